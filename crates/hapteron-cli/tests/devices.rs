//! `hapteron devices`, with and without devices.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Folder, hapteron_command, stderr, stdout};
use serde_json::Value;

/// Would catch a survey that says nothing about what is missing and how to get it.
#[test]
fn tells_what_is_missing_and_how_to_get_it() {
    let folder = Folder::new("devices-none");
    let output = hapteron_command(&folder, &["devices"])
        .env("HAPTERON_DRD_LIBRARY", "/nowhere/libdrd.so")
        .env("HAPTERON_HD_LIBRARY", "/nowhere/libHD.so")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    for words in [
        "force-dimension: Force Dimension delta, omega, sigma, lambda; Novint Falcon",
        "/nowhere/libdrd.so",
        "https://www.forcedimension.com",
        "openhaptics: 3D Systems Touch",
        "/nowhere/libHD.so",
        "haply: Haply Inverse3",
        "spacemouse: 3Dconnexion",
        "vrpn: any tracker",
    ] {
        assert!(text.contains(words), "no '{words}' in {text}");
    }
}

/// Would catch attached devices that are not listed, or listed without their capabilities; and JSON that differs from the text.
#[test]
#[cfg(unix)]
fn lists_attached_devices_with_their_capabilities() {
    let folder = Folder::new("devices-some");
    let test = std::env::current_exe().unwrap();
    let name = format!("{}hapteron_emulators{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let library = test.ancestors().skip(1).map(|f| f.join(&name)).find(|f| f.exists()).unwrap();
    let run = |options: &[&str]| {
        let daemon = hapteron_emulators::Spacenavd::start(1);
        let output = hapteron_command(&folder, options)
            .env("HAPTERON_DRD_LIBRARY", &library)
            .env("HAPTERON_HD_LIBRARY", &library)
            .env("SPNAV_SOCKET", daemon.path())
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    let text = run(&["devices"]);
    for words in [
        "attached: Force Dimension sigma.7 (kind = \"force-dimension\"; index = 0, serial = 1234)",
        "senses 6 axes, drives 6",
        "peak force 12 N",
        "drops the force by itself",
        "attached: OpenHaptics Emulated Premium 1.5",
        "paced by the vendor's scheduler",
        "workspace 380 x 270 x 170 mm",
        "attached: 3Dconnexion SpaceMouse",
        "drives none",
    ] {
        assert!(text.contains(words), "no '{words}' in {text}");
    }
    let json: Value = serde_json::from_str(&run(&["devices", "--json"])).unwrap();
    let kinds: Vec<&str> = json.as_array().unwrap().iter().map(|d| d["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["force-dimension", "openhaptics", "haply", "spacemouse", "vrpn"]);
    assert_eq!(json[0]["attached"][0]["peak_torque"], 0.2);
    assert_eq!(json[0]["missing"], Value::Null);
    assert_eq!(json[1]["attached"][0]["continuous_force"], 1.4);
    assert_eq!(json[1]["attached"][0]["stiffness"], 3500.0);
    assert_eq!(json[3]["attached"][0]["stiffness"], 0.0);
}
