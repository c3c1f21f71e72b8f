//! When a patch is good enough: the error metrics of method A.4.

use super::front::Tally;
use crate::clod::{Hierarchy, Node, PURE_HULL};
use crate::vector::{Vec3, norm, sub};
use nalgebra::Point3;

/// A patch that has been refined becomes coarse again only below this share of the allowed error.
const HYSTERESIS: f64 = 0.8;

/// How coarse contacts may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// s0, metres: 2.5 % of the object's radius in the paper. 0 means exact.
    pub threshold: f64,
    /// Where force begins, metres, when that is closer than the tolerance of the query: only what is within it makes a contact large.
    pub force_from: Option<f64>,
    /// Where surfaces move past each other quickly they may be as coarse as this many times the way that they move between
    /// two queries. 0: no such metric.
    pub per_step: f64,
    /// Errors that no one sees need not be refined. None: no such metric.
    pub view: Option<View>,
    /// With more than one metric.
    pub combine: Combine,
    /// Microseconds that a query should take at most: where that is not enough the greatest errors are refined first. It is kept by what the last
    /// queries took, so some of the first are late (these are exact, until levels are ready), and some after the contact has grown.
    /// Makes results depend on the machine's speed.
    pub budget_us: Option<f64>,
}

/// For errors on the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// World, metres.
    pub eye: Point3<f64>,
    /// Focal length, pixels.
    pub focal_px: f64,
    /// Allowed error, pixels.
    pub error_px: f64,
}

/// What several metrics mean together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Combine {
    /// Refine when any metric asks for it: the safest.
    #[default]
    Any,
    /// Refine when all of them do: the cheapest.
    All,
}

impl Detail {
    /// Only a threshold, in metres.
    #[must_use]
    pub fn threshold(threshold: f64) -> Self {
        Self {
            threshold,
            force_from: None,
            per_step: 0.0,
            view: None,
            combine: Combine::Any,
            budget_us: None,
        }
    }

    /// Whether everything is to be exact.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        !(self.threshold > 0.0 && self.threshold.is_finite())
    }
}

/// The metrics at one query, in the frame of the surface whose nodes are judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judge {
    pub detail: Detail,
    /// Vertices that a sample may stand for.
    pub weight: f64,
    /// Where the eye is.
    pub eye: Vec3,
    /// Multiplies the allowed error, for the budget; at least 1.
    pub leniency: f64,
}

impl Judge {
    /// Whether nothing but the weight tells nodes apart, so that the same weight means the same levels.
    pub(super) fn depends_on_weight_alone(&self) -> bool {
        self.detail.per_step == 0.0 && self.detail.view.is_none()
    }

    /// Whether a node must be replaced by its children. `moved` is how far it has moved against the other surface since the
    /// last query; `refined` tells whether it is replaced now.
    pub(super) fn refines(&self, node: &Node, moved: impl Fn() -> f64, refined: bool) -> bool {
        if node.level == PURE_HULL {
            return true;
        }
        let limit = self.leniency * if refined { HYSTERESIS } else { 1.0 };
        self.error(node, moved) > limit
    }

    /// Error over allowed error.
    fn error(&self, node: &Node, moved: impl Fn() -> f64) -> f64 {
        let samples = f64::from(node.samples[1] - node.samples[0]);
        let vertices = f64::from(node.vertices[1] - node.vertices[0]);
        // One vertex a sample is all there is.
        let haptic = if vertices > samples { vertices / (samples.max(1.0) * self.weight) } else { 0.0 };
        let combine = |a: f64, b: f64| match self.detail.combine {
            Combine::Any => a.max(b),
            Combine::All => a.min(b),
        };
        let mut error = haptic;
        if self.detail.per_step > 0.0 {
            let allowed = (self.detail.per_step * moved()).max(self.detail.threshold);
            error = combine(error, ratio(node.deviation, allowed));
        }
        if let Some(view) = self.detail.view {
            let distance = (norm(sub(node.center, self.eye)) - node.radius).max(1e-6);
            error = combine(error, ratio(node.deviation * view.focal_px, distance * view.error_px));
        }
        error
    }
}

/// a / b, zero when a is.
fn ratio(a: f64, b: f64) -> f64 {
    if a > 0.0 { a / b } else { 0.0 }
}

/// How many vertices a sample may stand for on one surface, so that the contact is made of about as many samples as the
/// threshold asks for, whatever its size: a small contact is exact, a large one coarse.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Density {
    /// Vertices in contact, smoothed.
    contact: f64,
    known: bool,
    /// Vertices that the samples near the other surface stand for.
    near: f64,
    /// The weight that holds.
    held: f64,
}

impl Density {
    /// As if the whole surface were near, until more is known.
    pub(super) fn coarsest(hierarchy: &Hierarchy) -> Self {
        Self { near: hierarchy.vertices.len() as f64, ..Self::default() }
    }

    /// Takes in what the last walk came past.
    pub(super) fn observe(&mut self, tally: &Tally) {
        let share = if self.known { SMOOTHING } else { 1.0 };
        self.contact += share * (tally.contact - self.contact);
        self.near += share * (tally.near - self.near);
        self.known = true;
    }

    /// The next observation counts in full.
    pub(super) fn forget(&mut self) {
        self.known = false;
    }

    /// How many vertices a sample may stand for now. It changes only when it should be clearly another.
    pub(super) fn weight(&mut self, detail: &Detail, radius: f64) -> f64 {
        let wanted = wanted_samples(detail, radius);
        let weight = (self.contact / wanted).max(self.near / (NEAR_SAMPLES * wanted)).max(1.0);
        let (least, most) = (self.held / HOLDING, self.held * HOLDING);
        if !(least..=most).contains(&weight) || (weight == 1.0 && self.held != 1.0) {
            self.held = weight;
        }
        self.held
    }
}

/// A weight holds as long as the right one is within this factor.
const HOLDING: f64 = 1.1;
/// Of a new number of vertices in contact this share counts.
const SMOOTHING: f64 = 0.1;
/// Samples near the other surface are at most this many times as many as those wanted in contact.
const NEAR_SAMPLES: f64 = 24.0;
/// Samples wanted in contact on each surface, times the threshold as a share of the radius.
const SAMPLES: f64 = 1.6;

/// Fewest samples in contact that are asked for, on each surface.
const FEWEST: f64 = 8.0;

fn wanted_samples(detail: &Detail, radius: f64) -> f64 {
    (SAMPLES * radius / detail.threshold).max(FEWEST)
}

/// Samples in contact on both surfaces, at least: other metrics than the threshold may be content with few.
pub(super) fn least_samples(detail: &Detail, radius: f64) -> f64 {
    let threshold_alone = detail.per_step == 0.0 && detail.view.is_none();
    2.0 * if threshold_alone { wanted_samples(detail, radius) } else { FEWEST }
}
