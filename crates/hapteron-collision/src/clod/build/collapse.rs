//! Filtered edge collapse under convexity constraints (method A.3).

use super::convex::{all_below, area_vector, height, shape_quality};
use super::decompose::NONE;
use super::quadric::Quadric;
use super::work::{Freedom, Work};
use crate::clod::nearest::distance_to_triangle;
use crate::vector::{Vec3, add, dot, norm, scale, sub};

/// How far a new vertex relaxes towards the even distribution of its ring (method A.3, lambda).
const RELAXATION: f64 = 0.5;
/// A vertex may depart from the planes that it stands for by this share of the edge's length (root mean square): what is
/// filtered out is smaller than the resolution.
const DEPARTURE: f64 = 0.15;
/// A face may turn by no more than the angle of this cosine.
const TURN: f64 = 0.2;
/// No new face may be a worse needle than this unless it was worse before.
const NEEDLE: f64 = 0.05;

/// Edges at ends with more faces than this wait until there are fewer: each would take as long as a thousand others.
const MOST_AROUND: usize = 1024;

/// An edge with its surroundings.
struct Site<'a> {
    work: &'a Work,
    ends: [u32; 2],
    /// The faces that vanish.
    shared: Vec<u32>,
    /// The faces that stay and change.
    moved: Vec<u32>,
    /// The patches of the changed faces.
    patches: Vec<u32>,
    /// Of the faces that both ends stand for.
    planes: Quadric,
    /// How far from those planes the joined vertex may be.
    reach: f64,
}

/// Where the joined vertex of an edge may go; none when the edge is blocked.
pub(super) fn place(work: &Work, ends: [u32; 2]) -> Option<Vec3> {
    let [u, v] = ends;
    if ends.iter().any(|&end| work.around[end as usize].len() > MOST_AROUND) {
        return None;
    }
    let shared: Vec<u32> = common(&work.around[u as usize], &work.around[v as usize]);
    let fixed = allowed(work, ends, &shared)?;
    let mut moved: Vec<u32> = work.around[u as usize].clone();
    moved.extend(&work.around[v as usize]);
    moved.retain(|f| !shared.contains(f));
    let mut patches: Vec<u32> = moved.iter().map(|&f| work.patch_of[f as usize]).collect();
    patches.sort_unstable();
    patches.dedup();
    let mut planes = work.quadric[u as usize];
    planes.add(&work.quadric[v as usize]);
    let length = norm(sub(work.position[v as usize], work.position[u as usize]));
    let site = Site { work, ends, shared, moved, patches, planes, reach: DEPARTURE * length };
    let candidates = match fixed {
        Some(end) => vec![work.position[end as usize]],
        None => site.candidates(),
    };
    candidates.into_iter().find(|&p| site.is_feasible(p))
}

fn common(a: &[u32], b: &[u32]) -> Vec<u32> {
    a.iter().copied().filter(|x| b.contains(x)).collect()
}

/// Whether the topology lets the edge collapse; with the end that must stay where it is, if one must.
fn allowed(work: &Work, ends: [u32; 2], shared: &[u32]) -> Option<Option<u32>> {
    let [u, v] = ends;
    let rings = [work.ring(u), work.ring(v)];
    let is_rim_edge = shared.len() == 1;
    // Link condition: the ends have no common neighbours but the tips of the faces that vanish.
    if !(is_rim_edge || shared.len() == 2) || common(&rings[0], &rings[1]).len() != shared.len() {
        return None;
    }
    // A tip with no other faces would be left hanging.
    let tips = shared.iter().flat_map(|&f| work.faces[f as usize]).filter(|t| !ends.contains(t));
    for tip in tips {
        let least = if work.freedom[tip as usize] == Freedom::Free { 4 } else { 2 };
        if work.around[tip as usize].len() < least {
            return None;
        }
    }
    if work.around[u as usize].len() + work.around[v as usize].len() <= 2 * shared.len() + 1 {
        return None;
    }
    use Freedom::{Fixed, Free, Rim};
    match (work.freedom[u as usize], work.freedom[v as usize]) {
        (Free, Free) => Some(None),
        (Rim, Rim) => is_rim_edge.then_some(None),
        (Fixed | Rim, Free) => Some(Some(u)),
        (Free, Fixed | Rim) => Some(Some(v)),
        (Fixed, Fixed | Rim) | (Rim, Fixed) => None,
    }
}

impl Site<'_> {
    /// Places to try, best first.
    fn candidates(&self) -> Vec<Vec3> {
        let [p, q] = self.ends.map(|e| self.work.position[e as usize]);
        let middle = scale(add(p, q), 0.5);
        let mut quadric = self.planes;
        for end in self.ends {
            quadric.add(&self.work.walls[end as usize]);
        }
        let mut best = quadric.minimiser(middle);
        let length = norm(sub(q, p));
        if !(norm(sub(best, middle)) <= 2.0 * length) {
            best = middle;
        }
        let relaxed =
            if self.work.freedom[self.ends[0] as usize] == Freedom::Free { self.relaxed(best) } else { best };
        let half = |a: Vec3, b: Vec3| scale(add(a, b), 0.5);
        let mut list = vec![relaxed, half(relaxed, best), best, half(best, middle), middle];
        // Of the ends the one that the quadric likes better.
        let cost = |x: Vec3| norm(sub(x, best));
        list.extend(if cost(p) <= cost(q) { [p, q] } else { [q, p] });
        list
    }

    /// The quadric's minimiser, relaxed: along the surface towards the mean of its ring, across it by the difference
    /// between its second difference and those of its ring, so that flat and evenly curved parts stay as they are.
    fn relaxed(&self, best: Vec3) -> Vec3 {
        let work = self.work;
        let mut ring = work.ring(self.ends[0]);
        ring.extend(work.ring(self.ends[1]));
        ring.retain(|r| !self.ends.contains(r));
        ring.sort_unstable();
        ring.dedup();
        if ring.is_empty() {
            return best;
        }
        let share = 1.0 / ring.len() as f64;
        let mean = ring.iter().fold([0.0; 3], |sum, &r| add(sum, scale(work.position[r as usize], share)));
        let normal = self.moved.iter().fold([0.0; 3], |sum, &f| add(sum, area_vector(work.corners(f))));
        let length = norm(normal);
        if !(length > 0.0) {
            return best;
        }
        let normal = scale(normal, 1.0 / length);
        let difference = sub(mean, best);
        let across = dot(difference, normal);
        let theirs: f64 = ring.iter().map(|&r| dot(second_difference(work, r), normal)).sum::<f64>() * share;
        let along = sub(difference, scale(normal, across));
        // Theirs is on shorter edges than the new vertex's, hence never overdo it.
        let bend = (across - theirs).clamp(-across.abs(), across.abs()) * 0.25;
        add(best, scale(add(along, scale(normal, bend)), RELAXATION))
    }

    fn is_feasible(&self, p: Vec3) -> bool {
        if !(p.iter().all(|c| c.is_finite()) && self.planes.distance(p) <= self.reach) {
            return false;
        }
        self.moved.iter().all(|&f| self.turns_little(f, p))
            && self.patches.iter().all(|&c| self.stays_convex(c, p))
    }

    /// The corners of a face with the joined vertex at `p`.
    fn corners(&self, face: u32, p: Vec3) -> [Vec3; 3] {
        self.work.faces[face as usize]
            .map(|v| if self.ends.contains(&v) { p } else { self.work.position[v as usize] })
    }

    fn turns_little(&self, face: u32, p: Vec3) -> bool {
        let (before, after) = (self.work.corners(face), self.corners(face, p));
        let (m, n) = (area_vector(before), area_vector(after));
        let quality = shape_quality(after);
        quality >= NEEDLE.min(0.5 * shape_quality(before))
            && dot(m, n) >= TURN * norm(m) * norm(n)
            && norm(n) > 0.0
    }

    fn stays_convex(&self, patch: u32, p: Vec3) -> bool {
        let own = || self.work.patches[patch as usize].iter().copied().filter(|f| !self.shared.contains(f));
        own().all(|f| {
            if self.moved.contains(&f) {
                let points = own().flat_map(|g| self.corners(g, p));
                all_below(self.corners(f, p), points, self.work.slack)
            } else {
                height(self.work.corners(f), p) <= self.work.slack
            }
        })
    }
}

/// From a vertex to the mean of its ring.
fn second_difference(work: &Work, vertex: u32) -> Vec3 {
    let ring = work.ring(vertex);
    let share = 1.0 / ring.len().max(1) as f64;
    let mean = ring.iter().fold([0.0; 3], |sum, &r| add(sum, scale(work.position[r as usize], share)));
    sub(mean, work.position[vertex as usize])
}

fn center([a, b, c]: [Vec3; 3]) -> Vec3 {
    scale(add(add(a, b), c), 1.0 / 3.0)
}

/// Collapses an edge to a vertex at `p`, which is the first of its ends from now on.
pub(super) fn collapse(work: &mut Work, originals: &[Vec3], [u, v]: [u32; 2], p: Vec3) {
    let (ui, vi) = (u as usize, v as usize);
    let length = norm(sub(work.position[vi], work.position[ui]));
    let shared = common(&work.around[ui], &work.around[vi]);
    let centers: Vec<Vec3> = shared.iter().map(|&f| center(work.corners(f))).collect();
    let tips: Vec<(u32, u32)> = shared
        .iter()
        .map(|&f| {
            let tip = work.faces[f as usize].into_iter().find(|t| *t != u && *t != v);
            (std::mem::replace(&mut work.patch_of[f as usize], NONE), tip.unwrap_or(u))
        })
        .collect();
    for &f in &shared {
        for corner in work.faces[f as usize] {
            work.around[corner as usize].retain(|&g| g != f);
        }
    }
    let theirs = std::mem::take(&mut work.around[vi]);
    for &f in &theirs {
        for corner in &mut work.faces[f as usize] {
            *corner = if *corner == v { u } else { *corner };
        }
    }
    work.around[ui].extend(theirs);
    let quadric = work.quadric[vi];
    work.quadric[ui].add(&quadric);
    let walls = work.walls[vi];
    work.walls[ui].add(&walls);
    work.longest[ui] = work.longest[ui].max(work.longest[vi]).max(length);
    work.position[ui] = p;
    if work.freedom[vi] != Freedom::Free {
        work.freedom[ui] = work.freedom[vi];
    }
    let away = |original: u32| norm(sub(originals[original as usize], p));
    if away(work.original[vi]) < away(work.original[ui]) {
        work.original[ui] = work.original[vi];
    }
    work.stamp[ui] += 1;
    work.stamp[vi] += 1;
    for ((&f, center), (patch, tip)) in shared.iter().zip(centers).zip(tips) {
        work.patches[patch as usize].retain(|&g| g != f);
        if !work.patches[patch as usize].is_empty() || work.part_of[patch as usize] != patch {
            continue;
        }
        // The last face is gone: what it covered belongs to the patch that closes over it.
        let beside = |g: &u32| work.faces[*g as usize].contains(&tip);
        let away = |g: &u32| distance_to_triangle(center, work.corners(*g));
        let heir = work.around[ui].iter().copied().filter(beside).min_by(|g, h| away(g).total_cmp(&away(h)));
        if let Some(heir) = heir.or_else(|| work.around[ui].first().copied()) {
            let into = work.patch_of[heir as usize];
            if into != patch {
                work.join(patch, into);
            }
        }
    }
}
