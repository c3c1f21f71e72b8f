//! Fewer planes when a query finds more contacts than a tick can weigh.

use hapteron_dynamics::ContactPlane;

/// A plane with its depth at the snapshot, metres.
pub type Candidate = (f64, ContactPlane);

/// First cell size, as a share of the body's radius; it grows until few enough planes are left.
const FIRST_CELL: f64 = 1.0 / 128.0;
const GROWTH: f64 = 1.25;

/// Keeps the deepest plane of each cell of the body's space and each octant of directions, with the smallest cells that leave no
/// more than `most`. Tells whether any plane was dropped.
///
/// Unlike keeping the deepest of all this leaves no side of the body unsupported. The cells move with the body, so that the choice
/// changes little from pass to pass. Deterministic; the planes that are kept stay in their order.
pub fn thin(candidates: &mut Vec<Candidate>, radius: f64, most: usize) -> bool {
    if candidates.len() <= most {
        return false;
    }
    let mut cell = radius * FIRST_CELL;
    loop {
        let mut order: Vec<(u64, usize)> = candidates.iter().map(|c| key(&c.1, cell)).zip(0..).collect();
        order.sort_unstable_by(|a, b| {
            let depth = |i: usize| candidates[i].0;
            a.0.cmp(&b.0).then(depth(b.1).total_cmp(&depth(a.1))).then(a.1.cmp(&b.1))
        });
        order.dedup_by_key(|o| o.0);
        // With cells as large as the body only the octants are left.
        if order.len() <= most || !(cell < 8.0 * radius) {
            order.truncate(most);
            let mut kept: Vec<usize> = order.into_iter().map(|o| o.1).collect();
            kept.sort_unstable();
            *candidates = kept.into_iter().map(|i| candidates[i]).collect();
            return true;
        }
        cell *= GROWTH;
    }
}

/// The cell of a plane's point and the octant of its normal, as one number.
fn key(plane: &ContactPlane, cell: f64) -> u64 {
    // 20 bits an axis: cells are never smaller than 1/128 of the radius, so none overflows.
    let axis = |x: f64| ((x / cell).floor() as i64 & 0xf_ffff) as u64;
    let p = plane.point_b;
    let n = plane.normal_w;
    let octant = u64::from(n.x > 0.0) | u64::from(n.y > 0.0) << 1 | u64::from(n.z > 0.0) << 2;
    (axis(p.x) << 43) | (axis(p.y) << 23) | (axis(p.z) << 3) | octant
}

#[cfg(test)]
mod tests {
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
        assert!(thin(&mut candidates, 0.01, 512));
        assert!(candidates.len() <= 512 && candidates.len() > 200, "{}", candidates.len());
        assert!(candidates.iter().any(|c| c.0 == deepest));
        let upper = candidates.iter().filter(|c| c.1.normal_w.z < 0.0).count();
        assert!(upper * 3 > candidates.len(), "{upper} of {}", candidates.len());
    }

    #[test]
    fn few_planes_are_left_alone_and_equal_ones_end() {
        let mut candidates = vec![(0.0, plane(0.0, 0.0, Vector3::z())); 3];
        assert!(!thin(&mut candidates, 0.01, 3));
        assert!(thin(&mut candidates, 0.01, 2));
        assert_eq!(candidates.len(), 1);
    }
}
