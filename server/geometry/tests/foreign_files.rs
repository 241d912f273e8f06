//! Mesh files as other programs write them: several pieces, ghost cells, cells of any order, marks, comments, line ends.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::path::Path;

use common::vtu::{Bar, file, piece};
use plica_geometry::import::{NamedMesh, ReadOptions, parse_mesh};

const LEFT: Bar = Bar { lower: [0.0; 3], upper: [20.0, 20.0, 20.0], divisions: [2; 3] };
const RIGHT: Bar = Bar { lower: [20.0, 0.0, 0.0], upper: [40.0, 20.0, 20.0], divisions: [2; 3] };
const WHOLE: Bar = Bar { lower: [0.0; 3], upper: [40.0, 20.0, 20.0], divisions: [4, 2, 2] };

fn read(bytes: &[u8]) -> Result<NamedMesh, String> {
    parse_mesh(Path::new("a.mesh"), bytes, ReadOptions::unit(1e-3)).map_err(|error| error.to_string())
}

fn check_bar(name: &str, bytes: &[u8]) -> NamedMesh {
    let read = read(bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert_eq!((read.mesh.n_nodes(), read.mesh.n_elements()), (45, 16), "{name}");
    assert!((read.mesh.volume() - 16e-6).abs() < 1e-15, "{name}");
    read
}

fn cell_data(name: &str, values: &[u32]) -> String {
    let values: Vec<String> = values.iter().map(u32::to_string).collect();
    format!(
        "<CellData>\n<DataArray type=\"UInt8\" Name=\"{name}\" format=\"ascii\">{}</DataArray>\n</CellData>\n",
        values.join(" ")
    )
}

#[test]
fn pieces_are_read_whole_and_their_common_nodes_are_one() {
    let empty = "<Piece NumberOfPoints=\"0\" NumberOfCells=\"0\">\n</Piece>\n";
    let [left, right] = [piece(&[LEFT], 12, ""), piece(&[RIGHT], 12, "")];
    for (name, pieces) in [
        ("two", format!("{left}{right}")),
        ("an empty one first", format!("{empty}{left}{right}")),
        ("an empty one between", format!("{left}{empty}{right}")),
    ] {
        let read = check_bar(name, file(&pieces).as_bytes());
        assert!(read.remarks[0].contains("2 pieces; 9 nodes"), "{name}: {:?}", read.remarks);
    }
    let one = check_bar("one and an empty one", file(&format!("{}{empty}", piece(&[WHOLE], 12, ""))).as_bytes());
    assert!(one.remarks.is_empty(), "{:?}", one.remarks);
    // Where coordinates differ in the last digits, nothing is guessed.
    let nearly = Bar { lower: [20.000_001, 0.0, 0.0], ..RIGHT };
    let refused = read(file(&format!("{left}{}", piece(&[nearly], 12, ""))).as_bytes()).unwrap_err();
    assert!(refused.contains("at 9 points several nodes") && refused.contains("merge_tolerance_m"), "{refused}");
    let apart = ReadOptions { metres_per_unit: 1e-3, merge_tolerance_m: Some(0.0) };
    let apart = parse_mesh(Path::new("a.vtu"), file(&format!("{left}{right}")).as_bytes(), apart).unwrap();
    assert_eq!(apart.mesh.n_nodes(), 54);
    assert!(apart.remarks[0].contains("at 9 points several nodes"), "{:?}", apart.remarks);
}

#[test]
fn cells_that_another_piece_owns_are_left_to_it_and_groups_span_pieces() {
    // The left piece repeats the first layer of the right one, as ParaView's ghost cells do.
    let layer = Bar { lower: [20.0, 0.0, 0.0], upper: [30.0, 20.0, 20.0], divisions: [1, 2, 2] };
    let ghosts = [[0; 8].as_slice(), &[1; 4]].concat();
    let left = piece(&[LEFT, layer], 12, &cell_data("vtkGhostType", &ghosts));
    let right = piece(&[RIGHT], 12, &cell_data("vtkGhostType", &[0; 8]));
    // The ghosts' own nodes go with them, and the bar is left.
    check_bar("ghosts", file(&format!("{left}{right}")).as_bytes());
    let [left, right] = [(LEFT, 1), (RIGHT, 2)].map(|(bar, material)| {
        piece(&[bar], 12, &cell_data("material", &[1, 1, 1, 1, material, material, material, material]))
    });
    let read = check_bar("groups", file(&format!("{left}{right}")).as_bytes());
    let n_hexes = |name: &str| read.groups.volume(name).unwrap().elements.len();
    assert_eq!((n_hexes("material=1"), n_hexes("material=2")), (12, 4));
}

#[test]
fn first_order_cells_of_higher_kinds_are_plain_ones() {
    for code in [12, 67, 72, 79] {
        check_bar(&code.to_string(), file(&piece(&[WHOLE], code, "")).as_bytes());
    }
    let wedges = read(file(&piece(&[WHOLE], 13, "")).as_bytes()).unwrap_err();
    assert!(wedges.contains("holds 16 wedges (prisms) (cell 0, type 13)"), "{wedges}");
    let mixed = piece(&[WHOLE], 12, "").replacen("12 12 12 12", "12 12 12 14", 1);
    let mixed = read(file(&mixed).as_bytes()).unwrap_err();
    assert!(mixed.contains("holds 1 pyramids beside 15 hexahedra (cell 3, type 14)"), "{mixed}");
    assert!(mixed.contains("Recombine") && !mixed.contains("xtract"), "a remedy must not lose a part: {mixed}");
    let parallel = "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid/></VTKFile>";
    assert!(read(parallel.as_bytes()).unwrap_err().contains("save it as one .vtu"));
}

/// The bar in Gmsh's format 2.2.
fn msh() -> String {
    let node = |x: usize, y: usize, z: usize| 1 + (z * 3 + y) * 5 + x;
    let grid =
        |n: [usize; 3]| (0..n[2]).flat_map(move |z| (0..n[1]).flat_map(move |y| (0..n[0]).map(move |x| [x, y, z])));
    let nodes = grid([5, 3, 3]).map(|[x, y, z]| format!("{} {} {} {}\n", node(x, y, z), 10 * x, 10 * y, 10 * z));
    let ring = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
    let hexes = grid([4, 2, 2]).enumerate().map(|(i, [x, y, z])| {
        let corners = ring.map(|[a, b, c]| node(x + a, y + b, z + c).to_string());
        format!("{} 5 2 1 1 {}\n", i + 1, corners.join(" "))
    });
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n45\n{}$EndNodes\n$Elements\n16\n{}$EndElements\n",
        nodes.collect::<String>(),
        hexes.collect::<String>()
    )
}

#[test]
fn marks_comments_and_line_ends_change_nothing() {
    let utf16 = |text: &str, bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
        std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(bytes).collect()
    };
    let vtu = format!("<?xml version=\"1.0\" encoding=\"UTF-16\"?>\n{}", file(&piece(&[WHOLE], 12, "")));
    let plain = file(&piece(&[WHOLE], 12, ""));
    for (format, text) in [("vtu", plain.clone()), ("msh", msh())] {
        check_bar(format, text.as_bytes());
        check_bar(format, format!("\u{feff}{text}").as_bytes());
        check_bar(format, text.replace('\n', "\r\n").as_bytes());
        check_bar(format, format!("\u{feff}{}", text.replace('\n', "\r\n")).as_bytes());
        check_bar(format, &utf16(&text, u16::to_le_bytes));
        check_bar(format, &utf16(&text, u16::to_be_bytes));
        check_bar(format, format!("\n\n{text}").as_bytes());
    }
    check_bar("declared UTF-16", &utf16(&vtu, u16::to_le_bytes));
    check_bar("XML comment", format!("<!-- made by hand -->\n{plain}").as_bytes());
    for comment in
        ["$Comments\nmade by hand\n$EndComments\n", "// made by hand\n", "# one\n# two\n", "made by hand\r\n\r\n"]
    {
        check_bar(comment, format!("{comment}{}", msh()).as_bytes());
    }
    let within = msh().replace("$Nodes", "$Comments\n$ and numbers 1 2 3\n$EndComments\n# note\n$Nodes");
    check_bar("comments within", within.as_bytes());
    assert!(read(b"$Comments\nno end").unwrap_err().contains("$Comments has no end"));
    assert!(read(b"$Comments\n$EndComments\n").unwrap_err().contains("has no $MeshFormat"));
}
