//! What was unusual in a tick, as bits.

use hapteron_device::guard::GuardStatus;
use hapteron_dynamics::Status;

/// Bits of one tick. The lowest eight are those of the integration step ([`Status`]), those from 16 on of the guard ([`GuardStatus`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags(u32);

impl Flags {
    /// More contacts than planes; the deepest of each neighbourhood were kept.
    pub const CONTACTS_THINNED: Self = Self(1 << 8);
    /// A fault happened in this tick or an earlier one: the command is zero until the session is made anew.
    pub const FAULT_LATCHED: Self = Self(1 << 9);
    /// No pass has delivered contacts yet.
    pub const NO_CONTACTS_YET: Self = Self(1 << 10);

    /// The hand has let go of the body.
    pub const RELEASED: Self = Self(1 << 11);
    /// The handle moves and the world does not.
    pub const CLUTCHED: Self = Self(1 << 12);
    /// The body stands still by command.
    pub const PAUSED: Self = Self(1 << 13);
    /// The device gave no new sample; the last one was used again.
    pub const SAMPLE_REPEATED: Self = Self(1 << 14);
    /// Ticks before this one were missed.
    pub const DEADLINE_MISSED: Self = Self(1 << 15);

    /// The device had its motors off after the tick before; the force begins anew on the guard's ramp.
    pub const DEVICE_OFF: Self = Self(1 << 31);

    /// The guard latched a fault: the command is zero until it is re-armed.
    pub const GUARD_FAULT: Self = Self::from_guard(GuardStatus::FAULT);

    /// What the bits mean, for people.
    const NAMES: [(u32, &'static str); 27] = [
        (Status::NON_FINITE.bits(), "a number was not finite"),
        (Status::SINGULAR.bits(), "the system of equations was singular"),
        (Status::COUPLING_ANGLE_LIMIT.bits(), "coupling near half a turn"),
        (Status::COUPLING_SATURATED.bits(), "coupling saturated"),
        (Status::FEEDBACK_LIMITED.bits(), "feedback at its limit"),
        (1 << 8, "more contacts than planes"),
        (1 << 9, "fault latched, no force"),
        (1 << 10, "no contacts known yet"),
        (1 << 11, "body let go"),
        (1 << 12, "clutch pressed"),
        (1 << 13, "paused"),
        (1 << 14, "device sample used again"),
        (1 << 15, "ticks missed before this one"),
        (1 << 31, "the device's motors were off"),
        (Self::from_guard(GuardStatus::LIMITED).0, "guard: force or torque at its limit"),
        (Self::from_guard(GuardStatus::SLEWED).0, "guard: force changes too fast"),
        (Self::from_guard(GuardStatus::POWER_LIMITED).0, "guard: power at its limit"),
        (Self::from_guard(GuardStatus::RAMPING).0, "guard: ramp"),
        (Self::from_guard(GuardStatus::CONTACTS_STALE).0, "guard: contacts stale, the force fades"),
        (Self::from_guard(GuardStatus::SAMPLES_STALE).0, "guard: samples stale, the force fades"),
        (Self::from_guard(GuardStatus::DAMPED).0, "guard: damped for passivity"),
        (Self::from_guard(GuardStatus::TORQUE_UNDELIVERED).0, "a torque that the device cannot drive"),
        (Self::from_guard(GuardStatus::FAULT).0, "guard: fault latched, no force"),
        (Self::from_guard(GuardStatus::OVER_SPEED).0, "guard fault: handle too fast"),
        (Self::from_guard(GuardStatus::OSCILLATION).0, "guard fault: force oscillates"),
        (Self::from_guard(GuardStatus::CLOCK).0, "guard fault: clock stands still"),
        (Self::from_guard(GuardStatus::LOST).0, "guard fault: contacts or samples lost"),
    ];

    /// From a step's status.
    #[must_use]
    pub fn from_status(status: Status) -> Self {
        Self(status.bits() & 0xff)
    }

    /// From a pass of the guard.
    #[must_use]
    pub const fn from_guard(status: GuardStatus) -> Self {
        Self((status.bits() as u32) << 16)
    }

    /// Both.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The bits that the other has as well.
    #[must_use]
    pub fn only(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Whether all bits of the other are set.
    #[must_use]
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether a fault keeps the force away.
    #[must_use]
    pub fn no_force(self) -> bool {
        self.contains(Self::FAULT_LATCHED) || self.contains(Self::GUARD_FAULT)
    }

    /// As they stand in `run.csv`.
    #[must_use]
    pub fn bits(self) -> u32 {
        self.0
    }

    /// From `run.csv`.
    #[must_use]
    pub fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// The set bits in words.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(bit, _)| self.0 & bit != 0).map(|(_, name)| name)
    }
}
