//! Axes, checks and velocities that the drivers share.

use crate::{DeviceCommand, DeviceSample};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// From a vendor's base axes to ours (x right, y up, z toward the user): a rotation by whole quarter turns, kept as the matrix whose rows
/// are our axes in the vendor's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes(pub Matrix3<f64>);

impl Axes {
    pub fn vector(&self, vendor: &Vector3<f64>) -> Vector3<f64> {
        self.0 * vendor
    }

    pub fn to_vendor(self, ours: &Vector3<f64>) -> Vector3<f64> {
        self.0.tr_mul(ours)
    }

    /// Of a frame that is the identity where the handle's axes lie along the base's.
    pub fn orientation(&self, vendor: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let v = self.0 * vendor.imag();
        UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(vendor.w, v.x, v.y, v.z))
    }
}

/// A rotation matrix's quaternion; `None` when it is not near a rotation.
pub(super) fn rotation(matrix: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let defect = (matrix.tr_mul(matrix) - Matrix3::identity()).abs().max();
    if !(defect < 1e-2 && matrix.determinant() > 0.0) {
        return None;
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*matrix));
    unit(q.w, q.i, q.j, q.k)
}

/// A quaternion of nearly unit length, made exactly so; `None` for others.
pub(super) fn unit(w: f64, x: f64, y: f64, z: f64) -> Option<UnitQuaternion<f64>> {
    let q = nalgebra::Quaternion::new(w, x, y, z);
    let norm = q.norm();
    ((norm - 1.0).abs() < 0.1).then(|| UnitQuaternion::new_unchecked(q / norm))
}

pub(super) fn sample_is_finite(s: &DeviceSample) -> bool {
    let parts = [&s.position, &s.linear_velocity, &s.angular_velocity];
    s.time.is_finite()
        && parts.iter().all(|v| vector_is_finite(v))
        && s.orientation.coords.iter().all(|c| c.is_finite())
}

pub(super) fn command_is_finite(c: &DeviceCommand) -> bool {
    vector_is_finite(&c.force) && vector_is_finite(&c.torque)
}

pub(super) fn vector_is_finite(v: &Vector3<f64>) -> bool {
    v.iter().all(|c| c.is_finite())
}

/// Whether it is finite in single precision as well, for protocols that carry it so.
pub(super) fn single_is_finite(v: &Vector3<f64>) -> bool {
    v.iter().all(|c| (*c as f32).is_finite())
}

/// A force within a limit, direction kept, and the factor that it took.
pub(super) fn limited(force: &Vector3<f64>, limit: f64) -> (Vector3<f64>, f64) {
    let size = force.norm();
    if size > limit {
        let factor = limit / size;
        return (force * factor, factor);
    }
    (*force, 1.0)
}

/// Number of samples remembered by [`Velocities`].
const REMEMBERED: usize = 64;
/// Seconds of motion that a linear velocity is taken over, where the device gives none.
const LINEAR_WINDOW: f64 = 0.015;
/// The same for angular velocities, whose sensors are coarser.
const ANGULAR_WINDOW: f64 = 0.030;

/// Time, position, orientation.
type Timed = (f64, Vector3<f64>, UnitQuaternion<f64>);

/// Velocities from past poses, for devices (or moments) that give none. Constant work, no allocation.
#[derive(Clone, Debug)]
pub(super) struct Velocities {
    poses: [Timed; REMEMBERED],
    count: usize,
}

impl Velocities {
    pub fn new() -> Self {
        Self { poses: [(0.0, Vector3::zeros(), UnitQuaternion::identity()); REMEMBERED], count: 0 }
    }

    /// Remembers a pose; one that is not newer than the last is left out.
    pub fn push(&mut self, time: f64, position: &Vector3<f64>, orientation: &UnitQuaternion<f64>) {
        if self.count > 0 && !(time > self.poses[(self.count - 1) % REMEMBERED].0) {
            return;
        }
        self.poses[self.count % REMEMBERED] = (time, *position, *orientation);
        self.count += 1;
    }

    /// m/s over the last 15 ms; zero as long as nothing is known.
    pub fn linear(&self) -> Vector3<f64> {
        match self.ends(LINEAR_WINDOW) {
            Some((old, new)) => (new.1 - old.1) / (new.0 - old.0),
            None => Vector3::zeros(),
        }
    }

    /// rad/s over the last 30 ms, base axes; zero as long as nothing is known.
    pub fn angular(&self) -> Vector3<f64> {
        match self.ends(ANGULAR_WINDOW) {
            Some((old, new)) => (new.2 * old.2.inverse()).scaled_axis() / (new.0 - old.0),
            None => Vector3::zeros(),
        }
    }

    /// The newest pose and the oldest within the window (or the last one before the newest, if all are older).
    fn ends(&self, window: f64) -> Option<(&Timed, &Timed)> {
        if self.count < 2 {
            return None;
        }
        let at = |back: usize| &self.poses[(self.count - 1 - back) % REMEMBERED];
        let newest = at(0);
        let mut oldest = at(1);
        for back in 2..self.count.min(REMEMBERED) {
            if newest.0 - at(back).0 > window {
                break;
            }
            oldest = at(back);
        }
        Some((oldest, newest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards the estimate: a helix sampled at 1 kHz, against its own derivative.
    #[test]
    fn velocities_of_a_steady_motion() {
        let mut velocities = Velocities::new();
        assert_eq!(velocities.linear(), Vector3::zeros());
        let (v, w) = (Vector3::new(0.1, -0.2, 0.05), Vector3::new(0.5, 1.0, -2.0));
        for i in 0..200 {
            let t = f64::from(i) * 1e-3;
            velocities.push(t, &(v * t), &UnitQuaternion::from_scaled_axis(w * t));
        }
        assert!((velocities.linear() - v).norm() < 1e-12);
        assert!((velocities.angular() - w).norm() < 1e-9);
    }

    /// Guards against a division by zero: two samples of the same time.
    #[test]
    fn same_time_twice_changes_nothing() {
        let mut velocities = Velocities::new();
        for (t, x) in [(0.0, 0.0), (1e-3, 1e-3), (1e-3, 5.0), (0.5e-3, 7.0)] {
            velocities.push(t, &Vector3::new(x, 0.0, 0.0), &UnitQuaternion::identity());
        }
        assert_eq!(velocities.linear(), Vector3::new(1.0, 0.0, 0.0));
    }

    /// Guards the quaternion of a matrix, against nalgebra's own rotation, and the refusal of what is none.
    #[test]
    fn rotation_or_none() {
        let q = UnitQuaternion::from_euler_angles(0.3, -1.1, 2.9);
        let found = rotation(q.to_rotation_matrix().matrix()).unwrap();
        assert!(found.angle_to(&q) < 1e-12);
        assert!(rotation(&(-Matrix3::identity())).is_none());
        assert!(rotation(&Matrix3::from_element(f64::NAN)).is_none());
        assert!(rotation(&Matrix3::zeros()).is_none());
    }
}
