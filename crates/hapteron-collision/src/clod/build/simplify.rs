//! From the leaves to the coarsest level: collapse the shortest edge, merge, and keep the patches whenever half are left.

use super::collapse::{collapse, place};
use super::decompose::NONE;
use super::merge::merge_around;
use super::work::Work;
use super::{BuildError, Progress, tell};
use crate::surface::Surface;
use crate::vector::{Vec3, norm, sub};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashSet};

/// With fewer patches than this no further level is made of them.
const FEWEST_PATCHES: usize = 8;

/// No edge longer than this share of the object's radius is collapsed: what would be left is no likeness of it.
const LONGEST_EDGE: f64 = 0.35;

/// The patches at one resolution.
#[derive(Debug, Default)]
pub(super) struct Level {
    pub vertices: Vec<Vec3>,
    /// By vertex: an original vertex near it that it stands for.
    pub originals: Vec<u32>,
    /// In the order of the patches.
    pub faces: Vec<[u32; 3]>,
    pub patches: Vec<LevelPatch>,
}

impl Level {
    /// Its faces made ready for searches.
    pub(super) fn surface(&self) -> Surface {
        Surface::of_triangles(&self.vertices, &self.faces)
    }
}

/// A patch of a level.
#[derive(Debug)]
pub(super) struct LevelPatch {
    /// Range of the level's faces.
    pub faces: [u32; 2],
    /// Longest edge that was collapsed into it, metres.
    pub edge: f64,
    /// Patches of the finer level that it consists of.
    pub children: Vec<u32>,
    /// At the finest level: the surface's triangles.
    pub triangles: Vec<u32>,
}

/// By length (as bits, which sort like positive numbers), with its ends and their stamps.
type Entry = Reverse<(u64, [u32; 2], [u32; 2])>;

struct Simplifier<'a> {
    surface: &'a Surface,
    work: Work,
    queue: BinaryHeap<Entry>,
    /// Edges that could not collapse, and may when something near them has changed.
    blocked: HashSet<[u32; 2]>,
    /// By patch number its index in the last level.
    index: Vec<u32>,
    levels: Vec<Level>,
    longest: f64,
    longest_at_level: f64,
    radius: f64,
}

/// All levels, the finest first.
pub(super) fn levels(
    surface: &Surface,
    radius: f64,
    work: Work,
    progress: &mut Progress<'_>,
) -> Result<Vec<Level>, BuildError> {
    let index = vec![NONE; work.patches.len()];
    let mut simplifier = Simplifier {
        surface,
        work,
        queue: BinaryHeap::new(),
        blocked: HashSet::new(),
        index,
        levels: Vec::new(),
        longest: 0.0,
        longest_at_level: 0.0,
        radius,
    };
    simplifier.emit();
    for edge in &surface.edges {
        simplifier.push(edge.vertices);
    }
    simplifier.run(progress)?;
    Ok(simplifier.levels)
}

impl Simplifier<'_> {
    fn push(&mut self, [a, b]: [u32; 2]) {
        let ends = [a.min(b), a.max(b)];
        let [p, q] = ends.map(|v| self.work.position[v as usize]);
        let stamps = ends.map(|v| self.work.stamp[v as usize]);
        self.queue.push(Reverse((norm(sub(q, p)).to_bits(), ends, stamps)));
    }

    fn run(&mut self, progress: &mut Progress<'_>) -> Result<(), BuildError> {
        let all = self.work.position.len();
        let (mut collapsed, mut looked) = (0, 0u32);
        let mut last_live = self.work.live;
        while let Some(Reverse((length, ends, stamps))) = self.queue.pop() {
            if f64::from_bits(length) > LONGEST_EDGE * self.radius {
                break;
            }
            if stamps != ends.map(|v| self.work.stamp[v as usize])
                || ends.iter().any(|&v| self.work.around[v as usize].is_empty())
            {
                continue;
            }
            looked = looked.wrapping_add(1);
            if looked % 1024 == 0 {
                tell(progress, 0.1 + 0.6 * collapsed as f64 / all as f64)?;
            }
            let Some(p) = place(&self.work, ends) else {
                self.blocked.insert(ends);
                continue;
            };
            collapse(&mut self.work, &self.surface.vertices, ends, p);
            merge_around(&mut self.work, ends[0]);
            self.reinsert(ends[0]);
            self.longest = self.longest.max(f64::from_bits(length));
            collapsed += 1;
            if self.work.live < FEWEST_PATCHES {
                break;
            }
            let halved = 2 * self.work.live <= last_live;
            let coarser = self.longest >= 2.0 * self.longest_at_level && 10 * self.work.live <= 9 * last_live;
            if halved || (coarser && self.longest_at_level > 0.0) {
                last_live = self.work.live;
                self.longest_at_level = self.longest;
                self.emit();
            }
        }
        if self.work.live > 0 && 10 * self.work.live <= 9 * last_live {
            self.emit();
        }
        Ok(())
    }

    /// The edges of a vertex that moved, and the blocked ones near it.
    fn reinsert(&mut self, vertex: u32) {
        for r in self.work.ring(vertex) {
            self.push([vertex, r]);
            for s in self.work.ring(r) {
                if s != vertex && self.blocked.remove(&[r.min(s), r.max(s)]) {
                    self.push([r, s]);
                }
            }
        }
    }

    /// Keeps the patches as they are now.
    fn emit(&mut self) {
        let work = &self.work;
        let mut level = Level::default();
        let mut renamed = vec![NONE; work.position.len()];
        let mut number = vec![NONE; work.patches.len()];
        for (patch, faces) in work.patches.iter().enumerate().filter(|(_, f)| !f.is_empty()) {
            let begin = level.faces.len() as u32;
            let mut edge: f64 = 0.0;
            for &f in faces {
                let t = work.faces[f as usize];
                edge = t.iter().map(|&v| work.longest[v as usize]).fold(edge, f64::max);
                level.faces.push(t.map(|v| {
                    if renamed[v as usize] == NONE {
                        renamed[v as usize] = level.vertices.len() as u32;
                        level.vertices.push(work.position[v as usize]);
                        level.originals.push(work.original[v as usize]);
                    }
                    renamed[v as usize]
                }));
            }
            number[patch] = level.patches.len() as u32;
            level.patches.push(LevelPatch {
                faces: [begin, level.faces.len() as u32],
                edge,
                children: Vec::new(),
                triangles: if self.levels.is_empty() { faces.clone() } else { Vec::new() },
            });
        }
        for patch in 0..work.patches.len() as u32 {
            let of_last_level = self.index[patch as usize];
            if of_last_level != NONE {
                let parent = number[work.patch(patch) as usize];
                debug_assert!(parent != NONE, "a patch that vanished has an heir");
                if let Some(parent) = level.patches.get_mut(parent as usize) {
                    parent.children.push(of_last_level);
                }
            }
        }
        self.index = number;
        self.levels.push(level);
    }
}
