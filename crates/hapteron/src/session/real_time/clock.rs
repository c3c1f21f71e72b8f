//! The haptic thread's clock: monotonic nanoseconds, and waking at an absolute time.
#![allow(unsafe_code, reason = "calls of the operating system")]

use std::time::Duration;

/// How long before a deadline sleeping ends and spinning begins, at the least; see [`Margin`].
pub const SPIN: Duration = Duration::from_micros(100);
/// Spinning takes no more of a period than this share (or the least, where that is more).
const MOST_SPIN: f64 = 0.3;
/// A margin covers the latest waking times this.
const COVER: f64 = 1.5;
/// Sleeps after which a margin has forgotten two thirds of what it learned.
const MEMORY: u64 = 8192;

/// Nanoseconds of a clock that never steps. Real time.
#[cfg(target_os = "linux")]
#[must_use]
pub fn now_ns() -> u64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is a valid place for the result. The monotonic clock always exists.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// Sleeps until `wake_ns`; may wake late, and early when a signal comes.
#[cfg(target_os = "linux")]
pub fn sleep_until(wake_ns: u64) {
    let time = libc::timespec {
        tv_sec: (wake_ns / 1_000_000_000) as libc::time_t,
        tv_nsec: (wake_ns % 1_000_000_000) as libc::c_long,
    };
    // SAFETY: `time` is valid and normalised, and no remaining time is asked for.
    unsafe {
        libc::clock_nanosleep(
            libc::CLOCK_MONOTONIC,
            libc::TIMER_ABSTIME,
            &raw const time,
            std::ptr::null_mut(),
        )
    };
}

/// Nanoseconds since the first call.
#[cfg(not(target_os = "linux"))]
#[must_use]
pub fn now_ns() -> u64 {
    static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    START.get_or_init(std::time::Instant::now).elapsed().as_nanos() as u64
}

/// Sleeps until `wake_ns`; may wake late.
#[cfg(not(target_os = "linux"))]
pub fn sleep_until(wake_ns: u64) {
    let now = now_ns();
    if wake_ns > now {
        std::thread::sleep(Duration::from_nanos(wake_ns - now));
    }
}

/// How long before a deadline sleeping ends, learned from how late the system woke the thread before: a virtual machine whose CPU was put
/// to sleep by its host wakes hundreds of microseconds late a few times a second, others never do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Margin {
    now_ns: u64,
    least_ns: u64,
    most_ns: u64,
}

impl Margin {
    /// At its least, which is `spin`.
    #[must_use]
    pub fn new(spin: Duration, period_ns: u64) -> Self {
        let least_ns = spin.as_nanos() as u64;
        let most_ns = ((period_ns as f64 * MOST_SPIN) as u64).max(least_ns);
        Self { now_ns: least_ns, least_ns, most_ns }
    }

    /// Nanoseconds.
    #[must_use]
    pub fn ns(&self) -> u64 {
        self.now_ns
    }

    /// Takes by how much a waking was late.
    fn learn(&mut self, late_ns: u64) {
        let forgotten = self.now_ns - (self.now_ns - self.least_ns).div_ceil(MEMORY);
        let wanted = (late_ns as f64 * COVER) as u64;
        self.now_ns = forgotten.max(wanted).clamp(self.least_ns, self.most_ns);
    }
}

/// Waits until a deadline as exactly as the machine can: asleep until a margin before it, then spinning. Answers the time.
pub fn wait_until(deadline_ns: u64, margin: &mut Margin) -> u64 {
    let mut now = now_ns();
    let wake_ns = deadline_ns.saturating_sub(margin.ns());
    if now < wake_ns {
        sleep_until(wake_ns);
        now = now_ns();
        margin.learn(now.saturating_sub(wake_ns));
    }
    while now < deadline_ns {
        std::hint::spin_loop();
        now = now_ns();
    }
    now
}

/// A time in the next two milliseconds to count periods from, such that neither the deadlines nor the middles between them fall on whole
/// milliseconds (for periods that divide one), where Linux does its own periodic work.
#[must_use]
pub fn quiet_epoch(period_ns: u64) -> u64 {
    const MILLISECOND: u64 = 1_000_000;
    now_ns().div_ceil(MILLISECOND) * MILLISECOND + period_ns / 4
}

/// One beat of a [`Metronome`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Beat {
    /// Which period began, counted from the start.
    pub index: u64,
    /// When this beat was noticed.
    pub started_ns: u64,
    /// After the deadline that was waited for.
    pub lateness_ns: u64,
    /// Deadlines that have passed by without a beat.
    pub missed: u64,
}

/// Absolute deadlines in equal steps. One that is late by whole periods goes on with the newest deadline: it never runs after lost time.
#[derive(Clone, Debug)]
pub struct Metronome {
    epoch_ns: u64,
    period_ns: u64,
    margin: Margin,
    next: u64,
}

impl Metronome {
    /// The first beat comes one period after `epoch_ns`.
    #[must_use]
    pub fn new(epoch_ns: u64, period_ns: u64, spin: Duration) -> Self {
        let period_ns = period_ns.max(1);
        Self { epoch_ns, period_ns, margin: Margin::new(spin, period_ns), next: 1 }
    }

    /// The deadline that is waited for next.
    #[must_use]
    pub fn deadline_ns(&self) -> u64 {
        self.epoch_ns + self.next * self.period_ns
    }

    /// Waits for the next beat.
    pub fn wait(&mut self) -> Beat {
        let started_ns = wait_until(self.deadline_ns(), &mut self.margin);
        self.beat(started_ns)
    }

    /// The beat noticed at a time.
    fn beat(&mut self, started_ns: u64) -> Beat {
        let lateness_ns = started_ns.saturating_sub(self.deadline_ns());
        let missed = lateness_ns / self.period_ns;
        let index = self.next + missed;
        self.next = index + 1;
        Beat { index, started_ns, lateness_ns, missed }
    }

    /// Waits until the middle between the last beat and the next; tells by how much it was late, or nothing when it was too late to wait
    /// without haste.
    pub fn wait_between(&mut self) -> Option<u64> {
        let middle = self.deadline_ns().saturating_sub(self.period_ns / 2);
        let room = self.margin.ns() + self.period_ns / 20;
        if now_ns() + room > middle {
            return None;
        }
        Some(wait_until(middle, &mut self.margin).saturating_sub(middle))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a loop that hurries after lost time, or counts a late tick as a missed one.
    #[test]
    fn a_late_beat_goes_on_with_the_newest_deadline() {
        let mut m = Metronome::new(1_000_000, 1000, SPIN);
        assert_eq!(m.beat(1_001_000), Beat { index: 1, started_ns: 1_001_000, lateness_ns: 0, missed: 0 });
        let late = m.beat(1_002_999);
        assert_eq!((late.index, late.lateness_ns, late.missed), (2, 999, 0));
        let very_late = m.beat(1_007_500);
        assert_eq!((very_late.index, very_late.lateness_ns, very_late.missed), (7, 4500, 4));
        assert_eq!(m.deadline_ns(), 1_008_000);
    }

    /// Would catch a margin that does not follow late wakings, takes the whole period, or never lets go of one that was very late.
    #[test]
    fn the_margin_follows_how_late_the_system_wakes() {
        let mut margin = Margin::new(SPIN, 1_000_000);
        let mut after = |late_us: u64, sleeps: u32| {
            (0..sleeps).for_each(|_| margin.learn(late_us * 1000));
            margin.ns()
        };
        assert_eq!(after(5, 10_000), 100_000);
        assert_eq!(after(140, 1), 210_000);
        assert_eq!(after(5000, 1), 300_000);
        let second_later = after(5, 1000);
        assert!((270_000..280_000).contains(&second_later), "{second_later}");
        assert!(after(5, 100_000) < 101_000);
        assert_eq!(Margin::new(SPIN, 125_000).most_ns, 100_000);
    }

    /// Would catch a wait that ends early: the one thing that a busy machine cannot excuse.
    #[test]
    fn no_beat_comes_before_its_deadline() {
        let mut m = Metronome::new(now_ns(), 500_000, SPIN);
        for _ in 0..100 {
            let deadline = m.deadline_ns();
            assert!(m.wait().started_ns >= deadline);
        }
    }
}
