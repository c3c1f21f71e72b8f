//! What the tests of the guard need.
#![allow(dead_code)]

use hapteron_device::guard::{GuardInput, GuardSettings};
use hapteron_device::{DeviceCommand, DeviceSample};
use nalgebra::{UnitQuaternion, Vector3};

/// Seconds.
pub const DT: f64 = 1e-3;

/// The limits of a Premium 1.5 6DOF.
pub fn premium() -> GuardSettings {
    GuardSettings::within(8.5, 0.5, DT)
}

/// A handle at rest.
pub fn at(position: Vector3<f64>) -> DeviceSample {
    DeviceSample {
        time: 0.0,
        position,
        orientation: UnitQuaternion::identity(),
        linear_velocity: Vector3::zeros(),
        angular_velocity: Vector3::zeros(),
        buttons: 0,
    }
}

/// Along z, N.
pub fn pushing(force: f64) -> DeviceCommand {
    DeviceCommand { force: Vector3::z() * force, torque: Vector3::zeros() }
}

/// A tick in which nothing is wrong.
pub fn input(command: DeviceCommand, sample: DeviceSample, tick: u32) -> GuardInput {
    let time = f64::from(tick) * DT;
    GuardInput { command, sample, time, contact_age: DT, sample_age: 0.0, simulation_fault: false }
}

/// SplitMix64: fast and the same everywhere.
pub struct Rng(pub u64);

impl Rng {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From -1 to 1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (2.0 / (1u64 << 53) as f64) - 1.0
    }

    pub fn one_in(&mut self, n: u64) -> bool {
        self.bits().is_multiple_of(n)
    }
}
