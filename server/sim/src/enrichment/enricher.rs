//! One enrichment method with its tables: layout, correlation and interpolation.

use super::correlation::Correlation;
use super::error::EnricherError;
use super::examples::{Examples, PreparedExamples, check, without_duplicates};
use super::fade::Trust;
use super::field::{Field, FieldScratch, TrainingSet};
use super::kriging::KrigingChoice;
use super::layout::{ChartOptions, Charts};
use super::options::{Correlator, EnrichmentOptions};
use super::rescale::Rescale;
use super::situation::{Contact, Offsets, Touch, coordinates};
use super::surface::{FramedPoint, Surface};
use crate::contact::V3;
use crate::lanes::{F, LANES, Node};
use crate::model::Model;
use crate::state::State;

/// Largest angle between normals in one chart; beyond it vertices belong to another side of the object \[rad\].
const MAX_NORMAL_ANGLE: f64 = 2.2;

/// Constant tables of one enrichment method for one model.
#[derive(Debug, Clone)]
pub struct Enricher {
    options: EnrichmentOptions,
    surface: Surface,
    charts: Charts,
    correlation: Correlation,
    field: Field,
    n_examples: usize,
    n_nodes: usize,
    /// Radius of charts \[m\].
    radius: f32,
}

/// Scratch of an evaluation; undefined between calls.
#[derive(Debug, Clone)]
pub struct EnricherScratch {
    layout: Vec<[F; 2]>,
    weights: Vec<f32>,
    kernel: Vec<f32>,
    field: FieldScratch,
}

impl Enricher {
    /// Prepares everything that does not depend on the state. Takes about a second.
    ///
    /// # Errors
    /// See [`EnricherError`].
    pub fn new(model: &Model, examples: &Examples, options: EnrichmentOptions) -> Result<Self, EnricherError> {
        check(model, examples)?;
        let examples = &without_duplicates(examples);
        let surface = Surface::new(&model.description().skin, options.axes);
        let cell = f64::from(model.cell_size);
        let radius_m = options.radius_cells * cell;
        let chart = ChartOptions {
            radius_m,
            anchor_spacing_m: options.anchor_cells * cell,
            max_normal_angle: MAX_NORMAL_ANGLE,
            coordinates: options.coordinates,
        };
        let charts = Charts::new(&surface, chart);
        let prepared = PreparedExamples::new(model, &surface, &charts, examples);
        let situations = prepared.situations();
        let needs_examples = options.correlator != Correlator::Rescale;
        let rescale = if options.field.control_variate || !needs_examples {
            Rescale::fit(&situations, &examples.details, surface.reference().vertex_areas(), radius_m)
        } else {
            Rescale::none(radius_m)
        };
        let n_examples = if needs_examples { situations.len() } else { 0 };
        let training_set =
            TrainingSet { situations: &situations[..n_examples], details: &examples.details[..n_examples] };
        let field = Field::new(options.field, radius_m, &rescale, surface.reference(), training_set);
        let correlator = options.correlator;
        let correlation =
            Correlation::new(model, surface.reference(), correlator, training_set.situations, field.products())?;
        let n_nodes = model.n_nodes();
        drop(situations);
        Ok(Self { options, surface, charts, correlation, field, n_examples, n_nodes, radius: radius_m as f32 })
    }

    /// Options of the method.
    pub fn options(&self) -> &EnrichmentOptions {
        &self.options
    }

    /// Hyper-parameters chosen by leave-one-out, for kriging.
    pub fn kriging_choice(&self) -> Option<KrigingChoice> {
        self.correlation.kriging_choice()
    }

    /// Radius of the chart around a contact point \[m\].
    pub fn radius_m(&self) -> f64 {
        f64::from(self.radius)
    }

    /// Bytes of the tables of charts and of examples.
    pub fn bytes(&self) -> [usize; 2] {
        [self.charts.bytes(), self.field.bytes()]
    }

    /// Scratch for [`Enricher::evaluate`].
    pub fn scratch(&self) -> EnricherScratch {
        let n_skin = self.surface.n_vertices();
        EnricherScratch {
            layout: vec![[F::ZERO; 2]; self.surface.groups().n()],
            weights: vec![0.0; self.n_examples],
            kernel: vec![0.0; self.n_examples],
            field: self.field.scratch(n_skin),
        }
    }

    /// Detail that one contact adds, `[n_skin]` \[m\], and its confidence: 0 is the plain coarse skin.
    pub fn evaluate(&self, contact: &Contact<'_>, scratch: &mut EnricherScratch, detail: &mut [Node]) -> f32 {
        self.evaluate_within([0.0, 1.0], contact, scratch, detail).confidence
    }

    /// [`Enricher::evaluate`] with bounds on the share of the detail.
    pub(crate) fn evaluate_within(
        &self,
        bounds: [f32; 2],
        contact: &Contact<'_>,
        scratch: &mut EnricherScratch,
        detail: &mut [Node],
    ) -> Trust {
        let Some((framed, trust)) = self.weigh(bounds, contact, scratch) else {
            detail.fill([0.0; 4]);
            return Trust::NONE;
        };
        let EnricherScratch { layout, weights, field, .. } = scratch;
        self.field.evaluate(&contact.at(&framed, layout), weights, trust.share, field, detail);
        trust
    }

    /// Whether [`Enricher::sample_within`] yields the whole detail of [`Enricher::evaluate`].
    pub(crate) fn is_sampled(&self) -> bool {
        self.field.is_sampled()
    }

    /// Calls `each` with the detail of sixteen vertices at a time instead of filling an array: half the memory traffic.
    pub(crate) fn sample_within(
        &self,
        bounds: [f32; 2],
        contact: &Contact<'_>,
        scratch: &mut EnricherScratch,
        each: impl FnMut(usize, &[Node; LANES]),
    ) -> Option<Trust> {
        let (framed, trust) = self.weigh(bounds, contact, scratch)?;
        let EnricherScratch { layout, weights, field, .. } = scratch;
        self.field.sample(&contact.at(&framed, layout), weights, trust.share, field, each);
        Some(trust)
    }

    /// A contact in a running simulation; offsets are deformed less rest positions.
    pub(crate) fn contact<'a>(&'a self, model: &Model, state: &'a State, touch: &'a Touch) -> Contact<'a> {
        let offsets = Offsets::Between(&state.skin, self.surface.rest());
        Contact { displacements: &state.u[..model.n_free], offsets, touch }
    }

    /// Lays the skin out around the contact point and weighs the examples; `None` where no chart reaches.
    fn weigh(
        &self,
        [least, most]: [f32; 2],
        contact: &Contact<'_>,
        scratch: &mut EnricherScratch,
    ) -> Option<(FramedPoint, Trust)> {
        let EnricherScratch { layout, weights, kernel, .. } = scratch;
        let framed = self.lay_out(contact.touch, layout)?;
        let mut trust = self.correlation.weigh(&contact.at(&framed, layout), kernel, weights);
        trust.share = if self.options.fade { trust.share.clamp(least, most) } else { 1.0 };
        trust.confidence = trust.confidence.min(trust.share);
        Some((framed, trust))
    }

    /// Detail with given weights `[n]` in framed of the correlator's: interpolation alone.
    pub fn interpolate(
        &self,
        contact: &Contact<'_>,
        weights: &[f32],
        scratch: &mut EnricherScratch,
        detail: &mut [Node],
    ) {
        let EnricherScratch { layout, field, .. } = scratch;
        detail.fill([0.0; 4]);
        if let Some(framed) = self.lay_out(contact.touch, layout) {
            self.field.evaluate(&contact.at(&framed, layout), weights, 1.0, field, detail);
        }
    }

    /// Lays the skin out around a contact point; `None` where no chart reaches.
    fn lay_out(&self, touch: &Touch, layout: &mut [[F; 2]]) -> Option<FramedPoint> {
        let framed = self.surface.framed_point(&touch.contact_point);
        let chart = self.charts.at(&framed)?;
        self.charts.lay_out(&chart, &self.surface, layout);
        Some(framed)
    }

    /// The skin vertex nearest to a contact point.
    pub(crate) fn nearest_vertex(&self, touch: &Touch) -> usize {
        self.surface.nearest(&touch.contact_point)
    }

    /// Distance of a vertex from its rest position \[m\].
    pub(crate) fn offset(&self, state: &State, vertex: usize) -> f32 {
        let rest = self.surface.reference().skin().positions()[vertex].coords.cast::<f32>();
        (V3::from(state.skin.vertex(vertex)) - rest).norm()
    }

    /// Closeness of a vertex to the contact evaluated last: 1 at the contact point, 0 from the rim of its chart on.
    #[inline(always)]
    pub(crate) fn closeness(&self, scratch: &EnricherScratch, vertex: usize) -> f32 {
        let [x, y] = coordinates(&scratch.layout, vertex);
        (1.0 - (x * x + y * y) / (self.radius * self.radius)).max(0.0).powi(2)
    }

    /// Whether the numbers of nodes and vertices are those of a model.
    pub fn fits(&self, model: &Model) -> bool {
        self.n_nodes == model.n_nodes() && self.surface.n_vertices() == model.n_skin()
    }
}
