//! A histogram of durations with fixed bins: recording one is a handful of instructions, without lock or allocation.

use std::sync::atomic::{AtomicU64, Ordering};

/// Bins in each factor of two: values are known to 1 part in 256, so that a period of 1000 us does not read as one of 1016.
const PER_OCTAVE: usize = 256;
const OCTAVE_BITS: u32 = PER_OCTAVE.trailing_zeros();
/// From 2^8 to 2^37 ns (137 s); below, every nanosecond has a bin of its own, above is the last bin.
const OCTAVES: usize = 29;
const BINS: usize = PER_OCTAVE * (OCTAVES + 1);

/// The bin of a duration.
fn bin(ns: u64) -> usize {
    if ns < PER_OCTAVE as u64 {
        return ns as usize;
    }
    let octave = ns.ilog2() - OCTAVE_BITS;
    let within = (ns >> octave) as usize - PER_OCTAVE;
    (PER_OCTAVE * (octave as usize + 1) + within).min(BINS - 1)
}

/// Least duration of a bin.
fn floor_of(bin: usize) -> u64 {
    if bin < PER_OCTAVE {
        return bin as u64;
    }
    let octave = bin / PER_OCTAVE - 1;
    ((PER_OCTAVE + bin % PER_OCTAVE) as u64) << octave
}

/// One thread records, any thread looks.
#[derive(Debug)]
pub struct Histogram {
    bins: Box<[AtomicU64]>,
    count: AtomicU64,
    total_ns: AtomicU64,
    greatest_ns: AtomicU64,
}

impl Histogram {
    /// Without a duration.
    #[must_use]
    pub fn new() -> Self {
        let zero = || AtomicU64::new(0);
        Self {
            bins: (0..BINS).map(|_| zero()).collect(),
            count: zero(),
            total_ns: zero(),
            greatest_ns: zero(),
        }
    }

    /// Adds a duration; from one thread only, or counts are lost. Real time.
    pub fn record(&self, ns: u64) {
        // One writer: no need of a locked instruction.
        let add = |cell: &AtomicU64, n: u64| {
            cell.store(cell.load(Ordering::Relaxed).wrapping_add(n), Ordering::Relaxed);
        };
        if let Some(cell) = self.bins.get(bin(ns)) {
            add(cell, 1);
        }
        add(&self.count, 1);
        add(&self.total_ns, ns);
        if ns > self.greatest_ns.load(Ordering::Relaxed) {
            self.greatest_ns.store(ns, Ordering::Relaxed);
        }
    }

    /// What has been recorded so far.
    #[must_use]
    pub fn distribution(&self) -> Distribution {
        let counts: Vec<u64> = self.bins.iter().map(|c| c.load(Ordering::Relaxed)).collect();
        Distribution {
            count: counts.iter().sum(),
            total_ns: self.total_ns.load(Ordering::Relaxed),
            greatest_ns: self.greatest_ns.load(Ordering::Relaxed),
            counts,
        }
    }
}

impl Default for Histogram {
    fn default() -> Self {
        Self::new()
    }
}

/// How often which duration came.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Distribution {
    counts: Vec<u64>,
    /// How many.
    pub count: u64,
    /// Their sum.
    pub total_ns: u64,
    /// The greatest.
    pub greatest_ns: u64,
}

impl Distribution {
    /// The duration that a share (0 to 1) of all do not exceed, to 1 part in 256, nanoseconds; zero when there are none.
    #[must_use]
    pub fn quantile_ns(&self, share: f64) -> u64 {
        let wanted = (share * self.count as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        for (i, count) in self.counts.iter().enumerate() {
            seen += count;
            // The last bin has no end.
            if seen >= wanted && i + 1 < BINS {
                return (floor_of(i + 1) - 1).min(self.greatest_ns);
            }
        }
        self.greatest_ns
    }

    /// Between which durations that quantile of the process lies that made these, with 95 % confidence: those whose ranks are two standard
    /// deviations of a binomial count away. Of 10,000 durations the ten greatest make the 99.9 %, and ten may as well have been four or sixteen.
    #[must_use]
    pub fn quantile_between_ns(&self, share: f64) -> [u64; 2] {
        const DEVIATIONS: f64 = 1.96;
        let count = self.count.max(1) as f64;
        let off = DEVIATIONS * (share * (1.0 - share) / count).max(0.0).sqrt();
        [self.quantile_ns((share - off).max(0.0)), self.quantile_ns((share + off).min(1.0))]
    }

    /// The share (0 to 1) of durations up to a bound, to the bin that it falls in; 1 when there are none.
    #[must_use]
    pub fn share_up_to(&self, ns: u64) -> f64 {
        if self.count == 0 {
            return 1.0;
        }
        let within: u64 = self.counts.iter().take(bin(ns) + 1).sum();
        within as f64 / self.count as f64
    }

    /// Nanoseconds; zero when there are none.
    #[must_use]
    pub fn mean_ns(&self) -> f64 {
        self.total_ns as f64 / self.count.max(1) as f64
    }

    /// The bins that hold anything: least duration in nanoseconds, and count.
    pub fn bins(&self) -> impl Iterator<Item = (u64, u64)> {
        self.counts.iter().enumerate().filter(|(_, c)| **c > 0).map(|(i, c)| (floor_of(i), *c))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Would catch bins that overlap, leave gaps or are wider than 1 part in 256.
        #[test]
        fn every_duration_is_in_the_bin_around_it(ns in 0u64..1 << 37) {
            let i = bin(ns);
            prop_assert!(floor_of(i) <= ns && ns < floor_of(i + 1));
            prop_assert!((floor_of(i + 1) - floor_of(i)) * 256 <= floor_of(i).max(256));
        }

        /// Would catch a quantile that is off by a bin: against sorting.
        #[test]
        fn quantiles_are_those_of_the_sorted_durations(
            mut all in prop::collection::vec(0u64..10_000_000, 1..500), share in 0.0..1.0f64
        ) {
            let histogram = Histogram::new();
            all.iter().for_each(|ns| histogram.record(*ns));
            all.sort_unstable();
            let exact = all[((share * all.len() as f64).ceil().max(1.0) as usize - 1).min(all.len() - 1)];
            let found = histogram.distribution().quantile_ns(share);
            prop_assert!(found >= exact && found - exact <= exact / 256 + 1, "{found} {exact}");
        }
    }

    /// Would catch an interval that is not one of 95 %: over 2,000 samples of a known distribution, how often it holds the true quantile.
    #[test]
    fn the_interval_holds_the_true_quantile_as_often_as_it_says() {
        // With a long tail: 2^40 / u for u evenly spread up to 2^24, by a linear congruential generator (Knuth's constants).
        let mut random = 1u64;
        let truth = (1u64 << 40) / ((1 << 24) / 1000);
        let held = (0..2000)
            .filter(|_| {
                let histogram = Histogram::new();
                for _ in 0..10_000 {
                    random = random
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    histogram.record((1 << 40) / ((random >> 40) + 1));
                }
                let [low, high] = histogram.distribution().quantile_between_ns(0.999);
                low <= truth && truth <= high
            })
            .count();
        assert!((1850..=1970).contains(&held), "{held} of 2000");
    }

    #[test]
    fn the_far_end_and_nothing_at_all_are_no_trouble() {
        let histogram = Histogram::new();
        assert_eq!(histogram.distribution().quantile_ns(0.5), 0);
        histogram.record(u64::MAX / 2);
        assert_eq!(histogram.distribution().quantile_ns(0.99), u64::MAX / 2);
        assert_eq!(histogram.distribution().share_up_to(1000), 0.0);
    }
}
