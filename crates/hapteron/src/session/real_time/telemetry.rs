//! What the threads tell of themselves: one record of fixed size a tick and a pass, and histograms that anyone may look at while they run.

use super::histogram::{Distribution, Histogram};
use crate::session::{Command, Tick};
use hapteron_device::{DeviceCommand, DeviceSample};
use std::sync::atomic::{AtomicU64, Ordering};

/// All of one tick.
#[derive(Clone, Copy, Debug)]
pub struct TickRecord {
    /// Counted from 1 without gaps.
    pub tick: u64,
    /// `now` of the tick, seconds since the start.
    pub time: f64,
    /// What the device gave.
    pub sample: DeviceSample,
    /// A command that was applied before the tick.
    pub command: Option<Command>,
    /// What came of it.
    pub result: Tick,
    /// The tick whose state the contacts were found at; 0 is the start.
    pub contacts_of: u64,
    /// Contacts that the pass found, and planes made of them.
    pub counts: (u32, u32),
    /// From the deadline to the start of the tick; zero where the device sets the pace.
    pub lateness_ns: u64,
    /// From the start of the tick until its command was there.
    pub compute_ns: u64,
    /// Deadlines that passed by just before this tick.
    pub missed: u64,
}

/// All of one contact pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassRecord {
    /// The tick whose state it looked at; 0 is the start.
    pub of_tick: u64,
    /// How far ahead it looked, seconds; decides its margin.
    pub ahead: f64,
    /// Of the surfaces at that state, negative where they cross, metres.
    pub min_distance: f64,
    /// Contacts that it found.
    pub contacts: u32,
    /// How long it took.
    pub duration_ns: u64,
}

/// Histograms and counts of a running session. Written by the threads, each by one of them.
#[derive(Debug, Default)]
pub struct Telemetry {
    pub(super) period: Histogram,
    pub(super) lateness: Histogram,
    pub(super) bare_lateness: Histogram,
    pub(super) compute: Histogram,
    pub(super) contact_age: Histogram,
    pub(super) pass: Histogram,
    pub(super) missed: AtomicU64,
    pub(super) ticks: AtomicU64,
    pub(super) passes: AtomicU64,
    pub(super) lost: AtomicU64,
    pub(super) lost_passes: AtomicU64,
    pub(super) repeated: AtomicU64,
    pub(super) limited_by_device: AtomicU64,
    undelivered: AtomicU64,
    /// The bits of a number: N and N m.
    undelivered_force: AtomicU64,
    undelivered_torque: AtomicU64,
}

/// Adds to a count that only the calling thread writes. Real time.
pub(super) fn add(count: &AtomicU64, n: u64) {
    count.store(count.load(Ordering::Relaxed) + n, Ordering::Relaxed);
}

/// A look at the telemetry of a session.
#[derive(Clone, Debug, Default)]
pub struct Timing {
    /// From the start of one tick to the start of the next.
    pub period: Distribution,
    /// From a deadline to the start of its tick.
    pub lateness: Distribution,
    /// The same of a loop that does nothing, between the ticks of the same thread; empty unless it was asked for.
    pub bare_lateness: Distribution,
    /// From the start of a tick until its command.
    pub compute: Distribution,
    /// Of the state that contacts were found at, when a tick used them.
    pub contact_age: Distribution,
    /// Of a contact pass.
    pub pass: Distribution,
    /// Deadlines without a tick.
    pub missed: u64,
    /// Ticks made.
    pub ticks: u64,
    /// Contact passes made.
    pub passes: u64,
    /// Records for which there was no room, because nobody drained them.
    pub lost: u64,
    /// Ticks without a new device sample.
    pub repeated: u64,
    /// Ticks whose command the device did not display fully.
    pub limited_by_device: u64,
    /// What the device has no motors for and left out.
    pub undelivered: Undelivered,
}

/// The part of the commands that a device has no motors for ([`hapteron_device::undeliverable`]).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Undelivered {
    /// Ticks with such a part.
    pub ticks: u64,
    /// The greatest, N.
    pub greatest_force: f64,
    /// The greatest, N m.
    pub greatest_torque: f64,
}

/// A tick that is no later, in nanoseconds, is on time.
pub const ON_TIME_NS: u64 = 50_000;

impl Timing {
    /// The 99.9 % of the ticks' lateness as a multiple of the bare loop's, and between which multiples it lies with at least 90 % confidence
    /// (each of the two within its own interval of 95 %). What is on time ([`ON_TIME_NS`]) counts as that late: of two loops that are, neither is the
    /// better one, though one may be late by a microsecond and the other by a nanosecond. None where no bare loop was measured.
    #[must_use]
    pub fn lateness_ratio(&self) -> Option<LatenessRatio> {
        const SHARE: f64 = 0.999;
        let (session, bare) = (&self.lateness, &self.bare_lateness);
        let ratio = |s: u64, b: u64| s.max(ON_TIME_NS) as f64 / b.max(ON_TIME_NS) as f64;
        let ([session_low, session_high], [bare_low, bare_high]) =
            (session.quantile_between_ns(SHARE), bare.quantile_between_ns(SHARE));
        (session.count > 0 && bare.count > 0).then(|| LatenessRatio {
            ratio: ratio(session.quantile_ns(SHARE), bare.quantile_ns(SHARE)),
            between: [ratio(session_low, bare_high), ratio(session_high, bare_low)],
        })
    }
}

/// See [`Timing::lateness_ratio`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatenessRatio {
    /// Of the two 99.9 %.
    pub ratio: f64,
    /// Least and greatest that the numbers of durations allow.
    pub between: [f64; 2],
}

impl std::fmt::Display for LatenessRatio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { ratio, between: [least, greatest] } = self;
        write!(
            f,
            "{ratio:.2} times the bare loop's (90 % sure: {least:.2} to {greatest:.2}; up to {} us is on time)",
            ON_TIME_NS / 1000
        )
    }
}

impl Telemetry {
    /// What has been recorded so far.
    #[must_use]
    pub fn timing(&self) -> Timing {
        let count = |c: &AtomicU64| c.load(Ordering::Relaxed);
        Timing {
            period: self.period.distribution(),
            lateness: self.lateness.distribution(),
            bare_lateness: self.bare_lateness.distribution(),
            compute: self.compute.distribution(),
            contact_age: self.contact_age.distribution(),
            pass: self.pass.distribution(),
            missed: count(&self.missed),
            ticks: count(&self.ticks),
            passes: count(&self.passes),
            lost: count(&self.lost) + count(&self.lost_passes),
            repeated: count(&self.repeated),
            limited_by_device: count(&self.limited_by_device),
            undelivered: Undelivered {
                ticks: count(&self.undelivered),
                greatest_force: f64::from_bits(count(&self.undelivered_force)),
                greatest_torque: f64::from_bits(count(&self.undelivered_torque)),
            },
        }
    }

    /// Takes what a device leaves out of a command. Real time.
    pub(super) fn left_out(&self, part: &DeviceCommand) {
        if *part == DeviceCommand::zero() {
            return;
        }
        add(&self.undelivered, 1);
        for (most, vector) in
            [(&self.undelivered_force, &part.force), (&self.undelivered_torque, &part.torque)]
        {
            // Zero has no bits.
            let size = vector.norm_squared().sqrt();
            if size > f64::from_bits(most.load(Ordering::Relaxed)) {
                most.store(size.to_bits(), Ordering::Relaxed);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::session::real_time::histogram::Histogram;

    /// Would catch a loop that is taken for a late one although both are on time, and one that is late and passes because of that.
    #[test]
    fn on_time_is_on_time() {
        let late_by = |tail_ns: u64| {
            let histogram = Histogram::new();
            (0..100_000).for_each(|i| histogram.record(if i % 100 == 0 { tail_ns } else { 20 }));
            histogram.distribution()
        };
        let ratio = |session, bare| {
            let timing =
                Timing { lateness: late_by(session), bare_lateness: late_by(bare), ..Timing::default() };
            timing.lateness_ratio().unwrap().ratio
        };
        assert_eq!(ratio(40_000, 100), 1.0);
        assert_eq!(ratio(100, 40_000), 1.0);
        assert!((3.8..4.2).contains(&ratio(200_000, 100)));
        assert!((3.8..4.2).contains(&ratio(400_000, 100_000)));
    }
}
