//! Arrows, discs and the floor's grid, as triangles and strokes.

use super::geometry::Vertex;
use super::picture::{Colour, Stroke, single};
use nalgebra::{Point3, Vector3};
use std::f64::consts::TAU;

/// Sides of an arrow's shaft.
const SIDES: usize = 14;
/// Pieces of a bent arrow.
const BENDS: usize = 40;
/// Corners of a disc.
const DISC: usize = 24;

/// Two unit vectors across one.
fn across(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let other = if axis.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
    let u = axis.cross(&other).normalize();
    [u, axis.cross(&u)]
}

fn vertex(position: &Point3<f64>, normal: &Vector3<f64>, colour: Colour) -> Vertex {
    let length = normal.norm().max(1e-30);
    Vertex { position: single(position), normal: (normal / length).map(|c| c as f32).into(), colour }
}

/// A ring of points with the direction outwards at each.
fn ring(center: &Point3<f64>, axis: &Vector3<f64>, radius: f64) -> Vec<(Point3<f64>, Vector3<f64>)> {
    let [u, v] = across(axis);
    let around = |k: usize| {
        let a = TAU * k as f64 / SIDES as f64;
        let out = u * a.cos() + v * a.sin();
        (center + out * radius, out)
    };
    (0..=SIDES).map(around).collect()
}

/// Triangles between two rings; `slope` leans their normals along the axis.
fn tube(
    out: &mut Vec<Vertex>,
    a: &[(Point3<f64>, Vector3<f64>)],
    b: &[(Point3<f64>, Vector3<f64>)],
    lean: &Vector3<f64>,
    colour: Colour,
) {
    let put = |p: &(Point3<f64>, Vector3<f64>)| vertex(&p.0, &(p.1 + lean), colour);
    for (from, to) in a.windows(2).zip(b.windows(2)) {
        out.extend([put(&from[0]), put(&from[1]), put(&to[1]), put(&from[0]), put(&to[1]), put(&to[0])]);
    }
}

/// A cone from a base to a tip, with its bottom.
fn cone(out: &mut Vec<Vertex>, base: &Point3<f64>, tip: &Point3<f64>, radius: f64, colour: Colour) {
    let axis = (tip - base).normalize();
    let rim = ring(base, &axis, radius);
    let end: Vec<_> = rim.iter().map(|p| (*tip, p.1)).collect();
    tube(out, &rim, &end, &(axis * (radius / (tip - base).norm())), colour);
    for pair in rim.windows(2) {
        out.extend([pair[1].0, pair[0].0, *base].map(|p| vertex(&p, &-axis, colour)));
    }
}

/// An arrow, solid; `radius` of its shaft. Nothing when it has no length.
pub fn arrow(out: &mut Vec<Vertex>, from: &Point3<f64>, along: &Vector3<f64>, radius: f64, colour: Colour) {
    let length = along.norm();
    if !(length > 1e-9 && length.is_finite()) {
        return;
    }
    let axis = along / length;
    let head = (5.5 * radius).min(0.6 * length);
    let neck = from + axis * (length - head);
    let start = ring(from, &axis, radius);
    tube(out, &start, &ring(&neck, &axis, radius), &Vector3::zeros(), colour);
    for pair in start.windows(2) {
        out.extend([pair[1].0, pair[0].0, *from].map(|p| vertex(&p, &-axis, colour)));
    }
    cone(out, &neck, &(from + along), 2.4 * radius.min(head / 2.0), colour);
}

/// An arrow bent around an axis: a torque, turning as the right hand's fingers. `sweep` in radians. Gives the place of its tip.
pub fn turn(
    out: &mut Vec<Vertex>,
    center: &Point3<f64>,
    axis: &Vector3<f64>,
    bend: f64,
    sweep: f64,
    radius: f64,
    colour: Colour,
) -> Option<Point3<f64>> {
    let length = axis.norm();
    if !(length > 1e-12 && length.is_finite() && sweep > 1e-3) {
        return None;
    }
    let axis = axis / length;
    let [u, v] = across(&axis);
    let at = |a: f64| center + (u * a.cos() + v * a.sin()) * bend;
    let tangent = |a: f64| v * a.cos() - u * a.sin();
    let head = (5.5 * radius / bend).min(0.6 * sweep);
    let shaft = sweep - head;
    let mut last = ring(&at(0.0), &tangent(0.0), radius);
    for k in 1..=BENDS {
        let a = shaft * k as f64 / BENDS as f64;
        // The ring is carried along the bend, not made anew, so that it does not twist.
        let turn = nalgebra::Rotation3::new(axis * (shaft / BENDS as f64));
        let next: Vec<_> = last.iter().map(|(p, n)| (center + turn * (p - center), turn * n)).collect();
        debug_assert!((next[0].0 - at(a)).norm() < 3.0 * radius + 1e-9);
        tube(out, &last, &next, &Vector3::zeros(), colour);
        last = next;
    }
    let neck = at(shaft);
    let tip = neck + tangent(shaft) * (head * bend);
    cone(out, &neck, &tip, 2.4 * radius, colour);
    Some(tip)
}

/// A disc to see through, and its rim.
pub fn disc(
    sheets: &mut Vec<Vertex>,
    strokes: &mut Vec<Stroke>,
    center: &Point3<f64>,
    normal: &Vector3<f64>,
    radius: f64,
    fill: Colour,
    rim: Colour,
) {
    let [u, v] = across(normal);
    let at = |k: usize| {
        let a = TAU * k as f64 / DISC as f64;
        center + (u * a.cos() + v * a.sin()) * radius
    };
    for k in 0..DISC {
        let (a, b) = (at(k), at(k + 1));
        sheets.extend([*center, a, b].map(|p| vertex(&p, normal, fill)));
        strokes.push(Stroke::line(&a, &b, 1.0, rim));
    }
}

/// The largest of 1, 2, 5 times a power of ten that is not above a length.
#[must_use]
pub fn nice_below(length: f64) -> f64 {
    if !(length > 0.0 && length.is_finite()) {
        return 1.0;
    }
    let power = 10f64.powf(length.log10().floor());
    let steps = [5.0, 2.0, 1.0];
    let share = length / power * (1.0 + 1e-9);
    steps.into_iter().find(|s| *s <= share).unwrap_or(1.0) * power
}

/// A square grid on the plane z = `height` around a place, fading outwards, every fifth line stronger.
pub fn grid(strokes: &mut Vec<Stroke>, center: &Point3<f64>, height: f64, radius: f64, colour: Colour) {
    let step = nice_below(radius / 4.0);
    let lines = (2.2 * radius / step).round() as i64;
    let (cx, cy) = ((center.x / step).round() as i64, (center.y / step).round() as i64);
    let reach = lines as f64 * step;
    for k in -lines..=lines {
        for along_x in [true, false] {
            let (middle, start) = if along_x { (cy, cx) } else { (cx, cy) };
            let strong = (middle + k) % 5 == 0;
            let fixed = (middle + k) as f64 * step;
            // In pieces, so that each end can fade on its own.
            const PIECES: i64 = 4;
            for piece in 0..PIECES {
                let place = |n: i64| {
                    let moving = start as f64 * step + reach * (2.0 * n as f64 / PIECES as f64 - 1.0);
                    let (x, y) = if along_x { (moving, fixed) } else { (fixed, moving) };
                    Point3::new(x, y, height)
                };
                let (a, b) = (place(piece), place(piece + 1));
                let middle = nalgebra::center(&a, &b);
                let away = (middle.xy() - center.xy()).norm() / reach;
                let share = (1.0 - away).max(0.0) * if strong { 1.0 } else { 0.5 };
                let [r, g, bl, alpha] = colour;
                let alpha = (f64::from(alpha) * share) as u8;
                if alpha > 2 {
                    strokes.push(Stroke::line(&a, &b, 1.0, [r, g, bl, alpha]));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch an arrow whose tip is not where the force says, or whose faces look inwards.
    #[test]
    fn an_arrow_ends_where_it_should_and_faces_outwards() {
        let mut out = Vec::new();
        let from = Point3::new(0.01, 0.02, 0.03);
        let along = Vector3::new(0.0, 0.1, 0.05);
        arrow(&mut out, &from, &along, 0.002, [255; 4]);
        let point = |v: &Vertex| Point3::from(v.position.map(f64::from));
        let farthest = out.iter().map(|v| (point(v) - from).dot(&along.normalize())).fold(0.0, f64::max);
        assert!((farthest - along.norm()).abs() < 1e-6);
        for t in out.chunks(3) {
            let [a, b, c] = [point(&t[0]), point(&t[1]), point(&t[2])];
            let face = (b - a).cross(&(c - a));
            let normal = Vector3::from(t[0].normal.map(f64::from));
            assert!(face.norm() < 1e-12 || face.dot(&normal) > 0.0, "{t:?}");
        }
    }

    /// Would catch a torque arrow that turns the wrong way.
    #[test]
    fn a_turn_goes_around_its_axis_by_the_right_hand() {
        let mut out = Vec::new();
        let axis = Vector3::new(0.1, -0.4, 0.7);
        let center = Point3::new(0.0, 0.1, 0.0);
        let tip = turn(&mut out, &center, &axis, 0.05, 2.0, 0.002, [255; 4]).unwrap();
        let mut half = Vec::new();
        let before = turn(&mut half, &center, &axis, 0.05, 1.9, 0.002, [255; 4]).unwrap();
        assert!((before - center).cross(&(tip - center)).dot(&axis) > 0.0);
    }

    #[test]
    fn nice_lengths_are_one_two_or_five() {
        for (length, nice) in
            [(0.0123, 0.01), (0.05, 0.05), (0.049, 0.02), (7.3, 5.0), (1.0, 1.0), (0.2, 0.2)]
        {
            assert!((nice_below(length) - nice).abs() < 1e-12, "{length}: {}", nice_below(length));
        }
        assert_eq!(nice_below(0.0), 1.0);
    }

    #[test]
    fn a_grid_stays_bounded() {
        for radius in [1e-4, 0.06, 3.0, 1e4] {
            let mut strokes = Vec::new();
            grid(&mut strokes, &Point3::new(radius, -2.0 * radius, 0.0), 0.0, radius, [255; 4]);
            assert!(!strokes.is_empty() && strokes.len() < 4_000, "{}", strokes.len());
        }
    }
}
