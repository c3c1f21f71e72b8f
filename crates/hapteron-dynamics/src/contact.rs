//! Contact forces: planes, and the three ways to use what a contact query found some time ago (section 6).

use crate::linearization::{Linearization, Motion, StateJacobian};
use crate::mass::RigidBody;
use crate::quaternion::{angular_velocity, rotation};
use crate::state::State;
use crate::wrench::Wrench;
use nalgebra::{Matrix3, RealField, Vector3, Vector6, convert};

/// A contact as a planar constraint: a point of the body that a plane of the scene holds back.  Eq. 21.
///
/// Requires finite numbers, a unit normal, and stiffness, damping and tolerance that are not negative. Nothing checks them here,
/// thousands of planes a millisecond; a plane with a number that is not finite makes [`crate::step`] report
/// [`crate::Status::NON_FINITE`] instead of being passed over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPlane {
    /// r: the contact point in the body frame, from the centre of mass, metres.
    pub point_b: Vector3<f64>,
    /// n: unit normal, world, outward from the body.
    pub normal_w: Vector3<f64>,
    /// n . p0: where the plane is along its normal, world, metres.
    pub offset: f64,
    /// k, N/m.
    pub stiffness: f64,
    /// b, N s/m.
    pub damping: f64,
    /// d: the force begins this far before the plane, metres.
    pub tolerance: f64,
}

/// A plane at a state.
#[derive(Clone, Copy)]
struct Reach<T> {
    /// a = R r.
    arm: Vector3<T>,
    /// g = n . (x + a - p0) + d: how far the point is inside the tolerance.
    gap: T,
    /// fn = k g + b n . (v + omega x a), before any clamp.
    push: T,
}

impl ContactPlane {
    /// A plane through `point_w` (p0; world, metres); the other arguments are the fields.
    ///
    /// Never fails; what it requires stands with the type. Real time: constant work.
    #[must_use]
    pub fn new(
        point_b: Vector3<f64>,
        point_w: &Vector3<f64>,
        normal_w: Vector3<f64>,
        stiffness: f64,
        damping: f64,
        tolerance: f64,
    ) -> Self {
        Self { point_b, normal_w, offset: normal_w.dot(point_w), stiffness, damping, tolerance }
    }

    #[inline]
    fn reach<T: RealField + Copy>(
        &self,
        position: &Vector3<T>,
        rotation: &Matrix3<T>,
        v: &Vector3<T>,
        omega: &Vector3<T>,
    ) -> Reach<T> {
        let constant = |v: f64| convert::<f64, T>(v);
        let n = self.normal_w.map(constant);
        let arm = rotation * self.point_b.map(constant);
        let gap = n.dot(&(position + arm)) + constant(self.tolerance - self.offset);
        let push = gap * constant(self.stiffness) + n.dot(&(v + omega.cross(&arm))) * constant(self.damping);
        Reach { arm, gap, push }
    }

    /// The wrench of this plane on the body at its centre of mass.  Eq. 21 with the arm R r (D4).
    ///
    /// With `clamp` it acts only within the tolerance and never pulls (D5); without, as printed. World axes, N and N m.
    /// `inverse_mass` is 1/m in 1/kg, `inverse_inertia_b` the paper's M^-1 in body axes, 1/(kg m^2). Generic, so that it can be
    /// differentiated automatically. Requires a quaternion that is not zero. Real time: constant work.
    pub fn wrench<T: RealField + Copy>(
        &self,
        state: &State<T>,
        inverse_mass: T,
        inverse_inertia_b: &Matrix3<T>,
        clamp: bool,
    ) -> Wrench<T> {
        let r = rotation(&state.orientation);
        let omega = angular_velocity(&state.orientation, &state.angular_momentum, inverse_inertia_b);
        let reach = self.reach(&state.position, &r, &(state.linear_momentum * inverse_mass), &omega);
        if clamp && (reach.gap <= T::zero() || reach.push <= T::zero()) {
            return Wrench::zero();
        }
        Wrench::at(&reach.arm, self.normal_w.map(convert::<f64, T>) * -reach.push)
    }

    /// Adds the force and its derivatives.  Eqs. 21 to 29.
    #[inline]
    fn add(&self, reach: &Reach<f64>, omega: &Vector3<f64>, to: &mut Linearization) {
        let n = &self.normal_w;
        let a = &reach.arm;
        let m = a.cross(n);
        let j = Vector6::new(n.x, n.y, n.z, m.x, m.y, m.z);
        to.wrench -= j * reach.push;
        let (k, b) = (self.stiffness, self.damping);
        // d(fn) = k J.(dx, dtheta) + b J.(dv, domega) + b (a x (n x omega)).dtheta
        let swing = a.cross(&n.cross(omega)) * b;
        let kj = j * k;
        let row = Vector6::new(kj[0], kj[1], kj[2], kj[3] + swing.x, kj[4] + swing.y, kj[5] + swing.z);
        to.by_position -= j * row.transpose();
        to.by_velocity -= j * (j * b).transpose();
        // The lever turns with the body: (dtheta x a) x (-fn n).
        let lever = (a * n.transpose() - Matrix3::identity() * a.dot(n)) * reach.push;
        let mut block = to.by_position.fixed_view_mut::<3, 3>(3, 3);
        block -= lever;
    }
}

/// The change of position, orientation and velocities over a step, to judge planes by their force at its end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change {
    pub position: Vector6<f64>,
    pub velocity: Vector6<f64>,
}

/// Whether a plane counts: it is within its tolerance and pushes, at the start of the step or, given the change over the step, at
/// its end (D8).
#[inline]
fn counts(plane: &ContactPlane, reach: &Reach<f64>, end: Option<&Change>) -> bool {
    let Some(change) = end else { return reach.gap > 0.0 && reach.push > 0.0 };
    let (n, m) = (&plane.normal_w, reach.arm.cross(&plane.normal_w));
    let along =
        |v: &Vector6<f64>| n.x * v[0] + n.y * v[1] + n.z * v[2] + m.x * v[3] + m.y * v[4] + m.z * v[5];
    let closing = along(&change.position);
    let push = plane.stiffness * closing + plane.damping * along(&change.velocity);
    reach.gap + closing > 0.0 && reach.push + push > 0.0
}

/// Order-dependent, so that different sets of planes have different signatures.
#[inline]
fn sign(signature: u64, index: usize) -> u64 {
    signature.wrapping_mul(0x0000_0100_0000_01b3).wrapping_add(index as u64 + 1)
}

/// Adds the planes that count. Returns the signature of their set.
pub(crate) fn add_planes(
    planes: &[ContactPlane],
    state: &State,
    motion: &Motion,
    end: Option<&Change>,
    to: &mut Linearization,
) -> u64 {
    let mut signature = 0;
    for (index, plane) in planes.iter().enumerate() {
        let reach = plane.reach(&state.position, &motion.rotation, &motion.v, &motion.omega);
        if counts(plane, &reach, end) {
            plane.add(&reach, &motion.omega, to);
            signature = sign(signature, index);
        }
    }
    signature
}

/// The signature of the set of planes that would count at the end of a step: that of [`add_planes`], without the adding.
pub(crate) fn signature_at_end(planes: &[ContactPlane], state: &State, motion: &Motion, end: &Change) -> u64 {
    let mut signature = 0;
    for (index, plane) in planes.iter().enumerate() {
        let reach = plane.reach(&state.position, &motion.rotation, &motion.v, &motion.omega);
        if counts(plane, &reach, Some(end)) {
            signature = sign(signature, index);
        }
    }
    signature
}

/// The wrench of all planes that push at a state. A plane that is not finite makes the sum not finite: it is not passed over.
pub(crate) fn planes_wrench(planes: &[ContactPlane], state: &State, motion: &Motion) -> Wrench {
    let mut sum = Wrench::zero();
    for plane in planes {
        let reach = plane.reach(&state.position, &motion.rotation, &motion.v, &motion.omega);
        if !(reach.gap <= 0.0 || reach.push <= 0.0) {
            sum = sum + Wrench::at(&reach.arm, plane.normal_w * -reach.push);
        }
    }
    sum
}

/// Contact force and torque as they were at a state, with their Jacobian: the linearized contact model.  Eq. 30.
///
/// World axes; N and N m at the centre of mass; the Jacobian by x (m), q, P (kg m/s), L (kg m^2/s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearizedContact {
    /// F_p(t) over T_p(t), world, at the centre of mass.
    pub wrench: Vector6<f64>,
    /// Its derivative by the state: Eqs. 22 to 29, summed over the planes.
    pub jacobian: StateJacobian,
    /// y(t), from which the wrench is extrapolated.
    pub state: State,
}

impl LinearizedContact {
    /// From the planes that are within their tolerance and push at the state.  Eqs. 21 to 29, clamped (D5).
    ///
    /// Never fails. Real time: work in proportion to the planes; made for the contact thread.
    #[must_use]
    pub fn from_planes(planes: &[ContactPlane], body: &RigidBody, state: &State) -> Self {
        let motion = Motion::of(state, body);
        let mut sum = Linearization::zero();
        add_planes(planes, state, &motion, None, &mut sum);
        Self { wrench: sum.wrench, jacobian: sum.by_state(&motion), state: *state }
    }

    /// The wrench at another state.  Eq. 30.
    ///
    /// World axes, N over N m, at the centre of mass. The quaternion enters as a vector, so it is taken from the hemisphere of
    /// the snapshot's (D6). It may pull: that is Eq. 30 as printed. Real time: constant work.
    #[must_use]
    pub fn wrench_at(&self, state: &State) -> Vector6<f64> {
        let mut y = *state;
        if y.orientation.dot(&self.state.orientation) < 0.0 {
            y.orientation = -y.orientation;
        }
        self.wrench + self.jacobian * (y.to_vector() - self.state.to_vector())
    }

    /// The Jacobian for a state of either hemisphere.
    pub(crate) fn jacobian_at(&self, state: &State) -> StateJacobian {
        let mut j = self.jacobian;
        if state.orientation.dot(&self.state.orientation) < 0.0 {
            let mut columns = j.fixed_columns_mut::<4>(3);
            columns.neg_mut();
        }
        j
    }
}

/// What the haptic thread knows about contact.
#[derive(Clone, Copy, Debug)]
pub enum ContactForce<'a> {
    /// Nothing touches.
    None,
    /// Planes, evaluated anew at every state; none ever pulls. The default.
    Planes(&'a [ContactPlane]),
    /// The linearized contact model: the last force, extrapolated by its Jacobian.  Eq. 30.
    Linearized(&'a LinearizedContact),
    /// The last force, held; its Jacobian enters only the matrix of an implicit step. The paper's 'without linearized model'.
    Held(&'a LinearizedContact),
}

impl ContactForce<'_> {
    /// The wrench on the body at its centre of mass: Eq. 21 summed and clamped, Eq. 30, or the held value.
    ///
    /// World axes, N and N m. Requires a quaternion that is not zero. Real time: work in proportion to the planes.
    #[must_use]
    pub fn wrench(&self, state: &State, body: &RigidBody) -> Wrench {
        match self {
            Self::None => Wrench::zero(),
            Self::Planes(planes) => planes_wrench(planes, state, &Motion::of(state, body)),
            Self::Linearized(model) => Wrench::from_vector(&model.wrench_at(state)),
            Self::Held(model) => Wrench::from_vector(&model.wrench),
        }
    }
}
