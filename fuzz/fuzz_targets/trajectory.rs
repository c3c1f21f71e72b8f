//! Trajectories and pose lists: an error or samples that are finite at any time.

#![no_main]

use hapteron::trajectory::Trajectory;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(trajectory) = Trajectory::parse(bytes, "fuzz") else { return };
    for share in [-1.0, 0.0, 0.3, 0.999, 1.0, 2.0] {
        let sample = trajectory.sample(share * trajectory.duration(), 1e-3);
        assert!(sample.position.iter().chain(sample.orientation.coords.iter()).all(|c| c.is_finite()), "{share}");
        assert!(sample.linear_velocity.iter().all(|c| c.is_finite()), "{share}");
    }
});
