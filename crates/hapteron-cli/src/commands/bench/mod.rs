//! `hapteron bench`: this machine's figures.

mod soak;
#[cfg(feature = "window")]
mod window;

use crate::arguments::Bench;
use crate::progress::{self, say};
use crate::report::{self, distribution_json};
use anyhow::{Result, bail};
use hapteron::dynamics::{ContactForce, ContactPlane, Method, Problem, step};
use hapteron::scene::Scene;
use hapteron::scenes;
use hapteron::session::real_time::{
    Distribution, ON_TIME_NS, RealTime, RealTimeOptions, SceneDevice, Timing, bare_loop,
};
use hapteron::session::{ContactPass, ContactSnapshot, VirtualTime, handle_speed};
use serde_json::{Value, json};
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Numbers of contact planes whose step is timed.
const PLANES: [usize; 6] = [0, 1, 10, 100, 500, 1000];
/// A step's time is the median of so many means of so many.
const ROUNDS: usize = 31;

/// Runs the command.
pub fn bench(arguments: &Bench) -> Result<ExitCode> {
    if let Some(seconds) = arguments.soak {
        return soak::soak(seconds, arguments.json);
    }
    if arguments.window {
        return window(arguments);
    }
    let seconds = arguments.seconds;
    progress::catch_interrupt();
    let scene = Arc::new(Scene::from_file(scenes::demo())?);
    say!("step times ...");
    let steps = steps(&scene)?;
    say!("query times ...");
    let queries = queries(&scene)?;
    say!("a loop that does nothing, {seconds} s ...");
    let options = RealTimeOptions::of(&scene);
    let bare = bare_loop(scene.time_step, seconds, options.priority, options.spin)?;
    say!("a session, {seconds} s ...");
    let timing = session(&scene, seconds)?;
    if arguments.json {
        let value = json!({
            "cores": std::thread::available_parallelism().map_or(0, usize::from),
            "step_us_by_planes": steps.iter().map(|s| json!([s.0, s.1])).collect::<Vec<_>>(),
            "queries": queries.json(),
            "bare_lateness_ns": distribution_json(&bare.lateness),
            "session": {
                "lateness_ns": distribution_json(&timing.lateness),
                "bare_between_ticks_ns": distribution_json(&timing.bare_lateness),
                "compute_ns": distribution_json(&timing.compute),
                "pass_ns": distribution_json(&timing.pass),
                "contact_age_ns": distribution_json(&timing.contact_age),
                "missed": timing.missed,
                "lateness_99_9_ratio": report::ratio_json(&timing),
            },
            "priority": bare.priority.to_string(),
        });
        writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&value)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut out = std::io::stdout().lock();
    writeln!(out, "one step of Backward Euler, by contact planes")?;
    for (planes, us) in &steps {
        writeln!(out, "  {planes:5}  {us:9.2} us")?;
    }
    writeln!(out, "contact pass, jaws of 47,340 and 40,180 triangles, along the demonstration's motion")?;
    queries.print(&mut out)?;
    writeln!(out, "lateness at {:.0} Hz ({})", 1.0 / scene.time_step, bare.priority)?;
    lateness(&mut out, "a bare loop alone", &bare.lateness, bare.missed)?;
    lateness(&mut out, "a session", &timing.lateness, timing.missed)?;
    lateness(&mut out, "a bare loop between its ticks", &timing.bare_lateness, 0)?;
    if let Some(ratio) = timing.lateness_ratio() {
        writeln!(out, "  99.9 % of the session's lateness is {ratio}")?;
    }
    writeln!(
        out,
        "  a tick computes for {:.1} us, 99 %: {:.1} us",
        us(timing.compute.quantile_ns(0.5)),
        us(timing.compute.quantile_ns(0.99))
    )?;
    Ok(ExitCode::SUCCESS)
}

/// Whether an open window makes ticks later.
#[cfg(feature = "window")]
fn window(arguments: &Bench) -> Result<ExitCode> {
    window::window(arguments.seconds, arguments.json)
}

/// Whether an open window makes ticks later.
#[cfg(not(feature = "window"))]
fn window(_: &Bench) -> Result<ExitCode> {
    bail!("{}", super::live::NO_WINDOW)
}

fn us(ns: u64) -> f64 {
    ns as f64 * 1e-3
}

fn lateness(out: &mut impl Write, what: &str, d: &Distribution, missed: u64) -> std::io::Result<()> {
    let [low, high] = d.quantile_between_ns(0.999);
    writeln!(
        out,
        "  {what:30} within 50 us {:6.2} %   99 % {:7.1} us   99.9 % {:7.1} us ({:.1} to {:.1})   greatest {:7.1} us   missed {missed} of {}",
        d.share_up_to(ON_TIME_NS) * 100.0,
        us(d.quantile_ns(0.99)),
        us(d.quantile_ns(0.999)),
        us(low),
        us(high),
        us(d.greatest_ns),
        d.count
    )
}

/// Microseconds of a step by number of planes: those of closed jaws, again and again.
fn steps(scene: &Scene) -> Result<Vec<(usize, f64)>> {
    let mut session = VirtualTime::new(scene)?;
    let mut last = session.advance();
    for _ in 0..1600 {
        last = session.advance();
    }
    let found = session.contacts().planes();
    if found.is_empty() {
        bail!("the jaws do not touch");
    }
    let handle = last.handle;
    let state = last.after.state;
    let mut times = Vec::new();
    for count in PLANES {
        let planes: Vec<ContactPlane> = found.iter().cycle().take(count).copied().collect();
        let problem = Problem {
            body: &scene.body,
            coupling: &scene.coupling,
            handle: &handle,
            contact: ContactForce::Planes(&planes),
            gravity: scene.gravity,
        };
        let repeats = 2000 / (1 + count / 20);
        let mut means: Vec<f64> = (0..ROUNDS)
            .map(|_| {
                let started = Instant::now();
                for _ in 0..repeats {
                    std::hint::black_box(step(
                        std::hint::black_box(&problem),
                        std::hint::black_box(&state),
                        scene.time_step,
                        Method::BackwardEuler,
                    ));
                }
                started.elapsed().as_secs_f64() * 1e6 / repeats as f64
            })
            .collect();
        means.sort_unstable_by(f64::total_cmp);
        times.push((count, means[ROUNDS / 2]));
    }
    Ok(times)
}

/// Passes along a motion: contacts found, microseconds.
struct Queries(Vec<(u32, f64)>);

fn queries(scene: &Scene) -> Result<Queries> {
    let mut session = VirtualTime::new(scene)?;
    let mut pass = ContactPass::new(scene);
    let mut snapshot = ContactSnapshot::empty(&scene.body, &scene.start);
    let ticks = (scene.duration() / scene.time_step) as usize;
    let mut all = Vec::with_capacity(ticks);
    for i in 0..ticks {
        let result = session.advance();
        let speed = handle_speed(scene, &result.handle);
        let started = Instant::now();
        pass.run(scene, &result.after.state, speed, i as f64 * scene.time_step, &mut snapshot);
        all.push((snapshot.contacts(), started.elapsed().as_secs_f64() * 1e6));
        if progress::interrupted() {
            bail!("stopped by Ctrl-C");
        }
    }
    Ok(Queries(all))
}

impl Queries {
    /// Groups by number of contacts: name, passes, median, 99 %, greatest microseconds.
    fn groups(&self) -> Vec<(&'static str, usize, [f64; 3])> {
        let bounds = [
            ("apart", 0, 0),
            ("1 to 10", 1, 10),
            ("11 to 100", 11, 100),
            ("101 to 300", 101, 300),
            ("more than 300", 301, u32::MAX),
        ];
        let group = |&(name, least, most): &(&'static str, u32, u32)| {
            let mut times: Vec<f64> =
                self.0.iter().filter(|q| (least..=most).contains(&q.0)).map(|q| q.1).collect();
            times.sort_unstable_by(f64::total_cmp);
            let at = |share: f64| times[((times.len() as f64 * share) as usize).min(times.len() - 1)];
            (!times.is_empty()).then(|| (name, times.len(), [at(0.5), at(0.99), at(1.0)]))
        };
        bounds.iter().filter_map(group).collect()
    }

    fn print(&self, out: &mut impl Write) -> std::io::Result<()> {
        for (name, count, [median, most, greatest]) in self.groups() {
            writeln!(
                out,
                "  contacts {name:14} {count:6} passes   median {median:7.0} us   99 % {most:7.0} us   greatest {greatest:7.0} us"
            )?;
        }
        Ok(())
    }

    fn json(&self) -> Value {
        let group = |(name, count, [median, p99, greatest]): (&str, usize, [f64; 3])| json!({"contacts": name, "passes": count, "median_us": median, "p99_us": p99, "greatest_us": greatest});
        self.groups().into_iter().map(group).collect()
    }
}

/// A session with the demonstration's motion.
fn session(scene: &Arc<Scene>, seconds: f64) -> Result<Timing> {
    let device = SceneDevice::new(Arc::clone(scene), true)?;
    let options =
        RealTimeOptions { duration: Some(seconds), bare: true, attach: false, ..RealTimeOptions::of(scene) };
    let mut running = RealTime::start(Arc::clone(scene), Box::new(device), options)?;
    while !running.is_over() && !progress::interrupted() {
        std::thread::sleep(Duration::from_millis(50));
        running.drain(&mut |_| {});
    }
    let finished = running.stop();
    if !finished.end.is_regular() {
        bail!("the session ended early: {}", finished.end);
    }
    Ok(finished.timing)
}
