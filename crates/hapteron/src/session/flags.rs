//! What was unusual in a tick, as bits.

use hapteron_dynamics::Status;

/// Bits of one tick. The lowest eight are those of the integration step ([`Status`]).
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

    /// What the bits mean, for people.
    const NAMES: [(u32, &'static str); 13] = [
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
    ];

    /// From a step's status.
    #[must_use]
    pub fn from_status(status: Status) -> Self {
        Self(status.bits() & 0xff)
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
