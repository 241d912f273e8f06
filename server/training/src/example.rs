//! One interaction solved by both models, or the reason why it is not.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use crate::coarse::Settling;
use crate::solve_info::SolveInfo;
use crate::worth::Worth;
use plica_geometry::ContactFrame;
use plica_sim::enrichment::Touch;

/// One interaction solved by both models. What is large is `f32`, as the run-time phase uses it.
#[derive(Debug, Clone, PartialEq)]
pub struct Example {
    /// Coarse nodal displacements `u`, `[n_nodes]` \[m\].
    pub displacements: Vec<[f32; 3]>,
    /// `d = s_a - s_c` with the accurate skin tied to the coarse imprint, `[n_skin]` \[m\].
    pub detail: Vec<[f32; 3]>,
    /// `s_a - s_c` with the accurate model's own contact, `[n_skin]` \[m\]; evaluation only.
    pub independent_detail: Option<Vec<[f32; 3]>>,
    /// Contact point on the reference skin \[m\].
    pub contact_point: [f64; 3],
    /// Rows `tau`, `theta`, `normal` at the contact point.
    pub contact_frame: [[f64; 3]; 3],
    /// `world <- tool`: position \[m\] and quaternion `xyzw`.
    pub tool_pose: [f64; 7],
    /// Force on the tool \[N\]: coarse.
    pub coarse_force: [f64; 3],
    /// Force on the tool \[N\]: accurate, tied.
    pub tied_force: [f64; 3],
    /// Force on the tool \[N\]: accurate, its own contact; evaluation only.
    pub independent_force: Option<[f64; 3]>,
    /// Its record in the metadata.
    pub record: Record,
}

/// Record of an example in the metadata of a database.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Number of the interaction in its plan, rejected ones counted.
    pub index: u32,
    /// Name of its set.
    pub kind: String,
    /// Tool, by index.
    pub tool: u32,
    /// Depth or height that was drawn \[m\].
    pub depth_m: f64,
    /// Drag that was drawn \[m\].
    pub drag_m: [f64; 3],
    /// How the coarse model came to rest.
    pub settling: SettlingRecord,
    /// Skin vertices that are tied.
    pub n_tied: u32,
    /// How the tied solve went.
    pub tied: SolveInfo,
    /// How the solve with its own contact went; evaluation only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub independent: Option<SolveInfo>,
    /// The tied result without a guard, where elements of that one turned over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tied_unguarded: Option<Worth>,
    /// The same of the solve with its own contact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub independent_unguarded: Option<Worth>,
    /// [`Setup::fingerprint`](crate::Setup::fingerprint): a job that goes on checks that it is the planned one.
    pub interaction_sha256: String,
}

/// How the coarse model came to rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SettlingRecord {
    /// Simulated time from the end of the motion \[s\].
    pub time_s: f64,
    /// Farthest that a node moved in the last window \[m\].
    pub motion_m: f64,
    /// Speed of the fastest node at the end \[m/s\].
    pub speed_m_per_s: f64,
}

impl From<&Settling> for SettlingRecord {
    fn from(s: &Settling) -> Self {
        Self { time_s: s.time_s, motion_m: s.motion_m, speed_m_per_s: s.speed_m_per_s }
    }
}

/// An interaction that gives no example.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rejection {
    /// Number of the interaction in its plan.
    pub index: u32,
    /// Name of its set.
    pub kind: String,
    /// Why.
    pub reason: Reason,
    /// Why, with numbers.
    pub message: String,
    /// Contact point that was drawn, on the reference skin \[m\].
    pub contact_point_m: [f64; 3],
    /// Depth or height that was drawn \[m\].
    pub depth_m: f64,
    /// Drag that was drawn \[m\].
    pub drag_m: [f64; 3],
    /// What the accurate result would have been worth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worth: Option<Worth>,
    /// [`Setup::fingerprint`](crate::Setup::fingerprint).
    pub interaction_sha256: String,
}

/// Why an interaction gives no example.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The tool passes the object by.
    NothingTouched,
    /// The coarse model had to be rolled back.
    CoarseUnstable,
    /// The coarse model did not come to rest.
    NotSettled,
    /// Suction does not raise the coarse skin as high as was drawn.
    HeightNotReached,
    /// The tied accurate solve did not converge.
    TiedNotConverged,
    /// The tied accurate result has an element that is all but inverted.
    TiedInverted,
    /// The accurate solve with its own contact did not converge.
    IndependentNotConverged,
    /// Its result has an element that is all but inverted.
    IndependentInverted,
    /// A number of the result is not finite.
    NotFinite,
}

/// Outcome of an interaction.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// Solved: an example that is stored.
    Accepted(Box<Example>),
    /// Rejected: listed with the reason.
    Rejected(Rejection),
}

impl Example {
    /// Contact point and tool origin.
    pub fn touch(&self) -> Touch {
        let [x, y, z, ..] = self.tool_pose;
        Touch { contact_point: self.contact_point.into(), tool_origin: Point3::new(x, y, z) }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        let large = [Some(&self.displacements), Some(&self.detail), self.independent_detail.as_ref()];
        let forces = [Some(&self.coarse_force), Some(&self.tied_force), self.independent_force.as_ref()];
        let small = self.contact_point.iter().chain(self.contact_frame.iter().flatten()).chain(&self.tool_pose);
        large.into_iter().flatten().flatten().flatten().all(|x| x.is_finite())
            && forces.into_iter().flatten().flatten().chain(small).all(|x| x.is_finite())
    }
}

/// `a - b` in run-time precision.
pub(crate) fn difference(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> Vec<[f32; 3]> {
    a.iter().zip(b).map(|(a, b)| to_f32(&(a - b))).collect()
}

pub(crate) fn to_f32(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

pub(crate) fn rows(frame: &ContactFrame) -> [[f64; 3]; 3] {
    [frame.tau.into(), frame.theta.into(), frame.normal.into()]
}

pub(crate) fn numbers(p: &Point3<f64>) -> [f64; 3] {
    p.coords.into()
}
