//! Faults that take the force away while a session runs: told at once, and re-armed by whoever sits at the terminal.

use crate::arguments::OnFault;
use crate::progress::say;
use hapteron::session::real_time::{Running, TickRecord};
use hapteron::session::{Command, CommandError};
use std::io::{BufRead, IsTerminal};
use std::sync::mpsc::{Receiver, channel};

/// What took the force away.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Seconds.
    pub time: f64,
    /// For people.
    pub reason: String,
    /// When there was force again, seconds.
    pub rearmed: Option<f64>,
}

/// Watches the ticks of a session.
pub struct Watch {
    faults: Vec<Fault>,
    on_fault: OnFault,
    /// A line for each Enter.
    enter: Option<Receiver<()>>,
}

impl Watch {
    /// Without a wish: waits for somebody at the terminal, if there can be somebody.
    pub fn new(on_fault: Option<OnFault>) -> Self {
        let usual = if std::io::stdin().is_terminal() { OnFault::Wait } else { OnFault::End };
        Self { faults: Vec::new(), on_fault: on_fault.unwrap_or(usual), enter: None }
    }

    /// Takes a tick; tells a fault that begins or is over.
    pub fn tick(&mut self, record: &TickRecord) {
        let no_force = record.result.flags.no_force();
        match (self.latched(), no_force) {
            (false, true) => {
                let reason = reason(record);
                say!("\nno force since {:.3} s: {reason}", record.time);
                match self.on_fault {
                    OnFault::Wait => say!(
                        "Enter: force again, from where the handle is then (it comes slowly). Ctrl-C: the end."
                    ),
                    OnFault::End => say!("the session ends (--on-fault wait lets you go on)"),
                }
                self.faults.push(Fault { time: record.time, reason, rearmed: None });
            }
            (true, false) => {
                say!("force again since {:.3} s", record.time);
                if let Some(fault) = self.faults.last_mut() {
                    fault.rearmed = Some(record.time);
                }
            }
            _ => {}
        }
    }

    /// Re-arms when Enter was pressed. Answers whether the session is to end.
    pub fn react(&mut self, running: &mut Running) -> bool {
        if !self.latched() {
            return false;
        }
        match self.on_fault {
            OnFault::End => true,
            OnFault::Wait => {
                if self.enter.get_or_insert_with(lines).try_recv().is_ok() {
                    // One that is full takes it the next time; one that has ended needs none.
                    let sent = running.send(Command::Rearm);
                    debug_assert!(matches!(sent, Ok(()) | Err(CommandError::Ended | CommandError::Full)));
                }
                false
            }
        }
    }

    /// All of them.
    pub fn into_faults(self) -> Vec<Fault> {
        self.faults
    }

    fn latched(&self) -> bool {
        self.faults.last().is_some_and(|f| f.rearmed.is_none())
    }
}

/// Why a tick is without force, and what to do.
pub fn reason(record: &TickRecord) -> String {
    let after = &record.result.after;
    let names = |flags: hapteron::session::Flags| flags.names().collect::<Vec<_>>().join(", ");
    match (after.fault, after.guard.as_ref().and_then(|g| g.fault())) {
        (Some(flags), _) => format!("the simulation stopped: {}", names(flags)),
        (None, Some(fault)) => format!("the guard took it away: {fault}"),
        (None, None) => names(record.result.flags),
    }
}

/// Reads lines for as long as there are any. The thread ends with the program.
fn lines() -> Receiver<()> {
    let (tell, told) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines() {
            if line.is_err() || tell.send(()).is_err() {
                return;
            }
        }
    });
    told
}
