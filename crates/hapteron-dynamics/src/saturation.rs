//! The spring of the coupling: linear, then cubic, then constant (section 5.3.1).

/// A spring whose force grows with stiffness k up to half its greatest force, bends over along a cubic, and stays at the greatest force.
///
/// Per radian instead of per metre it is the angular spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// k, N/m or N m/rad.
    pub stiffness: f64,
    /// Greatest force, N or N m; `None` for a spring that stays linear.
    pub limit: Option<f64>,
}

/// The share of the limit up to which the spring is linear.
const LINEAR: f64 = 0.5;
/// Length of the cubic range in units of (limit - linear part) / k; 2 makes the slope fall in a straight line. Between 1.5 and
/// 3 the curve is monotone and concave.
const BEND: f64 = 2.0;

/// The force at a deflection, with its first two derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringForce {
    /// f(s), N or N m.
    pub force: f64,
    /// f'(s), N/m or N m/rad.
    pub slope: f64,
    /// f''(s), N/m^2 or N m/rad^2; at the two joints that of one side.
    pub curvature: f64,
}

impl Spring {
    /// The force at the deflection s >= 0 (metres or radians).  Section 5.3.1 (D10).
    ///
    /// Its slope is continuous. Requires a stiffness that is not negative and a positive limit, as [`crate::Coupling::new`]
    /// checks them; a spring of stiffness zero has no force at any deflection. Real time: constant work.
    #[inline]
    #[must_use]
    pub fn at(&self, s: f64) -> SpringForce {
        let k = self.stiffness;
        let linear = SpringForce { force: k * s, slope: k, curvature: 0.0 };
        let Some(limit) = self.limit else { return linear };
        let start = LINEAR * limit / k;
        // Also true for a stiffness of zero, whose start is infinite or not a number.
        if !(s > start) {
            return linear;
        }
        let rise = limit - k * start;
        let length = BEND * rise / k;
        let t = (s - start) / length;
        if t >= 1.0 {
            return SpringForce { force: limit, slope: 0.0, curvature: 0.0 };
        }
        let (t2, t3) = (t * t, t * t * t);
        SpringForce {
            force: k * start + rise * (3.0 * t2 - 2.0 * t3) + k * length * (t3 - 2.0 * t2 + t),
            slope: rise / length * (6.0 * t - 6.0 * t2) + k * (3.0 * t2 - 4.0 * t + 1.0),
            curvature: (rise / length * (6.0 - 12.0 * t) + k * (6.0 * t - 4.0)) / length,
        }
    }

    /// Whether the spring has reached its limit at the deflection s (metres or radians). Real time: constant work.
    #[must_use]
    pub fn is_saturated(&self, s: f64) -> bool {
        // A spring of stiffness zero has no slope either, but no force that could reach the limit.
        self.limit.is_some() && self.stiffness > 0.0 && self.at(s).slope <= 0.0
    }
}
