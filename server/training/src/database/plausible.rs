//! Limits of the numbers of a database, from the size of the scene's object.

use nalgebra::{Matrix3, Vector3};

use crate::example::Example;

/// Tolerance of orthonormal frames and unit quaternions.
const UNIT: f64 = 1e-6;
/// Room around the object for contact points, in diagonals of its box.
const AROUND: f64 = 0.1;
/// Bytes of a vector of `u`, `d` and `d_independent`.
const VECTOR_BYTES: usize = 12;
/// Bytes of an example's point, frame, pose and three forces.
const SMALL_BYTES: usize = 8 * (3 + 9 + 7 + 3 * 3);
/// Farthest origin of a tool from the object, in diagonals of its box.
const FAR: f64 = 1e3;

/// A scene as a database for it must be: hash, sizes, and the box of the object at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneLimits {
    /// Hash of the scene.
    pub scene_hash: String,
    /// Nodes of the coarse mesh.
    pub n_nodes: usize,
    /// Vertices of the skin.
    pub n_skin: usize,
    /// Lower corner of the object at rest \[m\].
    pub lowest_m: [f64; 3],
    /// Upper corner of the object at rest \[m\].
    pub highest_m: [f64; 3],
}

impl SceneLimits {
    /// Checks the shapes that a header names for `n` examples, and the `bytes` of all tensors.
    pub(super) fn check_sizes<'a>(
        &self,
        n: usize,
        bytes: usize,
        shape_of: impl Fn(&str) -> Option<&'a [usize]>,
    ) -> Result<(), String> {
        for (name, rows, of) in [("u", self.n_nodes, "nodes"), ("d", self.n_skin, "vertices of the skin")] {
            let shape = shape_of(name).ok_or_else(|| format!("there is no tensor `{name}`"))?;
            if shape != [n, rows, 3] {
                return Err(format!(
                    "tensor `{name}` is {shape:?}; {n} examples and the scene's {rows} {of} make [{n}, {rows}, 3]"
                ));
            }
        }
        let most = n * (VECTOR_BYTES * (self.n_nodes + 2 * self.n_skin) + SMALL_BYTES);
        if bytes > most {
            return Err(format!("its tensors have {bytes} bytes; at most {most} belong to {n} examples"));
        }
        Ok(())
    }

    /// Checks the numbers of an example; the error names the example, the number and the limit.
    pub(super) fn check_numbers(&self, example: &Example) -> Result<(), String> {
        let at = |problem: String| format!("example {}: {problem}", example.record.index);
        self.check_fields(example).map_err(at)?;
        check_frame(&example.contact_frame).map_err(at)?;
        self.check_places(example).map_err(at)
    }

    /// Nothing is moved farther than the object is long.
    fn check_fields(&self, example: &Example) -> Result<(), String> {
        let diagonal = self.diagonal_m();
        let fields = [
            ("u", Some(&example.displacements)),
            ("d", Some(&example.detail)),
            ("d_independent", example.independent_detail.as_ref()),
        ];
        for (name, field) in fields {
            let length = |v: &[f32; 3]| Vector3::from(v.map(f64::from)).norm();
            let longer = field.and_then(|f| f.iter().enumerate().find(|(_, v)| length(v) > diagonal));
            if let Some((row, v)) = longer {
                return Err(format!(
                    "{name}[{row}] is {:.3e} m long; at most the object's diagonal of {diagonal:.4} m is possible",
                    length(v)
                ));
            }
        }
        Ok(())
    }

    fn check_places(&self, example: &Example) -> Result<(), String> {
        let diagonal = self.diagonal_m();
        let is_near = |p: &[f64; 3], room: f64| {
            (0..3).all(|k| p[k] >= self.lowest_m[k] - room && p[k] <= self.highest_m[k] + room)
        };
        let (lowest, highest) = (self.lowest_m, self.highest_m);
        if !is_near(&example.contact_point, AROUND * diagonal) {
            let point = example.contact_point;
            return Err(format!("contact_point {point:?} m lies off the object, from {lowest:?} to {highest:?} m"));
        }
        let [x, y, z, rotation @ ..] = example.tool_pose;
        if !is_near(&[x, y, z], FAR * diagonal) {
            return Err(format!(
                "tool_pose is at {:?} m, far off the object, from {lowest:?} to {highest:?} m",
                [x, y, z]
            ));
        }
        let norm = rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > UNIT {
            return Err(format!("the quaternion of tool_pose has length {norm:e}; 1 within {UNIT:e} is needed"));
        }
        Ok(())
    }

    fn diagonal_m(&self) -> f64 {
        (Vector3::from(self.highest_m) - Vector3::from(self.lowest_m)).norm()
    }
}

/// `|R R^T - 1| <= 1e-6` entry by entry, and right-handed.
fn check_frame(rows: &[[f64; 3]; 3]) -> Result<(), String> {
    let frame = Matrix3::from_fn(|r, c| rows[r][c]);
    let off = (frame * frame.transpose() - Matrix3::identity()).abs().max();
    if off.is_nan() || off > UNIT || frame.determinant() <= 0.0 {
        return Err(format!("contact_frame {rows:?} is not orthonormal and right-handed within {UNIT:e}"));
    }
    Ok(())
}
