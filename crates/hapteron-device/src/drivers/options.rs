//! A driver's settings: keys and values as texts, from the scene's `[device]` table.

use super::OpenError;
use std::collections::BTreeMap;
use std::time::Duration;

/// A driver's settings; which keys there are depends on the kind (`docs/devices.md`).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DriverOptions {
    values: BTreeMap<String, String>,
}

impl DriverOptions {
    /// All defaults.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// With one more setting.
    #[must_use]
    pub fn with(mut self, key: impl Into<String>, value: impl ToString) -> Self {
        self.set(key, value);
        self
    }

    /// Sets one key.
    pub fn set(&mut self, key: impl Into<String>, value: impl ToString) {
        self.values.insert(key.into(), value.to_string());
    }

    /// The text of a key, if it is set.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&str> {
        self.values.get(key).map(String::as_str)
    }

    /// The view of one driver, after a check that it knows every key.
    pub(super) fn of(&self, kind: &'static str, known: &[&str]) -> Result<Reader<'_>, OpenError> {
        match self.values.keys().find(|key| !known.contains(&key.as_str())) {
            None => Ok(Reader { options: self, kind }),
            Some(key) => Err(OpenError::UnknownOption {
                kind,
                key: key.clone(),
                hint: suggestion(key, known),
                known: known.join(", "),
            }),
        }
    }
}

/// `; did you mean 'x'?` when a known word is near.
pub(super) fn suggestion(word: &str, known: &[&str]) -> String {
    let near = known
        .iter()
        .map(|k| (strsim::normalized_damerau_levenshtein(&word.to_lowercase(), k), k))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match near {
        Some((likeness, k)) if likeness > 0.5 => format!("; did you mean '{k}'?"),
        _ => String::new(),
    }
}

/// Options of one driver, read by type.
pub(super) struct Reader<'a> {
    options: &'a DriverOptions,
    kind: &'static str,
}

impl<'a> Reader<'a> {
    pub fn text(&self, key: &'static str) -> Option<&'a str> {
        self.options.get(key)
    }

    /// A number within bounds.
    pub fn number(
        &self,
        key: &'static str,
        default: f64,
        bounds: std::ops::RangeInclusive<f64>,
    ) -> Result<f64, OpenError> {
        let Some(text) = self.text(key) else { return Ok(default) };
        match text.trim().parse::<f64>() {
            Ok(number) if bounds.contains(&number) => Ok(number),
            _ => Err(self.bad(key, text, format!("a number from {} to {}", bounds.start(), bounds.end()))),
        }
    }

    /// A time in seconds, within bounds.
    pub fn seconds(
        &self,
        key: &'static str,
        default: f64,
        bounds: std::ops::RangeInclusive<f64>,
    ) -> Result<Duration, OpenError> {
        Ok(Duration::from_secs_f64(self.number(key, default, bounds)?))
    }

    /// A whole number.
    pub fn count(&self, key: &'static str) -> Result<Option<u32>, OpenError> {
        let parse = |text: &str| {
            text.trim().parse().map_err(|_| self.bad(key, text, "a whole number, not negative".into()))
        };
        self.text(key).map(parse).transpose()
    }

    /// One of some words; the first is the default.
    pub fn choice(
        &self,
        key: &'static str,
        words: &'static [&'static str],
    ) -> Result<&'static str, OpenError> {
        let Some(text) = self.text(key) else { return Ok(words[0]) };
        let found = words.iter().find(|w| **w == text);
        found.copied().ok_or_else(|| {
            let hint = suggestion(text, words);
            self.bad(key, text, format!("one of {}{hint}", words.join(", ")))
        })
    }

    /// `on` or `off`.
    pub fn switch(&self, key: &'static str, default: bool) -> Result<bool, OpenError> {
        match self.text(key) {
            None => Ok(default),
            Some("on" | "true" | "yes") => Ok(true),
            Some("off" | "false" | "no") => Ok(false),
            Some(text) => Err(self.bad(key, text, "on or off".into())),
        }
    }

    fn bad(&self, key: &'static str, value: &str, expected: String) -> OpenError {
        OpenError::BadOption { kind: self.kind, key, value: value.into(), expected }
    }
}
