//! The recording from inside: ticks and passes without a session, and disks that misbehave.

use super::writer::{WINDOW, Writer};
use super::*;
use crate::scene::file::Method;
use crate::scene::handle_at;
use crate::scenes::spoon_in_cup;
use crate::session::{ContactSnapshot, HapticState, Settings, tick};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};

fn scene() -> Arc<Scene> {
    Arc::new(Scene::from_file(spoon_in_cup(0.01, 2e3, Method::BackwardEuler)).unwrap())
}

/// A tick of the scene at its start.
fn record(scene: &Scene) -> TickRecord {
    let sample = scene.trajectory.sample(0.0, 1e-3);
    let contacts = ContactSnapshot::empty(&scene.body, &scene.start);
    let result = tick(&Settings::of(scene), &HapticState::new(scene.start), &sample, &contacts, 0.0);
    assert!(handle_at(&sample).position == result.handle.position);
    TickRecord {
        tick: 1,
        time: 0.0,
        sample,
        command: None,
        result,
        contacts_of: 0,
        counts: (3, 2),
        lateness_ns: 5,
        compute_ns: 7,
        missed: 0,
    }
}

fn pass(of_tick: u64) -> PassRecord {
    PassRecord { of_tick, ahead: 2e-3, min_distance: of_tick as f64 * 1e-9, contacts: 3, duration_ns: 9 }
}

type Talk = (Sender<()>, Receiver<()>);

/// A disk in memory that can be made to fail, or to wait for a word.
#[derive(Clone, Default)]
struct Disk {
    bytes: Arc<Mutex<Vec<u8>>>,
    room: Option<usize>,
    /// Says that it is in a call, and hears when to go on.
    wait: Option<Arc<Mutex<Talk>>>,
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if let Some(wait) = &self.wait {
            let wait = wait.lock().unwrap();
            let _ = wait.0.send(());
            let _ = wait.1.recv();
        }
        let mut held = self.bytes.lock().unwrap();
        let left = self.room.unwrap_or(usize::MAX) - held.len();
        if left == 0 && !bytes.is_empty() {
            return Err(io::ErrorKind::StorageFull.into());
        }
        let n = left.min(bytes.len());
        held.extend_from_slice(&bytes[..n]);
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn output(name: &str, out: impl Write + Send + 'static) -> Output {
    Output { out: Box::new(out), path: name.into(), buffer: Vec::new() }
}

fn outputs(rows: Disk) -> Outputs {
    Outputs {
        rows: output("run.csv", rows),
        log: output("device.csv", io::sink()),
        marks: output("run.part", io::sink()),
    }
}

fn lines(disk: &Disk) -> usize {
    disk.bytes.lock().unwrap().iter().filter(|b| **b == b'\n').count()
}

/// Would catch a recording that grows with the session: a million ticks, every other one looked at by a pass, in less than a megabyte.
#[test]
fn a_long_recording_takes_no_more_memory_than_a_short_one() {
    let scene = scene();
    let record = record(&scene);
    let mut rows = RowMaker::new(Arc::clone(&scene));
    let sinks = Outputs {
        rows: output("run.csv", io::sink()),
        log: output("device.csv", io::sink()),
        marks: output("run.part", io::sink()),
    };
    let mut writer = Writer::new(&scene, sinks);
    let mut run = |from: u64, to: u64| {
        allocation_counter::measure(|| {
            for tick in from..=to {
                let record = TickRecord { tick, time: tick as f64 * 1e-3, ..record };
                let row = rows.row(&record);
                let log = LogRow::of(&record);
                writer.take(Entry::Tick(Held {
                    tick,
                    row,
                    log,
                    angle: 0.1,
                    timing: [5, 7],
                    is_known: false,
                }));
                if tick % 2 == 0 {
                    writer.take(Entry::Pass(pass(tick)));
                }
                if tick % 20 == 0 {
                    assert_eq!(writer.flush(), None);
                }
            }
        })
    };
    let first = run(1, 1000);
    let rest = run(1001, 1_000_000);
    assert!(first.bytes_max < 1_000_000, "{first:?}");
    assert!(rest.bytes_max < 100_000 && rest.bytes_current.abs() < 10_000, "{rest:?}");
    writer.release_all();
    writer.flush();
    let written = writer.into_written();
    assert!((written.rows, written.lost, written.is_complete) == (1_000_000, 0, true), "{written:?}");
}

/// Would catch ticks that wait for ever for the pass of a contact thread that does not come, and one that comes too late and is not counted.
#[test]
fn ticks_do_not_wait_for_a_contact_thread_that_hangs() {
    let scene = scene();
    let record = record(&scene);
    let disk = Disk::default();
    let mut writer = Writer::new(&scene, outputs(disk.clone()));
    let mut rows = RowMaker::new(Arc::clone(&scene));
    let ticks = WINDOW as u64 + 100;
    for tick in 1..=ticks {
        let record = TickRecord { tick, time: tick as f64 * 1e-3, ..record };
        let (row, log) = (rows.row(&record), LogRow::of(&record));
        writer.take(Entry::Tick(Held { tick, row, log, angle: 0.0, timing: [0; 2], is_known: false }));
    }
    writer.flush();
    assert_eq!(lines(&disk), 100);
    writer.take(Entry::Pass(pass(50)));
    writer.take(Entry::Pass(pass(ticks)));
    writer.flush();
    assert_eq!(lines(&disk), WINDOW + 100);
    let written = writer.into_written();
    assert_eq!((written.rows, written.lost), (ticks, 1));
}

/// Would catch a full disk that ends more than the recording, leaves half a row among the whole ones, or is not told.
#[test]
fn a_full_disk_ends_the_recording_and_is_told() {
    let scene = scene();
    let record = record(&scene);
    let disk = Disk { room: Some(100_000), ..Disk::default() };
    let folder = Path::new("nowhere");
    let mut spool = Spool::begin(Arc::clone(&scene), folder, outputs(disk.clone()), 1 << 12).unwrap();
    let mut tick = 0;
    while spool.trouble().is_none() {
        tick += 1;
        spool.tick(&TickRecord { tick, time: tick as f64 * 1e-3, ..record });
        spool.pass(&pass(tick));
        thread::sleep(Duration::from_micros(100));
        assert!(tick < 100_000, "the disk never got full");
    }
    let text = spool.trouble().unwrap().to_owned();
    assert!(text.contains("run.csv") && text.contains("nothing is recorded"), "{text}");
    let spooled = spool.finish(&[TickRecord { tick: tick + 1, ..record }], &[]);
    assert_eq!(spooled.trouble(), Some(text.as_str()));
    assert!(!spooled.is_complete());
    // Each pass and each tick are one entry; a pass that never reaches its tick is lost with it.
    let rows = spooled.rows() as usize;
    assert!(rows > 0 && rows <= lines(&disk), "{rows} rows of {} lines", lines(&disk));
    assert!(rows as u64 + spooled.lost() >= tick, "{rows} rows, {} lost of {tick}", spooled.lost());
}

/// Would catch a slow disk that whoever drains the session waits for, or rows that are lost without a count.
#[test]
fn a_slow_disk_loses_rows_and_holds_up_nobody() {
    let scene = scene();
    let record = record(&scene);
    let ((go, wait), (inside, is_inside)) = (channel(), channel());
    let disk = Disk { wait: Some(Arc::new(Mutex::new((inside, wait)))), ..Disk::default() };
    let room = 256;
    let folder = Path::new("nowhere");
    let mut outputs = outputs(disk.clone());
    // The disk hangs in its first write, of the header, for as long as the test wants it to.
    outputs.rows.buffer.extend_from_slice(b"header\n");
    let mut spool = Spool::begin(Arc::clone(&scene), folder, outputs, room).unwrap();
    is_inside.recv().unwrap();
    let ticks = 10_000;
    for tick in 1..=ticks {
        spool.tick(&TickRecord { tick, time: tick as f64 * 1e-3, ..record });
    }
    assert_eq!(spool.lost, ticks - room as u64);
    drop(go);
    let spooled = spool.finish(&[], &[]);
    assert_eq!(spooled.rows() + spooled.lost(), ticks);
    assert!(!spooled.is_complete() && spooled.trouble().is_none());
    assert_eq!(lines(&disk) as u64, 1 + spooled.rows());
}

/// Would catch a thread that goes on looking for rows when the session could not begin and nobody ends the recording.
#[test]
fn a_spool_that_is_dropped_ends_its_thread() {
    let [rows, log, marks] = ["rows", "log", "marks"].map(|name| output(name, Disk::default()));
    let spool = Spool::begin(scene(), Path::new(""), Outputs { rows, log, marks }, 16).unwrap();
    let shared = Arc::downgrade(&spool.handing.0);
    drop(spool);
    for _ in 0..1000 {
        if shared.strong_count() == 0 {
            return;
        }
        thread::sleep(Duration::from_millis(10));
    }
    panic!("the thread is still there");
}
