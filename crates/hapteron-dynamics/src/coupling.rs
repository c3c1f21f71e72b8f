//! The virtual coupling between handle and body (section 5).

use crate::linearization::Linearization;
use crate::mass::RigidBody;
use crate::quaternion::{
    angular_velocity, conjugate, inverse_right_jacobian, product, rotation, rotation_vector, skew,
};
use crate::saturation::Spring;
use crate::state::State;
use crate::wrench::Wrench;
use nalgebra::{Matrix3, RealField, UnitQuaternion, Vector3, Vector4, convert};

/// The handle as the body sees it: pose and velocity in the virtual world, at the time of the step's end (D7).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Handle {
    /// x_h, world, metres.
    pub position: Vector3<f64>,
    /// q_h, handle to world.
    pub orientation: UnitQuaternion<f64>,
    /// v_h of the point x_h, world, m/s.
    pub linear_velocity: Vector3<f64>,
    /// omega_h, world axes, rad/s.
    pub angular_velocity: Vector3<f64>,
}

impl Handle {
    /// Whether every component is a finite number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let finite = |v: &Vector3<f64>| v.iter().all(|c| c.is_finite());
        finite(&self.position)
            && finite(&self.linear_velocity)
            && finite(&self.angular_velocity)
            && self.orientation.coords.iter().all(|c| c.is_finite())
    }
}

/// Why a coupling cannot be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CouplingError {
    /// A stiffness or damping is negative or not finite: its name and value.
    Negative(&'static str, f64),
    /// A limit is not positive and finite: its name and value.
    Limit(&'static str, f64),
    /// A component of the grasp is not finite: which one, and its value.
    NotFinite(&'static str, f64),
    /// The grasp's orientation is not a unit quaternion: its length.
    NotUnit(f64),
}

impl core::fmt::Display for CouplingError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Negative(name, value) => write!(f, "{name} is {value}; it must be finite and not negative"),
            Self::Limit(name, value) => write!(f, "{name} is {value}; it must be positive and finite"),
            Self::NotFinite(name, value) => write!(f, "{name} has the component {value}; it must be finite"),
            Self::NotUnit(length) => write!(f, "grasp_orientation has the length {length}; it must be 1"),
        }
    }
}

impl core::error::Error for CouplingError {}

/// The viscoelastic six-degree-of-freedom link between handle and body.  Section 5.
///
/// It acts between the handle's point x_h and the coupling point x + R c, which were one when the body was grasped, and between
/// the handle's orientation q_h and that of the coupling frame, q q_c.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// k_c with its greatest force.
    linear: Spring,
    /// k_theta with its greatest torque.
    angular: Spring,
    /// b_c, N s/m.
    linear_damping: f64,
    /// b_theta, N m s/rad.
    angular_damping: f64,
    /// c: the coupling point in the body frame, from the centre of mass, metres.
    grasp_position_b: Vector3<f64>,
    /// q_c: coupling frame to body frame.
    grasp_orientation_b: UnitQuaternion<f64>,
}

/// Least share of the damping that is left where the spring is saturated (D10).
const LEAST_DAMPING: f64 = 0.2;

/// Where the coupling point stands to the handle.
struct Deviation<T> {
    /// R c.
    arm: Vector3<T>,
    /// e = x_h - x - R c.
    offset: Vector3<T>,
    /// e's rate.
    rate: Vector3<T>,
    /// u_c: the rotation vector from the coupling frame to the handle, world axes.
    turn: Vector3<T>,
    turn_rate: Vector3<T>,
}

/// A spring's force along a vector, generic so that it can be differentiated automatically.
fn spring<T: RealField + Copy>(spring: &Spring, deflection: &Vector3<T>) -> (Vector3<T>, T) {
    let constant = |v: f64| convert::<f64, T>(v);
    let k = constant(spring.stiffness);
    let (Some(limit), s2) = (spring.limit, deflection.norm_squared()) else {
        return (deflection * k, T::one());
    };
    let half = constant(0.5 * limit);
    if !(s2 * k * k > half * half) {
        return (deflection * k, T::one());
    }
    let s = s2.sqrt();
    let length = constant(limit) / k;
    let t = (s - half / k) / length;
    if t >= T::one() {
        return (deflection * (constant(limit) / s), constant(LEAST_DAMPING));
    }
    // With a bend of 2 the cubic is a parabola: the slope falls from k to 0 in a straight line.
    let force = half + k * length * t * (T::one() - t * constant(0.5));
    (deflection * (force / s), (T::one() - t).max(constant(LEAST_DAMPING)))
}

impl Coupling {
    /// A coupling at the given grasp: c (body frame, from the centre of mass, metres) and q_c (coupling frame to body frame).
    ///
    /// Damping in N s/m and N m s/rad. A spring with a limit bends over to it (section 5.3.1, D10).
    ///
    /// # Errors
    /// [`CouplingError`]: stiffness and damping must be finite and not negative, limits positive and finite, the grasp finite and its
    /// orientation a unit quaternion.
    pub fn new(
        linear: Spring,
        linear_damping: f64,
        angular: Spring,
        angular_damping: f64,
        grasp_position_b: Vector3<f64>,
        grasp_orientation_b: UnitQuaternion<f64>,
    ) -> Result<Self, CouplingError> {
        let not_negative = [
            ("linear_stiffness", linear.stiffness),
            ("linear_damping", linear_damping),
            ("angular_stiffness", angular.stiffness),
            ("angular_damping", angular_damping),
        ];
        for (name, value) in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(CouplingError::Negative(name, value));
            }
        }
        for (name, limit) in [("max_force", linear.limit), ("max_torque", angular.limit)] {
            if let Some(value) = limit.filter(|v| !(*v > 0.0 && v.is_finite())) {
                return Err(CouplingError::Limit(name, value));
            }
        }
        if let Some(&value) = grasp_position_b.iter().find(|c| !c.is_finite()) {
            return Err(CouplingError::NotFinite("grasp_position", value));
        }
        let q = &grasp_orientation_b.coords;
        if let Some(&value) = q.iter().find(|c| !c.is_finite()) {
            return Err(CouplingError::NotFinite("grasp_orientation", value));
        }
        let length = libm::sqrt(q.norm_squared());
        if !((length - 1.0).abs() < 1e-6) {
            return Err(CouplingError::NotUnit(length));
        }
        Ok(Self { linear, angular, linear_damping, angular_damping, grasp_position_b, grasp_orientation_b })
    }

    /// k_c, N/m.
    #[must_use]
    pub fn linear_stiffness(&self) -> f64 {
        self.linear.stiffness
    }

    /// k_theta, N m/rad.
    #[must_use]
    pub fn angular_stiffness(&self) -> f64 {
        self.angular.stiffness
    }

    /// The springs of translation and rotation, and their dampings (N s/m, N m s/rad).
    #[must_use]
    pub fn springs(&self) -> ([Spring; 2], [f64; 2]) {
        ([self.linear, self.angular], [self.linear_damping, self.angular_damping])
    }

    /// The grasp: the coupling point in the body frame (from the centre of mass, metres), and coupling frame to body frame.
    #[must_use]
    pub fn grasp(&self) -> (Vector3<f64>, UnitQuaternion<f64>) {
        (self.grasp_position_b, self.grasp_orientation_b)
    }

    /// The same springs and dampers, grasped where the handle is now: with no deviation.  Section 5.1.
    ///
    /// Requires a finite handle and a unit quaternion. Real time: constant work.
    #[must_use]
    pub fn grasped(&self, handle: &Handle, state: &State) -> Self {
        let inverse = state.unit_quaternion().inverse();
        Self {
            grasp_position_b: inverse * (handle.position - state.position),
            grasp_orientation_b: UnitQuaternion::new_normalize((inverse * handle.orientation).into_inner()),
            ..*self
        }
    }

    /// These springs and dampers at another grasp, as [`Coupling::grasp`] gives it. Real time: constant work.
    #[must_use]
    pub fn with_grasp(&self, position_b: Vector3<f64>, orientation_b: UnitQuaternion<f64>) -> Self {
        Self { grasp_position_b: position_b, grasp_orientation_b: orientation_b, ..*self }
    }

    /// Springs and dampers on the way to another coupling's, at this grasp: `share` 0 gives these, 1 the other's. A limit that one of
    /// them does not have comes from, or goes to, infinity. Real time: constant work.
    #[must_use]
    pub fn toward(&self, other: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * share;
        let limit = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => Some(mix(a, b)),
            (None, Some(b)) => (share > 0.0).then(|| b / share),
            (Some(a), None) => (share < 1.0).then(|| a / (1.0 - share)),
            (None, None) => None,
        };
        let spring = |a: Spring, b: Spring| Spring {
            stiffness: mix(a.stiffness, b.stiffness),
            limit: limit(a.limit, b.limit).filter(|l| l.is_finite()),
        };
        Self {
            linear: spring(self.linear, other.linear),
            angular: spring(self.angular, other.angular),
            linear_damping: mix(self.linear_damping, other.linear_damping),
            angular_damping: mix(self.angular_damping, other.angular_damping),
            ..*self
        }
    }

    /// The same grasp without springs and dampers: an open hand. Real time: constant work.
    #[must_use]
    pub fn released(&self) -> Self {
        let none = Spring { stiffness: 0.0, limit: None };
        Self { linear: none, angular: none, linear_damping: 0.0, angular_damping: 0.0, ..*self }
    }

    /// The handle that the coupling has no deviation from: at x + R c, turned by q q_c, and moving with the body.
    ///
    /// Requires a unit quaternion. Real time: constant work.
    #[must_use]
    pub fn without_deviation(&self, state: &State, body: &RigidBody) -> Handle {
        let rotation = state.unit_quaternion();
        let arm = rotation * self.grasp_position_b;
        let omega = state.angular_velocity(body);
        Handle {
            position: state.position + arm,
            orientation: rotation * self.grasp_orientation_b,
            linear_velocity: state.linear_velocity(body) + omega.cross(&arm),
            angular_velocity: omega,
        }
    }

    fn deviation<T: RealField + Copy>(
        &self,
        handle: &Handle,
        state: &State<T>,
        v: &Vector3<T>,
        omega: &Vector3<T>,
    ) -> Deviation<T> {
        let constant = |v: &Vector3<f64>| v.map(convert::<f64, T>);
        let arm = rotation(&state.orientation) * constant(&self.grasp_position_b);
        let to4 = |q: &UnitQuaternion<f64>| Vector4::new(q.w, q.i, q.j, q.k);
        let goal = product(&to4(&handle.orientation), &conjugate(&to4(&self.grasp_orientation_b)));
        let error = product(&goal.map(convert::<f64, T>), &conjugate(&state.orientation));
        Deviation {
            arm,
            offset: constant(&handle.position) - state.position - arm,
            rate: constant(&handle.linear_velocity) - v - omega.cross(&arm),
            turn: rotation_vector(&error),
            turn_rate: constant(&handle.angular_velocity) - omega,
        }
    }

    /// Force of the coupling at its point, and its torque without that force's lever.
    fn link<T: RealField + Copy>(&self, deviation: &Deviation<T>) -> (Vector3<T>, Vector3<T>) {
        let (pull, damping) = spring(&self.linear, &deviation.offset);
        let (twist, turn_damping) = spring(&self.angular, &deviation.turn);
        let b = damping * convert::<f64, T>(self.linear_damping);
        let b_turn = turn_damping * convert::<f64, T>(self.angular_damping);
        (pull + deviation.rate * b, twist + deviation.turn_rate * b_turn)
    }

    /// The wrench of the coupling on the body at its centre of mass.  Eq. 12, with the lever R c in the damper (D2).
    ///
    /// World axes, N and N m. `inverse_mass` is 1/m in 1/kg, `inverse_inertia_b` the paper's M^-1 in body axes, 1/(kg m^2). Generic,
    /// so that it can be differentiated automatically. Requires quaternions that are not zero. Real time: constant work.
    pub fn wrench<T: RealField + Copy>(
        &self,
        handle: &Handle,
        state: &State<T>,
        inverse_mass: T,
        inverse_inertia_b: &Matrix3<T>,
    ) -> Wrench<T> {
        let v = state.linear_momentum * inverse_mass;
        let omega = angular_velocity(&state.orientation, &state.angular_momentum, inverse_inertia_b);
        let deviation = self.deviation(handle, state, &v, &omega);
        let (force, torque) = self.link(&deviation);
        let at_center = Wrench::at(&deviation.arm, force);
        Wrench { torque: at_center.torque + torque, ..at_center }
    }

    /// What a device is sent: the opposite of the coupling's force, and of its torque without the lever of the force,
    /// which acts about the body's centre of mass and not about the handle (D3). Also the length of e = x_h - x - R c (metres) and of
    /// u_c (radians, at most pi). Section 5.3.
    ///
    /// World axes, N and N m, before [`Coupling::limited`]. Real time: constant work.
    #[must_use]
    pub fn feedback(&self, handle: &Handle, state: &State, body: &RigidBody) -> (Wrench, f64, f64) {
        let v = state.linear_velocity(body);
        let deviation = self.deviation(handle, state, &v, &state.angular_velocity(body));
        let (force, torque) = self.link(&deviation);
        let length = |v: &Vector3<f64>| libm::sqrt(v.norm_squared());
        (Wrench { force: -force, torque: -torque }, length(&deviation.offset), length(&deviation.turn))
    }

    /// Brings a wrench (N, N m) to the greatest force and torque, keeping directions; tells whether it had to (D10). Without
    /// limits it stays. Real time: constant work.
    #[must_use]
    pub fn limited(&self, wrench: Wrench) -> (Wrench, bool) {
        let limit = |v: Vector3<f64>, limit: Option<f64>| match limit {
            Some(most) if v.norm_squared() > most * most => (v * (most / libm::sqrt(v.norm_squared())), true),
            _ => (v, false),
        };
        let (force, forced) = limit(wrench.force, self.linear.limit);
        let (torque, twisted) = limit(wrench.torque, self.angular.limit);
        (Wrench { force, torque }, forced || twisted)
    }

    /// Whether a deviation of this length (metres) and angle (radians) is in the constant range of either spring.
    #[must_use]
    pub fn is_saturated(&self, length: f64, angle: f64) -> bool {
        self.linear.is_saturated(length) || self.angular.is_saturated(angle)
    }

    /// Adds the wrench and its derivatives.  Eqs. 12 to 20 (D2), by small changes of position, orientation and velocities.
    ///
    /// `v` (m/s) and `omega` (rad/s) are the body's at `state`, world axes; [`Linearization::by_state`] makes the blocks of the paper
    /// of the sum. At a coupling angle of pi, where u_c jumps, the derivative is that of one side. Real time: constant work.
    pub fn linearize(
        &self,
        handle: &Handle,
        state: &State,
        v: &Vector3<f64>,
        omega: &Vector3<f64>,
        to: &mut Linearization,
    ) {
        let deviation = self.deviation(handle, state, v, omega);
        let Deviation { arm, offset, rate, turn, turn_rate } = deviation;
        let (pull, k, b, b_by_offset) = tangent(&self.linear, self.linear_damping, &offset);
        let (twist, k_turn, b_turn, b_by_turn) = tangent(&self.angular, self.angular_damping, &turn);
        let force = pull + rate * b;
        let arm_s = skew(&arm);
        // de = -dx + a* dtheta;  d(rate) = -dv + a* domega + omega* a* dtheta.
        let by_offset = k + rate * b_by_offset.transpose();
        let f_x = -by_offset;
        let f_turn = by_offset * arm_s + skew(omega) * arm_s * b;
        let f_v = Matrix3::identity() * -b;
        let f_omega = arm_s * b;
        // The lever: d(a x F) = a* dF + (dtheta x a) x F.
        let lever = arm * force.transpose() - Matrix3::identity() * arm.dot(&force);
        let by_turn = (k_turn + turn_rate * b_by_turn.transpose()) * -inverse_right_jacobian(&turn);
        let torque = arm.cross(&force) + twist + turn_rate * b_turn;
        to.wrench += Wrench { force, torque }.to_vector();
        let mut add = |row: usize, column: usize, m: Matrix3<f64>, velocity: bool| {
            let block = if velocity { &mut to.by_velocity } else { &mut to.by_position };
            let mut part = block.fixed_view_mut::<3, 3>(row, column);
            part += m;
        };
        add(0, 0, f_x, false);
        add(0, 3, f_turn, false);
        add(3, 0, arm_s * f_x, false);
        add(3, 3, arm_s * f_turn + lever + by_turn, false);
        add(0, 0, f_v, true);
        add(0, 3, f_omega, true);
        add(3, 0, arm_s * f_v, true);
        add(3, 3, arm_s * f_omega - Matrix3::identity() * b_turn, true);
    }
}

/// A spring and damper along a vector: force, its derivative, damping, and the damping's derivative.
fn tangent(
    spring: &Spring,
    damping: f64,
    deflection: &Vector3<f64>,
) -> (Vector3<f64>, Matrix3<f64>, f64, Vector3<f64>) {
    let k = spring.stiffness;
    let s = libm::sqrt(deflection.norm_squared());
    let at = spring.at(s);
    if s == 0.0 || at.slope == k {
        return (deflection * k, Matrix3::identity() * k, damping, Vector3::zeros());
    }
    let u = deflection / s;
    let uu = u * u.transpose();
    let derivative = uu * at.slope + (Matrix3::identity() - uu) * (at.force / s);
    let share = at.slope / k;
    let (share, by_s) = if share > LEAST_DAMPING { (share, at.curvature / k) } else { (LEAST_DAMPING, 0.0) };
    (u * at.force, derivative, damping * share, u * (damping * by_s))
}
