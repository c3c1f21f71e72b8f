//! The commands as a user types them.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Folder, fails, hapteron, stderr, stdout};

const CUBE: &str = "OFF\n8 12 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n3 0 2 1\n3 0 3 2\n3 4 5 6\n3 4 6 7\n3 0 1 5\n3 0 5 4\n3 1 2 6\n3 1 6 5\n3 2 3 7\n3 2 7 6\n3 3 0 4\n3 3 4 7\n";

/// Would catch a wrong distance, a wrong sign, and output that differs from what README.md says.
#[test]
fn query_tells_distance_and_contacts() {
    let folder = Folder::new("query");
    folder.file("cube.off", CUBE);
    let poses = "t,px,py,pz,qw,qx,qy,qz\n0,1.25,0,0,1,0,0,0\n0.5,0.9,0.1,0.2,1,0,0,0\n1,3,0,0,1,0,0,0\n";
    folder.file("poses.csv", poses);
    let command = [
        "query",
        "cube.off",
        "cube.off",
        "--poses",
        "poses.csv",
        "--tolerance",
        "0.5",
        "--contacts",
        "c.csv",
        "--rate",
    ];
    let output = hapteron(&folder, &command);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
    assert_eq!(lines[0], ["pose", "t", "min_distance", "contacts"]);
    assert_eq!(lines[1][..3], ["0", "0", "0.25"]);
    let crossing: f64 = lines[2][2].parse().unwrap();
    assert!((crossing + 0.1).abs() < 1e-9, "{crossing}");
    assert_eq!(lines[3][2..], ["inf", "0"]);
    assert!(stderr(&output).contains("3 queries: median"), "{}", stderr(&output));
    let contacts = folder.read("c.csv");
    assert!(contacts.starts_with("pose,px,py,pz,ox,oy,oz,nx,ny,nz,depth,weight\n"));
    let count: usize = lines[1][3].parse::<usize>().unwrap() + lines[2][3].parse::<usize>().unwrap();
    assert_eq!(contacts.lines().count(), count + 1);
    // From the cube at +x the other one lies towards -x.
    let first: Vec<f64> = contacts.lines().nth(1).unwrap().split(',').map(|w| w.parse().unwrap()).collect();
    assert_eq!(first[7..10], [-1.0, 0.0, 0.0]);
}

/// Would catch a mesh description that is wrong or silent about a defect.
#[test]
fn mesh_describes_a_closed_and_an_open_mesh() {
    let folder = Folder::new("mesh");
    folder.file("cube.off", CUBE);
    let output = hapteron(&folder, &["mesh", "cube.off"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    for words in ["12", "closed           yes", "1.000000e0 m^3", "[0.500000, 0.500000, 0.500000]"] {
        assert!(text.contains(words), "no '{words}' in {text}");
    }
    folder.file("open.off", &CUBE.replacen("8 12 0", "8 11 0", 1).replacen("3 3 4 7\n", "", 1));
    let text = stdout(&hapteron(&folder, &["mesh", "open.off"]));
    assert!(text.contains("3 boundary edges") && text.contains("no mass properties"), "{text}");
}

/// Would catch built-in models and scenes that cannot be used from the files they are written to.
#[test]
fn models_writes_meshes_and_scenes_that_run() {
    let folder = Folder::new("models");
    let output = hapteron(&folder, &["models", "m"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let scene = folder
        .read("m/spoon_in_cup.toml")
        .replace("builtin:spoon\"", "spoon.obj\"")
        .replace("builtin:cup", "cup.obj");
    std::fs::write(folder.path().join("m/mine.toml"), scene).unwrap();
    let output = hapteron(&folder, &["run", "m/mine.toml", "--virtual-time", "--out", "r"]);
    assert!(output.status.success(), "{} {}", stdout(&output), stderr(&output));
    assert!(stdout(&output).contains("stable"), "{}", stdout(&output));
}

/// Would catch a run folder that is incomplete, or whose resolved scene does not repeat the run bit for bit.
#[test]
fn run_writes_a_folder_from_which_the_run_repeats() {
    let folder = Folder::new("run");
    hapteron(&folder, &["models", "m"]);
    let scene = "m/spoon_in_cup.toml";
    let set = ["--set", "contact.stiffness=3000", "--set", "contact_thread.latency=0.0015"];
    let first = hapteron(&folder, &[&["run", scene, "--virtual-time", "--out", "a"][..], &set].concat());
    assert!(first.status.success(), "{}", stderr(&first));
    let again = hapteron(&folder, &["run", "a/scene.toml", "--virtual-time", "--out", "b"]);
    assert!(again.status.success(), "{}", stderr(&again));
    assert_eq!(folder.read("a/run.csv"), folder.read("b/run.csv"));
    assert_eq!(folder.read("a/scene.toml"), folder.read("b/scene.toml"));
    assert!(folder.read("a/scene.toml").contains("stiffness = 3000.0"));
    assert_eq!(folder.read("a/run.csv").lines().count(), 651);
    // Without --out a run never overwrites another.
    for name in ["runs/scene", "runs/scene-2"] {
        hapteron(&folder, &["run", "a/scene.toml", "--virtual-time"]);
        assert!(folder.path().join(name).join("run.csv").is_file(), "{name}");
    }
}

/// Would catch a replay that is not the motion given, or a hand that stays.
#[test]
fn replay_makes_the_handle_follow_the_file() {
    let folder = Folder::new("replay");
    hapteron(&folder, &["models", "m"]);
    folder.file("t.csv", "t,px,py,pz,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n0.1,0.01,0,0,1,0,0,0\n");
    let command = ["run", "m/spoon_in_free_space.toml", "--virtual-time", "--replay", "t.csv", "--out", "r"];
    let output = hapteron(&folder, &command);
    assert!(output.status.success(), "{}", stderr(&output));
    let run = folder.read("r/run.csv");
    assert_eq!(run.lines().count(), 101);
    let last: Vec<f64> = run.lines().last().unwrap().split(',').map(|w| w.parse().unwrap()).collect();
    assert_eq!(last[0], 0.1);
    assert_eq!(last[1], 0.01);
}

/// Would catch a failure that is reported as success.
#[test]
fn an_unstable_run_exits_with_1_and_says_so() {
    let folder = Folder::new("unstable");
    hapteron(&folder, &["models", "m"]);
    let command = [
        "run",
        "m/spoon_in_free_space.toml",
        "--virtual-time",
        "--set",
        "integrator.method=forward-euler",
        "--out",
        "r",
    ];
    let output = hapteron(&folder, &command);
    assert_eq!(output.status.code(), Some(1));
    assert!(stdout(&output).contains("NOT STABLE"), "{}", stdout(&output));
    assert!(!folder.read("r/run.csv").contains("NaN"));
}

/// Would catch messages that leave a user without file, line or cure, and panics on bad input.
#[test]
fn bad_input_gets_a_clear_error() {
    let folder = Folder::new("bad");
    folder.file("cube.off", CUBE);
    folder.file("empty.stl", "");
    folder.file("liar.off", "OFF\n4000000000 4000000000 0\n");
    folder.file("nan.obj", "v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n");
    folder.file("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    folder.file("p.csv", "t,px,py,pz,qw,qx,qy,qz\n0,0,0,0,2,0,0,0\n");
    folder.file("one.csv", "t,px,py,pz,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n");
    folder.file("s.toml", "[body]\nmesh = \"builtin:spoon\"\n[contact]\nstifness = 1\n");
    folder.file("t.toml", "[body]\nmesh = \"builtin:spoon\"\n[hand]\ntrajectory = \"one.csv\"\n");
    fails(&folder, 1, &["mesh", "nowhere.stl"], &["nowhere.stl"]);
    fails(&folder, 1, &["mesh", "empty.stl"], &["empty.stl"]);
    fails(&folder, 1, &["mesh", "liar.off"], &["liar.off"]);
    fails(&folder, 1, &["mesh", "nan.obj"], &["nan.obj", "line 2"]);
    fails(&folder, 1, &["mesh", "index.obj"], &["index.obj", "line 4"]);
    fails(&folder, 1, &["mesh", "builtin:spon"], &["spoon"]);
    fails(&folder, 1, &["mesh", "cube.off", "--scale", "0"], &["--scale"]);
    let query = |poses: &'static str, d: &'static str| {
        ["query", "cube.off", "cube.off", "--poses", poses, "--tolerance", d]
    };
    fails(&folder, 1, &query("p.csv", "0.1"), &["p.csv, line 2", "unit quaternion"]);
    fails(&folder, 1, &query("nowhere.csv", "0.1"), &["nowhere.csv"]);
    fails(&folder, 1, &query("one.csv", "nan"), &["--tolerance"]);
    fails(&folder, 1, &["run", "s.toml"], &["s.toml, line 4", "did you mean `stiffness`"]);
    fails(&folder, 1, &["run", "t.toml"], &["t.toml, line 4", "at least two"]);
    fails(&folder, 1, &["run", "s.toml", "--set", "body.mas=1"], &["line 4"]);
    fails(
        &folder,
        1,
        &["run", "t.toml", "--set", "body.mas=1"],
        &["--set body.mas=1", "did you mean `mass`"],
    );
    fails(&folder, 2, &["run"], &["SCENE.toml"]);
    fails(&folder, 2, &["rum"], &["run"]);
}

/// Would catch a Ctrl-C that loses the files, or a session that does not end.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_session_with_complete_files() {
    use std::io::Read;
    use std::process::{Command, Stdio};
    let folder = Folder::new("interrupt");
    hapteron(&folder, &["models", "m"]);
    let mut child = Command::new(env!("CARGO_BIN_EXE_hapteron"))
        .args(["run", "m/spoon_in_cup.toml", "--duration", "600", "--out", "r"])
        .current_dir(folder.path())
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut errors = child.stderr.take().unwrap();
    let mut begun = [0; 14];
    errors.read_exact(&mut begun).unwrap();
    assert_eq!(&begun, b"haptic thread:");
    std::thread::sleep(std::time::Duration::from_millis(500));
    let told = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(told.success());
    let mut rest = String::new();
    errors.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1), "{rest}");
    assert!(rest.contains("stopped after"), "{rest}");
    let rows = folder.read("r/run.csv").lines().count();
    assert!(rows > 10 && folder.read("r/device.csv").lines().count() == rows + 1, "{rows}");
    assert!(
        folder.read("r/report.html").ends_with("</html>\n")
            && folder.read("r/timing.json").contains("\"stopped\"")
    );
    let again = hapteron(&folder, &["run", "r/scene.toml", "--replay", "r/device.csv", "--out", "again"]);
    let shorter = ["run", "r/scene.toml", "--replay", "r/device.csv", "--duration", "1"];
    fails(&folder, 1, &shorter, &["--duration does not go with r/device.csv"]);
    assert!(again.status.success(), "{}", stderr(&again));
    assert!(folder.read("again/run.csv") == folder.read("r/run.csv"));
}

/// Would catch a scene for a real device that asks for a motion, and a driver's error without its cure.
#[test]
fn a_scene_with_a_driver_needs_no_motion_but_its_device() {
    let folder = Folder::new("driver");
    folder.file(
        "s.toml",
        "[body]\nmesh = \"builtin:spoon\"\nmass = 0.01\n[device]\nkind = \"haply\"\n[device.options]\naddress = \"127.0.0.1:1\"\n",
    );
    fails(&folder, 1, &["run", "s.toml", "--out", "r"], &["127.0.0.1:1"]);
    fails(&folder, 1, &["run", "s.toml", "--virtual-time"], &["[hand] trajectory"]);
    fails(&folder, 1, &["run", "s.toml", "--set", "device.kind=\"haplee\""], &["did you mean 'haply'"]);
    for seconds in ["-1", "0", "nan", "inf", "soon"] {
        let duration = format!("--duration={seconds}");
        fails(&folder, 2, &["run", "s.toml", &duration], &["positive number of seconds"]);
    }
}
