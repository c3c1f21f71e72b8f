//! How the handle moves: a hand of mass, damping and stiffness after a goal that itself never jumps.

use super::{Hold, Source, Wish};
use hapteron::device::{DeviceCommand, DeviceSample, GRIP_RADIUS, HandParameters};
use hapteron::trajectory::Trajectory;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// Longest step of time that the hand makes; after a longer gap it goes on from where it was, seconds.
const LONGEST_STEP: f64 = 0.005;
/// The goal moves no faster, device scale: m/s and rad/s.
const FASTEST: [f64; 2] = [0.6, 6.0];
/// How fast the handle goes over to another source of motion, device scale: m/s and rad/s, at least within `SHORTEST_CHANGE`.
const CHANGE_SPEED: [f64; 2] = [0.12, 1.5];
const SHORTEST_CHANGE: f64 = 0.3;

/// A mass on a spring and damper that follows a goal and is pushed by the device.
#[derive(Clone, Copy, Debug)]
struct Follower {
    parameters: HandParameters,
    sample: DeviceSample,
}

impl Follower {
    /// Moves on by `dt` while the device pushes with a held force.
    ///
    /// Implicit Euler on each axis, stable for any impedance; the turn towards the goal is small within one step. Real time: constant work.
    fn advance(&mut self, goal: &DeviceSample, command: &DeviceCommand, dt: f64) -> DeviceSample {
        let HandParameters { mass, damping, stiffness } = self.parameters;
        let whole = mass + dt * damping + dt * dt * stiffness;
        let pull = (goal.position - self.sample.position) * stiffness
            + goal.linear_velocity * damping
            + command.force;
        let v = (self.sample.linear_velocity * mass + pull * dt) / whole;
        let r2 = GRIP_RADIUS * GRIP_RADIUS;
        let turn = (goal.orientation * self.sample.orientation.inverse()).scaled_axis();
        let twist = turn * (stiffness * r2) + goal.angular_velocity * (damping * r2) + command.torque;
        let omega = (self.sample.angular_velocity * (mass * r2) + twist * dt) / (whole * r2);
        let finite = |v: &Vector3<f64>| v.iter().all(|c| c.is_finite());
        if finite(&v) && finite(&omega) {
            self.sample.position += v * dt;
            self.sample.orientation = UnitQuaternion::from_scaled_axis(omega * dt) * self.sample.orientation;
            self.sample.linear_velocity = v;
            self.sample.angular_velocity = omega;
        }
        self.sample.time = goal.time;
        self.sample
    }
}

/// Moves the handle, without a clock of its own. Real time: constant work but for the search in the motion, no allocation.
pub(super) struct Mover {
    sample: DeviceSample,
    hand: Follower,
    hold: Hold,
    /// Where the goal is.
    goal: Isometry3<f64>,
    source: Source,
    start: u32,
    /// When the source was changed or the motion started.
    pub(super) since: f64,
    /// From the new source's pose to where the goal was, and how long that takes to vanish.
    leftover: (Isometry3<f64>, f64),
}

impl Mover {
    pub(super) fn new(wish: &Wish) -> Self {
        let sample = standing(&wish.pose, 0.0);
        Self {
            sample,
            hand: Follower { parameters: wish.hold.parameters(), sample },
            hold: wish.hold,
            goal: wish.pose,
            source: wish.source,
            start: wish.start,
            since: 0.0,
            leftover: (Isometry3::identity(), 0.0),
        }
    }

    pub(super) fn advance(
        &mut self,
        wish: &Wish,
        motion: Option<&Trajectory>,
        command: &DeviceCommand,
        now: f64,
        step: f64,
    ) -> DeviceSample {
        let dt = step.clamp(0.0, LONGEST_STEP);
        let source = if motion.is_some() { wish.source } else { Source::Pointer };
        if source != self.source || wish.start != self.start {
            (self.source, self.start, self.since) = (source, wish.start, now);
            let first = self.target(wish, motion, 0.0, dt).0;
            let from = self.goal;
            let offset = Isometry3::from_parts(
                (from.translation.vector - first.translation.vector).into(),
                from.rotation * first.rotation.inverse(),
            );
            let path = offset.translation.vector.norm() / CHANGE_SPEED[0];
            let turn = offset.rotation.angle() / CHANGE_SPEED[1];
            self.leftover = (offset, path.max(turn).max(SHORTEST_CHANGE));
        }
        let goal = self.goal_at(wish, motion, now, dt);
        if wish.hold != self.hold {
            self.hold = wish.hold;
            self.hand = Follower { parameters: self.hold.parameters(), sample: self.sample };
        }
        let exactly = self.hold == Hold::Exact && self.source == Source::Motion;
        let held = DeviceCommand::zero();
        let command = if self.hold == Hold::Exact { &held } else { command };
        self.sample = if dt > 0.0 {
            self.hand.advance(&goal, command, dt)
        } else {
            DeviceSample { time: now, ..self.sample }
        };
        if exactly && dt > 0.0 {
            // A recorded hand is followed as it was, and the simulated one stays with it for when it takes over.
            self.sample = goal;
            self.hand.sample = goal;
        }
        self.sample
    }

    /// The goal with its velocity, after what is left of a change of source and within the greatest speed.
    fn goal_at(&mut self, wish: &Wish, motion: Option<&Trajectory>, now: f64, dt: f64) -> DeviceSample {
        let (offset, duration) = self.leftover;
        let elapsed = now - self.since;
        let left =
            if duration > 0.0 { 1.0 - hapteron::motion::minimum_jerk(elapsed / duration).0 } else { 0.0 };
        // The motion waits until the handle is there.
        let (mut pose, mut velocity) = self.target(wish, motion, elapsed - duration, dt);
        if left > 0.0 {
            velocity = [Vector3::zeros(); 2];
            pose.translation.vector += offset.translation.vector * left;
            pose.rotation =
                UnitQuaternion::from_scaled_axis(offset.rotation.scaled_axis() * left) * pose.rotation;
        }
        if self.source == Source::Pointer {
            pose = limited(&self.goal, &pose, dt);
        }
        self.goal = pose;
        let [linear_velocity, angular_velocity] = velocity;
        DeviceSample { linear_velocity, angular_velocity, ..standing(&pose, now) }
    }

    /// Pose and velocity of the source at a time since its start.
    fn target(
        &self,
        wish: &Wish,
        motion: Option<&Trajectory>,
        time: f64,
        dt: f64,
    ) -> (Isometry3<f64>, [Vector3<f64>; 2]) {
        match (self.source, motion) {
            (Source::Motion, Some(motion)) => {
                let time = if wish.repeat { time.max(0.0) % motion.duration() } else { time.max(0.0) };
                let sample = motion.sample(time, dt.max(1e-4));
                let pose = Isometry3::from_parts(sample.position.into(), sample.orientation);
                (pose, [sample.linear_velocity, sample.angular_velocity])
            }
            _ => (wish.pose, [Vector3::zeros(); 2]),
        }
    }
}

fn standing(pose: &Isometry3<f64>, time: f64) -> DeviceSample {
    DeviceSample {
        time,
        position: pose.translation.vector,
        orientation: pose.rotation,
        linear_velocity: Vector3::zeros(),
        angular_velocity: Vector3::zeros(),
        buttons: 0,
    }
}

/// From one pose towards another, no farther than the greatest speeds allow in `dt`. A pose that is not finite is not followed.
fn limited(from: &Isometry3<f64>, to: &Isometry3<f64>, dt: f64) -> Isometry3<f64> {
    let way = to.translation.vector - from.translation.vector;
    let turn = (to.rotation * from.rotation.inverse()).scaled_axis();
    if !(way.norm().is_finite() && turn.norm().is_finite()) {
        return *from;
    }
    let share = |length: f64, fastest: f64| (fastest * dt / length.max(1e-12)).min(1.0);
    Isometry3::from_parts(
        (from.translation.vector + way * share(way.norm(), FASTEST[0])).into(),
        UnitQuaternion::from_scaled_axis(turn * share(turn.norm(), FASTEST[1])) * from.rotation,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapteron::trajectory::PoseRow;

    const DT: f64 = 1e-3;

    fn wish(x: f64) -> Wish {
        Wish {
            pose: Isometry3::translation(x, 0.0, 0.0),
            source: Source::Pointer,
            hold: Hold::Exact,
            start: 0,
            repeat: false,
        }
    }

    fn swing() -> Trajectory {
        let row = |i: u32| {
            let t = f64::from(i) * DT;
            PoseRow {
                time: t,
                pose: Isometry3::translation(0.0, 0.02 * (1.0 - (6.0 * t).cos()), 0.0),
                velocity: None,
            }
        };
        Trajectory::from_rows((0..2000).map(row).collect(), "swing").unwrap()
    }

    /// Runs ticks and tells the greatest jump of velocity between two of them.
    fn roughest(
        mover: &mut Mover,
        wish: impl Fn(f64) -> Wish,
        motion: Option<&Trajectory>,
        ticks: u32,
    ) -> f64 {
        let mut greatest = 0.0_f64;
        let mut before = mover.sample;
        let push = DeviceCommand::zero();
        for i in 1..=ticks {
            let now = mover.sample.time + DT;
            let sample = mover.advance(&wish(f64::from(i) * DT), motion, &push, now, DT);
            greatest = greatest.max((sample.linear_velocity - before.linear_velocity).norm());
            before = sample;
        }
        greatest
    }

    /// Would catch a handle that jumps as the pointer does: 1 cm from one picture to the next.
    #[test]
    fn a_jump_of_the_pointer_is_a_smooth_motion_of_the_handle() {
        let mut mover = Mover::new(&wish(0.0));
        let rough = roughest(&mut mover, |_| wish(0.01), None, 600);
        assert!(rough < 0.03, "{rough} m/s from tick to tick");
        assert!((mover.sample.position.x - 0.01).abs() < 1e-6, "{}", mover.sample.position.x);
    }

    /// Would catch a change from pointer to motion and back that throws the handle.
    #[test]
    fn the_motion_is_taken_up_and_left_smoothly_and_followed_exactly() {
        let motion = swing();
        let mut mover = Mover::new(&wish(0.05));
        let rough =
            roughest(&mut mover, |_| Wish { source: Source::Motion, ..wish(0.05) }, Some(&motion), 1500);
        assert!(rough < 0.02, "{rough} m/s from tick to tick");
        let playing = mover.sample;
        let lead = mover.leftover.1;
        let exact = motion.sample(playing.time - mover.since - lead, DT);
        assert!((playing.position - exact.position).norm() < 1e-9);
        let place = mover.goal;
        let back = Wish { pose: place, ..wish(0.0) };
        let rough = roughest(&mut mover, |_| back, Some(&motion), 600);
        assert!(rough < 0.13, "{rough} m/s from tick to tick");
        assert!((mover.sample.position - place.translation.vector).norm() < 1e-5);
    }

    /// Would catch a hand that does not give way, or gives way when it is not to.
    #[test]
    fn only_a_yielding_hand_gives_way_to_the_force() {
        for (hold, expected) in [(Hold::Exact, 0.0), (Hold::Light, 0.01), (Hold::Firm, 1.0 / 700.0)] {
            let told = Wish { hold, ..wish(0.0) };
            let mut mover = Mover::new(&told);
            let push = DeviceCommand { force: Vector3::x(), torque: Vector3::zeros() };
            for i in 1..3000 {
                mover.advance(&told, None, &push, f64::from(i) * DT, DT);
            }
            assert!((mover.sample.position.x - expected).abs() < 1e-6, "{hold:?}");
        }
    }

    /// Would catch a number that is not finite on its way from the window to the handle.
    #[test]
    fn a_goal_that_is_not_finite_is_not_followed() {
        let mut mover = Mover::new(&wish(0.0));
        let bad = Wish { pose: Isometry3::translation(f64::NAN, 0.0, 0.0), ..wish(0.0) };
        for i in 1..100 {
            let sample = mover.advance(&bad, None, &DeviceCommand::zero(), f64::from(i) * DT, DT);
            assert_eq!(sample.position, Vector3::zeros());
        }
    }
}
