//! Small VTU files made in a test.

use std::fmt::Write;

/// A box of hexahedra with nodes of its own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bar {
    pub(crate) lower: [f64; 3],
    pub(crate) upper: [f64; 3],
    pub(crate) divisions: [usize; 3],
}

impl Bar {
    fn points(&self) -> Vec<[f64; 3]> {
        let [nx, ny, nz] = self.divisions;
        let at = |i: [usize; 3]| {
            std::array::from_fn(|k| {
                let share = i[k] as f64 / self.divisions[k] as f64;
                self.lower[k] * (1.0 - share) + self.upper[k] * share
            })
        };
        let grid = (0..=nz).flat_map(|z| (0..=ny).flat_map(move |y| (0..=nx).map(move |x| [x, y, z])));
        grid.map(at).collect()
    }

    fn hexes(&self) -> Vec<[usize; 8]> {
        let [nx, ny, nz] = self.divisions;
        let node = |x: usize, y: usize, z: usize| (z * (ny + 1) + y) * (nx + 1) + x;
        let grid = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        let ring = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
        grid.map(|[x, y, z]| ring.map(|[a, b, c]| node(x + a, y + b, z + c))).collect()
    }
}

/// One piece that holds all bars.
pub(crate) fn vtu(bars: &[Bar]) -> String {
    file(&piece(bars, 12, ""))
}

/// `<VTKFile>` around pieces.
pub(crate) fn file(pieces: &str) -> String {
    format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\n<UnstructuredGrid>\n{pieces}\
         </UnstructuredGrid>\n</VTKFile>\n"
    )
}

/// A piece of bars as cells of type `code`; `data` stands behind the cells.
pub(crate) fn piece(bars: &[Bar], code: u32, data: &str) -> String {
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    for bar in bars {
        let first = points.len();
        points.extend(bar.points());
        cells.extend(bar.hexes().into_iter().map(|hex| hex.map(|node| node + first)));
    }
    let mut text = String::new();
    let array = |text: &mut String, head: &str, words: Vec<String>| {
        writeln!(text, "<DataArray {head} format=\"ascii\">\n{}\n</DataArray>", words.join(" ")).unwrap();
    };
    writeln!(text, "<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<Points>", points.len(), cells.len()).unwrap();
    let coordinates = points.iter().flatten().map(f64::to_string).collect();
    array(&mut text, "type=\"Float64\" NumberOfComponents=\"3\"", coordinates);
    text += "</Points>\n<Cells>\n";
    let connectivity = cells.iter().flatten().map(usize::to_string).collect();
    array(&mut text, "type=\"Int64\" Name=\"connectivity\"", connectivity);
    array(&mut text, "type=\"Int64\" Name=\"offsets\"", (1..=cells.len()).map(|n| (8 * n).to_string()).collect());
    array(&mut text, "type=\"UInt8\" Name=\"types\"", vec![code.to_string(); cells.len()]);
    text + "</Cells>\n" + data + "</Piece>\n"
}
