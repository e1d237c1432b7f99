//! Names with values.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use maud::{Markup, Render, html};
use serde_json::Value;

use crate::error::{Error, Result};

/// A list of names with values, such as the metrics of a run.
#[must_use]
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Facts {
    pub(crate) entries: Vec<(String, String)>,
}

/// Metrics `name.stepK` for more values of `K` than these are shown by the first and the last.
const LONGEST_SERIES: usize = 6;

impl Facts {
    /// Adds an entry at the end.
    pub fn with(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.entries.push((name.into(), value.into()));
        self
    }

    /// Adds a value at the end: entries of maps are named `name: key of the entry`, lists of plain values are one line,
    /// numbers have five digits unless they are whole, and null is left out.
    pub fn with_value(self, name: &str, value: &Value) -> Self {
        match value {
            Value::Object(map) => map.iter().fold(self, |facts, (key, value)| {
                facts.with_value(&format!("{name}: {}", key.replace('_', " ")), value)
            }),
            Value::Array(values) if values.iter().any(|v| v.is_object() || v.is_array()) => {
                let values = values.iter().enumerate();
                values.fold(self, |facts, (k, value)| {
                    facts.with_value(&format!("{name}[{k}]"), value)
                })
            }
            Value::Array(values) => {
                let values: Vec<String> = values.iter().map(plain).collect();
                self.with(name, values.join(", "))
            }
            Value::Null => self,
            value => self.with(name, plain(value)),
        }
    }

    /// The metrics in the text of a `summary.json`, a flat map from names to numbers; `name` is for
    /// messages. Numbers have five digits, and a long series `x.step0`, `x.step1`, ... one line.
    pub fn from_summary(name: &str, json: &str) -> Result<Self> {
        let failed = |problem: String| Error::Json {
            name: name.to_owned(),
            expected: "a flat map from names to numbers",
            problem,
        };
        let map: BTreeMap<String, Value> =
            serde_json::from_str(json).map_err(|error| failed(error.to_string()))?;
        let mut metrics: Vec<(&str, f64)> = Vec::with_capacity(map.len());
        for (metric, value) in &map {
            let number = value
                .as_f64()
                .ok_or_else(|| failed(format!("{metric:?} is {value}")))?;
            metrics.push((metric, number));
        }
        metrics.sort_by(|(a, _), (b, _)| natural(a, b));
        let mut facts = Self::default();
        for group in
            metrics.chunk_by(|(a, _), (b, _)| series(a).is_some() && series(a) == series(b))
        {
            let ((first, from), (last, to)) = (group[0], group[group.len() - 1]);
            if group.len() > LONGEST_SERIES {
                let step = last.rsplit('.').next().unwrap_or_default();
                let [from, to] = [from, to].map(five_digits);
                facts = facts.with(format!("{first} … {step}"), format!("{from} … {to}"));
            } else {
                for &(metric, value) in group {
                    facts = facts.with(metric, five_digits(value));
                }
            }
        }
        Ok(facts)
    }
}

impl Render for Facts {
    fn render(&self) -> Markup {
        html! {
            dl.facts {
                @for (name, value) in &self.entries {
                    div { dt { (name) } dd { (value) } }
                }
            }
        }
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => five_digits(number.as_f64().unwrap_or(0.0)),
        other => other.to_string(),
    }
}

/// `x` of `x.step12`.
fn series(metric: &str) -> Option<&str> {
    let (series, step) = metric.rsplit_once(".step")?;
    (!step.is_empty() && step.bytes().all(|b| b.is_ascii_digit())).then_some(series)
}

/// The order in which `step2` comes before `step10`.
pub(crate) fn natural(a: &str, b: &str) -> Ordering {
    // `1` and `01` are told apart by their characters.
    parts(a).cmp(parts(b)).then_with(|| a.cmp(b))
}

/// Characters, and numbers as one part each: of two without leading zeros, the longer one is larger.
fn parts(mut text: &str) -> impl Iterator<Item = (char, usize, &str)> {
    std::iter::from_fn(move || {
        let first = text.chars().next()?;
        let digits = text.bytes().take_while(u8::is_ascii_digit).count();
        let (part, rest) = text.split_at(digits.max(first.len_utf8()));
        text = rest;
        let number = part.trim_start_matches('0');
        Some(match digits {
            0 => (first, 0, ""),
            _ => ('0', number.len(), number),
        })
    })
}

/// A number with five digits; whole numbers as they are.
pub fn five_digits(value: f64) -> String {
    const LARGEST_WHOLE: f64 = 1e9;
    if value.fract() == 0.0 && value.abs() < LARGEST_WHOLE {
        return format!("{value:.0}").replace('-', "\u{2212}");
    }
    // Rounded first, so that 0.99999999 is 1.0000 and not 1.00000.
    let rounded = format!("{value:.4e}");
    let exponent: i32 = rounded
        .split_once('e')
        .and_then(|(_, exponent)| exponent.parse().ok())
        .unwrap_or_default();
    let text = if (-4..6).contains(&exponent) {
        format!("{value:.*}", usize::try_from(4 - exponent).unwrap_or(0))
    } else {
        rounded
    };
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use std::fmt::Write;

    use super::*;
    use proptest::prelude::*;

    #[test]
    fn long_series_take_one_line() {
        let mut json = String::from("{\"a.w\":1.5");
        for step in 0..12 {
            let _ = write!(
                json,
                ",\"a.tip.step{step}\":{}",
                0.5 + f64::from(step) / 8.0
            );
        }
        json.push_str(",\"a.n128\":2e-7,\"a.n64\":3,\"b.step0\":1,\"b.step1\":2}");
        let expected = [
            ("a.n64", "3"),
            ("a.n128", "2.0000e\u{2212}7"),
            ("a.tip.step0 … step11", "0.50000 … 1.8750"),
            ("a.w", "1.5000"),
            ("b.step0", "1"),
            ("b.step1", "2"),
        ];
        let expected = expected.map(|(name, value)| (name.to_owned(), value.to_owned()));
        let facts = Facts::from_summary("summary.json", &json).unwrap();
        assert_eq!(facts.entries, expected);
    }

    #[test]
    fn what_is_no_summary_is_named() {
        for json in [
            "",
            "[1]",
            "{\"a\": \"x\"}",
            "{\"a\": {\"b\": 1}}",
            "{\"a\": 1",
        ] {
            let error = Facts::from_summary("cross/summary.json", json).unwrap_err();
            let message = error.to_string();
            assert!(
                message.contains("cross/summary.json") && !message.contains('\n'),
                "{message}"
            );
        }
    }

    #[test]
    fn numbers_have_five_digits() {
        let cases = [
            (0.99999999, "1.0000"),
            (123456.7, "123457"),
            (1234567.8, "1.2346e6"),
            (0.00012345, "0.00012345"),
            (-0.1, "\u{2212}0.10000"),
            (0.0, "0"),
        ];
        for (value, text) in cases {
            assert_eq!(five_digits(value), text);
        }
    }

    fn name() -> impl Strategy<Value = String> {
        let characters = prop::sample::select(vec!['a', '.', '0', '1', '2']);
        prop::collection::vec(characters, 0..7).prop_map(String::from_iter)
    }

    proptest! {
        #[test]
        fn the_natural_order_is_an_order(a in name(), b in name(), c in name()) {
            prop_assert_eq!(natural(&a, &b), natural(&b, &a).reverse());
            prop_assert_eq!(natural(&a, &b) == Ordering::Equal, a == b);
            if natural(&a, &b).is_le() && natural(&b, &c).is_le() {
                prop_assert!(natural(&a, &c).is_le());
            }
        }
    }
}
