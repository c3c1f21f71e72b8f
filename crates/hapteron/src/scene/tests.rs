use super::*;
use nalgebra::UnitQuaternion;

const SCENE: &str = "[body]\nmesh = \"builtin:spoon\"\n[[obstacle]]\nmesh = \"builtin:cup\"\n[hand]\ntrajectory = \"builtin:free-space\"\n";

fn parse(text: &str) -> Result<Scene, SceneError> {
    Scene::parse(text, "s.toml", Path::new("."), &Changes::default())
}

fn with(line: &str) -> String {
    // The line goes at the head of its table's part, the text after.
    let (table, rest) = line.split_once('/').unwrap();
    if SCENE.contains(&format!("[{table}]\n")) {
        SCENE.replace(&format!("[{table}]\n"), &format!("[{table}]\n{rest}\n"))
    } else {
        format!("{SCENE}[{table}]\n{rest}\n")
    }
}

fn fault(line: &str) -> String {
    parse(&with(line)).unwrap_err().to_string()
}

/// Would catch a value that the written scene loses or changes in its last bit.
#[test]
fn a_written_scene_comes_back_bit_for_bit() {
    let scene = parse(&with("body/mass = 0.0123")).unwrap();
    let text = scene.to_toml().unwrap();
    let again = parse(&text).unwrap();
    assert_eq!(scene.file, again.file);
    assert_eq!(scene.start, again.start);
    assert_eq!(scene.body, again.body);
    assert_eq!(scene.coupling, again.coupling);
    assert_eq!(text, again.to_toml().unwrap());
}

/// Would catch a start that jerks the hand.
#[test]
fn a_body_without_a_pose_starts_without_deviation_and_at_rest_relative_to_the_handle() {
    let folder = std::env::temp_dir().join(format!("hapteron-scene-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let motion = "t,px,py,pz,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz\n0,1,2,3,0.6,0,0.8,0,0.1,0.2,0.3,1,2,3\n1,1,2,3,0.6,0,0.8,0,0,0,0,0,0,0\n";
    std::fs::write(folder.join("m.csv"), motion).unwrap();
    let text = SCENE.replace("builtin:free-space", "m.csv")
        + "[coupling]\ngrasp_position=[0.05,0.01,0.02]\ngrasp_orientation=[0.8,0.6,0,0]\n";
    let scene = Scene::parse(&text, "s.toml", &folder, &Changes::default()).unwrap();
    let handle = handle_at(&scene.trajectory.sample(0.0, scene.time_step));
    let (feedback, deviation, angle) = scene.coupling.feedback(&handle, &scene.start, &scene.body);
    assert!(deviation < 1e-12 && angle < 1e-12, "{deviation} {angle}");
    assert!(feedback.force.norm() < 1e-12 && feedback.torque.norm() < 1e-12, "{feedback:?}");
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Would catch a grasp that is not recorded where the handle is.
#[test]
fn a_body_with_a_pose_is_held_where_the_handle_is() {
    let q = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.0);
    let line = format!("body/position = [0.1, 0.2, 0.3]\norientation = [{}, {}, {}, {}]", q.w, q.i, q.j, q.k);
    let scene = parse(&with(&line)).unwrap();
    let handle = handle_at(&scene.trajectory.sample(0.0, scene.time_step));
    let (_, deviation, angle) = scene.coupling.feedback(&handle, &scene.start, &scene.body);
    assert!(deviation < 1e-12 && angle < 1e-12, "{deviation} {angle}");
    assert_eq!(scene.start.linear_velocity(&scene.body).norm(), 0.0);
}

#[test]
fn faults_name_the_line_the_key_and_the_cure() {
    let negative = fault("contact/stiffness = -1");
    assert_eq!(negative, "s.toml, line 8, `contact.stiffness`: is -1; it must be positive and finite");
    assert!(fault("coupling/linear_stiffness = -1").contains("not negative"));
    assert!(fault("body/mass = 0").contains("positive"));
    assert!(fault("body/mass = nan").contains("positive"));
    assert!(fault("body/mass = 1\ndensity = 2").contains("one of the two"));
    assert!(fault("body/inertia = [[1,0,0],[0,1,0],[0,0,5]]\nmass = 1").contains("inertia"));
    assert!(fault("body/orientation = [0,0,0,0]").contains("unit quaternion"));
    assert!(fault("body/scale = 0").contains("line 2"));
    assert!(fault("contact/friction = 0.3").contains("not available yet"));
    assert!(fault("contact/anticipation = -0.1").contains("not negative"));
    assert!(fault("contact_thread/period = 0").contains("positive"));
    assert!(fault("integrator/time_step = inf").contains("positive"));
    // Such a step would ask for terabytes, and such a period would not let a tick end.
    assert!(fault("integrator/time_step = 1e-12").contains("at least 0.000001 seconds"));
    assert!(fault("contact_thread/period = 1e-12").contains("at least 0.000001 seconds"));
    assert!(fault("hand/mass = 1").contains("together"));
    assert!(fault("device/position_scale = 0").contains("position_scale"));
    assert!(fault("hand/grip = \"light\"\nmass = 1").contains("`hand.grip`: stands beside"));
    assert!(fault("hand/grip = \"loose\"").contains("known here: released, light, medium, firm"));
    assert!(fault("hand/mass = -1\ndamping = 1\nstiffness = 1").contains("`hand.mass`"));
    assert!(fault("hand/tremor = 1e-4").contains("give it a grip"));
    assert!(fault("device/model = \"premium\"").contains("there are premium-1.5-6dof, "));
    assert!(fault("device/delay = 3").contains("`device.delay`: device.delay is 3; it must be 0, 1 or 2"));
    assert!(fault("device/velocity_filter = 0").contains("`device.velocity_filter`"));
    assert!(fault("guard/max_slew = 0").contains("`guard.max_slew`: guard.max_slew is 0"));
    assert!(fault("guard/max_forc = 1").contains("did you mean `max_force`?"));
    let text = SCENE.replace("builtin:spoon", "builtin:spon");
    assert!(parse(&text).unwrap_err().to_string().contains("there are"), "{text}");
    let text = SCENE.replace("builtin:spoon", "nowhere.stl");
    assert!(parse(&text).unwrap_err().to_string().contains("nowhere.stl"));
    let text = SCENE.replace("builtin:free-space", "builtin:x");
    assert!(parse(&text).unwrap_err().to_string().contains("free-space"));
    assert!(parse("[body]\nmesh = \"builtin:spoon\"\n").unwrap_err().to_string().contains("--replay"));
}

/// Would catch a flat body that gets a mass from nowhere.
#[test]
fn a_body_without_volume_needs_its_mass_properties() {
    let folder = std::env::temp_dir().join(format!("hapteron-flat-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("flat.obj"), "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n").unwrap();
    let text = SCENE.replace("builtin:spoon", "flat.obj");
    let try_it = |text: &str| Scene::parse(text, "s.toml", &folder, &Changes::default());
    let message = try_it(&text).unwrap_err().to_string();
    assert!(message.contains("Give `mass`, `inertia` and `center_of_mass`"), "{message}");
    let given =
        "[body]\nmass = 0.01\ninertia = [[1e-5,0,0],[0,1e-5,0],[0,0,2e-5]]\ncenter_of_mass = [0,0,0]\n";
    assert!(try_it(&text.replace("[body]\n", given)).is_ok());
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Would catch a guard that acts on a replay, or is missing where a hand feels the force; and limits that are not the device's.
#[test]
fn a_hand_gets_a_guard_with_its_device_s_limits() {
    let replay = parse(SCENE).unwrap();
    assert!(replay.guard.is_none() && replay.hand.is_none());
    let held = parse(&with("hand/grip = \"medium\"")).unwrap();
    let guard = held.guard.unwrap();
    assert_eq!((guard.max_force, guard.max_torque), (8.5, 0.5));
    assert_eq!(held.hand, Some(hapteron_device::Grip::Medium.parameters()));
    assert_eq!(parse(&held.to_toml().unwrap()).unwrap().guard, held.guard);
    let text = with("hand/grip = \"medium\"") + "[device]\nmodel = \"touch\"\n[guard]\nmax_slew = 33.0\n";
    let touch = parse(&text).unwrap().guard.unwrap();
    assert_eq!((touch.max_force, touch.max_torque, touch.max_slew), (3.3, 0.0, 33.0));
    assert!(parse(&(text + "enabled = false\n")).unwrap().guard.is_none());
    assert!(parse(&with("guard/enabled = true")).unwrap().guard.is_some());
    let device = hapteron_device::simulated::model("sigma.7").unwrap().capabilities();
    let real = parse(&with("device/kind = \"forcedimension\"")).unwrap();
    assert_eq!(real.guard_for(&device).unwrap().unwrap().settings().max_force, 12.0);
}

/// Would catch a scene file that pushes a hand with more than its device is made for, or takes a real device's limits away.
#[test]
fn no_scene_takes_a_device_s_limits_away() {
    let device = hapteron_device::simulated::model("sigma.7").unwrap().capabilities();
    let greedy = with("device/kind = \"forcedimension\"") + "[guard]\nmax_force = 500.0\nmax_torque = 90.0\n";
    let limits = |text: &str| {
        let mut scene = parse(text).unwrap();
        scene.adopt(&device).unwrap();
        // What is written out makes the same guard again where the device is not there.
        assert_eq!(parse(&scene.to_toml().unwrap()).unwrap().guard, scene.guard);
        scene.guard.unwrap()
    };
    let on = limits(&greedy);
    assert_eq!((on.max_force, on.max_torque), (device.peak_force, device.peak_torque));
    let off = limits(&(greedy.clone() + "enabled = false\n"));
    assert_eq!((off.max_force, off.max_torque, off.ramp_time), (on.max_force, on.max_torque, on.ramp_time));
    assert!(off.max_slew > 1e6 && off.oscillation_force > 1e6);
    let simulated = greedy.replace("forcedimension", "simulated") + "enabled = true\n";
    assert_eq!(parse(&simulated).unwrap().guard.unwrap().max_force, 8.5);
}

/// Would catch a real device without a guard because its scene was made for a replay or a simulated hand, as when it is chosen in the window.
#[test]
fn a_real_device_has_a_guard_in_every_scene() {
    let device = hapteron_device::simulated::model("touch").unwrap().capabilities();
    let off = with("hand/grip = \"medium\"") + "[guard]\nenabled = false\n";
    for text in [SCENE.to_owned(), off] {
        let mut scene = parse(&text).unwrap();
        assert!(scene.guard.is_none());
        scene.adopt(&device).unwrap();
        let guard = scene.guard.unwrap();
        assert_eq!((guard.max_force, guard.max_torque, guard.max_damping), (3.3, 0.0, 4.0));
        assert!(guard.max_slew < 1e4 && guard.max_speed <= 2.0);
        // Passivity control damps as much when the session is made again.
        assert_eq!(parse(&scene.to_toml().unwrap()).unwrap().guard, scene.guard);
    }
}

/// Would catch buttons or a priority that cannot be, and a priority above the haptic thread's.
#[test]
fn buttons_and_priorities_are_checked() {
    assert!(fault("device/grasp_button = 32").contains("0 to 31"));
    assert!(fault("device/clutch_button = 0").contains("the same as grasp_button"));
    assert!(fault("contact_thread/priority = 80").contains("1 to 79"));
    let scene = parse(&with("device/grasp_button = 3")).unwrap();
    assert_eq!((scene.buttons.grasp, scene.buttons.clutch), (8, 2));
    let driven = SCENE.replace("trajectory = \"builtin:free-space\"", "") + "[device]\nkind = \"haply\"\n";
    let options = driven.clone() + "[device.options]\naddress = \"a:1\"\npatience = 0.5\n";
    let scene = parse(&options).unwrap();
    let (kind, options) = scene.driver().unwrap();
    assert_eq!((kind, options.get("address"), options.get("patience")), ("haply", Some("a:1"), Some("0.5")));
    assert_eq!(parse(&scene.to_toml().unwrap()).unwrap().file, scene.file);
    assert!(parse(&driven.replace("haply", "simulated")).unwrap_err().to_string().contains("needs a motion"));
}

/// Would catch contact levels that are built without a word, or that cannot be stopped: of a spoon whose size no cache knows.
#[test]
fn building_contact_levels_is_told_and_can_be_stopped() {
    let size = 1.0 + 1e-9 * f64::from(std::process::id());
    let text =
        with("contact/error_threshold = 0.025").replace("[body]\n", &format!("[body]\nscale = {size}\n"));
    let path = std::env::temp_dir().join(format!("hapteron-levels-{}.toml", std::process::id()));
    std::fs::write(&path, &text).unwrap();
    let mut told = Vec::new();
    let stopped = Scene::load_with(&path, &Changes::default(), &mut |share| {
        told.push(share);
        told.len() < 3
    });
    std::fs::remove_file(path).unwrap();
    let error = stopped.unwrap_err().to_string();
    assert!(error.contains("cancelled") && error.contains("contact.error_threshold"), "{error}");
    assert_eq!(told.len(), 3);
    assert!(told.iter().all(|share| (0.0..1.0).contains(share)), "{told:?}");
}
