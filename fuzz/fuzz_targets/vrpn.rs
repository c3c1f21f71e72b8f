//! What a VRPN server sends: an error or messages whose numbers are finite.

#![no_main]

use hapteron_device::drivers::vrpn::message::Incoming;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut incoming = Incoming::default();
    let mut bytes = bytes;
    while !bytes.is_empty() {
        let room = incoming.room();
        let count = room.len().min(bytes.len()).min(61);
        room[..count].copy_from_slice(&bytes[..count]);
        incoming.filled(count);
        bytes = &bytes[count..];
        loop {
            match incoming.next_message() {
                Err(_) => return,
                Ok(None) => break,
                Ok(Some(message)) => {
                    let _ = (message.name(), message.button(), message.error());
                    if let Some((_, p, q)) = message.pose() {
                        assert!(p.iter().chain(q.coords.iter()).all(|c| c.is_finite()));
                    }
                    if let Some((_, v, w)) = message.velocity() {
                        assert!(v.iter().chain(w.iter()).all(|c| c.is_finite()));
                    }
                }
            }
        }
    }
});
