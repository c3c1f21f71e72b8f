//! What a hand would feel: pushes, releases, energy, with friction, encoders, saturation and the guard.

use super::rig::{DT, Rig, Tool, at, bilateral, floor, premium};
use hapteron::device::guard::{Guard, GuardSettings};
use hapteron::device::simulated::SimulatedSettings;
use hapteron::device::{Device, DeviceSample, Grip};
use hapteron::dynamics::State;
use hapteron::session::{ContactSnapshot, HapticState, tick};
use nalgebra::{UnitQuaternion, Vector3};

fn guard(device: &SimulatedSettings) -> Guard {
    Guard::new(GuardSettings::for_device(&device.model.capabilities(), DT)).unwrap()
}

/// Would catch a limit cycle: a hand pushes the body on a wall for 7 s; over the last 5 s the force must not swing by more than 0.05 N rms. G.5 (3).
#[test]
fn a_push_on_a_wall_comes_to_rest() {
    let mut worst = (0.0, String::new());
    for grip in [Grip::Light, Grip::Medium, Grip::Firm] {
        for stiffness in [200.0, 500.0, 1000.0] {
            for mass in [0.001, 0.01, 0.1] {
                for wall in [2e3, 5e3, 10e3] {
                    let device = premium(grip.parameters());
                    let tool = Tool { mass, stiffness, damping: 4.0 };
                    let mut rig = Rig::new(tool, device, floor(wall, mass), 0.01).guarded(guard(&device));
                    let depth = 1.2 / grip.parameters().stiffness + 1.2 / stiffness + 1.2 / wall;
                    let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
                    while rig.time() < 7.0 {
                        // In half a second to where it pushes with 1.2 N, which the motors can hold for ever.
                        let s = (rig.time() / 0.5).min(1.0);
                        let way = 0.01 - s * (0.01 + depth);
                        let out = rig.advance(way, if s < 1.0 { -2.0 * (0.01 + depth) } else { 0.0 });
                        assert!(
                            !out.flags.no_force(),
                            "{grip:?} {stiffness} {mass} {wall} at {}",
                            rig.time()
                        );
                        if rig.time() > 2.0 {
                            let f = out.command.force.z;
                            (sum, squares, n) = (sum + f, squares + f * f, n + 1.0);
                        }
                    }
                    let mean: f64 = sum / n;
                    let rms = (squares / n - mean * mean).max(0.0).sqrt();
                    assert!(mean > 1.0, "{grip:?} pushes with {mean} N only");
                    assert!(rms < 0.05, "{grip:?}, k_c {stiffness}, {mass} kg, wall {wall}: {rms} N rms");
                    if rms > worst.0 {
                        worst = (rms, format!("{grip:?}, k_c {stiffness}, {mass} kg, wall {wall}"));
                    }
                }
            }
        }
    }
    println!("largest swing {:.4} N rms: {}", worst.0, worst.1);
}

/// Would catch a virtual side that makes energy: a trembling hand goes in and out of a wall for a minute; what has gone into the
/// device's port is never less than -1 mJ. G.5 (4).
#[test]
fn no_energy_comes_out_of_the_device_s_port() {
    for grip in [Grip::Light, Grip::Medium, Grip::Firm] {
        let device = SimulatedSettings { tremor: 1e-4, seed: 3, ..premium(grip.parameters()) };
        let tool = Tool { mass: 0.01, stiffness: 500.0, damping: 4.0 };
        let mut rig = Rig::new(tool, device, floor(5e3, 0.01), 0.01).guarded(guard(&device));
        let (mut energy, mut least, mut most) = (0.0f64, 0.0f64, 0.0f64);
        while rig.time() < 60.0 {
            let before = rig.device.position();
            let acting = rig.device.acting();
            let w = std::f64::consts::TAU * 0.7;
            let t = rig.time() + DT;
            let _ = rig.advance(0.01 * (w * t).cos(), -0.01 * w * (w * t).sin());
            energy -= acting.force.dot(&(rig.device.position() - before));
            least = least.min(energy);
            most = most.max(energy);
        }
        println!("{grip:?}: from {:.4} to {:.3} mJ", least * 1e3, most * 1e3);
        assert!(least > -1e-3, "{grip:?}: {} mJ", least * 1e3);
        assert!(most > 1e-3, "the hand must have worked against the wall");
    }
}

/// Would catch a bounce that grows, or a handle that is thrown: the hand lets go while it presses. G.5 (7).
#[test]
fn a_released_handle_settles() {
    for stiffness in [200.0, 500.0] {
        for mass in [0.001, 0.01, 0.1] {
            let device = premium(Grip::Medium.parameters());
            let tool = Tool { mass, stiffness, damping: 4.0 };
            let mut rig = Rig::new(tool, device, floor(5e3, mass), 0.001).guarded(guard(&device));
            while rig.time() < 1.5 {
                let _ = rig.advance((0.001 - 0.03 * rig.time()).max(-0.02), 0.0);
            }
            let pressed = rig.device.acting().force.z;
            assert!(pressed > 1.0, "{pressed} N");
            rig.device.set_hand(Grip::Released.parameters()).unwrap();
            let (mut fastest, mut force_at_end) = (0.0f64, 0.0f64);
            while rig.time() < 4.5 {
                let out = rig.advance(0.0, 0.0);
                assert!(!out.flags.no_force(), "{stiffness} {mass}: {:?}", out.flags);
                fastest = fastest.max(rig.device.read().unwrap().linear_velocity.norm());
                if rig.time() > 3.5 {
                    force_at_end = force_at_end.max(out.command.force.norm());
                }
            }
            println!(
                "k_c {stiffness}, {mass} kg, pressed {pressed:.2} N: up to {fastest:.2} m/s, then {force_at_end:.4} N"
            );
            assert!(fastest < 1.0, "thrown at {fastest} m/s");
            assert!(force_at_end < 0.05, "{force_at_end} N two seconds later");
        }
    }
}

/// Would catch a passivity controller that does nothing, or harms: a coupling that is too stiff for a released handle is unstable
/// without it, and hums at most with it.
#[test]
fn the_passivity_controller_tames_what_would_oscillate() {
    let run = |(delay, damping, stiffness): (usize, f64, f64), passivity: bool, seconds: f64| {
        let mut device = SimulatedSettings { delay, ..premium(Grip::Released.parameters()) };
        // Friction would hide what is unstable.
        device.model.friction = 0.0;
        let limits = GuardSettings {
            passivity,
            delay,
            // The detector would end the run.
            oscillation_force: 1e3,
            oscillation_torque: 1e3,
            max_speed: 1e3,
            ..GuardSettings::for_device(&device.model.capabilities(), DT)
        };
        let tool = Tool { mass: 0.01, stiffness, damping };
        let mut rig = Rig::new(tool, device, bilateral(5e3, 5.0), 0.0).guarded(Guard::new(limits).unwrap());
        let mut late = 0.0f64;
        while rig.time() < seconds {
            if (rig.time() - 0.5).abs() < 0.5 * DT {
                // A blow to the body, once the force is whole: 2 m/s.
                rig.haptic.state.linear_momentum.z = 0.02;
            }
            let out = rig.advance(0.0, 0.0);
            if rig.time() > seconds - 0.5 {
                late = late.max(out.command.force.norm());
            }
        }
        late
    };
    // Delay in samples, b_c, k_c.
    for case in [(0, 0.0, 1000.0), (1, 0.0, 300.0), (1, 1.0, 2000.0), (2, 1.0, 500.0), (2, 1.0, 1000.0)] {
        let (without, with) = (run(case, false, 3.0), run(case, true, 3.0));
        println!("{case:?}: force in the end {without:.3} N without, {with:.3} N with");
        assert!(without > 1.0, "the test needs an oscillation: {without} N");
        assert!(with < 0.35, "{with} N");
    }
}

/// Would catch a hand that feels in free space anything but the body's mass: handle moved to and fro, force by its acceleration. G.5 (8).
#[test]
fn in_free_space_the_hand_feels_the_body_s_mass() {
    let mut worst = 0.0f64;
    for frequency in [0.5, 1.0, 2.0, 5.0] {
        for (mass, stiffness) in
            [0.001, 0.01, 0.1].iter().flat_map(|m| [200.0, 500.0, 1000.0].map(|k| (*m, k)))
        {
            let tool = Tool { mass, stiffness, damping: 4.0 };
            let settings = tool.settings();
            let w = std::f64::consts::TAU * frequency;
            let amplitude = 0.02;
            let zero = Vector3::zeros();
            let start = Vector3::z() * (amplitude * w);
            let state = State::moving(&settings.body, zero, &UnitQuaternion::identity(), &start, &zero);
            let contacts = ContactSnapshot::of_planes(&[], &settings.body, &state, 0.0);
            let mut haptic = HapticState::new(state);
            // Projected on sine and cosine over whole periods, after one second.
            let ticks = (4.0 / DT) as u32;
            let (mut in_phase, mut across) = (0.0, 0.0);
            for i in 1..=ticks {
                let t = f64::from(i) * DT;
                let sample = DeviceSample {
                    time: t,
                    linear_velocity: Vector3::z() * (amplitude * w * (w * t).cos()),
                    ..at(amplitude * (w * t).sin())
                };
                let result = tick(&settings, &haptic, &sample, &contacts, t);
                haptic = result.after;
                if 2 * i > ticks {
                    let force = result.command.force.z * 4.0 / f64::from(ticks);
                    (in_phase, across) = (in_phase + force * (w * t).sin(), across + force * (w * t).cos());
                }
            }
            let felt = f64::hypot(in_phase, across) / (amplitude * w * w);
            // |m (k + b s) / (m s^2 + b s + k)| at s = i w: the mass, but for the coupling's own resonance.
            let (k, b) = (stiffness, tool.damping);
            let expected = mass * f64::hypot(k, b * w) / f64::hypot(k - mass * w * w, b * w);
            assert!(
                (felt / expected - 1.0).abs() < 0.1,
                "{frequency} Hz, {mass} kg, k_c {k}: {felt} kg, expected {expected}"
            );
            // Where the resonance is far, it is the mass.
            if mass * w * w / k < 0.05 {
                worst = worst.max((felt / mass - 1.0).abs());
                assert!((felt / mass - 1.0).abs() < 0.1, "{frequency} Hz, {mass} kg, k_c {k}: {felt} kg");
            }
        }
    }
    println!("the mass felt is within {:.1} % of the body's", worst * 100.0);
}
