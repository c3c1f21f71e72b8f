//! One state frame of the service, in the service's axes (x right, y forward, z up).

use super::json::{Json, NotJson};
use crate::drivers::motion::unit;
use nalgebra::{UnitQuaternion, Vector3};

/// What a frame tells about the devices that are looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame<'a> {
    /// The Inverse3.
    pub inverse: Option<Inverse<'a>>,
    /// The grip that gives the orientation.
    pub grip: Option<Grip<'a>>,
    /// Number of Inverse3 in the frame.
    pub inverses: u32,
}

/// An Inverse3's part of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inverse<'a> {
    /// `device_id`, as written.
    pub id: &'a str,
    /// Metres.
    pub position: Option<Vector3<f64>>,
    /// m/s.
    pub velocity: Option<Vector3<f64>>,
    /// It knows where it is.
    pub calibrated: Option<bool>,
    /// Its motors have power.
    pub powered: Option<bool>,
    /// It takes commands.
    pub ready: Option<bool>,
    /// The frame has fields that came with service 3.5.
    pub newer: bool,
    /// It stands left.
    pub left_handed: bool,
}

/// A VerseGrip's part of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Grip<'a> {
    /// `device_id`, as written.
    pub id: &'a str,
    /// Grip axes to the service's.
    pub orientation: Option<UnitQuaternion<f64>>,
    /// Bit i is set while button i is down.
    pub buttons: u32,
}

/// Buttons by bit.
const BUTTONS: [&str; 10] = ["a", "b", "c", "d", "e", "f", "up", "down", "left", "right"];

impl<'a> Frame<'a> {
    /// Reads a frame. `inverse` and `grip` choose the devices; without a choice it is the first of each. Unknown keys are ignored, keys come in any order.
    /// Real time: no allocation; work in proportion to the text.
    ///
    /// # Errors
    /// No JSON, or known keys with values of another kind.
    pub fn read(text: &'a str, inverse: Option<&str>, grip: Option<&str>) -> Result<Self, NotJson> {
        let mut frame = Self::default();
        let mut json = Json::new(text);
        json.object(|key, json| match key {
            "inverse3" => json.array(|json| {
                let found = read_inverse(json)?;
                frame.inverses += 1;
                if frame.inverse.is_none() && inverse.is_none_or(|id| id == found.id) {
                    frame.inverse = Some(found);
                }
                Ok(())
            }),
            "verse_grip" | "wireless_verse_grip" | "custom_verse_grip" => json.array(|json| {
                let found = read_grip(json)?;
                if frame.grip.is_none() && grip.is_none_or(|id| id == found.id) {
                    frame.grip = Some(found);
                }
                Ok(())
            }),
            _ => json.skip(),
        })?;
        json.end()?;
        Ok(frame)
    }
}

fn read_inverse<'a>(json: &mut Json<'a>) -> Result<Inverse<'a>, NotJson> {
    let mut found = Inverse::default();
    json.object(|key, json| match key {
        "device_id" => json.string().map(|id| found.id = id),
        "state" => json.object(|key, json| match key {
            "cursor_position" => vector(json).map(|v| found.position = v),
            "cursor_velocity" => vector(json).map(|v| found.velocity = v),
            "control_mode" | "control_domain" | "current_cursor_force" | "transform_velocity" => {
                found.newer = true;
                json.skip()
            }
            _ => json.skip(),
        }),
        "status" => json.object(|key, json| match key {
            "calibrated" => json.boolean().map(|b| found.calibrated = Some(b)),
            "power_supply" => json.boolean().map(|b| found.powered = Some(b)),
            "ready" => json.boolean().map(|b| found.ready = Some(b)),
            _ => json.skip(),
        }),
        "config" if json.peek() == b'{' => json.object(|key, json| match key {
            "handedness" if json.peek() == b'"' => json.string().map(|h| found.left_handed = h == "left"),
            _ => json.skip(),
        }),
        _ => json.skip(),
    })?;
    Ok(found)
}

fn read_grip<'a>(json: &mut Json<'a>) -> Result<Grip<'a>, NotJson> {
    let mut found = Grip::default();
    json.object(|key, json| match key {
        "device_id" => json.string().map(|id| found.id = id),
        "state" => json.object(|key, json| match key {
            "orientation" if json.peek() == b'{' => {
                let [w, x, y, z] = parts(json, ["w", "x", "y", "z"])?;
                found.orientation = match (w, x, y, z) {
                    // An identity may be left out.
                    (None, None, None, None) => Some(UnitQuaternion::identity()),
                    (Some(w), Some(x), Some(y), Some(z)) => Some(unit(w, x, y, z).ok_or(NotJson)?),
                    _ => return Err(NotJson),
                };
                Ok(())
            }
            "button" if matches!(json.peek(), b't' | b'f') => {
                json.boolean().map(|down| found.buttons |= u32::from(down))
            }
            "buttons" if json.peek() == b'{' => {
                json.object(|key, json| match BUTTONS.iter().position(|b| *b == key) {
                    Some(bit) => json.boolean().map(|down| found.buttons |= u32::from(down) << bit),
                    None => json.skip(),
                })
            }
            _ => json.skip(),
        }),
        _ => json.skip(),
    })?;
    Ok(found)
}

/// The named numbers of an object.
fn parts<const N: usize>(json: &mut Json<'_>, names: [&str; N]) -> Result<[Option<f64>; N], NotJson> {
    let mut found = [None; N];
    json.object(|key, json| match names.iter().position(|n| *n == key) {
        Some(i) => json.number().map(|x| found[i] = Some(x)),
        None => json.skip(),
    })?;
    Ok(found)
}

/// A vector with all three parts; `None` for null.
fn vector(json: &mut Json<'_>) -> Result<Option<Vector3<f64>>, NotJson> {
    if json.peek() == b'n' {
        return json.skip().map(|()| None);
    }
    match parts(json, ["x", "y", "z"])? {
        [Some(x), Some(y), Some(z)] => Ok(Some(Vector3::new(x, y, z))),
        _ => Err(NotJson),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: &str = r#"{"verse_grip":[],"new key":[{"x":[1,2,{}]}],
        "wireless_verse_grip":[{"status":{"awake":false},"device_id":"1102","state":{"battery_level":0.15,
            "buttons":{"a":false,"b":true,"c":false,"left":true,"z":3},"hall":16,
            "orientation":{"x":-0.0016784668,"y":-0.037994385,"z":-0.74890137,"w":0.65896606}}}],
        "inverse3":[
            {"device_id":"other","state":{"cursor_position":{"x":9,"y":9,"z":9}},"status":{}},
            {"config":{"handedness":"left","cursor_offset":null},"status":{"ready":true,"calibrated":true,"power_supply":false},
             "state":{"mode":"idle","cursor_velocity":{"z":-0.25,"y":-2e-5,"x":0.5},"cursor_position":{"y":0.0389,"x":0.1279,"z":-0.0508}},
             "device_id":"04C3"}]}"#;

    /// Guards the fields of a frame with keys in other orders, several devices and unknown keys.
    #[test]
    fn a_whole_frame() {
        let frame = Frame::read(FRAME, Some("04C3"), None).unwrap();
        let inverse = frame.inverse.unwrap();
        assert_eq!(inverse.position, Some(Vector3::new(0.1279, 0.0389, -0.0508)));
        assert_eq!(inverse.velocity, Some(Vector3::new(0.5, -2e-5, -0.25)));
        assert_eq!(
            (inverse.calibrated, inverse.ready, inverse.powered),
            (Some(true), Some(true), Some(false))
        );
        assert!(inverse.left_handed && !inverse.newer);
        let grip = frame.grip.unwrap();
        assert_eq!((grip.id, grip.buttons), ("1102", 0b01_0000_0010));
        // As a device sends it: not quite of unit length.
        let raw = nalgebra::Quaternion::new(0.65896606, -0.0016784668, -0.037994385, -0.74890137);
        assert!(grip.orientation.unwrap().angle_to(&UnitQuaternion::from_quaternion(raw)) < 1e-9);
        assert_eq!(Frame::read(FRAME, None, None).unwrap().inverse.unwrap().id, "other");
        assert!(Frame::read(FRAME, Some("none"), Some("none")).unwrap().inverse.is_none());
    }

    /// Guards against frames that are cut anywhere, and against values that would be a jump to zero.
    #[test]
    fn damaged_frames_are_refused() {
        for end in (0..FRAME.len()).filter(|i| FRAME.is_char_boundary(*i)) {
            assert!(Frame::read(&FRAME[..end], None, None).is_err(), "{end}");
        }
        for damage in [
            FRAME.replace("\"x\":0.1279,", ""),
            FRAME.replace("0.1279", "1e999"),
            FRAME.replace("0.1279", "\"0.1279\""),
            FRAME.replace("-0.74890137", "-7.4890137"),
        ] {
            assert!(Frame::read(&damage, None, None).is_err(), "{damage}");
        }
    }
}
