//! Recordings: what reads is written and read again.

#![no_main]

use hapteron::recording::Recording;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(recording) = Recording::read_csv(bytes, "fuzz") else { return };
    let mut written = Vec::new();
    recording.write_csv(&mut written).expect("memory takes all");
    let again = Recording::read_csv(&written, "written").expect("what was written reads");
    assert_eq!(again.rows.len(), recording.rows.len());
});
