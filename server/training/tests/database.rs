//! The database: what is written is read, and nothing else is.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::Path;

use plica_training::*;
use tempfile::TempDir;

const HASH: &str = "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa";

fn example(index: u32, two_references: bool) -> Example {
    let field =
        |n: usize, scale: f32| -> Vec<[f32; 3]> { (0..n).map(|i| [scale * i as f32, index as f32, -scale]).collect() };
    let solve =
        SolveInfo { iterations: 6, indefinite_steps: 1, residual: 1e-10, smallest_jacobian: 0.123_456_789_012_345_67 };
    Example {
        displacements: field(5, 0.1),
        detail: field(7, 1e-3),
        independent_detail: two_references.then(|| field(7, 2e-3)),
        contact_point: [0.1, 0.2, 1.0 / 3.0],
        contact_frame: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        tool_pose: [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0],
        coarse_force: [0.0, 0.1, 9.0],
        tied_force: [0.0, 0.1, 4.0],
        independent_force: two_references.then_some([0.0, 0.1, 5.0]),
        record: Record {
            index,
            kind: "in_region".into(),
            tool: 0,
            depth_m: 0.004,
            drag_m: [0.001, 0.0, 0.0],
            settling: SettlingRecord { time_s: 0.4, motion_m: 1e-7, speed_m_per_s: 1e-6 },
            n_tied: 30,
            tied: solve,
            independent: two_references.then_some(solve),
            tied_unguarded: None,
            independent_unguarded: None,
            interaction_sha256: "b".repeat(64),
        },
    }
}

fn database(two_references: bool) -> Database {
    Database {
        about: About::new(HASH, if two_references { DatabaseKind::Evaluation } else { DatabaseKind::Training }, 42),
        examples: vec![example(0, two_references), example(2, two_references)],
        rejected: vec![Rejection {
            index: 1,
            kind: "in_region".into(),
            reason: Reason::TiedInverted,
            message: "smallest J is 0.010".into(),
            contact_point_m: [0.0; 3],
            depth_m: 0.01,
            drag_m: [0.0; 3],
            worth: None,
            interaction_sha256: "c".repeat(64),
        }],
    }
}

fn written(folder: &TempDir) -> (std::path::PathBuf, Vec<u8>) {
    let path = folder.path().join("database.safetensors");
    database(true).write(&path).unwrap();
    let bytes = fs::read(&path).unwrap();
    (path, bytes)
}

fn refusal(path: &Path) -> String {
    Database::read(path, Some(HASH)).unwrap_err().to_string()
}

/// Writes `bytes` with their header changed by `change`; offsets stay what they are.
fn with_header(path: &Path, bytes: &[u8], change: impl Fn(&str) -> String) {
    let n = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let header = change(std::str::from_utf8(&bytes[8..8 + n]).unwrap());
    let mut file = (header.len() as u64).to_le_bytes().to_vec();
    file.extend(header.as_bytes());
    file.extend(&bytes[8 + n..]);
    fs::write(path, file).unwrap();
}

#[test]
fn what_is_written_is_read_and_written_again_alike() {
    let folder = TempDir::new().unwrap();
    for two_references in [false, true] {
        let path = folder.path().join("a.safetensors");
        let original = database(two_references);
        original.write(&path).unwrap();
        let read = Database::read(&path, Some(HASH)).unwrap();
        assert_eq!(read, original);
        let again = folder.path().join("b.safetensors");
        read.write(&again).unwrap();
        assert!(fs::read(&path).unwrap() == fs::read(&again).unwrap());
    }
}

#[test]
fn the_file_is_plain_safetensors_with_one_metadata_key() {
    let folder = TempDir::new().unwrap();
    let (_, bytes) = written(&folder);
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
    let metadata = header.metadata().clone().unwrap();
    assert_eq!(metadata.keys().collect::<Vec<_>>(), ["plica"]);
    let shape = |name: &str| tensors.tensor(name).unwrap().shape().to_vec();
    assert_eq!((shape("u"), shape("d"), shape("d_independent")), (vec![2, 5, 3], vec![2, 7, 3], vec![2, 7, 3]));
    assert_eq!((shape("contact_frame"), shape("tool_pose")), (vec![2, 3, 3], vec![2, 7]));
    let json: serde_json::Value = serde_json::from_str(&metadata["plica"]).unwrap();
    assert_eq!(json["about"]["versions"]["tie"], plica_accurate::TIE_VERSION);
    assert_eq!(json["rejected"][0]["reason"], "tied_inverted");
    assert_eq!(json["examples"][1]["index"], 2);
}

#[test]
fn every_byte_counts() {
    let folder = TempDir::new().unwrap();
    let (path, bytes) = written(&folder);
    // One flipped bit anywhere: never read as if nothing had happened.
    for at in (0..bytes.len()).step_by(37) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        fs::write(&path, &damaged).unwrap();
        // Blanks that pad the header mean nothing, whatever blank they are.
        if let Ok(read) = Database::read(&path, Some(HASH)) {
            assert_eq!(read, database(true), "byte {at}");
            panic!("byte {at} was changed and nobody noticed");
        }
    }
}

#[test]
fn a_truncated_file_is_refused_wherever_it_ends() {
    let folder = TempDir::new().unwrap();
    let (path, bytes) = written(&folder);
    for length in [0, 4, 8, 100, bytes.len() / 2, bytes.len() - 1] {
        fs::write(&path, &bytes[..length]).unwrap();
        let message = refusal(&path);
        assert!(message.contains("truncated") && message.contains("database.safetensors"), "{message}");
    }
    fs::write(&path, [bytes.as_slice(), b"tail"].concat()).unwrap();
    assert!(refusal(&path).contains("truncated"), "{}", refusal(&path));
}

#[test]
fn headers_that_lie_are_refused() {
    let folder = TempDir::new().unwrap();
    let (path, bytes) = written(&folder);
    let cases: [(&str, &str, &str); 9] = [
        ("\\\"format\\\":\\\"plica-examples\\\"", "\\\"format\\\":\\\"plica-pictures\\\"", "not an example database"),
        ("\\\"format_version\\\":1", "\\\"format_version\\\":99", "format version 99"),
        ("\\\"tie\\\":1", "\\\"tie\\\":77", "tie version 77"),
        ("\\\"tandem\\\":1,", "", "tandem version unknown"),
        ("\\\"seed\\\":42", "\\\"seed\\\":43", "damaged"),
        ("\\\"seed\\\":42", "\\\"seed\\\":-1", "not an example database"),
        ("\\\"rejected\\\":[", "\\\"more\\\":[],\\\"rejected\\\":[", "not an example database"),
        ("\"__metadata__\":{\"plica\"", "\"__metadata__\":{\"plicb\"", "no metadata key `plica`"),
        ("\"dtype\":\"F32\",\"shape\":[2,5,3]", "\"dtype\":\"F32\",\"shape\":[3,5,2]", "damaged"),
    ];
    for (from, to, expected) in cases {
        with_header(&path, &bytes, |header| {
            assert!(header.contains(from), "{from} is not in {header}");
            header.replacen(from, to, 1)
        });
        let message = refusal(&path);
        assert!(message.contains(expected), "{from} -> {to}: {message}");
        assert!(message.contains("database.safetensors"), "{message}");
    }
}

#[test]
fn sizes_that_cannot_be_are_refused_without_taking_memory() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("database.safetensors");
    let huge = |length: u64, header: &str| {
        let mut bytes = length.to_le_bytes().to_vec();
        bytes.extend(header.as_bytes());
        fs::write(&path, bytes).unwrap();
        refusal(&path)
    };
    assert!(huge(u64::MAX, "{}").contains("truncated"));
    let shape = r#"{"u":{"dtype":"F32","shape":[4294967295,4294967295,3],"data_offsets":[0,8]}}"#;
    assert!(huge(shape.len() as u64, shape).contains("truncated, or not a safetensors file"));
    assert!(huge(2, "{}").contains("no metadata key"));
    let deep = format!("{{\"__metadata__\":{{\"plica\":\"{}\"}}}}", "[".repeat(100_000));
    assert!(huge(deep.len() as u64, &deep).contains("not an example database"));
}

/// A file whose checksum is right and whose content is not: whoever writes one must be told, too.
#[test]
fn consistent_nonsense_is_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("database.safetensors");
    let refused_when_read = |change: &dyn Fn(&mut Database)| {
        let mut database = database(true);
        change(&mut database);
        database.write(&path).unwrap();
        refusal(&path)
    };
    assert!(refused_when_read(&|d| d.examples[1].detail[3][1] = f32::NAN).contains("not finite"));
    assert!(refused_when_read(&|d| d.examples[0].tool_pose[6] = f64::INFINITY).contains("not finite"));
    assert!(refused_when_read(&|d| d.examples.swap(0, 1)).contains("not in the order"));
    assert!(refused_when_read(&|d| d.examples[0].record.independent = None).contains("two references"));
    let unequal = |change: &dyn Fn(&mut Database)| {
        let mut database = database(true);
        change(&mut database);
        database.write(&path).unwrap_err().to_string()
    };
    assert!(unequal(&|d| d.examples[1].detail.truncate(3)).contains("other sizes"));
    assert!(unequal(&|d| d.examples.clear()).contains("no example"));
}

#[test]
fn another_scene_and_a_missing_file_are_told_apart() {
    let folder = TempDir::new().unwrap();
    let (path, _) = written(&folder);
    let message = Database::read(&path, Some(&"d".repeat(64))).unwrap_err().to_string();
    assert!(message.contains("belongs to another scene") && message.contains("train again"), "{message}");
    let message = Database::read(&folder.path().join("none"), None).unwrap_err().to_string();
    assert!(message.contains("none") && message.contains("No such file"), "{message}");
}

/// Limits that the examples of this file fit.
fn limits() -> SceneLimits {
    SceneLimits { scene_hash: HASH.to_owned(), n_nodes: 5, n_skin: 7, lowest_m: [0.0; 3], highest_m: [3.0, 3.0, 3.0] }
}

/// A change of an example.
type Change<'a> = &'a dyn Fn(&mut Example);

fn read_for(path: &Path, limits: &SceneLimits) -> Result<Database, DatabaseError> {
    Database::read_for(RegularFile::open(path, MAX_DATABASE_BYTES).unwrap(), path, limits)
}

#[test]
fn numbers_that_the_object_cannot_have_are_refused_with_example_and_value() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("database.safetensors");
    let refused = |change: &dyn Fn(&mut Example)| {
        let mut database = database(true);
        change(&mut database.examples[1]);
        database.write(&path).unwrap();
        match read_for(&path, &limits()) {
            Ok(_) => String::new(),
            Err(error) => error.to_string(),
        }
    };
    assert_eq!(refused(&|_| {}), "");
    let turned = |angle: f64| [[angle.cos(), angle.sin(), 0.0], [-angle.sin(), angle.cos(), 0.0], [0.0, 0.0, 1.0]];
    assert_eq!(refused(&|e| e.contact_frame = turned(0.3)), "");
    assert_eq!(refused(&|e| e.detail[3] = [5.1, 0.0, 0.0]), "", "shorter than the diagonal of 5.196 m");
    let absurd: [(&str, Change<'_>); 11] = [
        ("d[3] is 5.300e0 m long", &|e| e.detail[3] = [5.3, 0.0, 0.0]),
        ("d[0] is 1.732e30 m long", &|e| e.detail[0] = [1e30; 3]),
        ("d[6] is ", &|e| e.detail[6] = [3e38; 3]),
        ("u[4] is 6.000e0 m long", &|e| e.displacements[4] = [0.0, -6.0, 0.0]),
        ("d_independent[1] is ", &|e| e.independent_detail.as_mut().unwrap()[1] = [9.0; 3]),
        ("contact_frame [[0.0, 0.0, 0.0]", &|e| e.contact_frame = [[0.0; 3]; 3]),
        ("contact_frame [[1e300", &|e| e.contact_frame = [[1e300; 3]; 3]),
        ("contact_frame", &|e| e.contact_frame[2] = [0.0, 0.0, -1.0]),
        ("contact_point [4.0, 0.0, 0.0] m lies off the object", &|e| e.contact_point = [4.0, 0.0, 0.0]),
        ("tool_pose is at [10000000000.0, ", &|e| e.tool_pose[0] = 1e10),
        ("quaternion of tool_pose has length 2e0", &|e| e.tool_pose[6] = 2.0),
    ];
    for (expected, change) in absurd {
        let message = refused(change);
        assert!(message.contains("example 2: ") && message.contains(expected), "{expected}: {message}");
    }
}

#[test]
fn sizes_of_another_scene_are_refused_before_the_examples_are_read() {
    let folder = TempDir::new().unwrap();
    let (path, bytes) = written(&folder);
    let other = SceneLimits { n_skin: 8, ..limits() };
    let message = read_for(&path, &other).unwrap_err().to_string();
    assert!(message.contains("tensor `d` is [2, 7, 3]") && message.contains("[2, 8, 3]"), "{message}");
    // The header is wrong in a way that the checksum would tell: sizes come first.
    let mut damaged = bytes.clone();
    *damaged.last_mut().unwrap() ^= 1;
    fs::write(&path, damaged).unwrap();
    assert!(read_for(&path, &other).unwrap_err().to_string().contains("[2, 8, 3]"));
    assert!(read_for(&path, &limits()).unwrap_err().to_string().contains("damaged"));
}

#[test]
fn a_sparse_file_is_refused_by_its_header_or_its_size() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("database.safetensors");
    let sparse = |bytes: u64| {
        fs::File::create(&path).unwrap().set_len(bytes).unwrap();
        refusal(&path)
    };
    assert!(sparse(1 << 30).contains("truncated, or not a safetensors file"));
    assert!(sparse(4 << 30).contains("has 4294967296 bytes; at most 1073741824 are read"));
}
