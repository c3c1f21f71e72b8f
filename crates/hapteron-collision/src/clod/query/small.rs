//! Which way contacts are found: by the exact query where they are few, deep, or change quickly, by levels where they are many.
//!
//! Where few vertices are near, the full-resolution query is as fast as any level and shows the middles of crossing edges too. A front
//! lives on what it knows from the last queries, so it pays the less the faster the surfaces move. A front is made ready beside
//! exact queries, a part at each, so that no query takes long because of it. Between the two ways contacts change over by their
//! weights: both find the same contacts at the vertices that are samples, so it takes one exact query at a time.

use super::front::BLEND_STEPS;
use crate::contact::Contact;
use crate::surface::Surface;

/// A contact of more vertices than this is large, of fewer than that share of it small again.
const LARGE: f64 = 96.0;
const SMALL_AGAIN: f64 = 0.5;
/// Where surfaces move by this share of the tolerance from query to query, contacts are large that have as many vertices more as a front has samples in contact; by twice
/// that share, four times as many.
const FAST: f64 = 0.022;
/// Deeper than this share of the tolerance a contact is exact, until it is less deep than that one: a front shows nothing that is deeper than
/// the tolerance, and a hard push must not go through.
const DEEP: f64 = 0.5;
const SHALLOW_AGAIN: f64 = 0.25;
/// Of a new pace this share counts.
const SMOOTHING: f64 = 0.1;
/// A front that is not ready after so many queries is left alone for so many: the surfaces move too quickly for it.
const PATIENCE: u32 = 200;
const REST: u32 = 2000;
/// Searches through the tree that a query may spend on making each front ready: so many, and one a contact up to so many.
const SEARCHES: usize = 32;
const MOST_SEARCHES: usize = 4096;

/// How far the surfaces move from query to query, as a share of the tolerance, smoothed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace(f64);

impl Default for Pace {
    /// Fast, until it is seen to be slow.
    fn default() -> Self {
        Self(0.25)
    }
}

impl Pace {
    pub(super) fn observe(&mut self, share: f64) {
        self.0 += SMOOTHING * (share - self.0);
    }

    /// Vertices of a contact from where on it is large, when a front has so many samples in contact.
    fn large(self, wanted: f64) -> f64 {
        let share = self.0 / FAST;
        LARGE + wanted * share * share
    }
}

/// Which of the two ways contacts are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Way {
    /// On a front of levels.
    Levels,
    /// By the exact query; its contacts have this share of their own weights, the rest of those that the front gives them.
    Exact(f32),
}

impl Default for Way {
    fn default() -> Self {
        Self::Exact(1.0)
    }
}

/// How far the fronts are on their way to serve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Warmth {
    #[default]
    Cold,
    /// For so many queries by now.
    Warming(u32),
    Warm,
    /// For so many queries still.
    Resting(u32),
}

impl Warmth {
    /// After a query that made the fronts readier.
    pub(super) fn after(self, ready: bool) -> Self {
        match self {
            _ if ready => Self::Warm,
            Self::Warming(queries) if queries < PATIENCE => Self::Warming(queries + 1),
            Self::Warming(_) => Self::Resting(REST),
            other => other,
        }
    }
}

/// What a query found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub contacts: usize,
    /// Greatest depth as a share of the tolerance.
    pub pressed: f64,
    /// Queries take longer than they may.
    pub late: bool,
    pub pace: Pace,
    /// Samples that a front has in contact.
    pub wanted: f64,
}

impl Seen {
    pub(super) fn asks_for_levels(&self) -> bool {
        self.pressed <= SHALLOW_AGAIN && (self.contacts as f64 > self.pace.large(self.wanted) || self.late)
    }

    /// Searches that a query may spend on the fronts.
    pub(super) fn searches(&self) -> usize {
        SEARCHES + self.contacts.min(MOST_SEARCHES)
    }
}

/// What comes after a query by levels that found contacts of so many vertices in all.
pub(super) fn after_levels(vertices: f64, seen: Seen) -> Way {
    let small = vertices < SMALL_AGAIN * seen.pace.large(seen.wanted) && !seen.late;
    if seen.pressed > DEEP || small { Way::Exact(1.0 / BLEND_STEPS) } else { Way::Levels }
}

/// A step from the weights of the front towards the own ones, or back.
pub(super) fn blended(share: f32, to_levels: bool) -> Way {
    let step = if to_levels { -1.0 } else { 1.0 } / BLEND_STEPS;
    // Steps of a twentieth do not sum up to one exactly.
    let share = share + step;
    if share < 1e-3 { Way::Levels } else { Way::Exact(if share > 0.999 { 1.0 } else { share }) }
}

/// Exact contacts with their own weights in part, and the weights of the front's samples for the rest. What is deeper than the tolerance
/// no front shows, so it has its own weight.
pub(super) fn fade(
    found: &[Contact],
    surfaces: [&Surface; 2],
    share: f32,
    weights: &[Vec<(u32, f32)>; 2],
    tolerance: f64,
    contacts: &mut Vec<Contact>,
) {
    contacts.clear();
    if share == 1.0 {
        contacts.extend_from_slice(found);
        return;
    }
    let of = |side: usize, vertex: u32| {
        let at = weights[side].binary_search_by_key(&vertex, |w| w.0);
        at.map_or(0.0, |at| weights[side][at].1)
    };
    contacts.extend(found.iter().filter_map(|c| {
        let features = [c.body_feature, c.obstacle_feature];
        let is_vertex = [0, 1].map(|k| (features[k] as usize) < surfaces[k].vertices.len());
        let coarse = match is_vertex {
            // Which of the two it was found for does not show.
            [true, true] => 0.5 * (of(0, features[0]) + of(1, features[1])),
            [true, false] => of(0, features[0]),
            [false, true] => of(1, features[1]),
            [false, false] => 0.0,
        };
        let weight = c.weight * f64::from(share) + f64::from(coarse * (1.0 - share));
        let weight = if c.depth > tolerance { c.weight } else { weight };
        (weight > 0.0).then_some(Contact { weight, ..*c })
    }));
}
