//! Work for all cores, of which the caller is told, and which ends when the caller says so.

use super::{BuildError, Progress, tell};
use rayon::Yield;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Portions that the work is cut into, unless single items are larger.
const PORTIONS: usize = 256;
/// The caller is asked at least so often whether to go on.
const PATIENCE: Duration = Duration::from_millis(100);

/// Does something with each of `weights.len()` items, on all cores, in an order that depends on nothing else; `work` should look at its
/// flag now and then, and end when it is set. `shares` is where the progress begins and ends.
pub(super) fn in_portions<T: Send>(
    weights: &[usize],
    work: impl Fn(usize, &AtomicBool) -> T + Sync,
    shares: [f64; 2],
    progress: &mut Progress<'_>,
) -> Result<Vec<T>, BuildError> {
    let portions = cut(weights);
    let total = weights.iter().sum::<usize>().max(1) as f64;
    let mut found: Vec<Option<Vec<T>>> = portions.iter().map(|_| None).collect();
    let stop = AtomicBool::new(false);
    rayon::in_place_scope(|scope| {
        let (send, receive) = channel();
        for (number, portion) in portions.iter().enumerate() {
            let (send, work, stop) = (send.clone(), &work, &stop);
            scope.spawn(move |_| {
                if !stop.load(Ordering::Relaxed) {
                    let own: Vec<T> = portion.clone().map(|item| work(item, stop)).collect();
                    // Nobody receives when the work was stopped.
                    let _ = send.send((number, own));
                }
            });
        }
        drop(send);
        let mut done = 0;
        loop {
            // The caller may be one of the cores itself, and the only one.
            let wait = if rayon::yield_now() == Some(Yield::Executed) { Duration::ZERO } else { PATIENCE };
            match receive.recv_timeout(wait) {
                Ok((number, own)) => {
                    done += weights[portions[number].clone()].iter().sum::<usize>();
                    found[number] = Some(own);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            let share = shares[0] + (shares[1] - shares[0]) * (done as f64 / total).min(1.0);
            if let Err(cancelled) = tell(progress, share) {
                stop.store(true, Ordering::Relaxed);
                return Err(cancelled);
            }
        }
    })?;
    Ok(found.into_iter().flatten().flatten().collect())
}

/// Ranges of items of about the same weight.
fn cut(weights: &[usize]) -> Vec<Range<usize>> {
    let most = weights.iter().sum::<usize>() / PORTIONS;
    let (mut portions, mut begin, mut weight) = (Vec::new(), 0, 0);
    for (item, own) in weights.iter().enumerate() {
        weight += own;
        if weight > most || item + 1 == weights.len() {
            portions.push(begin..item + 1);
            (begin, weight) = (item + 1, 0);
        }
    }
    portions
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch items that are lost or out of order, a share that leaps, and a deadlock where the caller is the only core.
    #[test]
    fn all_is_done_in_order_by_any_number_of_threads() {
        let weights: Vec<usize> = (0..5000).map(|i| if i < 3 { 1000 } else { i % 7 }).collect();
        let total: usize = weights.iter().sum();
        let wanted: Vec<usize> = (0..5000).map(|i| 3 * i).collect();
        let run = || {
            let mut last = 0.5;
            let done = in_portions(&weights, |i, _| 3 * i, [0.5, 1.0], &mut |share| {
                assert!(share >= last && share - last <= 0.5 * 1006.0 / total as f64, "{last} {share}");
                last = share;
                true
            });
            assert_eq!(done.as_deref(), Ok(&wanted[..]));
            assert!((last - 1.0).abs() < 1e-12, "{last}");
        };
        run();
        for threads in [1, 2, 5] {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run);
        }
        let none = in_portions(&[], |i, _| i, [0.0, 1.0], &mut |_| true);
        assert_eq!(none, Ok(vec![]));
    }

    /// Would catch work that goes on although it was stopped: a single item that would last for ever.
    #[test]
    fn an_item_that_lasts_can_be_stopped() {
        let for_ever = |_, stop: &AtomicBool| {
            while !stop.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
        };
        let mut calls = 0;
        let stopped = in_portions(&[1, 1], for_ever, [0.0, 1.0], &mut |_| {
            calls += 1;
            calls < 3
        });
        assert_eq!(stopped, Err(BuildError::Cancelled));
    }
}
