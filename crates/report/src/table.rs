//! Small tables, written as CSV for programs and as Markdown for people.

use derive_more::From;

use crate::axis::power_of_ten;
use crate::error::Result;
use crate::output::OutputDir;

/// How Markdown shows the numbers of a column. CSV carries nine significant digits of all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// The fewest digits that read back exactly.
    Shortest,
    /// This many decimals.
    Fixed(usize),
    /// One digit before and this many after the point, times a power of ten: `1.25·10⁻³`.
    Scientific(usize),
}

/// What a row has in a column.
#[derive(Debug, Clone, PartialEq, From)]
pub enum Cell {
    /// Text, whatever the format of the column.
    #[from(String, &str)]
    Text(String),
    /// A whole number, shown as it is whatever the format of the column.
    Integer(i64),
    /// A finite number.
    #[from]
    Number(f64),
    /// Nothing to report: empty in CSV, a dash in Markdown.
    Missing,
}

impl From<usize> for Cell {
    fn from(number: usize) -> Self {
        i64::try_from(number).map_or(Self::Number(number as f64), Self::Integer)
    }
}

impl<C: Into<Cell>> From<Option<C>> for Cell {
    fn from(cell: Option<C>) -> Self {
        cell.map_or(Self::Missing, Into::into)
    }
}

impl Cell {
    /// As CSV has it.
    fn raw(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Integer(number) => number.to_string(),
            Self::Number(number) => shortest(rounded(*number)),
            Self::Missing => String::new(),
        }
    }

    /// As Markdown has it.
    fn shown(&self, format: Option<Format>) -> String {
        match (self, format) {
            (Self::Missing, _) => "–".to_owned(),
            (Self::Number(number), Some(Format::Fixed(decimals))) => {
                let text = format!("{number:.decimals$}");
                // Without the sign of what is zero to these digits.
                match text.strip_prefix('-') {
                    Some(zero) if zero.parse() == Ok(0.0) => zero.to_owned(),
                    _ => text,
                }
            }
            (Self::Number(number), Some(Format::Scientific(decimals))) => {
                scientific(*number, decimals)
            }
            (Self::Number(number), _) => shortest(*number),
            _ => escaped(&self.raw()),
        }
    }
}

/// Name of a column with its unit or scaling, and how its numbers are shown; without a format it is text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) format: Option<Format>,
}

/// A table with typed columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    pub(crate) columns: Vec<Column>,
    pub(crate) rows: Vec<Vec<Cell>>,
}

impl Table {
    /// The table as CSV (RFC 4180 quoting, line feeds), numbers with nine significant digits.
    pub fn to_csv(&self) -> String {
        let head = self.columns.iter().map(|column| &column.name);
        let mut rows = self.rows.iter().map(|row| row.iter().map(Cell::raw));
        let mut writer = csv::Writer::from_writer(Vec::new());
        let head = writer.write_record(head);
        let written = head.and_then(|()| rows.try_for_each(|row| writer.write_record(row)));
        written.expect("every row has a cell for every column");
        let bytes = writer.into_inner().expect("memory takes all bytes");
        String::from_utf8(bytes).expect("all cells are text")
    }

    /// The table as Markdown with padded columns, numbers as their columns say.
    pub fn to_markdown(&self) -> String {
        // Every column with a rule below its name, all padded to its width.
        let column = |(k, column): (usize, &Column)| -> Vec<String> {
            let cells = self.rows.iter().map(|row| row[k].shown(column.format));
            let cells: Vec<String> = [escaped(&column.name)].into_iter().chain(cells).collect();
            let lengths = cells.iter().map(|cell| cell.chars().count());
            let width = lengths.fold(3, usize::max);
            let padded = |cell: &String| match column.format {
                None => format!(" {cell:<width$} "),
                Some(_) => format!(" {cell:>width$} "),
            };
            let rule = match column.format {
                None => format!(":{}-", "-".repeat(width)),
                Some(_) => format!("-{}:", "-".repeat(width)),
            };
            let mut lines: Vec<String> = cells.iter().map(padded).collect();
            lines.insert(1, rule);
            lines
        };
        let columns: Vec<_> = self.columns.iter().enumerate().map(column).collect();
        let line = |number: usize| -> String {
            let cells = columns.iter().map(|cells| format!("|{}", cells[number]));
            cells.collect::<String>() + "|\n"
        };
        (0..self.rows.len() + 2).map(line).collect()
    }

    /// Writes `<stem>.csv` and `<stem>.md`.
    pub fn write(&self, folder: &OutputDir, stem: &str) -> Result<()> {
        folder.write(&format!("{stem}.csv"), self.to_csv())?;
        folder.write(&format!("{stem}.md"), self.to_markdown())?;
        Ok(())
    }
}

/// The number with nine significant digits: more than any result is good for, and half as long as all digits.
fn rounded(number: f64) -> f64 {
    let digits = format!("{number:.8e}");
    digits.parse().expect("a formatted number is a number")
}

/// The fewest digits that read back exactly, with an exponent where that is shorter to read.
fn shortest(number: f64) -> String {
    let size = number.abs();
    if size == 0.0 || (1e-7..1e16).contains(&size) {
        format!("{number}")
    } else {
        format!("{number:e}")
    }
}

/// Keeps text from ending its cell or its row.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\")
        .replace('|', "\\|")
        .replace(['\n', '\r'], " ")
}

/// `1.25·10⁻³`; plain where the power is 10⁰.
fn scientific(number: f64, decimals: usize) -> String {
    let text = format!("{number:.decimals$e}");
    match text.split_once('e') {
        Some((mantissa, "0")) => mantissa.to_owned(),
        Some((mantissa, power)) => {
            let power = power.parse().expect("the exponent is an integer");
            format!("{mantissa}·{}", power_of_ten(power))
        }
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sheet;
    use proptest::prelude::*;

    fn example() -> Table {
        let rows = [
            ("a|b, \"c\"", 128_usize, Some(1.2345e-6), 1.0 / 3.0),
            ("plain", 64, None, 1.0),
        ];
        let sheet = Sheet::of(&rows)
            .text("method", |row| row.0)
            .column("N", Format::Shortest, |row| row.1)
            .column("error", Format::Scientific(2), |row| row.2)
            .column("share", Format::Fixed(3), |row| row.3);
        sheet.finish().unwrap().0
    }

    #[test]
    fn csv_quotes_and_keeps_nine_digits() {
        let text = example().to_csv();
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        assert_eq!(reader.headers().unwrap().iter().next_back(), Some("share"));
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(&rows[0][0], "a|b, \"c\"");
        assert_eq!(&rows[0][3], "0.333333333");
        assert_eq!(&rows[1][2], "");
        assert!(
            text.contains("\"a|b, \"\"c\"\"\",128,0.0000012345,"),
            "{text}"
        );
    }

    #[test]
    fn markdown_formats_and_aligns() {
        let text = example().to_markdown();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4);
        assert!(
            lines[1].starts_with("|:-") && lines[1].ends_with("-:|"),
            "{text}"
        );
        for (line, part) in [(2, "a\\|b"), (2, "1.23·10⁻⁶"), (2, "0.333"), (3, " – ")] {
            assert!(lines[line].contains(part), "{part}: {text}");
        }
        let widths: Vec<usize> = lines.iter().map(|line| line.chars().count()).collect();
        assert!(widths.iter().all(|&w| w == widths[0]), "{text}");
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused_with_their_place() {
        let rows = [0.5, f64::NAN];
        let sheet = Sheet::of(&rows).column("error", Format::Shortest, |row| *row);
        let error = sheet.finish().unwrap_err().to_string();
        assert!(
            error.contains("\"error\"") && error.contains("row 1"),
            "{error}"
        );
    }

    proptest! {
        #[test]
        fn numbers_read_back_exactly_or_to_nine_digits(number in proptest::num::f64::NORMAL) {
            prop_assert_eq!(shortest(number).parse::<f64>().unwrap().to_bits(), number.to_bits());
            let rounded = rounded(number);
            prop_assert!((rounded - number).abs() <= 5e-9 * number.abs());
        }
    }
}
