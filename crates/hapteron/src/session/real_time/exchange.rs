//! What goes between the threads, and by which way: newest values through three slots, every record and command through bounded rings ([`hapteron_exchange`]).
//! Both are wait-free on both sides and allocate nothing after the start; no thread can hold another up, dead or alive.

use super::telemetry::{PassRecord, TickRecord};
use crate::scene::ContactModel;
use crate::session::{Command, ContactLaw, ContactSnapshot, LevelsInUse};
use hapteron_dynamics::{Handle, RigidBody, State};
use hapteron_exchange::{Consumer, Producer, Reader, Writer, newest, ring};

/// Commands that may wait; one is applied a tick.
const COMMANDS: usize = 256;

/// Contacts, and the tick whose state they were found at.
#[derive(Clone, Debug)]
pub struct Found {
    pub of_tick: u64,
    pub snapshot: ContactSnapshot,
}

/// The state of a tick, as the contact thread needs it.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    pub of_tick: u64,
    pub time: f64,
    pub state: State,
    pub handle: Handle,
    pub body: RigidBody,
    pub law: ContactLaw,
    pub model: ContactModel,
    /// When the next one is to be expected.
    pub next_ns: u64,
}

/// The haptic thread's ends.
pub(super) struct HapticEnd {
    contacts: Reader<Found>,
    states: Writer<Seen>,
    latest: Writer<TickRecord>,
    records: Producer<TickRecord>,
    commands: Consumer<Command>,
}

impl HapticEnd {
    /// Real time.
    pub fn newest_contacts(&mut self) -> &Found {
        self.contacts.read()
    }

    /// Real time.
    pub fn next_command(&mut self) -> Option<Command> {
        self.commands.pop()
    }

    /// Real time.
    pub fn publish_state(&mut self, seen: &Seen) {
        self.states.write(*seen);
    }

    /// Answers whether there was room for it. Real time.
    pub fn publish_record(&mut self, record: &TickRecord) -> bool {
        self.latest.write(*record);
        self.records.push(*record).is_ok()
    }
}

/// The contact thread's ends.
pub(super) struct ContactsEnd {
    pub states: Reader<Seen>,
    pub contacts: Writer<Found>,
    pub passes: Producer<PassRecord>,
    /// For those who look on.
    pub shown: Writer<ContactSnapshot>,
    pub levels: Writer<LevelsInUse>,
}

/// The ends of whoever watches and steers.
pub(super) struct OuterEnd {
    pub latest: Reader<TickRecord>,
    pub records: Consumer<TickRecord>,
    pub passes: Consumer<PassRecord>,
    pub commands: Producer<Command>,
    pub shown: Reader<ContactSnapshot>,
    pub levels: Reader<LevelsInUse>,
}

/// Makes all ways, with memory that has been touched. `room` is how many records may wait to be drained.
pub(super) fn exchange(
    found: &Found,
    seen: &Seen,
    first: &TickRecord,
    first_pass: &PassRecord,
    room: usize,
) -> (HapticEnd, ContactsEnd, OuterEnd) {
    let (contacts_in, contacts_out) = newest(found);
    let (states_in, states_out) = newest(seen);
    let (latest_in, latest_out) = newest(first);
    let (shown_in, shown_out) = newest(&found.snapshot);
    let (levels_in, levels_out) = newest(&LevelsInUse::default());
    let (records_in, records_out) = ring(*first, room);
    let (passes_in, passes_out) = ring(*first_pass, room);
    let (commands_in, commands_out) = ring(Command::Stop, COMMANDS);
    let haptic = HapticEnd {
        contacts: contacts_out,
        states: states_in,
        latest: latest_in,
        records: records_in,
        commands: commands_out,
    };
    let contacts = ContactsEnd {
        states: states_out,
        contacts: contacts_in,
        passes: passes_in,
        shown: shown_in,
        levels: levels_in,
    };
    let outer = OuterEnd {
        latest: latest_out,
        records: records_out,
        passes: passes_out,
        commands: commands_in,
        shown: shown_out,
        levels: levels_out,
    };
    (haptic, contacts, outer)
}
