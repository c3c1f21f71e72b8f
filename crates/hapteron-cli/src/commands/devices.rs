//! `hapteron devices`: what can be driven from this machine, and what is missing for the rest.

use crate::arguments::Devices;
use anyhow::Result;
use hapteron::device::drivers::{self, Attached, DriverSurvey};
use hapteron::device::{Capabilities, Pacing};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::Write as _;
use std::process::ExitCode;

/// Runs the command.
pub fn devices(arguments: &Devices) -> Result<ExitCode> {
    let survey = drivers::survey();
    let mut out = std::io::stdout().lock();
    if arguments.json {
        let list: Vec<Value> = survey.iter().map(driver_json).collect();
        writeln!(out, "{}", serde_json::to_string_pretty(&list)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    for (i, driver) in survey.iter().enumerate() {
        if i > 0 {
            writeln!(out)?;
        }
        write!(out, "{}", driver_text(driver))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn driver_text(driver: &DriverSurvey) -> String {
    let mut text = format!("{}: {}\n", driver.kind, driver.devices);
    for device in &driver.attached {
        text += &device_text(driver.kind, device);
    }
    for note in &driver.notes {
        let _ = writeln!(text, "  note: {note}");
    }
    match &driver.missing {
        Some(missing) => {
            let _ = writeln!(text, "  not available: {}", missing.to_string().replace('\n', "\n  "));
        }
        None if driver.attached.is_empty() => text += "  no device attached\n",
        None => {}
    }
    text
}

fn device_text(kind: &str, device: &Attached) -> String {
    let c = &device.capabilities;
    let mut text = format!("  attached: {} (kind = \"{kind}\"; {})\n", c.name, device.address);
    let axes = |rotation: bool| if rotation { 6 } else { 3 };
    let drives = match (c.drives_force, c.drives_torque) {
        (false, _) => "drives none".to_owned(),
        (true, torque) => format!("drives {}", axes(torque)),
    };
    let _ = writeln!(text, "    senses {} axes, {drives}", axes(c.senses_rotation));
    let mut limits = Vec::new();
    for (name, value, unit) in limits_of(c) {
        if value.is_finite() && value > 0.0 {
            limits.push(format!("{name} {value} {unit}"));
        }
    }
    if !limits.is_empty() {
        let _ = writeln!(text, "    {}", limits.join(", "));
    }
    let [low, high] = &c.workspace;
    if high != low {
        let size = (high - low) * 1e3;
        let _ = writeln!(text, "    workspace {:.0} x {:.0} x {:.0} mm", size.x, size.y, size.z);
    }
    let _ = writeln!(
        text,
        "    {} Hz, {}, up to {} buttons{}",
        c.rate,
        pacing(c.pacing),
        c.buttons,
        match (c.drives_force, c.force_persists, c.hardware_watchdog) {
            (false, _, _) => "",
            (true, _, true) => ", drops the force by itself when the host falls silent",
            (true, true, false) => ", holds the last force when the host falls silent",
            (true, false, false) => ", force only while it is commanded",
        }
    );
    text
}

fn limits_of(c: &Capabilities) -> [(&'static str, f64, &'static str); 7] {
    [
        ("peak force", c.peak_force, "N"),
        ("continuous force", c.continuous_force, "N"),
        ("peak torque", c.peak_torque, "N m"),
        ("continuous torque", c.continuous_torque, "N m"),
        ("stiffness", c.max_stiffness, "N/m"),
        ("angular stiffness", c.max_angular_stiffness, "N m/rad"),
        ("damping", c.max_damping, "N s/m"),
    ]
}

fn pacing(pacing: Pacing) -> &'static str {
    match pacing {
        Pacing::Polled => "polled",
        Pacing::Callback => "paced by the vendor's scheduler",
        Pacing::Exchange => "one answer for each command",
    }
}

fn driver_json(driver: &DriverSurvey) -> Value {
    json!({
        "kind": driver.kind,
        "devices": driver.devices,
        "attached": driver.attached.iter().map(device_json).collect::<Vec<_>>(),
        "notes": driver.notes,
        "missing": driver.missing.as_ref().map(ToString::to_string),
    })
}

/// SI units; a limit that is not known is null.
fn device_json(device: &Attached) -> Value {
    let c = &device.capabilities;
    let corner = |v: &nalgebra::Vector3<f64>| [v.x, v.y, v.z];
    let mut value = json!({
        "address": device.address,
        "name": c.name,
        "senses_rotation": c.senses_rotation,
        "drives_force": c.drives_force,
        "drives_torque": c.drives_torque,
        "workspace": c.workspace.iter().map(corner).collect::<Vec<_>>(),
        "rate": c.rate,
        "buttons": c.buttons,
        "force_persists": c.force_persists,
        "hardware_watchdog": c.hardware_watchdog,
        "pacing": pacing(c.pacing),
    });
    for (name, limit, _) in limits_of(c) {
        value[name.replace(' ', "_")] = if limit.is_finite() { limit.into() } else { Value::Null };
    }
    value
}
