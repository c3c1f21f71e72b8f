//! The inner loops, sixteen lanes at a time; every lane is the same IEEE arithmetic on any machine.

use crate::surface::{LANES, Leaf, Node, TriangleBlock};
use fearless_simd::{Level, Simd, dispatch, f32x16, mask32x16, prelude::*, u32x16};

/// As many numbers as there are lanes, to calculate with.
pub(super) type Lanes<S> = f32x16<S>;
pub(super) type LaneNumbers<S> = u32x16<S>;
/// One truth for each of them.
pub(super) type LaneMask<S> = mask32x16<S>;

/// Numbers to calculate with, by the instructions that `simd` stands for.
#[inline(always)]
pub(super) fn lanes<S: Simd>(simd: S, values: &[f32; LANES]) -> Lanes<S> {
    Lanes::load_array_ref(simd, values)
}

/// The same by axis.
#[inline(always)]
pub(super) fn lanes_of<S: Simd, const N: usize>(simd: S, values: &[[f32; LANES]; N]) -> [Lanes<S>; N] {
    core::array::from_fn(
        #[inline(always)]
        |k| lanes(simd, &values[k]),
    )
}

/// A vector in all lanes.
#[inline(always)]
pub(super) fn splat<S: Simd>(simd: S, v: [f32; 3]) -> [Lanes<S>; 3] {
    [Lanes::splat(simd, v[0]), Lanes::splat(simd, v[1]), Lanes::splat(simd, v[2])]
}

/// Scalar products, lane by lane.
#[inline(always)]
pub(super) fn dot<S: Simd>(a: [Lanes<S>; 3], b: [Lanes<S>; 3]) -> Lanes<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// One bit a lane.
#[inline(always)]
pub(super) fn bits<S: Simd>(mask: LaneMask<S>) -> u32 {
    mask.to_bitmask() as u32
}

/// Puts the values of the lanes that are set one after the other into a list from its place number `count` on, which must have room for all
/// lanes, without a branch. Gives the count with them.
#[inline(always)]
pub(super) fn append<S: Simd>(
    list: &mut [u32],
    count: usize,
    values: LaneNumbers<S>,
    set: LaneMask<S>,
) -> usize {
    if let Some(room) = list[count..].first_chunk_mut() {
        *room = values.compress(set).to_array();
    }
    count + set.to_bitmask().count_ones() as usize
}

/// The numbers of the lanes.
pub(super) const NUMBERS: [u32; LANES] = {
    let mut numbers = [0; LANES];
    let mut lane = 0;
    while lane < LANES {
        numbers[lane] = lane as u32;
        lane += 1;
    }
    numbers
};

/// Lower bounds of the squared distances of points, one a lane, to a leaf.
#[inline(always)]
pub(super) fn leaf_squared<S: Simd>(simd: S, p: &[Lanes<S>; 3], leaf: &Leaf, slack: f32) -> Lanes<S> {
    let zero = Lanes::splat(simd, 0.0);
    let (mut sum, mut height) = (zero, zero);
    for (k, &c) in p.iter().enumerate() {
        let (under, over) = (Lanes::splat(simd, leaf.min[k]) - c, c - leaf.max[k]);
        let beyond = (under.max(over) - slack).max(zero);
        sum += beyond * beyond;
        height += c * leaf.normal[k];
    }
    let (under, over) = (Lanes::splat(simd, leaf.low) - height, height - leaf.high);
    let beyond = (under.max(over) - slack).max(zero);
    (beyond * beyond).max(sum)
}

/// Lower bounds of the squared distances of a point to a node's children.
#[inline(always)]
pub(super) fn children_squared<S: Simd>(simd: S, node: &Node, p: [f32; 3], slack: f32) -> [f32; LANES] {
    let zero = Lanes::splat(simd, 0.0);
    let mut sum = zero;
    for (k, &c) in p.iter().enumerate() {
        let (under, over) = (lanes(simd, &node.min[k]) - c, c - lanes(simd, &node.max[k]));
        let beyond = (under.max(over) - slack).max(zero);
        sum += beyond * beyond;
    }
    sum.to_array()
}

/// Scalar products with the vectors of a block.
#[inline(always)]
fn parts<S: Simd>(simd: S, axis: &[[f32; LANES]; 3], p: &[Lanes<S>; 3]) -> Lanes<S> {
    lanes(simd, &axis[0]) * p[0] + lanes(simd, &axis[1]) * p[1] + lanes(simd, &axis[2]) * p[2]
}

/// The vector from the first corners of a block's triangles to a point (from the block's origin).
#[inline(always)]
fn from_corners<S: Simd>(simd: S, p: [f32; 3], b: &TriangleBlock) -> [Lanes<S>; 3] {
    core::array::from_fn(
        #[inline(always)]
        |k| Lanes::splat(simd, p[k]) - lanes(simd, &b.corner[k]),
    )
}

/// Squared distances of a point (from the block's origin) to the triangles of a block.
#[inline(always)]
pub(super) fn squared_distances<S: Simd>(simd: S, p: [f32; 3], b: &TriangleBlock) -> Lanes<S> {
    let q = from_corners(simd, p, b);
    let (x, y, z) = (parts(simd, &b.along, &q), parts(simd, &b.across, &q), parts(simd, &b.normal, &q));
    let length = lanes_of(simd, &b.length);
    let beyond = x - length[0];
    let (u, v) = (lanes_of(simd, &b.second), lanes_of(simd, &b.third));
    let (along2, across2) = (u[0] * beyond + u[1] * y, u[1] * beyond - u[0] * y);
    let (along3, across3) = (v[0] * x + v[1] * y, v[0] * y - v[1] * x);
    let side1 = beside(x, length[0], y);
    let side2 = beside(along2, length[1], across2);
    let side3 = beside(along3, length[2], across3);
    let sides = side1.min(side2).min(side3);
    let over = y.simd_ge(0.0) & across2.simd_le(0.0) & across3.simd_le(0.0);
    z * z + over.select(Lanes::splat(simd, 0.0), sides)
}

/// Squared distance in the plane to a side, from the coordinates along and across it.
#[inline(always)]
fn beside<S: Simd>(along: Lanes<S>, length: Lanes<S>, across: Lanes<S>) -> Lanes<S> {
    let beyond = (-along).max(along - length).max(0.0);
    beyond * beyond + across * across
}

/// [`squared_distances`] for callers without lanes of their own, who know what the machine has.
#[inline(always)]
pub(crate) fn point_triangles(level: Level, p: [f32; 3], b: &TriangleBlock) -> [f32; LANES] {
    dispatch!(level, simd => squared_distances(simd, p, b).to_array())
}

/// The least of all lanes.
#[inline(always)]
pub(crate) fn least(values: &[f32; LANES]) -> f32 {
    let lesser = |a: f32, b: f32| if a < b { a } else { b };
    let (mut all, mut half) = (*values, LANES / 2);
    while half > 0 {
        for l in 0..half {
            all[l] = lesser(all[l], all[l + half]);
        }
        half /= 2;
    }
    all[0]
}

/// Bit `i` is set when value `i` is at most `limit`.
#[inline(always)]
pub(crate) fn at_most(values: &[f32; LANES], limit: f32) -> u32 {
    dispatch!(Level::baseline(), simd => bits(lanes(simd, values).simd_le(limit)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::mesh::TriMesh;
    use crate::query::feature;
    use crate::surface::Surface;

    /// Would catch a distance in single precision that is farther off than the block says, thin and tiny triangles included: then
    /// the closest triangle could be missed.
    #[test]
    fn distances_to_a_block_are_as_certain_as_it_says() {
        let mut seed = 7u64;
        let mut number = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let mut inside = 0;
        for round in 0..4000 {
            // From equilateral to a millionth as high as wide, far from the origin, up to a metre in size.
            let (thin, size) = (0.1f64.powi(round % 7), 0.1f64.powi(round / 7 % 5));
            let a = [0; 3].map(|_| 5.0 * number());
            let side = [0; 3].map(|_| size * number());
            let b = crate::vector::add(a, side);
            let along = number();
            let c = [0, 1, 2].map(|k| a[k] + along * side[k] + thin * size * number());
            let Ok(mesh) = TriMesh::new(vec![a, b, c], vec![[0, 1, 2]]) else { continue };
            let surface = Surface::build(&mesh);
            let (leaf, block) = (&surface.leaves[0], &surface.blocks[0]);
            for _ in 0..20 {
                let p = a.map(|x| x + 1.5 * size * number());
                let local = [0, 1, 2].map(|k| (p[k] - f64::from(block.origin[k])) as f32);
                let squared =
                    dispatch!(Level::new(), simd => squared_distances(simd, local, block).to_array());
                assert_eq!(
                    squared,
                    point_triangles(Level::baseline(), local, block),
                    "the same bits by all instructions"
                );
                let found = f64::from(least(&squared).sqrt());
                let exact = feature::foot(p, leaf.triangle(0), &surface).signed_distance.abs();
                let error = f64::from(block.error) + f64::from(crate::surface::ERROR) * exact;
                assert!((found - exact).abs() <= error, "{found} {exact} {error} {thin} {size}");
                inside += 1;
            }
        }
        assert!(inside > 50_000, "{inside}");
    }
}
