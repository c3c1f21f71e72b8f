//! Runs in real time: the session, its live line, and the run folder.

use super::faults::{Fault, Watch};
use super::run::{begin, finish};
use crate::arguments::OnFault;
use crate::progress::{self, say};
use crate::report::{self, Digest, Live, Outcome, Time};
use anyhow::{Context, Result, bail};
use hapteron::device::{Device, drivers};
use hapteron::scene::Scene;
use hapteron::session::real_time::{
    Finished, ON_TIME_NS, PassRecord, RealTime, RealTimeOptions, Running, SceneDevice, Spool, Spooled,
    TickRecord, Told, system,
};
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How a run is made.
pub struct Plan {
    /// Seconds; none: as long as the scene's motion, or until Ctrl-C with a real device.
    pub duration: Option<f64>,
    /// Measure a bare loop besides.
    pub bare: bool,
    /// The motion begins anew at its end.
    pub repeat: bool,
    /// The handle follows the scene's motion, whatever device the scene names.
    pub recorded_motion: bool,
    /// What a fault leads to.
    pub on_fault: Option<OnFault>,
}

/// Between two looks at the session.
const LOOK: Duration = Duration::from_millis(20);
/// Between two live lines.
const LINE: Duration = Duration::from_millis(500);

/// Runs a scene in real time and writes the run folder; fails when the run was not stable or ended early.
pub fn run_into(mut scene: Scene, plan: &Plan, folder: &Path) -> Result<ExitCode> {
    let notes = begin(&scene, folder)?;
    progress::catch_interrupt();
    system::ignore_suspend();
    let driver = scene.driver().filter(|_| !plan.recorded_motion);
    let real = match driver {
        Some((kind, options)) => Some(drivers::open(kind, &options)?),
        None => None,
    };
    if let Some(device) = &real {
        scene.adopt(device.capabilities())?;
    }
    let scene = Arc::new(scene);
    // A real device is held as long as its user likes; a motion has an end.
    let duration = plan.duration.or_else(|| real.is_none().then(|| scene.duration()));
    let attach = real.is_some();
    let device: Box<dyn Device> = match real {
        Some(device) => device,
        None => Box::new(SceneDevice::new(Arc::clone(&scene), plan.repeat)?),
    };
    let name = device.capabilities().name.clone();
    let options = RealTimeOptions { duration, bare: plan.bare, attach, ..RealTimeOptions::of(&scene) };
    // Before the motors are on: what cannot be recorded is known now.
    let spool = Spool::create(Arc::clone(&scene), folder)?;
    let running = RealTime::start(Arc::clone(&scene), device, options)?;
    say!("haptic thread: {}; memory {}", running.grants().priority, running.grants().memory);
    let (finished, spooled, faults) = follow(running, spool, Watch::new(plan.on_fault));
    if finished.timing.ticks == 0 {
        bail!("the session ended before its first tick: {}", finished.end);
    }
    // Without a duration Ctrl-C is the way to end it.
    let cancelled = progress::interrupted() && duration.is_some();
    let (digest, trouble) = settle(&spooled, cancelled);
    let live = Live {
        end: finished.end.clone(),
        grants: finished.grants,
        timing: finished.timing,
        unrecorded: spooled.lost(),
        trouble: trouble.clone(),
        device: name,
        faults,
    };
    let force_lost = match live.faults.last() {
        Some(Fault { time, reason, rearmed: None }) => Some((*time, reason.clone())),
        _ => None,
    };
    let path = folder.join("timing.json");
    let text = serde_json::to_string_pretty(&report::timing_json(&live))?;
    std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    let outcome = Outcome { scene: &scene, digest, time: Time::Real(Box::new(live)) };
    let told = finish(outcome, duration.unwrap_or_default(), &notes, folder);
    if !finished.end.is_regular() {
        bail!("the session ended early: {}", finished.end);
    }
    if let Some((time, reason)) = force_lost {
        bail!("there was no force from {time:.3} s on: {reason}");
    }
    match trouble {
        Some(trouble) => bail!("{trouble}"),
        // After the session's own end: that nobody reads the summary makes no success of a failure.
        None => told,
    }
}

/// Reads the recording once more, for the depths that are not known yet and for the report. Answers what is wrong with it, too.
fn settle(spooled: &Spooled, cancelled: bool) -> (Digest, Option<String>) {
    let bar = progress::bar(1000, "measuring depths");
    let mut digest = Digest::expecting(usize::try_from(spooled.rows()).unwrap_or(usize::MAX));
    let mut told = |share: f64| {
        bar.set_position((share * 1000.0) as u64);
        true
    };
    let settled = spooled.settle(&mut told, &mut |row, timing| digest.push(row, timing));
    bar.finish_and_clear();
    (digest.greatest_angle, digest.cancelled) = (spooled.greatest_angle(), cancelled);
    let trouble = spooled.trouble().map(str::to_owned);
    (digest, trouble.or(settled.err().map(|e| e.to_string())))
}

/// Watches a session to its end, with a live line.
fn follow(mut running: Running, mut spool: Spool, mut watch: Watch) -> (Finished, Spooled, Vec<Fault>) {
    let mut line = LiveLine::new();
    let mut in_trouble = false;
    while !running.is_over() && !progress::interrupted() {
        std::thread::sleep(LOOK);
        running.drain(&mut |told| match told {
            Told::Tick(tick) => {
                watch.tick(tick);
                line.tick(tick);
                spool.tick(tick);
            }
            Told::Pass(pass) => {
                line.pass(pass);
                spool.pass(pass);
            }
        });
        // A full disk is no reason to take the force out of a hand.
        if let (Some(trouble), false) = (spool.trouble(), in_trouble) {
            say!("\n{trouble}; the session goes on");
            in_trouble = true;
        }
        if watch.react(&mut running) {
            break;
        }
        line.show(&running);
    }
    let finished = running.stop();
    line.end();
    finished.records.iter().for_each(|record| watch.tick(record));
    let spooled = spool.finish(&finished.records, &finished.passes);
    (finished, spooled, watch.into_faults())
}

/// What happens, every half a second, on a terminal.
struct LiveLine {
    shown: bool,
    last: Instant,
    ticks: u64,
    force: f64,
    depth: f64,
}

impl LiveLine {
    fn new() -> Self {
        let shown = std::io::stderr().is_terminal();
        Self { shown, last: Instant::now(), ticks: 0, force: 0.0, depth: f64::NEG_INFINITY }
    }

    fn tick(&mut self, record: &TickRecord) {
        self.ticks += 1;
        self.force = self.force.max(record.result.command.force.norm());
    }

    fn pass(&mut self, record: &PassRecord) {
        self.depth = self.depth.max(-record.min_distance);
    }

    fn show(&mut self, running: &Running) {
        let passed = self.last.elapsed();
        if passed < LINE {
            return;
        }
        if self.shown {
            let rate = self.ticks as f64 / passed.as_secs_f64();
            let depth = if self.depth.is_finite() {
                format!("{:+.3} mm", self.depth * 1e3)
            } else {
                "far".to_owned()
            };
            let timing = running.timing();
            let mut out = std::io::stderr().lock();
            // A terminal that is gone is no reason to leave the session's files as they are.
            let _ = write!(
                out,
                "\r{:7.1} s  {rate:6.0} Hz  force {:6.2} N  depth {depth:>10}  contacts {:.1} ms old  missed {}   ",
                timing.ticks as f64 * running.scene().time_step,
                self.force,
                timing.contact_age.quantile_ns(0.5) as f64 * 1e-6,
                timing.missed
            );
            let _ = out.flush();
        }
        *self = Self { last: Instant::now(), ticks: 0, force: 0.0, depth: f64::NEG_INFINITY, ..*self };
    }

    fn end(&self) {
        if self.shown {
            say!("");
        }
    }
}

/// The summary's lines on timing.
pub fn print_timing(out: &mut impl Write, live: &Live) -> std::io::Result<()> {
    let timing = &live.timing;
    let us = |ns: u64| ns as f64 * 1e-3;
    let late = &timing.lateness;
    writeln!(
        out,
        "  {} ticks, {} deadlines missed; {:.2} % at most 50 us late; lateness 99 % {:.1} us, 99.9 % {:.1} us, greatest {:.1} us",
        timing.ticks,
        timing.missed,
        late.share_up_to(ON_TIME_NS) * 100.0,
        us(late.quantile_ns(0.99)),
        us(late.quantile_ns(0.999)),
        us(late.greatest_ns)
    )?;
    let bare = &timing.bare_lateness;
    if bare.count > 0 {
        writeln!(
            out,
            "  a bare loop between the ticks: {:.2} % at most 50 us late; 99 % {:.1} us, 99.9 % {:.1} us, greatest {:.1} us",
            bare.share_up_to(ON_TIME_NS) * 100.0,
            us(bare.quantile_ns(0.99)),
            us(bare.quantile_ns(0.999)),
            us(bare.greatest_ns)
        )?;
    }
    if let Some(ratio) = timing.lateness_ratio() {
        writeln!(out, "  99.9 % of the ticks' lateness is {ratio}")?;
    }
    writeln!(
        out,
        "  a tick computes for {:.1} us (99 %: {:.1} us); a contact pass takes {:.0} us (99 %: {:.0} us); contacts are {:.1} ms old (99 %: {:.1} ms)",
        us(timing.compute.quantile_ns(0.5)),
        us(timing.compute.quantile_ns(0.99)),
        us(timing.pass.quantile_ns(0.5)),
        us(timing.pass.quantile_ns(0.99)),
        us(timing.contact_age.quantile_ns(0.5)) * 1e-3,
        us(timing.contact_age.quantile_ns(0.99)) * 1e-3
    )?;
    if let Some(text) = report::left_out(live) {
        writeln!(out, "  {text}")?;
    }
    if report::records_lost(live) > 0 {
        writeln!(out, "  {} records were lost: this run cannot be made again", report::records_lost(live))?;
    }
    for fault in &live.faults {
        let since = fault.rearmed.map_or_else(|| "the end".to_owned(), |t| format!("{t:.3} s"));
        writeln!(out, "  no force from {:.3} s to {since}: {}", fault.time, fault.reason)?;
    }
    writeln!(out, "  haptic thread: {}; memory: {}", live.grants.priority, live.grants.memory)
}
