//! From pointer and keys to where the handle should go.

use crate::view::Camera;
use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion, Vector2, Vector3};

/// Radians for one point of the pointer's way.
const TURN_SPEED: f64 = 0.008;
/// Of the keys: radii of the body and radians in a second.
const KEY_SPEED: [f64; 2] = [0.5, 1.2];
/// Depth of one notch of the wheel, in radii of the body.
const NOTCH: f64 = 0.04;

/// What the pointer does to the handle while it holds it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drag {
    /// Moves it in the plane of the picture.
    Move,
    /// Turns it about the picture's horizontal and vertical.
    Turn,
    /// Turns it about the line of sight.
    Roll,
}

/// Keys that are down, -1, 0 or 1 each: right, up, towards the eye; move or turn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Keys {
    /// Right, up, back.
    pub push: Vector3<f64>,
    /// Turns instead of moving.
    pub turn: bool,
    /// A fifth as fast.
    pub slow: bool,
}

/// The goal of the handle, world, and what the pointer holds of it.
#[derive(Clone, Copy, Debug)]
pub struct Steering {
    goal: Isometry3<f64>,
    /// The point of the body that the pointer took hold of.
    grab: Option<Point3<f64>>,
}

impl Steering {
    /// Stays where the handle is.
    #[must_use]
    pub fn new(handle: Isometry3<f64>) -> Self {
        Self { goal: handle, grab: None }
    }

    /// Where the handle should go, world.
    #[must_use]
    pub fn goal(&self) -> Isometry3<f64> {
        self.goal
    }

    /// Whether the pointer holds the handle.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.grab.is_some()
    }

    /// Goes on from another place; lets go.
    pub fn set(&mut self, handle: Isometry3<f64>) {
        *self = Self::new(handle);
    }

    /// The pointer takes hold of a point.
    pub fn grab(&mut self, point: Point3<f64>) {
        self.grab = Some(point);
    }

    /// The pointer lets go.
    pub fn release(&mut self) {
        self.grab = None;
    }

    /// The pointer has moved by `by` to `place` (points of a picture of `size`).
    pub fn drag(
        &mut self,
        camera: &Camera,
        kind: Drag,
        place: Point2<f64>,
        by: Vector2<f64>,
        size: Vector2<f64>,
    ) {
        let Some(held) = self.grab else { return };
        let [right, up, back] = camera.axes();
        match kind {
            Drag::Move => {
                if let Some(now) = camera.on_plane(place, size, &held) {
                    self.shift(now - held);
                }
            }
            Drag::Turn => self.turn((up * by.x + right * by.y) * TURN_SPEED),
            Drag::Roll => self.turn(back * (-by.x * TURN_SPEED)),
        }
        if kind != Drag::Move {
            // The pointer goes on moving from here, not from where it took hold.
            self.grab = camera.on_plane(place, size, &held);
        }
    }

    /// The wheel was turned by this many notches: towards the eye, or away.
    pub fn wheel(&mut self, camera: &Camera, notches: f64, radius: f64) {
        self.shift(camera.axes()[2] * (notches * NOTCH * radius));
    }

    /// Keys were down for `dt` seconds.
    pub fn keys(&mut self, camera: &Camera, keys: &Keys, radius: f64, dt: f64) {
        let [right, up, back] = camera.axes();
        let pace = if keys.slow { 0.2 } else { 1.0 } * dt;
        let Keys { push, .. } = keys;
        if keys.turn {
            // The arrow keys turn as the pointer does.
            self.turn((up * push.x - right * push.y + back * push.z) * (KEY_SPEED[1] * pace));
        } else {
            self.shift((right * push.x + up * push.y + back * push.z) * (KEY_SPEED[0] * radius * pace));
        }
    }

    /// Brings the goal no farther than `reach` from where the handle would be without stretch.
    pub fn keep_near(&mut self, unstretched: &Point3<f64>, reach: f64) {
        let away = self.goal.translation.vector - unstretched.coords;
        let length = away.norm();
        if length > reach {
            self.shift(away * (reach / length - 1.0));
        }
    }

    fn shift(&mut self, by: Vector3<f64>) {
        if by.iter().all(|c| c.is_finite()) {
            self.goal.translation.vector += by;
            self.grab = self.grab.map(|p| p + by);
        }
    }

    fn turn(&mut self, by: Vector3<f64>) {
        if by.iter().all(|c| c.is_finite()) {
            self.goal.rotation = UnitQuaternion::from_scaled_axis(by) * self.goal.rotation;
            self.goal.rotation.renormalize();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Preset;

    const SIZE: Vector2<f64> = Vector2::new(900.0, 600.0);

    fn start() -> (Camera, Steering) {
        let camera = Camera::framing(Point3::new(0.0, 0.0, 0.02), 0.08, Preset::Front);
        (camera, Steering::new(Isometry3::translation(0.0, 0.0, 0.03)))
    }

    /// Would catch a body that slips from under the pointer.
    #[test]
    fn the_point_taken_hold_of_stays_under_the_pointer() {
        let (camera, mut steering) = start();
        let point = Point3::new(0.01, -0.02, 0.04);
        let from = camera.project(&point, SIZE).unwrap();
        steering.grab(point);
        let mut place = from;
        for _ in 0..10 {
            let by = Vector2::new(7.0, 12.0);
            place += by;
            steering.drag(&camera, Drag::Move, place, by, SIZE);
        }
        let moved = steering.goal().translation.vector - Vector3::new(0.0, 0.0, 0.03);
        let now = camera.project(&(point + moved), SIZE).unwrap();
        assert!((now - place).norm() < 1e-6, "{now} {place}");
        assert!(moved.z < -0.01 && moved.y.abs() < 1e-12, "{moved}");
    }

    /// Would catch a wheel that loses the pointer's hold, or goes the wrong way.
    #[test]
    fn the_wheel_moves_along_the_line_of_sight() {
        let (camera, mut steering) = start();
        steering.grab(Point3::new(0.0, 0.0, 0.03));
        steering.wheel(&camera, 2.0, 0.05);
        let moved = steering.goal().translation.vector - Vector3::new(0.0, 0.0, 0.03);
        assert!((moved - camera.axes()[2] * (2.0 * NOTCH * 0.05)).norm() < 1e-12);
    }

    /// Would catch a turn that moves the handle, or goes against the pointer: dragged to the right, the front goes right.
    #[test]
    fn a_turn_keeps_the_place_and_goes_with_the_pointer() {
        let (camera, mut steering) = start();
        steering.grab(Point3::new(0.0, 0.0, 0.03));
        steering.drag(&camera, Drag::Turn, Point2::new(450.0, 300.0), Vector2::new(50.0, 0.0), SIZE);
        assert_eq!(steering.goal().translation.vector, Vector3::new(0.0, 0.0, 0.03));
        let [right, _, back] = camera.axes();
        assert!((steering.goal().rotation * back).dot(&right) > 0.3);
        let before = steering.goal();
        steering.keys(&camera, &Keys { push: Vector3::x(), turn: true, slow: false }, 0.05, 0.1);
        assert!((steering.goal().rotation * before.rotation.inverse() * back).dot(&right) > 0.05);
    }

    #[test]
    fn the_goal_stays_within_reach() {
        let (_, mut steering) = start();
        steering.keep_near(&Point3::new(0.0, 0.0, -0.07), 0.03);
        assert!((steering.goal().translation.vector - Vector3::new(0.0, 0.0, -0.04)).norm() < 1e-12);
        steering.keep_near(&Point3::new(0.0, 0.0, -0.02), 0.03);
        assert!((steering.goal().translation.vector.z + 0.04).abs() < 1e-12);
    }
}
