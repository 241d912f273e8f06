//! Bytes to examples. Nothing in a file is trusted.

use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, Metadata as Header, SafeTensors};
use serde_json::Value;

use super::plausible::SceneLimits;
use super::tensors::{NO_CHECKSUM, checksum};
use super::{Database, FORMAT, FORMAT_VERSION, MAX_DATABASE_BYTES, METADATA_KEY, Metadata, versions};
use crate::database_error::DatabaseError;
use crate::example::Example;
use crate::regular_file::RegularFile;

/// Largest header: names and shapes of the tensors, and a record of each example.
const MAX_HEADER_BYTES: u64 = 16 << 20;
/// Bytes of the header's length.
const LENGTH_BYTES: u64 = 8;

impl Database {
    /// Reads and checks a file; with `scene_hash` it must belong to that scene.
    ///
    /// # Errors
    /// See [`DatabaseError`].
    pub fn read(path: &Path, scene_hash: Option<&str>) -> Result<Self, DatabaseError> {
        let open = RegularFile::open(path, MAX_DATABASE_BYTES);
        let open = open.map_err(|fault| DatabaseError::File { path: path.to_owned(), fault })?;
        read(open, &BeingRead { path }, scene_hash, None)
    }

    /// Reads an open file that errors call `path`, and checks it against a scene: hash and sizes before the examples are
    /// read, then all numbers.
    ///
    /// # Errors
    /// See [`DatabaseError`].
    pub fn read_for(open: RegularFile, path: &Path, scene: &SceneLimits) -> Result<Self, DatabaseError> {
        read(open, &BeingRead { path }, Some(&scene.scene_hash), Some(scene))
    }
}

fn read(
    mut open: RegularFile,
    file: &BeingRead<'_>,
    scene_hash: Option<&str>,
    scene: Option<&SceneLimits>,
) -> Result<Database, DatabaseError> {
    let fault = |fault| DatabaseError::File { path: file.path(), fault };
    let mut bytes = open.read_next(LENGTH_BYTES).map_err(fault)?;
    let header_bytes = file.header_bytes(&bytes, open.bytes())?;
    let text = open.read_next(header_bytes).map_err(fault)?;
    let header: Header = serde_json::from_slice(&text).map_err(|e| file.malformed(e.to_string()))?;
    if Some(open.bytes()) != (LENGTH_BYTES + header_bytes).checked_add(header.data_len() as u64) {
        return Err(file.malformed(format!("its header does not describe {} bytes", open.bytes())));
    }
    let key = header.metadata().as_ref().and_then(|m| m.get(METADATA_KEY));
    let key = key.ok_or_else(|| file.foreign(format!("there is no metadata key `{METADATA_KEY}`")))?;
    let metadata = file.metadata(key, scene_hash)?;
    if let Some(scene) = scene {
        let kept = |name: &str| header.info(name).map(|info| info.shape.as_slice());
        let checked = scene.check_sizes(metadata.examples.len(), header.data_len(), kept);
        checked.map_err(|problem| file.inconsistent(problem))?;
    }
    bytes.extend(text);
    open.read_rest(&mut bytes).map_err(fault)?;
    let tensors = SafeTensors::deserialize(&bytes).map_err(|e| file.malformed(e.to_string()))?;
    file.check_sum(key, &metadata.sha256, &tensors)?;
    let arrays = Arrays { file, tensors: &tensors, n: metadata.examples.len() };
    let examples = arrays.examples(&metadata)?;
    if let Some(scene) = scene {
        let checked = examples.iter().try_for_each(|example| scene.check_numbers(example));
        checked.map_err(|problem| file.inconsistent(problem))?;
    }
    Ok(Database { about: metadata.about, examples, rejected: metadata.rejected })
}

/// The file that errors name.
struct BeingRead<'a> {
    path: &'a Path,
}

impl BeingRead<'_> {
    fn path(&self) -> PathBuf {
        self.path.to_owned()
    }

    /// Length of the header, from the first bytes of a file of `file_bytes`.
    fn header_bytes(&self, first: &[u8], file_bytes: u64) -> Result<u64, DatabaseError> {
        let length = first.try_into().map(u64::from_le_bytes);
        let length = length.map_err(|_| self.malformed(format!("it has {file_bytes} bytes")))?;
        if length > file_bytes - LENGTH_BYTES {
            return Err(self.malformed(format!("its header should have {length} bytes, the file has {file_bytes}")));
        }
        if length > MAX_HEADER_BYTES {
            return Err(self.malformed(format!("its header has {length} bytes; at most {MAX_HEADER_BYTES} are read")));
        }
        Ok(length)
    }

    fn malformed(&self, problem: String) -> DatabaseError {
        DatabaseError::Malformed { path: self.path(), problem }
    }

    fn foreign(&self, problem: String) -> DatabaseError {
        DatabaseError::Foreign { path: self.path(), problem }
    }

    fn inconsistent(&self, problem: String) -> DatabaseError {
        DatabaseError::Inconsistent { path: self.path(), problem }
    }

    /// Format and versions before anything else, so that an old file is told from a broken one.
    fn metadata(&self, text: &str, scene_hash: Option<&str>) -> Result<Metadata, DatabaseError> {
        let value: Value = serde_json::from_str(text).map_err(|e| self.foreign(format!("its metadata: {e}")))?;
        if value["format"] != FORMAT {
            return Err(self.foreign(format!("its format is {}, not \"{FORMAT}\"", value["format"])));
        }
        let known =
            versions().into_iter().map(|(what, known)| (value["about"]["versions"][&what].clone(), what, known));
        let format = (value["format_version"].clone(), "format".to_owned(), FORMAT_VERSION);
        for (found, what, known) in std::iter::once(format).chain(known) {
            if found != known {
                let found = if found.is_null() { "unknown".to_owned() } else { found.to_string() };
                return Err(DatabaseError::Version { path: self.path(), what, found, known });
            }
        }
        let metadata: Metadata =
            serde_json::from_value(value).map_err(|e| self.foreign(format!("its metadata: {e}")))?;
        match scene_hash {
            Some(expected) if expected != metadata.about.scene_hash => Err(DatabaseError::OtherScene {
                path: self.path(),
                found: metadata.about.scene_hash,
                expected: expected.to_owned(),
            }),
            _ => Ok(metadata),
        }
    }

    fn check_sum(&self, text: &str, expected: &str, tensors: &SafeTensors<'_>) -> Result<(), DatabaseError> {
        let blank = text.replacen(&format!("\"sha256\":\"{expected}\""), &format!("\"sha256\":\"{NO_CHECKSUM}\""), 1);
        let mut names = tensors.names();
        names.sort_unstable();
        let views: Vec<_> = names.into_iter().filter_map(|n| tensors.tensor(n).ok().map(|t| (n, t))).collect();
        let found = checksum(&blank, views.iter().map(|(n, t)| (*n, t.dtype(), t.shape(), t.data())));
        if found == expected {
            return Ok(());
        }
        Err(DatabaseError::Damaged { path: self.path(), found, expected: expected.to_owned() })
    }
}

/// The tensors of a file with `n` examples.
struct Arrays<'a> {
    file: &'a BeingRead<'a>,
    tensors: &'a SafeTensors<'a>,
    n: usize,
}

impl Arrays<'_> {
    fn examples(&self, metadata: &Metadata) -> Result<Vec<Example>, DatabaseError> {
        let has_independent = self.check_records(metadata)?;
        let (u, d) = (self.vectors("u")?, self.vectors("d")?);
        let optional = |name| if has_independent { self.vectors(name).map(Some) } else { Ok(None) };
        let independent = optional("d_independent")?;
        if independent.as_ref().is_some_and(|i| i.iter().zip(&d).any(|(i, d)| i.len() != d.len())) {
            return Err(self.file.inconsistent("d_independent has another number of vertices than d".into()));
        }
        let [points, forces, tied] = ["contact_point", "force_coarse", "force_tied"].map(|n| self.small::<3>(n, &[3]));
        let (points, forces, tied) = (points?, forces?, tied?);
        let frames = self.small::<9>("contact_frame", &[3, 3])?;
        let poses = self.small::<7>("tool_pose", &[7])?;
        let independent_forces = if has_independent { Some(self.small::<3>("force_independent", &[3])?) } else { None };
        let mut large = u.into_iter().zip(d);
        let mut independent = independent.map(Vec::into_iter);
        let mut examples = Vec::with_capacity(self.n);
        for (i, record) in metadata.examples.iter().enumerate() {
            let (displacements, detail) = large.next().unwrap_or_default();
            let example = Example {
                displacements,
                detail,
                independent_detail: independent.as_mut().and_then(Iterator::next),
                contact_point: points[i],
                contact_frame: std::array::from_fn(|r| std::array::from_fn(|c| frames[i][3 * r + c])),
                tool_pose: poses[i],
                coarse_force: forces[i],
                tied_force: tied[i],
                independent_force: independent_forces.as_ref().map(|f| f[i]),
                record: record.clone(),
            };
            if !example.is_finite() {
                return Err(self
                    .file
                    .inconsistent(format!("example {} holds numbers that are not finite", record.index)));
            }
            examples.push(example);
        }
        Ok(examples)
    }

    /// Whether the examples hold the accurate model's own contact: all of them or none.
    fn check_records(&self, metadata: &Metadata) -> Result<bool, DatabaseError> {
        let records = &metadata.examples;
        if !records.windows(2).all(|pair| pair[0].index < pair[1].index) {
            return Err(self.file.inconsistent("examples are not in the order of their interactions".into()));
        }
        let n_independent = records.iter().filter(|r| r.independent.is_some()).count();
        if n_independent != 0 && n_independent != records.len() {
            return Err(self
                .file
                .inconsistent(format!("{n_independent} of {} examples have two references", records.len())));
        }
        Ok(n_independent > 0)
    }

    /// `[n, any, 3]` in single precision.
    fn vectors(&self, name: &str) -> Result<Vec<Vec<[f32; 3]>>, DatabaseError> {
        let view = self.tensors.tensor(name).map_err(|e| self.file.inconsistent(e.to_string()))?;
        let per_example = match *view.shape() {
            [n, rows, 3] if n == self.n && rows > 0 && view.dtype() == Dtype::F32 => rows,
            _ => return Err(self.wrong(name, view.dtype(), view.shape(), "F32", "rows, 3")),
        };
        let (words, _) = view.data().as_chunks::<4>();
        let vectors: Vec<[f32; 3]> = words.as_chunks::<3>().0.iter().map(|v| v.map(f32::from_le_bytes)).collect();
        Ok(vectors.chunks(per_example).map(<[_]>::to_vec).collect())
    }

    /// `[n, shape...]` in double precision, `N` numbers per example.
    fn small<const N: usize>(&self, name: &str, shape: &[usize]) -> Result<Vec<[f64; N]>, DatabaseError> {
        let view = self.tensors.tensor(name).map_err(|e| self.file.inconsistent(e.to_string()))?;
        if view.dtype() != Dtype::F64 || view.shape().first() != Some(&self.n) || view.shape()[1..] != *shape {
            let shape: Vec<_> = shape.iter().map(ToString::to_string).collect();
            return Err(self.wrong(name, view.dtype(), view.shape(), "F64", &shape.join(", ")));
        }
        let (words, _) = view.data().as_chunks::<8>();
        Ok(words.as_chunks::<N>().0.iter().map(|v| v.map(f64::from_le_bytes)).collect())
    }

    fn wrong(&self, name: &str, dtype: Dtype, shape: &[usize], wanted: &str, rest: &str) -> DatabaseError {
        let n = self.n;
        self.file.inconsistent(format!("tensor `{name}` is {dtype} {shape:?}, {wanted} [{n}, {rest}] is needed"))
    }
}
