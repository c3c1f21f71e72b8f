//! VRPN's wire format: messages of 24 bytes of header and a payload, big endian, padded to multiples of 8; and a cookie before the first.

use nalgebra::{UnitQuaternion, Vector3};

/// What both sides say first.
pub const COOKIE: &[u8; 24] = b"vrpn: ver. 07.38  0\0\0\0\0\0";
/// Names of the other side's senders and message types.
pub const SENDER_DESCRIPTION: i32 = -1;
/// See [`SENDER_DESCRIPTION`].
pub const TYPE_DESCRIPTION: i32 = -2;
/// The other side goes.
pub const DISCONNECT: i32 = -5;

const HEADER: usize = 24;
/// A payload larger than this belongs to no tracker or force device.
const LARGEST_PAYLOAD: usize = 16 * 1024;
const CAPACITY: usize = 64 * 1024;

/// What came is not VRPN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotVrpn;

/// Whether a cookie is of a version that this driver speaks: 7, whatever the minor version.
#[must_use]
pub fn cookie_is_known(cookie: &[u8; 24]) -> bool {
    cookie.starts_with(b"vrpn: ver. 07.")
}

/// One message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message<'a> {
    /// The sender's clock, microseconds.
    pub time: i64,
    /// Number of the sender in its own table.
    pub sender: i32,
    /// Number of the message type in the sender's table; negative ones belong to the system.
    pub kind: i32,
    /// Without padding.
    pub payload: &'a [u8],
}

/// Bytes that came, cut into messages. The memory is taken once.
#[derive(Debug)]
pub struct Incoming {
    bytes: Box<[u8]>,
    start: usize,
    end: usize,
}

impl Default for Incoming {
    fn default() -> Self {
        Self { bytes: vec![0; CAPACITY].into(), start: 0, end: 0 }
    }
}

impl Incoming {
    /// Where the next bytes go, and [`Incoming::filled`] then tells how many they were. Never empty.
    pub fn room(&mut self) -> &mut [u8] {
        self.bytes.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
        &mut self.bytes[self.end..]
    }

    /// So many bytes have been put into the room.
    pub fn filled(&mut self, count: usize) {
        self.end = (self.end + count).min(self.bytes.len());
    }

    /// The next whole message. Real time: no allocation.
    ///
    /// # Errors
    /// A length that cannot be: the stream is lost.
    pub fn next_message(&mut self) -> Result<Option<Message<'_>>, NotVrpn> {
        let left = &self.bytes[self.start..self.end];
        if left.len() < HEADER {
            return Ok(None);
        }
        let length = usize::try_from(int(left, 0)).map_err(|_| NotVrpn)?;
        if !(HEADER..=HEADER + LARGEST_PAYLOAD).contains(&length) {
            return Err(NotVrpn);
        }
        let padded = length.next_multiple_of(8);
        if left.len() < padded {
            return Ok(None);
        }
        let time = i64::from(int(left, 4)) * 1_000_000 + i64::from(int(left, 8));
        let (sender, kind) = (int(left, 12), int(left, 16));
        let from = self.start;
        self.start += padded;
        Ok(Some(Message { time, sender, kind, payload: &self.bytes[from + HEADER..from + length] }))
    }
}

fn int(bytes: &[u8], at: usize) -> i32 {
    let mut four = [0; 4];
    four.copy_from_slice(&bytes[at..at + 4]);
    i32::from_be_bytes(four)
}

fn double(bytes: &[u8], at: usize) -> f64 {
    let mut eight = [0; 8];
    eight.copy_from_slice(&bytes[at..at + 8]);
    f64::from_be_bytes(eight)
}

fn doubles<const N: usize>(bytes: &[u8], at: usize) -> [f64; N] {
    std::array::from_fn(|i| double(bytes, at + 8 * i))
}

impl<'a> Message<'a> {
    /// The name in a description of a sender or a message type.
    #[must_use]
    pub fn name(&self) -> Option<&'a str> {
        let length = usize::try_from(int(self.payload.get(..4)?, 0)).ok()?;
        let text = self.payload.get(4..)?.get(..length)?;
        let text = text.split(|b| *b == 0).next()?;
        std::str::from_utf8(text).ok()
    }

    /// `vrpn_Tracker Pos_Quat`: sensor, metres, orientation.
    #[must_use]
    pub fn pose(&self) -> Option<(i32, Vector3<f64>, UnitQuaternion<f64>)> {
        let p = self.payload.get(..64)?;
        let [x, y, z, i, j, k, w] = doubles(p, 8);
        let position = Vector3::new(x, y, z);
        let orientation = crate::drivers::motion::unit(w, i, j, k)?;
        // It goes back as the origin of the force field, in single precision.
        crate::drivers::motion::single_is_finite(&position).then_some((int(p, 0), position, orientation))
    }

    /// `vrpn_Tracker Velocity`: sensor, m/s, rad/s. The rotation is given as what it comes to in a time.
    #[must_use]
    pub fn velocity(&self) -> Option<(i32, Vector3<f64>, Vector3<f64>)> {
        let p = self.payload.get(..72)?;
        let [x, y, z, i, j, k, w, dt] = doubles(p, 8);
        let linear = Vector3::new(x, y, z);
        let turn = crate::drivers::motion::unit(w, i, j, k)?.scaled_axis();
        let angular = if dt > 0.0 { turn / dt } else { Vector3::zeros() };
        let finite = linear.iter().chain(angular.iter()).all(|c| c.is_finite());
        finite.then_some((int(p, 0), linear, angular))
    }

    /// `vrpn_Button Change`: button, down.
    #[must_use]
    pub fn button(&self) -> Option<(i32, bool)> {
        let p = self.payload.get(..8)?;
        Some((int(p, 0), int(p, 4) != 0))
    }

    /// `vrpn_ForceDevice Force_Error`.
    #[must_use]
    pub fn error(&self) -> Option<i32> {
        self.payload.get(..4).map(|p| int(p, 0))
    }
}

/// Messages on their way out. The memory is taken once.
#[derive(Debug)]
pub struct Outgoing {
    bytes: Vec<u8>,
    sequence: i32,
}

impl Default for Outgoing {
    fn default() -> Self {
        Self { bytes: Vec::with_capacity(CAPACITY), sequence: 0 }
    }
}

impl Outgoing {
    /// Appends a message.
    pub fn message(&mut self, time: i64, sender: i32, kind: i32, payload: &[u8]) {
        let length = (HEADER + payload.len()) as i32;
        let header =
            [length, (time / 1_000_000) as i32, (time % 1_000_000) as i32, sender, kind, self.sequence];
        self.sequence = self.sequence.wrapping_add(1);
        for number in header {
            self.bytes.extend_from_slice(&number.to_be_bytes());
        }
        self.bytes.extend_from_slice(payload);
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
    }

    /// Appends the name of one of our senders or message types.
    pub fn description(&mut self, time: i64, kind: i32, number: i32, name: &str) {
        let mut payload = ((name.len() + 1) as i32).to_be_bytes().to_vec();
        payload.extend_from_slice(name.as_bytes());
        payload.push(0);
        self.message(time, number, kind, &payload);
    }

    /// Appends a force that is the same everywhere within a radius of a point; its Jacobian is zero.
    pub fn force(
        &mut self,
        time: i64,
        sender: i32,
        kind: i32,
        origin: &Vector3<f64>,
        force: &Vector3<f64>,
        radius: f32,
    ) {
        let mut payload = [0; 64];
        let mut numbers = [0.0f32; 16];
        for axis in 0..3 {
            numbers[axis] = origin[axis] as f32;
            numbers[3 + axis] = force[axis] as f32;
        }
        numbers[15] = radius;
        for (place, number) in payload.chunks_exact_mut(4).zip(numbers) {
            place.copy_from_slice(&number.to_be_bytes());
        }
        self.message(time, sender, kind, &payload);
    }

    /// What has not been sent.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// So many bytes have been sent.
    pub fn sent(&mut self, count: usize) {
        self.bytes.drain(..count.min(self.bytes.len()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn push(incoming: &mut Incoming, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let room = incoming.room();
            let count = room.len().min(bytes.len());
            room[..count].copy_from_slice(&bytes[..count]);
            incoming.filled(count);
            bytes = &bytes[count..];
        }
    }

    /// Guards the format against bytes that were put together by hand after VRPN's description.
    #[test]
    fn a_description_byte_by_byte() {
        let mut out = Outgoing::default();
        out.description(1_500_000, TYPE_DESCRIPTION, 3, "abcde");
        let expected = [
            &[0, 0, 0, 34][..],
            &[0, 0, 0, 1],
            &[0, 7, 161, 32],
            &[0, 0, 0, 3],
            &[255, 255, 255, 254],
            &[0, 0, 0, 0],
            &[0, 0, 0, 6],
            b"abcde\0",
            &[0; 6],
        ]
        .concat();
        assert_eq!(out.bytes(), expected);
        let mut incoming = Incoming::default();
        push(&mut incoming, out.bytes());
        let message = incoming.next_message().unwrap().unwrap();
        assert_eq!(
            (message.time, message.sender, message.kind, message.name()),
            (1_500_000, 3, -2, Some("abcde"))
        );
    }

    proptest! {
        /// Guards the cutting: messages of any size in any pieces come out as they went in.
        #[test]
        fn pieces_do_not_matter(payloads in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..200), 0..8), piece in 1usize..100) {
            let mut out = Outgoing::default();
            for (i, payload) in payloads.iter().enumerate() {
                out.message(i as i64 * 1_000_001, 7, i as i32, payload);
            }
            let (mut incoming, mut seen) = (Incoming::default(), Vec::new());
            for bytes in out.bytes().chunks(piece) {
                push(&mut incoming, bytes);
                while let Some(message) = incoming.next_message().unwrap() {
                    prop_assert_eq!((message.time, message.kind), (seen.len() as i64 * 1_000_001, seen.len() as i32));
                    seen.push(message.payload.to_vec());
                }
            }
            prop_assert_eq!(seen, payloads);
        }

        /// Guards against any bytes: no panic, and whatever is understood is finite.
        #[test]
        fn any_bytes(bytes in prop::collection::vec(any::<u8>(), 0..400), small in 24u8..120) {
            let mut bytes = bytes;
            if bytes.len() > 4 {
                bytes[..4].copy_from_slice(&[0, 0, 0, small]);
            }
            let mut incoming = Incoming::default();
            push(&mut incoming, &bytes);
            while let Ok(Some(message)) = incoming.next_message() {
                let _ = (message.name(), message.button(), message.error());
                if let Some((_, p, q)) = message.pose() {
                    prop_assert!(p.iter().chain(q.coords.iter()).all(|c| (*c as f32).is_finite()));
                }
                if let Some((_, v, w)) = message.velocity() {
                    prop_assert!(v.iter().chain(w.iter()).all(|c| c.is_finite()));
                }
            }
        }
    }

    /// Guards against a position that is a number here and none on its way back to the server.
    #[test]
    fn a_position_beyond_single_precision_is_no_pose() {
        for (x, known) in [(0.1, true), (1e38, true), (1e39, false), (f64::NAN, false)] {
            let mut payload = [0; 64];
            payload[8..16].copy_from_slice(&f64::to_be_bytes(x));
            payload[56..64].copy_from_slice(&1f64.to_be_bytes());
            let message = Message { time: 0, sender: 0, kind: 0, payload: &payload };
            assert_eq!(message.pose().is_some(), known, "{x}");
        }
    }

    /// Guards against lengths that would take memory or run over.
    #[test]
    fn impossible_lengths() {
        for length in [0, 23, -1, i32::MAX, i32::MIN, 24 + 16 * 1024 + 1] {
            let mut incoming = Incoming::default();
            push(&mut incoming, &length.to_be_bytes());
            push(&mut incoming, &[0; 40]);
            assert_eq!(incoming.next_message().err(), Some(NotVrpn), "{length}");
        }
    }
}
