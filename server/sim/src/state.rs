//! State that a tick changes. A clone is a snapshot; [`State::copy_from`] restores one without allocating.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::contact::{Contact, Proxy};
use crate::embedding::SkinPositions;
use crate::lanes::Node;
use crate::model::Model;
use crate::report::{ContactReading, ToolReading};
use crate::rotation::{IDENTITY, Quaternions};
use crate::tool::PoseTrack;

/// State of a scene between ticks.
#[derive(Debug)]
pub struct State {
    pub(crate) tick: u64,
    /// Nodal displacements in internal order, `[n_nodes]` \[m\].
    pub(crate) u: Vec<Node>,
    /// Nodal velocities \[m/s\].
    pub(crate) v: Vec<Node>,
    /// Constant forces on free nodes, in internal order \[N\]; empty without external forces.
    pub(crate) external_forces: Vec<Node>,
    /// Rotation of each element, by batch.
    pub(crate) quaternions: Vec<Quaternions>,
    pub(crate) skin: SkinPositions,
    /// Contacts of all bodies, loaded or close.
    pub(crate) contacts: Vec<Contact>,
    pub(crate) tracks: Vec<PoseTrack>,
    pub(crate) proxies: Vec<Proxy>,
    pub(crate) readings: Vec<ToolReading>,
    /// Time at rest with no tool near \[s\].
    pub(crate) quiet_s: f64,
    pub(crate) sleeping: bool,
    pub(crate) rollbacks: u64,
    /// Ticks since the last roll-back.
    pub(crate) ticks_since_rollback: u64,
    /// Displacements and rotations of the last tick that passed the output gate.
    pub(crate) good_u: Vec<Node>,
    pub(crate) good_quaternions: Vec<Quaternions>,
    timestep_s: f64,
}

impl State {
    /// The object at rest; tools are absent until their first pose.
    pub fn new(model: &Model) -> Self {
        let n_tools = model.n_tools();
        let n_contacts = model.max_rows();
        Self {
            tick: 0,
            u: vec![[0.0; 4]; model.n_nodes()],
            v: vec![[0.0; 4]; model.n_nodes()],
            external_forces: Vec::new(),
            quaternions: vec![IDENTITY; model.elements.n_batches()],
            skin: SkinPositions::at_rest(&model.embedding),
            contacts: Vec::with_capacity(n_contacts),
            tracks: model.description.tools.iter().map(PoseTrack::new).collect(),
            proxies: vec![Proxy::absent(); n_tools],
            readings: vec![absent_reading(); n_tools],
            quiet_s: 0.0,
            sleeping: false,
            rollbacks: 0,
            ticks_since_rollback: u64::MAX,
            good_u: vec![[0.0; 4]; model.n_nodes()],
            good_quaternions: vec![IDENTITY; model.elements.n_batches()],
            timestep_s: model.timestep_s(),
        }
    }

    /// Becomes a copy of a state of the same model, without allocating (but for the first state with external forces).
    pub fn copy_from(&mut self, other: &Self) {
        self.u.copy_from_slice(&other.u);
        self.v.copy_from_slice(&other.v);
        self.external_forces.clone_from(&other.external_forces);
        self.quaternions.copy_from_slice(&other.quaternions);
        self.skin.copy_from(&other.skin);
        self.contacts.clear();
        self.contacts.extend_from_slice(&other.contacts);
        self.tracks.clone_from_slice(&other.tracks);
        self.proxies.copy_from_slice(&other.proxies);
        self.readings.copy_from_slice(&other.readings);
        self.good_u.copy_from_slice(&other.good_u);
        self.good_quaternions.copy_from_slice(&other.good_quaternions);
        self.tick = other.tick;
        self.quiet_s = other.quiet_s;
        self.sleeping = other.sleeping;
        self.rollbacks = other.rollbacks;
        self.ticks_since_rollback = other.ticks_since_rollback;
    }

    /// Ticks taken since the state was made.
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// Simulated time \[s\].
    pub fn sim_time_s(&self) -> f64 {
        self.tick as f64 * self.timestep_s
    }

    /// Readings of the tools.
    pub fn tools(&self) -> &[ToolReading] {
        &self.readings
    }

    /// Whether the object sleeps.
    pub fn sleeping(&self) -> bool {
        self.sleeping
    }

    /// Roll-backs since the state was made.
    pub fn rollbacks(&self) -> u64 {
        self.rollbacks
    }

    /// World positions of the skin, `[n_skin]` \[m\].
    pub fn write_skin(&self, model: &Model, out: &mut [[f32; 3]]) {
        model.embedding.copy_positions(&self.skin, out);
    }

    /// Offsets of the skin from rest, `[n_skin]` \[m\].
    pub fn write_skin_offsets(&self, model: &Model, out: &mut [[f32; 3]]) {
        model.embedding.copy_offsets(&self.skin, out);
    }

    /// Offsets with a fourth component of zero, `[n_skin]` \[m\].
    pub fn write_padded_offsets(&self, model: &Model, out: &mut [[f32; 4]]) {
        model.embedding.copy_padded_offsets(&self.skin, out);
    }

    /// Displacements in the order of the mesh's nodes, `[n_nodes]` \[m\].
    pub fn node_displacements(&self, model: &Model) -> Vec<Vector3<f64>> {
        in_mesh_order(model, &self.u)
    }

    /// Velocities in the order of the mesh's nodes, `[n_nodes]` \[m/s\].
    pub fn node_velocities(&self, model: &Model) -> Vec<Vector3<f64>> {
        in_mesh_order(model, &self.v)
    }

    /// Sets displacements in the order of the mesh's nodes, at rest velocity; fixed nodes keep theirs. For tests and tools.
    pub fn set_node_displacements(&mut self, model: &Model, displacements: &[Vector3<f64>]) {
        for (internal, &node) in model.order.mesh_of_internal[..model.n_free].iter().enumerate() {
            let d = displacements[node as usize];
            self.u[internal] = [d.x as f32, d.y as f32, d.z as f32, 0.0];
            self.v[internal] = [0.0; 4];
        }
        (self.sleeping, self.quiet_s) = (false, 0.0);
        model.embedding.apply(&self.u, &mut self.skin);
    }

    /// Sets constant forces that act in every tick from now on, in the order of the mesh's nodes, `[n_nodes]` \[N\]; an
    /// empty slice removes them. Forces on fixed nodes have no effect. Training lifts the skin with them, which contact
    /// cannot.
    ///
    /// # Panics
    /// If there are neither none nor `n_nodes` forces.
    pub fn set_external_forces(&mut self, model: &Model, forces: &[Vector3<f64>]) {
        assert!(forces.is_empty() || forces.len() == model.n_nodes(), "{} forces", forces.len());
        let of_node = |&node: &u32| forces[node as usize].cast::<f32>();
        let free = &model.order.mesh_of_internal[..if forces.is_empty() { 0 } else { model.n_free }];
        self.external_forces.clear();
        self.external_forces.extend(free.iter().map(of_node).map(|f| [f.x, f.y, f.z, 0.0]));
        (self.sleeping, self.quiet_s) = (false, 0.0);
    }

    /// Speed of the fastest node \[m/s\].
    pub(crate) fn max_speed(&self) -> f32 {
        let squared = |n: &Node| n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        self.v.iter().map(squared).fold(0.0, f32::max).sqrt()
    }

    pub(crate) fn proxies_are_finite(&self) -> bool {
        let is_finite = |p: &Proxy| {
            p.twist
                .iter()
                .chain(p.pose.translation.vector.iter())
                .chain(p.pose.rotation.coords.iter())
                .all(|c| c.is_finite())
        };
        self.proxies.iter().all(is_finite)
    }

    /// Contacts after the last tick, loaded or close.
    pub fn contacts(&self) -> impl Iterator<Item = ContactReading> + '_ {
        self.contacts.iter().map(|c| {
            let normal = c.normal.cast::<f64>();
            let force = c.force.cast::<f64>();
            let normal_force = force.dot(&normal);
            ContactReading {
                body: c.body as usize,
                point_m: Point3::from(c.point.cast::<f64>()),
                normal,
                gap_m: f64::from(c.gap),
                normal_force_n: normal_force,
                tangential_force_n: force - normal * normal_force,
            }
        })
    }
}

impl Clone for State {
    fn clone(&self) -> Self {
        let mut contacts = Vec::with_capacity(self.contacts.capacity());
        contacts.extend_from_slice(&self.contacts);
        Self {
            tick: self.tick,
            u: self.u.clone(),
            v: self.v.clone(),
            external_forces: self.external_forces.clone(),
            quaternions: self.quaternions.clone(),
            skin: self.skin.clone(),
            contacts,
            tracks: self.tracks.clone(),
            proxies: self.proxies.clone(),
            readings: self.readings.clone(),
            quiet_s: self.quiet_s,
            sleeping: self.sleeping,
            rollbacks: self.rollbacks,
            ticks_since_rollback: self.ticks_since_rollback,
            good_u: self.good_u.clone(),
            good_quaternions: self.good_quaternions.clone(),
            timestep_s: self.timestep_s,
        }
    }
}

fn in_mesh_order(model: &Model, internal: &[Node]) -> Vec<Vector3<f64>> {
    let of_node = |&i: &u32| {
        let n = internal[i as usize];
        Vector3::new(n[0], n[1], n[2]).cast()
    };
    model.order.internal_of_mesh.iter().map(of_node).collect()
}

fn absent_reading() -> ToolReading {
    ToolReading {
        present: false,
        force_n: Vector3::zeros(),
        torque_n_m: Vector3::zeros(),
        contact_force_n: Vector3::zeros(),
        contact_point_m: Point3::origin(),
        reference_contact_point_m: Point3::origin(),
        contact_point_is_new: false,
        proxy: Isometry3::identity(),
        pose_sequence: 0,
        pose_source_time_ns: 0,
        pose_age_s: f64::INFINITY,
        n_contacts: 0,
        in_contact: false,
        sliding: false,
        saturated: false,
        stale: true,
        placements: 0,
    }
}
