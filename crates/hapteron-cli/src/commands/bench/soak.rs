//! A long session: whether it leaks memory, and whether anything drifts.

use crate::commands::faults::reason;
use crate::progress;
use anyhow::{Result, bail};
use hapteron::scene::Scene;
use hapteron::scenes;
use hapteron::session::real_time::{
    ON_TIME_NS, RealTime, RealTimeOptions, Running, SceneDevice, TickRecord, Timing, Told, clock,
    system::{allocated_bytes, resident_bytes},
};
use serde_json::{Value, json};
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

/// What is allocated grows by more than this from cycle to cycle, in half of them at least: a leak, bytes. Lists that grow for once, as for the most
/// contacts so far, are none.
const LEAK: f64 = 256.0;
/// More than this from the first cycle to the last is a leak whenever it came, bytes.
const MOST_GROWTH: f64 = 4.0e6;
/// More change than this of what each cycle of the motion repeats is a drift, as a share.
const DRIFT: f64 = 0.1;
/// The clock of the ticks may be this far from the machine's at the end, seconds: a look every 50 ms, and the start of the threads.
const CLOCK_DRIFT: f64 = 0.1;

/// One cycle of the motion.
#[derive(Clone, Copy, Default)]
struct Cycle {
    ticks: u64,
    force_sum: f64,
    greatest_force: f64,
    compute_ns: u64,
    late_ns: u64,
    /// At its beginning.
    memory: Memory,
}

impl Cycle {
    fn add(&mut self, record: &TickRecord) {
        let force = record.result.command.force.norm();
        self.ticks += 1;
        self.force_sum += force;
        self.greatest_force = self.greatest_force.max(force);
        self.compute_ns += record.compute_ns;
        self.late_ns += record.lateness_ns;
    }

    fn mean_force(&self) -> f64 {
        self.force_sum / self.ticks.max(1) as f64
    }
}

/// Bytes.
#[derive(Clone, Copy, Default)]
struct Memory {
    allocated: Option<u64>,
    resident: u64,
}

impl Memory {
    fn now() -> Self {
        Self { allocated: allocated_bytes(), resident: resident_bytes().unwrap_or(0) }
    }

    /// What is compared: where what is allocated is not known, what is resident.
    fn bytes(self) -> f64 {
        self.allocated.unwrap_or(self.resident) as f64
    }
}

/// Growth of memory, bytes.
struct Growth {
    /// Median of those from cycle to cycle.
    a_cycle: f64,
    /// From the second cycle's beginning to the last one's.
    whole: f64,
}

impl Growth {
    /// `memory` at the beginning of each cycle.
    fn of(memory: &[f64]) -> Self {
        let mut steps: Vec<f64> = memory.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_unstable_by(f64::total_cmp);
        let whole = memory.last().zip(memory.first()).map_or(0.0, |(last, first)| last - first);
        Self { a_cycle: steps.get(steps.len() / 2).copied().unwrap_or(0.0), whole }
    }

    fn is_leak(&self) -> bool {
        self.a_cycle > LEAK || self.whole > MOST_GROWTH
    }
}

/// A session as it is followed.
#[derive(Default)]
struct Followed {
    cycles: Vec<Cycle>,
    last_time: f64,
    /// When, and why.
    fault: Option<(f64, String)>,
    /// How far the clock of the ticks was behind the machine's, seconds.
    clock_drift: f64,
}

impl Followed {
    fn take(&mut self, record: &TickRecord, cycle_time: f64) {
        let index = (record.time / cycle_time) as usize;
        while self.cycles.len() <= index {
            self.cycles.push(Cycle { memory: Memory::now(), ..Cycle::default() });
        }
        self.cycles[index].add(record);
        if record.result.flags.no_force() && self.fault.is_none() {
            self.fault = Some((record.time, reason(record)));
        }
        self.last_time = record.time;
    }
}

/// Follows a session to its end, Ctrl-C, or a fault: then there is no force, and nothing to be compared.
fn follow(running: &mut Running, seconds: f64, cycle_time: f64) -> Followed {
    let started = clock::now_ns();
    let cycles = Vec::with_capacity((seconds / cycle_time) as usize + 2);
    let mut followed = Followed { cycles, ..Followed::default() };
    let bar = progress::bar(seconds as u64, "soak");
    while !running.is_over() && !progress::interrupted() && followed.fault.is_none() {
        std::thread::sleep(Duration::from_millis(50));
        running.drain(&mut |told| {
            if let Told::Tick(record) = told {
                followed.take(record, cycle_time);
            }
        });
        followed.clock_drift = (clock::now_ns() - started) as f64 * 1e-9 - followed.last_time;
        bar.set_position(followed.last_time as u64);
    }
    bar.finish_and_clear();
    followed
}

/// Runs the demonstration again and again for some seconds; fails when memory grows or anything drifts.
pub fn soak(seconds: f64, json: bool) -> Result<ExitCode> {
    progress::catch_interrupt();
    let scene = Arc::new(Scene::from_file(scenes::demo())?);
    let cycle_time = scene.duration();
    if seconds < 3.0 * cycle_time {
        bail!(
            "--soak {seconds}: the motion takes {cycle_time} s and is compared from cycle to cycle; give at least {}",
            3.0 * cycle_time
        );
    }
    let device = SceneDevice::new(Arc::clone(&scene), true)?;
    let options = RealTimeOptions { duration: Some(seconds), attach: false, ..RealTimeOptions::of(&scene) };
    let mut running = RealTime::start(Arc::clone(&scene), Box::new(device), options)?;
    let mut followed = follow(&mut running, seconds, cycle_time);
    let finished = running.stop();
    if !finished.end.is_regular() {
        bail!("the session ended early: {}", finished.end);
    }
    let timing = finished.timing;
    if let Some((time, reason)) = followed.fault {
        bail!(
            "no force since {time:.3} s: {reason}; {} deadlines missed until then, contacts up to {:.0} ms old",
            timing.missed,
            timing.contact_age.greatest_ns as f64 * 1e-6
        );
    }
    // Whole cycles only; the first one warms up.
    followed.cycles.truncate((followed.last_time / cycle_time + 0.01) as usize);
    if followed.cycles.len() < 3 {
        bail!("stopped before the third cycle; nothing to compare");
    }
    let verdict = Verdict::of(&followed);
    if json {
        let value = as_json(&followed, &verdict, &timing);
        writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&value)?)?;
    } else {
        print(&followed, &verdict, &timing)?;
    }
    Ok(if verdict.good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// What is compared: the second cycle and the last.
struct Verdict {
    early: Cycle,
    late: Cycle,
    growth: Growth,
    /// As a share.
    force_drift: f64,
    good: bool,
}

impl Verdict {
    fn of(followed: &Followed) -> Self {
        let cycles = &followed.cycles;
        let (early, late) = (cycles[1], cycles[cycles.len() - 1]);
        let memory: Vec<f64> = cycles.iter().skip(1).map(|c| c.memory.bytes()).collect();
        let growth = Growth::of(&memory);
        let force_drift = late.mean_force() / early.mean_force() - 1.0;
        let good = !growth.is_leak() && force_drift.abs() < DRIFT && followed.clock_drift.abs() < CLOCK_DRIFT;
        Self { early, late, growth, force_drift, good }
    }
}

fn as_json(followed: &Followed, verdict: &Verdict, timing: &Timing) -> Value {
    let cycles = &followed.cycles;
    json!({
        "seconds": followed.last_time,
        "cycles": cycles.len(),
        "allocated_by_cycle": cycles.iter().map(|c| c.memory.allocated).collect::<Vec<_>>(),
        "resident_by_cycle": cycles.iter().map(|c| c.memory.resident).collect::<Vec<_>>(),
        "growth_a_cycle_bytes": verdict.growth.a_cycle,
        "growth_bytes": verdict.growth.whole,
        "mean_force_second_cycle": verdict.early.mean_force(),
        "mean_force_last_cycle": verdict.late.mean_force(),
        "force_drift": verdict.force_drift,
        "clock_drift_s": followed.clock_drift,
        "missed": timing.missed,
        "records_lost": timing.lost,
        "within_50_us": timing.lateness.share_up_to(ON_TIME_NS),
        "lateness_p99_9_ns": timing.lateness.quantile_ns(0.999),
        "good": verdict.good,
    })
}

fn print(followed: &Followed, verdict: &Verdict, timing: &Timing) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let Verdict { early, late, growth, force_drift, good } = verdict;
    writeln!(
        out,
        "{:.1} s, {} cycles, {} deadlines missed, {} records lost; {:.3} % of the ticks at most 50 us late, 99.9 % {:.1} us",
        followed.last_time,
        followed.cycles.len(),
        timing.missed,
        timing.lost,
        timing.lateness.share_up_to(ON_TIME_NS) * 100.0,
        timing.lateness.quantile_ns(0.999) as f64 * 1e-3
    )?;
    let mib = |bytes: u64| bytes as f64 / 1_048_576.0;
    if let (Some(then), Some(now)) = (early.memory.allocated, late.memory.allocated) {
        write!(
            out,
            "  allocated {:.2} MiB after the first cycle, {:.2} MiB before the last;",
            mib(then),
            mib(now)
        )?;
    }
    writeln!(
        out,
        "  in RAM {:.2} and {:.2} MiB; grown by {:.0} bytes a cycle (median), {:+.1} KiB in all",
        mib(early.memory.resident),
        mib(late.memory.resident),
        growth.a_cycle,
        growth.whole / 1024.0
    )?;
    writeln!(
        out,
        "  mean force {:.4} N in the second cycle, {:.4} N in the last: {:+.2} %; greatest {:.3} and {:.3} N",
        early.mean_force(),
        late.mean_force(),
        force_drift * 100.0,
        early.greatest_force,
        late.greatest_force
    )?;
    let mean_us = |total: u64, c: &Cycle| total as f64 * 1e-3 / c.ticks.max(1) as f64;
    writeln!(
        out,
        "  a tick computes for {:.1} us and then {:.1} us; is late by {:.2} us and then {:.2} us (means)",
        mean_us(early.compute_ns, early),
        mean_us(late.compute_ns, late),
        mean_us(early.late_ns, early),
        mean_us(late.late_ns, late)
    )?;
    writeln!(
        out,
        "  the ticks' clock is {:+.1} ms from the machine's; {}",
        -followed.clock_drift * 1e3,
        if *good { "no leak, no drift" } else { "NOT GOOD" }
    )?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a leak that is let through, and a list that grew for once taken for one.
    #[test]
    fn what_grows_all_the_time_is_a_leak() {
        let leaking: Vec<f64> = (0..60).map(|i| 9e7 + 300.0 * f64::from(i)).collect();
        assert!(Growth::of(&leaking).is_leak());
        // As measured in ten minutes: two lists grew.
        let lists: Vec<f64> = (0..60)
            .map(|i| {
                if i < 30 {
                    9e7
                } else if i < 59 {
                    9.01e7
                } else {
                    9.03e7
                }
            })
            .collect();
        let growth = Growth::of(&lists);
        assert!(!growth.is_leak() && growth.a_cycle == 0.0 && growth.whole == 3e5);
        let lists: Vec<f64> = (0..60).map(|i| if i < 30 { 9e7 } else { 9.5e7 }).collect();
        assert!(Growth::of(&lists).is_leak());
    }
}
