//! One way to enrich: how the present state is compared with the examples, and how their detail is laid on the skin.

use nalgebra::{Matrix3, Point3, Vector3};
use plica_geometry::{ContactFrame, ReferenceSkin, SurfacePoint, TriangleIdx, VertexIdx};

use super::charts::{ChartOptions, Charts, Coordinates};
use super::field::{Field, FieldOptions, FieldScratch, Interpolator};
use super::groups::{Groups, Planar};
use super::kriging::{Kriging, KrigingChoice};
use super::linear::{Linear, LinearKind};
use super::modes::Precision;
use super::rbf::Rbf;
use super::rescale::Rescale;
use super::situation::{Situation, Touch, coordinates};
use super::ssh12::{Ssh12, Ssh12Options};
use super::stencil::Stencil;
use crate::lanes::{F, Node};
use crate::model::Model;
use crate::state::State;

/// Examples of coarse and accurate skins, as training leaves them.
#[derive(Debug, Clone, Default)]
pub struct Examples {
    /// Coarse displacements in the order of the mesh's nodes, `[n][n_nodes]` \[m\].
    pub displacements: Vec<Vec<[f32; 3]>>,
    /// `s_a - s_c`, `[n][n_skin]` \[m\].
    pub details: Vec<Vec<[f32; 3]>>,
    /// Where the tool touched, `[n]`.
    pub touches: Vec<Touch>,
}

/// How the present state is compared with examples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Correlator {
    /// Not at all: the coarse dent is rescaled, nothing else.
    Rescale,
    /// The paper's.
    Ssh12(Ssh12Options),
    /// A linear map.
    Linear(LinearKind),
    /// The position of the tool, with a width in coarse cells.
    Rbf {
        /// Width of the basis functions, in coarse cells.
        width_cells: f64,
    },
    /// Gaussian-process weights.
    Kriging,
}

/// A way to enrich. Lengths come from the coarse mesh: its cells are what detail is missing below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnrichmentOptions {
    /// How states are compared.
    pub correlator: Correlator,
    /// How detail is laid on the skin.
    pub field: FieldOptions,
    /// Radius of the chart around a contact point, in coarse cells.
    pub radius_cells: f64,
    /// Distance of the charts' anchors, in coarse cells.
    pub anchor_cells: f64,
    /// Geodesic or projected.
    pub coordinates: Coordinates,
    /// Whether what is not trusted fades to the coarse skin.
    pub fade: bool,
    /// Axes that stamps are laid out along.
    pub axes: [Vector3<f64>; 2],
}

impl Default for EnrichmentOptions {
    fn default() -> Self {
        Self {
            correlator: Correlator::Kriging,
            field: FieldOptions {
                interpolator: Interpolator::Stamp,
                texels: 32,
                window: [0.75, 1.0],
                modes: 32,
                precision: Precision::I16,
                control_variate: true,
            },
            radius_cells: 7.0,
            anchor_cells: 0.5,
            coordinates: Coordinates::Exponential,
            fade: true,
            axes: [Vector3::x(), Vector3::y()],
        }
    }
}

/// Normals farther apart than this lie on sides of the object that have nothing to do with each other \[rad\].
const MAX_NORMAL_ANGLE: f64 = 2.2;
/// Pitch and width of the stencil, in coarse cells.
const STENCIL_CELLS: [f64; 2] = [2.0 / 3.0, 1.0];

/// Examples whose displacements differ by less than this share are one.
const DUPLICATE: f64 = 5e-3;

/// Why there is no enricher.
#[derive(Debug, thiserror::Error)]
pub enum EnricherError {
    /// An array of the examples has another length than the model or the other arrays.
    #[error("example {example} has {found} {what}, {expected} are needed")]
    Length {
        /// The example.
        example: usize,
        /// Which array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length it should have.
        expected: usize,
    },
    /// Fewer examples than the method needs.
    #[error("{found} examples, at least {needed} are needed")]
    TooFew {
        /// Examples.
        found: usize,
        /// Needed.
        needed: usize,
    },
    /// The method's matrix is singular.
    #[error("the examples do not determine the weights: are they all the same?")]
    Singular,
}

/// Tables of one way to enrich one model; never changes.
#[derive(Debug, Clone)]
pub struct Enricher {
    options: EnrichmentOptions,
    reference: ReferenceSkin,
    /// Triangles around each vertex.
    fans: Vec<Vec<TriangleIdx>>,
    rest: Planar,
    normals: Planar,
    charts: Charts,
    correlation: Correlation,
    field: Field,
    n_examples: usize,
    n_nodes: usize,
    choice: Option<KrigingChoice>,
    /// Of charts \[m\].
    radius: f32,
}

#[derive(Debug, Clone)]
enum Correlation {
    None,
    Ssh12(Ssh12),
    Linear(Linear),
    Rbf(Rbf),
    Kriging(Box<Kriging>),
}

impl Correlation {
    /// Writes the weights `[n]` and returns the confidence.
    fn weigh(&self, situation: &Situation<'_>, kernel: &mut [f32], weights: &mut [f32]) -> f32 {
        match self {
            Self::None => 1.0,
            Self::Ssh12(ssh12) => ssh12.weigh(situation, weights),
            Self::Linear(linear) => linear.weigh(situation, weights),
            Self::Rbf(rbf) => rbf.weigh(situation, kernel, weights),
            Self::Kriging(kriging) => kriging.weigh(situation, kernel, weights),
        }
    }
}

/// Scratch of an evaluation; means nothing between calls.
#[derive(Debug, Clone)]
pub struct EnricherScratch {
    layout: Vec<[F; 2]>,
    weights: Vec<f32>,
    kernel: Vec<f32>,
    field: FieldScratch,
}

/// A contact point with its frame on the reference skin.
#[derive(Debug, Clone, Copy)]
struct Place {
    point: SurfacePoint,
    corners: [VertexIdx; 3],
    frame: ContactFrame,
}

impl Enricher {
    /// Prepares everything that does not depend on the state. Takes seconds.
    ///
    /// # Errors
    /// See [`EnricherError`].
    pub fn new(model: &Model, examples: &Examples, options: EnrichmentOptions) -> Result<Self, EnricherError> {
        check(model, examples)?;
        let examples = &without_duplicates(examples);
        let skin = &model.description().skin;
        let reference = ReferenceSkin::new(skin);
        let groups = Groups::new(skin.n_vertices());
        let cell = f64::from(model.cell_size);
        let chart = ChartOptions {
            radius_m: options.radius_cells * cell,
            anchor_spacing_m: options.anchor_cells * cell,
            max_normal_angle: MAX_NORMAL_ANGLE,
            coordinates: options.coordinates,
            axes: options.axes,
        };
        let row = |v: Vector3<f64>| <[f64; 3]>::from(v);
        let tables = Tables {
            rest: Planar::new(groups, |v| row(skin.positions()[v].coords)),
            normals: Planar::new(groups, |v| row(reference.vertex_normals()[v])),
            charts: Charts::new(&reference, groups, chart),
            fans: fans(skin),
            axes: options.axes,
        };
        let seen = SeenExamples::new(model, &reference, &tables, examples);
        let situations = seen.situations();
        let radius = chart.radius_m;
        let rescale = if options.field.control_variate || options.correlator == Correlator::Rescale {
            Rescale::fit(&situations, &examples.details, reference.vertex_areas(), radius)
        } else {
            Rescale::none(radius)
        };
        let without = options.correlator == Correlator::Rescale;
        let taught = if without { (&[][..], &[][..]) } else { (&situations[..], &examples.details[..]) };
        let field = Field::new(options.field, radius, &rescale, &reference, taught);
        let (correlation, choice) = correlation(model, &reference, options.correlator, &situations, &field, cell)?;
        let Tables { rest, normals, charts, fans, .. } = tables;
        let (n_examples, n_nodes) = (taught.0.len(), model.n_nodes());
        Ok(Self {
            options,
            fans,
            rest,
            normals,
            charts,
            correlation,
            field,
            n_examples,
            n_nodes,
            choice,
            reference,
            radius: radius as f32,
        })
    }

    /// What it was made with.
    pub fn options(&self) -> &EnrichmentOptions {
        &self.options
    }

    /// The hyper-parameters that leave-one-out chose, for kriging.
    pub fn kriging_choice(&self) -> Option<KrigingChoice> {
        self.choice
    }

    /// Radius of the chart around a contact point \[m\].
    pub fn radius_m(&self) -> f64 {
        f64::from(self.radius)
    }

    /// Bytes of tables: those of the charts, and those of the examples.
    pub fn bytes(&self) -> [usize; 2] {
        [self.charts.bytes(), self.field.bytes()]
    }

    /// Scratch for [`Enricher::evaluate`].
    pub fn scratch(&self) -> EnricherScratch {
        let n_skin = self.reference.skin().n_vertices();
        EnricherScratch {
            layout: vec![[F::ZERO; 2]; Groups::new(n_skin).n()],
            weights: vec![0.0; self.n_examples],
            kernel: vec![0.0; self.n_examples],
            field: self.field.scratch(n_skin),
        }
    }

    /// Detail that one contact adds, `[n_skin]` \[m\], and how far it is trusted: 0 is the plain coarse skin. `offsets` are those of
    /// the coarse skin from rest, as [`State::write_padded_offsets`] leaves them.
    pub fn evaluate(
        &self,
        model: &Model,
        state: &State,
        offsets: &[Node],
        touch: &Touch,
        scratch: &mut EnricherScratch,
        detail: &mut [Node],
    ) -> f32 {
        self.evaluate_within([0.0, 1.0], &state.u[..model.n_free], offsets, touch, scratch, detail)
    }

    /// The same with bounds for the confidence.
    pub(crate) fn evaluate_within(
        &self,
        [least, most]: [f32; 2],
        displacements: &[Node],
        offsets: &[Node],
        touch: &Touch,
        scratch: &mut EnricherScratch,
        detail: &mut [Node],
    ) -> f32 {
        let EnricherScratch { layout, weights, kernel, field } = scratch;
        let Some(place) = self.lay_out(touch, layout) else {
            detail.fill([0.0; 4]);
            return 0.0;
        };
        let situation = situation(displacements, offsets, layout, &place, touch);
        let confidence = self.correlation.weigh(&situation, kernel, weights).clamp(least, most);
        let fades = self.options.fade && matches!(self.correlation, Correlation::Kriging(_));
        self.field.evaluate(&situation, weights, if fades { confidence } else { 1.0 }, field, detail);
        confidence
    }

    /// Detail with given weights `[n]`, in place of the correlator's: to see what interpolation alone does.
    pub fn interpolate(
        &self,
        model: &Model,
        state: &State,
        offsets: &[Node],
        (touch, weights): (&Touch, &[f32]),
        scratch: &mut EnricherScratch,
        detail: &mut [Node],
    ) {
        let EnricherScratch { layout, field, .. } = scratch;
        detail.fill([0.0; 4]);
        if let Some(place) = self.lay_out(touch, layout) {
            let situation = situation(&state.u[..model.n_free], offsets, layout, &place, touch);
            self.field.evaluate(&situation, weights, 1.0, field, detail);
        }
    }

    /// Lays the skin out around a contact point; `None` where no chart reaches.
    fn lay_out(&self, touch: &Touch, layout: &mut [[F; 2]]) -> Option<Place> {
        let place = place(&self.reference, &self.fans, &self.options.axes, touch);
        let chart = self.charts.at(place.corners, &place.point, &place.frame)?;
        self.charts.lay_out(&chart, &self.rest, &self.normals, layout);
        Some(place)
    }

    /// The skin vertex nearest to a contact point.
    pub(crate) fn nearest_vertex(&self, touch: &Touch) -> usize {
        nearest(self.reference.skin().positions(), &touch.contact_point)
    }

    /// How much a vertex belongs to the contact that was last evaluated: 1 there, 0 where its chart ends.
    #[inline(always)]
    pub(crate) fn closeness(&self, scratch: &EnricherScratch, vertex: usize) -> f32 {
        let [x, y] = coordinates(&scratch.layout, vertex);
        (1.0 - (x * x + y * y) / (self.radius * self.radius)).max(0.0).powi(2)
    }

    /// Whether it was made for such a model.
    pub fn fits(&self, model: &Model) -> bool {
        self.n_nodes == model.n_nodes() && self.reference.skin().n_vertices() == model.n_skin()
    }
}

/// What examples are looked at with.
struct Tables {
    rest: Planar,
    normals: Planar,
    charts: Charts,
    fans: Vec<Vec<TriangleIdx>>,
    axes: [Vector3<f64>; 2],
}

/// The examples as the run time would see them.
struct SeenExamples {
    displacements: Vec<Vec<Node>>,
    offsets: Vec<Vec<Node>>,
    layouts: Vec<Vec<[F; 2]>>,
    places: Vec<Place>,
    touches: Vec<Touch>,
}

impl SeenExamples {
    fn new(model: &Model, reference: &ReferenceSkin, tables: &Tables, examples: &Examples) -> Self {
        let mut seen = Self {
            displacements: Vec::new(),
            offsets: Vec::new(),
            layouts: Vec::new(),
            places: Vec::new(),
            touches: examples.touches.clone(),
        };
        let mut state = State::new(model);
        for (displacements, touch) in examples.displacements.iter().zip(&examples.touches) {
            let nodes: Vec<_> = displacements.iter().map(|d| Vector3::from(d.map(f64::from))).collect();
            state.set_node_displacements(model, &nodes);
            let mut offsets = vec![[0.0; 4]; model.n_skin()];
            state.write_padded_offsets(model, &mut offsets);
            let place = place(reference, &tables.fans, &tables.axes, touch);
            let mut layout = vec![[F::ZERO; 2]; Groups::new(model.n_skin()).n()];
            if let Some(chart) = tables.charts.at(place.corners, &place.point, &place.frame) {
                tables.charts.lay_out(&chart, &tables.rest, &tables.normals, &mut layout);
            }
            seen.displacements.push(state.u[..model.n_free].to_vec());
            seen.offsets.push(offsets);
            seen.layouts.push(layout);
            seen.places.push(place);
        }
        seen
    }

    fn situations(&self) -> Vec<Situation<'_>> {
        let of_example = |i: usize| {
            let (u, offsets, layout) = (&self.displacements[i], &self.offsets[i], &self.layouts[i]);
            situation(u, offsets, layout, &self.places[i], &self.touches[i])
        };
        (0..self.places.len()).map(of_example).collect()
    }
}

fn correlation(
    model: &Model,
    reference: &ReferenceSkin,
    correlator: Correlator,
    situations: &[Situation<'_>],
    field: &Field,
    cell: f64,
) -> Result<(Correlation, Option<KrigingChoice>), EnricherError> {
    let singular = || EnricherError::Singular;
    let mesh = (&model.description().mesh, &model.order);
    Ok(match correlator {
        Correlator::Rescale => (Correlation::None, None),
        Correlator::Ssh12(options) => (Correlation::Ssh12(Ssh12::new(situations, options)), None),
        Correlator::Linear(kind) => {
            let linear = Linear::new(kind, situations, field.products(), mesh).ok_or_else(singular)?;
            (Correlation::Linear(linear), None)
        }
        Correlator::Rbf { width_cells } => {
            (Correlation::Rbf(Rbf::new(situations, width_cells * cell).ok_or_else(singular)?), None)
        }
        Correlator::Kriging => {
            let [pitch, width] = STENCIL_CELLS.map(|cells| cells * cell);
            let stencil = Stencil::new(reference, pitch, width);
            let kriging = Kriging::new(stencil, situations, field.products(), cell).ok_or_else(singular)?;
            (Correlation::Kriging(Box::new(kriging.0)), Some(kriging.1))
        }
    })
}

fn check(model: &Model, examples: &Examples) -> Result<(), EnricherError> {
    let found = examples.touches.len();
    if found < 2 {
        return Err(EnricherError::TooFew { found, needed: 2 });
    }
    let lengths = examples.displacements.iter().zip(&examples.details).enumerate();
    for (example, (displacements, details)) in lengths {
        for (what, found, expected) in
            [("nodes", displacements.len(), model.n_nodes()), ("skin vertices", details.len(), model.n_skin())]
        {
            if found != expected {
                return Err(EnricherError::Length { example, what, found, expected });
            }
        }
    }
    let arrays = [("displacements", examples.displacements.len()), ("details", examples.details.len())];
    match arrays.into_iter().find(|(_, n)| *n != found) {
        Some((what, n)) => Err(EnricherError::Length { example: 0, what, found: n, expected: found }),
        None => Ok(()),
    }
}

/// Of examples that are nearly the same, the first.
fn without_duplicates(examples: &Examples) -> Examples {
    let squared = |a: &[[f32; 3]], b: &[[f32; 3]]| -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2)).sum()
    };
    let mut kept: Vec<usize> = Vec::new();
    for (i, u) in examples.displacements.iter().enumerate() {
        let nothing = vec![[0.0; 3]; u.len()];
        let nearest = squared(u, &nothing) * DUPLICATE * DUPLICATE;
        if kept.iter().all(|k| squared(u, &examples.displacements[*k]) > nearest) {
            kept.push(i);
        }
    }
    Examples {
        displacements: kept.iter().map(|i| examples.displacements[*i].clone()).collect(),
        details: kept.iter().map(|i| examples.details[*i].clone()).collect(),
        touches: kept.iter().map(|i| examples.touches[*i]).collect(),
    }
}

fn situation<'a>(
    displacements: &'a [Node],
    offsets: &'a [Node],
    layout: &'a [[F; 2]],
    place: &Place,
    touch: &Touch,
) -> Situation<'a> {
    let frame = &place.frame;
    let rows = [frame.tau.transpose(), frame.theta.transpose(), frame.normal.transpose()];
    Situation {
        displacements,
        offsets,
        layout,
        contact_point: place.point.position.coords.cast(),
        frame: Matrix3::from_rows(&rows).cast(),
        tool_origin: touch.tool_origin.coords.cast(),
    }
}

/// The point of the skin next to a contact point: among the triangles around the nearest vertex.
fn place(reference: &ReferenceSkin, fans: &[Vec<TriangleIdx>], axes: &[Vector3<f64>; 2], touch: &Touch) -> Place {
    let positions = reference.skin().positions();
    let vertex = nearest(positions, &touch.contact_point);
    let point = reference.nearest_around(&touch.contact_point, &fans[vertex]);
    let point = point.unwrap_or_else(|| unreachable!("every vertex of a skin has triangles"));
    let corners = reference.skin().triangles()[point.triangle.index()];
    Place { corners, frame: reference.frame(&point, axes), point }
}

fn nearest(positions: &[Point3<f64>], p: &Point3<f64>) -> usize {
    let mut best = (f64::INFINITY, 0);
    for (v, position) in positions.iter().enumerate() {
        let squared = (position - p).norm_squared();
        if squared < best.0 {
            best = (squared, v);
        }
    }
    best.1
}

fn fans(skin: &plica_geometry::Skin) -> Vec<Vec<TriangleIdx>> {
    let mut fans = vec![Vec::new(); skin.n_vertices()];
    for (t, corners) in skin.triangles().iter().enumerate() {
        corners.iter().for_each(|v| fans[v.index()].push(TriangleIdx::from_index(t)));
    }
    fans
}
