//! Plain three-vectors for the inner loops, where arrays vectorise better than a matrix type.

/// A point or direction in metres (or dimensionless), in the frame that the context names.
pub(crate) type Vec3 = [f64; 3];

#[inline(always)]
pub(crate) fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline(always)]
pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(crate) fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// The unit vector along `a`, or zero when `a` has no direction.
#[inline(always)]
pub(crate) fn unit_or_zero(a: Vec3) -> Vec3 {
    let length = norm(a);
    if length > 0.0 && length.is_finite() { scale(a, 1.0 / length) } else { [0.0; 3] }
}

/// The unit vector along the first of the two that has a direction, else the z axis.
#[inline(always)]
pub(crate) fn unit_or(a: Vec3, other: Vec3) -> Vec3 {
    let (first, second) = (unit_or_zero(a), unit_or_zero(other));
    if first != [0.0; 3] {
        first
    } else if second != [0.0; 3] {
        second
    } else {
        [0.0, 0.0, 1.0]
    }
}

/// A rigid motion as rows of numbers: `rotation * v + translation`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rigid {
    pub rotation: [Vec3; 3],
    pub translation: Vec3,
}

impl Rigid {
    pub(crate) fn from_isometry(isometry: &nalgebra::Isometry3<f64>) -> Self {
        let r = isometry.rotation.to_rotation_matrix();
        let row = |i: usize| [r[(i, 0)], r[(i, 1)], r[(i, 2)]];
        let t = isometry.translation.vector;
        Self { rotation: [row(0), row(1), row(2)], translation: [t.x, t.y, t.z] }
    }

    #[inline(always)]
    pub(crate) fn direction(&self, v: Vec3) -> Vec3 {
        [dot(self.rotation[0], v), dot(self.rotation[1], v), dot(self.rotation[2], v)]
    }

    #[inline(always)]
    pub(crate) fn point(&self, v: Vec3) -> Vec3 {
        add(self.direction(v), self.translation)
    }
}
