//! The map of docs/stability.md: grips, couplings, masses and walls, and the same walls rendered without a body.
//!
//! `cargo test --release -p hapteron --test closed_loop grip_map -- --nocapture` prints it.

use super::rig::{DT, Rig, Tool, at, bilateral, floor, premium};
use hapteron::device::guard::{Guard, GuardSettings};
use hapteron::device::simulated::{SimulatedDevice, SimulatedSettings};
use hapteron::device::{Device, DeviceCommand, DeviceSample, Grip};
use nalgebra::Vector3;

const COUPLINGS: [f64; 3] = [200.0, 500.0, 1000.0];
const MASSES: [f64; 3] = [0.001, 0.01, 0.1];
const WALLS: [f64; 3] = [2e3, 5e3, 10e3];
const DAMPING: f64 = 4.0;
/// A force that swings by more than this at the end has not come to rest, N rms.
const AT_REST: f64 = 0.05;

/// A Premium with one sample of delay and its encoders, but without Coulomb friction, which hides instabilities.
fn device(grip: Grip) -> SimulatedSettings {
    let mut device = premium(grip.parameters());
    assert!(device.delay == 1 && device.model.resolution > 0.0);
    device.model.friction = 0.0;
    device.model.angular_friction = 0.0;
    device
}

fn guard(device: &SimulatedSettings) -> Guard {
    let usual = GuardSettings::for_device(&device.model.capabilities(), DT);
    Guard::new(GuardSettings { delay: device.delay, ramp_time: DT, ..usual }).unwrap()
}

/// Root mean square about the mean of what comes after 3 s of 4, and whether a fault ended it.
#[derive(Default)]
struct Rest {
    sum: f64,
    squares: f64,
    n: f64,
}

impl Rest {
    fn take(&mut self, time: f64, force: f64) {
        if time > 3.0 {
            (self.sum, self.squares, self.n) = (self.sum + force, self.squares + force * force, self.n + 1.0);
        }
    }

    fn rms(&self) -> f64 {
        let mean = self.sum / self.n;
        (self.squares / self.n - mean * mean).max(0.0).sqrt()
    }
}

/// Held at a wall on both sides (or, held by a hand, pushed on a floor with 1.2 N) and struck: the swing at the end, infinite after a fault.
fn swing(grip: Grip, tool: Tool, wall: f64, pushed: bool) -> f64 {
    let device = device(grip);
    let half_critical = (wall * tool.mass).sqrt();
    let planes = if pushed { floor(wall, tool.mass) } else { bilateral(wall, half_critical) };
    let depth =
        if pushed { 1.2 / grip.parameters().stiffness + 1.2 / tool.stiffness + 1.2 / wall } else { 0.0 };
    let mut rig = Rig::new(tool, device, planes, 0.0).guarded(guard(&device));
    let mut rest = Rest::default();
    while rig.time() < 4.0 {
        if (rig.time() - 1.0).abs() < 0.5 * DT {
            // The body is struck: 0.2 m/s.
            rig.haptic.state.linear_momentum.z += 0.2 * tool.mass;
        }
        let out = rig.advance(-depth * (rig.time() / 0.5).min(1.0), 0.0);
        if out.flags.no_force() {
            return f64::INFINITY;
        }
        rest.take(rig.time(), out.command.force.z);
    }
    rest.rms()
}

/// The same for a wall on both sides that is rendered as -(k x + b v).
fn direct_swing(grip: Grip, k: f64, b: f64) -> f64 {
    let settings = device(grip);
    let mut guard = guard(&settings);
    let mut device = SimulatedDevice::new(settings, &at(0.0)).unwrap();
    device.set_force_enabled(true).unwrap();
    let mut rest = Rest::default();
    for i in 1..=4000u32 {
        let time = f64::from(i) * DT;
        device.set_goal(&DeviceSample { time, ..at(0.0) });
        device.advance(DT);
        let sample = device.read().unwrap();
        let blow = if (1000..1010).contains(&i) { 1.0 } else { 0.0 };
        let force = blow - k * sample.position.z - b * sample.linear_velocity.z;
        let command = DeviceCommand { force: Vector3::z() * force, torque: Vector3::zeros() };
        let out = guard.pass(&hapteron::device::guard::GuardInput {
            command,
            sample,
            time,
            contact_age: 0.0,
            sample_age: 0.0,
            simulation_fault: false,
        });
        if guard.fault().is_some() {
            return f64::INFINITY;
        }
        rest.take(time, out.command.force.z);
        let _ = device.write(&out.command);
    }
    rest.rms()
}

/// Would catch any loss of stability with a body of 1 to 100 g, and a comparison that does not show what the body is good for.
#[test]
fn every_grip_is_stable_with_a_body() {
    println!("| grip | k_c, N/m | m, g | swing at walls of 2 / 5 / 10 kN/m, mN rms |\n|---|---|---|---|");
    for grip in Grip::ALL {
        for stiffness in COUPLINGS {
            for mass in MASSES {
                let tool = Tool { mass, stiffness, damping: DAMPING };
                let swings = WALLS.map(|wall| {
                    let struck = swing(grip, tool, wall, false);
                    if grip == Grip::Released { struck } else { struck.max(swing(grip, tool, wall, true)) }
                });
                let text: Vec<String> = swings.iter().map(|s| format!("{:.1}", s * 1e3)).collect();
                println!("| {grip:?} | {stiffness} | {} | {} |", mass * 1e3, text.join(" / "));
                assert!(swings.iter().all(|&s| s < AT_REST), "{grip:?} {stiffness} {mass}: {swings:?}");
            }
        }
    }
    println!("\n| grip | B, N s/m | direct, 2 / 5 / 10 kN/m |\n|---|---|---|");
    let mut unstable = 0;
    for grip in Grip::ALL {
        for b in [0.0, DAMPING] {
            let swings = WALLS.map(|k| direct_swing(grip, k, b));
            let word = |s: f64| if s < AT_REST { "stable".to_owned() } else { "unstable".to_owned() };
            println!("| {grip:?} | {b} | {} |", swings.map(word).join(" / "));
            unstable += swings.iter().filter(|s| !(**s < AT_REST)).count();
        }
    }
    assert!(unstable >= 12, "direct rendering was unstable in {unstable} of 24 only");
}
