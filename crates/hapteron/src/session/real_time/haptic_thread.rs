//! The haptic thread: device sample, tick, command, once a period.

use super::clock::{self, Beat, Metronome};
use super::exchange::{Found, HapticEnd, Seen};
use super::shared::{End, Shared, SharedDevice, message};
use super::telemetry::{TickRecord, add};
use crate::session::{Command, Flags, HapticState, Settings, apply, tick};
use hapteron_device::{
    Applied, Capabilities, DeviceCommand, DeviceFault, DeviceSample, Pacing, undeliverable,
};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A state is there so long after its deadline. The contact thread's timer must not go off at the deadline itself: its interrupt would delay
/// the very tick that it waits for.
const SETTLE_NS: u64 = 40_000;

/// Called before every tick with its number, on the haptic thread: where tests make trouble.
pub type TickHook = Box<dyn FnMut(u64) + Send>;

/// The haptic loop with all it owns. Everything that [`Loop::round`] reaches is real time.
pub(super) struct Loop {
    pub settings: Settings,
    pub haptic: HapticState,
    pub ends: HapticEnd,
    pub shared: Arc<Shared>,
    pub epoch_ns: u64,
    pub period_ns: u64,
    pub spin: Duration,
    /// After so many seconds it ends.
    pub duration: Option<f64>,
    /// Samples may fail to come for so long.
    pub late_limit_ns: u64,
    /// What the device can do.
    pub capabilities: Capabilities,
    /// Measure the lateness of a bare loop between the ticks.
    pub bare: bool,
    pub hook: Option<TickHook>,
    pub ticks: u64,
    /// The last command was not displayed.
    pub device_off: bool,
    /// As the device gave it, and when (on our clock).
    pub last: DeviceSample,
    pub last_fresh_ns: u64,
    /// Its time on the session's clock: that of the tick in which the device first gave it. Devices' clocks are their own; one that does
    /// not go on tells of a sample that is not new.
    pub last_time: f64,
    pub last_start_ns: u64,
}

/// When a tick happens.
struct Instant {
    /// `now` of the tick, seconds.
    time: f64,
    started_ns: u64,
    lateness_ns: u64,
    missed: u64,
}

impl Loop {
    /// Runs until something ends it; whatever that is, the device is stopped then.
    pub fn run(mut self, device: &SharedDevice) -> End {
        let shared = Arc::clone(&self.shared);
        let outcome = catch_unwind(AssertUnwindSafe(|| self.drive(device)));
        // Where the supervisor has it already, it stops it.
        device.stop();
        shared.haptic_ended();
        outcome.unwrap_or_else(|panic| End::HapticPanicked(message(panic.as_ref())))
    }

    fn drive(&mut self, device: &SharedDevice) -> End {
        let pacing = match device.claim() {
            Some(device) => device.capabilities().pacing,
            None => return End::HapticFrozen,
        };
        match pacing {
            // A device that answers each write with a sample has it ready by the next deadline; faster ticks than the simulation's would make
            // the body's time go faster.
            Pacing::Polled | Pacing::Exchange => self.polled(device),
            Pacing::Callback => self.served(device),
        }
    }

    /// By our own clock.
    fn polled(&mut self, device: &SharedDevice) -> End {
        let mut metronome = Metronome::new(self.epoch_ns, self.period_ns, self.spin);
        loop {
            let beat = metronome.wait();
            if let Some(end) = self.wanted_end() {
                return end;
            }
            let time = beat.index as f64 * self.settings.time_step;
            if self.is_over(time) {
                return End::Elapsed;
            }
            if let Err(end) = self.beat(device, &beat, time) {
                return end;
            }
            if self.bare
                && let Some(late) = metronome.wait_between()
            {
                self.shared.telemetry.bare_lateness.record(late);
            }
        }
    }

    /// One period of a polled device.
    fn beat(&mut self, device: &SharedDevice, beat: &Beat, time: f64) -> Result<(), End> {
        if beat.index > 1 {
            let lateness = &self.shared.telemetry.lateness;
            lateness.record(beat.lateness_ns);
        }
        let sample = self.sample(device)?;
        let Beat { started_ns, lateness_ns, missed, .. } = *beat;
        let instant = Instant { time, started_ns, lateness_ns, missed };
        let command = self.round(&sample, &instant);
        self.write(device, &command)
    }

    /// By the device's own thread.
    fn served(&mut self, device: &SharedDevice) -> End {
        let Some(mut device) = device.claim() else { return End::HapticFrozen };
        let mut end = End::Stopped;
        let served = device.serve(&mut |sample| {
            let instant = self.instant();
            if let Some(wanted) = self.wanted_end() {
                end = wanted;
                return None;
            }
            if self.is_over(instant.time) {
                end = End::Elapsed;
                return None;
            }
            if !is_finite(sample) {
                end = End::Device(DeviceFault::Malformed);
                return None;
            }
            Some(self.round(sample, &instant))
        });
        match served {
            Ok(()) => end,
            Err(fault) => End::Device(fault),
        }
    }

    /// The time of a tick that the device set the pace for.
    fn instant(&self) -> Instant {
        let started_ns = clock::now_ns();
        let time = started_ns.saturating_sub(self.epoch_ns) as f64 * 1e-9;
        Instant { time, started_ns, lateness_ns: 0, missed: 0 }
    }

    fn is_over(&self, time: f64) -> bool {
        // Half a step: a duration of n steps has n ticks.
        self.duration.is_some_and(|d| time > d + 0.5 * self.settings.time_step)
    }

    /// Whether someone wants the end; a sign of life besides.
    fn wanted_end(&mut self) -> Option<End> {
        self.shared.pulse_ns.store(clock::now_ns(), Ordering::Relaxed);
        if let Some(hook) = &mut self.hook {
            hook(self.ticks + 1);
        }
        self.shared.requested()
    }

    /// A new sample, or the last one again while the device is late for a bounded time.
    fn sample(&mut self, device: &SharedDevice) -> Result<DeviceSample, End> {
        let Some(mut device) = device.claim() else { return Err(End::HapticFrozen) };
        let now = clock::now_ns();
        match device.read() {
            Ok(sample) if is_finite(&sample) => {
                self.last_fresh_ns = now;
                Ok(sample)
            }
            Ok(_) => Err(End::Device(DeviceFault::Malformed)),
            Err(DeviceFault::Late) if now.saturating_sub(self.last_fresh_ns) <= self.late_limit_ns => {
                Ok(self.last)
            }
            Err(fault) => Err(End::Device(fault)),
        }
    }

    /// Gives the device a command, unless the session is to end.
    pub fn write(&mut self, device: &SharedDevice, command: &DeviceCommand) -> Result<(), End> {
        let Some(mut device) = device.claim() else { return Err(End::HapticFrozen) };
        // Asked while nobody else can have the device: one that was stopped as this thread hung in its tick gets no late force.
        if let Some(end) = self.shared.requested() {
            return Err(end);
        }
        match device.write(command) {
            Ok(Applied::Fully) => Ok(()),
            Ok(applied @ (Applied::Scaled(_) | Applied::Disabled)) => {
                let drives = self.capabilities.drives_force || self.capabilities.drives_torque;
                self.device_off = applied == Applied::Disabled && drives;
                add(&self.shared.telemetry.limited_by_device, 1);
                Ok(())
            }
            // The loop notices in its next read when it does not answer for good.
            Err(DeviceFault::Late) => Ok(()),
            Err(fault) => Err(End::Device(fault)),
        }
    }

    /// One tick: newest contacts, next command, tick, and what others are told of it.
    fn round(&mut self, sample: &DeviceSample, instant: &Instant) -> DeviceCommand {
        self.ticks += 1;
        let command = self.ends.next_command();
        match &command {
            Some(Command::Stop) => self.shared.stop(),
            Some(command) => apply(&mut self.settings, &mut self.haptic, command),
            None => {}
        }
        let repeated = self.ticks > 1 && sample.time == self.last.time;
        if repeated {
            add(&self.shared.telemetry.repeated, 1);
        } else {
            self.last_time = instant.time;
        }
        self.last = *sample;
        let off = std::mem::take(&mut self.device_off);
        if off {
            self.haptic.interrupted();
        }
        let sample = DeviceSample { time: self.last_time, ..*sample };
        let found: &Found = self.ends.newest_contacts();
        let mut result = tick(&self.settings, &self.haptic, &sample, &found.snapshot, instant.time);
        let (contacts_of, counts) = (found.of_tick, (found.snapshot.contacts(), found.snapshot.clusters()));
        self.haptic = result.after;
        let bits = [
            (Flags::SAMPLE_REPEATED, repeated),
            (Flags::DEADLINE_MISSED, instant.missed > 0),
            (Flags::DEVICE_OFF, off),
        ];
        for (bit, set) in bits {
            if set {
                result.flags = result.flags.with(bit);
            }
        }
        self.ends.publish_state(&Seen {
            of_tick: self.ticks,
            time: instant.time,
            state: result.after.state,
            handle: result.handle,
            body: self.settings.body,
            law: self.haptic.grip.contact_law(&self.settings.contact_law),
            model: self.settings.contact_model,
            next_ns: instant.started_ns.saturating_sub(instant.lateness_ns) + self.period_ns + SETTLE_NS,
        });
        let record = TickRecord {
            tick: self.ticks,
            time: instant.time,
            sample,
            command,
            result,
            contacts_of,
            counts,
            lateness_ns: instant.lateness_ns,
            compute_ns: clock::now_ns().saturating_sub(instant.started_ns),
            missed: instant.missed,
        };
        self.tell(&record, instant);
        result.command
    }

    /// A round outside of a running loop.
    #[cfg(test)]
    pub fn round_at(&mut self, sample: &DeviceSample, time: f64) -> DeviceCommand {
        let sample = DeviceSample { time, ..*sample };
        let instant = Instant { time, started_ns: clock::now_ns(), lateness_ns: 0, missed: 0 };
        self.round(&sample, &instant)
    }

    /// Histograms, counts and the record of a tick.
    fn tell(&mut self, record: &TickRecord, instant: &Instant) {
        let telemetry = &self.shared.telemetry;
        telemetry.left_out(&undeliverable(&self.capabilities, &record.result.wanted));
        if self.last_start_ns > 0 {
            telemetry.period.record(instant.started_ns.saturating_sub(self.last_start_ns));
        }
        self.last_start_ns = instant.started_ns;
        telemetry.compute.record(record.compute_ns);
        telemetry.contact_age.record((record.result.contact_age.max(0.0) * 1e9) as u64);
        add(&telemetry.ticks, 1);
        add(&telemetry.missed, instant.missed);
        if !self.ends.publish_record(record) {
            add(&telemetry.lost, 1);
        }
    }
}

fn is_finite(sample: &DeviceSample) -> bool {
    let finite = |v: &nalgebra::Vector3<f64>| v.iter().all(|c| c.is_finite());
    finite(&sample.position)
        && finite(&sample.linear_velocity)
        && finite(&sample.angular_velocity)
        && sample.orientation.coords.iter().all(|c| c.is_finite())
        && sample.time.is_finite()
}
