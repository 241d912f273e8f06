//! Writes frames as safetensors, one at a time: memory does not grow with their number.
//!
//! Arrays: `positions [n_frames, n_skin, 3]` f32, `time_s [n_frames]` f64, `tick [n_frames]` u64, `confidence [n_frames]`
//! f32, `force [n_frames, n_tools, 3]` f64, `proxy [n_frames, n_tools, 7]` f64 (position, then quaternion `xyzw`).

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use plica_daemon::realtime::Frame;
use plica_daemon::wire::position_and_xyzw;
use plica_sim::ToolReading;
use safetensors::Dtype;
use safetensors::tensor::{Metadata, TensorInfo};

/// Sizes, known before the first frame.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// Frames that will be written.
    pub n_frames: usize,
    /// Skin vertices.
    pub n_skin: usize,
    /// Tools.
    pub n_tools: usize,
}

/// A file that grows by a frame at a time. The small arrays stand before the positions and are written at the end.
pub struct FramesFile {
    out: BufWriter<File>,
    small_start: u64,
    time_s: Vec<u8>,
    tick: Vec<u8>,
    force: Vec<u8>,
    proxy: Vec<u8>,
    confidence: Vec<u8>,
    shape: Shape,
    written: usize,
}

impl FramesFile {
    /// Writes the header and leaves room for the small arrays.
    pub fn create(path: &Path, shape: Shape) -> std::io::Result<Self> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let mut out = BufWriter::new(File::create(path)?);
        let (header, positions_start) = header(shape)?;
        out.write_all(&(header.len() as u64).to_le_bytes())?;
        out.write_all(&header)?;
        let small_start = 8 + header.len() as u64;
        out.seek(SeekFrom::Start(small_start + positions_start as u64))?;
        Ok(Self {
            out,
            small_start,
            time_s: Vec::new(),
            tick: Vec::new(),
            force: Vec::new(),
            proxy: Vec::new(),
            confidence: Vec::new(),
            shape,
            written: 0,
        })
    }

    /// Adds a frame.
    pub fn write(&mut self, frame: &Frame, tools: &[ToolReading]) -> std::io::Result<()> {
        for x in frame.positions.iter().flatten() {
            self.out.write_all(&x.to_le_bytes())?;
        }
        self.time_s.extend(frame.sim_time_s.to_le_bytes());
        self.tick.extend(frame.tick.to_le_bytes());
        self.confidence.extend(frame.confidence.to_le_bytes());
        for tool in tools {
            self.force.extend(tool.force_n.iter().flat_map(|x| x.to_le_bytes()));
            let (position, orientation) = position_and_xyzw(&tool.proxy);
            self.proxy.extend(position.iter().chain(&orientation).flat_map(|x| x.to_le_bytes()));
        }
        self.written += 1;
        Ok(())
    }

    /// Writes the small arrays.
    pub fn finish(mut self) -> std::io::Result<()> {
        if self.written != self.shape.n_frames {
            let message = format!("{} frames were written, {} were promised", self.written, self.shape.n_frames);
            return Err(std::io::Error::other(message));
        }
        self.out.seek(SeekFrom::Start(self.small_start))?;
        // In the order of the header.
        for array in [&self.time_s, &self.tick, &self.force, &self.proxy, &self.confidence] {
            self.out.write_all(array)?;
        }
        self.out.flush()
    }
}

/// The header, padded to 8 bytes, and where the positions start behind it.
fn header(shape: Shape) -> std::io::Result<(Vec<u8>, usize)> {
    let Shape { n_frames, n_skin, n_tools } = shape;
    let arrays = [
        ("time_s", Dtype::F64, vec![n_frames], 8),
        ("tick", Dtype::U64, vec![n_frames], 8),
        ("force", Dtype::F64, vec![n_frames, n_tools, 3], 8),
        ("proxy", Dtype::F64, vec![n_frames, n_tools, 7], 8),
        ("confidence", Dtype::F32, vec![n_frames], 4),
        ("positions", Dtype::F32, vec![n_frames, n_skin, 3], 4),
    ];
    let mut start = 0;
    let mut positions_start = 0;
    let mut tensors = Vec::new();
    for (name, dtype, shape, size) in arrays {
        let end = start + size * shape.iter().product::<usize>();
        tensors.push((name.to_owned(), TensorInfo { dtype, shape, data_offsets: (start, end) }));
        positions_start = start;
        start = end;
    }
    let metadata = Metadata::new(None, tensors).map_err(std::io::Error::other)?;
    let mut header = ordered_json(&metadata)?;
    header.resize(header.len().next_multiple_of(8), b' ');
    Ok((header, positions_start))
}

/// The crate writes its map in random order; the same input must give the same bytes.
fn ordered_json(metadata: &Metadata) -> std::io::Result<Vec<u8>> {
    let sorted: serde_json::Value = serde_json::to_value(metadata)?;
    Ok(serde_json::to_vec(&sorted)?)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use safetensors::SafeTensors;

    use super::*;

    #[test]
    fn the_crate_reads_back_what_was_streamed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.safetensors");
        let shape = Shape { n_frames: 3, n_skin: 2, n_tools: 0 };
        let mut file = FramesFile::create(&path, shape).unwrap();
        for tick in 1..=3 {
            let positions = vec![[tick as f32; 3], [0.5; 3]];
            file.write(&Frame { tick, sim_time_s: 1e-3 * tick as f64, positions, ..Frame::default() }, &[]).unwrap();
        }
        file.finish().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        let positions = tensors.tensor("positions").unwrap();
        assert_eq!(positions.shape(), [3, 2, 3]);
        assert_eq!(positions.data()[24..28], 2.0_f32.to_le_bytes());
        assert_eq!(tensors.tensor("tick").unwrap().data()[16..], 3_u64.to_le_bytes());
        assert_eq!(tensors.tensor("proxy").unwrap().shape(), [3, 0, 7]);
    }

    #[test]
    fn too_few_frames_are_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let file =
            FramesFile::create(&folder.path().join("few.safetensors"), Shape { n_frames: 2, n_skin: 1, n_tools: 0 })
                .unwrap();
        assert!(file.finish().unwrap_err().to_string().contains("0 frames were written, 2"));
    }
}
