//! Motions of the hand given by formulas: the sums of sines of the paper's free-space experiment, and way points.

use crate::trajectory::{PoseRow, Trajectory, TrajectoryError};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// A sum of sines under a window, with its derivative.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Amplitude, frequency in hertz, phase in radians.
    pub sines: &'static [[f64; 3]],
}

/// Minimum-jerk step from 0 to 1 over u = 0 to 1, and its derivative by u.
#[must_use]
pub fn minimum_jerk(u: f64) -> (f64, f64) {
    if u <= 0.0 {
        (0.0, 0.0)
    } else if u >= 1.0 {
        (1.0, 0.0)
    } else {
        let u2 = u * u;
        (u2 * u * (10.0 - 15.0 * u + 6.0 * u2), 30.0 * u2 * (1.0 - 2.0 * u + u2))
    }
}

impl Channel {
    fn at(&self, t: f64, duration: f64, ramp: f64) -> (f64, f64) {
        let (rise, rise_rate) = minimum_jerk(t / ramp);
        let (fall, fall_rate) = minimum_jerk((duration - t) / ramp);
        let window = rise * fall;
        let window_rate = (rise_rate * fall - rise * fall_rate) / ramp;
        let (mut value, mut rate) = (0.0, 0.0);
        for &[amplitude, frequency, phase] in self.sines {
            let omega = 2.0 * std::f64::consts::PI * frequency;
            value += amplitude * libm::sin(omega * t + phase);
            rate += amplitude * omega * libm::cos(omega * t + phase);
        }
        (window * value, window_rate * value + window * rate)
    }
}

/// x, y, z (m), roll, pitch, yaw (rad) with orientation Rz(yaw) Ry(pitch) Rx(roll), under a window that rises and falls in `ramp` seconds.
#[derive(Clone, Copy, Debug)]
pub struct SineMotion {
    /// x, y, z, roll, pitch, yaw.
    pub channels: [Channel; 6],
    /// Seconds.
    pub duration: f64,
    /// Seconds.
    pub ramp: f64,
}

/// The hand of Fig. 2: 2.5 s in free space, up to 1.4 m/s.
pub const FREE_SPACE: SineMotion = SineMotion {
    channels: [
        Channel { sines: &[[0.0430, 1.3, 0.3], [0.0122, 2.9, 1.1]] },
        Channel { sines: &[[0.0860, 2.2, 2.0], [0.0074, 3.7, 0.4]] },
        Channel { sines: &[[0.0550, 2.2, 3.4], [0.0122, 3.1, 2.2]] },
        Channel { sines: &[[0.50, 1.7, 0.0], [0.10, 3.1, 1.0]] },
        Channel { sines: &[[0.30, 1.3, 0.9]] },
        Channel { sines: &[[0.35, 1.1, 2.5], [0.08, 2.7, 0.2]] },
    ],
    duration: 2.5,
    ramp: 0.4,
};

impl SineMotion {
    /// Pose and exact velocities at a time.
    #[must_use]
    pub fn at(&self, t: f64) -> PoseRow {
        let c = self.channels.map(|c| c.at(t, self.duration, self.ramp));
        let [roll, pitch, yaw] = [c[3], c[4], c[5]];
        let about = |axis: Vector3<f64>, angle: f64| turn(axis * angle);
        let (z, y, x) =
            (about(Vector3::z(), yaw.0), about(Vector3::y(), pitch.0), about(Vector3::x(), roll.0));
        let omega = Vector3::z() * yaw.1 + z * Vector3::y() * pitch.1 + (z * y) * Vector3::x() * roll.1;
        PoseRow {
            time: t,
            pose: Isometry3::from_parts(Vector3::new(c[0].0, c[1].0, c[2].0).into(), z * y * x),
            velocity: Some([Vector3::new(c[0].1, c[1].1, c[2].1), omega]),
        }
    }

    /// The motion at every `dt`, moved into the world by `world_from_motion`.
    ///
    /// # Errors
    /// A time step that leaves fewer than two rows.
    pub fn trajectory(
        &self,
        dt: f64,
        world_from_motion: &Isometry3<f64>,
    ) -> Result<Trajectory, TrajectoryError> {
        rows(self.duration, dt, world_from_motion, |t| self.at(t))
    }
}

/// A rotation by a rotation vector, with the same bits on every machine.
fn turn(v: Vector3<f64>) -> UnitQuaternion<f64> {
    let angle = libm::sqrt(v.norm_squared());
    let half = 0.5 * angle;
    let s = if angle > 1e-12 { libm::sin(half) / angle } else { 0.5 };
    UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(libm::cos(half), v.x * s, v.y * s, v.z * s))
}

/// One value of six (x, y, z, roll, pitch, yaw) at a time; between way points it moves with minimum jerk.
#[derive(Clone, Debug)]
pub struct WayPoints {
    /// For each channel (x, y, z in metres; a rotation vector in radians): times in rising order with values.
    pub channels: [Vec<(f64, f64)>; 6],
    /// Seconds.
    pub duration: f64,
}

impl WayPoints {
    /// Pose and exact velocity of position at a time. The rotation vector is small, so its rate stands for the angular velocity to
    /// within its square; it is left to the trajectory's differences.
    #[must_use]
    pub fn at(&self, t: f64) -> PoseRow {
        let v: [f64; 6] = std::array::from_fn(|i| between(&self.channels[i], t));
        let pose = Isometry3::from_parts(
            Vector3::new(v[0], v[1], v[2]).into(),
            turn(Vector3::new(v[3], v[4], v[5])),
        );
        PoseRow { time: t, pose, velocity: None }
    }

    /// The motion at every `dt`, moved into the world by `world_from_motion`.
    ///
    /// # Errors
    /// A time step that leaves fewer than two rows.
    pub fn trajectory(
        &self,
        dt: f64,
        world_from_motion: &Isometry3<f64>,
    ) -> Result<Trajectory, TrajectoryError> {
        rows(self.duration, dt, world_from_motion, |t| self.at(t))
    }
}

/// Motions that [`builtin`] knows.
pub const BUILTIN_NAMES: [&str; 4] = ["free-space", "spoon-in-cup", "chewing", "holding"];

/// A built-in motion by its name, at every `dt`, in the world of the built-in scene that uses it.
///
/// # Errors
/// A name that is not among [`BUILTIN_NAMES`], or a time step longer than the motion.
pub fn builtin(name: &str, dt: f64) -> Result<Trajectory, TrajectoryError> {
    match name {
        "free-space" => FREE_SPACE.trajectory(dt, &Isometry3::identity()),
        "spoon-in-cup" => {
            let (motion, world_from_motion) = spoon_in_cup();
            motion.trajectory(dt, &world_from_motion)
        }
        "chewing" => {
            let world_from_motion = Isometry3::from(Translation3::from(crate::scenes::JAW_GRIP));
            chewing().trajectory(dt, &world_from_motion)
        }
        "holding" => {
            let world_from_motion = Isometry3::from(Translation3::from(crate::scenes::JAW_GRIP));
            holding().trajectory(dt, &world_from_motion)
        }
        _ => Err(TrajectoryError {
            file: format!("builtin:{name}"),
            line: None,
            problem: format!("no built-in motion has this name; there are {}", BUILTIN_NAMES.join(", ")),
        }),
    }
}

/// The hand of Fig. 4: 650 ms in the frame of the spoon put through the cup's handle. For 130 ms it slides freely along the spoon, as fast
/// as in free space; then it presses the spoon's handle against the grip of the cup, with about 3.5 N at most.
fn spoon_in_cup() -> (WayPoints, Isometry3<f64>) {
    let mut channels: [Vec<(f64, f64)>; 6] = Default::default();
    channels[0] = vec![(0.0, 0.0), (0.13, 0.035)];
    channels[1] = vec![(0.06, 0.0), (0.30, -0.027), (0.42, -0.023), (0.56, -0.027)];
    channels[2] = vec![(0.25, 0.0), (0.40, 0.010), (0.60, -0.008)];
    channels[5] = vec![(0.10, 0.0), (0.30, 0.08), (0.50, -0.08)];
    // The spoon's x (along it) in the direction of the opening, its z up; at the start its handle is in the middle of the opening
    // at 40 mm from the centre of mass.
    let rotation = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(
        std::f64::consts::FRAC_1_SQRT_2,
        0.0,
        0.0,
        std::f64::consts::FRAC_1_SQRT_2,
    ));
    let in_opening = Vector3::new(0.040, 0.0, 0.0115);
    let centre = Vector3::from(crate::assets::OPENING.centre);
    let grip = Vector3::from(crate::scenes::SPOON_GRIP);
    let origin = centre + rotation * (grip - in_opening);
    (WayPoints { channels, duration: 0.65 }, Isometry3::from_parts(origin.into(), rotation))
}

/// The hand of Fig. 6: 900 ms. It closes the jaws, grinds to the right and to the left while it presses, and opens them. The
/// goal of the way points lies below the lower jaw's teeth: the coupling turns that into a push.
fn chewing() -> WayPoints {
    let mut channels: [Vec<(f64, f64)>; 6] = Default::default();
    channels[0] = vec![(0.24, 0.0), (0.38, 0.0030), (0.56, -0.0030), (0.72, 0.0)];
    channels[1] = vec![(0.28, 0.0), (0.46, 0.0012), (0.64, -0.0012), (0.78, 0.0)];
    channels[2] = vec![
        (0.0, crate::scenes::JAW_OPENING),
        (0.22, -0.0025),
        (0.40, -0.0040),
        (0.52, -0.0025),
        (0.66, -0.0040),
        (0.88, crate::scenes::JAW_OPENING),
    ];
    channels[3] = vec![(0.26, 0.0), (0.42, 0.02), (0.60, -0.02), (0.76, 0.0)];
    channels[5] = vec![(0.24, 0.0), (0.40, 0.03), (0.58, -0.03), (0.76, 0.0)];
    WayPoints { channels, duration: 0.9 }
}

/// The hand of the demonstration: 10 s. It closes the jaws, holds them closed, grinds slowly to either side, taps, holds, and opens them.
fn holding() -> WayPoints {
    let mut channels: [Vec<(f64, f64)>; 6] = Default::default();
    let (open, light, firm) = (crate::scenes::JAW_OPENING, -0.0025, -0.0040);
    channels[0] = vec![(2.5, 0.0), (3.4, 0.0030), (5.0, -0.0030), (6.0, 0.0)];
    channels[1] = vec![(2.8, 0.0), (3.9, 0.0012), (5.3, -0.0012), (6.2, 0.0)];
    channels[2] = vec![
        (0.2, open),
        (0.8, light),
        (1.6, firm),
        (2.4, light),
        (6.2, light),
        (6.6, open),
        (7.0, light),
        (7.4, open),
        (7.8, firm),
        (9.2, firm),
        (9.8, open),
    ];
    channels[3] = vec![(2.6, 0.0), (3.5, 0.02), (5.1, -0.02), (6.1, 0.0)];
    channels[5] = vec![(2.5, 0.0), (3.3, 0.03), (4.8, -0.03), (6.1, 0.0)];
    WayPoints { channels, duration: 10.0 }
}

fn between(points: &[(f64, f64)], t: f64) -> f64 {
    let after = points.partition_point(|p| p.0 <= t);
    match (after.checked_sub(1).map(|i| points[i]), points.get(after)) {
        (None, None) => 0.0,
        (None, Some(&(_, value))) | (Some((_, value)), None) => value,
        (Some((t0, a)), Some(&(t1, b))) => a + (b - a) * minimum_jerk((t - t0) / (t1 - t0)).0,
    }
}

fn rows(
    duration: f64,
    dt: f64,
    world_from_motion: &Isometry3<f64>,
    at: impl Fn(f64) -> PoseRow,
) -> Result<Trajectory, TrajectoryError> {
    let steps = if dt > 0.0 { (duration / dt).round() as usize } else { 0 };
    let rows = (0..=steps)
        .map(|i| {
            let row = at(i as f64 * dt);
            let turned = row.velocity.map(|v| v.map(|u| world_from_motion.rotation * u));
            PoseRow { pose: world_from_motion * row.pose, velocity: turned, ..row }
        })
        .collect();
    Trajectory::from_rows(rows, "built-in motion")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_are_the_derivatives_of_the_poses() {
        let h = 1e-6;
        for step in 1..50 {
            let t = f64::from(step) * 0.05;
            let (a, m, b) = (FREE_SPACE.at(t - h), FREE_SPACE.at(t), FREE_SPACE.at(t + h));
            let [v, omega] = m.velocity.unwrap();
            let rate = (b.pose.translation.vector - a.pose.translation.vector) / (2.0 * h);
            let spin = (b.pose.rotation * a.pose.rotation.inverse()).scaled_axis() / (2.0 * h);
            assert!((rate - v).norm() < 1e-7, "at {t}");
            assert!((spin - omega).norm() < 1e-7, "at {t}");
        }
    }

    #[test]
    fn way_points_are_met_and_left_smoothly() {
        let mut channels: [Vec<(f64, f64)>; 6] = Default::default();
        channels[1] = vec![(0.0, 0.0), (0.2, 0.0195), (0.4, -0.0195), (0.6, 0.0)];
        let motion = WayPoints { channels, duration: 0.65 };
        let y = |t| motion.at(t).pose.translation.vector.y;
        assert_eq!(y(0.2), 0.0195);
        assert!((y(0.1) - 0.00975).abs() < 1e-15);
        assert!((y(0.2 + 1e-3) - y(0.2)).abs() < 1e-6);
        assert_eq!(y(0.65), 0.0);
    }
}
