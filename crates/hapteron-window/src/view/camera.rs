//! Where the scene is looked at from.

use nalgebra::{Isometry3, Matrix4, Perspective3, Point2, Point3, Vector2, Vector3};

/// Vertical field of view, radians.
const FIELD_OF_VIEW: f64 = 0.6;
/// The camera never looks straight up or down: there it would not know which way is right.
const STEEPEST: f64 = 1.55;
/// Margin around what [`Camera::fit`] shows.
const MARGIN: f64 = 1.08;
/// Radians for one point of the pointer's way.
const ORBIT_SPEED: f64 = 0.008;

/// A direction to look from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// From the front, a little from above.
    Oblique,
    /// From negative y.
    Front,
    /// From positive x.
    Side,
    /// From positive z.
    Top,
}

impl Preset {
    /// All, with what people call them.
    pub const ALL: [(Self, &'static str); 4] =
        [(Self::Oblique, "Oblique"), (Self::Front, "Front"), (Self::Side, "Side"), (Self::Top, "Top")];

    /// Turn about z and height over the horizon, radians.
    fn angles(self) -> [f64; 2] {
        match self {
            Self::Oblique => [-1.05, 0.38],
            Self::Front => [-std::f64::consts::FRAC_PI_2, 0.0],
            Self::Side => [0.0, 0.0],
            Self::Top => [-std::f64::consts::FRAC_PI_2, STEEPEST],
        }
    }
}

/// A camera that turns around a point, z up. Lengths in metres, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    target: Point3<f64>,
    distance: f64,
    /// Radius of what there is to see; bounds for zoom and depth.
    extent: f64,
    yaw: f64,
    pitch: f64,
}

impl Camera {
    /// Shows a sphere.
    #[must_use]
    pub fn framing(center: Point3<f64>, radius: f64, preset: Preset) -> Self {
        let [yaw, pitch] = preset.angles();
        let mut camera = Self { target: center, distance: 1.0, extent: radius.max(1e-6), yaw, pitch };
        camera.fit(center, radius);
        camera
    }

    /// Moves so that a sphere fills the picture; the direction stays.
    pub fn fit(&mut self, center: Point3<f64>, radius: f64) {
        self.extent = radius.max(1e-6);
        self.target = center;
        self.distance = MARGIN * self.extent / (0.5 * FIELD_OF_VIEW).sin();
    }

    /// Looks from a preset's direction at the same point.
    pub fn look_from(&mut self, preset: Preset) {
        [self.yaw, self.pitch] = preset.angles();
    }

    /// Turns around the target as the pointer moves (points of the screen).
    pub fn orbit(&mut self, by: Vector2<f64>) {
        self.yaw = (self.yaw - by.x * ORBIT_SPEED).rem_euclid(std::f64::consts::TAU);
        self.pitch = (self.pitch + by.y * ORBIT_SPEED).clamp(-STEEPEST, STEEPEST);
    }

    /// Moves across so that what is at the target's depth stays under the pointer.
    pub fn pan(&mut self, by: Vector2<f64>, height: f64) {
        let metres = self.metres_per_point(height);
        let [right, up, _] = self.axes();
        self.target += (up * by.y - right * by.x) * metres;
    }

    /// Comes closer (factor above 1) or goes away.
    pub fn zoom(&mut self, factor: f64) {
        self.distance = (self.distance / factor).clamp(0.02 * self.extent, 40.0 * self.extent);
    }

    /// Right, up and back in the world.
    #[must_use]
    pub fn axes(&self) -> [Vector3<f64>; 3] {
        let (sy, cy) = self.yaw.sin_cos();
        let (sp, cp) = self.pitch.sin_cos();
        let back = Vector3::new(cy * cp, sy * cp, sp);
        let right = Vector3::new(-sy, cy, 0.0);
        [right, back.cross(&right), back]
    }

    /// Where the eye is.
    #[must_use]
    pub fn eye(&self) -> Point3<f64> {
        self.target + self.axes()[2] * self.distance
    }

    /// Size of a screen point at the target's depth when the picture is `height` points high.
    #[must_use]
    pub fn metres_per_point(&self, height: f64) -> f64 {
        2.0 * self.distance * (0.5 * FIELD_OF_VIEW).tan() / height.max(1.0)
    }

    /// Clip space from world, for a picture of this width over height.
    #[must_use]
    pub fn clip_from_world(&self, aspect: f64) -> Matrix4<f64> {
        let view = Isometry3::look_at_rh(&self.eye(), &self.target, &Vector3::z());
        // All of the scene and its floor, wherever it is moved; the ratio leaves 24 bits of depth fine enough.
        let far = self.distance + 12.0 * self.extent;
        let near = (self.distance - 12.0 * self.extent).max(far * 2e-4);
        Perspective3::new(aspect.max(1e-3), FIELD_OF_VIEW, near, far).to_homogeneous() * view.to_homogeneous()
    }

    /// Where a world point is in a picture (points from its top left corner); none behind the eye.
    #[must_use]
    pub fn project(&self, point: &Point3<f64>, size: Vector2<f64>) -> Option<Point2<f64>> {
        let clip = self.clip_from_world(size.x / size.y.max(1.0)) * point.to_homogeneous();
        if !(clip.w > 0.0) {
            return None;
        }
        let (x, y) = (clip.x / clip.w, clip.y / clip.w);
        Some(Point2::new((0.5 + 0.5 * x) * size.x, (0.5 - 0.5 * y) * size.y))
    }

    /// Direction (unit) from the eye through a place of the picture.
    #[must_use]
    pub fn ray(&self, place: Point2<f64>, size: Vector2<f64>) -> Vector3<f64> {
        let [right, up, back] = self.axes();
        let half = (0.5 * FIELD_OF_VIEW).tan();
        let x = (place.x - 0.5 * size.x) / (0.5 * size.y.max(1.0)) * half;
        let y = (0.5 * size.y - place.y) / (0.5 * size.y.max(1.0)) * half;
        (right * x + up * y - back).normalize()
    }

    /// Where the ray through a place of the picture meets the plane through `point` that faces the camera.
    #[must_use]
    pub fn on_plane(
        &self,
        place: Point2<f64>,
        size: Vector2<f64>,
        point: &Point3<f64>,
    ) -> Option<Point3<f64>> {
        let back = self.axes()[2];
        let ray = self.ray(place, size);
        let depth = (self.eye() - point).dot(&back);
        let along = -ray.dot(&back);
        (depth > 0.0 && along > 1e-6).then(|| self.eye() + ray * (depth / along))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Vector2<f64> = Vector2::new(800.0, 600.0);

    fn camera() -> Camera {
        Camera::framing(Point3::new(0.1, -0.2, 0.3), 0.05, Preset::Oblique)
    }

    /// Would catch a projection and a ray that do not belong to one camera.
    #[test]
    fn a_ray_through_a_projected_point_meets_it() {
        let camera = camera();
        let point = Point3::new(0.12, -0.19, 0.31);
        let place = camera.project(&point, SIZE).unwrap();
        let ray = camera.ray(place, SIZE);
        let offset = point - camera.eye();
        assert!((offset - ray * offset.dot(&ray)).norm() < 1e-12 * offset.norm().max(1.0));
        assert!((camera.on_plane(place, SIZE, &point).unwrap() - point).norm() < 1e-12);
    }

    /// Would catch a fit that cuts the scene off.
    #[test]
    fn a_fitted_sphere_is_within_the_picture_from_every_preset() {
        for (preset, _) in Preset::ALL {
            let mut camera = camera();
            camera.look_from(preset);
            for k in 0..64 {
                let a = f64::from(k) * 0.3;
                let direction = Vector3::new(a.cos(), a.sin(), (1.7 * a).sin()).normalize();
                let place = camera.project(&(camera.target + direction * 0.05), SIZE).unwrap();
                assert!(place.y > 0.0 && place.y < SIZE.y, "{preset:?}: {place}");
            }
        }
    }

    /// Would catch a pan that lets the scene slip from under the pointer.
    #[test]
    fn a_panned_target_follows_the_pointer() {
        let mut camera = camera();
        let held = camera.target;
        camera.pan(Vector2::new(30.0, -20.0), SIZE.y);
        let place = camera.project(&held, SIZE).unwrap();
        assert!((place - Point2::new(430.0, 280.0)).norm() < 0.5, "{place}");
    }

    #[test]
    fn what_is_behind_the_eye_is_not_in_the_picture() {
        let camera = camera();
        let behind = camera.eye() + camera.axes()[2];
        assert_eq!(camera.project(&behind, SIZE), None);
    }
}
