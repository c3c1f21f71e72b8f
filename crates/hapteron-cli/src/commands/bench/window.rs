//! `hapteron bench --window`: whether an open window makes ticks later.
//!
//! One session runs all the time, its hand chewing with the jaws. Blocks without a window take turns with blocks in which one is opened,
//! left alone, moved and resized, or frozen, and closed again. A second series of blocks without a window is the control: what differs
//! between the two series without one is the machine's doing, not the window's.

use crate::progress::{self, say};
use anyhow::{Result, bail};
use hapteron::session::real_time::clock;
use hapteron_window::trial::{Block, Treatment, Trial};
use serde_json::{Value, json};
use std::io::Write;
use std::process::ExitCode;

/// Seconds of a block: four times the motion of the jaws.
const BLOCK: f64 = 3.6;
/// Fewest blocks of each kind.
const FEWEST: usize = 3;
/// With a window, a figure may be so many times that without one ...
const FACTOR: f64 = 1.2;
/// ... and this much more, microseconds: a thousandth of a period, and far below what a timer tells apart.
const RESOLUTION_US: f64 = 1.0;
/// The same for the share of missed deadlines.
const RESOLUTION_MISSED: f64 = 1e-4;
/// Shares of the ticks whose lateness is compared.
const SHARES: [(f64, &str); 3] = [(0.5, "50 %"), (0.99, "99 %"), (0.999, "99.9 %")];

/// What happens in a block.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Without,
    With(Treatment),
}

/// All ticks of one kind.
struct Series {
    name: &'static str,
    kind: Kind,
    whole: Block,
    /// The lateness of 99.9 % in each block, microseconds.
    blocks: Vec<f64>,
    pictures: (u64, f64),
}

impl Series {
    fn new(name: &'static str, kind: Kind) -> Self {
        Self { name, kind, whole: Block::default(), blocks: Vec::new(), pictures: (0, 0.0) }
    }

    fn add(&mut self, block: &Block) {
        self.blocks.push(late(block, 0.999));
        self.whole.append(block);
    }

    fn ticks(&self) -> usize {
        self.whole.lateness_ns.len()
    }

    fn missed(&self) -> f64 {
        self.whole.missed as f64 / (self.ticks() as f64 + self.whole.missed as f64).max(1.0)
    }
}

/// What a series is compared with another by.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Verdict {
    Holds,
    DoesNot,
    /// Two series without a window differ as much.
    Untold,
}

/// Runs it; fails when the window makes ticks later, or when the machine is too busy to tell.
pub fn window(seconds: f64, json: bool) -> Result<ExitCode> {
    progress::catch_interrupt();
    let rounds = ((seconds / BLOCK).ceil() as usize).max(FEWEST);
    let mut trial = Trial::start("jaws")?;
    let mut series = [
        Series::new("without a window", Kind::Without),
        Series::new("window open", Kind::With(Treatment::Open)),
        Series::new("without, control", Kind::Without),
        Series::new("moved and resized", Kind::With(Treatment::Moved)),
        Series::new("frozen", Kind::With(Treatment::Frozen)),
    ];
    let mut around = Series::new("opening and closing", Kind::With(Treatment::Open));
    // The caches, the clocks and the session's own look-ahead settle.
    trial.without(1.0)?;
    let begun = clock::now_ns();
    for round in 0..rounds {
        // Every other round in the opposite order, so that a machine that becomes slower favours none.
        let mut order: Vec<usize> = (0..series.len()).collect();
        if round % 2 == 1 {
            order.reverse();
        }
        for index in order {
            if progress::interrupted() {
                bail!("stopped by Ctrl-C");
            }
            let Series { name, kind, .. } = series[index];
            say!("round {} of {rounds}: {name} ...", round + 1);
            match kind {
                Kind::Without => {
                    let block = trial.without(BLOCK)?;
                    series[index].add(&block);
                }
                Kind::With(treatment) => {
                    let shows = trial.with(treatment, BLOCK)?;
                    series[index].add(&shows.steady);
                    series[index].pictures.0 += shows.pictures.0;
                    series[index].pictures.1 += shows.pictures.1;
                    around.add(&shows.around);
                }
            }
        }
    }
    let took = (clock::now_ns() - begun) as f64 * 1e-9;
    let whole = trial.stop();
    let verdicts = judge(&series, &around);
    if json {
        let value = as_json(&series, &around, &verdicts);
        writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&value)?)?;
    } else {
        print(&series, &around, &verdicts, rounds, took, &whole)?;
    }
    let good = verdicts.iter().all(|row| row.1.iter().all(|v| *v == Verdict::Holds));
    Ok(if good { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The lateness that a share of the ticks does not exceed, microseconds.
fn late(block: &Block, share: f64) -> f64 {
    let mut sorted = block.lateness_ns.clone();
    sorted.sort_unstable();
    quantile(&sorted, share) * 1e-3
}

fn quantile(sorted: &[u64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    sorted.get(((sorted.len() as f64 * share) as usize).min(last)).map_or(0.0, |v| *v as f64)
}

/// Lateness at [`SHARES`], microseconds, and the share of missed deadlines.
fn figures(series: &Series) -> [f64; 4] {
    let mut sorted = series.whole.lateness_ns.clone();
    sorted.sort_unstable();
    let at = |share: f64| quantile(&sorted, share) * 1e-3;
    [at(SHARES[0].0), at(SHARES[1].0), at(SHARES[2].0), series.missed()]
}

/// Whether figures are no worse than others, one by one.
fn no_worse(figures: &[f64; 4], than: &[f64; 4]) -> [bool; 4] {
    std::array::from_fn(|i| {
        let resolution = if i < 3 { RESOLUTION_US } else { RESOLUTION_MISSED };
        figures[i] <= FACTOR * than[i] + resolution
    })
}

/// Every series with a window, each figure against the mean of those of the two series without one.
fn judge(series: &[Series; 5], around: &Series) -> Vec<(&'static str, [Verdict; 4])> {
    let [first, control] = [figures(&series[0]), figures(&series[2])];
    let without: [f64; 4] = std::array::from_fn(|i| 0.5 * (first[i] + control[i]));
    // Where one of the two is worse than the other, what is no worse than that one may be the machine's doing.
    let (there, back) = (no_worse(&control, &first), no_worse(&first, &control));
    let worst: [f64; 4] = std::array::from_fn(|i| first[i].max(control[i]));
    [&series[1], &series[3], &series[4], around]
        .into_iter()
        .map(|one| {
            let own = figures(one);
            let (good, far) = (no_worse(&own, &without), no_worse(&own, &worst));
            let verdicts = std::array::from_fn(|i| match (good[i], far[i], there[i] && back[i]) {
                (true, _, _) => Verdict::Holds,
                (false, true, false) => Verdict::Untold,
                _ => Verdict::DoesNot,
            });
            (one.name, verdicts)
        })
        .collect()
}

fn print(
    series: &[Series; 5],
    around: &Series,
    verdicts: &[(&'static str, [Verdict; 4])],
    rounds: usize,
    took: f64,
    whole: &str,
) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "jaws of 47,340 and 40,180 triangles, chewing; {rounds} blocks of {BLOCK} s each, in turn, {took:.0} s"
    )?;
    writeln!(
        out,
        "  {:20} {:>7} {:>8} {:>9} {:>10} {:>10} {:>9} {:>14} {:>9} {:>9} {:>10}",
        "lateness, us",
        "ticks",
        "50 %",
        "99 %",
        "99.9 %",
        "greatest",
        "missed",
        "99.9 % of blocks",
        "contacts",
        "in touch",
        "pictures/s"
    )?;
    for one in series.iter().chain([around]) {
        let [median, p99, p999, missed] = figures(one);
        let greatest = one.whole.lateness_ns.iter().max().copied().unwrap_or(0) as f64 * 1e-3;
        let mut ages = one.whole.contact_age.clone();
        ages.sort_unstable();
        let (low, high) = one.blocks.iter().fold((f64::MAX, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
        let pictures = if one.pictures.1 > 0.0 {
            format!("{:.1}", one.pictures.0 as f64 / one.pictures.1)
        } else {
            String::new()
        };
        writeln!(
            out,
            "  {:20} {:7} {median:8.1} {p99:9.1} {p999:10.1} {greatest:10.1} {:9} {:>14} {:6.0} ms {:7.0} % {pictures:>10}",
            one.name,
            one.ticks(),
            format!("{:.3} %", missed * 100.0),
            format!("{low:.0} to {high:.0}"),
            quantile(&ages, 0.99),
            100.0 * one.whole.in_contact as f64 / one.ticks().max(1) as f64,
        )?;
    }
    writeln!(out, "  contacts: age of those in use, 99 %. Whole session: {whole}")?;
    writeln!(
        out,
        "no worse than without by more than {:.0} % (and {RESOLUTION_US} us, {:.2} % of the deadlines)",
        (FACTOR - 1.0) * 100.0,
        RESOLUTION_MISSED * 100.0
    )?;
    for (name, row) in verdicts {
        let names = SHARES.iter().map(|s| s.1).chain(["missed"]);
        let words: Vec<String> = names.zip(row).map(|(what, v)| format!("{what}: {}", word(*v))).collect();
        writeln!(out, "  {name:20} {}", words.join("   "))?;
    }
    if verdicts.iter().any(|row| row.1.contains(&Verdict::Untold)) {
        writeln!(
            out,
            "  cannot tell: the two series without a window differ by as much; close what else runs here"
        )?;
    }
    Ok(())
}

fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Holds => "holds",
        Verdict::DoesNot => "DOES NOT HOLD",
        Verdict::Untold => "cannot tell",
    }
}

fn as_json(series: &[Series; 5], around: &Series, verdicts: &[(&'static str, [Verdict; 4])]) -> Value {
    let one = |s: &Series| {
        let [median, p99, p999, missed] = figures(s);
        json!({
            "name": s.name,
            "ticks": s.ticks(),
            "late_us": {"p50": median, "p99": p99, "p99.9": p999},
            "late_us_p99.9_by_block": s.blocks,
            "missed": s.whole.missed,
            "missed_share": missed,
            "pictures_per_second": (s.pictures.1 > 0.0).then(|| s.pictures.0 as f64 / s.pictures.1),
        })
    };
    let verdict = |(name, row): &(&str, [Verdict; 4])| json!({"name": name, "p50": word(row[0]), "p99": word(row[1]), "p99.9": word(row[2]), "missed": word(row[3])});
    json!({
        "series": series.iter().chain([around]).map(one).collect::<Vec<_>>(),
        "no_worse_than_without": verdicts.iter().map(verdict).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(name: &'static str, scale: u64) -> Series {
        let mut made = Series::new(name, Kind::Without);
        let lateness_ns = (0..2000).map(|i| scale * i).collect();
        made.add(&Block { lateness_ns, ..Block::default() });
        made
    }

    fn all(scales: [u64; 5]) -> [Series; 5] {
        scales.map(|scale| series("", scale))
    }

    /// Would catch a verdict that is always the same.
    #[test]
    fn later_ticks_are_told_and_a_restless_machine_is_not_blamed_on_the_window() {
        let around = series("", 100);
        let verdicts = judge(&all([100, 110, 100, 130, 90]), &around);
        let p999: Vec<Verdict> = verdicts.iter().map(|row| row.1[2]).collect();
        assert_eq!(p999, [Verdict::Holds, Verdict::DoesNot, Verdict::Holds, Verdict::Holds]);
        // The two series without a window differ by half: 190 can be the machine, 300 cannot.
        let verdicts = judge(&all([100, 190, 160, 300, 90]), &around);
        let p999: Vec<Verdict> = verdicts.iter().map(|row| row.1[2]).collect();
        assert_eq!(p999, [Verdict::Untold, Verdict::DoesNot, Verdict::Holds, Verdict::Holds]);
    }

    #[test]
    fn missed_deadlines_count_by_their_share() {
        let mut made = all([100; 5]);
        made[1].whole.missed = 4;
        let verdicts = judge(&made, &series("", 100));
        assert_eq!((verdicts[0].1[3], verdicts[1].1[3]), (Verdict::DoesNot, Verdict::Holds));
    }
}
