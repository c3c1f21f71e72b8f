//! What spacenavd sends: the same records in whatever pieces, and no button without a bit.

#![no_main]

use hapteron_device::drivers::spacemouse::events::{Event, Events};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (mut whole, mut pieces) = (Vec::new(), Vec::new());
    Events::default().push(bytes, |e| whole.push(e));
    let mut events = Events::default();
    for piece in bytes.chunks(7) {
        events.push(piece, |e| pieces.push(e));
    }
    assert_eq!(whole, pieces);
    assert!(whole.iter().all(|e| !matches!(e, Event::Button(b, _) if *b > 31)));
});
