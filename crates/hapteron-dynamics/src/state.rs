//! The state of the body (Eq. 2).

use crate::mass::RigidBody;
use crate::quaternion::angular_velocity;
use nalgebra::{Quaternion, RealField, SVector, UnitQuaternion, Vector3, Vector4};

/// The state y of a rigid body.  Eq. 2.
///
/// Generic in its numbers, so that forces can be differentiated automatically.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T = f64> {
    /// x: the centre of mass, world, metres.
    pub position: Vector3<T>,
    /// q: (w, x, y, z), body to world, unit after every step. It never changes its hemisphere from one step to the next.
    pub orientation: Vector4<T>,
    /// P, world, kg m/s.
    pub linear_momentum: Vector3<T>,
    /// L about the centre of mass, world axes, kg m^2/s.
    pub angular_momentum: Vector3<T>,
}

impl State<f64> {
    /// A state with the given velocities (world axes; m/s of the centre of mass, and rad/s).
    ///
    /// `position` is that of the centre of mass (world, metres), `orientation` turns body axes into world axes. Never fails.
    #[must_use]
    pub fn moving(
        body: &RigidBody,
        position: Vector3<f64>,
        orientation: &UnitQuaternion<f64>,
        linear_velocity: &Vector3<f64>,
        angular_velocity: &Vector3<f64>,
    ) -> Self {
        let r = orientation.to_rotation_matrix();
        Self {
            position,
            orientation: Vector4::new(orientation.w, orientation.i, orientation.j, orientation.k),
            linear_momentum: linear_velocity * body.mass(),
            angular_momentum: r * (body.inertia_b() * (r.inverse() * angular_velocity)),
        }
    }

    /// The orientation as a unit quaternion, body to world. Requires one that is not zero (a zero one gives NaN).
    #[must_use]
    pub fn unit_quaternion(&self) -> UnitQuaternion<f64> {
        let q = &self.orientation;
        UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]))
    }

    /// v = P / m of the centre of mass, world, m/s.
    #[must_use]
    pub fn linear_velocity(&self, body: &RigidBody) -> Vector3<f64> {
        self.linear_momentum / body.mass()
    }

    /// omega, world axes, rad/s.  Eq. 3.
    #[must_use]
    pub fn angular_velocity(&self, body: &RigidBody) -> Vector3<f64> {
        angular_velocity(&self.orientation, &self.angular_momentum, body.inverse_inertia_b())
    }

    /// Whether every component is a finite number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.to_vector().iter().all(|c| c.is_finite())
    }
}

impl<T: RealField + Copy> State<T> {
    /// The 13 components in the order x, q, P, L.
    #[must_use]
    pub fn to_vector(&self) -> SVector<T, 13> {
        let mut y = SVector::<T, 13>::zeros();
        y.fixed_rows_mut::<3>(0).copy_from(&self.position);
        y.fixed_rows_mut::<4>(3).copy_from(&self.orientation);
        y.fixed_rows_mut::<3>(7).copy_from(&self.linear_momentum);
        y.fixed_rows_mut::<3>(10).copy_from(&self.angular_momentum);
        y
    }

    /// The state with the given components, in the order x, q, P, L. Does not normalise the quaternion.
    #[must_use]
    pub fn from_vector(y: &SVector<T, 13>) -> Self {
        Self {
            position: y.fixed_rows::<3>(0).into(),
            orientation: y.fixed_rows::<4>(3).into(),
            linear_momentum: y.fixed_rows::<3>(7).into(),
            angular_momentum: y.fixed_rows::<3>(10).into(),
        }
    }
}
