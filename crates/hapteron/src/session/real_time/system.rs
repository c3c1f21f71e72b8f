//! What is asked of the operating system for the threads, and what it granted. Nothing here is required: without it the session runs, later.
#![allow(unsafe_code, reason = "calls of the operating system")]

/// What became of a wish.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Grant {
    /// What was granted.
    Given(String),
    /// Why not.
    Refused(String),
    /// Nothing was asked.
    NotAsked,
}

impl Grant {
    /// Whether it was granted.
    #[must_use]
    pub fn is_given(&self) -> bool {
        matches!(self, Self::Given(_))
    }
}

impl std::fmt::Display for Grant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Given(what) => write!(f, "{what}"),
            Self::Refused(why) => write!(f, "not granted: {why}"),
            Self::NotAsked => f.write_str("not asked for"),
        }
    }
}

/// What the threads of a session got.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grants {
    /// Of the haptic thread.
    pub priority: Grant,
    /// Of the haptic thread.
    pub cpu: Grant,
    /// Of the process.
    pub memory: Grant,
    /// Of the machine's idle states.
    pub latency: Grant,
    /// Priority of the contact thread.
    pub contact_priority: Grant,
    /// CPU of the contact thread.
    pub contact_cpu: Grant,
}

impl Default for Grants {
    fn default() -> Self {
        let none = || Grant::NotAsked;
        Self {
            priority: none(),
            cpu: none(),
            memory: none(),
            latency: none(),
            contact_priority: none(),
            contact_cpu: none(),
        }
    }
}

/// Stack that is touched before the loop starts, so that no tick meets a page for the first time.
const STACK: usize = 256 * 1024;

/// Touches the stack of the calling thread.
#[inline(never)]
pub fn touch_stack() {
    let mut stack = [0u8; STACK];
    for page in stack.chunks_mut(4096) {
        page[0] = 1;
    }
    std::hint::black_box(&mut stack);
}

#[cfg(target_os = "linux")]
mod linux {
    use super::Grant;
    use std::fs::File;
    use std::io::{Error, Write};

    /// CAP_IPC_LOCK: locks any amount of memory.
    const IPC_LOCK: u32 = 14;

    /// SCHED_FIFO for the calling thread.
    pub fn raise_priority(priority: i32) -> Grant {
        let parameters = libc::sched_param { sched_priority: priority };
        // SAFETY: the parameters are valid; 0 is the calling thread.
        let result = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) };
        if result == 0 {
            return Grant::Given(format!("SCHED_FIFO {priority}"));
        }
        let error = Error::last_os_error();
        Grant::Refused(match error.raw_os_error() {
            Some(libc::EPERM) => {
                "needs the right to real-time priority (a line '@realtime - rtprio 90' in /etc/security/limits.conf, or CAP_SYS_NICE)".to_owned()
            }
            _ => error.to_string(),
        })
    }

    /// Keeps the calling thread on one CPU.
    pub fn pin(cpu: usize) -> Grant {
        // SAFETY: an empty set is all zeros, and CPU_SET checks its bounds.
        let result = unsafe {
            let mut set: libc::cpu_set_t = std::mem::zeroed();
            if cpu < libc::CPU_SETSIZE as usize {
                libc::CPU_SET(cpu, &mut set);
            }
            libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &raw const set)
        };
        if result == 0 {
            Grant::Given(format!("CPU {cpu}"))
        } else {
            Grant::Refused(format!("CPU {cpu}: {}", Error::last_os_error()))
        }
    }

    /// Asks that the calling thread, which is not a real-time one, be woken on time.
    pub fn wake_exactly() {
        // SAFETY: no pointers; a kernel that does not know it refuses.
        unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1 as libc::c_ulong) };
    }

    /// Locks the pages that the process has now. Not those to come: with a limit, the first allocation above it would end the process.
    pub fn lock_memory() -> Grant {
        let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
        // SAFETY: `limit` is a valid place for the result.
        let known = unsafe { libc::getrlimit(libc::RLIMIT_MEMLOCK, &raw mut limit) } == 0;
        let limited = !known || (limit.rlim_cur != libc::RLIM_INFINITY && !has_capability(IPC_LOCK));
        let resident = resident_bytes().unwrap_or(u64::MAX);
        if limited && limit.rlim_cur <= resident {
            return Grant::Refused(format!(
                "RLIMIT_MEMLOCK is {} KiB and the process has {} KiB; raise 'memlock' in /etc/security/limits.conf",
                limit.rlim_cur / 1024,
                resident / 1024
            ));
        }
        // SAFETY: no pointers.
        if unsafe { libc::mlockall(libc::MCL_CURRENT) } == 0 {
            Grant::Given(format!("locked, {} MiB", resident_bytes().unwrap_or(0) >> 20))
        } else {
            Grant::Refused(Error::last_os_error().to_string())
        }
    }

    /// Undoes [`lock_memory`].
    pub fn unlock_memory() {
        // SAFETY: no pointers.
        unsafe { libc::munlockall() };
    }

    /// From now on Ctrl-Z at the terminal, and reading or writing there from the background, do not stop the process: its device would be left with
    /// the last force.
    pub fn ignore_suspend() {
        for signal in [libc::SIGTSTP, libc::SIGTTIN, libc::SIGTTOU] {
            // SAFETY: no handler is installed; signals that are ignored run no code.
            unsafe { libc::signal(signal, libc::SIG_IGN) };
        }
    }

    fn has_capability(bit: u32) -> bool {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let line = status.lines().find_map(|l| l.strip_prefix("CapEff:"));
        line.and_then(|l| u64::from_str_radix(l.trim(), 16).ok()).is_some_and(|set| set >> bit & 1 == 1)
    }

    /// Memory of the process that is in RAM.
    #[must_use]
    pub fn resident_bytes() -> Option<u64> {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
        let kib: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
        Some(kib * 1024)
    }

    /// What the program has allocated and not given back, as far as the system's allocator tells. Unlike [`resident_bytes`] it
    /// does not move with pages that the kernel takes and gives.
    #[must_use]
    pub fn allocated_bytes() -> Option<u64> {
        #[cfg(target_env = "gnu")]
        {
            // SAFETY: no pointers; the allocator takes its own locks.
            let info = unsafe { libc::mallinfo2() };
            Some((info.uordblks + info.hblkhd) as u64)
        }
        #[cfg(not(target_env = "gnu"))]
        None
    }

    /// Keeps the CPUs out of deep sleep as long as it lives.
    pub struct WakeLatency(#[allow(dead_code, reason = "open is what it is")] Option<File>);

    /// Asks for CPUs that wake at once.
    pub fn keep_awake() -> (WakeLatency, Grant) {
        const PATH: &str = "/dev/cpu_dma_latency";
        let asked = File::options().write(true).open(PATH).and_then(|mut file| {
            file.write_all(&0i32.to_ne_bytes())?;
            Ok(file)
        });
        match asked {
            Ok(file) => (WakeLatency(Some(file)), Grant::Given(format!("{PATH} 0 us"))),
            Err(error) => (WakeLatency(None), Grant::Refused(format!("{PATH}: {error}"))),
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod elsewhere {
    use super::Grant;

    const UNKNOWN: &str = "not known how on this system";

    pub fn raise_priority(_: i32) -> Grant {
        Grant::Refused(UNKNOWN.to_owned())
    }

    pub fn pin(_: usize) -> Grant {
        Grant::Refused(UNKNOWN.to_owned())
    }

    pub fn wake_exactly() {}

    pub fn lock_memory() -> Grant {
        Grant::Refused(UNKNOWN.to_owned())
    }

    pub fn unlock_memory() {}

    pub fn ignore_suspend() {}

    #[must_use]
    pub fn resident_bytes() -> Option<u64> {
        None
    }

    #[must_use]
    pub fn allocated_bytes() -> Option<u64> {
        None
    }

    pub struct WakeLatency;

    pub fn keep_awake() -> (WakeLatency, Grant) {
        (WakeLatency, Grant::Refused(UNKNOWN.to_owned()))
    }
}

#[cfg(not(target_os = "linux"))]
pub use elsewhere::*;
#[cfg(target_os = "linux")]
pub use linux::*;
