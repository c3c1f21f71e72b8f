//! An axis of a map: a scene key and the values that it takes.

use anyhow::{Result, bail};

/// Most values on an axis.
const MOST: usize = 200;

/// One axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// As `table.key`.
    pub key: String,
    /// As they are set in the scene.
    pub values: Vec<String>,
    /// Whether each value is the last times a factor.
    pub logarithmic: bool,
}

impl Axis {
    /// From `KEY=lo:hi:n` (evenly spaced; by ratio when both ends are positive and the upper is ten times the lower) or `KEY=a,b,c`.
    pub fn parse(text: &str) -> Result<Self> {
        let help = "an axis is written table.key=lo:hi:n, as in contact.stiffness=500:20000:8, or table.key=a,b,c, as in hand.grip=light,firm";
        let Some((key, range)) = text.split_once('=') else { bail!("'{text}': {help}") };
        let key = key.trim().to_owned();
        let parts: Vec<&str> = range.split(':').map(str::trim).collect();
        let (values, logarithmic): (Vec<String>, bool) = match parts[..] {
            [list] => (list.split(',').map(|v| v.trim().to_owned()).collect(), false),
            [lo, hi, n] => {
                let (Ok(lo), Ok(hi), Ok(n)) = (lo.parse::<f64>(), hi.parse::<f64>(), n.parse::<usize>())
                else {
                    bail!("'{text}': {help}")
                };
                if !(lo.is_finite() && hi.is_finite() && lo < hi && (2..=MOST).contains(&n)) {
                    bail!("'{text}': lo must be below hi, both finite, and n from 2 to {MOST}");
                }
                let logarithmic = lo > 0.0 && hi / lo >= 10.0;
                let at = |i: usize| {
                    let f = i as f64 / (n - 1) as f64;
                    let v = if logarithmic { lo * (hi / lo).powf(f) } else { lo + (hi - lo) * f };
                    // Four digits, so that what is written is what is run.
                    format!("{v:.3e}").parse().unwrap_or(v)
                };
                ((0..n).map(|i| number(at(i))).collect(), logarithmic)
            }
            _ => bail!("'{text}': {help}"),
        };
        if values.iter().any(String::is_empty) || values.len() > MOST {
            bail!("'{text}': {help}");
        }
        Ok(Self { key, values, logarithmic })
    }
}

/// A number as short as it can be written, with a point or exponent, which TOML needs to take it for one that is not whole.
fn number(v: f64) -> String {
    format!("{v:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_spaced_evenly_or_by_ratio() {
        let axis = Axis::parse("contact.stiffness=100:10000:3").unwrap();
        assert_eq!(
            (axis.values, axis.logarithmic),
            (vec!["100.0".into(), "1000.0".into(), "10000.0".into()], true)
        );
        let axis = Axis::parse("device.delay=0,1,2").unwrap();
        assert_eq!(axis.values, ["0", "1", "2"]);
        assert_eq!(Axis::parse("coupling.linear_damping=0:4:3").unwrap().values, ["0.0", "2.0", "4.0"]);
        for bad in ["a.b", "a.b=1:2", "a.b=2:1:3", "a.b=1:2:1", "a.b=1:inf:3", "a.b=1,,2", "a.b=x:2:3"] {
            assert!(Axis::parse(bad).is_err(), "{bad}");
        }
    }
}
