//! Convex parts of a tool from an OBJ file: every group or object is one part, taken as the hull of its vertices.

use std::collections::BTreeSet;

use nalgebra::Point3;

/// Points of each part in the text of an OBJ file \[m\]. A part holds the vertices of its faces.
///
/// # Errors
/// A sentence with line and problem, without words of the text: clients may name files that they cannot read.
pub fn parse_obj_parts(text: &str, metres_per_unit: f64) -> Result<Vec<Vec<Point3<f64>>>, String> {
    let mut vertices: Vec<Point3<f64>> = Vec::new();
    let mut parts: Vec<BTreeSet<usize>> = vec![BTreeSet::new()];
    for (i, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => vertices.push(vertex(words, metres_per_unit).ok_or(format!("line {}: bad vertex", i + 1))?),
            Some("g" | "o") => parts.push(BTreeSet::new()),
            Some("f") => {
                let part = parts.last_mut().expect("starts with one part");
                for word in words {
                    part.insert(index(word, vertices.len()).ok_or(format!("line {}: bad face", i + 1))?);
                }
            }
            _ => {}
        }
    }
    let hulls: Vec<Vec<_>> =
        parts.iter().filter(|p| !p.is_empty()).map(|p| p.iter().map(|v| vertices[*v]).collect()).collect();
    match hulls.iter().find(|h| h.len() < 4) {
        Some(h) => Err(format!("a part has {} vertices; at least 4 are needed", h.len())),
        None if hulls.is_empty() => Err("there is no face".into()),
        None => Ok(hulls),
    }
}

fn vertex<'a>(words: impl Iterator<Item = &'a str>, scale: f64) -> Option<Point3<f64>> {
    let numbers: Vec<f64> = words.take(3).map_while(|w| w.parse().ok()).filter(|x: &f64| x.is_finite()).collect();
    (numbers.len() == 3).then(|| Point3::new(numbers[0], numbers[1], numbers[2]) * scale)
}

/// Zero-based vertex of `7`, `7/1/2` or `-1` (the last one).
fn index(word: &str, n_vertices: usize) -> Option<usize> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let index = if number < 0 { n_vertices as i64 + number } else { number - 1 };
    usize::try_from(index).ok().filter(|i| *i < n_vertices)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn groups_become_parts_and_indices_count_from_one_or_from_the_end() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\no a\nf 1 2 3\nf 1/1 2/1 4/1\no b\nf -1 -2 -3 -4\n";
        let parts = parse_obj_parts(text, 0.001).unwrap();
        assert_eq!(parts.iter().map(Vec::len).collect::<Vec<_>>(), [4, 4]);
        assert_eq!(parts[0][1].x, 0.001);
    }

    #[test]
    fn a_face_beyond_the_vertices_is_named_by_line() {
        assert!(parse_obj_parts("v 0 0 0\nf 1 2 3\n", 1.0).unwrap_err().contains("line 2"));
    }
}
