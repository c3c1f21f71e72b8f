//! What a guard did and why it stopped, as bits and as a reason.

/// Bits of one pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GuardStatus(u16);

impl GuardStatus {
    /// Force or torque was beyond the greatest and was brought to it.
    pub const LIMITED: Self = Self(1);
    /// The command changed faster than allowed and lags behind.
    pub const SLEWED: Self = Self(1 << 1);
    /// The command would have pushed the moving hand with more power than allowed.
    pub const POWER_LIMITED: Self = Self(1 << 2);
    /// The force is not whole yet, after an engage, a re-arming or staleness.
    pub const RAMPING: Self = Self(1 << 3);
    /// The contacts are too old to be trusted: the force fades.
    pub const CONTACTS_STALE: Self = Self(1 << 4);
    /// The device's samples are too old to be trusted: the force fades.
    pub const SAMPLES_STALE: Self = Self(1 << 5);
    /// The passivity controller added damping.
    pub const DAMPED: Self = Self(1 << 6);
    /// There is a torque, and the device has no motors for it.
    pub const TORQUE_UNDELIVERED: Self = Self(1 << 7);
    /// A fault is latched: no force until it is re-armed.
    pub const FAULT: Self = Self(1 << 8);
    /// Beside [`GuardStatus::FAULT`]: the handle was too fast.
    pub const OVER_SPEED: Self = Self(1 << 9);
    /// Beside [`GuardStatus::FAULT`]: the force swung to and fro.
    pub const OSCILLATION: Self = Self(1 << 10);
    /// Beside [`GuardStatus::FAULT`]: the clock stood still or ran backward.
    pub const CLOCK: Self = Self(1 << 11);
    /// Beside [`GuardStatus::FAULT`]: contacts or samples stayed away.
    pub const LOST: Self = Self(1 << 12);

    /// As one number.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Whether all bits of the other are set.
    #[must_use]
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    pub(super) fn set(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

/// Why a guard took the force away. The first reason stays until [`super::Guard::rearm`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum GuardFault {
    /// The command, the sample or the time was not a finite number, or beyond all measure.
    NotFinite,
    /// The simulation stopped with a fault of its own.
    Simulation,
    /// The handle moved faster than allowed.
    OverSpeed,
    /// The force kept swinging to and fro, between 8 Hz and half the rate, and fed the hand energy or was violent.
    Oscillation,
    /// The time stood still or ran backward from tick to tick.
    Clock,
    /// No new contacts for a second.
    ContactsLost,
    /// No new device samples for a second.
    SamplesLost,
}

impl GuardFault {
    /// The bits of it.
    pub(super) fn status(self) -> GuardStatus {
        let reason = match self {
            Self::OverSpeed => GuardStatus::OVER_SPEED,
            Self::Oscillation => GuardStatus::OSCILLATION,
            Self::Clock => GuardStatus::CLOCK,
            Self::ContactsLost | Self::SamplesLost => GuardStatus::LOST,
            Self::NotFinite | Self::Simulation => GuardStatus::FAULT,
        };
        GuardStatus(GuardStatus::FAULT.0 | reason.0)
    }
}

impl std::fmt::Display for GuardFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a command, a sample or a time was not a finite number",
            Self::Simulation => "the simulation stopped with a fault",
            Self::OverSpeed => "the handle moved faster than guard.max_speed",
            Self::Oscillation => {
                "the force kept swinging to and fro; less coupling.linear_stiffness or more coupling.linear_damping may cure it"
            }
            Self::Clock => "the clock stood still or ran backward",
            Self::ContactsLost => "no new contacts for a second",
            Self::SamplesLost => "no new device samples for a second",
        })
    }
}
