//! Where a picture is taken from.

use nalgebra::{Point3, Vector3};

/// A point of view: maps world positions (metres) to the picture.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    eye: Point3<f64>,
    right: Vector3<f64>,
    up: Vector3<f64>,
    back: Vector3<f64>,
    /// Tangent of half the vertical field of view.
    half_height: f64,
}

impl Camera {
    /// A camera that looks along `direction` and shows a whole sphere, with a margin of 4 %.
    ///
    /// `up` may be any vector that is not parallel to `direction`; `angle` is the vertical field of view in radians, `aspect` width over height.
    pub fn framing(
        centre: Point3<f64>,
        radius: f64,
        direction: Vector3<f64>,
        up: Vector3<f64>,
        angle: f64,
        aspect: f64,
    ) -> Self {
        let back = -unit_or(direction, -Vector3::y());
        let right = unit_or(up.cross(&back), Vector3::x());
        let up = back.cross(&right);
        let radius = 1.04 * radius.max(1e-9) / aspect.min(1.0);
        let (distance, half_height) = (radius / (0.5 * angle).sin(), (0.5 * angle).tan());
        Self { eye: centre + back * distance, right, up, back, half_height }
    }

    /// Direction from the scene towards the eye at a world position; unit length.
    pub fn towards_eye(&self, position: &Point3<f64>) -> Vector3<f64> {
        unit_or(self.eye - position, self.back)
    }

    /// The camera's axes in the world: right, up, backwards.
    pub fn axes(&self) -> [Vector3<f64>; 3] {
        [self.right, self.up, self.back]
    }

    /// Pixel coordinates (from the top left corner) and nearness of a world position.
    ///
    /// Nearness grows towards the eye and is linear over the picture, so that it can be interpolated in pixels.
    /// `None` when the position is not in front of the eye.
    pub fn project(&self, position: &Point3<f64>, width: f64, height: f64) -> Option<[f64; 3]> {
        let offset = position - self.eye;
        let depth = -offset.dot(&self.back);
        if depth <= 1e-9 {
            return None;
        }
        let scale = 0.5 * height / (self.half_height * depth);
        let x = 0.5 * width + offset.dot(&self.right) * scale;
        let y = 0.5 * height - offset.dot(&self.up) * scale;
        Some([x, y, 1.0 / depth])
    }
}

fn unit_or(vector: Vector3<f64>, otherwise: Vector3<f64>) -> Vector3<f64> {
    let length = vector.norm();
    if length > 1e-12 { vector / length } else { otherwise }
}
