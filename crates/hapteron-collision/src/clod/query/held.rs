//! What is kept beside a sample: the triangles that can be its closest one, each with a plane that bounds its distance.
//!
//! A triangle lies behind any plane across the direction from its closest point. So wherever the sample goes, its distance to the triangle is at least the height above
//! that plane: much more than the distance less the way, since the heights above the planes of neighbours change almost alike. Mostly sixteen heights in single precision
//! tell that the triangle of the last foot is still the closest, and only that one is looked at exactly.

use super::known::{Closest, HELD};
use crate::clod::nearest::{NOWHERE, from_triangle};
use crate::query::feature::{self, Foot};
use crate::surface::Surface;
use crate::vector::{Vec3, dot, norm, scale, sub};

/// After so many triangles that were looked at in vain the planes are made anew.
const SPENT: u32 = 8;
/// Covers the rounding of heights in single precision.
const ROUNDING: f32 = 1.0 + 1e-6;
/// Distances below this (metres) have no direction.
const TOUCHING: f64 = 1e-12;

/// The triangles that can be the closest to a sample, and which one was.
#[derive(Clone, Debug)]
pub(super) struct Held {
    /// Where the sample was when the planes were made.
    base: Vec3,
    /// Lower bound of the distances of all triangles but these from there.
    rest: f64,
    /// Of the closest triangle.
    corners: [Vec3; 3],
    lane: u32,
    spent: u32,
    /// By lane the height of the base above a plane in front of the triangle, and the plane's normal by axis.
    heights: [f32; HELD],
    normals: [[f32; HELD]; 3],
    triangles: [u32; HELD],
}

impl Held {
    pub(super) const NOTHING: Self = Self {
        base: [0.0; 3],
        rest: f64::NEG_INFINITY,
        corners: [[0.0; 3]; 3],
        lane: 0,
        spent: 0,
        heights: [f32::INFINITY; HELD],
        normals: [[0.0; HELD]; 3],
        triangles: [NOWHERE; HELD],
    };

    /// The foot of the sample at `p`. None when that may be on another triangle than these.
    #[inline(always)]
    pub(super) fn foot(&mut self, p: Vec3, other: &Surface) -> Option<Foot> {
        let way = sub(p, self.base);
        let rest = self.rest - norm(way);
        if !(rest > 0.0) {
            return None;
        }
        let triangle = self.triangles[self.lane as usize];
        let mut foot = feature::foot_between(p, self.corners, triangle, other);
        if !(foot.signed_distance.abs() < rest) {
            return None;
        }
        let mask = self.lower(way, foot.signed_distance.abs()) & !(1 << self.lane);
        if mask != 0 {
            self.choose(p, other, mask, &mut foot);
        }
        Some(foot)
    }

    /// Bit `i` is set when the triangle in lane `i` may be as close as `distance`, so far from the base.
    #[inline(always)]
    fn lower(&self, way: Vec3, distance: f64) -> u32 {
        let [x, y, z] = way.map(|c| c as f32);
        let mut heights = [0.0; HELD];
        for l in 0..HELD {
            heights[l] =
                self.heights[l] + self.normals[0][l] * x + self.normals[1][l] * y + self.normals[2][l] * z;
        }
        let way = x.abs() + y.abs() + z.abs();
        let limit = (distance as f32 + 1e-6 * way) * ROUNDING;
        heights.iter().enumerate().fold(0, |mask, (lane, &height)| mask | u32::from(height <= limit) << lane)
    }

    /// Looks at the triangles of a mask as well. Of equals the first has the foot.
    #[inline(never)]
    fn choose(&mut self, p: Vec3, other: &Surface, mut mask: u32, foot: &mut Foot) {
        self.spent += mask.count_ones();
        let before = self.lane;
        while mask != 0 {
            let lane = mask.trailing_zeros();
            mask &= mask - 1;
            let (triangle, held) = (self.triangles[lane as usize], self.triangles[self.lane as usize]);
            let new = feature::foot(p, triangle, other);
            let (distance, least) = (new.signed_distance.abs(), foot.signed_distance.abs());
            if distance < least || (distance == least && triangle < held) {
                (self.lane, *foot) = (lane, new);
            }
        }
        if self.lane != before {
            self.corners = feature::corners(self.triangles[self.lane as usize], other);
        }
        if self.spent > SPENT {
            self.rest -= norm(sub(p, self.base));
            self.make_planes(p, other);
        }
    }

    /// Begins anew with the triangles around a sample, the closest of which is known.
    #[inline(always)]
    pub(super) fn renew(&mut self, p: Vec3, triangle: u32, closest: &Closest, other: &Surface) {
        self.triangles = closest.triangles;
        let lane = self.triangles.iter().position(|&t| t == triangle);
        self.rest = if lane.is_some() { closest.rest } else { f64::NEG_INFINITY };
        self.lane = lane.unwrap_or(0) as u32;
        self.corners = feature::corners(triangle, other);
        self.make_planes(p, other);
    }

    fn make_planes(&mut self, p: Vec3, other: &Surface) {
        (self.base, self.spent) = (p, 0);
        let mut corners = [[[0.0; HELD]; 3]; 3];
        for (lane, &triangle) in self.triangles.iter().enumerate().filter(|(_, t)| **t != NOWHERE) {
            for (to, from) in corners.iter_mut().zip(feature::corners(triangle, other)) {
                (0..3).for_each(|k| to[k][lane] = from[k] - p[k]);
            }
        }
        planes(&corners, &mut self.heights, &mut self.normals);
        for lane in (0..HELD).filter(|&lane| self.triangles[lane] == NOWHERE) {
            self.heights[lane] = f32::INFINITY;
        }
    }
}

/// By lane the plane in front of a triangle (its corners by axis, seen from the origin) across the direction to it: the height of the origin above it and
/// its normal, which is a bit shorter than a unit, so that no height is greater than the distance to the triangle.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512dq", "x86_64+avx2"))]
fn planes(corners: &[[[f64; HELD]; 3]; 3], heights: &mut [f32; HELD], normals: &mut [[f32; HELD]; 3]) {
    for lane in 0..HELD {
        let [a, b, c] = corners.map(|corner| [corner[0][lane], corner[1][lane], corner[2][lane]]);
        let from = from_triangle(sub(b, a), sub(c, a), scale(a, -1.0));
        let distance = norm(from);
        let inverse = if distance > TOUCHING { (1.0 - 1e-6) / distance } else { 0.0 };
        let normal = scale(from, inverse).map(|c| c as f32);
        let along = normal.map(f64::from);
        let height = -dot(along, a).max(dot(along, b)).max(dot(along, c));
        // Rounded down.
        heights[lane] = (height - height.abs() * 1e-7 - f64::from(f32::MIN_POSITIVE)) as f32;
        (0..3).for_each(|k| normals[k][lane] = normal[k]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a plane that is farther from somewhere than its triangle is: the closest triangle would be overlooked.
    #[test]
    fn planes_are_no_farther_than_their_triangles() {
        let mut seed = 5u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let mut tight = 0;
        for round in 0..20_000 {
            let corners = [0; 3].map(|_| [0; 3].map(|_| 1e-3 * number()));
            let lift = [0; 3].map(|_| 1e-3 * number());
            // Some triangles without area, some seen from a corner.
            let corners = if round % 7 == 0 { [corners[0], corners[1], corners[0]] } else { corners };
            let mut lanes = [[[0.0; HELD]; 3]; 3];
            for (to, from) in lanes.iter_mut().zip(corners) {
                (0..3).for_each(|k| to[k][round % HELD] = from[k] - lift[k]);
            }
            let (mut heights, mut normals) = ([0.0; HELD], [[0.0; HELD]; 3]);
            planes(&lanes, &mut heights, &mut normals);
            let (height, normal) = (heights[round % HELD], normals.map(|axis| axis[round % HELD]));
            let way = [0; 3].map(|_| 5e-4 * number());
            let [a, b, c] = corners;
            let p = [0, 1, 2].map(|k| lift[k] + way[k]);
            let distance = norm(from_triangle(sub(b, a), sub(c, a), sub(p, a)));
            let lower = f64::from(height) + dot(normal.map(f64::from), way);
            assert!(lower <= distance * (1.0 + 1e-12), "{lower} {distance}");
            tight += usize::from(lower > 0.9 * distance);
        }
        assert!(tight > 5_000, "{tight}");
    }
}
