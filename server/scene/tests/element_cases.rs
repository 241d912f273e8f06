//! Cases of tetrahedra, of the exponential law and of fibres against closed forms. `--nocapture` prints figures of
//! docs/measured.md.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use plica_geometry::export::{Field, write_volume_vtu};
use plica_geometry::import::{ReadOptions, read_mesh};
use plica_scene::case::{Case, Problem, follow};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/cases")
}

/// The text of a case with parts replaced.
fn text(name: &str, changes: &[(&str, &str)]) -> String {
    let text = std::fs::read_to_string(folder().join(name)).unwrap();
    changes.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "`{from}` is not in {name}");
        text.replace(from, to)
    })
}

fn build(text: &str) -> Result<Problem, String> {
    let case = Case::parse(&folder().join("changed.toml"), text).map_err(|e| e.to_string())?;
    Problem::new(&case).map_err(|e| e.to_string())
}

/// Readings of probes by name.
struct Solved(Vec<(String, Vec<f64>)>);

impl Solved {
    fn probe(&self, name: &str) -> &[f64] {
        &self.0.iter().find(|(n, _)| n == name).unwrap().1
    }
}

fn solve(text: &str) -> Solved {
    let case = Case::parse(&folder().join("changed.toml"), text).unwrap();
    let problem = Problem::new(&case).unwrap();
    let solution = follow(&problem, &case.solve(), &mut |_| ControlFlow::Continue(())).unwrap();
    println!(
        "{} {}, {} Newton steps",
        problem.mesh().n_elements(),
        problem.mesh().kind().plural(),
        solution.iterations()
    );
    let read = |probe: &plica_scene::case::Probe| {
        (probe.name.clone(), probe.read(&problem, &solution).value.components().to_vec())
    };
    Solved(problem.probes().iter().map(read).collect())
}

#[track_caller]
fn assert_close(what: &str, found: f64, expected: f64, share: f64) {
    println!("{what}: {found:.6e}, closed form {expected:.6e}, off by {:.3} %", 100.0 * (found / expected - 1.0));
    assert!((found - expected).abs() <= share * expected.abs(), "{what}: {found} is not {expected} within {share}");
}

/// Hoop stress over `p` of a ring with circular fibres, 10 and 20 mm, `k^2 = E_f/E` \[Lek68, art. 37\].
fn hoop(r_m: f64, k: f64) -> f64 {
    let (c, share) = (0.5_f64, r_m / 0.02);
    k * c.powf(k + 1.0) / (1.0 - c.powf(2.0 * k)) * (share.powf(k - 1.0) + share.powf(-k - 1.0))
}

#[test]
fn a_ring_of_circular_fibres_stretches_as_lekhnitskii_says() {
    let ring = solve(&text("ring.toml", &[]));
    let k = 7.0_f64.sqrt();
    assert_close("ring, inner displacement", ring.probe("inner")[0], 1e3 * 0.01 / 140e6 * hoop(0.01, k), 5e-3);
    assert_close("ring, hoop stress inside", ring.probe("inner stress")[1], 1e3 * hoop(0.01, k), 0.02);
    assert_close("ring, hoop stress in the middle", ring.probe("middle stress")[1], 1e3 * hoop(0.015, k), 0.01);
}

/// Directions of a cell array of the mesh file give the same as circles around the axis, and are named where they are absent.
#[test]
fn fibres_of_a_cell_array_are_those_around_an_axis() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = read_mesh(&self::folder().join("ring.msh"), ReadOptions::unit(1e-3)).unwrap().mesh;
    let around = |element| Vector3::z().cross(&mesh.centre_of(element).coords) * 30.0;
    let directions: Vec<_> = mesh.elements().map(around).collect();
    let file = folder.path().join("ring.vtu");
    write_volume_vtu(&file, &mesh, &[], &[Field::Vectors("fibre", &directions)]).unwrap();
    let named = format!("file = {:?}", file);
    let changes = [
        ("file = \"ring.msh\"", named.as_str()),
        ("metres_per_unit = 1e-3", ""),
        ("about = { axis = [0.0, 0.0, 1.0] }", "array = \"fibre\""),
        ("{ group = \"inner\" }", "{ where = \"sqrt(x * x + y * y) < 0.0101\" }"),
    ];
    let (found, expected) = (solve(&text("ring.toml", &changes)), solve(&text("ring.toml", &[])));
    assert_close("ring, of an array", found.probe("inner")[0], expected.probe("inner")[0], 1e-9);
    let other = text("ring.toml", &changes).replace("\"fibre\"", "\"fiber\"");
    let message = build(&other).unwrap_err();
    assert!(
        message.contains("fibres.array: no cell array `fiber` of three components; the mesh has `fibre`"),
        "{message}"
    );
    let none = text("ring.toml", &[("about = { axis = [0.0, 0.0, 1.0] }", "array = \"fibre\"")]);
    assert!(build(&none).unwrap_err().contains("the mesh has none"));
}

#[test]
fn a_thick_sphere_of_gmshs_tetrahedra_stretches_as_lame_says() {
    let sphere = solve(&text("thick-sphere.toml", &[]));
    assert_close("sphere, inner displacement", sphere.probe("inner")[0], 8.0e-6, 5e-3);
    let at = |r: f64| (8e-6 / r.powi(3) - 1.0, 1.0 + 4e-6 / r.powi(3));
    let (_, hoop) = at(0.02);
    assert_close("sphere, hoop stress outside", sphere.probe("outer stress")[1], 1e3 / 7.0 * hoop, 0.03);
    let r = Vector3::new(0.009, 0.009, 0.008);
    let (inward, hoop) = at(r.norm());
    let stress = sphere.probe("middle stress");
    let n = r.normalize();
    // n . s n of xx, yy, zz, xy, yz, xz.
    let radial = n.x * n.x * stress[0]
        + n.y * n.y * stress[1]
        + n.z * n.z * stress[2]
        + 2.0 * (n.x * n.y * stress[3] + n.y * n.z * stress[4] + n.x * n.z * stress[5]);
    let trace = stress[0] + stress[1] + stress[2];
    assert_close("sphere, radial stress in the middle", radial, -1e3 / 7.0 * inward, 0.02);
    assert_close("sphere, hoop stress in the middle", (trace - radial) / 2.0, 1e3 / 7.0 * hoop, 0.01);
}

/// A bar that hangs by its top, of tetrahedra: `rho g L^2/2E`, and the weight at the ceiling.
#[test]
fn weight_and_moments_act_on_tetrahedra() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../geometry/tests/data/tet10-4.1.msh");
    let bar = format!(
        "[mesh]\nfile = {file:?}\nmetres_per_unit = 1e-3\n[material]\nmodel = \"linear\"\nyoung_modulus_pa = 1e5\n\
         poisson_ratio = 0.0\ndensity_kg_per_m3 = 1000.0\n[[supports]]\nname = \"wall\"\nselect = {{ face = \"x_min\" }}\n\
         [[loads]]\nname = \"load\"\nselect = {{ LOAD }}\n[[probes]]\nname = \"end\"\nquantity = \"displacement\"\n\
         select = {{ face = \"x_max\" }}\n[[probes]]\nname = \"wall\"\nquantity = \"force\"\nsupport = \"wall\"\n\
         [[probes]]\nname = \"moment\"\nquantity = \"moment\"\nsupport = \"wall\"\n"
    );
    let hung = solve(&bar.replace("{ LOAD }", "{ where = \"x >= 0\" }\ngravity_m_per_s2 = [9.81, 0.0, 0.0]"));
    assert_close("own weight, end", hung.probe("end")[0], 1000.0 * 9.81 * 4e-4 / 2e5, 1e-6);
    assert_close("own weight, wall", hung.probe("wall")[0], -1000.0 * 9.81 * 2e-6, 1e-9);
    let twisted = solve(&bar.replace("{ LOAD }", "{ group = \"end\" }\nmoment_n_m = [1e-6, 0.0, 0.0]"));
    assert_close("twisted, wall", twisted.probe("moment")[0], -1e-6, 1e-6);
}

#[test]
fn linear_tetrahedra_come_with_a_word_about_locking_and_tools_need_hexahedra() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../geometry/tests/data/tetrahedra.msh");
    let mesh = format!("file = {file:?}");
    let linear = text(
        "thick-sphere.toml",
        &[("file = \"thick-sphere.msh\"", &mesh), ("{ group = \"inner\" }", "{ face = \"x_max\" }")],
    );
    let probes = linear.find("[[probes]]").unwrap();
    let problem = build(&linear[..probes]).unwrap();
    assert!(problem.remarks().iter().any(|r| r.contains("4-node tetrahedra lock") && r.contains("10-node")));
    let tool = "[[tools]]\nname = \"ball\"\nshape = { ball = { radius_m = 0.02 } }\nposition_m = [0.0, 0.0, 1.0]\n";
    let message = build(&format!("{}{tool}", text("thick-sphere.toml", &[]))).err().unwrap();
    assert!(message.contains("tools: touch a mesh of 10-node tetrahedra; mesh the body with hexahedra"), "{message}");
}

#[test]
fn bad_materials_are_named() {
    let exponential = "model = \"exponential\"\nexponent = 5.0\nyoung_modulus_pa = 1e6\npoisson_ratio = 0.3";
    let sphere = |material: &str| {
        let old = "model = \"linear\"\nyoung_modulus_pa = 1e6\npoisson_ratio = 0.3";
        build(&text("thick-sphere.toml", &[(old, material)])).err().unwrap_or_default()
    };
    assert_eq!(sphere(exponential), "");
    let ring = |from: &str, to: &str| build(&text("ring.toml", &[(from, to)])).err().unwrap_or_default();
    let fibres = "fibres = { fibre_modulus_pa = 140e6, about = { axis = [0.0, 0.0, 1.0] } }";
    for (message, parts) in [
        (sphere(&exponential.replace("exponent = 5.0\n", "")), ["material.exponent", "is missing"]),
        (sphere(&exponential.replace("exponent = 5.0", "exponent = -1.0")), ["material.exponent", "0.001 to 10000"]),
        (sphere(&exponential.replace("\"exponential\"", "\"linear\"")), ["material.exponent", "has no meaning"]),
        (ring(fibres, ""), ["material.fibres", "is missing"]),
        (ring("140e6", "14e6"), ["fibre_modulus_pa", "below young_modulus_pa"]),
        (ring("[0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0]"), ["fibres.about.axis", "has length 0"]),
        (ring("about = {", "direction = [1.0, 0.0, 0.0], about = {"), ["material.fibres", "exactly one of direction"]),
        (
            ring("young_modulus_pa = 20e6\npoisson_ratio = 0.0", "mu_pa = 1e6\nlambda_pa = 1e6"),
            ["material.mu_pa", "no meaning"],
        ),
        (ring("\"fibre_reinforced\"", "\"linear\""), ["material.fibres", "has no meaning"]),
    ] {
        assert!(message.starts_with("changed.toml:") || message.contains("changed.toml:"), "{message}");
        parts.iter().for_each(|part| assert!(message.contains(part), "`{part}` in: {message}"));
    }
}

/// The force on the exponential law's ball grows faster than on a Neo-Hookean one of the same modulus.
#[test]
fn a_ball_in_liver_meets_more_and_more_force() {
    let force = |changes: &[(&str, &str)]| -solve(&text("liver.toml", changes)).probe("ball")[2] * 4.0;
    let half = ("motion_m = [0.0, 0.0, -2e-3]", "motion_m = [0.0, 0.0, -1e-3]");
    let plain = ("model = \"exponential\"\nexponent = 60.0", "model = \"compressible_neo_hookean\"");
    let slope = |deep: f64, shallow: f64| (deep / shallow).log2();
    let [liver, rubber] = [slope(force(&[]), force(&[half])), slope(force(&[plain]), force(&[plain, half]))];
    println!(
        "ball of 4 mm, 1 to 2 mm deep: log-log slope {liver:.3} of the exponential law, {rubber:.3} of the Neo-Hookean one"
    );
    assert!(liver > 1.8 && (1.3..1.6).contains(&rubber), "{liver} {rubber}");
}
