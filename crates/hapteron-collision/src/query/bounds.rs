//! Boxes, slabs and corners that the walk holds against each other.

use super::kernel::{LaneMask, LaneNumbers, Lanes, lanes, lanes_of};
use crate::surface::{LANES, LEAF, Leaf, Node};
use crate::vector::{Rigid, dot};
use fearless_simd::{Simd, prelude::*};

/// A box and a slab around the same thing, in single precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub center: [f32; 3],
    pub half: [f32; 3],
    pub normal: [f32; 3],
    pub low: f32,
    pub high: f32,
}

/// Which of a node's children are nodes.
#[inline(always)]
pub(super) fn nodes<S: Simd>(simd: S, node: &Node) -> LaneMask<S> {
    LaneNumbers::load_array_ref(simd, &node.child).simd_lt(LEAF)
}

/// Which of a node's children are nodes with a box whose squared diagonal is longer than this.
#[inline(always)]
pub(super) fn coarse_nodes<S: Simd>(simd: S, node: &Node, extent: f32) -> LaneMask<S> {
    let mut own = Lanes::splat(simd, 0.0);
    for k in 0..3 {
        let side = lanes(simd, &node.max[k]) - lanes(simd, &node.min[k]);
        own += side * side;
    }
    own.simd_gt(extent) & nodes(simd, node)
}

/// Boxes with slabs, by axis and lane.
pub(super) struct Boxes<'a> {
    pub min: [&'a [f32; LANES]; 3],
    pub max: [&'a [f32; LANES]; 3],
    pub normal: [&'a [f32; LANES]; 3],
    pub low: &'a [f32; LANES],
    pub high: &'a [f32; LANES],
}

impl<'a> Boxes<'a> {
    /// Those of a node's children.
    #[inline(always)]
    pub(super) fn of(node: &'a Node) -> Self {
        Self {
            min: [&node.min[0], &node.min[1], &node.min[2]],
            max: [&node.max[0], &node.max[1], &node.max[2]],
            normal: [&node.normal[0], &node.normal[1], &node.normal[2]],
            low: &node.low,
            high: &node.high,
        }
    }

    /// Whose boxes may be within the margin of the one of the bounds.
    #[inline(always)]
    pub(super) fn touch<S: Simd>(&self, simd: S, b: &Bounds, margin: f32) -> LaneMask<S> {
        let mut apart = LaneMask::splat(simd, false);
        for k in 0..3 {
            let reach = b.half[k] + margin;
            apart |= lanes(simd, self.min[k]).simd_gt(b.center[k] + reach)
                | lanes(simd, self.max[k]).simd_lt(b.center[k] - reach);
        }
        !apart
    }

    /// Which of them may be within the margin of what is inside the bounds.
    #[inline(always)]
    pub(super) fn near<S: Simd>(&self, simd: S, b: &Bounds, margin: f32) -> LaneMask<S> {
        let zero = Lanes::splat(simd, 0.0);
        let mut apart = !self.touch(simd, b, margin);
        // Theirs against the box, and the slab against their boxes.
        let (mut height, mut reach) = (zero, Lanes::splat(simd, margin));
        let (mut other_height, mut other_reach) = (zero, reach);
        for k in 0..3 {
            let normal = lanes(simd, self.normal[k]);
            height += normal * b.center[k];
            reach += normal.abs() * b.half[k];
            let (min, max) = (lanes(simd, self.min[k]), lanes(simd, self.max[k]));
            other_height += (min + max) * (0.5 * b.normal[k]);
            other_reach += (max - min) * (0.5 * b.normal[k].abs());
        }
        apart |= (height - reach).simd_gt(lanes(simd, self.high))
            | (height + reach).simd_lt(lanes(simd, self.low));
        apart |= (other_height - other_reach).simd_gt(b.high) | (other_height + other_reach).simd_lt(b.low);
        !apart
    }
}

/// The space between two parallel planes.
pub(super) struct Slab {
    pub normal: [f32; 3],
    pub low: f32,
    pub high: f32,
}

impl Slab {
    #[inline(always)]
    pub(super) fn of(leaf: &Leaf, motion: &Rigid) -> Self {
        let normal = motion.direction(leaf.normal.map(f64::from));
        let shift = dot(normal, motion.translation) as f32;
        Self { normal: normal.map(|c| c as f32), low: leaf.low + shift, high: leaf.high + shift }
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

    /// Squared lengths of the diagonals of their boxes when these are grown by `margin` on all sides.
    #[inline(always)]
    pub(super) fn extents<S: Simd>(&self, simd: S, margin: f32) -> [f32; LANES] {
        let mut sum = Lanes::splat(simd, 0.0);
        for half in &self.half {
            let side = (lanes(simd, half) + margin) * 2.0;
            sum += side * side;
        }
        sum.to_array()
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

    /// The box around some of the children, with the slab of no direction, which everything is in.
    #[inline(always)]
    pub(super) fn around<S: Simd>(&self, simd: S, children: u32) -> Bounds {
        let chosen = LaneMask::from_bitmask(simd, u64::from(children));
        let none = Lanes::splat(simd, f32::INFINITY);
        let mut b = Bounds { center: [0.0; 3], half: [0.0; 3], normal: [0.0; 3], low: 0.0, high: 0.0 };
        for k in 0..3 {
            let (center, half) = (lanes(simd, &self.center[k]), lanes(simd, &self.half[k]));
            let low = chosen.select(center - half, none).reduce_min();
            let high = chosen.select(center + half, -none).reduce_max();
            (b.center[k], b.half[k]) = (0.5 * (low + high), 0.5 * (high - low));
        }
        b
    }
}
