//! `hapteron stability` through the binary.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Folder, fails, hapteron, stderr, stdout};

/// A bar of 10 cm pressed on a plate; the hand comes down by 8 mm in 0.2 s and holds.
const BOX: &str = "v -0.05 -0.01 -0.005\nv 0.05 -0.01 -0.005\nv 0.05 0.01 -0.005\nv -0.05 0.01 -0.005\n\
    v -0.05 -0.01 0.005\nv 0.05 -0.01 0.005\nv 0.05 0.01 0.005\nv -0.05 0.01 0.005\n\
    f 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 2 3 7\nf 2 7 6\nf 3 4 8\nf 3 8 7\nf 4 1 5\nf 4 5 8\n";
const SCENE: &str = "[body]\nmesh = \"box.obj\"\nmass = 0.02\n[[obstacle]]\nmesh = \"box.obj\"\nscale = 2.0\nposition = [0, 0, -0.017]\n\
    [coupling]\nlinear_damping = 4.0\n[hand]\ntrajectory = \"down.csv\"\n";
const DOWN: &str =
    "t,px,py,pz,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n0.2,0,0,-0.008,1,0,0,0\n0.3,0,0,-0.008,1,0,0,0\n";

/// Would catch a map whose cells are swapped, all alike, or judged wrongly: a coupling that the theory says is stable late by a sample (500 N/m)
/// and one far beyond its limit (100 kN/m), each with two grips.
#[test]
fn a_map_tells_stable_from_unstable() {
    let folder = Folder::new("stability");
    folder.file("box.obj", BOX);
    folder.file("down.csv", DOWN);
    folder.file("scene.toml", SCENE);
    let arguments = [
        "stability",
        "scene.toml",
        "--x",
        "hand.grip=light,firm",
        "--y",
        "coupling.linear_stiffness=500,100000",
        "--set",
        "device.friction=0",
        "--out",
        "map",
    ];
    let output = hapteron(&folder, &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let csv = folder.read("map/map.csv");
    let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows.len(), 4, "{csv}");
    for row in &rows {
        assert_eq!(row[2] == "stable", row[1] == "500", "{row:?}\n{csv}");
        let force: f64 = row[5].parse().unwrap();
        assert!(force > 0.1 && force <= 8.5 + 1e-9, "{row:?}");
    }
    assert!(stdout(&output).contains("2 of 4 stable"), "{}", stdout(&output));
    let png = std::fs::read(folder.path().join("map/map.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG"));
    let html = folder.read("map/report.html");
    assert!(html.contains("data:image/png;base64,") && html.contains("2 of 4 stable"));
    assert!(!html.contains("http://") && !html.contains("https://"), "the report must need nothing else");
    assert_eq!(folder.read("map/map.csv"), csv);
}

#[test]
fn a_wrong_axis_gets_a_clear_error() {
    let folder = Folder::new("stability-errors");
    folder.file("box.obj", BOX);
    folder.file("down.csv", DOWN);
    folder.file("scene.toml", SCENE);
    let y = "contact.stiffness=2000:10000:2";
    fails(&folder, 1, &["stability", "scene.toml", "--x", "body.mass", "--y", y], &["table.key=lo:hi:n"]);
    fails(&folder, 1, &["stability", "scene.toml", "--x", y, "--y", y], &["two keys"]);
    let x = "body.mas=0.001:0.1:2";
    fails(&folder, 1, &["stability", "scene.toml", "--x", x, "--y", y], &["did you mean `mass`?"]);
    fails(&folder, 2, &["stability", "scene.toml", "--x", y], &["--y"]);
}
