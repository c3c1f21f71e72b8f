//! Merging of patches whose union is convex (method A.3).

use super::convex::all_below;
use super::decompose::MOST_FACES;
use super::work::Work;
use crate::vector::{norm, sub};

/// Merges patches around a vertex, those with the longest common border first, until no union is convex.
pub(super) fn merge_around(work: &mut Work, vertex: u32) {
    let mut refused: Vec<[u32; 2]> = Vec::new();
    loop {
        let pairs = borders(work, vertex);
        let Some(&(_, [p, q])) = pairs.iter().find(|(_, pair)| !refused.contains(pair)) else {
            return;
        };
        if union_is_convex(work, p, q) {
            work.join(q, p);
            // What was refused to the two may be asked of their union again, and is refused again: no need to ask.
            refused.iter_mut().flatten().filter(|r| **r == q).for_each(|r| *r = p);
            refused.iter_mut().for_each(|pair| pair.sort_unstable());
        } else {
            refused.push([p, q]);
        }
    }
}

/// Pairs of patches (lower number first) with the length of their common border among the faces around a vertex, longest first.
fn borders(work: &Work, vertex: u32) -> Vec<(f64, [u32; 2])> {
    let mut pairs: Vec<(f64, [u32; 2])> = Vec::new();
    let mut add = |a: u32, b: u32, length: f64| {
        let pair = [a.min(b), a.max(b)];
        match pairs.iter_mut().find(|p| p.1 == pair) {
            Some(known) => known.0 += length,
            None => pairs.push((length, pair)),
        }
    };
    for &f in &work.around[vertex as usize] {
        let t = work.faces[f as usize];
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let patch = work.patch_of[f as usize];
            let across = work.around[b as usize].iter().copied().find(|&g| {
                g != f && work.faces[g as usize].contains(&a) && work.faces[g as usize].contains(&b)
            });
            let Some(other) = across.map(|g| work.patch_of[g as usize]) else {
                continue;
            };
            // An edge at the vertex is seen from both sides.
            let share = if a == vertex || b == vertex { 0.5 } else { 1.0 };
            if other != patch {
                let length = norm(sub(work.position[a as usize], work.position[b as usize]));
                add(patch, other, share * length);
            }
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    pairs
}

fn union_is_convex(work: &Work, p: u32, q: u32) -> bool {
    let (p, q) = (&work.patches[p as usize], &work.patches[q as usize]);
    let below = |faces: &[u32], others: &[u32]| {
        faces
            .iter()
            .all(|&f| all_below(work.corners(f), others.iter().flat_map(|&g| work.corners(g)), work.slack))
    };
    p.len() + q.len() <= MOST_FACES && below(p, q) && below(q, p)
}
