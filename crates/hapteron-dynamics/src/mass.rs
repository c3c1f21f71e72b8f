//! Mass and inertia of the body.

use nalgebra::Matrix3;

/// Why a mass or an inertia is not that of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum RigidBodyError {
    /// The mass is not a positive finite number.
    Mass(f64),
    /// The inertia is not symmetric.
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
    /// Values that no body has; the triangle inequality of the moments is allowed to fail by one part in a thousand.
    pub fn new(mass: f64, inertia_b: Matrix3<f64>) -> Result<Self, RigidBodyError> {
        if !(mass > 0.0 && mass.is_finite()) {
            return Err(RigidBodyError::Mass(mass));
        }
        let size = inertia_b.amax();
        if !size.is_finite() || (inertia_b - inertia_b.transpose()).amax() > 1e-9 * size {
            return Err(RigidBodyError::Asymmetric);
        }
        let mut moments = inertia_b.symmetric_eigenvalues();
        moments.as_mut_slice().sort_unstable_by(f64::total_cmp);
        if moments[0] <= 1e-12 * size || size == 0.0 {
            return Err(RigidBodyError::NotPositive(moments[0]));
        }
        if moments[2] > (moments[0] + moments[1]) * 1.001 {
            return Err(RigidBodyError::Triangle);
        }
        let inverse_inertia_b = inertia_b.try_inverse().ok_or(RigidBodyError::NotPositive(moments[0]))?;
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

    /// Its inverse.
    #[must_use]
    pub fn inverse_inertia_b(&self) -> &Matrix3<f64> {
        &self.inverse_inertia_b
    }
}
