//! Contact operator of the linear solver: `h^2 J^T D J - (h^2 J^T D P) App^-1 (h^2 P^T D J)`, tools eliminated.

use nalgebra::Vector6;

use super::proxy::{ProxyMotion, at_arm, transposed_at_arm};
use super::rows::Rows;
use super::{M3, V3};
use crate::lanes::Node;

/// Scratch of the contact operator.
#[derive(Debug, Clone)]
pub(crate) struct ContactCoupling {
    /// Active rows with their stiffness and `D J p`.
    active: Vec<(u32, M3, V3)>,
    /// `h^2 P^T D J p` per body.
    on_bodies: Vec<Vector6<f32>>,
}

impl ContactCoupling {
    /// `max_rows` bounds the rows of all bodies together.
    pub(crate) fn new(n_bodies: usize, max_rows: usize) -> Self {
        Self { active: Vec::with_capacity(max_rows), on_bodies: vec![Vector6::zeros(); n_bodies] }
    }

    /// Prepares a pass: tools are factored, and `residual += h J^T f + h^2 J^T D P App^-1 r_p`.
    pub(crate) fn begin_pass(&mut self, rows: &Rows, tools: &mut [ProxyMotion], h: f32, residual: &mut [Node]) {
        self.active.clear();
        for (index, row) in rows.rows.iter().enumerate().filter(|(_, r)| r.active) {
            self.active.push((index as u32, row.stiffness_matrix(), V3::zeros()));
        }
        for (body, tool) in tools.iter_mut().enumerate() {
            tool.factor(body as u32, rows, h);
            self.on_bodies[body] = tool.solve(&tool.residual());
        }
        for (index, d, _) in &self.active {
            let row = &rows.rows[*index as usize];
            let body = row.contact.body as usize;
            let yielding = tools.get(body).map_or(V3::zeros(), |t| at_arm(&self.on_bodies[body], t.lever, &row.arm));
            rows.add_transpose_product(*index as usize, &(row.force * h + d * yielding * (h * h)), residual);
        }
    }

    /// Ends a pass: velocities and displacements of the rows at the solution `dv`, and the tools' part of it.
    pub(crate) fn end_pass(&mut self, rows: &mut Rows, tools: &mut [ProxyMotion], h: f32, dv: &[Node]) {
        self.on_bodies.fill(Vector6::zeros());
        for index in 0..rows.rows.len() {
            let jdv = rows.jacobian_product(index, dv);
            let row = &mut rows.rows[index];
            let change = jdv - row.jdv;
            row.jdv = jdv;
            if let (true, Some(tool)) = (row.active, tools.get(row.contact.body as usize)) {
                let force = row.stiffness_matrix() * change * (h * h);
                self.on_bodies[row.contact.body as usize] += transposed_at_arm(&force, tool.lever, &row.arm);
            }
        }
        for (body, tool) in tools.iter_mut().enumerate() {
            let change = tool.solve(&(tool.residual() + self.on_bodies[body]));
            tool.advance(&change);
        }
        for row in &mut rows.rows {
            let tool_velocity =
                tools.get(row.contact.body as usize).map_or(V3::zeros(), |t| t.point_velocity(&row.arm));
            row.u = (row.skin_velocity + row.jdv - tool_velocity) * h;
        }
    }

    /// `out += (h^2 J^T D J - ...) p`
    #[inline(always)]
    pub(crate) fn add_product(&mut self, rows: &Rows, tools: &[ProxyMotion], h: f32, p: &[Node], out: &mut [Node]) {
        if self.active.is_empty() {
            return;
        }
        self.on_bodies.fill(Vector6::zeros());
        for (index, d, force) in &mut self.active {
            let row = &rows.rows[*index as usize];
            *force = *d * rows.jacobian_product(*index as usize, p) * (h * h);
            if let Some(tool) = tools.get(row.contact.body as usize) {
                self.on_bodies[row.contact.body as usize] += transposed_at_arm(force, tool.lever, &row.arm);
            }
        }
        for (tool, load) in tools.iter().zip(&mut self.on_bodies) {
            *load = tool.solve(load);
        }
        for (index, d, force) in &self.active {
            let row = &rows.rows[*index as usize];
            let body = row.contact.body as usize;
            let yielding = tools.get(body).map_or(V3::zeros(), |t| at_arm(&self.on_bodies[body], t.lever, &row.arm));
            rows.add_transpose_product(*index as usize, &(force - d * yielding * (h * h)), out);
        }
    }
}
