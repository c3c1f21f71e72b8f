//! Grasp, release, clutch, pause and other switches: what the hand feels goes on.
#![allow(clippy::unwrap_used)]

use hapteron::device::{DeviceCommand, DeviceSample};
use hapteron::scene::file::{ContactModel, Method};
use hapteron::scene::{Scene, SceneFile};
use hapteron::scenes::spoon_in_cup;
use hapteron::session::{
    Command, ContactPass, ContactSnapshot, Flags, Gains, HapticState, Settings, Tick, View, apply,
    handle_speed, tick,
};
use nalgebra::{UnitQuaternion, Vector3};

const GRASP: u32 = 1;
const CLUTCH: u32 = 2;

/// A session driven by hand, its contacts found at every tick.
struct Session {
    scene: Scene,
    settings: Settings,
    haptic: HapticState,
    pass: ContactPass,
    contacts: ContactSnapshot,
    ticks: u32,
    /// Greatest step of force (N) and torque (N m) from tick to tick.
    step: (f64, f64),
    sent: DeviceCommand,
    /// As `step`, of the contact in rest, which trembles a little by itself.
    natural: (f64, f64),
}

impl Session {
    fn new(change: impl FnOnce(&mut SceneFile)) -> Self {
        let mut file = spoon_in_cup(0.01, 2e3, Method::BackwardEuler);
        change(&mut file);
        let scene = Scene::from_file(file).unwrap();
        Self {
            settings: Settings::of(&scene),
            haptic: HapticState::new(scene.start),
            pass: ContactPass::new(&scene),
            contacts: ContactSnapshot::empty(&scene.body, &scene.start),
            ticks: 0,
            step: (0.0, 0.0),
            sent: DeviceCommand::zero(),
            natural: (0.0, 0.0),
            scene,
        }
    }

    fn advance(&mut self, sample: &DeviceSample) -> Tick {
        self.ticks += 1;
        let now = f64::from(self.ticks) * self.scene.time_step;
        let result = tick(&self.settings, &self.haptic, sample, &self.contacts, now);
        self.haptic = result.after;
        let view = View {
            state: self.haptic.state,
            body: self.settings.body,
            handle_speed: handle_speed(&self.scene, &result.handle),
            time: now,
            ahead: 2e-3,
            law: self.haptic.grip.contact_law(&self.settings.contact_law),
            model: self.settings.contact_model,
        };
        self.pass.look(&self.scene, &view, &mut self.contacts);
        let (force, torque) = (
            (result.command.force - self.sent.force).norm(),
            (result.command.torque - self.sent.torque).norm(),
        );
        self.step = (self.step.0.max(force), self.step.1.max(torque));
        self.sent = result.command;
        result
    }

    /// Along the scene's motion to a time, so that the body is pressed against the cup. Forgets the steps on the way.
    fn pressed(mut self, until: f64) -> (Self, DeviceSample) {
        let mut sample = self.sample(0.0);
        while f64::from(self.ticks) * 1e-3 < until {
            sample = self.sample(f64::from(self.ticks + 1) * 1e-3);
            self.advance(&sample);
        }
        let still =
            DeviceSample { linear_velocity: Vector3::zeros(), angular_velocity: Vector3::zeros(), ..sample };
        for i in 0..400 {
            if i == 200 {
                self.step = (0.0, 0.0);
            }
            self.advance(&still);
        }
        self.natural = self.step;
        self.step = (0.0, 0.0);
        (self, still)
    }

    fn sample(&self, time: f64) -> DeviceSample {
        self.scene.scaling.from_world(&self.scene.trajectory.sample(time, 1e-3))
    }

    fn tell(&mut self, command: Command) {
        apply(&mut self.settings, &mut self.haptic, &command);
    }
}

fn with_buttons(sample: &DeviceSample, buttons: u32) -> DeviceSample {
    DeviceSample { buttons, ..*sample }
}

/// What may change in a tick after a switch: the whole force over the blend time, besides what changes by itself.
fn gentle(force: f64, natural: f64) -> f64 {
    1.1 * force * 1e-3 / hapteron::session::BLEND_TIME + 1.5 * natural
}

/// Would catch a grasp or release that is felt as a blow, a press that counts twice, and a grasp that pulls the body to the old place.
#[test]
fn grasp_and_release_by_button_are_no_step() {
    let (mut s, still) = Session::new(|_| {}).pressed(0.3);
    let (force, torque) = (s.sent.force.norm(), s.sent.torque.norm());
    assert!(force > 1.0, "the test needs a force that could step: {force}");
    // Pressed for ten ticks: one release.
    for i in 0..200 {
        let result = s.advance(&with_buttons(&still, if i < 10 { GRASP } else { 0 }));
        assert!(result.flags.contains(Flags::RELEASED));
    }
    assert!(
        s.step.0 < gentle(force, s.natural.0) && s.step.1 < gentle(torque, s.natural.1),
        "release: {:?} of {force}",
        s.step
    );
    assert_eq!(s.sent, DeviceCommand::zero(), "an open hand feels something");
    // The hand goes elsewhere and grasps there: no deviation, whatever the distance.
    let elsewhere = DeviceSample {
        position: still.position + Vector3::new(0.01, -0.02, 0.03),
        orientation: still.orientation * UnitQuaternion::from_euler_angles(0.3, -0.2, 0.1),
        ..still
    };
    s.step = (0.0, 0.0);
    let mut greatest = 0.0_f64;
    for _ in 0..100 {
        s.advance(&elsewhere);
    }
    for i in 0..300 {
        let result = s.advance(&with_buttons(&elsewhere, if i < 10 { GRASP } else { 0 }));
        assert!(!result.flags.contains(Flags::RELEASED));
        greatest = greatest.max(result.command.force.norm());
    }
    assert!(s.step.0 < 0.05 && greatest < 0.3, "grasp: {:?}, up to {greatest} N", s.step);
    // And it holds: the body follows the hand.
    let x = s.haptic.state.position;
    let moved = DeviceSample { position: elsewhere.position + Vector3::new(0.0, 0.0, 0.01), ..elsewhere };
    for _ in 0..500 {
        s.advance(&moved);
    }
    assert!((s.haptic.state.position - x - Vector3::new(0.0, 0.0, 0.01)).norm() < 5e-4);
}

/// Would catch a body that an open hand still moves, with every method.
#[test]
fn a_released_body_moves_by_gravity_and_contacts_only() {
    for method in [
        Method::BackwardEuler,
        Method::BackwardEulerNewton,
        Method::RungeKutta4,
        Method::ForwardEuler,
        Method::QuasiStatic,
    ] {
        let mut s = Session::new(|file| {
            file.obstacle.clear();
            file.integrator.method = Some(method);
            file.scene.gravity = Some([0.0, 0.0, -9.81]);
            file.body.linear_velocity = Some([0.0; 3]);
            file.body.angular_velocity = Some([0.0; 3]);
        });
        let start = s.haptic.state.position;
        s.tell(Command::Grasp(false));
        let sample = s.sample(0.0);
        for _ in 0..100 {
            let far = DeviceSample { position: sample.position + Vector3::x(), ..sample };
            let result = s.advance(&far);
            assert!(result.step.deviation == 0.0 && result.after.fault.is_none(), "{method:?}");
        }
        let fallen = s.haptic.state.position - start;
        let expected = if method == Method::QuasiStatic { 0.0 } else { -9.81 * 0.5 * 0.1 * 0.1 };
        assert!((fallen - Vector3::new(0.0, 0.0, expected)).norm() < 6e-4, "{method:?}: {fallen:?}");
    }
}

/// Would catch a clutch that lets the force drop or jump, moves the body, or forgets the scale.
#[test]
fn the_clutch_moves_the_workspace_and_not_the_body() {
    let (mut s, still) = Session::new(|file| file.device.position_scale = Some(0.4)).pressed(0.3);
    let force = s.sent.force.norm();
    let handle = s.advance(&still).handle;
    let away = Vector3::new(0.03, 0.02, -0.05);
    let turn = UnitQuaternion::from_euler_angles(0.4, 0.3, -0.5);
    for i in 0..300 {
        // The hand travels while the clutch is down.
        let share = (f64::from(i) / 200.0).min(1.0);
        let moving = DeviceSample {
            position: still.position + away * share,
            orientation: turn.powf(share) * still.orientation,
            linear_velocity: if share < 1.0 { away / 0.2 } else { Vector3::zeros() },
            buttons: CLUTCH,
            ..still
        };
        let result = s.advance(&moving);
        assert!(result.flags.contains(Flags::CLUTCHED));
        assert_eq!(
            (result.handle.position, result.handle.linear_velocity),
            (handle.position, Vector3::zeros())
        );
    }
    assert_eq!(s.sent, DeviceCommand::zero(), "felt while clutched");
    assert!(s.step.0 < gentle(force, s.natural.0), "pressed: {:?} of {force}", s.step);
    s.step = (0.0, 0.0);
    let there =
        DeviceSample { position: still.position + away, orientation: turn * still.orientation, ..still };
    let mut result = s.advance(&there);
    for _ in 0..300 {
        result = s.advance(&there);
    }
    assert!(s.step.0 < gentle(force, s.natural.0), "let go: {:?} of {force}", s.step);
    assert!((result.handle.position - handle.position).norm() < 1e-12);
    assert!(result.handle.orientation.angle_to(&handle.orientation) < 1e-7);
    assert!((s.sent.force.norm() - force).abs() < 0.02 * force, "{} was {force}", s.sent.force.norm());
    // A motion of the hand counts 0.4 of it, in the same direction; a turn about an axis is one about that axis.
    let nudge = DeviceSample {
        position: there.position + Vector3::new(1e-3, 0.0, 0.0),
        orientation: UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.02, 0.0)) * there.orientation,
        ..there
    };
    let after = s.advance(&nudge).handle;
    assert!((after.position - result.handle.position - Vector3::new(4e-4, 0.0, 0.0)).norm() < 1e-12);
    let turned = (after.orientation * result.handle.orientation.inverse()).scaled_axis();
    assert!((turned - Vector3::new(0.0, 0.02, 0.0)).norm() < 1e-9);
}

/// Would catch any switch that the hand feels as a step, in contact.
#[test]
fn no_switch_is_a_step() {
    let gains = Gains {
        linear_stiffness: 1500.0,
        linear_damping: 5.0,
        angular_stiffness: 0.2,
        angular_damping: 0.01,
        max_force: Some(4.0),
        max_torque: None,
    };
    let scene = Session::new(|_| {}).scene;
    let switches = [
        Command::coupling(&gains).unwrap(),
        Command::SetMethod(hapteron::dynamics::Method::BackwardEulerNewton),
        Command::SetMethod(hapteron::dynamics::Method::QuasiStatic),
        Command::SetContactModel(ContactModel::Linearized),
        Command::SetContactModel(ContactModel::Held),
        Command::contact(5e3, 4.0).unwrap(),
        Command::gravity([0.0, 0.0, -9.81]).unwrap(),
        Command::mass(&scene, 0.05).unwrap(),
        Command::Attach,
        Command::Pause(true),
        Command::Clutch(true),
        Command::Grasp(false),
    ];
    for switch in switches {
        let (mut s, still) = Session::new(|_| {}).pressed(0.3);
        let force = s.sent.force.norm();
        s.tell(switch);
        s.advance(&still);
        // In the switch's own tick nothing changes but what the body does by itself.
        assert!(s.step.0 < 1.5 * s.natural.0, "{switch:?}: {:?} in its tick", s.step);
        for _ in 0..200 {
            s.advance(&still);
        }
        let most = gentle(2.0 * force, s.natural.0);
        assert!(s.step.0 < most, "{switch:?}: {:?}, {most}", s.step);
        assert!(s.haptic.fault.is_none());
    }
}

/// Would catch a pause that lets the body creep, or a resume that pulls it to where the hand has gone.
#[test]
fn after_a_pause_it_goes_on_from_where_the_body_stands() {
    let (mut s, still) = Session::new(|_| {}).pressed(0.3);
    s.tell(Command::Pause(true));
    let state = s.haptic.state;
    let gone = DeviceSample { position: still.position + Vector3::new(0.1, 0.0, 0.0), ..still };
    for _ in 0..100 {
        assert!(s.advance(&gone).flags.contains(Flags::PAUSED));
    }
    assert_eq!(s.haptic.state.position, state.position);
    s.tell(Command::Pause(false));
    let result = s.advance(&gone);
    assert_eq!(result.command.force.norm(), 0.0);
    // The contacts push the body a little before the coupling holds it again.
    assert!(result.step.deviation < 2e-4, "{}", result.step.deviation);
}

/// Would catch a re-arming that is not explicit, or comes with a jerk.
#[test]
fn rearming_starts_without_force_from_where_the_body_stands() {
    let (mut s, still) = Session::new(|_| {}).pressed(0.3);
    s.advance(&DeviceSample { position: Vector3::new(f64::NAN, 0.0, 0.0), ..still });
    assert!(s.haptic.fault.is_some());
    let gone = DeviceSample { position: still.position + Vector3::new(0.0, 0.05, 0.0), ..still };
    for command in [Command::Attach, Command::Grasp(true), Command::Pause(false)] {
        s.tell(command);
        let result = s.advance(&gone);
        assert!(result.flags.contains(Flags::FAULT_LATCHED), "{command:?} re-armed");
        assert_eq!(result.command, DeviceCommand::zero());
    }
    s.tell(Command::Rearm);
    s.step = (0.0, 0.0);
    for _ in 0..100 {
        let result = s.advance(&gone);
        assert!(!result.flags.contains(Flags::FAULT_LATCHED));
    }
    assert!(s.step.0 < 0.05, "{:?}", s.step);
}

/// Would catch a button that is down at the start and counts as pressed, and a sample that is not finite and switches something.
#[test]
fn buttons_count_when_they_go_down() {
    let mut s = Session::new(|_| {});
    let down = with_buttons(&s.sample(0.0), GRASP);
    for _ in 0..3 {
        assert!(!s.advance(&down).flags.contains(Flags::RELEASED));
    }
    let mut s = Session::new(|_| {});
    let bad = DeviceSample { position: Vector3::repeat(f64::INFINITY), buttons: CLUTCH, ..s.sample(0.0) };
    assert!(!s.advance(&bad).flags.contains(Flags::CLUTCHED));
}
