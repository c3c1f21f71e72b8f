//! What spacenavd says: records of eight 32-bit numbers in the machine's byte order, cut out of a stream.

/// Bytes of a record.
pub const RECORD: usize = 32;

/// A record that this driver uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Counts of the cap's displacement x, y, z and rotation rx, ry, rz, and the milliseconds since the last.
    Motion([i32; 6], i32),
    /// A button and whether it is down.
    Button(u32, bool),
    /// A device came (true) or went.
    Device(bool),
    /// An answer to a request, an event of another kind.
    Other,
}

/// Cuts a stream into records, whatever pieces it comes in.
#[derive(Clone, Copy, Debug)]
pub struct Events {
    partial: [u8; RECORD],
    filled: usize,
}

impl Default for Events {
    fn default() -> Self {
        Self { partial: [0; RECORD], filled: 0 }
    }
}

impl Events {
    /// Takes bytes and tells every whole record. Real time: no allocation.
    pub fn push(&mut self, bytes: &[u8], mut tell: impl FnMut(Event)) {
        for byte in bytes {
            self.partial[self.filled] = *byte;
            self.filled += 1;
            if self.filled == RECORD {
                self.filled = 0;
                tell(event(&self.partial));
            }
        }
    }
}

fn event(record: &[u8; RECORD]) -> Event {
    let mut n = [0; 8];
    for (number, bytes) in n.iter_mut().zip(record.chunks_exact(4)) {
        *number = i32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    }
    match n[0] {
        0 => Event::Motion([n[1], n[2], n[3], n[4], n[5], n[6]], n[7]),
        1 | 2 => match u32::try_from(n[1]) {
            Ok(button) if button < 32 => Event::Button(button, n[0] == 1),
            _ => Event::Other,
        },
        3 => match n[1] {
            0 => Event::Device(true),
            1 => Event::Device(false),
            _ => Event::Other,
        },
        _ => Event::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all(pieces: &[&[u8]]) -> Vec<Event> {
        let (mut events, mut seen) = (Events::default(), Vec::new());
        for piece in pieces {
            events.push(piece, |e| seen.push(e));
        }
        seen
    }

    proptest! {
        /// Guards the cutting: any stream in any two pieces gives what it gives in one, and never a button that has no bit.
        #[test]
        fn pieces_do_not_matter(bytes in prop::collection::vec(any::<u8>(), 0..300), cut in any::<prop::sample::Index>()) {
            let at = cut.index(bytes.len() + 1);
            let whole = all(&[&bytes]);
            prop_assert_eq!(whole.len(), bytes.len() / RECORD);
            prop_assert_eq!(&whole, &all(&[&bytes[..at], &bytes[at..]]));
            prop_assert!(whole.iter().all(|e| !matches!(e, Event::Button(b, _) if *b > 31)));
        }
    }
}
