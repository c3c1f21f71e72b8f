//! The mesh while it is simplified: triangles with their patches, and who is around a vertex.

use super::decompose::Decomposition;
use super::quadric::Quadric;
use crate::surface::{EdgeKind, Surface};
use crate::vector::{Vec3, cross, dot, norm, sub, unit_or_zero};
use std::collections::HashSet;

/// Weight of a border's wall against the faces beside it.
const BORDER_WEIGHT: f64 = 0.05;

/// Of a vertex with more faces than this, the neighbours are told apart by a table: there are fans of thousands, the ends of turned parts.
const MANY_FACES: usize = 32;

/// How freely a vertex may move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Freedom {
    Free,
    /// On the rim of an open surface: stays on it.
    Rim,
    /// Where more than two faces meet at an edge, or two fans at a vertex: stays where it is.
    Fixed,
}

/// A mesh in the course of simplification.
pub(super) struct Work {
    /// Greatest height above a face of its own patch that a vertex may have.
    pub slack: f64,
    pub position: Vec<Vec3>,
    /// By vertex its faces; none when it is gone.
    pub around: Vec<Vec<u32>>,
    pub faces: Vec<[u32; 3]>,
    /// By face; [`NONE`] when it is gone.
    pub patch_of: Vec<u32>,
    /// By patch its faces; none when it has become part of another.
    pub patches: Vec<Vec<u32>>,
    /// By patch the one it became part of, or itself.
    pub part_of: Vec<u32>,
    /// Patches that are left.
    pub live: usize,
    pub freedom: Vec<Freedom>,
    /// By vertex the planes of the faces that it stands for.
    pub quadric: Vec<Quadric>,
    /// And the walls along rims and borders.
    pub walls: Vec<Quadric>,
    /// By vertex the longest edge that was collapsed into it.
    pub longest: Vec<f64>,
    /// By vertex the original vertex among those it stands for that is nearest to it, or nearly.
    pub original: Vec<u32>,
    /// Counts the changes of a vertex.
    pub stamp: Vec<u32>,
}

impl Work {
    pub(super) fn new(surface: &Surface, decomposition: Decomposition, slack: f64) -> Self {
        let count = surface.vertices.len();
        let around = faces_around(surface);
        let mut quadric = vec![Quadric::default(); count];
        for t in &surface.triangles {
            let own = Quadric::triangle(t.map(|v| surface.vertices[v as usize]));
            for &v in t {
                quadric[v as usize].add(&own);
            }
        }
        let mut work = Self {
            slack,
            position: surface.vertices.clone(),
            around,
            faces: surface.triangles.clone(),
            live: decomposition.patches.len(),
            part_of: (0..decomposition.patches.len() as u32).collect(),
            patch_of: decomposition.patch_of,
            patches: decomposition.patches,
            freedom: vec![Freedom::Free; count],
            quadric,
            walls: vec![Quadric::default(); count],
            longest: vec![0.0; count],
            original: (0..count as u32).collect(),
            stamp: vec![0; count],
        };
        work.restrict(surface);
        work.hold_borders(surface);
        work
    }

    fn restrict(&mut self, surface: &Surface) {
        for edge in surface.edges.iter().filter(|e| e.kind == EdgeKind::Boundary) {
            let [a, b] = edge.vertices.map(|v| surface.vertices[v as usize]);
            let [p, q, r] = self.corners(edge.triangles[0]);
            let along = sub(b, a);
            let wall = unit_or_zero(cross(along, cross(sub(q, p), sub(r, p))));
            let weight = norm(along) * norm(along);
            for v in edge.vertices {
                self.freedom[v as usize] = Freedom::Rim;
                self.walls[v as usize].add(&Quadric::plane(wall, a, weight));
            }
        }
        for edge in surface.edges.iter().filter(|e| e.kind == EdgeKind::Unoriented) {
            for v in edge.vertices {
                self.freedom[v as usize] = Freedom::Fixed;
            }
        }
        for v in 0..self.position.len() as u32 {
            if !is_one_fan(v, &self.around[v as usize], &self.faces) {
                self.freedom[v as usize] = Freedom::Fixed;
            }
        }
    }

    /// Walls along the borders of patches, so that where nothing else holds a border it stays about where it is.
    fn hold_borders(&mut self, surface: &Surface) {
        for edge in &surface.edges {
            let [f, g] = edge.triangles;
            if f == g || self.patch_of[f as usize] == self.patch_of[g as usize] {
                continue;
            }
            let [a, b] = edge.vertices.map(|v| surface.vertices[v as usize]);
            let along = sub(b, a);
            let wall = unit_or_zero(cross(along, edge.normal.map(f64::from)));
            let weight = BORDER_WEIGHT * dot(along, along);
            for v in edge.vertices {
                self.walls[v as usize].add(&Quadric::plane(wall, a, weight));
            }
        }
    }

    pub(super) fn corners(&self, face: u32) -> [Vec3; 3] {
        self.faces[face as usize].map(|v| self.position[v as usize])
    }

    /// The vertices next to one, each once, in the order of its faces.
    pub(super) fn ring(&self, vertex: u32) -> Vec<u32> {
        let around = &self.around[vertex as usize];
        let corners = around.iter().flat_map(|&f| self.faces[f as usize]).filter(|&v| v != vertex);
        if around.len() > MANY_FACES {
            let mut seen = HashSet::with_capacity(2 * around.len());
            return corners.filter(|&v| seen.insert(v)).collect();
        }
        let mut ring = Vec::with_capacity(8);
        corners.for_each(|v| {
            if !ring.contains(&v) {
                ring.push(v);
            }
        });
        ring
    }

    /// The patch that a patch has become part of.
    pub(super) fn patch(&self, mut patch: u32) -> u32 {
        while self.part_of[patch as usize] != patch {
            patch = self.part_of[patch as usize];
        }
        patch
    }

    /// Makes one patch part of another.
    pub(super) fn join(&mut self, gone: u32, into: u32) {
        let faces = std::mem::take(&mut self.patches[gone as usize]);
        for &f in &faces {
            self.patch_of[f as usize] = into;
        }
        self.patches[into as usize].extend(faces);
        self.part_of[gone as usize] = into;
        self.live -= 1;
    }
}

/// By vertex its faces.
pub(super) fn faces_around(surface: &Surface) -> Vec<Vec<u32>> {
    let mut around = vec![Vec::new(); surface.vertices.len()];
    for (f, t) in surface.triangles.iter().enumerate() {
        t.iter().for_each(|&v| around[v as usize].push(f as u32));
    }
    around
}

/// Whether the faces around a vertex hang together by edges at it.
pub(super) fn is_one_fan(vertex: u32, around: &[u32], faces: &[[u32; 3]]) -> bool {
    // By neighbour the faces that share the edge to it.
    let corners = |(i, &f): (usize, &u32)| faces[f as usize].map(|v| (v, i));
    let mut spokes: Vec<(u32, usize)> = around.iter().enumerate().flat_map(corners).collect();
    spokes.retain(|s| s.0 != vertex);
    spokes.sort_unstable();
    let mut part: Vec<usize> = (0..around.len()).collect();
    let mut parts = around.len();
    for pair in spokes.windows(2).filter(|p| p[0].0 == p[1].0) {
        let [a, b] = [pair[0].1, pair[1].1].map(|i| first_of(&mut part, i));
        parts -= usize::from(a != b);
        part[a.max(b)] = a.min(b);
    }
    parts <= 1
}

/// The first face of the part that a face belongs to.
fn first_of(part: &mut [usize], mut face: usize) -> usize {
    while part[face] != face {
        part[face] = part[part[face]];
        face = part[face];
    }
    face
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch time that grows with the square of the faces at a vertex (minutes for these), and fans that are taken for one or for several.
    #[test]
    fn large_fans_are_told_apart() {
        let count = 100_000;
        let closed: Vec<[u32; 3]> = (0..count).map(|k| [0, 1 + k, 1 + (k + 1) % count]).collect();
        let around: Vec<u32> = (0..count).collect();
        assert!(is_one_fan(0, &around, &closed));
        // Without one face it is open but still one, without two that are apart it is two.
        assert!(is_one_fan(0, &around[1..], &closed));
        let torn: Vec<u32> = around.iter().copied().filter(|f| ![7, 5000].contains(f)).collect();
        assert!(!is_one_fan(0, &torn, &closed));
        assert!(is_one_fan(0, &[], &closed));
    }
}
