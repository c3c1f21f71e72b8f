//! Surface convex decomposition at full resolution: every triangle belongs to one convex patch.
//!
//! After the priority-first variant of Ehmann and Lin 2001: patches grow from the tops of convex regions, the faces that are
//! farthest from any edge that is not convex, and take in faces across convex edges as long as the patch stays convex. A
//! patch has no more than [`MOST_FACES`] faces, so that convexity is tested directly, every vertex against every face.

use super::convex::{CONVEX_SLACK, all_below, height};
use super::{BuildError, Progress, tell};
use crate::surface::{EdgeKind, Surface};
use crate::vector::Vec3;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

/// Most faces of a patch, at every level.
pub(super) const MOST_FACES: usize = 48;
/// Faces between two words to the progress callback.
const PORTION: usize = 8192;
/// No patch.
pub(super) const NONE: u32 = u32::MAX;

/// By triangle its patch, and the triangles of each patch.
pub(super) struct Decomposition {
    pub patch_of: Vec<u32>,
    pub patches: Vec<Vec<u32>>,
}

/// Cuts the surface into convex patches.
pub(super) fn decompose(surface: &Surface, progress: &mut Progress<'_>) -> Result<Decomposition, BuildError> {
    let count = surface.triangles.len();
    let grower = Grower { surface, slack: CONVEX_SLACK * surface.radius };
    let convex = convex_edges(surface, grower.slack);
    let rank = distance_from_concavity(surface, &convex);
    let mut seeds: Vec<u32> = (0..count as u32).collect();
    seeds.sort_by_key(|&f| (Reverse(rank[f as usize]), f));
    let mut result = Decomposition { patch_of: vec![NONE; count], patches: Vec::new() };
    let mut failed = vec![NONE; count];
    for (done, seed) in seeds.into_iter().enumerate() {
        if done % PORTION == PORTION - 1 {
            tell(progress, 0.1 * done as f64 / count as f64)?;
        }
        if result.patch_of[seed as usize] == NONE {
            grower.grow(seed, &convex, &rank, &mut failed, &mut result);
        }
    }
    Ok(result)
}

/// A face that may be taken in next: those farthest from concavity first, and of those the ones closest to the seed, so that
/// patches are compact.
type Open = (u32, Reverse<u32>, Reverse<u32>);

struct Grower<'a> {
    surface: &'a Surface,
    slack: f64,
}

impl Grower<'_> {
    fn corners(&self, face: u32) -> [Vec3; 3] {
        self.surface.triangles[face as usize].map(|v| self.surface.vertices[v as usize])
    }

    fn grow(&self, seed: u32, convex: &[bool], rank: &[u32], failed: &mut [u32], result: &mut Decomposition) {
        let patch = result.patches.len() as u32;
        let mut faces = vec![seed];
        let mut vertices = self.surface.triangles[seed as usize].to_vec();
        result.patch_of[seed as usize] = patch;
        let mut open = BinaryHeap::new();
        self.open_neighbours((seed, 0), convex, rank, &result.patch_of, &mut open);
        while let Some((_, Reverse(hops), Reverse(face))) = open.pop() {
            if faces.len() == MOST_FACES {
                break;
            }
            if result.patch_of[face as usize] != NONE || failed[face as usize] == patch {
                continue;
            }
            if !self.stays_convex(face, &faces, &vertices) {
                failed[face as usize] = patch;
                continue;
            }
            result.patch_of[face as usize] = patch;
            faces.push(face);
            for v in self.surface.triangles[face as usize] {
                if !vertices.contains(&v) {
                    vertices.push(v);
                }
            }
            self.open_neighbours((face, hops), convex, rank, &result.patch_of, &mut open);
        }
        result.patches.push(faces);
    }

    fn open_neighbours(
        &self,
        (face, hops): (u32, u32),
        convex: &[bool],
        rank: &[u32],
        patch_of: &[u32],
        open: &mut BinaryHeap<Open>,
    ) {
        for other in neighbours(self.surface, face, convex) {
            if patch_of[other as usize] == NONE {
                open.push((rank[other as usize], Reverse(hops + 1), Reverse(other)));
            }
        }
    }

    fn stays_convex(&self, face: u32, faces: &[u32], vertices: &[u32]) -> bool {
        let points = vertices.iter().map(|&v| self.surface.vertices[v as usize]);
        let fresh = self.surface.triangles[face as usize].into_iter().filter(|v| !vertices.contains(v));
        let fresh: Vec<Vec3> = fresh.map(|v| self.surface.vertices[v as usize]).collect();
        all_below(self.corners(face), points, self.slack)
            && faces.iter().all(|&f| all_below(self.corners(f), fresh.iter().copied(), self.slack))
    }
}

/// The faces across the convex edges of a face.
fn neighbours<'a>(surface: &'a Surface, face: u32, convex: &'a [bool]) -> impl Iterator<Item = u32> + 'a {
    surface.triangle_edges[face as usize].into_iter().filter(|&e| convex[e as usize]).map(move |e| {
        let [a, b] = surface.edges[e as usize].triangles;
        if a == face { b } else { a }
    })
}

/// By edge: two faces of one orientation that bend outward or not at all.
fn convex_edges(surface: &Surface, slack: f64) -> Vec<bool> {
    let corners = |f: u32| surface.triangles[f as usize].map(|v| surface.vertices[v as usize]);
    surface
        .edges
        .iter()
        .map(|edge| {
            let [f, g] = edge.triangles;
            matches!(edge.kind, EdgeKind::Convex | EdgeKind::Hollow)
                && corners(g).into_iter().all(|p| height(corners(f), p) <= slack)
                && corners(f).into_iter().all(|p| height(corners(g), p) <= slack)
        })
        .collect()
}

/// By face: how many faces away the nearest edge is that is not convex.
fn distance_from_concavity(surface: &Surface, convex: &[bool]) -> Vec<u32> {
    let mut rank = vec![u32::MAX; surface.triangles.len()];
    let mut queue = VecDeque::new();
    for (face, edges) in surface.triangle_edges.iter().enumerate() {
        if edges.iter().any(|&e| !convex[e as usize]) {
            rank[face] = 0;
            queue.push_back(face as u32);
        }
    }
    while let Some(face) = queue.pop_front() {
        for other in neighbours(surface, face, convex) {
            if rank[other as usize] == u32::MAX {
                rank[other as usize] = rank[face as usize] + 1;
                queue.push_back(other);
            }
        }
    }
    rank
}
