//! Memory of the search for feet.

use crate::query::feature::Foot;
use crate::surface::LANES;
use crate::vector::Vec3;

/// Memory of the search, kept to be reused. A batch of vertices is searched for at once, as many in a group as there are lanes, each in a
/// slot of its own.
#[derive(Clone, Debug, Default)]
pub(in crate::query) struct Scratch {
    pub(super) groups: Vec<Group>,
    /// By group and leaf of its neighbourhood: lower bounds of the squared distances.
    pub(super) lowers: Vec<[f32; LANES]>,
    /// By slot; places beyond the last vertex of a group are not used.
    pub(super) points: Vec<[Vec3; LANES]>,
    /// The closest triangle is not farther than this; zero for a vertex that has none within the tolerance.
    pub(super) within: Vec<[f32; LANES]>,
    /// The leaf to look in first.
    pub(super) guesses: Vec<[u32; LANES]>,
    /// The closest foot so far, and its distance.
    pub(super) best: Vec<[u32; LANES]>,
    pub(super) distances: Vec<[f64; LANES]>,
    /// Which slots look in which leaves: first each where it may be closest, then wherever else it must.
    pub(super) looks: Looks,
    /// Which triangles may be the closest, by slot, and the feet on them.
    pub(super) candidates: Candidates,
    pub(super) feet: Vec<Foot>,
}

/// Vertices of one leaf, numbered in a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    pub first_vertex: u32,
    /// Its neighbourhood, a range of the near leaves.
    pub begin: u32,
    pub end: u32,
}

/// Lists with room for more than is in use, so that whole lanes can be written.
#[derive(Clone, Debug, Default)]
pub(super) struct Looks {
    pub count: usize,
    pub slot: Vec<u32>,
    pub leaf: Vec<u32>,
    /// Squared distances of the triangles, and how certain these are.
    pub squared: Vec<[f32; LANES]>,
    pub error: Vec<f32>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Candidates {
    pub count: usize,
    pub slot: Vec<u32>,
    pub triangle: Vec<u32>,
}

impl Scratch {
    /// Makes room for the next batch.
    #[inline(always)]
    pub(super) fn forget(&mut self) {
        self.groups.clear();
        self.lowers.clear();
        self.points.clear();
        self.within.clear();
        self.guesses.clear();
        self.best.clear();
        self.distances.clear();
        self.looks.count = 0;
        self.candidates.count = 0;
        self.feet.clear();
    }
}

impl Looks {
    /// Makes sure that `more` can be appended.
    #[inline(always)]
    pub(super) fn expect(&mut self, more: usize) {
        if self.slot.len() < self.count + more {
            let room = 2 * (self.count + more);
            self.slot.resize(room, 0);
            self.leaf.resize(room, 0);
            self.squared.resize(room, [0.0; LANES]);
            self.error.resize(room, 0.0);
        }
    }
}

impl Candidates {
    #[inline(always)]
    pub(super) fn expect(&mut self, more: usize) {
        if self.slot.len() < self.count + more {
            let room = 2 * (self.count + more);
            self.slot.resize(room, 0);
            self.triangle.resize(room, 0);
        }
    }
}
