//! Headline numbers of a run: a flat map from metric names to numbers, stored as `summary.json`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;
use serde_json::{Map, Number, Value};

use crate::error::{Error, Result};
use crate::output::OutputDir;
use crate::table::Cell;

/// Metric names and their values, sorted by name.
///
/// Names are lower-case words of ASCII letters, digits and `_` (not at their start), the first one starting with a letter, joined by
/// `.`, such as `circle.error_l2`. Values are finite, and no name is set twice. The same content gives the same bytes: floats have the fewest digits that read
/// back exactly.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[serde(transparent)]
pub struct Summary {
    metrics: BTreeMap<String, Number>,
}

impl Summary {
    /// Adds a metric: an integer without a decimal point, and nothing for text or a missing value.
    pub fn insert(&mut self, name: &str, value: impl Into<Cell>) -> Result<()> {
        let number = match value.into() {
            Cell::Integer(value) => value.into(),
            Cell::Number(value) => Number::from_f64(value).ok_or_else(|| Error::NotFinite {
                what: format!("metric {name:?}"),
                value,
            })?,
            Cell::Text(_) | Cell::Missing => return Ok(()),
        };
        self.add(name, number)
    }

    /// Adds the numbers of a record as `<prefix>.<field>`. Fields that hold text, lists or records are left out; those that are NaN,
    /// infinite or missing are refused.
    pub fn insert_record(&mut self, prefix: &str, record: &impl Serialize) -> Result<()> {
        let fields: Map<String, Value> = serde_json::to_value(record)
            .and_then(serde_json::from_value)
            .map_err(Error::json(format!("the record {prefix:?}")))?;
        for (field, value) in fields {
            let name = format!("{prefix}.{field}");
            match value {
                Value::Number(number) => self.add(&name, number)?,
                // JSON knows no NaN.
                Value::Null => self.insert(&name, f64::NAN)?,
                _ => {}
            }
        }
        Ok(())
    }

    fn add(&mut self, name: &str, number: Number) -> Result<()> {
        if !is_metric_name(name) {
            return Err(Error::MetricName(name.to_owned()));
        }
        if let Some(old) = self.metrics.get(name) {
            let (name, value) = (name.to_owned(), old.to_string());
            return Err(Error::DuplicateMetric { name, value });
        }
        self.metrics.insert(name.to_owned(), number);
        Ok(())
    }

    /// Writes `summary.json`.
    pub fn write(&self, folder: &OutputDir) -> Result<PathBuf> {
        folder.write_json("summary.json", self)
    }
}

fn is_metric_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit();
    let is_word =
        |word: &str| word.starts_with(is_plain) && word.chars().all(|c| is_plain(c) || c == '_');
    name.starts_with(|c: char| c.is_ascii_lowercase()) && name.split('.').all(is_word)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    #[test]
    fn values_that_are_not_finite_are_refused_by_name() {
        let mut summary = Summary::default();
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let error = summary.insert("torus.energy", value).unwrap_err();
            assert!(matches!(error, Error::NotFinite { .. }));
            assert!(error.to_string().contains("\"torus.energy\""), "{error}");
        }
        assert_eq!(summary, Summary::default());
    }

    #[test]
    fn integers_stay_integers() {
        let mut summary = Summary::default();
        summary.insert("l2", 2.5e-4).unwrap();
        summary.insert("newton", 17_usize).unwrap();
        let json = serde_json::to_string(&summary).unwrap();
        assert_eq!(json, r#"{"l2":0.00025,"newton":17}"#);
    }

    #[test]
    fn the_numbers_of_a_record_are_metrics() {
        #[derive(Serialize)]
        struct Circle {
            name: &'static str,
            radius: f64,
            steps: usize,
        }
        let circle = |radius| Circle {
            name: "first",
            radius,
            steps: 17,
        };
        let mut summary = Summary::default();
        summary.insert_record("circle", &circle(0.5)).unwrap();
        let expected = json!({"circle.radius": 0.5, "circle.steps": 17});
        assert_eq!(json!(summary), expected);
        let error = summary
            .insert_record("other", &circle(f64::NAN))
            .unwrap_err();
        assert!(error.to_string().contains("\"other.radius\""), "{error}");
        let error = summary.insert_record("no", &[1, 2]).unwrap_err();
        assert!(matches!(error, Error::Json { .. }));
    }

    #[test]
    fn names_follow_the_grammar() {
        let mut summary = Summary::default();
        for name in [
            "a",
            "error_l2",
            "circle.n128.error_l2",
            "a.b2_c",
            "hvp.512x512.ratio",
        ] {
            summary.insert(name, 1.0).unwrap();
        }
        for name in [
            "", "Error", "a b", "a..b", ".a", "a.", "2d", "ä", "a-b", "a._b", "_a", "a\"b",
        ] {
            let error = summary.insert(name, 1.0).unwrap_err();
            assert!(matches!(error, Error::MetricName { .. }), "{name:?}");
        }
        let error = summary.insert("a", 2.0).unwrap_err();
        assert!(matches!(error, Error::DuplicateMetric { .. }));
        assert_eq!(summary.metrics["a"].as_f64(), Some(1.0));
    }

    proptest! {
        #[test]
        fn every_finite_number_survives(
            value in proptest::num::f64::NORMAL | proptest::num::f64::ZERO,
        ) {
            let mut summary = Summary::default();
            summary.insert("metric", value).unwrap();
            let text = serde_json::to_string_pretty(&summary).unwrap();
            let read: BTreeMap<String, f64> = serde_json::from_str(&text).unwrap();
            prop_assert_eq!(read["metric"].to_bits(), value.to_bits());
        }
    }
}
