//! The last minutes, one row a tick.

use hapteron::recording::Row;
use std::collections::VecDeque;

/// Rows kept: two minutes at 1 kHz, some 50 megabytes.
pub const KEPT: usize = 120_000;

/// Rows in order of time.
pub struct History {
    rows: VecDeque<Row>,
    /// The tick of each.
    ticks: VecDeque<u64>,
    kept: usize,
}

impl History {
    /// One that keeps so many rows.
    #[must_use]
    pub fn keeping(kept: usize) -> Self {
        Self { rows: VecDeque::new(), ticks: VecDeque::new(), kept: kept.max(1) }
    }

    /// Adds the row of a tick, and forgets the oldest when there are too many. Its penetration is that of the row before until a contact
    /// pass has looked: see [`History::correct`].
    pub fn push(&mut self, tick: u64, mut row: Row) {
        if self.rows.len() >= self.kept {
            self.rows.pop_front();
            self.ticks.pop_front();
        }
        if let Some(before) = self.rows.back() {
            row.penetration = before.penetration;
        }
        self.rows.push_back(row);
        self.ticks.push_back(tick);
    }

    /// A pass has found the penetration at a tick; later ticks have it too, until the next pass.
    pub fn correct(&mut self, tick: u64, penetration: f64) {
        let first = self.ticks.partition_point(|t| *t < tick);
        for row in self.rows.range_mut(first..) {
            row.penetration = penetration;
        }
    }

    /// Whether no more rows fit without losing the oldest.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.rows.len() >= self.kept
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.ticks.clear();
    }

    /// The newest.
    #[must_use]
    pub fn newest(&self) -> Option<&Row> {
        self.rows.back()
    }

    /// Time of the oldest and the newest, seconds.
    #[must_use]
    pub fn span(&self) -> Option<[f64; 2]> {
        Some([self.rows.front()?.time, self.rows.back()?.time])
    }

    /// The row nearest before a time, or the oldest.
    #[must_use]
    pub fn at(&self, time: f64) -> Option<&Row> {
        let after = self.rows.partition_point(|r| r.time <= time);
        self.rows.get(after.saturating_sub(1))
    }

    /// Rows from one time to another.
    pub fn between(&self, from: f64, to: f64) -> impl Iterator<Item = &Row> + Clone {
        let first = self.rows.partition_point(|r| r.time < from);
        let last = self.rows.partition_point(|r| r.time <= to);
        self.rows.range(first..last.max(first))
    }

    /// All rows, oldest first.
    pub fn rows(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter()
    }
}

/// A curve thinned to what a plot of so many columns can show: the least and the greatest value of each column, in order of time.
///
/// `value` gives what is plotted; what is not finite is left out.
pub fn thinned<'a>(
    rows: impl Iterator<Item = &'a Row>,
    [from, to]: [f64; 2],
    columns: usize,
    value: impl Fn(&Row) -> f64,
) -> Vec<[f64; 2]> {
    let width = ((to - from) / columns.max(1) as f64).max(1e-9);
    let mut points: Vec<[f64; 2]> = Vec::with_capacity(2 * columns + 2);
    let mut column = i64::MIN;
    let (mut least, mut greatest) = ([0.0; 2], [0.0; 2]);
    let flush = |points: &mut Vec<[f64; 2]>, a: [f64; 2], b: [f64; 2]| {
        let (first, second) = if a[0] <= b[0] { (a, b) } else { (b, a) };
        points.push(first);
        if second != first {
            points.push(second);
        }
    };
    for row in rows {
        let point = [row.time, value(row)];
        if !point[1].is_finite() {
            continue;
        }
        let here = ((row.time - from) / width).floor() as i64;
        if here != column {
            if column != i64::MIN {
                flush(&mut points, least, greatest);
            }
            (column, least, greatest) = (here, point, point);
        } else if point[1] < least[1] {
            least = point;
        } else if point[1] > greatest[1] {
            greatest = point;
        }
    }
    if column != i64::MIN {
        flush(&mut points, least, greatest);
    }
    points
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use hapteron::session::Flags;
    use nalgebra::{Isometry3, Vector3};

    /// A row with a force of `force` newtons upwards.
    pub fn row(time: f64, force: f64) -> Row {
        Row {
            time,
            handle: Isometry3::identity(),
            body: Isometry3::identity(),
            body_velocity: [Vector3::zeros(); 2],
            coupling: [Vector3::zeros(); 2],
            contact: [Vector3::zeros(); 2],
            feedback: [Vector3::z() * force, Vector3::zeros()],
            deviation: 0.0,
            penetration: 0.0,
            contacts: 0,
            clusters: 0,
            contact_age: 0.0,
            flags: Flags::default(),
        }
    }

    /// Would catch a plot that loses the one millisecond in which the force had a peak.
    #[test]
    fn a_single_peak_survives_thinning() {
        let rows: Vec<Row> =
            (0..10_000).map(|i| row(f64::from(i) * 1e-3, if i == 7_777 { 9.0 } else { 1.0 })).collect();
        let points = thinned(rows.iter(), [0.0, 10.0], 200, |r| r.feedback[0].norm());
        assert!(points.len() <= 402, "{}", points.len());
        assert!(points.contains(&[7.777, 9.0]));
        assert!(points.windows(2).all(|w| w[0][0] < w[1][0]), "not in order of time");
    }

    /// Would catch a scrubbed view that shows another instant than the one asked for.
    #[test]
    fn the_row_at_a_time_is_the_one_before_it() {
        let mut history = History::keeping(KEPT);
        assert!(history.at(1.0).is_none());
        for i in 0..5 {
            history.push(i, row(i as f64, 0.0));
        }
        assert_eq!(history.at(2.9).unwrap().time, 2.0);
        assert_eq!(history.at(-1.0).unwrap().time, 0.0);
        assert_eq!(history.at(99.0).unwrap().time, 4.0);
        assert_eq!(history.between(1.0, 3.0).count(), 3);
        assert_eq!(history.between(7.0, 3.0).count(), 0);
    }

    #[test]
    fn memory_is_bounded() {
        let mut history = History::keeping(100);
        for i in 0..110 {
            history.push(i, row(i as f64, 0.0));
        }
        assert_eq!(history.rows().count(), 100);
        assert_eq!(history.span().unwrap()[0], 10.0);
    }

    /// Would catch a penetration told of the wrong ticks: a pass is done some ticks after the state that it looked at.
    #[test]
    fn a_pass_tells_of_the_tick_it_looked_at_and_later_ones() {
        let mut history = History::keeping(100);
        for i in 1..=5 {
            history.push(i, row(i as f64, 0.0));
        }
        history.correct(2, 0.1);
        history.correct(4, 0.2);
        history.push(6, row(6.0, 0.0));
        let found: Vec<f64> = history.rows().map(|r| r.penetration).collect();
        assert_eq!(found, [0.0, 0.1, 0.1, 0.2, 0.2, 0.2]);
    }
}
