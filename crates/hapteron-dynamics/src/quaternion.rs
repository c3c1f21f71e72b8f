//! Rotations by quaternions, and their derivatives (Eqs. 1, 3, 8 to 11).
//!
//! A quaternion is a vector (w, x, y, z) that turns body axes into world axes. R(q) stands for R(q/|q|) in values and
//! derivatives (deviation D1): it does not change along q, so every change of R is a small turn of the body.

use nalgebra::{Matrix3, Matrix3x4, Matrix4, Matrix4x3, RealField, Vector3, Vector4};

/// The matrix u* with u* v = u x v, in the axes and units of u.  Eq. 1.
#[inline]
pub fn skew<T: RealField + Copy>(u: &Vector3<T>) -> Matrix3<T> {
    let zero = T::zero();
    Matrix3::new(zero, -u.z, u.y, u.z, zero, -u.x, -u.y, u.x, zero)
}

/// R(q/|q|): body axes to world axes.
///
/// Requires a quaternion that is not zero (a zero one gives NaN). Does not change with the quaternion's length or sign (D1).
/// Real time: constant work.
#[inline]
pub fn rotation<T: RealField + Copy>(q: &Vector4<T>) -> Matrix3<T> {
    let s = T::one() / q.norm_squared();
    let (w, x, y, z) = (q[0], q[1], q[2], q[3]);
    let two = T::one() + T::one();
    Matrix3::new(
        w * w + x * x - y * y - z * z,
        two * (x * y - w * z),
        two * (x * z + w * y),
        two * (x * y + w * z),
        w * w - x * x + y * y - z * z,
        two * (y * z - w * x),
        two * (x * z - w * y),
        two * (y * z + w * x),
        w * w - x * x - y * y + z * z,
    ) * s
}

/// G, 3x4: a change dq of a unit quaternion turns the body by G dq (rotation vector, world axes, radians).
///
/// The inverse of Q on the tangent space: G Q = I, and G q = 0 (D1). Requires a unit quaternion.
#[inline]
#[must_use]
pub fn turn_matrix(q: &Vector4<f64>) -> Matrix3x4<f64> {
    quaternion_rate_matrix(q).transpose() * 4.0
}

/// The derivative of R(q/|q|) by the i-th component of a unit quaternion, i = 0 to 3 for w, x, y, z (greater i count as 3).
///
/// The factor dR/dq_i of Eqs. 11, 15, 16, 24 and 25. Requires a unit quaternion. Real time: constant work.
#[must_use]
pub fn rotation_derivative(q: &Vector4<f64>, i: usize) -> Matrix3<f64> {
    let turn: Vector3<f64> = turn_matrix(q).column(i.min(3)).into();
    skew(&turn) * rotation(q)
}

/// Q, 4x3: the quaternion's rate is Q omega, with omega in world axes, rad/s.  Eq. 8.
#[inline]
pub fn quaternion_rate_matrix<T: RealField + Copy>(q: &Vector4<T>) -> Matrix4x3<T> {
    let half = T::one() / (T::one() + T::one());
    let (w, x, y, z) = (q[0] * half, q[1] * half, q[2] * half, q[3] * half);
    Matrix4x3::new(-x, -y, -z, w, z, -y, -z, w, x, y, -x, w)
}

/// omega = R M^-1 R^T L, world axes, rad/s.  Eq. 3.
///
/// `angular_momentum` in world axes, kg m^2/s; `inverse_inertia_b` is the paper's M^-1, body axes, 1/(kg m^2). Requires a
/// quaternion that is not zero. Real time: constant work.
#[inline]
pub fn angular_velocity<T: RealField + Copy>(
    q: &Vector4<T>,
    angular_momentum: &Vector3<T>,
    inverse_inertia_b: &Matrix3<T>,
) -> Vector3<T> {
    let r = rotation(q);
    r * (inverse_inertia_b * (r.transpose() * angular_momentum))
}

/// The derivative of omega by a small turn of the body (3x3, world rotation vector); times G it is Eq. 11.
///
/// World axes: omega in rad/s, L in kg m^2/s, `inverse_inertia_w` = R M^-1 R^T in 1/(kg m^2). Real time: constant work.
#[inline]
#[must_use]
pub fn angular_velocity_derivative(
    angular_velocity: &Vector3<f64>,
    angular_momentum: &Vector3<f64>,
    inverse_inertia_w: &Matrix3<f64>,
) -> Matrix3<f64> {
    inverse_inertia_w * skew(angular_momentum) - skew(angular_velocity)
}

/// The derivative of the quaternion's rate by the quaternion, 4x4.  Eq. 10.
///
/// `omega` in world axes, rad/s; `omega_by_turn` is [`angular_velocity_derivative`]. Requires a unit quaternion. Real time:
/// constant work.
#[inline]
#[must_use]
pub fn quaternion_rate_derivative(
    q: &Vector4<f64>,
    omega: &Vector3<f64>,
    omega_by_turn: &Matrix3<f64>,
) -> Matrix4<f64> {
    let (x, y, z) = (0.5 * omega.x, 0.5 * omega.y, 0.5 * omega.z);
    // Q(q) omega is linear in q: half the matrix of left multiplication by (0, omega).
    let by_q = Matrix4::new(0.0, -x, -y, -z, x, 0.0, -z, y, y, z, 0.0, -x, z, -y, x, 0.0);
    by_q + quaternion_rate_matrix(q) * (omega_by_turn * turn_matrix(q))
}

/// The product of two quaternions (w, x, y, z).
#[inline]
pub(crate) fn product<T: RealField + Copy>(a: &Vector4<T>, b: &Vector4<T>) -> Vector4<T> {
    Vector4::new(
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )
}

#[inline]
pub(crate) fn conjugate<T: RealField + Copy>(q: &Vector4<T>) -> Vector4<T> {
    Vector4::new(q[0], -q[1], -q[2], -q[3])
}

/// The rotation vector of a quaternion of any length, at most pi long: 2 atan2(|v|, |w|) along v.
#[inline]
pub(crate) fn rotation_vector<T: RealField + Copy>(e: &Vector4<T>) -> Vector3<T> {
    let e = if e[0] < T::zero() { -e } else { *e };
    let v = Vector3::new(e[1], e[2], e[3]);
    let two = T::one() + T::one();
    let n2 = v.norm_squared();
    // Below this the series is exact to round-off: atan2(n, w) / n = 1/w - n^2/(3 w^3) + ...
    if n2 < e[0] * e[0] * nalgebra::convert::<f64, T>(1e-10) {
        let three = two + T::one();
        return v * (two / e[0] * (T::one() - n2 / (three * e[0] * e[0])));
    }
    let n = n2.sqrt();
    v * (two * n.atan2(e[0]) / n)
}

/// The quaternion of a rotation vector.
#[inline]
pub(crate) fn exponential(turn: &Vector3<f64>) -> Vector4<f64> {
    let angle = libm::sqrt(turn.norm_squared());
    let half = 0.5 * angle;
    let scale = if angle > 1e-8 { libm::sin(half) / angle } else { 0.5 };
    Vector4::new(libm::cos(half), turn.x * scale, turn.y * scale, turn.z * scale)
}

/// The inverse right Jacobian of the rotation group at the rotation vector u: how log(R_e) changes when R_e is followed
/// on the right by a small turn.
#[inline]
pub(crate) fn inverse_right_jacobian(u: &Vector3<f64>) -> Matrix3<f64> {
    let t2 = u.norm_squared();
    let second = if t2 < 1e-6 {
        1.0 / 12.0 + t2 / 720.0
    } else {
        let t = libm::sqrt(t2);
        let half = 0.5 * t;
        1.0 / t2 - libm::cos(half) / (2.0 * t * libm::sin(half))
    };
    let s = skew(u);
    Matrix3::identity() + s * 0.5 + s * s * second
}
