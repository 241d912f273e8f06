//! Draws `tests/convergence.json` into an SVG:
//!
//! `cargo run --release -p plica-accurate --example convergence_chart -- docs/accurate-convergence.svg`

use std::error::Error;

use plotters::prelude::*;
use serde_json::Value;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/convergence.json");

/// Key in the file, name in the picture, colour and size of the marks: the lines nearly coincide.
const MATERIALS: [(&str, &str, RGBColor, i32); 3] = [
    ("Linear", "linear", RGBColor(0, 90, 160), 8),
    ("CompressibleNeoHookean", "compressible Neo-Hookean", RGBColor(220, 90, 0), 5),
    ("StableNeoHookean", "stable Neo-Hookean", RGBColor(0, 130, 80), 2),
];

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("say where to write the SVG")?;
    let stored: Value = serde_json::from_str(&std::fs::read_to_string(FILE)?)?;
    // Along x stands the logarithm to base 2, so that labels fall on the meshes.
    let places: Vec<f64> = numbers(&stored["cells"]).into_iter().map(f64::log2).collect();
    let area = SVGBackend::new(&path, (760, 460)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption("Accurate solids: error against a known solution, nu = 0.45", ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(42)
        .y_label_area_size(62)
        .build_cartesian_2d(0.8..4.2, (2e-4..0.4_f64).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("hexahedra along an edge")
        .y_desc("relative error")
        .x_labels(4)
        .x_label_formatter(&|x: &f64| format!("{:.0}", x.exp2()))
        .y_label_formatter(&|y| format!("{y:.0e}"))
        .light_line_style(BLACK.mix(0.05))
        .draw()?;
    for (key, name, colour, size) in MATERIALS {
        for (norm, what) in [("l2", "displacement"), ("h1", "gradient")] {
            let points: Vec<_> = places.iter().copied().zip(numbers(&stored["materials"][key][norm])).collect();
            let style = if norm == "l2" { colour.filled() } else { colour.stroke_width(2) };
            chart.draw_series(LineSeries::new(points.clone(), colour.stroke_width(1)))?;
            chart
                .draw_series(points.into_iter().map(|point| Circle::new(point, size, style)))?
                .label(format!("{name}, {what}"))
                .legend(move |(x, y)| Circle::new((x + 9, y), size.min(5), style));
        }
    }
    for (order, start, above) in [(1.0, 0.32, 1.3), (2.0, 0.05, 0.6)] {
        let slope = [1.0, 4.0].map(|x: f64| (x, start * ((1.0 - x) * order).exp2()));
        let style = BLACK.mix(0.5).stroke_width(1);
        chart.draw_series(DashedLineSeries::new(slope, 4, 4, style))?;
        let text =
            Text::new(format!("order {order}"), (3.45, above * start * (-2.45 * order).exp2()), ("sans-serif", 13));
        chart.draw_series([text])?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.2))
        .draw()?;
    area.present()?;
    Ok(())
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().map_or_else(Vec::new, |list| list.iter().filter_map(Value::as_f64).collect())
}
