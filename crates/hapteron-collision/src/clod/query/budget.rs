//! How much coarser contacts are than the error metrics ask for, so that queries take no longer than they may.

/// Two queries that take longer than they may make the next ones at least this much more lenient, and as much as both were longer, but no more than that
/// at once, and no more than a limit in all. One alone may be the system's fault. Levels take some queries to change, with both the old and the new ones in them,
/// and until then no more is done.
const STEP: f64 = 1.2;
const LARGEST_STEP: f64 = 2.0;
const MOST: f64 = 1e6;
const CHANGING: u32 = super::front::BLEND_STEPS as u32;
/// One that takes less than this share of its time could be stricter ...
const SPARE: f64 = 0.6;
/// ... and at once when it takes less than this one, for then a step costs too little to matter.
const IDLE: f64 = 0.1;
/// Queries with time to spare, one after the other, until one step stricter is tried: longer than a change of level takes.
const CALM: u32 = 40;
/// A step that turned out to be too much is tried again after twice as many, up to so many.
const MOST_CALM: u32 = 1280;

/// Multiplies the errors that are allowed. What is refined at any value of it are the nodes with the greatest errors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leniency {
    factor: f64,
    /// Queries with time to spare since the last step.
    calm: u32,
    /// How many of them the next step needs.
    needed: u32,
    /// Queries since the last step to be stricter, and since the last one to be more lenient.
    tried: u32,
    yielded: u32,
    /// Of the last query.
    share: f64,
}

impl Default for Leniency {
    fn default() -> Self {
        Self { factor: 1.0, calm: 0, needed: CALM, tried: u32::MAX, yielded: u32::MAX, share: 0.0 }
    }
}

impl Leniency {
    /// At least 1.
    pub(super) fn factor(&self) -> f64 {
        self.factor
    }

    /// Queries take, or would take, longer than they may.
    pub(super) fn is_late(&self) -> bool {
        self.factor > 1.0
    }

    /// Takes in the share of its time that a query took. One that was exact could not have been faster by leniency, so many of them call for
    /// no more of it than one.
    pub(super) fn observe(&mut self, share: f64, by_levels: bool) {
        if share.is_nan() {
            return;
        }
        let both = share.min(core::mem::replace(&mut self.share, share));
        self.tried = self.tried.saturating_add(1);
        self.yielded = self.yielded.saturating_add(1);
        if both > 1.0 {
            self.calm = 0;
            if self.tried < CALM {
                // The last step was too much.
                self.needed = (2 * self.needed).min(MOST_CALM);
                self.tried = u32::MAX;
            }
            if !by_levels {
                self.factor = self.factor.max(STEP);
            } else if self.yielded > CHANGING {
                self.factor = (self.factor * both.clamp(STEP, LARGEST_STEP)).min(MOST);
                self.yielded = 0;
            }
        } else if share < SPARE && self.factor > 1.0 {
            self.calm += 1;
            if share < IDLE || self.calm >= self.needed {
                self.needed = if share < IDLE { CALM } else { self.needed };
                self.factor = (self.factor / STEP).max(1.0);
                (self.calm, self.tried) = (0, 0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Would catch a budget that is kept no better than by chance: queries that cost the less the more lenient they are, and half as much again while levels
    /// change, go to and fro about it.
    #[test]
    fn few_queries_are_late() {
        let mut leniency = Leniency::default();
        let (mut late, mut changing, mut last) = (0, 0, 1.0);
        for query in 0..10_000 {
            changing = if leniency.factor() == last { changing - 1 } else { 20 };
            last = leniency.factor();
            let share = 8.0 / last * if changing > 0 { 1.5 } else { 1.0 };
            leniency.observe(share, true);
            late += u32::from(query >= 500 && share > 1.0);
        }
        assert!(late < 300, "{late}");
        // No coarser than it has to be.
        assert!((8.0..20.0).contains(&leniency.factor()), "{}", leniency.factor());
    }

    /// Would catch one query that the system held up and that makes contacts coarse; exact queries, which no leniency makes faster, that leave nothing of the contacts after them; time that is not a number; and leniency that stays
    /// when there is time.
    #[test]
    fn leniency_comes_from_levels_and_goes() {
        let mut leniency = Leniency::default();
        (0..100).for_each(|_| leniency.observe(f64::INFINITY, false));
        assert_eq!(leniency.factor(), STEP);
        (0..100).for_each(|_| leniency.observe(f64::NAN, true));
        assert_eq!(leniency.factor(), STEP);
        (0..400).for_each(|_| leniency.observe(f64::INFINITY, true));
        assert_eq!(leniency.factor(), MOST);
        (0..100).for_each(|_| leniency.observe(0.0, true));
        leniency.observe(9.0, true);
        leniency.observe(0.9, true);
        assert_eq!(leniency.factor(), 1.0);
        assert!(!leniency.is_late());
    }
}
