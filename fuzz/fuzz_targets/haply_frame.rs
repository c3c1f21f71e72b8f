//! State frames of Haply's service: an error or finite numbers, and no JSON that serde_json would refuse.

#![no_main]

use hapteron_device::drivers::haply::frame::Frame;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(frame) = Frame::read(text, None, None) else { return };
    assert!(serde_json::from_str::<serde_json::Value>(text).is_ok());
    if let Some(inverse) = frame.inverse {
        let vectors = inverse.position.iter().chain(inverse.velocity.iter());
        assert!(vectors.flat_map(|v| v.iter()).all(|c| c.is_finite()));
    }
    if let Some(q) = frame.grip.and_then(|g| g.orientation) {
        assert!((q.norm() - 1.0).abs() < 1e-9);
    }
});
