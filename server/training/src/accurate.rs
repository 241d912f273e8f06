//! The accurate half of the tandem: quasi-static solves from rest, tied, loaded, or with contact of their own.

mod pressed;

use nalgebra::Vector3;
use plica_accurate::contact::{ContactParams, ContactSurface};
use plica_accurate::{Constraints, Energy, NodalForces, Params, Progress, Solid, SolveError, Solver, Tie, TurnGuard};
use plica_geometry::{Embedding, EmbeddingKind, HexIdx, HexMesh, NodeIdx, Skin, isoparametric};

use crate::coarse::{Interrupted, SolveObserver};
use crate::error::BuildError;
use crate::setup::AccurateDescription;
use crate::solve_info::SolveInfo;
use crate::worth::Unguarded;
pub use pressed::Touch;

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
        let (mut sum, mut unguarded) = match free {
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
        unguarded.accepted = (!sum.is_turned_over()).then(|| offsets.clone());
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
        let params = Params { tolerance: TOLERANCE, max_iterations: MAX_ITERATIONS, ..Params::default() };
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
        Unguarded { solve, worst_m: worst.unwrap_or_default(), offsets: self.offsets(x), accepted: None }
    }

    /// `A_a (x_a - x_a(rest))`: the skin's own rest positions stay what they are.
    fn offsets(&self, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let displacements: Vec<_> = x.iter().zip(&self.rest).map(|(x, rest)| x - rest).collect();
        self.embedding.apply(&displacements)
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
