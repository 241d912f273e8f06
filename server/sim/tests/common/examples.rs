//! Examples of a wedge with an "accurate" skin from a formula: cheap, and known everywhere.

use nalgebra::{Point3, Vector3};
use plica_sim::enrichment::*;

use super::*;

pub const RADIUS: f64 = 0.007;

/// One press with its state, skins and contact point.
#[derive(Clone)]
pub struct Press {
    pub displacements: Vec<[f32; 3]>,
    pub detail: Vec<[f32; 3]>,
    pub touch: Touch,
}

/// A coarse skin and a ball.
pub fn scene() -> Scene {
    let shape = Wedge::default();
    let mut ball = ball(RADIUS);
    ball.friction = 0.5;
    Scene::on(wedge(&shape, [8, 4, 4]), wedge_skin(&shape, 3e-3), E, 0.45).tool(ball)
}

/// Presses at random places of `x`, `y` [m], 2 to 6 mm deep, some of them dragged.
pub fn presses(n: usize, seed: u64, [low, high]: [[f64; 2]; 2]) -> Vec<Press> {
    let mut random = Random(seed);
    let mut run = scene().run();
    let rest = run.state.clone();
    let mut between = |a: f64, b: f64| a + (b - a) * 0.5 * (random.symmetric() + 1.0);
    let place = |_| {
        let [x, y, depth] = [between(low[0], high[0]), between(low[1], high[1]), between(0.002, 0.006)];
        ([x, y, depth], [between(-0.003, 0.003), between(-0.003, 0.003)])
    };
    let places: Vec<_> = (0..n).map(place).collect();
    let press = |([x, y, depth], drag): ([f64; 3], [f64; 2])| {
        run.state.copy_from(&rest);
        let above = Point3::new(x, y, top(x)) + top_normal() * RADIUS;
        let below = above - top_normal() * depth;
        run.glide(above, below, 0.1, |_, _| ());
        let end = below + Vector3::new(drag[0], drag[1], 0.0);
        run.glide(below, end, 0.1, |_, _| ());
        run.hold(end, 0.1, |_, _| ());
        press_of(&run)
    };
    places.into_iter().map(press).collect()
}

/// The press that a run is in.
pub fn press_of(run: &Run) -> Press {
    let reading = &run.state.tools()[0];
    let to_f32 = |v: &Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
    let touch = Touch {
        contact_point: reading.reference_contact_point_m,
        tool_origin: reading.proxy.translation.vector.into(),
    };
    Press {
        displacements: run.state.node_displacements(&run.model).iter().map(to_f32).collect(),
        detail: truth(run, &touch.contact_point).iter().map(to_f32).collect(),
        touch,
    }
}

/// Reduction of the smeared indentation away from the contact, a bulge around it, and a quadratic part.
pub fn truth(run: &Run, contact: &Point3<f64>) -> Vec<Vector3<f64>> {
    let skin = &run.model.description().skin;
    let offsets = run.offsets();
    let nearest = (0..offsets.len())
        .min_by(|a, b| (skin.positions()[*a] - contact).norm().total_cmp(&(skin.positions()[*b] - contact).norm()));
    let depth = offsets[nearest.unwrap()].norm();
    let of_vertex = |(p, u): (&Point3<f64>, &Vector3<f64>)| {
        let r = (p - contact).norm();
        let smeared = 0.6 * (r / 0.01).min(1.0).powi(2);
        let bulge = 0.3 * depth * (r / 0.012).powi(2) * (-(r / 0.012).powi(2)).exp();
        let slide = 20.0 * depth * depth * (-(r / 0.015).powi(2)).exp();
        u * -smeared + top_normal() * bulge + Vector3::x() * slide
    };
    skin.positions().iter().zip(&offsets).map(of_vertex).collect()
}

pub fn examples(presses: &[Press]) -> Examples {
    Examples {
        displacements: presses.iter().map(|p| p.displacements.clone()).collect(),
        details: presses.iter().map(|p| p.detail.clone()).collect(),
        touches: presses.iter().map(|p| p.touch).collect(),
    }
}

/// An enricher with state and scratch for evaluations.
pub struct Bench {
    pub enricher: Enricher,
    pub model: Model,
    pub state: State,
    pub scratch: EnricherScratch,
    pub offsets: Vec<[f32; 4]>,
    pub detail: Vec<[f32; 4]>,
    areas: Vec<f64>,
}

impl Bench {
    pub fn new(presses: &[Press], options: EnrichmentOptions) -> Self {
        let model = scene().run().model;
        let enricher = Enricher::new(&model, &examples(presses), options).unwrap();
        let zeros = vec![[0.0; 4]; model.n_skin()];
        Self {
            scratch: enricher.scratch(),
            state: State::new(&model),
            offsets: zeros.clone(),
            detail: zeros,
            areas: model.description().skin.vertex_areas(),
            enricher,
            model,
        }
    }

    /// The coarse displacements times `factor`.
    pub fn set(&mut self, press: &Press, factor: f64) {
        let nodes: Vec<_> = press.displacements.iter().map(|d| Vector3::from(d.map(f64::from)) * factor).collect();
        self.state.set_node_displacements(&self.model, &nodes);
        self.state.write_padded_offsets(&self.model, &mut self.offsets);
    }

    /// Detail of a press; returns the confidence.
    pub fn enrich(&mut self, press: &Press, factor: f64) -> f32 {
        self.set(press, factor);
        self.enrich_at(&press.touch)
    }

    /// Detail of the present state for a contact.
    pub fn enrich_at(&mut self, touch: &Touch) -> f32 {
        let Self { enricher, model, state, scratch, offsets, detail, .. } = self;
        enricher.evaluate(&Contact::new(model, state, offsets, touch), scratch, detail)
    }

    /// Detail of the `i`-th example alone, at its own contact point.
    pub fn reproduce(&mut self, presses: &[Press], i: usize) {
        self.set(&presses[i], 1.0);
        let mut weights = vec![0.0; presses.len()];
        weights[i] = 1.0;
        let Self { enricher, model, state, scratch, offsets, detail, .. } = self;
        enricher.interpolate(&Contact::new(model, state, offsets, &presses[i].touch), &weights, scratch, detail);
    }

    /// Error of the detail at each vertex [m].
    pub fn misses(&self, press: &Press) -> Vec<f64> {
        let miss = |(a, b): (&[f32; 4], &[f32; 3])| -> f64 {
            (0..3).map(|k| f64::from(a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
        };
        self.detail.iter().zip(&press.detail).map(miss).collect()
    }

    /// Area-weighted RMS over the error of the coarse skin.
    pub fn relative_error(&self, press: &Press) -> f64 {
        let own: Vec<f64> = press.detail.iter().map(|d| size(d)).collect();
        self.rms(&self.misses(press)) / self.rms(&own)
    }

    pub fn rms(&self, values: &[f64]) -> f64 {
        let sum: f64 = values.iter().zip(&self.areas).map(|(v, a)| a * v * v).sum();
        (sum / self.areas.iter().sum::<f64>()).sqrt()
    }
}

pub fn size(v: &[f32]) -> f64 {
    v.iter().take(3).map(|c| f64::from(*c).powi(2)).sum::<f64>().sqrt()
}

pub fn largest(press: &Press) -> f64 {
    press.detail.iter().map(|d| size(d)).fold(0.0, f64::max)
}

pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
