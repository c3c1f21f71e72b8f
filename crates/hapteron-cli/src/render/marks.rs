//! Lines, dots and arrows over and among the meshes.

use nalgebra::{Point3, Vector3};

use super::picture::OVERSAMPLING;
use super::{Camera, Colour, Picture};

/// How far a mark is drawn in front of what it lies on, as a share of the distances in the picture.
const LIFT: f64 = 2e-3;

impl Picture {
    /// Draws a straight line of a width in pixels; hidden where a surface is in front of it.
    pub fn draw_segment(
        &mut self,
        camera: &Camera,
        from: &Point3<f64>,
        to: &Point3<f64>,
        width: f64,
        colour: Colour,
    ) {
        let (columns, rows) = self.samples();
        let ends = [from, to].map(|p| camera.project(p, columns as f64, rows as f64));
        let [Some(a), Some(b)] = ends else { return };
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy);
        let radius = (0.5 * width * OVERSAMPLING as f64).max(0.5);
        // A line that leaves the picture by far is cut short: its cost must not depend on where it ends.
        let steps = (length.ceil().min(4.0 * (columns + rows) as f64) as usize).max(1);
        for step in 0..=steps {
            let share = step as f64 / steps as f64;
            let nearness = a[2] + (b[2] - a[2]) * share;
            self.stamp([a[0] + dx * share, a[1] + dy * share], radius, nearness, colour);
        }
    }

    /// Draws a dot of a diameter in pixels; hidden where a surface is in front of it.
    pub fn draw_point(&mut self, camera: &Camera, position: &Point3<f64>, diameter: f64, colour: Colour) {
        let (columns, rows) = self.samples();
        if let Some([x, y, nearness]) = camera.project(position, columns as f64, rows as f64) {
            self.stamp([x, y], 0.5 * diameter * OVERSAMPLING as f64, nearness, colour);
        }
    }

    /// Draws an arrow with a shaft of a width in pixels: a contact's normal, a force.
    pub fn draw_arrow(
        &mut self,
        camera: &Camera,
        from: &Point3<f64>,
        to: &Point3<f64>,
        width: f64,
        colour: Colour,
    ) {
        self.draw_segment(camera, from, to, width, colour);
        let along: Vector3<f64> = to - from;
        let side = along.cross(&camera.towards_eye(to));
        let side_length = side.norm();
        if side_length <= 0.0 || side_length.is_nan() {
            return;
        }
        let barb = 0.28 * along.norm();
        let direction = along / along.norm();
        for sign in [-1.0, 1.0] {
            let end = to - direction * barb + side / side_length * (0.45 * barb * sign);
            self.draw_segment(camera, to, &end, width, colour);
        }
    }

    fn stamp(&mut self, centre: [f64; 2], radius: f64, nearness: f64, colour: Colour) {
        let (columns, rows) = self.samples();
        let nearness = nearness + LIFT * nearness.abs();
        let range = |middle: f64, limit: usize| {
            let low = (middle - radius).floor().clamp(0.0, limit as f64) as usize;
            let high = ((middle + radius).ceil() + 1.0).clamp(0.0, limit as f64) as usize;
            low..high
        };
        for y in range(centre[1], rows) {
            for x in range(centre[0], columns) {
                let (dx, dy) = (x as f64 + 0.5 - centre[0], y as f64 + 0.5 - centre[1]);
                if dx * dx + dy * dy <= radius * radius + 0.25 {
                    self.put(x, y, nearness, colour);
                }
            }
        }
    }
}
