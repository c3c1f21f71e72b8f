//! The timing of a session in real time: a section of the report, and `timing.json`.

use super::plot::{Plot, Plots};
use super::run::Live;
use super::{Cell, Page};
use hapteron::session::real_time::{Distribution, Grants, ON_TIME_NS, Timing};
use serde_json::{Value, json};

/// Shares of a distribution that are named.
const SHARES: [(&str, f64); 4] = [("median", 0.5), ("99 %", 0.99), ("99.9 %", 0.999), ("99.99 %", 0.9999)];
/// How the rarest events are drawn: one in 10^x, x in these steps.
const STEP: f64 = 0.02;

const US: f64 = 1e-3;

/// What was measured, in words.
fn named(timing: &Timing) -> [(&'static str, &'static str, &Distribution); 6] {
    [
        ("lateness", "lateness of a tick", &timing.lateness),
        ("bare_lateness", "lateness of a bare loop between the ticks", &timing.bare_lateness),
        ("period", "from tick to tick", &timing.period),
        ("compute", "computing a tick", &timing.compute),
        ("contact_age", "age of contacts in use", &timing.contact_age),
        ("pass", "a contact pass", &timing.pass),
    ]
}

/// What the system granted, in words.
fn granted(grants: &Grants) -> [(&'static str, String); 6] {
    [
        ("priority of the haptic thread", grants.priority.to_string()),
        ("CPU of the haptic thread", grants.cpu.to_string()),
        ("memory", grants.memory.to_string()),
        ("wake-up latency", grants.latency.to_string()),
        ("priority of the contact thread", grants.contact_priority.to_string()),
        ("CPU of the contact thread", grants.contact_cpu.to_string()),
    ]
}

/// The section of the report.
pub fn section(page: &mut Page, live: &Live) {
    let timing = &live.timing;
    page.heading("Timing");
    let mut text = format!(
        "{} ticks, {} deadlines missed, {} contact passes; {} ticks used a device sample again.",
        timing.ticks, timing.missed, timing.passes, timing.repeated
    );
    if records_lost(live) > 0 {
        text.push_str(&format!(
            " {} records were lost: the log is not complete and does not repeat the session exactly.",
            records_lost(live)
        ));
    }
    page.paragraph(&text, false);
    if let Some(trouble) = &live.trouble {
        page.paragraph(trouble, false);
    }
    if let Some(text) = left_out(live) {
        page.paragraph(&text, false);
    }
    if !live.faults.is_empty() {
        let rows: Vec<Vec<Cell>> = live
            .faults
            .iter()
            .map(|f| {
                let until = f.rearmed.map_or_else(|| "the end".to_owned(), |t| format!("{t:.3}"));
                [format!("{:.3}", f.time), until, f.reason.clone()].into_iter().map(Cell::Text).collect()
            })
            .collect();
        page.table(&["no force from, s", "to, s", "because"], &rows);
    }
    let mut header = vec!["microseconds"];
    header.extend(SHARES.iter().map(|s| s.0));
    header.push("greatest");
    let mut rows = Vec::new();
    for (_, what, distribution) in named(timing).iter().filter(|n| n.2.count > 0) {
        let mut row = vec![Cell::Text((*what).to_owned())];
        row.extend(
            SHARES.iter().map(|s| Cell::Text(format!("{:.1}", distribution.quantile_ns(s.1) as f64 * US))),
        );
        row.push(Cell::Text(format!("{:.1}", distribution.greatest_ns as f64 * US)));
        rows.push(row);
    }
    page.table(&header, &rows);
    page.plots(&rare(timing));
    let rows: Vec<Vec<Cell>> = granted(&live.grants)
        .into_iter()
        .map(|(what, text)| vec![Cell::Text(what.to_owned()), Cell::Text(text)])
        .collect();
    page.table(&["asked of the system", "granted"], &rows);
}

/// Distributions drawn so that the rare events can be seen.
fn rare(timing: &Timing) -> Plots {
    let mut plots = Plots::new("one in 10^x is greater: x");
    let most = timing.lateness.count.max(timing.pass.count).max(10) as f64;
    let xs: Vec<f64> = (0..=(most.log10() / STEP) as usize).map(|i| i as f64 * STEP).collect();
    let times = plots.times(&xs);
    let curve = |distribution: &Distribution| -> Vec<f64> {
        let share = |x: &f64| 1.0 - 10f64.powf(-x);
        let known = |x: &f64| distribution.count as f64 >= 10f64.powf(*x);
        xs.iter()
            .map(|x| if known(x) { distribution.quantile_ns(share(x)) as f64 * US } else { f64::NAN })
            .collect()
    };
    let mut late = Plot::new("Lateness", "us").clipped(1000.0);
    for (label, distribution) in [("ticks", &timing.lateness), ("bare loop", &timing.bare_lateness)] {
        if distribution.count > 0 {
            late = late.series(label, times, &curve(distribution));
        }
    }
    if timing.lateness.count > 0 {
        plots.add(late);
    }
    plots.add(Plot::new("Computing a tick", "us").series("ticks", times, &curve(&timing.compute)));
    plots.add(Plot::new("A contact pass", "us").series("passes", times, &curve(&timing.pass)));
    plots
}

/// Ticks and passes that are not in the files.
pub fn records_lost(live: &Live) -> u64 {
    live.timing.lost + live.unrecorded
}

/// `timing.json`.
pub fn json(live: &Live) -> Value {
    let timing = &live.timing;
    let mut histograms = serde_json::Map::new();
    for (name, _, distribution) in named(timing) {
        histograms.insert(name.to_owned(), distribution_json(distribution));
    }
    json!({
        "end": live.end.to_string(),
        "device": live.device,
        "granted": granted(&live.grants).into_iter().map(|(k, v)| (k.to_owned(), v.into())).collect::<serde_json::Map<_, _>>(),
        "ticks": timing.ticks,
        "missed_deadlines": timing.missed,
        "contact_passes": timing.passes,
        "samples_used_again": timing.repeated,
        "limited_by_device": timing.limited_by_device,
        "records_lost": records_lost(live),
        "recording_trouble": live.trouble,
        "undelivered": {
            "ticks": timing.undelivered.ticks,
            "greatest_force": timing.undelivered.greatest_force,
            "greatest_torque": timing.undelivered.greatest_torque,
        },
        "faults": live.faults.iter().map(|f| json!({"time": f.time, "rearmed": f.rearmed, "reason": f.reason})).collect::<Vec<_>>(),
        "within_50_us": timing.lateness.share_up_to(ON_TIME_NS),
        "lateness_99_9_ratio": ratio_json(timing),
        "nanoseconds": histograms,
    })
}

/// The ticks' 99.9 % against the bare loop's: least, as measured, greatest; null without a bare loop.
pub fn ratio_json(timing: &Timing) -> Value {
    timing.lateness_ratio().map_or(Value::Null, |r| json!([r.between[0], r.ratio, r.between[1]]))
}

/// What a device that drives some axes has no motors for; one that drives none leaves out everything, which goes without saying.
pub fn left_out(live: &Live) -> Option<String> {
    let undelivered = &live.timing.undelivered;
    let driven = undelivered.greatest_force == 0.0 || undelivered.greatest_torque == 0.0;
    (undelivered.ticks > 0 && driven).then(|| {
        format!(
            "the device has no motors for some of what it should have displayed: up to {:.2} N and {:.1} mN m were left out, in {} ticks",
            undelivered.greatest_force,
            undelivered.greatest_torque * 1e3,
            undelivered.ticks
        )
    })
}

/// Quantiles and bins of a distribution.
pub fn distribution_json(d: &Distribution) -> Value {
    json!({
        "count": d.count,
        "mean": d.mean_ns(),
        "p50": d.quantile_ns(0.5),
        "p90": d.quantile_ns(0.9),
        "p99": d.quantile_ns(0.99),
        "p99_9": d.quantile_ns(0.999),
        "p99_9_between": d.quantile_between_ns(0.999),
        "p99_99": d.quantile_ns(0.9999),
        "greatest": d.greatest_ns,
        "bins": d.bins().map(|(from, count)| json!([from, count])).collect::<Vec<_>>(),
    })
}
