//! On real threads, as fast as they can; under Miri as well: `cargo +nightly miri test -p hapteron-exchange`.

use crate::{newest, ring};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

const VALUES: u64 = if cfg!(miri) { 300 } else { 1_000_000 };

/// Would catch a torn, older or lost value: each is a kilobyte of the same number.
#[test]
fn newest_values_come_whole_and_in_order() {
    let (mut writer, mut reader) = newest(&[0u64; 128]);
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| {
            for i in 1..=VALUES {
                if i % 2 == 0 {
                    writer.slot().fill(i);
                    writer.publish();
                } else {
                    writer.write([i; 128]);
                }
            }
            done.store(true, Ordering::Release);
        });
        let (mut last, mut seen) = (0, 0u64);
        loop {
            let over = done.load(Ordering::Acquire);
            let fresh = reader.update();
            let value = reader.value();
            assert!(value.iter().all(|x| *x == value[0]), "torn");
            assert!(if fresh { value[0] > last } else { value[0] == last });
            (last, seen) = (value[0], seen + u64::from(fresh));
            if over {
                break;
            }
            std::hint::spin_loop();
        }
        assert_eq!(last, VALUES, "the last one was lost");
        assert!(seen > 0);
    });
}

/// Would catch values lost, doubled or out of order, on a ring that is full and empty again and again.
#[test]
fn a_ring_gives_every_value_once_and_in_order() {
    let (mut producer, mut consumer) = ring([0u64; 4], 3);
    thread::scope(|scope| {
        scope.spawn(move || {
            for i in 1..=VALUES {
                while producer.push([i; 4]).is_err() {
                    thread::yield_now();
                }
            }
        });
        for i in 1..=VALUES {
            let value = loop {
                if let Some(value) = consumer.pop() {
                    break value;
                }
                thread::yield_now();
            };
            assert_eq!(value, [i; 4]);
        }
        assert_eq!(consumer.pop(), None);
    });
}

/// Would catch a count that is off by one at either end.
#[test]
fn a_ring_is_full_and_empty_when_it_says_so() {
    let (mut producer, mut consumer) = ring(0, 4);
    for round in 0..3 {
        assert_eq!(consumer.pop(), None);
        for i in 0..4 {
            assert_eq!(producer.push(10 * round + i), Ok(()));
        }
        assert_eq!(producer.push(99), Err(99));
        assert_eq!(consumer.waiting(), 4);
        for i in 0..4 {
            assert_eq!(consumer.pop(), Some(10 * round + i));
        }
    }
}

/// Would catch an end that needs the other to live.
#[test]
fn an_end_outlives_the_other() {
    let (mut writer, reader) = newest(&String::from("first"));
    drop(reader);
    writer.write("second".to_owned());
    let (mut writer, mut reader) = newest(&String::from("first"));
    writer.write("second".to_owned());
    drop(writer);
    assert_eq!(reader.read(), "second");
    let (mut producer, mut consumer) = ring(1, 2);
    assert_eq!(producer.push(2), Ok(()));
    drop(producer);
    assert_eq!((consumer.pop(), consumer.pop()), (Some(2), None));
}
