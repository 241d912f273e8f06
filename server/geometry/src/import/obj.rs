//! Parts of a tool from an OBJ file: every group or object is one part.

use std::collections::BTreeMap;

use nalgebra::Point3;

use super::text::without_mark;

/// A group or object of an OBJ file.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjPart {
    /// Name of the group or object; `part N` without one.
    pub name: String,
    /// Vertices of its faces \[m\], in the order of the file.
    pub points: Vec<Point3<f64>>,
    /// Its faces, split into triangles, as indices into `points`.
    pub triangles: Vec<[usize; 3]>,
}

/// A part with vertices by their numbers in the file.
#[derive(Default)]
struct RawPart {
    name: String,
    faces: Vec<Vec<usize>>,
}

/// Parts in the content of an OBJ file; faces decide which part a vertex belongs to.
///
/// # Errors
/// A sentence with line and problem, without words of the file: clients may name files that they cannot read.
pub fn parse_obj_parts(bytes: &[u8], metres_per_unit: f64) -> Result<Vec<ObjPart>, String> {
    // Names may be in any encoding; numbers and keywords are ASCII.
    let content = without_mark(bytes);
    let text = String::from_utf8_lossy(&content);
    let mut vertices: Vec<Point3<f64>> = Vec::new();
    let mut parts: Vec<RawPart> = vec![RawPart::default()];
    for (i, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => vertices.push(vertex(words, metres_per_unit).ok_or(format!("line {}: bad vertex", i + 1))?),
            Some("g" | "o") => {
                let name = words.collect::<Vec<_>>().join(" ");
                parts.push(RawPart { name, faces: Vec::new() });
            }
            Some("f") => {
                let known = vertices.len();
                let corner = |word| index(word, known).ok_or(format!("line {}: bad face", i + 1));
                let face = words.map(corner).collect::<Result<_, _>>()?;
                parts.last_mut().expect("starts with one part").faces.push(face);
            }
            _ => {}
        }
    }
    let with_faces = parts.iter().filter(|part| !part.faces.is_empty()).enumerate();
    let parts: Vec<ObjPart> = with_faces.map(|(i, part)| part.gather(i, &vertices)).collect();
    match parts.iter().enumerate().find(|(_, part)| part.points.len() < 4) {
        Some((i, part)) => Err(format!("part {} has {} vertices; at least 4 are needed", i + 1, part.points.len())),
        None if parts.is_empty() => Err("there is no face".into()),
        None => Ok(parts),
    }
}

impl RawPart {
    fn gather(&self, number: usize, vertices: &[Point3<f64>]) -> ObjPart {
        let used: BTreeMap<usize, usize> = {
            let mut numbers: Vec<usize> = self.faces.iter().flatten().copied().collect();
            numbers.sort_unstable();
            numbers.dedup();
            numbers.into_iter().enumerate().map(|(i, vertex)| (vertex, i)).collect()
        };
        let fan = |face: &Vec<usize>| -> Vec<[usize; 3]> {
            face.windows(2).skip(1).map(|pair| [used[&face[0]], used[&pair[0]], used[&pair[1]]]).collect()
        };
        ObjPart {
            name: if self.name.is_empty() { format!("part {}", number + 1) } else { self.name.clone() },
            points: used.keys().map(|&vertex| vertices[vertex]).collect(),
            triangles: self.faces.iter().flat_map(fan).collect(),
        }
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
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\no a\nf 1 2 3\nf 1/1 2/1 4/1\no b c\nf -1 -2 -3 -4\n";
        let parts = parse_obj_parts(text.as_bytes(), 0.001).unwrap();
        assert_eq!(parts.iter().map(|part| part.points.len()).collect::<Vec<_>>(), [4, 4]);
        assert_eq!(parts.iter().map(|part| part.name.as_str()).collect::<Vec<_>>(), ["a", "b c"]);
        assert_eq!(parts[0].points[1].x, 0.001);
        assert_eq!(parts[0].triangles, [[0, 1, 2], [0, 1, 3]]);
        assert_eq!(parts[1].triangles, [[3, 2, 1], [3, 1, 0]]);
    }

    #[test]
    fn a_face_beyond_the_vertices_is_named_by_line() {
        assert!(parse_obj_parts(b"v 0 0 0\nf 1 2 3\n", 1.0).unwrap_err().contains("line 2"));
    }
}
