//! Points that become one: within a tolerance where that is asked for, and those that the pieces of one file have in common.

use std::collections::HashMap;

use nalgebra::Point3;

use super::assemble::Content;
use super::error::{Fault, Place, fault};
use super::options::ReadOptions;

/// Merges points, and tells how many.
pub(super) fn merge(content: Content, options: &ReadOptions) -> Result<(Content, Vec<String>), Fault> {
    match options.merge_tolerance_m {
        Some(0.0) => Ok((content, Vec::new())),
        Some(tolerance_m) => {
            let first = near_points(&content.points, tolerance_m / options.metres_per_unit);
            let n_merged = n_moved(&first);
            check_shapes(&content, &first, options, tolerance_m)?;
            let remark = match n_merged {
                0 => format!("no two nodes lie within merge_tolerance_m = {tolerance_m:e}: nothing was merged"),
                n => format!("{n} nodes were merged with another one within {tolerance_m:e} m (merge_tolerance_m)"),
            };
            Ok((replace(content, &first), vec![remark]))
        }
        None if content.pieces.len() > 1 => {
            let first = common_points(&content);
            let n_merged = n_moved(&first);
            let remark = format!(
                "the file has {} pieces; {n_merged} nodes that two of them have at exactly the same place were taken for one \
                 (merge_tolerance_m = 0 keeps them apart)",
                content.pieces.len()
            );
            Ok((replace(content, &first), vec![remark]))
        }
        None => Ok((content, Vec::new())),
    }
}

fn n_moved(first: &[u32]) -> usize {
    first.iter().enumerate().filter(|(point, first)| *point != **first as usize).count()
}

/// For each point the nearest earlier one within `tolerance` that was not merged itself, else the point.
fn near_points(points: &[Point3<f64>], tolerance: f64) -> Vec<u32> {
    let cube = |x: &Point3<f64>| [x.x, x.y, x.z].map(|c| (c / tolerance).floor() as i64);
    let mut kept: HashMap<[i64; 3], Vec<u32>> = HashMap::with_capacity(points.len());
    let mut first = Vec::with_capacity(points.len());
    for (point, x) in (0..).zip(points) {
        let at = cube(x);
        let around = (0..27).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]);
        let around = around.filter_map(|step| kept.get(&[0, 1, 2].map(|axis| at[axis].saturating_add(step[axis]))));
        let distance = |other: &u32| (points[*other as usize] - x).norm();
        let near = around.flatten().copied().filter(|other| distance(other) <= tolerance);
        match near.min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b))) {
            Some(other) => first.push(other),
            None => {
                kept.entry(at).or_default().push(point);
                first.push(point);
            }
        }
    }
    first
}

/// For each point the first one of an earlier piece at exactly its place, else the point.
fn common_points(content: &Content) -> Vec<u32> {
    // Adding 0 makes -0 and 0 one place.
    let bits = |x: &Point3<f64>| [x.x, x.y, x.z].map(|c| (c + 0.0).to_bits());
    let mut known: HashMap<[u64; 3], (u32, usize)> = HashMap::with_capacity(content.points.len());
    let mut first = Vec::with_capacity(content.points.len());
    let mut piece = 0;
    for (point, x) in (0..).zip(&content.points) {
        while content.pieces.get(piece + 1).is_some_and(|&begin| begin <= point as usize) {
            piece += 1;
        }
        let (other, of_piece) = *known.entry(bits(x)).or_insert((point, piece));
        first.push(if of_piece == piece { point } else { other });
    }
    first
}

/// Refuses a tolerance that merges nodes of one volume.
fn check_shapes(content: &Content, first: &[u32], options: &ReadOptions, tolerance_m: f64) -> Result<(), Fault> {
    for cell in content.cells.iter().filter(|cell| cell.shape.dimension() == 3) {
        for (k, a) in cell.nodes().iter().enumerate() {
            let twin = cell.nodes()[..k].iter().find(|b| *b != a && first[**b as usize] == first[*a as usize]);
            if let Some(b) = twin {
                let apart = (content.points[*a as usize] - content.points[*b as usize]).norm();
                let problem = format!(
                    "merge_tolerance_m = {tolerance_m:e} would merge two nodes of a {}, which are {:e} m apart",
                    cell.shape.singular(),
                    apart * options.metres_per_unit
                );
                let advice = "give a tolerance well below the shortest edge";
                return fault(Place::Field(format!("cell {}", cell.number), None), problem, advice);
            }
        }
    }
    Ok(())
}

fn replace(mut content: Content, first: &[u32]) -> Content {
    for cell in &mut content.cells {
        let n_nodes = cell.shape.n_nodes();
        cell.nodes[..n_nodes].iter_mut().for_each(|node| *node = first[*node as usize]);
    }
    let labels = content.point_labels.iter_mut().flat_map(|(_, points)| points);
    labels.for_each(|point| *point = first[*point] as usize);
    content
}
