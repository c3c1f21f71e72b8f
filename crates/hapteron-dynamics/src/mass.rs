//! Mass and inertia of the body.

use nalgebra::Matrix3;

/// Why a mass or an inertia is not that of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum RigidBodyError {
    /// The mass (kg) is not a positive finite number, or so small that 1/m is none.
    Mass(f64),
    /// The inertia is not symmetric, or has a component that is not finite.
    Asymmetric,
    /// The inertia has a principal moment that is not positive (the least one is given).
    NotPositive(f64),
    /// One principal moment is greater than the sum of the other two: no distribution of mass has that.
    Triangle,
}

impl core::fmt::Display for RigidBodyError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Mass(mass) => write!(f, "mass {mass} kg; it must be positive and finite"),
            Self::Asymmetric => write!(f, "the inertia matrix is not symmetric and finite"),
            Self::NotPositive(least) => {
                write!(f, "the inertia has the principal moment {least} kg m^2; all three must be positive")
            }
            Self::Triangle => {
                write!(
                    f,
                    "one principal moment of inertia is greater than the sum of the other two; no body has that"
                )
            }
        }
    }
}

impl core::error::Error for RigidBodyError {}

/// Mass properties in the body frame, whose origin is the centre of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidBody {
    mass: f64,
    inertia_b: Matrix3<f64>,
    inverse_inertia_b: Matrix3<f64>,
}

impl RigidBody {
    /// A body of the given mass (kg) and inertia tensor about its centre of mass (kg m^2, body axes).
    ///
    /// # Errors
    /// [`RigidBodyError`] for values that no body has; the triangle inequality of the moments is allowed to fail by one part in a
    /// thousand, for inertias that were rounded. Not real time: the eigenvalues are found by iteration.
    pub fn new(mass: f64, inertia_b: Matrix3<f64>) -> Result<Self, RigidBodyError> {
        if !(mass > 0.0 && mass.is_finite() && (1.0 / mass).is_finite()) {
            return Err(RigidBodyError::Mass(mass));
        }
        // Before any maximum, which would pass over a NaN, and any iteration, which would not end with one.
        if !inertia_b.iter().all(|c| c.is_finite()) {
            return Err(RigidBodyError::Asymmetric);
        }
        let size = inertia_b.amax();
        if (inertia_b - inertia_b.transpose()).amax() > 1e-9 * size {
            return Err(RigidBodyError::Asymmetric);
        }
        if size == 0.0 {
            return Err(RigidBodyError::NotPositive(0.0));
        }
        // In units of the largest component, so that no product overflows or vanishes.
        let unit = inertia_b / size;
        let moments = unit.symmetric_eigenvalues();
        let (least, greatest) = (moments.min(), moments.max());
        if !(least > 1e-12) {
            return Err(RigidBodyError::NotPositive(least * size));
        }
        if greatest > (moments.sum() - greatest) * 1.001 {
            return Err(RigidBodyError::Triangle);
        }
        let inverse_inertia_b = unit.try_inverse().unwrap_or_default() / size;
        if !(inverse_inertia_b.trace() > 0.0 && inverse_inertia_b.iter().all(|c| c.is_finite())) {
            return Err(RigidBodyError::NotPositive(least * size));
        }
        Ok(Self { mass, inertia_b, inverse_inertia_b })
    }

    /// m, in kg.
    #[must_use]
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// The inertia tensor about the centre of mass, body axes, kg m^2: the paper's M.
    #[must_use]
    pub fn inertia_b(&self) -> &Matrix3<f64> {
        &self.inertia_b
    }

    /// Its inverse, body axes, 1/(kg m^2): the paper's M^-1.
    #[must_use]
    pub fn inverse_inertia_b(&self) -> &Matrix3<f64> {
        &self.inverse_inertia_b
    }
}
