//! The cup of the paper's section 7.3: a mug that fits into a sphere of 8 cm radius, 4,000 triangles.
//!
//! The wall is a surface of revolution closed at both poles; the handle is a tube whose two end rings *are* the
//! borders of two windows cut into the outer wall, so that body and handle are one closed surface of genus 1.

use super::shape::{Point, Shape, add, scale};

/// Vertices around the axis.
const AROUND: usize = 48;
/// How much closer the vertices stand on the side of the handle (0 = evenly).
const CROWDING: f64 = 0.25;
/// Half the angular width of a window, in vertices, and its height in rows.
const WINDOW: (usize, usize) = (2, 2);
/// Bands of quadrilaterals along the handle.
const HANDLE_BANDS: usize = 30;
/// Height of the mug and thickness of its wall, millimetres.
const HEIGHT: f64 = 110.0;
const WALL: f64 = 3.6;
/// Height of the middle of the handle's opening over the table, millimetres.
const OPENING_HEIGHT: f64 = 56.0;
/// Distance of the handle's arms from that height, measured to their middle, millimetres.
const ARM: f64 = 25.0;
/// Distance of the grip (the handle's upright) from the mug's axis, measured to its middle, millimetres.
const GRIP: f64 = 82.5;
/// Radius of the bends between arms and grip, millimetres.
const BEND: f64 = 19.0;
/// Half the width and half the thickness of the handle, millimetres.
const HANDLE_HALF_SIZES: [f64; 2] = [7.5, 5.0];
/// Length over which the handle widens towards the wall, and by how much.
const FLARE: (f64, f64) = (11.0, 0.3);

/// A passage through a model, in its mesh frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opening {
    /// Middle of the passage.
    pub centre: [f64; 3],
    /// Unit direction in which something is put through.
    pub axis: [f64; 3],
    /// Free distance from the middle along x (across the handle) and along z (up and down).
    pub half_sizes: [f64; 2],
}

/// The opening of the cup's handle. Its arms above and below are straight for
/// |x - centre| up to 0.8 mm towards the grip and all the way to the wall on the other side.
pub const OPENING: Opening = {
    let wall = 44.5 + 2.5 * (OPENING_HEIGHT / HEIGHT) * (OPENING_HEIGHT / HEIGHT);
    let grip = GRIP - HANDLE_HALF_SIZES[1];
    Opening {
        centre: [0.5e-3 * (wall + grip), 0.0, 1e-3 * OPENING_HEIGHT],
        axis: [0.0, 1.0, 0.0],
        half_sizes: [0.5e-3 * (grip - wall), 1e-3 * (ARM - HANDLE_HALF_SIZES[1])],
    }
};

/// Generates the mug in metres: its axis along z, its foot on z = 0, its handle towards positive x.
pub(crate) fn generate() -> Shape {
    let mut shape = Shape::default();
    let rings: Vec<Vec<u32>> =
        profile().iter().map(|&[radius, z]| ring(&mut shape, radius, z, AROUND)).collect();
    let windows = window_rows();
    for (row, pair) in rings.windows(2).enumerate() {
        let cut = windows.iter().any(|&start| (start..start + WINDOW.1).contains(&row));
        for k in 0..AROUND {
            let from_handle = (k + WINDOW.0) % AROUND;
            if cut && from_handle < 2 * WINDOW.0 {
                continue;
            }
            let next = (k + 1) % AROUND;
            shape.quad([pair[0][k], pair[0][next], pair[1][next], pair[1][k]]);
        }
    }
    if let (Some(foot), Some(bottom)) = (rings.first(), rings.last()) {
        let foot: Vec<u32> = reversed_from_start(foot);
        cap(&mut shape, &foot, -1.0);
        let bottom = bottom.clone();
        cap(&mut shape, &bottom, 1.0);
    }
    let borders = windows.map(|row| window_border(&rings, row));
    handle(&mut shape, &borders);
    shape.compact();
    shape.shift_and_scale([0.0; 3], 1e-3);
    shape
}

/// Radius of the outer wall at a height, millimetres.
fn outer_radius(z: f64) -> f64 {
    44.5 + 2.5 * (z / HEIGHT) * (z / HEIGHT)
}

/// Rows (radius, height) from the foot up the outer wall, over the rim and down the inner wall.
fn profile() -> Vec<[f64; 2]> {
    let mut rows = vec![[36.0, 1.2], [38.5, 0.0], [41.5, 0.4], [43.6, 2.6]];
    for z in [8.5, 16.5, 25.0, 31.0, 37.0, 43.0, 49.5, 56.0, 62.5, 69.0, 75.0, 81.0, 87.0, 93.0, 99.0, 104.5]
    {
        rows.push([outer_radius(z), z]);
    }
    let rim = outer_radius(HEIGHT) - 0.5 * WALL;
    for degrees in [10.0, 50.0, 90.0, 130.0, 170.0] {
        let angle: f64 = degrees * core::f64::consts::PI / 180.0;
        let half = 0.5 * WALL;
        rows.push([rim + half * libm::cos(angle), HEIGHT - half + half * libm::sin(angle)]);
    }
    for z in [97.0, 80.0, 62.0, 44.0, 27.0, 13.0] {
        rows.push([outer_radius(z) - WALL, z]);
    }
    rows.extend([[37.8, 6.6], [33.0, 4.2]]);
    rows
}

/// First row of the lower and of the upper window.
fn window_rows() -> [usize; 2] {
    let rows = profile();
    [OPENING_HEIGHT - ARM, OPENING_HEIGHT + ARM].map(|middle| {
        let row = rows.iter().position(|&[radius, z]| radius > 40.0 && (z - middle).abs() < 1e-9);
        row.unwrap_or(WINDOW.1) - WINDOW.1 / 2
    })
}

/// A ring about the axis, counter-clockwise seen from above, its first vertex towards the handle.
fn ring(shape: &mut Shape, radius: f64, z: f64, count: usize) -> Vec<u32> {
    let mut ring = Vec::with_capacity(count);
    for k in 0..count {
        let even = 2.0 * core::f64::consts::PI * k as f64 / count as f64;
        let angle = even - CROWDING * libm::sin(even);
        ring.push(shape.vertex([radius * libm::cos(angle), radius * libm::sin(angle), z]));
    }
    ring
}

/// The ring the other way round, still beginning at its first vertex.
fn reversed_from_start(ring: &[u32]) -> Vec<u32> {
    let mut reversed: Vec<u32> = ring.iter().rev().copied().collect();
    reversed.rotate_right(1);
    reversed
}

/// Closes a polar ring of 48 by rings of 24 and 12 and a fan; `side` is -1 below the foot and 1 inside on the bottom.
fn cap(shape: &mut Shape, outer: &[u32], side: f64) {
    let [start, height] = {
        let [x, y, z] = shape.vertices[outer[0] as usize];
        [(x * x + y * y).sqrt(), z]
    };
    let middle = if side < 0.0 { 1.6 } else { WALL };
    let mut previous = outer.to_vec();
    for (count, share) in [(24, 0.66), (12, 0.33)] {
        let mut inner = ring(shape, start * share, middle + (height - middle) * share * share * share, count);
        if side < 0.0 {
            inner = reversed_from_start(&inner);
        }
        shape.halving_band(&previous, &inner);
        previous = inner;
    }
    let apex = shape.vertex([0.0, 0.0, middle]);
    shape.fan(&previous, apex);
}

/// Border of the window that begins at `row`, counter-clockwise seen from outside, from the middle of its right side.
fn window_border(rings: &[Vec<u32>], row: usize) -> Vec<u32> {
    let (half, rows) = WINDOW;
    let column = |offset: isize| (offset.rem_euclid(AROUND as isize)) as usize;
    let half = half as isize;
    let mut border = Vec::new();
    border.extend((rows / 2..rows).map(|r| rings[row + r][column(half)]));
    border.extend((-half + 1..=half).rev().map(|c| rings[row + rows][column(c)]));
    border.extend((1..=rows).rev().map(|r| rings[row + r][column(-half)]));
    border.extend((-half..half).map(|c| rings[row][column(c)]));
    border.extend((0..rows / 2).map(|r| rings[row + r][column(half)]));
    border
}

/// Runs the tube from the lower window to the upper one.
fn handle(shape: &mut Shape, borders: &[Vec<u32>; 2]) {
    let count = borders[0].len();
    // Seen along the tube the upper window's border runs the other way round and begins at the same side.
    let last: Vec<u32> = (0..count).map(|k| borders[1][(count - k) % count]).collect();
    let start = outer_radius(OPENING_HEIGHT - ARM);
    let mut previous = borders[0].clone();
    for band in 1..HANDLE_BANDS {
        let travelled = path_length(start) * band as f64 / HANDLE_BANDS as f64;
        let (centre, outwards) = path(start, travelled);
        let from_wall = travelled.min(path_length(start) - travelled) / FLARE.0;
        let widening = 1.0 + FLARE.1 * (1.0 - from_wall).max(0.0) * (1.0 - from_wall).max(0.0);
        let mut section = Vec::with_capacity(count);
        for k in 0..count {
            let angle = 2.0 * core::f64::consts::PI * k as f64 / count as f64;
            let across = HANDLE_HALF_SIZES[0] * rounded(libm::cos(angle)) * widening;
            let along = HANDLE_HALF_SIZES[1] * rounded(libm::sin(angle)) * widening;
            section.push(shape.vertex(add(add(centre, [0.0, across, 0.0]), scale(outwards, -along))));
        }
        shape.band(&previous, &section);
        previous = section;
    }
    shape.band(&previous, &last);
}

/// Makes a circle's coordinate that of a superellipse with fuller corners.
fn rounded(x: f64) -> f64 {
    x.signum() * libm::pow(x.abs(), 0.85)
}

/// Length of the handle's middle line, millimetres.
fn path_length(start: f64) -> f64 {
    let arm = GRIP - BEND - start;
    2.0 * arm + core::f64::consts::PI * BEND + 2.0 * (ARM - BEND)
}

/// Point of the handle's middle line after `travelled`, and the direction away from the middle of the opening there.
fn path(start: f64, travelled: f64) -> (Point, Point) {
    let whole = path_length(start);
    // The line is symmetric about the height of the opening.
    let (lower, sign) = if travelled > 0.5 * whole { (whole - travelled, 1.0) } else { (travelled, -1.0) };
    let arm = GRIP - BEND - start;
    let quarter = 0.5 * core::f64::consts::PI * BEND;
    let (x, z, out_x, out_z) = if lower < arm {
        (start + lower, ARM, 0.0, 1.0)
    } else if lower < arm + quarter {
        let angle = (lower - arm) / BEND;
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        (GRIP - BEND + BEND * sin, ARM - BEND + BEND * cos, sin, cos)
    } else {
        (GRIP, ARM - BEND - (lower - arm - quarter), 1.0, 0.0)
    };
    ([x, 0.0, OPENING_HEIGHT + sign * z], [out_x, 0.0, sign * out_z])
}
