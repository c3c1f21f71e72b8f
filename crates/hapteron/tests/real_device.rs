//! A whole session with a driver, against an emulated device: the way of `hapteron run` with `[device] kind`.
#![allow(clippy::unwrap_used)]

mod common;
#[path = "../../hapteron-device/tests/emulated/mod.rs"]
mod emulated;

use common::csv;
use emulated::EmulatedLibrary;
use hapteron::device::{DeviceFault, drivers};
use hapteron::scene::file::{Guard, Method};
use hapteron::scene::{Changes, Scene};
use hapteron::scenes::spoon_in_cup;
use hapteron::session::real_time::{End, RealTime, RealTimeOptions, Recorder, Running, Told};
use hapteron::session::replay;
use hapteron_emulators::{Generation, HaplyService, VrpnServer};
use nalgebra::Vector3;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Starts a session with the device that the scene names.
fn start(mut scene: Scene) -> (Arc<Scene>, Running) {
    let (kind, options) = scene.driver().unwrap();
    let device = drivers::open(kind, &options).unwrap();
    scene.adopt(device.capabilities()).unwrap();
    let scene = Arc::new(scene);
    let options = RealTimeOptions { watchdog: Duration::from_secs(2), ..RealTimeOptions::of(&scene) };
    let running = RealTime::start(Arc::clone(&scene), device, options).unwrap();
    (scene, running)
}

/// The spoon in the cup, for whoever comes with a device.
fn scene(kind: &str, options: &[(&str, toml::Value)]) -> Scene {
    let resolved = Scene::from_file(spoon_in_cup(0.01, 2e3, Method::BackwardEuler)).unwrap();
    let mut file = resolved.file;
    file.hand.trajectory = None;
    // With nobody to feel it the scene had none.
    file.guard = Guard::default();
    file.device.kind = Some(kind.to_owned());
    file.device.options.extend(options.iter().map(|(k, v)| ((*k).to_owned(), v.clone())));
    (file.body.linear_velocity, file.body.angular_velocity) = (None, None);
    Scene::from_file(file).unwrap()
}

/// Would catch a session that does not reach the device's hand, starts with a jerk because the handle is elsewhere, does not end when
/// the device is gone, or cannot be made again from what it wrote.
#[test]
fn a_session_with_a_driver_pushes_the_hand_and_ends_with_the_device() {
    let service = HaplyService::start(Generation::V35);
    // Far from where the body is.
    service.state().hand.target = Vector3::new(0.0, 0.05, 0.02);
    let options = [("address", service.address().to_owned().into()), ("patience", 0.5.into())];
    let (scene, mut running) = start(scene("haply", &options));
    let limit = scene.guard.unwrap().max_force;
    let mut recorder = Recorder::new(Arc::clone(&scene));
    let (started, mut greatest, mut gone) = (Instant::now(), 0.0_f64, false);
    let mut early = Vec::new();
    while !running.is_over() && started.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
        running.drain(&mut |told| match told {
            Told::Tick(tick) => {
                if tick.tick <= 20 {
                    early.push(tick.result.command.force.norm());
                }
                recorder.tick(tick);
            }
            Told::Pass(pass) => recorder.pass(pass),
        });
        let ticks = running.timing().ticks;
        let mut state = service.state();
        greatest = greatest.max(state.force.norm());
        if ticks > 200 {
            // The hand pulls the spoon's handle against the grip of the cup.
            state.hand.target = Vector3::new(0.03, 0.05, 0.02);
        }
        if ticks > 1500 && !gone {
            assert!(greatest > 0.5, "the hand felt {greatest} N");
            state.hang_up = true;
            gone = true;
        }
    }
    let finished = running.stop();
    assert!(matches!(finished.end, End::Device(_)), "{:?}", finished.end);
    finished.records.iter().for_each(|r| recorder.tick(r));
    finished.passes.iter().for_each(|p| recorder.pass(p));
    let recorded = recorder.finish(&mut |_| true);
    assert!(early.iter().all(|f| *f < 0.1), "the start was felt: {early:?}");
    assert!(greatest <= limit, "{greatest} N");
    assert!(recorded.recording.rows.iter().any(|r| r.contact[0].norm() > 0.3), "no contact");
    let again = replay(&scene, &recorded.log, &mut |_| true).unwrap();
    assert!(csv(&again) == csv(&recorded.recording), "made again it is different");
    // The written scene, without the device, is enough.
    let text = scene.to_toml().unwrap();
    let written = Scene::parse(&text, "scene.toml", Path::new("."), &Changes::default()).unwrap();
    let again = replay(&written, &recorded.log, &mut |_| true).unwrap();
    assert!(csv(&again) == csv(&recorded.recording), "made again from the written scene it is different");
}

/// Would catch a vendor's library with which no session starts (a device that calls the loop gives no sample before), one that reaches the hand with the
/// wrong sign or too much, or whose motors stay on when it is unplugged in contact.
#[test]
fn sessions_with_the_vendors_libraries_push_the_hand_and_end_with_the_device() {
    for (kind, prefix, unplug) in
        [("openhaptics", "hd", "comm_error"), ("force-dimension", "dhd", "disconnected")]
    {
        let emulator = EmulatedLibrary::new(prefix);
        // Ours x is the vendor's y at the one.
        let pull = if prefix == "hd" { "target_x" } else { "target_y" };
        let mut options = vec![("library", emulator.path.display().to_string().into())];
        if prefix == "hd" {
            emulator.set("period_us", 900.0);
            options.push(("patience", 1.0.into()));
        }
        let (scene, mut running) = start(scene(kind, &options));
        let limit = scene.guard.unwrap().max_force;
        let mut recorder = Recorder::new(Arc::clone(&scene));
        let (started, mut greatest, mut gone) = (Instant::now(), 0.0_f64, false);
        while !running.is_over() && started.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(5));
            running.drain(&mut |told| match told {
                Told::Tick(tick) => recorder.tick(tick),
                Told::Pass(pass) => recorder.pass(pass),
            });
            let ticks = running.timing().ticks;
            greatest = greatest.max(emulator.vector("applied").norm());
            if ticks > 200 {
                emulator.set(pull, 0.03);
            }
            if ticks > 1500 && !gone {
                assert!(greatest > 0.5, "{kind}: the hand felt {greatest} N");
                assert!(
                    emulator.vector("applied")[usize::from(prefix == "dhd")] < -0.5,
                    "{kind}: not held back"
                );
                emulator.set(unplug, 1.0);
                gone = true;
            }
        }
        let finished = running.stop();
        assert_eq!(finished.end, End::Device(DeviceFault::Disconnected), "{kind}");
        assert_eq!(emulator.get("applied"), 0.0, "{kind}: a force stays");
        finished.records.iter().for_each(|r| recorder.tick(r));
        finished.passes.iter().for_each(|p| recorder.pass(p));
        let recorded = recorder.finish(&mut |_| true);
        assert!(greatest <= limit, "{kind}: {greatest} N");
        assert!(recorded.recording.rows.iter().any(|r| r.contact[0].norm() > 0.3), "{kind}: no contact");
        let again = replay(&scene, &recorded.log, &mut |_| true).unwrap();
        assert!(csv(&again) == csv(&recorded.recording), "{kind}: made again it is different");
    }
}

/// Would catch a VRPN server with which no session starts, a hand that feels nothing or too much, and a session that goes on without its server.
#[test]
fn a_session_with_a_vrpn_server_pushes_the_hand_and_ends_with_it() {
    let server = VrpnServer::start(b"vrpn: ver. 07.35  0\0\0\0\0\0");
    let options = [
        ("address", server.address()),
        ("tracker", "Phantom0"),
        ("force_device", "Phantom0"),
        ("patience", "5"),
    ];
    let options = options.map(|(key, value)| (key, value.to_owned().into()));
    let (scene, mut running) = start(scene("vrpn", &options));
    let limit = scene.guard.unwrap().max_force;
    let (started, mut greatest, mut felt) = (Instant::now(), 0.0_f64, 0.0_f64);
    while !running.is_over() && started.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
        running.drain(&mut |_| {});
        let ticks = running.timing().ticks;
        let mut state = server.state();
        // A single is a little more or less than the force that it was made from.
        greatest = greatest.max(state.field.1.norm());
        felt = felt.min(state.field.1.x);
        if ticks > 200 {
            state.hand.target.x = 0.03;
        }
        state.hang_up |= ticks > 2000;
    }
    let finished = running.stop();
    assert_eq!(finished.end, End::Device(DeviceFault::Disconnected));
    assert!(felt < -0.5 && greatest <= limit * (1.0 + 1e-6), "{felt} N back, up to {greatest} N");
}
