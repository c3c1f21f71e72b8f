//! How far ahead a contact pass looks in real time.
//!
//! Planes that will be needed before the next pass takes over must be found by this one, so the margin is speed times the time that passes
//! take. But a wider margin finds more contacts and makes the pass slower, which asks for a wider margin: left alone, one slow pass could
//! keep all later ones slow. So the time is measured, and bounded by a limit that falls while passes are slow because of what they find in
//! the margin, and rises again when they are not: from what the last pass looked ahead, and by little, so that one pass that the system held up for long
//! does not make the next one look ten times as far, where it may find ten times as much.

/// Passes slower than this are asked whether their margin is to blame, seconds.
const SLOW: f64 = 0.004;
/// Looking farther ahead than this is guessing, seconds.
const FARTHEST: f64 = 0.05;
const FALL: f64 = 0.7;
const RISE: f64 = 1.25;
/// How fast an unusually long pass is forgotten.
const FORGET: f64 = 0.8;

/// The time ahead that the margin is made for.
#[derive(Clone, Copy, Debug)]
pub struct Lookahead {
    measured: f64,
    least: f64,
    limit: f64,
}

impl Lookahead {
    /// Before anything is measured: `expected` seconds, and never less.
    #[must_use]
    pub fn new(expected: f64) -> Self {
        Self { measured: expected, least: expected, limit: expected * RISE }
    }

    /// For the next pass, seconds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.measured.min(self.limit).max(self.least)
    }

    /// Learns from a pass: how long after the one before it it started, how long it took (seconds), how many contacts it found, and how many
    /// of them were in the margin only.
    pub fn learn(&mut self, interval: f64, duration: f64, found: u32, in_margin: u32) {
        let ahead = self.seconds();
        let needed = interval + duration;
        self.measured = needed.max(FORGET * self.measured + (1.0 - FORGET) * needed);
        let margin_costs = duration > SLOW && 2 * in_margin > found;
        let limit = ahead * if margin_costs { FALL } else { RISE };
        self.limit = limit.clamp(self.least, FARTHEST.max(self.least));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Duration of a pass by the time that it looks ahead: a base, and the area of contact that comes with the margin.
    fn settle(mut look: Lookahead, base: f64, growth: f64, passes: usize) -> (Lookahead, f64) {
        let mut duration = 0.0;
        for _ in 0..passes {
            let ahead = look.seconds();
            duration = base + growth * ahead * ahead;
            let (near, far) = (50.0, 50.0 * growth * ahead * ahead / base);
            look.learn(duration.max(1e-3), duration, (near + far) as u32, far as u32);
        }
        (look, duration)
    }

    /// Would catch passes that keep themselves slow: without the limit this cost has no fixed point below the farthest (0.15 s a pass).
    #[test]
    fn one_slow_pass_does_not_make_all_later_ones_slow() {
        let mut look = Lookahead::new(2e-3);
        look.learn(0.1, 0.1, 100, 10);
        let (look, duration) = settle(look, 5e-4, 60.0, 400);
        assert!(duration < 2.0 * SLOW, "{duration}");
        // And where the margin is cheap it is as wide as the measured times ask.
        let (look, duration) = settle(look, 5e-4, 1e-3, 400);
        assert!((look.seconds() - 2e-3).abs() < 1e-4 && duration < 6e-4, "{look:?}");
    }

    /// Would catch a jump to the farthest after one wait: with the margin of 50 ms the jaws' pass takes 46 ms instead of 0.9 ms, and finds 4,400 contacts.
    #[test]
    fn a_pass_that_is_held_up_does_not_make_the_next_ones_slow() {
        let (mut look, _) = settle(Lookahead::new(2e-3), 9e-4, 18.0, 400);
        look.learn(0.08, 0.08, 400, 10);
        let mut slowest = 0.0f64;
        for _ in 0..100 {
            let (next, duration) = settle(look, 9e-4, 18.0, 1);
            (look, slowest) = (next, slowest.max(duration));
        }
        assert!(slowest < 2.0 * SLOW, "{slowest}");
    }

    #[test]
    fn passes_that_are_slow_by_themselves_look_as_far_as_they_take() {
        let (look, _) = settle(Lookahead::new(2e-3), 0.015, 1e-6, 400);
        assert!((look.seconds() - 0.03).abs() < 1e-3, "{look:?}");
    }
}
