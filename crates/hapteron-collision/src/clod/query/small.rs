//! Small and deep contacts are exact: where few vertices are near, the full-resolution query is as fast as any level and shows the
//! middles of crossing edges too, so it takes over. Its contacts of vertices are those of the finest level; those of edges come
//! and go over some queries, so nothing jumps when the one takes over from the other.

use super::front::BLEND_STEPS;
use crate::contact::Contact;
use crate::surface::Surface;

/// A contact of more vertices than this is large, of fewer than that share of it small again.
const LARGE: f64 = 96.0;
const SMALL_AGAIN: f64 = 0.5;
/// A front lives on what it knows from the last queries. Where surfaces move by this share of the tolerance from query to query a
/// large contact has twice as many vertices, and so on up to a limit.
const SLOW: f64 = 0.02;
const LARGEST: f64 = 960.0;
/// Deeper than this share of the tolerance a contact is exact, until it is less deep than that one: a front shows nothing that is deeper than
/// the tolerance, and a hard push must not go through.
const DEEP: f64 = 0.5;
const SHALLOW_AGAIN: f64 = 0.25;
/// Of a new pace this share counts.
const SMOOTHING: f64 = 0.1;

/// How far the surfaces move from query to query, as a share of the tolerance, smoothed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace(f64);

impl Pace {
    pub(super) fn observe(&mut self, share: f64) {
        self.0 += SMOOTHING * (share - self.0);
    }

    /// Vertices of a contact from where on it is large.
    fn large(self) -> f64 {
        (LARGE * (1.0 + self.0 / SLOW)).min(LARGEST)
    }
}

/// Which of the two ways contacts are found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Way {
    /// On a front of levels.
    #[default]
    Levels,
    /// On a front that is on its way to the finest level everywhere.
    Refining,
    /// By the exact query; its contacts of two edges have this share of their weight.
    Exact(f32),
}

impl Way {
    /// What comes after a query by levels that found contacts of so many vertices in all; `finest` when the front is at the finest level;
    /// `pressed` is the greatest depth as a share of the tolerance.
    pub(super) fn after_levels(self, vertices: f64, finest: bool, pace: Pace, pressed: f64) -> Self {
        match self {
            _ if pressed > DEEP => Self::Exact(0.0),
            Self::Refining if vertices > pace.large() => Self::Levels,
            Self::Refining if finest => Self::Exact(0.0),
            Self::Levels if vertices < SMALL_AGAIN * pace.large() => Self::Refining,
            other => other,
        }
    }

    /// What comes after an exact query with so many contacts, so deep.
    pub(super) fn after_exact(self, contacts: usize, late: bool, pace: Pace, pressed: f64) -> Self {
        let Self::Exact(share) = self else { return self };
        let step = 1.0 / BLEND_STEPS;
        if pressed > SHALLOW_AGAIN || (contacts as f64 <= pace.large() && !late) {
            Self::Exact((share + step).min(1.0))
        } else if share > 0.0 {
            Self::Exact((share - step).max(0.0))
        } else {
            Self::Levels
        }
    }

    /// What a first query that found contacts of so many vertices goes on with.
    pub(super) fn first(vertices: f64) -> Self {
        if vertices <= LARGE { Self::Exact(1.0) } else { Self::Levels }
    }
}

/// The contacts with those of two edges at a share of their weight.
pub(super) fn fade(found: &[Contact], surfaces: [&Surface; 2], share: f32, contacts: &mut Vec<Contact>) {
    let is_edge = |number: u32, surface: &Surface| {
        let first = surface.vertices.len();
        (first..first + surface.edges.len()).contains(&(number as usize))
    };
    contacts.clear();
    contacts.extend(found.iter().filter_map(|c| {
        let edges = is_edge(c.body_feature, surfaces[0]) && is_edge(c.obstacle_feature, surfaces[1]);
        let weight = c.weight * if edges { f64::from(share) } else { 1.0 };
        (weight > 0.0).then_some(Contact { weight, ..*c })
    }));
}
