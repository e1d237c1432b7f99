//! Records as CSV and JSON.

use std::io;

use serde::Serialize;

use crate::error::{Error, Result};

/// Records as CSV with a header from their field names.
pub(crate) fn to_csv<T: Serialize>(records: impl IntoIterator<Item = T>) -> Result<String> {
    let mut exact = csv::Writer::from_writer(Vec::new());
    for record in records {
        exact.serialize(record)?;
    }
    let text = finished(exact)?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .from_reader(text.as_bytes());
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in reader.records() {
        writer.write_record(row?.iter().map(shortened))?;
    }
    finished(writer)
}

/// A field of a CSV file, [rounded] if it is a number with decimals.
fn shortened(field: &str) -> String {
    match field.parse() {
        Ok(number) if field.contains('.') => shortest(rounded(number)),
        _ => field.to_owned(),
    }
}

/// The number with nine significant digits: more than any result is good for, and half as long as all digits.
pub(crate) fn rounded(number: f64) -> f64 {
    let digits = format!("{number:.8e}");
    digits.parse().expect("a formatted number is a number")
}

/// Any value as indented JSON with a final newline.
pub(crate) fn to_json<T: Serialize>(value: &T) -> Result<String> {
    let text = serde_json::to_string_pretty(value).map_err(Error::json("the value"))?;
    Ok(text + "\n")
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

    #[test]
    fn fields_are_shortened_where_they_are_numbers() {
        for (field, short) in [
            ("0.1234567891234", "0.123456789"),
            ("-98765.432109876e-20", "-9.87654321e-16"),
            ("0.5", "0.5"),
            ("12345678901234", "12345678901234"),
            ("NaN", "NaN"),
            ("r = 0.1234567891234", "r = 0.1234567891234"),
            ("", ""),
        ] {
            assert_eq!(shortened(field), short);
        }
    }

    proptest! {
        #[test]
        fn records_survive_csv_with_nine_digits_and_json_with_all(
            method in proptest::collection::vec(any::<char>(), 0..20),
            time in -1e300..1e300_f64,
            iterations in any::<Option<u32>>(),
        ) {
            let method: String = method.into_iter().collect();
            let records = vec![Record { method, time, iterations }; 2];
            let text = to_csv(&records).unwrap();
            let mut reader = csv::Reader::from_reader(text.as_bytes());
            let read: Vec<Record> = reader.deserialize().map(Result::unwrap).collect();
            let expected = Record { time: rounded(time), ..records[1].clone() };
            prop_assert!((expected.time - time).abs() <= 5e-9 * time.abs());
            prop_assert_eq!(&read[1], &expected);
            let json: Vec<Record> = serde_json::from_str(&to_json(&records).unwrap()).unwrap();
            prop_assert_eq!(&json, &records);
        }

        #[test]
        fn shortest_numbers_read_back_exactly(number in proptest::num::f64::NORMAL) {
            prop_assert_eq!(shortest(number).parse::<f64>().unwrap().to_bits(), number.to_bits());
        }
    }
}
