//! The mesh while it is simplified: triangles with their patches, and who is around a vertex.

use super::decompose::Decomposition;
use super::quadric::Quadric;
use crate::surface::{EdgeKind, Surface};
use crate::vector::{Vec3, cross, dot, norm, sub, unit_or_zero};

/// Weight of a border's wall against the faces beside it.
const BORDER_WEIGHT: f64 = 0.05;

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
        let mut ring = Vec::with_capacity(8);
        for &f in &self.around[vertex as usize] {
            for v in self.faces[f as usize] {
                if v != vertex && !ring.contains(&v) {
                    ring.push(v);
                }
            }
        }
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
    let mut reached = vec![false; around.len()];
    let mut stack = vec![0];
    while let Some(i) = stack.pop() {
        if around.is_empty() || std::mem::replace(&mut reached[i], true) {
            continue;
        }
        for (j, &g) in around.iter().enumerate() {
            let touches = |&v: &u32| v != vertex && faces[around[i] as usize].contains(&v);
            if !reached[j] && faces[g as usize].iter().any(touches) {
                stack.push(j);
            }
        }
    }
    reached.iter().all(|&r| r)
}
