//! Boxes, slabs and corners that the walk holds against each other.

use super::kernel::{LaneMask, Lanes};
use super::kernel::{bits, lanes, lanes_of};
use crate::surface::{LANES, Leaf, Node, TriangleBlock};
use crate::vector::{Rigid, dot};
use fearless_simd::{Simd, prelude::*};

/// An axis-aligned box in single precision, rounded outward.
#[derive(Clone, Copy, Debug)]
pub(super) struct Box32 {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

impl Box32 {
    #[inline(always)]
    pub(super) fn grown(&self, margin: f32) -> Self {
        let mut result = *self;
        for k in 0..3 {
            result.min[k] -= margin;
            result.max[k] += margin;
        }
        result
    }

    #[inline(always)]
    pub(super) fn overlaps(&self, min: &[f32; 3], max: &[f32; 3]) -> bool {
        let mut apart = false;
        for k in 0..3 {
            apart |= (self.min[k] > max[k]) | (self.max[k] < min[k]);
        }
        !apart
    }
}

/// A box and a slab around the same thing, in single precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub center: [f32; 3],
    pub half: [f32; 3],
    pub normal: [f32; 3],
    pub low: f32,
    pub high: f32,
}

impl Bounds {
    /// Length of the diagonal of the box, squared, when that is grown by `margin` on all sides.
    #[inline(always)]
    pub(super) fn extent(&self, margin: f32) -> f32 {
        self.half.iter().map(|h| 4.0 * (h + margin) * (h + margin)).sum()
    }
}

/// Bit `i` is set when child `i` of the node may be within the margin of what is inside the bounds.
#[inline(always)]
pub(super) fn children_near<S: Simd>(simd: S, node: &Node, b: &Bounds, margin: f32) -> u32 {
    let half = Lanes::splat(simd, 0.5);
    let mut apart = LaneMask::splat(simd, false);
    let mut centers = [half; 3];
    let mut halves = [half; 3];
    for k in 0..3 {
        let (min, max) = (lanes(simd, &node.min[k]), lanes(simd, &node.max[k]));
        let reach = b.half[k] + margin;
        apart |= min.simd_gt(b.center[k] + reach) | max.simd_lt(b.center[k] - reach);
        (centers[k], halves[k]) = ((min + max) * half, (max - min) * half);
    }
    if apart.all_true() {
        return 0;
    }
    // Theirs against the box ...
    let (mut height, mut reach) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, margin));
    for k in 0..3 {
        let normal = lanes(simd, &node.normal[k]);
        height += normal * b.center[k];
        reach += normal.abs() * b.half[k];
    }
    apart |=
        (height - reach).simd_gt(lanes(simd, &node.high)) | (height + reach).simd_lt(lanes(simd, &node.low));
    // ... and the slab against their boxes.
    let (mut height, mut reach) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, margin));
    for k in 0..3 {
        height += centers[k] * b.normal[k];
        reach += halves[k] * b.normal[k].abs();
    }
    apart |= (height - reach).simd_gt(b.high) | (height + reach).simd_lt(b.low);
    bits(!apart)
}

/// The space between two parallel planes.
pub(super) struct Slab {
    normal: [f32; 3],
    low: f32,
    high: f32,
}

impl Slab {
    #[inline(always)]
    pub(super) fn of_own(leaf: &Leaf) -> Self {
        Self { normal: leaf.normal, low: leaf.low, high: leaf.high }
    }

    #[inline(always)]
    pub(super) fn of(leaf: &Leaf, motion: &Rigid) -> Self {
        let normal = motion.direction(leaf.normal.map(f64::from));
        let shift = dot(normal, motion.translation) as f32;
        Self { normal: normal.map(|c| c as f32), low: leaf.low + shift, high: leaf.high + shift }
    }

    /// How far from it things between these heights are; negative when they overlap.
    #[inline(always)]
    pub(super) fn apart(&self, (low, high): (f32, f32)) -> f32 {
        (low - self.high).max(self.low - high)
    }

    /// True when the box is farther than `margin` from the slab.
    #[inline(always)]
    pub(super) fn misses(&self, min: &[f32; 3], max: &[f32; 3], margin: f32) -> bool {
        let mut center = 0.0;
        let mut half = margin;
        for k in 0..3 {
            center += self.normal[k] * (0.5 * (min[k] + max[k]));
            half += self.normal[k].abs() * (0.5 * (max[k] - min[k]));
        }
        center - half > self.high || center + half < self.low
    }
}

/// The bounds of a node's children after a rigid motion, by lane.
pub(super) struct MovedChildren {
    center: [[f32; LANES]; 3],
    half: [[f32; LANES]; 3],
    normal: [[f32; LANES]; 3],
    low: [f32; LANES],
    high: [f32; LANES],
}

impl MovedChildren {
    #[inline(always)]
    pub(super) fn new<S: Simd>(simd: S, node: &Node, motion: &Rigid) -> Self {
        let zero = [0.0; LANES];
        let mut result =
            Self { center: [zero; 3], half: [zero; 3], normal: [zero; 3], low: zero, high: zero };
        let (min, max) = (lanes_of(simd, &node.min), lanes_of(simd, &node.max));
        let normal = lanes_of(simd, &node.normal);
        let mut shift = Lanes::splat(simd, 0.0);
        for row in 0..3 {
            let r = motion.rotation[row].map(|c| c as f32);
            let t = motion.translation[row] as f32;
            let mut center = Lanes::splat(simd, t);
            let (mut half, mut turned) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 0.0));
            for k in 0..3 {
                center += (min[k] + max[k]) * (0.5 * r[k]);
                half += (max[k] - min[k]) * (0.5 * r[k].abs());
                turned += normal[k] * r[k];
            }
            shift += turned * t;
            result.center[row] = center.to_array();
            result.half[row] = half.to_array();
            result.normal[row] = turned.to_array();
        }
        result.low = (lanes(simd, &node.low) + shift).to_array();
        result.high = (lanes(simd, &node.high) + shift).to_array();
        result
    }

    /// Bit `i` is set when child `i` may be within the margin of a leaf.
    #[inline(always)]
    pub(super) fn near<S: Simd>(&self, simd: S, leaf: &Leaf, margin: f32) -> u32 {
        let mut apart = LaneMask::splat(simd, false);
        let (mut height, mut reach) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, margin));
        let (mut own_height, mut own_reach) = (height, reach);
        for k in 0..3 {
            let (center, half) = (lanes(simd, &self.center[k]), lanes(simd, &self.half[k]));
            let own = half + margin;
            apart |= (center + own).simd_lt(leaf.min[k]) | (center - own).simd_gt(leaf.max[k]);
            // The leaf's slab against the boxes, and the slabs against its box.
            height += center * leaf.normal[k];
            reach += half * leaf.normal[k].abs();
            let normal = lanes(simd, &self.normal[k]);
            own_height += normal * (0.5 * (leaf.min[k] + leaf.max[k]));
            own_reach += normal.abs() * (0.5 * (leaf.max[k] - leaf.min[k]));
        }
        apart |= (height - reach).simd_gt(leaf.high) | (height + reach).simd_lt(leaf.low);
        let (low, high) = (lanes(simd, &self.low), lanes(simd, &self.high));
        apart |= (own_height - own_reach).simd_gt(high) | (own_height + own_reach).simd_lt(low);
        bits(!apart)
    }

    #[inline(always)]
    pub(super) fn of(&self, lane: usize) -> Bounds {
        let pick = |v: &[[f32; LANES]; 3]| [v[0][lane], v[1][lane], v[2][lane]];
        Bounds {
            center: pick(&self.center),
            half: pick(&self.half),
            normal: pick(&self.normal),
            low: self.low[lane],
            high: self.high[lane],
        }
    }
}

/// The corners of a block's triangles, about a point, after a rigid motion.
#[derive(Clone, Copy)]
pub(super) struct Corners<S: Simd> {
    /// By corner and axis.
    at: [[Lanes<S>; 3]; 3],
    about: [f32; 3],
}

impl<S: Simd> Corners<S> {
    #[inline(always)]
    pub(super) fn moved(simd: S, block: &TriangleBlock, motion: &Rigid) -> Self {
        let about = motion.point(block.origin.map(f64::from)).map(|c| c as f32);
        let (length, third) = (lanes(simd, &block.length[0]), lanes(simd, &block.length[2]));
        let (x, y) = (lanes(simd, &block.third[0]) * third, lanes(simd, &block.third[1]) * third);
        let mut at = [[Lanes::splat(simd, 0.0); 3]; 3];
        for row in 0..3 {
            let r = motion.rotation[row].map(|c| c as f32);
            let first = heights(&lanes_of(simd, &block.corner), r);
            let along = heights(&lanes_of(simd, &block.along), r);
            let across = heights(&lanes_of(simd, &block.across), r);
            at[0][row] = first;
            at[1][row] = first + along * length;
            at[2][row] = first + along * x + across * y;
        }
        Self { at, about }
    }

    /// The box around them.
    #[inline(always)]
    pub(super) fn bounds(&self) -> Box32 {
        let mut result = Box32 { min: [0.0; 3], max: [0.0; 3] };
        for k in 0..3 {
            let (low, high) = self.range([self.at[0][k], self.at[1][k], self.at[2][k]]);
            result.min[k] = self.about[k] + low;
            result.max[k] = self.about[k] + high;
        }
        result
    }

    /// Between which heights they lie along a direction.
    #[inline(always)]
    pub(super) fn heights(&self, normal: [f32; 3]) -> (f32, f32) {
        let about: f32 = (0..3).map(|k| self.about[k] * normal[k]).sum();
        let [a, b, c] = &self.at;
        let (low, high) = self.range([heights(a, normal), heights(b, normal), heights(c, normal)]);
        (about + low, about + high)
    }

    #[inline(always)]
    fn range(&self, [a, b, c]: [Lanes<S>; 3]) -> (f32, f32) {
        (a.min(b).min(c).reduce_min(), a.max(b).max(c).reduce_max())
    }
}

/// Heights of points along a direction.
#[inline(always)]
fn heights<S: Simd>(points: &[Lanes<S>; 3], along: [f32; 3]) -> Lanes<S> {
    points[0] * along[0] + points[1] * along[1] + points[2] * along[2]
}
