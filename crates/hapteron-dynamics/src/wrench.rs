//! A force with a torque.

use nalgebra::{RealField, Vector3, Vector6};

/// A force and a torque about a stated point, world axes, N and N m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench<T = f64> {
    /// In newtons.
    pub force: Vector3<T>,
    /// In newton metres.
    pub torque: Vector3<T>,
}

impl<T: RealField + Copy> Wrench<T> {
    /// No force, no torque.
    #[must_use]
    pub fn zero() -> Self {
        Self { force: Vector3::zeros(), torque: Vector3::zeros() }
    }

    /// Force over torque.
    #[must_use]
    pub fn to_vector(&self) -> Vector6<T> {
        let (f, t) = (&self.force, &self.torque);
        Vector6::new(f.x, f.y, f.z, t.x, t.y, t.z)
    }

    /// From force over torque.
    #[must_use]
    pub fn from_vector(v: &Vector6<T>) -> Self {
        Self { force: Vector3::new(v[0], v[1], v[2]), torque: Vector3::new(v[3], v[4], v[5]) }
    }

    /// The wrench about a point of a force (N) that acts at `arm` (metres, from that point, in the force's axes).
    #[must_use]
    pub fn at(arm: &Vector3<T>, force: Vector3<T>) -> Self {
        Self { force, torque: arm.cross(&force) }
    }
}

impl Wrench<f64> {
    /// Whether every component is a finite number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.force.iter().chain(self.torque.iter()).all(|c| c.is_finite())
    }
}

impl<T: RealField + Copy> core::ops::Add for Wrench<T> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { force: self.force + other.force, torque: self.torque + other.torque }
    }
}

impl<T: RealField + Copy> core::ops::Neg for Wrench<T> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { force: -self.force, torque: -self.torque }
    }
}
