//! A long session: whether it leaks memory, and whether anything drifts.

use crate::commands::faults::reason;
use crate::progress;
use anyhow::{Result, bail};
use hapteron::scene::Scene;
use hapteron::scenes;
use hapteron::session::real_time::{
    RealTime, RealTimeOptions, SceneDevice, TickRecord, Told, clock,
    system::{allocated_bytes, resident_bytes},
};
use serde_json::json;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

/// More growth than this of what is allocated, or where that is not known of what is resident, after the first cycle is a leak, bytes.
const LEAK: [f64; 2] = [0.25e6, 4.0e6];
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

    fn growth(self, since: Self) -> Growth {
        let difference = |now: u64, then: u64| now as f64 - then as f64;
        Growth {
            allocated: self.allocated.zip(since.allocated).map(|(now, then)| difference(now, then)),
            resident: difference(self.resident, since.resident),
        }
    }
}

/// Bytes.
struct Growth {
    allocated: Option<f64>,
    resident: f64,
}

impl Growth {
    fn is_leak(&self) -> bool {
        self.allocated.map_or(self.resident > LEAK[1], |growth| growth > LEAK[0])
    }
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
    let started = clock::now_ns();
    let mut cycles: Vec<Cycle> = Vec::with_capacity((seconds / cycle_time) as usize + 2);
    let mut last_time = 0.0;
    let mut fault: Option<(f64, String)> = None;
    let mut seen_at = started;
    let bar = progress::bar(seconds as u64, "soak");
    // After a fault there is no force, and nothing to be compared.
    while !running.is_over() && !progress::interrupted() && fault.is_none() {
        std::thread::sleep(Duration::from_millis(50));
        running.drain(&mut |told| {
            if let Told::Tick(record) = told {
                let index = (record.time / cycle_time) as usize;
                while cycles.len() <= index {
                    cycles.push(Cycle::default());
                    if let Some(cycle) = cycles.last_mut() {
                        cycle.memory = Memory::now();
                    }
                }
                cycles[index].add(record);
                if record.result.flags.no_force() && fault.is_none() {
                    fault = Some((record.time, reason(record)));
                }
                last_time = record.time;
            }
        });
        seen_at = clock::now_ns();
        bar.set_position(last_time as u64);
    }
    bar.finish_and_clear();
    let finished = running.stop();
    if !finished.end.is_regular() {
        bail!("the session ended early: {}", finished.end);
    }
    if let Some((time, reason)) = fault {
        let timing = finished.timing;
        bail!(
            "no force since {time:.3} s: {reason}; {} deadlines missed until then, contacts up to {:.0} ms old",
            timing.missed,
            timing.contact_age.greatest_ns as f64 * 1e-6
        );
    }
    // Whole cycles only; the first one warms up.
    cycles.truncate((last_time / cycle_time + 0.01) as usize);
    if cycles.len() < 3 {
        bail!("stopped before the third cycle; nothing to compare");
    }
    let (early, late) = (cycles[1], cycles[cycles.len() - 1]);
    let growth = late.memory.growth(early.memory);
    let force_drift = late.mean_force() / early.mean_force() - 1.0;
    let clock_drift = (seen_at - started) as f64 * 1e-9 - last_time;
    let good = !growth.is_leak() && force_drift.abs() < DRIFT && clock_drift.abs() < CLOCK_DRIFT;
    let mean_us = |total: u64, c: &Cycle| total as f64 * 1e-3 / c.ticks.max(1) as f64;
    if json {
        let value = json!({
            "seconds": last_time,
            "cycles": cycles.len(),
            "allocated_by_cycle": cycles.iter().map(|c| c.memory.allocated).collect::<Vec<_>>(),
            "allocated_growth_bytes": growth.allocated,
            "resident_by_cycle": cycles.iter().map(|c| c.memory.resident).collect::<Vec<_>>(),
            "resident_growth_bytes": growth.resident,
            "mean_force_second_cycle": early.mean_force(),
            "mean_force_last_cycle": late.mean_force(),
            "force_drift": force_drift,
            "clock_drift_s": clock_drift,
            "missed": finished.timing.missed,
            "records_lost": finished.timing.lost,
            "within_50_us": finished.timing.lateness.share_up_to(50_000),
            "lateness_p99_9_ns": finished.timing.lateness.quantile_ns(0.999),
            "good": good,
        });
        writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&value)?)?;
    } else {
        let mut out = std::io::stdout().lock();
        writeln!(
            out,
            "{last_time:.1} s, {} cycles, {} deadlines missed, {} records lost; {:.3} % of the ticks at most 50 us late, 99.9 % {:.1} us",
            cycles.len(),
            finished.timing.missed,
            finished.timing.lost,
            finished.timing.lateness.share_up_to(50_000) * 100.0,
            finished.timing.lateness.quantile_ns(0.999) as f64 * 1e-3
        )?;
        let mib = |bytes: u64| bytes as f64 / 1_048_576.0;
        let (first, last) = (early.memory, late.memory);
        if let (Some(then), Some(now), Some(growth)) = (first.allocated, last.allocated, growth.allocated) {
            let (then, now, growth) = (mib(then), mib(now), growth / 1024.0);
            writeln!(
                out,
                "  allocated {then:.2} MiB after the first cycle, {now:.2} MiB before the last: {growth:+.1} KiB"
            )?;
        }
        writeln!(
            out,
            "  in RAM {:.2} MiB and then {:.2} MiB: {:+.0} KiB",
            mib(first.resident),
            mib(last.resident),
            growth.resident / 1024.0
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
        writeln!(
            out,
            "  a tick computes for {:.1} us and then {:.1} us; is late by {:.2} us and then {:.2} us (means)",
            mean_us(early.compute_ns, &early),
            mean_us(late.compute_ns, &late),
            mean_us(early.late_ns, &early),
            mean_us(late.late_ns, &late)
        )?;
        writeln!(
            out,
            "  the ticks' clock is {:+.1} ms from the machine's; {}",
            -clock_drift * 1e3,
            if good { "no leak, no drift" } else { "NOT GOOD" }
        )?;
    }
    Ok(if good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
