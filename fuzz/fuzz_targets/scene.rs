//! Scene files: an error, or a scene that writes and reads back.

#![no_main]

use hapteron::scene::{Changes, Scene, parse_file};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(file) = parse_file(text, "fuzz") else { return };
    let written = file.to_toml().expect("what was read can be written");
    parse_file(&written, "written").expect("what was written reads");
    // No path, so that the fuzzer opens no file of the machine.
    if !text.contains('/') {
        let _ = Scene::parse(text, "fuzz", std::path::Path::new("/nonexistent"), &Changes::default());
    }
});
