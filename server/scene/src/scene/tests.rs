#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;

use super::*;

/// The built-in scene with `from` replaced by `to`; the message that comes out, and the line on which `to` stands.
fn message_and_line(from: &str, to: &str) -> (String, usize) {
    assert!(BUILT_IN_SCENE.contains(from), "`{from}` is not in the built-in scene");
    let text = BUILT_IN_SCENE.replacen(from, to, 1);
    let line = 1 + text[..text.find(to).unwrap()].matches('\n').count();
    let error = Config::parse(Path::new("bad.toml"), &text).expect_err(to);
    (error.to_string(), line)
}

#[test]
fn the_built_in_scene_is_the_wedge_of_the_design() {
    let config = Config::built_in().unwrap();
    assert_eq!(config.name(), "wedge");
    assert_eq!(config.object().mesh().extents_m(), [0.12, 0.06, 0.04]);
    assert_eq!(config.object().material().young_modulus_pa, 3e4);
    assert_eq!(config.object().divisions(), [8, 4, 4]);
    assert_eq!(config.tools()[0].friction, 0.8);
    assert_eq!(config.runtime().timestep_s(), 1e-3);
}

/// The built-in scene writes out what it would get anyway, so that it documents the defaults.
#[test]
fn the_built_in_scene_writes_the_defaults() {
    let config = Config::built_in().unwrap();
    let bare = |text: &str, from: &str, to: &str| {
        let (start, end) = (text.find(from).unwrap(), text.find(to).unwrap());
        format!("{}{}", &text[..start], &text[end..])
    };
    let text = bare(BUILT_IN_SCENE, "[contact]", "[bench]");
    let text = bare(&text, "[objects.wedge.coarse]", "[objects.wedge.skin]");
    let bare = Config::parse(Path::new("bare.toml"), &text).unwrap();
    assert_eq!(bare.contact(), config.contact());
    assert_eq!(bare.sleep(), config.sleep());
    assert_eq!(bare.object().solver(), config.object().solver());
    assert_eq!(bare.object().substeps(), config.object().substeps());
    assert_eq!(bare.runtime().realtime_priority(), config.runtime().realtime_priority());
}

/// Enrichment of the built-in scene with the line of its method replaced.
fn enrichment_with(lines: &str) -> EnrichmentConfig {
    let from = "method = \"kriging-stamp\"";
    assert!(BUILT_IN_SCENE.contains(from), "{from}");
    let text = BUILT_IN_SCENE.replacen(from, &format!("{lines}\n"), 1);
    Config::parse(Path::new("scenes/wedge.toml"), &text).unwrap().enrichment
}

#[test]
fn enrichment_reads() {
    use plica_sim::enrichment::{Coordinates, EnrichmentOptions, Interpolator};
    let own = Config::built_in().unwrap().enrichment;
    assert_eq!(own, EnrichmentConfig { options: EnrichmentOptions::default(), database: None });
    assert_eq!(enrichment_with(""), own, "left out, the method is the default");
    let overrides = "texels = 16\nmodes = 8\nradius_cells = 3\nfade = false\ncoordinates = \"orthogonal\"";
    let changed = enrichment_with(overrides).options;
    assert_eq!((changed.field.texels, changed.field.modes, changed.radius_cells), (16, 8, 3.0));
    assert_eq!((changed.fade, changed.coordinates), (false, Coordinates::Orthogonal));
    let changed = enrichment_with("interpolation = \"warp\"\nmethod = \"ridge\"").options;
    assert_eq!((changed.correlator.family(), changed.field.interpolator), ("ridge", Interpolator::Warp));
    let named = enrichment_with("database = \"wedge.safetensors\"").database;
    assert_eq!(named.as_deref(), Some(Path::new("scenes/wedge.safetensors")));
}

/// A name in a scene gives the options that `evaluate` and `chart` measure under that name; so does its family with the interpolation.
#[test]
fn a_scene_serves_the_method_that_is_measured_under_its_name() {
    use plica_training::evaluation::methods;
    let axes = Config::built_in().unwrap().training().stamp_axes;
    for measured in methods(axes) {
        let name = &measured.name;
        assert_eq!(enrichment_with(&format!("method = \"{name}\"")).options, measured.options, "{name}");
        if let [family, interpolation] = name.split('-').collect::<Vec<_>>()[..] {
            let both = format!("method = \"{family}\"\ninterpolation = \"{interpolation}\"");
            assert_eq!(enrichment_with(&both).options, measured.options, "{name}");
        }
    }
}

/// Rows of the accuracy table that describe a method in words.
const DESCRIBED: [(&str, &str); 4] = [
    ("coarse skin", ""),
    ("the same without control variate", "kriging-stamp-plain"),
    ("the same, projected orthogonally as in the paper", "kriging-stamp-orthogonal"),
    ("ssh12-vector, Eq. 10 as printed", "ssh12-vector-literal"),
];

/// Methods in the first column of the published accuracy table.
fn published_methods() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let texts =
        ["docs/measured.md", "README.md"].map(|file| std::fs::read_to_string(root.join(file)).unwrap_or_default());
    let header = "| method | E in the region |";
    let text = texts.iter().find(|text| text.contains(header)).expect("an accuracy table");
    let rows =
        text.lines().skip_while(|line| !line.starts_with(header)).skip(2).take_while(|line| line.starts_with('|'));
    let name = |row: &str| {
        let cell = row.split('|').nth(1).unwrap().trim().replace(['*', '`'], "");
        let described = DESCRIBED.iter().find(|(words, _)| *words == cell).map(|(_, name)| (*name).to_owned());
        described.unwrap_or_else(|| cell.split([' ', ',']).next().unwrap().to_owned())
    };
    rows.map(name).filter(|name| !name.is_empty()).collect()
}

#[test]
fn every_method_of_the_published_accuracy_table_can_be_configured() {
    let published = published_methods();
    assert!(published.len() >= 14, "{published:?}");
    for name in published {
        let axes = Config::built_in().unwrap().training().stamp_axes;
        let measured = plica_training::evaluation::methods(axes).into_iter().find(|m| m.name == name);
        let measured = measured.unwrap_or_else(|| panic!("`{name}` is published and has no row"));
        assert_eq!(enrichment_with(&format!("method = \"{name}\"")).options, measured.options);
    }
}

#[test]
fn the_peer_wedge_reads() {
    let text = include_str!("../../../../configs/scenes/peer-wedge.toml");
    let config = Config::parse(Path::new("peer-wedge.toml"), text).unwrap();
    assert_eq!(config.bench().unwrap().duration_s(), 1.0);
}

/// Each bad file gives one message that names file, line, key, what is allowed, and what to do.
#[test]
fn every_bad_file_gives_one_clear_message() {
    let cases: &[(&str, &str, &[&str])] = &[
        (
            "poisson_ratio = 0.45",
            "poisson_ratio = 0.7",
            &["material.poisson_ratio", "0.7", "0 to 0.499", "Poisson's ratio [-]"],
        ),
        ("young_modulus_pa = 3e4", "young_modulus_pa = nan", &["young_modulus_pa", "10 to 1000000000"]),
        ("young_modulus_pa = 3e4", "young_modulus_kpa = 30", &["unknown field `young_modulus_kpa`", "expected"]),
        ("young_modulus_pa = 3e4", "young_modulus_pa = \"stiff\"", &["young_modulus_pa", "invalid type", "string"]),
        ("length_m = 0.12 ", "length_m = -1.0 ", &["mesh.length_m", "0.001 to 10"]),
        ("generator = \"wedge\" ", "generator = \"cone\" ", &["mesh.generator", "unknown variant `cone`", "wedge"]),
        ("divisions = [8, 4, 4]", "divisions = [100, 100, 100]", &["coarse.divisions", "1000000", "1 to 20000"]),
        ("divisions = [8, 4, 4]", "divisions = [8, 4]", &["coarse.divisions", "length"]),
        ("faces = [\"z_min\"]", "faces = [\"bottom\"]", &["fixed", "unknown variant `bottom`", "z_min"]),
        ("planes = []", "planes = [{ point_m = [0, 0, 0], normal = [0, 0, 0] }]", &["planes.0.normal", "floor"]),
        ("spacing_m = 0.00122", "spacing_m = 0.00011", &["skin.spacing_m", "at most 300000"]),
        ("publish_hz = 90.0", "publish_hz = 2000.0", &["publish.publish_hz", "1 to 1000"]),
        ("format = \"f32\"", "format = \"f16\"", &["unknown variant `f16`", "`i16`"]),
        ("friction = 0.8", "friction = 3.0", &["tools.probe.friction", "0 to 2"]),
        ("coupling = \"spring\"", "coupling = \"rigid\"", &["has no meaning with coupling = \"rigid\"", "remove"]),
        ("sampling = \"latest\" ", "sampling = \"interpolate\" ", &["tools.probe.delay_ms", "is missing", "add"]),
        ("[0.0, 0.0, 0.0, 1.0] }\ntool_from", "[0.0, 0.0, 0.0, 2.0] }\ntool_from", &["rotation_xyzw", "0.99 to 1.01"]),
        ("radius_m = 0.007", "radius_m = 0.0", &["tools.probe.shape.capsule.radius_m", "0.0005 to 0.5"]),
        (
            "capsule = { radius_m = 0.007, length_m = 0.1 }",
            "convex_hull = { points_m = [[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [0.01, 0.01, 0]] }",
            &["tools.probe.shape.convex_hull.points_m", "the hull of 4 points has no volume", "plane"],
        ),
        ("stale_after_ms = 200.0", "stale_after_s = 0.2", &["tools.probe.stale_after_s", "unknown field"]),
        ("max_contacts = 32", "max_contacts = 0", &["contact.max_contacts", "1 to 256"]),
        ("timestep_s = 0.001", "timestep_s = 1.0", &["runtime.timestep_s", "0.0001 to 0.02"]),
        ("realtime_priority = 60", "realtime_priority = 100", &["runtime.realtime_priority", "0 to 99"]),
        ("{ tool = \"probe\", time_s = 0.3", "{ tool = \"prob\", time_s = 0.3", &["motion.1.tool", "`prob`", "probe"]),
        ("{ tool = \"probe\", time_s = 0.3", "{ tool = \"probe\", time_s = 0.7", &["time_s", "order"]),
        ("divisions = [32, 16, 8]", "divisions = [999, 999, 999]", &["accurate.divisions", "1 to 1000000"]),
        ("poisson_ratio = 0.48", "poisson_ratio = 0.5", &["accurate.poisson_ratio", "0 to 0.4999"]),
        ("\"stable_neo_hookean\"", "\"rubber\"", &["accurate.model", "unknown variant `rubber`", "linear"]),
        ("compliance_m = 2e-5", "compliance_m = 0", &["tie.compliance_m", "0.00000001 to 0.01"]),
        ("rim_floor = 1e-4", "rim = 1e-4", &["tie.rim", "unknown field `rim`", "rim_floor"]),
        ("tool = \"probe\"  ", "tool = \"drill\"  ", &["training.tool", "no tool `drill`", "name one of: probe"]),
        (
            "approach = \"vertical\"",
            "approach = \"sideways\"",
            &["approach", "\"vertical\", \"normal\", or a direction"],
        ),
        ("approach = \"vertical\"", "approach = [0, 0, 0]", &["training.approach", "no direction"]),
        ("depth_share = [0.1, 0.35]", "depth_share = [0.35, 0.1]", &["training.depth_share", "smaller number first"]),
        ("drag_share = 0.66", "drag_share = 1.66", &["training.drag_share", "0 to 1"]),
        ("seed = 2 ", "seed = 1 ", &["evaluation.seed", "seed of training", "choose another"]),
        ("name = \"lift\"", "name = \"a lift\"", &["evaluation.outside.1.name"]),
        (
            "action = \"lift\", examples = 15",
            "action = \"lift\", drag_share = 1, examples = 15",
            &["drag_share", "remove"],
        ),
        ("candidates_per_example = 2", "candidates_per_example = 1", &["candidates_per_example", "2 to 1000"]),
        (
            "method = \"kriging-stamp\"",
            "method = \"krigging\"",
            &["enrichment.method", "no method `krigging`", "ssh12-vector", "choose"],
        ),
        (
            "# interpolation = \"stamp\"",
            "interpolation = \"blend\"",
            &["enrichment.interpolation", "`blend` contradicts method = \"kriging-stamp\"", "remove"],
        ),
        ("# texels = 32", "texels = 1000", &["enrichment.texels", "8 to 256"]),
        ("# modes = 32", "modes = 0", &["enrichment.modes", "1 to 100000"]),
        ("# radius_cells = 7.0", "radius_cells = 0.1", &["enrichment.radius_cells", "0.5 to 64"]),
        ("# fade = true", "fading = true", &["enrichment.fading", "unknown field `fading`", "fade"]),
    ];
    for (from, to, fragments) in cases {
        let (message, line) = message_and_line(from, to);
        assert!(message.starts_with("bad.toml:"), "{message}");
        assert!(!message.contains('\n'), "one line: {message}");
        for fragment in *fragments {
            assert!(message.contains(fragment), "`{fragment}` is missing in: {message}");
        }
        let named: usize = message.split(':').nth(1).unwrap().parse().unwrap();
        if message.contains("outside the allowed range") {
            assert_eq!(named, line, "{message}");
        }
        assert!((line.saturating_sub(20)..=line + 1).contains(&named), "line {line} expected: {message}");
    }
}

#[test]
fn a_second_object_is_refused() {
    let second = BUILT_IN_SCENE.replace("objects.wedge", "objects.other");
    let second = &second[..second.find("# --- The tools").unwrap()];
    let error = Config::parse(Path::new("bad.toml"), &format!("{BUILT_IN_SCENE}\n{second}")).unwrap_err();
    assert!(error.to_string().contains("exactly one object"), "{error}");
}

#[test]
fn text_that_is_not_toml_names_its_line() {
    let error = Config::parse(Path::new("bad.toml"), "[objects.wedge\nmesh = 1\n").unwrap_err();
    assert!(error.to_string().starts_with("bad.toml:1: not valid TOML"), "{error}");
}

#[test]
fn a_missing_file_says_so() {
    let error = Config::from_file(Path::new("no-such.toml")).unwrap_err();
    assert!(error.to_string().starts_with("no-such.toml: cannot be read"), "{error}");
}

#[test]
fn bench_motion_is_piecewise_linear() {
    let config = Config::built_in().unwrap();
    let at = |t| config.bench().unwrap().pose(0, t).unwrap().translation.vector;
    assert_eq!(at(-1.0), at(0.0));
    assert_eq!(at(9.0), at(1.0));
    assert!((at(0.15).z - 0.5 * (0.037 + 0.0285)).abs() < 1e-12);
}
