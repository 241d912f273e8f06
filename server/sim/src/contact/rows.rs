//! Constraint rows: selected from the candidates, with the state of the last tick's contacts.

use super::V3;
use super::detect::Candidate;
use super::surface::SkinSurface;
use crate::embedding::SkinEmbedding;
use crate::lanes::Node;

/// A contact, kept from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Contact {
    /// Tool index, or `n_tools + plane index`.
    pub(crate) body: u32,
    pub(crate) feature: u64,
    /// Multipliers: normal force and tangential force on the skin \[N\].
    pub(crate) normal_force: f32,
    pub(crate) tangential_force: V3,
    /// Tangential displacement since it sticks \[m\].
    pub(crate) slip: V3,
    /// Secant of the friction cone, `min(1, mu f_n / |t|)`: 1 sticks, less slides, 0 is to be predicted.
    pub(crate) secant: f32,
    /// Penetration found when the contact began, fading out \[m\]; never positive.
    pub(crate) bias: f32,
    pub(crate) point: V3,
    pub(crate) normal: V3,
    /// Gap at the end of the tick \[m\].
    pub(crate) gap: f32,
    /// Forces of the last solve, for reports \[N\].
    pub(crate) force: V3,
}

impl Contact {
    /// Whether friction is at its limit.
    pub(crate) fn slides(&self) -> bool {
        self.secant < 1.0
    }
}

/// A contact in this step's solve.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) contact: Contact,
    /// From the tool's origin to the point \[m\].
    pub(crate) arm: V3,
    /// Gap that the solve closes: measured gap less bias, bounded below \[m\].
    pub(crate) gap: f32,
    /// Sticking stiffness `k` of the augmented Lagrangian \[N/m\].
    pub(crate) stiffness: f32,
    /// Its normal stiffness `k_n` \[N/m\].
    pub(crate) normal_stiffness: f32,
    pub(crate) friction: f32,
    /// `tr(J A_0^-1 J^T) / 3` at the point \[1/kg\].
    pub(crate) inverse_mass: f32,
    /// Bound of the normal multiplier \[N\].
    pub(crate) max_force: f32,
    pub(crate) active: bool,
    /// Velocity of the skin point before the solve \[m/s\].
    pub(crate) skin_velocity: V3,
    /// Displacement of the skin against the tool in this step \[m\].
    pub(crate) u: V3,
    /// `J dv` of the last pass \[m/s\].
    pub(crate) jdv: V3,
    /// Force on the skin \[N\].
    pub(crate) force: V3,
    first_entry: u32,
    last_entry: u32,
}

/// All rows of a step, with their sparse Jacobians over internal nodes.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    pub(crate) rows: Vec<Row>,
    nodes: Vec<u32>,
    weights: Vec<f32>,
    /// Selection scratch.
    ranked: Vec<Ranked>,
    chosen: Vec<Ranked>,
}

#[derive(Debug, Clone, Copy)]
struct Ranked {
    /// Normal force of the old contact \[N\].
    load: f32,
    predicted_gap: f32,
    candidate: u32,
    old: Option<u32>,
}

/// Parameters for selecting the rows of one body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Selection<'a> {
    pub(crate) body: u32,
    pub(crate) friction: f32,
    pub(crate) origin: V3,
    pub(crate) activation_gap: f32,
    pub(crate) max_contacts: usize,
    /// Least distance of rows when there are too many \[m\].
    pub(crate) spacing: f32,
    pub(crate) dt: f32,
    /// Largest penetration that one step resolves \[m\].
    pub(crate) max_correction: f32,
    /// Indentation whose static force bounds the multiplier \[m\].
    pub(crate) max_press: f32,
    pub(crate) surface: &'a SkinSurface,
    /// Contacts of the last tick, all bodies.
    pub(crate) old: &'a [Contact],
}

/// Contacts hand their load over to a neighbour within this distance \[m\].
const HAND_OVER: f32 = 10e-3;

impl Rows {
    /// `n` bounds the rows of all bodies together.
    pub(crate) fn new(n: usize, longest_row: usize) -> Self {
        Self {
            rows: Vec::with_capacity(n),
            nodes: Vec::with_capacity(3 * n * longest_row),
            weights: Vec::with_capacity(3 * n * longest_row),
            ranked: Vec::with_capacity(4096),
            chosen: Vec::with_capacity(n + 1),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.rows.clear();
        self.nodes.clear();
        self.weights.clear();
    }

    /// Turns the candidates of one body into rows. Returns the number left out.
    ///
    /// `tool_velocity(arm)` is the free velocity of the body's point at `arm`.
    pub(crate) fn select(
        &mut self,
        embedding: &SkinEmbedding,
        v: &[Node],
        candidates: &[Candidate],
        tool_velocity: impl Fn(V3) -> V3,
        selection: &Selection<'_>,
    ) -> u32 {
        self.rank(embedding, v, candidates, tool_velocity, selection);
        let dropped = self.choose(candidates, selection);
        let first_row = self.rows.len();
        for index in 0..self.chosen.len() {
            let ranked = self.chosen[index];
            let candidate = &candidates[ranked.candidate as usize];
            self.push(embedding, v, candidate, ranked.old.map(|o| &selection.old[o as usize]), selection);
        }
        self.hand_over(first_row, selection);
        dropped
    }

    /// Candidates that may come into contact in this step, each with the old contact that it continues.
    fn rank(
        &mut self,
        embedding: &SkinEmbedding,
        v: &[Node],
        candidates: &[Candidate],
        tool_velocity: impl Fn(V3) -> V3,
        selection: &Selection<'_>,
    ) {
        self.ranked.clear();
        for (index, c) in candidates.iter().enumerate() {
            let relative = point_velocity(embedding, v, c) - tool_velocity(c.point - selection.origin);
            let predicted_gap = c.gap.min(c.gap + selection.dt * c.normal.dot(&relative));
            if predicted_gap >= selection.activation_gap {
                continue;
            }
            let is_same = |o: &Contact| o.body == selection.body && o.feature == c.feature;
            let old = selection.old.iter().position(is_same);
            let load = old.map_or(0.0, |o| selection.old[o].normal_force);
            // One that friction drags along is left to the neighbour that it comes to.
            let is_dragged = selection.friction > 0.0 && old.is_some_and(|o| selection.old[o].slides());
            if c.is_fringe && (load <= 0.0 || is_dragged) {
                continue;
            }
            let old = old.map(|o| o as u32);
            self.ranked.push(Ranked { load, predicted_gap, candidate: index as u32, old });
        }
    }

    /// All candidates if they fit, else in this order:
    ///
    /// 1. new penetrations, deepest first, up to a quarter of the room;
    /// 2. loaded contacts, at the least spacing that makes them fit;
    /// 3. the most loaded, then the deepest, of the rest.
    fn choose(&mut self, candidates: &[Candidate], selection: &Selection<'_>) -> u32 {
        self.chosen.clear();
        let room = selection.max_contacts;
        if self.ranked.len() <= room {
            self.chosen.extend_from_slice(&self.ranked);
            return 0;
        }
        self.ranked.sort_unstable_by(|a, b| {
            let order = b.load.total_cmp(&a.load).then(a.predicted_gap.total_cmp(&b.predicted_gap));
            order.then(a.candidate.cmp(&b.candidate))
        });
        let point = |r: &Ranked| candidates[r.candidate as usize].point;
        let is_apart = |chosen: &[Ranked], r: &Ranked, spacing: f32| {
            chosen.iter().all(|c| (point(c) - point(r)).norm_squared() > spacing * spacing)
        };
        for r in self.ranked.iter().filter(|r| r.load <= 0.0 && r.predicted_gap < 0.0) {
            if self.chosen.len() < room / 4 && is_apart(&self.chosen, r, selection.spacing) {
                self.chosen.push(*r);
            }
        }
        let n_violating = self.chosen.len();
        let mut spacing = selection.spacing;
        loop {
            self.chosen.truncate(n_violating);
            for r in self.ranked.iter().filter(|r| r.load > 0.0) {
                if self.chosen.len() <= room && is_apart(&self.chosen[n_violating..], r, spacing) {
                    self.chosen.push(*r);
                }
            }
            if self.chosen.len() <= room {
                break;
            }
            spacing *= 1.4;
        }
        for r in &self.ranked {
            if self.chosen.len() < room && self.chosen.iter().all(|c| c.candidate != r.candidate) {
                self.chosen.push(*r);
            }
        }
        (self.ranked.len() - self.chosen.len()) as u32
    }

    fn push(
        &mut self,
        embedding: &SkinEmbedding,
        v: &[Node],
        candidate: &Candidate,
        old: Option<&Contact>,
        selection: &Selection<'_>,
    ) {
        let first_entry = self.nodes.len() as u32;
        for (vertex, weight) in carriers(candidate) {
            let (nodes, weights) = embedding.row(vertex);
            self.nodes.extend_from_slice(nodes);
            self.weights.extend(weights.iter().map(|w| w * weight));
        }
        let contact = match old {
            Some(old) => continued(old, candidate),
            None => begun(candidate, selection),
        };
        self.rows.push(Row {
            contact,
            arm: candidate.point - selection.origin,
            gap: (candidate.gap - contact.bias).max(-selection.max_correction),
            stiffness: 0.0,
            normal_stiffness: 0.0,
            friction: selection.friction,
            max_force: carriers(candidate).map(|(v, w)| w * selection.surface.static_stiffness[v]).sum::<f32>()
                * selection.max_press,
            inverse_mass: carriers(candidate).map(|(v, w)| w * selection.surface.inverse_mass[v]).sum(),
            active: false,
            skin_velocity: V3::zeros(),
            u: V3::zeros(),
            jdv: V3::zeros(),
            force: V3::zeros(),
            first_entry,
            last_entry: self.nodes.len() as u32,
        });
        let row = self.rows.len() - 1;
        self.rows[row].skin_velocity = self.jacobian_product(row, v);
    }

    /// Hands the load of contacts without a row to the nearest row of their body. A new row takes their whole state, so
    /// that a contact that moves from one feature of the skin to the next continues unchanged.
    fn hand_over(&mut self, first_row: usize, selection: &Selection<'_>) {
        let rows = &mut self.rows[first_row..];
        let is_continued = |rows: &[Row], o: &Contact| rows.iter().any(|r| r.contact.feature == o.feature);
        let slides = selection.old.iter().any(|o| o.body == selection.body && o.slides() && o.normal_force > 0.0);
        let n_old = selection.old.len();
        for row in rows.iter_mut().filter(|r| r.contact.normal_force <= 0.0) {
            row.contact.secant = if slides { 0.0 } else { 1.0 };
        }
        for index in 0..n_old {
            let old = &selection.old[index];
            if old.body != selection.body || old.normal_force <= 0.0 || is_continued(rows, old) {
                continue;
            }
            let distance = |r: &Row| (r.contact.point - old.point).norm_squared();
            let nearest = rows.iter_mut().min_by(|a, b| distance(a).total_cmp(&distance(b)));
            let Some(row) = nearest.filter(|r| distance(r) < HAND_OVER * HAND_OVER) else { continue };
            let is_untouched = row.contact.normal_force == 0.0
                && !selection.old.iter().any(|o| o.body == old.body && o.feature == row.contact.feature);
            let c = &mut row.contact;
            if is_untouched {
                (c.secant, c.slip) = (old.secant, tangent(&c.normal, &old.slip));
                row.gap += c.bias - old.bias;
                c.bias = old.bias;
            }
            c.normal_force += old.normal_force;
            c.tangential_force += tangent(&c.normal, &old.tangential_force);
        }
    }

    /// `J v`: velocity of the row's skin point.
    #[inline(always)]
    pub(crate) fn jacobian_product(&self, row: usize, v: &[Node]) -> V3 {
        let row = &self.rows[row];
        let range = row.first_entry as usize..row.last_entry as usize;
        let sum = weighted_sum(&self.nodes[range.clone()], &self.weights[range], v);
        V3::new(sum[0], sum[1], sum[2])
    }

    /// Number of active rows that load the surroundings of this one, itself included: `sum (1 - d^2 / cell^2)^2`.
    pub(crate) fn crowding(&self, row: usize, cell: f32) -> f32 {
        let point = self.rows[row].contact.point;
        let overlap = |other: &Row| {
            let x = 1.0 - (other.contact.point - point).norm_squared() / (cell * cell);
            if x > 0.0 { x * x } else { 0.0 }
        };
        let others = self.rows.iter().enumerate().filter(|&(i, r)| i != row && r.active);
        1.0 + others.map(|(_, r)| overlap(r)).sum::<f32>()
    }

    /// `out += scale * sum J^T f` over all rows.
    pub(crate) fn add_forces(&self, scale: f32, out: &mut [Node]) {
        for (index, row) in self.rows.iter().enumerate().filter(|(_, r)| r.active) {
            self.add_transpose_product(index, &(row.force * scale), out);
        }
    }

    /// `out += J^T f`
    #[inline(always)]
    pub(crate) fn add_transpose_product(&self, row: usize, f: &V3, out: &mut [Node]) {
        let row = &self.rows[row];
        let range = row.first_entry as usize..row.last_entry as usize;
        let padded = [f.x, f.y, f.z, 0.0];
        for (&node, &w) in self.nodes[range.clone()].iter().zip(&self.weights[range]) {
            let n = &mut out[node as usize];
            for k in 0..4 {
                n[k] = w.mul_add(padded[k], n[k]);
            }
        }
    }
}

/// Vertices that carry a candidate, with non-zero weight.
fn carriers(candidate: &Candidate) -> impl Iterator<Item = (usize, f32)> {
    candidate.vertices.into_iter().zip(candidate.weights).filter(|c| c.1 != 0.0).map(|(v, w)| (v as usize, w))
}

fn point_velocity(embedding: &SkinEmbedding, v: &[Node], candidate: &Candidate) -> V3 {
    let mut sum = [0.0; 4];
    for (vertex, weight) in carriers(candidate) {
        let (nodes, weights) = embedding.row(vertex);
        let part = weighted_sum(nodes, weights, v);
        for k in 0..4 {
            sum[k] += weight * part[k];
        }
    }
    V3::new(sum[0], sum[1], sum[2])
}

/// `sum_a w_a v_a`; the padding is carried along, so that a node is one vector operation.
#[inline(always)]
fn weighted_sum(nodes: &[u32], weights: &[f32], v: &[Node]) -> Node {
    let mut sum = [0.0_f32; 4];
    for (&node, &w) in nodes.iter().zip(weights) {
        let n = &v[node as usize];
        for k in 0..4 {
            sum[k] = w.mul_add(n[k], sum[k]);
        }
    }
    sum
}

fn continued(old: &Contact, candidate: &Candidate) -> Contact {
    Contact {
        tangential_force: tangent(&candidate.normal, &old.tangential_force),
        slip: tangent(&candidate.normal, &old.slip),
        point: candidate.point,
        normal: candidate.normal,
        ..*old
    }
}

fn begun(candidate: &Candidate, selection: &Selection<'_>) -> Contact {
    Contact {
        body: selection.body,
        feature: candidate.feature,
        normal_force: 0.0,
        tangential_force: V3::zeros(),
        slip: V3::zeros(),
        secant: 1.0,
        bias: candidate.gap.min(0.0),
        point: candidate.point,
        normal: candidate.normal,
        gap: candidate.gap,
        force: V3::zeros(),
    }
}

/// The part of `v` orthogonal to the unit vector `n`.
pub(crate) fn tangent(n: &V3, v: &V3) -> V3 {
    v - n * n.dot(v)
}
