//! What a step has to say besides its numbers.

/// A set of status bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Status(u32);

impl Status {
    /// Nothing to say.
    pub const NONE: Self = Self(0);
    /// A number came in or out that is not finite, the quaternion was zero, or the time step was not positive; the state was kept
    /// and all wrenches are zero.
    pub const NON_FINITE: Self = Self(1);
    /// The linear system could not be solved; the state was kept and all wrenches are zero.
    pub const SINGULAR: Self = Self(1 << 1);
    /// The coupling is turned by more than 3 rad; beyond pi its torque changes sides.
    pub const COUPLING_ANGLE_LIMIT: Self = Self(1 << 2);
    /// The coupling's spring is in its saturated range.
    pub const COUPLING_SATURATED: Self = Self(1 << 3);
    /// The feedback was reduced to the coupling's greatest force or torque (D10).
    pub const FEEDBACK_LIMITED: Self = Self(1 << 4);

    /// The union of both.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether all bits of `other` are set.
    #[must_use]
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether the step failed: its state is that before it, and its wrenches are zero.
    #[must_use]
    pub fn is_fault(self) -> bool {
        self.0 & (Self::NON_FINITE.0 | Self::SINGULAR.0) != 0
    }

    /// The bits, for a record.
    #[must_use]
    pub const fn bits(self) -> u32 {
        self.0
    }
}
