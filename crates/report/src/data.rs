//! Records and series as CSV and JSON.

use std::io;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::plot::Series;

/// Records as CSV with a header from their field names (RFC 4180 quoting, line feeds).
///
/// Records are flat structs of numbers, text and options (`None` is an empty field). Floats are
/// written with the fewest digits that read back exactly; NaN and infinities as `NaN` and `inf`.
///
/// # Errors
///
/// [`Error::Csv`] if a record is not flat.
pub fn to_csv<T: Serialize>(records: impl IntoIterator<Item = T>) -> Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for record in records {
        writer.serialize(record)?;
    }
    finished(writer)
}

/// Curves as CSV in long form: one row `series,x,y` per point.
///
/// # Errors
///
/// [`Error::NotFinite`] naming series and point.
pub fn series_to_csv(series: &[Series]) -> Result<String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(["series", "x", "y"])?;
    for curve in series {
        for (k, point) in curve.points.iter().enumerate() {
            if let Some(&value) = point.iter().find(|c| !c.is_finite()) {
                let what = format!("point {k} of series {:?}", curve.name);
                return Err(Error::NotFinite { what, value });
            }
            let [x, y] = point.map(shortest);
            writer.write_record([curve.name.as_str(), &x, &y])?;
        }
    }
    finished(writer)
}

/// Any value as indented JSON with a final newline. JSON knows no NaN and no infinity: they become
/// `null`.
///
/// # Errors
///
/// [`Error::Json`] if the value has, for example, a map with keys that are not text.
pub fn to_json<T: Serialize>(value: &T) -> Result<String> {
    let mut text = serde_json::to_string_pretty(value).map_err(|source| Error::Json {
        what: "the value".to_owned(),
        source,
    })?;
    text.push('\n');
    Ok(text)
}

/// The fewest digits that read back exactly, with an exponent where that is shorter to read.
pub(crate) fn shortest(number: f64) -> String {
    let size = number.abs();
    if size == 0.0 || (1e-7..1e16).contains(&size) {
        format!("{number}")
    } else {
        format!("{number:e}")
    }
}

pub(crate) fn finished(writer: csv::Writer<Vec<u8>>) -> Result<String> {
    let bytes = writer
        .into_inner()
        .map_err(|error| csv::Error::from(error.into_error()))?;
    let invalid = |error| csv::Error::from(io::Error::new(io::ErrorKind::InvalidData, error));
    Ok(String::from_utf8(bytes).map_err(invalid)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde::Deserialize;

    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    struct Record {
        method: String,
        time: f64,
        iterations: Option<u32>,
    }

    proptest! {
        #[test]
        fn records_survive_csv_and_json(
            method in proptest::collection::vec(any::<char>(), 0..20),
            time in -1e300..1e300_f64,
            iterations in any::<Option<u32>>(),
        ) {
            let method: String = method.into_iter().collect();
            let records = vec![Record { method, time, iterations }; 2];
            let text = to_csv(&records).unwrap();
            let mut reader = csv::Reader::from_reader(text.as_bytes());
            let read: Vec<Record> = reader.deserialize().map(Result::unwrap).collect();
            prop_assert_eq!(&read, &records);
            let json: Vec<serde_json::Value> =
                serde_json::from_str(&to_json(&records).unwrap()).unwrap();
            prop_assert_eq!(json[1]["method"].as_str().unwrap(), &records[1].method);
        }

        #[test]
        fn shortest_numbers_read_back_exactly(number in proptest::num::f64::NORMAL) {
            prop_assert_eq!(shortest(number).parse::<f64>().unwrap().to_bits(), number.to_bits());
        }
    }

    #[test]
    fn series_are_in_long_form_with_quoted_names() {
        let series = [
            Series::new("ε = h, τ = h²", vec![[0.0, 1.0], [0.5, 1e-9]]),
            Series::new("exact", vec![[0.0, 2.0]]),
        ];
        let text = series_to_csv(&series).unwrap();
        assert_eq!(
            text,
            "series,x,y\n\"ε = h, τ = h²\",0,1\n\"ε = h, τ = h²\",0.5,1e-9\nexact,0,2\n"
        );
        let bad = Series::new("diverged", vec![[0.0, 1.0], [1.0, f64::NAN]]);
        let error = series_to_csv(&[bad]).unwrap_err().to_string();
        assert!(
            error.contains("point 1") && error.contains("diverged"),
            "{error}"
        );
    }
}
