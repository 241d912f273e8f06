//! Size limits of the bus.

pub use plica_protocol::rpc::{MAX_SNAPSHOTS, MAX_STEP_POSES};
use plica_protocol::skin::{SkinFlags, SkinHeader};
use plica_scene::Config;
use plica_scene::scene::PositionFormat;

/// Largest frame in bytes; the transmit queue holds little more, and a larger frame would never arrive.
pub const MAX_FRAME_BYTES: u64 = 1_000_000;

/// A skin frame that does not fit the transmit queue.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{file}: a skin frame has {bytes} bytes, at most {MAX_FRAME_BYTES} reach a client; set objects.{object}.publish.format = \
     \"i16\", or normals = false, or a larger skin.spacing_m"
)]
pub struct FrameTooLarge {
    /// The scene.
    pub file: String,
    /// The object.
    pub object: String,
    /// Length of a frame.
    pub bytes: u64,
}

/// Length of a skin frame of `n_skin` vertices.
pub fn frame_bytes(config: &Config, n_skin: usize) -> u64 {
    let publish = config.object().publish();
    let flags = SkinFlags {
        normals: publish.normals,
        offsets_i16: publish.format == PositionFormat::I16,
        ..SkinFlags::default()
    };
    SkinHeader { n_vertices: n_skin as u32, flags, ..SkinHeader::default() }.frame_bytes()
}

/// Refuses a scene whose frames would never arrive.
pub fn check_frame(config: &Config, n_skin: usize) -> Result<(), FrameTooLarge> {
    let bytes = frame_bytes(config, n_skin);
    if bytes <= MAX_FRAME_BYTES {
        return Ok(());
    }
    let (file, object) = (config.file().display().to_string(), config.object().name().to_owned());
    Err(FrameTooLarge { file, object, bytes })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use std::path::Path;

    use super::*;
    use plica_scene::BUILT_IN_SCENE;

    #[test]
    fn frames_beyond_a_megabyte_need_sixteen_bits() {
        let config = Config::built_in().unwrap();
        assert_eq!(frame_bytes(&config, 6_900), 64 + 12 * 6_900);
        assert!(check_frame(&config, 83_000).is_ok());
        assert!(check_frame(&config, 84_000).unwrap_err().to_string().contains("format = \"i16\""));
        let short = BUILT_IN_SCENE.replace("format = \"f32\"", "format = \"i16\"");
        let config = Config::parse(Path::new("short.toml"), &short).unwrap();
        assert!(check_frame(&config, 160_000).is_ok());
    }
}
