//! The accurate half of the tandem: quasi-static solves from rest, tied, loaded, or with contact of their own.

use nalgebra::Vector3;
use plica_accurate::contact::{
    ContactError, ContactParams, ContactProgress, ContactState, ContactSurface, Obstacle, Press,
};
use plica_accurate::{Constraints, Energy, NodalForces, Params, Progress, Solid, SolveError, Solver, Tie, TurnGuard};
use plica_geometry::{Embedding, EmbeddingKind, HexIdx, HexMesh, NodeIdx, Skin, isoparametric};
use serde::{Deserialize, Serialize};

use crate::coarse::{Interrupted, SolveObserver};
use crate::error::BuildError;
use crate::setup::AccurateDescription;
use crate::tool_path::ToolPath;
use crate::worth::Unguarded;

/// A result with an element below this `det F` is not stored.
pub const SMALLEST_JACOBIAN: f64 = 0.05;
/// Relative volume below which the guard of a repeated solve holds a Gauss point.
const GUARD_FLOOR: f64 = 0.2;
/// Stiffnesses of that guard over the shear modulus, softest first: the first that suffices is taken.
const GUARD_STIFFNESSES: [f64; 3] = [10.0, 100.0, 1000.0];
/// Largest force left at a free coordinate, as a share of the largest nodal force.
const TOLERANCE: f64 = 1e-8;
/// Newton steps after which a solve gives up.
const MAX_ITERATIONS: u32 = 100;
/// Load steps of a lift that does not converge at once.
const LOAD_STEPS: u32 = 8;
/// Increments of a press, as a share of the mean edge of the mesh.
const INCREMENT_CELLS: f64 = 0.5;

/// The accurate model, ready to be solved from rest again and again.
pub struct Accurate {
    rest: Vec<Vector3<f64>>,
    solid: Solid,
    weight: Option<NodalForces>,
    constraints: Constraints,
    /// Skin vertices as rows over the accurate nodes, trilinear.
    embedding: Embedding,
    surface: ContactSurface,
    contact: ContactParams,
    /// Mean longest edge of a hexahedron \[m\].
    cell_m: f64,
    /// Centre of each hexahedron at rest \[m\].
    centres: Vec<[f64; 3]>,
    solver: Solver,
}

/// An equilibrium of the accurate model.
#[derive(Debug, Clone)]
pub struct AccurateResult {
    /// Skin offsets from rest, `[n_skin]` \[m\].
    pub offsets: Vec<Vector3<f64>>,
    /// Force on the tool \[N\].
    pub tool_force: Vector3<f64>,
    /// How the solve went.
    pub solve: SolveInfo,
    /// The result without the guard, where elements of that one turned over.
    pub unguarded: Option<Box<Unguarded>>,
}

/// Size of the accurate model's linear systems.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AccurateSize {
    /// Free unknowns.
    pub n_unknowns: usize,
    /// Values of the Cholesky factor.
    pub n_factor_values: usize,
}

/// How an accurate solve went.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolveInfo {
    /// Newton steps.
    pub iterations: u32,
    /// Newton steps whose matrix was not positive definite.
    pub indefinite_steps: u32,
    /// Largest force left at a free coordinate, as a share of the largest nodal force.
    pub residual: f64,
    /// Smallest `det F`.
    pub smallest_jacobian: f64,
}

/// Why there is no equilibrium.
#[derive(Debug)]
pub enum AccurateFailure {
    /// Asked to stop.
    Interrupted,
    /// It was not found: why, and the last state.
    Failed(String, Box<Unguarded>),
}

impl From<Interrupted> for AccurateFailure {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

impl Accurate {
    /// Builds the model and analyses its sparsity; `skin` is what its results are given on.
    ///
    /// # Errors
    /// See [`BuildError`].
    pub fn new(
        description: &AccurateDescription,
        skin: &Skin,
        gravity_m_per_s2: &Vector3<f64>,
    ) -> Result<Self, BuildError> {
        let mesh = &description.mesh;
        let solid = Solid::new(mesh, &description.materials)?;
        let rest: Vec<_> = mesh.nodes().iter().map(|p| p.coords).collect();
        let mut constraints = Constraints::none(mesh.n_nodes());
        let held = description.fixed.iter().enumerate().filter(|(_, fixed)| **fixed);
        held.for_each(|(node, _)| constraints.hold(node, &rest[node]));
        let embedding = Embedding::new(mesh, skin.positions(), EmbeddingKind::Trilinear)?;
        let surface = ContactSurface::of_boundary(mesh, &constraints);
        let moduli = description.materials.iter().map(|m| m.young_modulus_pa);
        let softest = moduli.fold(f64::INFINITY, f64::min);
        let cell_m = mesh.mean_longest_edge();
        let contact = ContactParams::new(softest, INCREMENT_CELLS * cell_m);
        let centre = |hex| mesh.corner_positions(hex).iter().map(|p| p.coords / 8.0).sum::<Vector3<f64>>().into();
        let centres = mesh.hex_indices().map(centre).collect();
        let solver = Solver::new(&constraints, &[&solid]).map_err(SolveError::from)?;
        let weight = (*gravity_m_per_s2 != Vector3::zeros())
            .then(|| weight(mesh, &description.densities_kg_per_m3, gravity_m_per_s2));
        Ok(Self { rest, solid, weight, constraints, embedding, surface, contact, cell_m, centres, solver })
    }

    /// Mean longest edge of the hexahedra \[m\].
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// Size of the linear systems.
    pub fn size(&self) -> AccurateSize {
        let (n_unknowns, n_factor_values) = self.solver.size();
        AccurateSize { n_unknowns, n_factor_values }
    }

    /// Skin vertices as rows over the accurate nodes.
    pub fn embedding(&self) -> &Embedding {
        &self.embedding
    }

    /// From rest, tied. Where elements turn over, again with a guard against it, as soft a one as suffices.
    ///
    /// # Errors
    /// See [`AccurateFailure`].
    pub fn tied(&mut self, tie: &Tie, observer: SolveObserver<'_>) -> Result<AccurateResult, AccurateFailure> {
        let mut x = self.rest.clone();
        let free = self.minimise(&[tie], None, &mut x, observer);
        let (mut sum, unguarded) = match free {
            Ok(solve) if solve.is_turned_over() => (solve, Box::new(self.unguarded(&x, solve))),
            Ok(solve) => {
                let (offsets, tool_force) = (self.offsets(&x), -tie.force(&x));
                return Ok(AccurateResult { offsets, tool_force, solve, unguarded: None });
            }
            Err(AccurateFailure::Failed(_, unguarded)) => (unguarded.solve, unguarded),
            Err(interrupted) => return Err(interrupted),
        };
        for stiffness in GUARD_STIFFNESSES {
            sum = sum.followed_by(&self.minimise(&[tie], Some(stiffness), &mut x, observer)?);
            if !sum.is_turned_over() {
                break;
            }
        }
        let (offsets, tool_force) = (self.offsets(&x), -tie.force(&x));
        Ok(AccurateResult { offsets, tool_force, solve: sum, unguarded: Some(unguarded) })
    }

    /// From rest, under forces at skin vertices, `[n_skin]` \[N\]. In load steps if it does not converge at once.
    ///
    /// # Errors
    /// See [`AccurateFailure`].
    pub fn loaded(
        &mut self,
        skin_forces: &[Vector3<f64>],
        observer: SolveObserver<'_>,
    ) -> Result<AccurateResult, AccurateFailure> {
        let nodal = self.embedding.apply_transpose(skin_forces);
        let share = |share: f64| {
            let loads = nodal.iter().enumerate().filter(|(_, f)| **f != Vector3::zeros());
            NodalForces::new(loads.map(|(n, f)| (NodeIdx::from_index(n), f * share)).collect())
        };
        let mut x = self.rest.clone();
        let mut solve = self.minimise(&[&share(1.0)], None, &mut x, observer);
        if let Err(AccurateFailure::Failed(..)) = solve {
            x.copy_from_slice(&self.rest);
            let mut sum = SolveInfo::default();
            for step in 1..=LOAD_STEPS {
                let load = share(f64::from(step) / f64::from(LOAD_STEPS));
                sum = sum.followed_by(&self.minimise(&[&load], None, &mut x, observer)?);
            }
            solve = Ok(sum);
        }
        let tool_force = -skin_forces.iter().sum::<Vector3<f64>>();
        Ok(AccurateResult { offsets: self.offsets(&x), tool_force, solve: solve?, unguarded: None })
    }

    /// From rest, with the model's own unilateral frictional contact: the tool follows `path`. Where elements turn over or no
    /// equilibrium is found, again with a guard, in shorter increments.
    ///
    /// # Errors
    /// See [`AccurateFailure`].
    pub fn pressed(
        &mut self,
        obstacle: &Obstacle,
        friction: f64,
        path: &ToolPath,
        observer: SolveObserver<'_>,
    ) -> Result<AccurateResult, AccurateFailure> {
        let touch = Touch { obstacle, friction, path };
        let (mut sum, unguarded) = match self.press(&touch, None, observer) {
            Ok(AccurateResult { solve, unguarded: Some(unguarded), .. }) => (solve, unguarded),
            Err(AccurateFailure::Failed(_, unguarded)) => (unguarded.solve, unguarded),
            other => return other,
        };
        let mut last = None;
        for stiffness in GUARD_STIFFNESSES {
            let result = self.press(&touch, Some(stiffness), observer)?;
            sum = sum.followed_by(&result.solve);
            let is_over = !result.solve.is_turned_over();
            last = Some(AccurateResult { solve: sum, unguarded: None, ..result });
            if is_over {
                break;
            }
        }
        let result = last.expect("guards are tried");
        Ok(AccurateResult { unguarded: Some(unguarded), ..result })
    }

    fn press(
        &mut self,
        touch: &Touch<'_>,
        guard: Option<f64>,
        observer: SolveObserver<'_>,
    ) -> Result<AccurateResult, AccurateFailure> {
        let mut x = self.rest.clone();
        if self.weight.is_some() {
            self.minimise(&[], guard, &mut x, observer)?;
        }
        let poses = touch.path.poses();
        let mut state = ContactState::untouched(&self.surface, &poses[0], &x);
        let guard = guard.map(|ratio| TurnGuard { solid: &self.solid, floor: GUARD_FLOOR, stiffness_ratio: ratio });
        let guard = guard.iter().map(|g| g as &dyn Energy);
        let energies: Vec<_> = energies(&self.solid, &self.weight, &[]).into_iter().chain(guard).collect();
        let setting = Press {
            energies: &energies,
            constraints: &self.constraints,
            surface: &self.surface,
            obstacle: touch.obstacle,
            friction: touch.friction,
            params: self.contact,
        };
        let mut last = SolveInfo::default();
        let mut watch = |progress: ContactProgress| {
            last.residual = progress.newton.residual;
            last.iterations += u32::from(progress.newton.iteration > 0);
            observer()
        };
        match setting.follow(&poses[1..], &mut self.solver, &mut state, &mut x, &mut watch) {
            Ok(info) => {
                let solve = SolveInfo {
                    iterations: info.newton_iterations,
                    indefinite_steps: info.indefinite_steps,
                    residual: info.residual,
                    smallest_jacobian: info.smallest_jacobian.unwrap_or(1.0),
                };
                let unguarded = solve.is_turned_over().then(|| Box::new(self.unguarded(&x, solve)));
                Ok(AccurateResult { offsets: self.offsets(&x), tool_force: info.force_n, solve, unguarded })
            }
            Err(ContactError::Cancelled { .. }) => Err(AccurateFailure::Interrupted),
            Err(error) => {
                let smallest_jacobian = self.solid.smallest_jacobian(&x).unwrap_or(1.0);
                let unguarded = self.unguarded(&x, SolveInfo { smallest_jacobian, ..last });
                Err(AccurateFailure::Failed(error.to_string(), Box::new(unguarded)))
            }
        }
    }

    fn minimise(
        &mut self,
        loads: &[&dyn Energy],
        guard: Option<f64>,
        x: &mut [Vector3<f64>],
        observer: SolveObserver<'_>,
    ) -> Result<SolveInfo, AccurateFailure> {
        let Self { solid, solver, weight, constraints, .. } = &mut *self;
        let guard = guard.map(|stiffness_ratio| TurnGuard { solid, floor: GUARD_FLOOR, stiffness_ratio });
        let guard = guard.iter().map(|g| g as &dyn Energy);
        let energies: Vec<_> = energies(solid, weight, loads).into_iter().chain(guard).collect();
        let params = Params { tolerance: TOLERANCE, max_iterations: MAX_ITERATIONS };
        let mut steps = 0;
        let mut watch = |progress: Progress| {
            steps = progress.iteration;
            observer()
        };
        match solver.minimise(&energies, constraints, &params, x, &mut watch) {
            Ok(info) => Ok(SolveInfo {
                iterations: info.iterations,
                indefinite_steps: info.indefinite_steps,
                residual: info.residuals.last().copied().unwrap_or(0.0),
                smallest_jacobian: info.smallest_jacobian.unwrap_or(1.0),
            }),
            Err(SolveError::Cancelled { .. }) => Err(AccurateFailure::Interrupted),
            Err(error) => {
                let solve = SolveInfo {
                    iterations: steps,
                    residual: error.residual().unwrap_or(f64::NAN),
                    smallest_jacobian: self.solid.smallest_jacobian(x).unwrap_or(1.0),
                    ..SolveInfo::default()
                };
                Err(AccurateFailure::Failed(error.to_string(), Box::new(self.unguarded(x, solve))))
            }
        }
    }

    fn unguarded(&self, x: &[Vector3<f64>], solve: SolveInfo) -> Unguarded {
        let worst = self.solid.most_compressed(x).map(|hex| self.centres[hex.index()]);
        Unguarded { solve, worst_m: worst.unwrap_or_default(), offsets: self.offsets(x) }
    }

    /// `A_a (x_a - x_a(rest))`: the skin's own rest positions stay what they are.
    fn offsets(&self, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let displacements: Vec<_> = x.iter().zip(&self.rest).map(|(x, rest)| x - rest).collect();
        self.embedding.apply(&displacements)
    }
}

/// A tool, its friction and its path.
struct Touch<'a> {
    obstacle: &'a Obstacle,
    friction: f64,
    path: &'a ToolPath,
}

impl SolveInfo {
    /// Whether an element is all but inverted.
    pub fn is_turned_over(&self) -> bool {
        self.smallest_jacobian < SMALLEST_JACOBIAN
    }

    /// Of this solve and the one that went on from it.
    pub fn followed_by(&self, next: &Self) -> Self {
        Self {
            iterations: self.iterations + next.iterations,
            indefinite_steps: self.indefinite_steps + next.indefinite_steps,
            ..*next
        }
    }
}

fn energies<'a>(solid: &'a Solid, weight: &'a Option<NodalForces>, loads: &[&'a dyn Energy]) -> Vec<&'a dyn Energy> {
    let weight = weight.iter().map(|w| w as &dyn Energy);
    std::iter::once(solid as &dyn Energy).chain(weight).chain(loads.iter().copied()).collect()
}

/// `f_a = int rho N_a dV g`, by 2 x 2 x 2 Gauss points.
fn weight(mesh: &HexMesh, densities: &[f64], gravity: &Vector3<f64>) -> NodalForces {
    let mut forces = Vec::with_capacity(8 * mesh.n_hexes());
    for (hex, (nodes, density)) in mesh.hexes().iter().zip(densities).enumerate() {
        let corners = mesh.corner_positions(HexIdx::from_index(hex));
        let mut mass = [0.0; 8];
        for xi in plica_accurate::GAUSS_POINTS {
            let volume = isoparametric::jacobian(&corners, xi).determinant();
            let shares = isoparametric::shape_functions(xi);
            mass.iter_mut().zip(shares).for_each(|(m, share)| *m += density * volume * share);
        }
        forces.extend(nodes.iter().zip(mass).map(|(node, m)| (*node, gravity * m)));
    }
    NodalForces::new(forces)
}
