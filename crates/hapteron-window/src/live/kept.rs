//! How ticks kept their time, for those who count.

use hapteron::session::real_time::TickRecord;

/// How a tick kept its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kept {
    /// From its deadline to its start.
    pub lateness_ns: u64,
    /// Deadlines that passed by before it.
    pub missed: u64,
    /// How old its contacts were, ticks.
    pub contact_age: u64,
    /// Contacts that they were.
    pub contacts: u32,
}

impl Kept {
    /// From its record.
    pub fn of(record: &TickRecord) -> Self {
        Self {
            lateness_ns: record.lateness_ns,
            missed: record.missed,
            contact_age: record.tick.saturating_sub(record.contacts_of),
            contacts: record.counts.0,
        }
    }
}
