//! The distinct corners of leaves, which are fewer than those of their triangles.

use super::super::kernel::Lanes;
use crate::surface::{LANES, Leaf, Surface};
use crate::vector::Rigid;
use fearless_simd::{Simd, f32x8, f64x4, prelude::*};

/// A leaf's triangles have no more corners than this.
const MOST: usize = 3 * LANES;

/// A rigid motion by its columns.
#[derive(Clone, Copy)]
pub(super) struct Columns<S: Simd> {
    axes: [f64x4<S>; 3],
    shift: f64x4<S>,
}

impl<S: Simd> Columns<S> {
    pub(super) fn new(simd: S, motion: &Rigid) -> Self {
        let column = |v: [f64; 3]| f64x4::load_array(simd, [v[0], v[1], v[2], 0.0]);
        Self {
            axes: [0, 1, 2].map(|k| column(motion.rotation.map(|row| row[k]))),
            shift: column(motion.translation),
        }
    }

    #[inline(always)]
    fn point(&self, simd: S, &[x, y, z]: &[f64; 3]) -> f64x4<S> {
        let [x, y, z] = [f64x4::splat(simd, x), f64x4::splat(simd, y), f64x4::splat(simd, z)];
        self.axes[0] * x + self.axes[1] * y + self.axes[2] * z + self.shift
    }
}

/// The distinct corners of a leaf after a rigid motion, and the box around them.
#[derive(Clone, Debug, Default)]
pub(super) struct Corners {
    /// Two in each, of four numbers the last of which means nothing.
    at: [[f32; 8]; MOST / 2],
    /// How many pairs there are.
    pairs: usize,
    pub min: [f32; 3],
    pub max: [f32; 3],
}

impl Corners {
    /// Takes those of a leaf.
    #[inline(always)]
    pub(super) fn take<S: Simd>(&mut self, simd: S, surface: &Surface, leaf: &Leaf, columns: &Columns<S>) {
        let list = surface.corners(leaf);
        let (mut low, mut high) = (f32x8::splat(simd, f32::INFINITY), f32x8::splat(simd, f32::NEG_INFINITY));
        for (two, at) in list.as_chunks::<2>().0.iter().zip(&mut self.at) {
            let a = columns.point(simd, &surface.vertices[two[0] as usize]);
            let b = columns.point(simd, &surface.vertices[two[1] as usize]);
            let both = a.narrow(b);
            (low, high) = (low.min(both), high.max(both));
            *at = both.to_array();
        }
        self.pairs = list.len() / 2;
        let (low, high) = (low.to_array(), high.to_array());
        for k in 0..3 {
            self.min[k] = low[k].min(low[k + 4]);
            self.max[k] = high[k].max(high[k + 4]);
        }
    }

    /// Between which heights they lie along as many directions as there are lanes.
    #[inline(always)]
    pub(super) fn heights<S: Simd>(&self, simd: S, [x, y, z]: [Lanes<S>; 3]) -> [Lanes<S>; 2] {
        let (mut low, mut high) = (Lanes::splat(simd, f32::INFINITY), Lanes::splat(simd, f32::NEG_INFINITY));
        for two in self.at.iter().take(self.pairs) {
            let first = x * two[0] + y * two[1] + z * two[2];
            let second = x * two[4] + y * two[5] + z * two[6];
            (low, high) = (low.min(first).min(second), high.max(first).max(second));
        }
        [low, high]
    }
}
