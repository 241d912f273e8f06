//! Files with random faults: whatever a reader meets, it answers with a result or a sentence.
//!
//! `cargo test --release --workspace --test mutated_files` reads a hundred of each kind;
//! `PLICA_MUTATIONS=10000 cargo test --release --workspace --test mutated_files -- --nocapture` ten thousand.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use plica_client::recording::{self, Kind, Recorded, Recorder};
use plica_geometry::export::write_vtu;
use plica_geometry::import::{ReadOptions, parse_mesh, parse_obj_parts};
use plica_geometry::shapes;
use plica_protocol::pose::{Pose, gate};
use plica_scene::Config;
use plica_scene::case::Case;
use plica_training::Database;
use tempfile::TempDir;

/// Longest that one file may take: a bound on hangs, not on speed.
const PATIENCE: Duration = Duration::from_secs(20);
/// Largest memory of the process \[KiB\].
const MOST_KIB: u64 = 2 << 20;
/// Words that are likely to find something.
const WORDS: [&[u8]; 16] = [
    b"-1",
    b"0",
    b"1e308",
    b"NaN",
    b"inf",
    b"99999999999999999999",
    b"4294967296",
    b"\0",
    b"\xff\xfe",
    b"\"",
    b"[[",
    b"}",
    b"<",
    b"\n",
    b"\r",
    b",",
];

/// xorshift64*.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// A copy of `bytes` with one fault, or up to eight: bits flipped, runs cut out, doubled, moved, overwritten, words put in, the end cut off.
fn mutated(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut out = bytes.to_vec();
    let n_faults = if random.below(3) == 0 { 1 + random.below(8) } else { 1 };
    for _ in 0..n_faults {
        let at = random.below(out.len());
        let run = at..(at + 1 + random.below(24)).min(out.len());
        match random.below(8) {
            0 if !out.is_empty() => out[at] ^= 1 << random.below(8),
            1 => drop(out.drain(run)),
            2 => out.splice(at..at, bytes[random.below(bytes.len())..].iter().take(64).copied()).for_each(drop),
            3 => out.truncate(at),
            4 => run.for_each(|i| out[i] = random.next() as u8),
            // A digit of a number is the likeliest to be believed.
            5 => {
                let digits: Vec<usize> = (0..out.len()).filter(|i| out[*i].is_ascii_digit()).collect();
                if let Some(i) = digits.get(random.below(digits.len())) {
                    out[*i] = b'0' + random.below(10) as u8;
                }
            }
            _ => out.splice(at..at, WORDS[random.below(WORDS.len())].iter().copied()).for_each(drop),
        }
    }
    out
}

/// Reads mutations of each base and says how many were taken; the reader says whether it took one.
fn hammer(kind: &str, bases: &[PathBuf], mut read: impl FnMut(&Path, &[u8]) -> bool) {
    let n: usize = std::env::var("PLICA_MUTATIONS").map_or(100, |n| n.parse().unwrap());
    let folder = TempDir::new().unwrap();
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (mut taken, mut longest) = (0, Duration::ZERO);
    for i in 0..n {
        let base = &bases[i % bases.len()];
        let bytes = mutated(&fs::read(base).unwrap(), &mut random);
        let path = folder.path().join(base.file_name().unwrap());
        fs::write(&path, &bytes).unwrap();
        let start = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| read(&path, &bytes)));
        let took = start.elapsed();
        if outcome.is_err() || took > PATIENCE {
            let kept = std::env::temp_dir().join(format!("plica-mutated-{i}-{}", base.file_name().unwrap().display()));
            fs::copy(&path, &kept).unwrap();
            panic!("{kind} {i}: a panic, or {took:?}; the file is kept as {}", kept.display());
        }
        taken += usize::from(outcome.unwrap());
        longest = longest.max(took);
    }
    println!("{n} {kind}: {taken} taken, {} refused, {longest:.1?} at the longest", n - taken);
    assert!(taken < n, "no mutation of {kind} is refused");
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().split(' ').next()?.parse::<u64>().ok());
    assert!(peak.is_none_or(|kib| kib < MOST_KIB), "{peak:?} KiB");
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Files of a folder with one of the extensions; none where the folder is absent.
fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        println!("{} is absent: none of its files is mutated", folder.display());
        return Vec::new();
    };
    let mut found: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    found.retain(|path| extensions.iter().any(|e| path.extension().is_some_and(|extension| extension == *e)));
    found.sort();
    found
}

fn shared_cases(kind: &str, extensions: &[&str]) -> Vec<PathBuf> {
    files(&repository().join("../shared/cases").join(kind), extensions)
}

#[test]
fn scenes() {
    hammer("scenes", &files(&repository().join("configs/scenes"), &["toml"]), |path, bytes| {
        std::str::from_utf8(bytes).is_ok_and(|text| Config::parse(path, text).is_ok())
    });
}

#[test]
fn cases() {
    hammer("cases", &files(&repository().join("configs/cases"), &["toml"]), |path, bytes| {
        std::str::from_utf8(bytes).is_ok_and(|text| Case::parse(path, text).is_ok())
    });
}

#[test]
fn meshes() {
    let folder = TempDir::new().unwrap();
    let bar = folder.path().join("block.vtu");
    write_vtu(&bar, &shapes::block([0.04, 0.02, 0.01], [3, 2, 1]), &[], &[]).unwrap();
    let ascii = folder.path().join("two.msh");
    fs::write(&ascii, TWO_HEXAHEDRA).unwrap();
    let mut bases = vec![bar, ascii];
    bases.extend(shared_cases("mesh", &["msh", "vtu"]));
    hammer("meshes", &bases, |path, bytes| parse_mesh(path, bytes, ReadOptions::unit(1.0)).is_ok());
}

/// Gmsh 4.1, ASCII.
const TWO_HEXAHEDRA: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 12 1 12\n3 1 0 12\n1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n11\n12\n0 0 0\n1 0 0\n1 1 0\n\
    0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n2 0 0\n2 1 0\n2 0 1\n2 1 1\n$EndNodes\n$Elements\n1 2 1 2\n3 1 5 2\n1 1 2 3 4 5 6 7 8\n2 2 9 10 3 6 11 12 7\n$EndElements\n";

#[test]
fn tools() {
    let folder = TempDir::new().unwrap();
    let corner = folder.path().join("corner.obj");
    fs::write(&corner, "o corner\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n").unwrap();
    let mut bases = vec![corner];
    bases
        .extend(shared_cases("tools", &["obj"]).into_iter().filter(|path| fs::metadata(path).unwrap().len() < 1 << 17));
    hammer("tool meshes", &bases, |_, bytes| parse_obj_parts(bytes, 1e-3).is_ok());
}

#[test]
fn motions() {
    let mut bases = files(&repository().join("configs/poses"), &["csv", "tum"]);
    bases.extend(shared_cases("poses", &["csv", "tum"]));
    hammer("motions", &bases, |path, _| plica_trajectory::read(path, Default::default(), gate).is_ok());
}

#[test]
fn recordings() {
    let folder = TempDir::new().unwrap();
    let base = folder.path().join("poses.mcap");
    let mut recorder = Recorder::create(&base).unwrap();
    for i in 0..40 {
        let bytes = Pose { sequence: i, ..Pose::default() }.encode().to_vec();
        let key = "plica/v1/main/tool/probe/pose".to_owned();
        recorder.write(&Recorded { key, kind: Kind::Pose, log_time_ns: 1000 * i, bytes }).unwrap();
    }
    recorder.finish().unwrap();
    hammer("recordings", &[base], |path, _| recording::read(path, &[Kind::Pose]).is_ok());
}

#[test]
fn databases() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("block.toml"), BLOCK).unwrap();
    let mut plicad = Command::new(env!("CARGO_BIN_EXE_plicad"));
    let trained = plicad.args(["train", "block.toml", "--folder", "job"]).current_dir(folder.path()).output().unwrap();
    assert!(trained.status.success(), "{}", String::from_utf8_lossy(&trained.stderr));
    let base = folder.path().join("job/database.safetensors");
    hammer("databases", &[base], |path, _| Database::read(path, None).is_ok());
}

/// An interaction takes a fraction of a second.
const BLOCK: &str = r#"
[objects.block]
mesh = { generator = "block", size_m = [0.04, 0.04, 0.02] }
material = { young_modulus_pa = 3e4, poisson_ratio = 0.45, density_kg_per_m3 = 1000.0 }
supports = { fixed = { faces = ["z_min"] } }
coarse = { divisions = [3, 3, 2] }
skin = { spacing_m = 0.004 }
accurate = { divisions = [6, 6, 3], poisson_ratio = 0.48 }
[objects.block.training]
examples = 2
contact_regions = [{ min_m = [0.012, 0.012, 0.0], max_m = [0.028, 0.028, 1.0] }]
depth_share = [0.1, 0.2]
drag_m = [0.0, 0.002]
[tools.rod]
shape = { capsule = { radius_m = 0.006, length_m = 0.1 } }
friction = 0.8
"#;
