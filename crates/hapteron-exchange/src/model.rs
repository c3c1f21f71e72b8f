//! Every meeting of the two sides, by loom: `RUSTFLAGS="--cfg loom" CARGO_TARGET_DIR=target/loom cargo test -p hapteron-exchange --lib`.

use crate::{newest, ring};
use loom::thread;

/// Would catch an exchange whose order is too weak (the slot's trace finds a use by both sides), a value that is torn, older than the one before, or
/// lost though it was the last.
#[test]
fn the_newest_value_comes_whole_in_order_and_at_last() {
    loom::model(|| {
        let (mut writer, mut reader) = newest(&[0usize; 2]);
        let writing = thread::spawn(move || {
            for i in 1..=3 {
                // In place, as the contact thread does, and at once.
                if i == 2 {
                    writer.write([i; 2]);
                } else {
                    writer.slot()[0] = i;
                    writer.slot()[1] = i;
                    writer.publish();
                }
            }
            writer
        });
        let mut last = 0;
        for _ in 0..3 {
            let fresh = reader.update();
            let [a, b] = *reader.value();
            assert_eq!(a, b, "torn");
            assert!(if fresh { a > last } else { a == last }, "{a} after {last}, fresh: {fresh}");
            last = a;
        }
        let writer = writing.join();
        assert!(writer.is_ok());
        assert_eq!(*reader.read(), [3; 2]);
        assert!(!reader.update());
    });
}

/// Would catch values that are lost, doubled, out of order or read before they are written, and a ring that takes one more than it has room for.
#[test]
fn the_ring_keeps_order_and_loses_only_what_it_refused() {
    loom::model(|| {
        let (mut producer, mut consumer) = ring(0usize, 2);
        let giving = thread::spawn(move || {
            // One more than there is room for, so that places are used again.
            (1..=4).filter(|i| producer.push(*i).is_ok()).collect::<Vec<usize>>()
        });
        let mut got = Vec::new();
        for _ in 0..3 {
            let waiting = consumer.waiting();
            assert!(waiting <= 2);
            let value = consumer.pop();
            assert!(waiting == 0 || value.is_some());
            got.extend(value);
        }
        let given = giving.join();
        while let Some(value) = consumer.pop() {
            got.push(value);
        }
        assert_eq!(given.ok(), Some(got));
    });
}
