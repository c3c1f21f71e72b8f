//! Fewer planes when a query finds more contacts than a tick can weigh.

use hapteron_dynamics::ContactPlane;

/// A plane with its depth at the snapshot, metres.
pub type Candidate = (f64, ContactPlane);

/// Smallest cell size, as a share of the body's radius.
const FINEST: f64 = 1.0 / 1024.0;
/// Bits of a cell's number along an axis; half of the cells are on either side of the body's centre of mass.
const AXIS_BITS: u32 = 20;
/// Cells of a key; above them is the octant.
const CELL_BITS: usize = 3 * AXIS_BITS as usize;

/// Lists to be reused.
#[derive(Debug, Default)]
pub struct Thinning {
    /// Keys with the candidates that have them.
    order: Vec<(u64, u32)>,
    kept: Vec<u32>,
}

impl Thinning {
    /// Keeps the deepest plane of each cell of the body's space and each octant of directions, with the smallest cells that leave no
    /// more than `most`. Tells whether any plane was dropped.
    ///
    /// Unlike keeping the deepest of all this leaves no side of the body unsupported. The cells move with the body, so that the choice
    /// changes little from pass to pass. Deterministic; the planes that are kept stay in their order.
    pub fn thin(&mut self, candidates: &mut Vec<Candidate>, radius: f64, most: usize) -> bool {
        if candidates.len() <= most {
            return false;
        }
        let Self { order, kept } = self;
        order.clear();
        order.extend(candidates.iter().map(|c| key(&c.1, radius * FINEST)).zip(0..));
        order.sort_unstable();
        let shift = shift(order, most);
        kept.clear();
        for cell in order.chunk_by(|a, b| a.0 >> shift == b.0 >> shift) {
            let depth = |i: u32| candidates[i as usize].0;
            let deepest =
                cell.iter().map(|c| c.1).min_by(|&a, &b| depth(b).total_cmp(&depth(a)).then(a.cmp(&b)));
            kept.extend(deepest);
        }
        // Fewer than the octants.
        kept.truncate(most);
        kept.sort_unstable();
        for (to, &from) in kept.iter().enumerate() {
            candidates[to] = candidates[from as usize];
        }
        candidates.truncate(kept.len());
        true
    }
}

/// How many of the lowest bits of the keys may differ within a cell, such that there are no more than so many cells: each makes cells twice as large.
fn shift(order: &[(u64, u32)], most: usize) -> usize {
    // Two neighbours in the order are in one cell when they differ in its bits alone.
    let mut borders = [0; CELL_BITS];
    let mut cells = 1;
    for pair in order.windows(2) {
        let different = pair[0].0 ^ pair[1].0;
        if different != 0 {
            cells += 1;
            if let Some(border) = borders.get_mut(different.ilog2() as usize) {
                *border += 1;
            }
        }
    }
    for (shift, border) in borders.iter().enumerate() {
        if cells <= most {
            return shift;
        }
        cells -= border;
    }
    CELL_BITS
}

/// The octant of a plane's normal and the cell of its point, as one number: the bits of the three axes by turns, so that all but the lowest ones are
/// the number of a larger cell.
fn key(plane: &ContactPlane, cell: f64) -> u64 {
    let half = f64::from(1 << (AXIS_BITS - 1));
    // Far away is in the last cell, and what is no number in the first.
    let axis = |x: f64| spread((x / cell + half).clamp(0.0, 2.0 * half - 1.0) as u64);
    let (p, n) = (plane.point_b, plane.normal_w);
    let octant = u64::from(n.x > 0.0) | u64::from(n.y > 0.0) << 1 | u64::from(n.z > 0.0) << 2;
    octant << CELL_BITS | axis(p.x) << 2 | axis(p.y) << 1 | axis(p.z)
}

/// The lowest 20 bits of a number, two bits apart from each other.
fn spread(n: u64) -> u64 {
    let n = (n | n << 32) & 0x001f_0000_0000_ffff;
    let n = (n | n << 16) & 0x001f_0000_ff00_00ff;
    let n = (n | n << 8) & 0x100f_00f0_0f00_f00f;
    let n = (n | n << 4) & 0x10c3_0c30_c30c_30c3;
    (n | n << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use nalgebra::Vector3;

    fn plane(x: f64, y: f64, n: Vector3<f64>) -> ContactPlane {
        ContactPlane::new(Vector3::new(x, y, 0.0), &Vector3::zeros(), n, 1.0, 0.0, 0.0)
    }

    /// Would catch a choice that leaves a side without support, or loses the deepest contact.
    #[test]
    fn every_side_keeps_planes_and_the_deepest_stays() {
        let up = Vector3::new(0.1, 0.1, 1.0).normalize();
        let mut candidates = Vec::new();
        for i in 0..100 {
            for j in 0..100 {
                let (x, y) = (f64::from(i) * 1e-4, f64::from(j) * 1e-4);
                // The lower side is deeper everywhere.
                candidates.push((1e-3 + f64::from(i * 100 + j) * 1e-9, plane(x, y, up)));
                candidates.push((1e-5, plane(x, y, -up)));
            }
        }
        let deepest = candidates.iter().map(|c| c.0).fold(0.0, f64::max);
        assert!(Thinning::default().thin(&mut candidates, 0.01, 512));
        assert!(candidates.len() <= 512 && candidates.len() > 200, "{}", candidates.len());
        assert!(candidates.iter().any(|c| c.0 == deepest));
        let upper = candidates.iter().filter(|c| c.1.normal_w.z < 0.0).count();
        assert!(upper * 3 > candidates.len(), "{upper} of {}", candidates.len());
    }

    #[test]
    fn few_planes_are_left_alone_and_equal_ones_end() {
        let mut candidates = vec![(0.0, plane(0.0, 0.0, Vector3::z())); 3];
        assert!(!Thinning::default().thin(&mut candidates, 0.01, 3));
        assert!(Thinning::default().thin(&mut candidates, 0.01, 2));
        assert_eq!(candidates.len(), 1);
    }

    /// Would catch axes whose bits fall on each other.
    #[test]
    fn every_bit_has_its_place() {
        (0..AXIS_BITS).for_each(|bit| assert_eq!(spread(1 << bit), 1 << (3 * bit)));
        assert_eq!(spread(0b1011), 0b1_000_001_001);
    }

    /// Would catch a cell that loses its deepest plane, cells that are larger than they need to be, and planes that change their order: against one
    /// count after the other, far away and without a number included.
    #[test]
    fn cells_are_the_smallest_that_leave_few_enough() {
        let mut seed = 3u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        for round in 0..20 {
            let size = if round % 5 == 4 { 1e9 } else { 0.01 };
            let mut all: Vec<Candidate> = (0..3000)
                .map(|_| {
                    let normal = Vector3::new(number(), number(), number()).normalize();
                    (1e-3 * number(), plane(size * number(), size * number(), normal))
                })
                .collect();
            if round == 7 {
                all[5].1.point_b.x = f64::NAN;
            }
            let most = 100 + 37 * round;
            let cells = |shift: usize| {
                let keys = all.iter().map(|c| key(&c.1, 0.01 * FINEST) >> shift);
                keys.collect::<std::collections::BTreeSet<u64>>()
            };
            let shift = (0..).find(|&s| cells(s).len() <= most).unwrap();
            let wanted: std::collections::BTreeSet<usize> = cells(shift)
                .iter()
                .map(|&cell| {
                    let own = (0..all.len()).filter(|&i| key(&all[i].1, 0.01 * FINEST) >> shift == cell);
                    own.max_by(|&a, &b| all[a].0.total_cmp(&all[b].0)).unwrap()
                })
                .collect();
            let mut kept = all.clone();
            assert!(Thinning::default().thin(&mut kept, 0.01, most));
            let depths = |list: &mut dyn Iterator<Item = f64>| list.map(f64::to_bits).collect::<Vec<_>>();
            assert_eq!(depths(&mut kept.iter().map(|c| c.0)), depths(&mut wanted.iter().map(|&i| all[i].0)));
        }
    }
}
