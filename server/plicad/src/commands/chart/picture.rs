//! The chart as SVG: time to the right, error up, both logarithmic.

mod labels;

use std::path::Path;

use anyhow::anyhow;
use plica_training::evaluation::COARSE;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::configuration::FAMILIES;
use super::points::{Chart, Point};

use labels::{Box2, place};

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Width and height of the picture \[px\].
const SIZE: (u32, u32) = (1060, 620);
/// Left, top, right and bottom of the plot \[px\].
const FRAME: [f64; 4] = [74.0, 56.0, 700.0, 560.0];
/// Left edge of the lists \[px\].
const LISTS_X: i32 = 724;
const COLOURS: [RGBColor; FAMILIES.len()] = [
    RGBColor(90, 90, 90),
    RGBColor(0, 100, 175),
    RGBColor(215, 95, 0),
    RGBColor(0, 140, 95),
    RGBColor(165, 65, 150),
    RGBColor(190, 150, 0),
];
const FRONT: RGBColor = RGBColor(200, 30, 45);

/// Points and the front in the picture.
struct Plotted<'a> {
    drawn: &'a [&'a Point],
    /// By rising time.
    front: &'a [&'a Point],
    /// Corners of the line along the front \[px\].
    stairs: &'a [(f64, f64)],
}

/// Logarithmic scales: values to pixels.
struct Scales {
    /// Range \[us\].
    x: [f64; 2],
    /// Range \[mm\].
    y: [f64; 2],
}

/// Draws the points whose ticks fit the time step; slower ones are named below.
pub(super) fn draw(chart: &Chart, file: &Path) -> anyhow::Result<()> {
    paint(chart, file).map_err(|e| anyhow!("{}: cannot be drawn: {e}", file.display()))
}

fn paint(chart: &Chart, file: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::new(file, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let (drawn, slow): (Vec<&Point>, Vec<&Point>) = chart.points.iter().partition(|p| p.tick_us() < chart.timestep_us);
    let scales = Scales::around(&drawn, chart.timestep_us);
    let title = format!(
        "{}: speed against accuracy, {} held-out states in the trained region",
        chart.scene, chart.held_out_states
    );
    text(&area, &title, (FRAME[0], 24.0), 17, HPos::Left, &BLACK)?;
    grid(&area, &scales)?;
    let front = drawn_front(chart, &drawn);
    let stairs = staircase(&scales, &front);
    line(&area, &stairs, FRONT.mix(0.7).stroke_width(2))?;
    for p in &drawn {
        let (x, y) = scales.pixel(p);
        let colour = colour(p);
        let style = if p.examples == 0 { colour.stroke_width(2) } else { colour.mix(0.75).filled() };
        area.draw(&Circle::new((x as i32, y as i32), if p.examples == 0 { 5 } else { 4 }, style))?;
        if p.on_front {
            area.draw(&Circle::new((x as i32, y as i32), 7, FRONT.stroke_width(2)))?;
        }
    }
    name_points(&area, &scales, &Plotted { drawn: &drawn, front: &front, stairs: &stairs })?;
    lists(&area, chart, &front)?;
    if !slow.is_empty() {
        let names: Vec<_> = slow.iter().map(|p| format!("{} ({:.1} ms)", p.name, 1e-3 * p.tick_us())).collect();
        let note = format!("slower than the time step, not drawn: {}", names.join(", "));
        text(&area, &note, (FRAME[0], 608.0), 11, HPos::Left, &BLACK.mix(0.6))?;
    }
    area.present()?;
    Ok(())
}

/// Points of the front that are drawn, by rising time.
fn drawn_front<'a>(chart: &Chart, drawn: &[&'a Point]) -> Vec<&'a Point> {
    chart.front.iter().filter_map(|name| drawn.iter().find(|p| p.name == *name).copied()).collect()
}

impl Scales {
    fn around(points: &[&Point], longest_us: f64) -> Self {
        let range = |f: &dyn Fn(&Point) -> f64| {
            points.iter().map(|p| f(p)).fold([f64::INFINITY, 0.0_f64], |[low, high], v| [low.min(v), high.max(v)])
        };
        let (x, y) = (range(&|p| p.tick_us()), range(&|p| p.independent_mm));
        Self { x: [0.85 * x[0], (1.25 * x[1]).min(longest_us.max(x[1]))], y: [0.88 * y[0], 1.15 * y[1]] }
    }

    fn pixel(&self, p: &Point) -> (f64, f64) {
        (self.x_of(p.tick_us()), self.y_of(p.independent_mm))
    }

    fn x_of(&self, us: f64) -> f64 {
        FRAME[0] + (us / self.x[0]).ln() / (self.x[1] / self.x[0]).ln() * (FRAME[2] - FRAME[0])
    }

    fn y_of(&self, mm: f64) -> f64 {
        FRAME[3] - (mm / self.y[0]).ln() / (self.y[1] / self.y[0]).ln() * (FRAME[3] - FRAME[1])
    }
}

/// Round numbers of a range: one, two, three and five times powers of ten.
fn round_numbers([low, high]: [f64; 2]) -> Vec<f64> {
    let powers = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let all = powers.flat_map(|power| [1.0, 1.5, 2.0, 3.0, 5.0, 7.0].map(|m| m * 10_f64.powi(power)));
    all.filter(|v| (low..=high).contains(v)).collect()
}

fn grid(area: &Area<'_>, scales: &Scales) -> Result<(), Box<dyn std::error::Error>> {
    let [left, top, right, bottom] = FRAME;
    let light = BLACK.mix(0.1);
    for us in round_numbers(scales.x) {
        let x = scales.x_of(us);
        line(area, &[(x, top), (x, bottom)], light.into())?;
        text(area, &format!("{us:.0}"), (x, bottom + 13.0), 12, HPos::Center, &BLACK)?;
    }
    for mm in round_numbers(scales.y) {
        let y = scales.y_of(mm);
        line(area, &[(left, y), (right, y)], light.into())?;
        text(area, &format!("{}", (1e4 * mm).round() / 1e4), (left - 6.0, y), 12, HPos::Right, &BLACK)?;
    }
    line(area, &[(left, top), (left, bottom), (right, bottom)], BLACK.mix(0.6).into())?;
    text(
        area,
        "tick: simulation and enrichment [us]",
        (0.5 * (left + right), bottom + 32.0),
        13,
        HPos::Center,
        &BLACK,
    )?;
    text(
        area,
        "median error against the accurate model's own contact [mm]",
        (14.0, top - 14.0),
        13,
        HPos::Left,
        &BLACK,
    )?;
    Ok(())
}

/// Corners of the front as a staircase: the least error within a time.
fn staircase(scales: &Scales, front: &[&Point]) -> Vec<(f64, f64)> {
    let mut corners: Vec<(f64, f64)> = Vec::new();
    for p in front {
        let (x, y) = scales.pixel(p);
        corners.extend(corners.last().map(|last| (x, last.1)));
        corners.push((x, y));
    }
    corners.extend(corners.last().map(|last| (FRAME[2], last.1)));
    corners
}

/// Numbers at the points of the front; names at others where there is room.
fn name_points(area: &Area<'_>, scales: &Scales, plotted: &Plotted<'_>) -> Result<(), Box<dyn std::error::Error>> {
    let Plotted { drawn, front, stairs } = plotted;
    let radius = |p: &Point| if p.on_front { 9.0 } else { 5.0 };
    let mut taken: Vec<Box2> = drawn.iter().map(|p| Box2::around(scales.pixel(p), [radius(p); 2])).collect();
    taken.extend(stairs.windows(2).map(|pair| Box2::spanning(pair[0], pair[1])));
    let numbers = front.iter().enumerate().map(|(i, p)| ((i + 1).to_string(), *p, FRONT, 13));
    let names = drawn.iter().filter(|p| !p.on_front);
    let names = names.map(|p| (p.name.replace(&format!("{COARSE}, "), ""), *p, colour(p), 10));
    for (label, point, colour, size) in numbers.chain(names) {
        let at = scales.pixel(point);
        let extent = [0.25 * f64::from(size) * label.len() as f64 + 1.0, 0.5 * f64::from(size) + 1.0];
        let Some(spot) = place(at, extent, &taken, FRAME) else { continue };
        if let Some(end) = spot.leader(at) {
            line(area, &[at, end], colour.mix(0.4).into())?;
        }
        text(area, &label, spot.centre(), size, HPos::Center, &colour)?;
        taken.push(spot);
    }
    Ok(())
}

/// Legend of the colours and list of the front, right of the plot.
fn lists(area: &Area<'_>, chart: &Chart, front: &[&Point]) -> Result<(), Box<dyn std::error::Error>> {
    let x = f64::from(LISTS_X);
    let mut y = FRAME[1];
    text(area, "what is varied", (x, y), 13, HPos::Left, &BLACK)?;
    for (name, colour) in FAMILIES.iter().zip(COLOURS) {
        y += 18.0;
        let is_hollow = *name == FAMILIES[0];
        let style = if is_hollow { colour.stroke_width(2) } else { colour.filled() };
        area.draw(&Circle::new((LISTS_X + 6, y as i32), 5, style))?;
        let name = if is_hollow { "coarse model, without enrichment" } else { name };
        text(area, name, (x + 18.0, y), 12, HPos::Left, &BLACK)?;
    }
    y += 34.0;
    text(area, "front: none is both faster and more accurate", (x, y), 13, HPos::Left, &FRONT)?;
    for (i, p) in front.iter().enumerate() {
        y += 18.0;
        let mark = if p.name == chart.default { " (default)" } else { "" };
        text(area, &format!("{}", i + 1), (x + 10.0, y), 12, HPos::Right, &FRONT)?;
        let entry = format!("{:.0} us, {:.3} mm: {}{mark}", p.tick_us(), p.independent_mm, p.name);
        text(area, &entry, (x + 18.0, y), 12, HPos::Left, &BLACK)?;
    }
    if let Some(p) = chart.points.iter().find(|p| p.name == chart.default && !p.on_front) {
        y += 26.0;
        let entry = format!("default: {:.0} us, {:.3} mm: {}", p.tick_us(), p.independent_mm, p.name);
        text(area, &entry, (x, y), 12, HPos::Left, &BLACK)?;
    }
    Ok(())
}

fn colour(p: &Point) -> RGBColor {
    let family = FAMILIES.iter().position(|f| *f == p.family);
    family.map_or(BLACK, |i| COLOURS[i])
}

fn line(area: &Area<'_>, corners: &[(f64, f64)], style: ShapeStyle) -> Result<(), Box<dyn std::error::Error>> {
    let corners: Vec<(i32, i32)> = corners.iter().map(|(x, y)| (x.round() as i32, y.round() as i32)).collect();
    Ok(area.draw(&PathElement::new(corners, style))?)
}

fn text(
    area: &Area<'_>,
    what: &str,
    (x, y): (f64, f64),
    size: u32,
    side: HPos,
    colour: &impl Color,
) -> Result<(), Box<dyn std::error::Error>> {
    let style = TextStyle::from(("sans-serif", size).into_font()).color(colour).pos(Pos::new(side, VPos::Center));
    Ok(area.draw(&Text::new(what.to_owned(), (x.round() as i32, y.round() as i32), style))?)
}
