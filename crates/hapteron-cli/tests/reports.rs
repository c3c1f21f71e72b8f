//! What the commands write for people to look at.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Folder, fails, hapteron, stderr, stdout};

/// A report that needs nothing from elsewhere, and whose numbers for the plots can be read.
fn assert_self_contained(html: &str, plots: usize, pictures: usize) {
    assert!(html.starts_with("<!doctype html>") && html.trim_end().ends_with("</html>"));
    for reference in ["http://", "https://", "src=\"/", "href=", "@import", "url("] {
        assert!(!html.contains(reference), "refers to something else by {reference}");
    }
    assert_eq!(html.matches("data:image/png;base64,").count(), pictures);
    let mut found = 0;
    for part in html.split("<script type=\"application/json\">").skip(1) {
        let json = part.split("</script>").next().unwrap();
        let value: serde_json::Value = serde_json::from_str(json).unwrap();
        for plot in value["plots"].as_array().unwrap() {
            found += 1;
            for series in plot["series"].as_array().unwrap() {
                let times = &value["times"][series["time"].as_u64().unwrap() as usize];
                let values = series["ys"].as_array().unwrap();
                assert_eq!(times.as_array().unwrap().len(), values.len(), "{}", plot["title"]);
                assert!(values.iter().any(|v| v.is_number()), "{} is empty", plot["title"]);
            }
        }
    }
    assert_eq!(found, plots);
}

/// Would catch a demo that fails, shows a scene without contact, or a session that does not come again from its log bit for bit.
#[test]
fn demo_in_real_time_comes_again_from_its_log() {
    let folder = Folder::new("demo");
    let output = hapteron(&folder, &["demo", "--duration", "2"]);
    let text = stdout(&output);
    assert!(
        text.contains("in real time") && text.contains("runs/demo/report.html"),
        "{}{text}",
        stderr(&output)
    );
    assert!(text.contains("a bare loop between the ticks"), "{text}");
    assert_self_contained(&folder.read("runs/demo/report.html"), 7 + 2 + 3, 3);
    let timing: serde_json::Value = serde_json::from_str(&folder.read("runs/demo/timing.json")).unwrap();
    let (ticks, missed) = (timing["ticks"].as_u64().unwrap(), timing["missed_deadlines"].as_u64().unwrap());
    assert_eq!(
        (timing["end"].as_str(), timing["records_lost"].as_u64()),
        (Some("the time was over"), Some(0))
    );
    // Deadlines after the last tick are nobody's.
    assert!((1900..=2000).contains(&(ticks + missed)), "{ticks} ticks, {missed} missed");
    assert_eq!(timing["nanoseconds"]["compute"]["count"].as_u64(), Some(ticks));

    let log = ["--replay", "runs/demo/device.csv"];
    hapteron(&folder, &[&["run", "runs/demo/scene.toml", "--out", "again"], &log[..]].concat());
    assert!(folder.read("again/run.csv") == folder.read("runs/demo/run.csv"), "made again it is different");
    let soft = ["run", "runs/demo/scene.toml", "--set", "contact.stiffness=1000", "--out", "soft"];
    let output = hapteron(&folder, &[&soft[..], &log[..]].concat());
    assert!(stdout(&output).contains("a session made again"), "{}", stderr(&output));
    let output = hapteron(&folder, &["compare", "runs/demo", "soft"]);
    let rms = stdout(&output);
    let rms = rms.lines().find(|l| l.starts_with("rms difference of body")).unwrap();
    assert!(!rms.ends_with(" 0.0000 mm"), "{rms}");
}

/// Would catch a demo whose jaws do not touch, sink in, or shake in the hand.
#[test]
fn demo_in_virtual_time_holds_the_jaws_closed() {
    let folder = Folder::new("demo-virtual");
    let output = hapteron(&folder, &["demo", "--virtual-time", "--duration", "2.5"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stdout(&output).contains("virtual time, stable"), "{}", stdout(&output));
    assert!(stdout(&output).contains("never crossed"), "{}", stdout(&output));
}

/// Would catch an experiment of the paper that no longer comes out, or a report without it.
#[test]
fn reproduce_holds_every_row() {
    let folder = Folder::new("reproduce");
    let output = hapteron(&folder, &["reproduce", "--out", "r"]);
    assert!(output.status.success(), "{}{}", stdout(&output), stderr(&output));
    let text = stdout(&output);
    assert!(!text.contains("does not hold") && text.contains("32 of 32 rows hold"), "{text}");
    let html = folder.read("r/report.html");
    assert_self_contained(&html, 2 + 5 * 3, 0);
    for figure in ["Fig. 2", "Fig. 4", "Fig. 6"] {
        assert!(text.contains(figure) && html.contains(figure), "{figure}");
    }
    for curve in
        ["r/fig2/backward-euler-10-g.csv", "r/fig4/backward-euler-10-g-2-kn-m.csv", "r/fig6/with-100-hz.csv"]
    {
        assert!(folder.read(curve).starts_with("t,handle_px"), "{curve}");
    }
}

/// Would catch a comparison that mixes up the runs or misses a difference.
#[test]
fn compare_puts_two_runs_side_by_side() {
    let folder = Folder::new("compare");
    hapteron(&folder, &["models", "m"]);
    for (name, stiffness) in [("soft", "1000"), ("hard", "8000")] {
        let set = format!("contact.stiffness={stiffness}");
        let run = ["run", "m/spoon_in_cup.toml", "--virtual-time", "--set", &set, "--out", name];
        let output = hapteron(&folder, &run);
        assert!(output.status.success(), "{}", stderr(&output));
    }
    let output = hapteron(&folder, &["compare", "soft", "hard/run.csv"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    let header: Vec<&str> = text.lines().next().unwrap().split_whitespace().collect();
    assert_eq!(header, ["soft", "hard", "difference"]);
    let depth = text.lines().find(|l| l.starts_with("greatest penetration")).unwrap();
    let numbers: Vec<f64> = depth.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    assert!(numbers[1] < numbers[0] && numbers[2] < 0.0, "{depth}");
    assert_self_contained(&folder.read("runs/compare/report.html"), 6, 0);
    let same = stdout(&hapteron(&folder, &["compare", "soft", "soft", "--out", "c"]));
    let rms = same.lines().find(|l| l.starts_with("rms difference of feedback")).unwrap();
    assert!(rms.ends_with("0.0000 N"), "{rms}");
    fails(&folder, 1, &["compare", "soft", "nowhere"], &["nowhere"]);
    folder.file("other.csv", "a,b\n1,2\n");
    fails(&folder, 1, &["compare", "soft", "other.csv"], &["other.csv", "line 1"]);
}

/// Would catch a scene that starts wedged without a word.
#[test]
fn a_start_inside_the_obstacle_is_told() {
    let folder = Folder::new("inside");
    folder.file(
        "s.toml",
        "[body]\nmesh = \"builtin:spoon\"\nmass = 0.01\n[[obstacle]]\nmesh = \"builtin:spoon\"\nposition = [0, 0, 0.001]\n\
         [hand]\ntrajectory = \"t.csv\"\n",
    );
    folder.file("t.csv", "t,px,py,pz,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n0.02,0,0,0,1,0,0,0\n");
    let output = hapteron(&folder, &["run", "s.toml", "--virtual-time", "--out", "r"]);
    assert!(stderr(&output).contains("already cross"), "{}", stderr(&output));
    assert!(folder.read("r/report.html").contains("already cross"));
}
