//! Where a node makes its contacts: original vertices, spread as the vertices of its level are, each standing for those
//! of the node that are nearest to it. The samples of a node are among those of its children.

use super::decompose::NONE;
use super::simplify::Level;
use super::tree::Tree;
use crate::clod::{Sample, range};
use crate::surface::Surface;
use crate::vector::{dot, sub};
use rayon::prelude::*;

/// By branch its samples.
pub(super) fn samples(surface: &Surface, levels: &[Level], tree: &Tree) -> Vec<Vec<Sample>> {
    let mut chosen = choose(levels, tree, surface.vertices.len());
    fill_gaps(tree, &mut chosen);
    tree.branches
        .par_iter()
        .zip(&chosen)
        .map(|(branch, chosen)| weigh(surface, &tree.vertices[range(branch.vertices)], chosen))
        .collect()
}

/// By branch the originals of its level's vertices that belong to it.
fn choose(levels: &[Level], tree: &Tree, vertices: usize) -> Vec<Vec<u32>> {
    let mut place = vec![NONE; vertices];
    for (at, &v) in tree.vertices.iter().enumerate() {
        place[v as usize] = at as u32;
    }
    let mut chosen = vec![Vec::new(); tree.branches.len()];
    let mut branch_at = vec![NONE; tree.vertices.len()];
    for (number, level) in levels.iter().enumerate() {
        for (index, branch) in tree.branches.iter().enumerate() {
            if branch.patch.is_some_and(|p| p.0 as usize == number) {
                branch_at[range(branch.vertices)].fill(index as u32);
            }
        }
        for &original in &level.originals {
            let at = place[original as usize];
            if at != NONE {
                chosen[branch_at[at as usize] as usize].push(original);
            }
        }
    }
    for list in &mut chosen {
        list.sort_unstable();
        list.dedup();
    }
    chosen
}

/// A branch that got none takes one of its children's. Children come after their parents, so from the back.
fn fill_gaps(tree: &Tree, chosen: &mut [Vec<u32>]) {
    for index in (0..tree.branches.len()).rev() {
        let branch = &tree.branches[index];
        if branch.patch.is_some() && chosen[index].is_empty() {
            let of_children = range(branch.children).find_map(|c| chosen[c].first().copied());
            chosen[index].extend(of_children);
        }
    }
}

/// Gives every vertex to the nearest sample.
fn weigh(surface: &Surface, vertices: &[u32], chosen: &[u32]) -> Vec<Sample> {
    let mut samples: Vec<Sample> = chosen.iter().map(|&vertex| Sample { vertex, weight: 0.0 }).collect();
    let squared = |a: u32, b: u32| {
        let d = sub(surface.vertices[a as usize], surface.vertices[b as usize]);
        dot(d, d)
    };
    for &v in vertices {
        let nearest = samples.iter_mut().min_by(|s, t| squared(s.vertex, v).total_cmp(&squared(t.vertex, v)));
        if let Some(nearest) = nearest {
            nearest.weight += 1.0;
        }
    }
    samples
}
