//! Small tables, written as CSV for programs and as Markdown for people.

use std::path::PathBuf;

use serde_json::{Map, Value};

use crate::axis::power_of_ten;
use crate::error::{Error, Result};
use crate::output::OutputDir;

/// How Markdown shows the numbers of a column. CSV always carries all digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Text, aligned left.
    Text,
    /// The fewest digits that read back exactly.
    Shortest,
    /// This many decimals.
    Fixed(usize),
    /// One digit before and this many after the point, times a power of ten: `1.25·10⁻³`.
    Scientific(usize),
    /// A fraction as per cent with this many decimals: 0.125 is `12.5 %`.
    Percent(usize),
}

/// Head of a column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name, with its unit or scaling.
    pub name: String,
    /// How numbers are shown.
    pub format: Format,
}

impl Column {
    /// A column of text.
    pub fn text(name: impl Into<String>) -> Self {
        Self::number(name, Format::Text)
    }

    /// A column of numbers.
    pub fn number(name: impl Into<String>, format: Format) -> Self {
        Self {
            name: name.into(),
            format,
        }
    }
}

/// One cell.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Text, whatever the format of the column.
    Text(String),
    /// A whole number, shown as it is whatever the format of the column.
    Integer(i64),
    /// A finite number.
    Number(f64),
    /// Nothing to report: empty in CSV, a dash in Markdown.
    Missing,
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<i64> for Cell {
    fn from(number: i64) -> Self {
        Self::Integer(number)
    }
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

/// A table with typed columns.
///
/// ```
/// use report::{Column, Format, Table};
/// let mut table =
///     Table::new([Column::text("method"), Column::number("error", Format::Scientific(1))]);
/// table.push(["implicit".into(), 1.25e-3.into()])?;
/// assert_eq!(table.to_csv()?, "method,error\nimplicit,0.00125\n");
/// assert!(table.to_markdown().contains("| implicit | 1.3·10⁻³ |"));
/// # Ok::<(), report::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table without rows.
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Self {
            columns: columns.into_iter().collect(),
            rows: Vec::new(),
        }
    }

    /// A table without rows for programs, who want all digits.
    pub fn data<'a>(names: impl IntoIterator<Item = &'a &'a str>) -> Self {
        let column = |name: &&str| Column::number(*name, Format::Shortest);
        Self::new(names.into_iter().map(column))
    }

    /// Starts a table with a row for every record.
    ///
    /// ```
    /// use report::{Format, Table};
    /// let circles = [(0.1, 2_usize), (0.2, 3)];
    /// let table = Table::of(&circles)
    ///     .text("circle", |(radius, _)| format!("R = {radius}"))
    ///     .number("iterations", Format::Shortest, |&(_, count)| count)
    ///     .finish()?;
    /// assert_eq!(table.to_csv()?, "circle,iterations\nR = 0.1,2\nR = 0.2,3\n");
    /// # Ok::<(), report::Error>(())
    /// ```
    pub fn of<R>(records: &[R]) -> Tabulated<'_, R> {
        Tabulated {
            records,
            columns: Vec::new(),
            rows: records.iter().map(|_| Vec::new()).collect(),
        }
    }

    /// Adds a row.
    ///
    /// # Errors
    ///
    /// [`Error::RowLength`], or [`Error::NotFinite`] naming column and row.
    pub fn push(&mut self, cells: impl IntoIterator<Item = Cell>) -> Result<()> {
        let cells: Vec<Cell> = cells.into_iter().collect();
        let row = self.rows.len();
        if cells.len() != self.columns.len() {
            let (expected, found) = (self.columns.len(), cells.len());
            return Err(Error::RowLength {
                row,
                expected,
                found,
            });
        }
        for (cell, column) in cells.iter().zip(&self.columns) {
            match *cell {
                Cell::Number(value) if !value.is_finite() => {
                    let what = format!("column {:?} of table row {row}", column.name);
                    return Err(Error::NotFinite { what, value });
                }
                _ => {}
            }
        }
        self.rows.push(cells);
        Ok(())
    }

    /// The heads of the columns.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The rows.
    pub fn rows(&self) -> &[Vec<Cell>] {
        &self.rows
    }

    /// The table as CSV (RFC 4180 quoting, line feeds), numbers with all their digits.
    ///
    /// # Errors
    ///
    /// [`Error::Csv`] if the table has no columns.
    pub fn to_csv(&self) -> Result<String> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(self.columns.iter().map(|column| column.name.as_str()))?;
        for row in &self.rows {
            writer.write_record(row.iter().map(|cell| match cell {
                Cell::Text(text) => text.clone(),
                Cell::Integer(number) => number.to_string(),
                Cell::Number(number) => crate::data::shortest(*number),
                Cell::Missing => String::new(),
            }))?;
        }
        crate::data::finished(writer)
    }

    /// The table as a JSON array with an object for each row, numbers with all their digits, `null` for what is missing.
    ///
    /// # Errors
    ///
    /// [`Error::Json`] never, for finite numbers.
    pub fn to_json(&self) -> Result<String> {
        let value = |cell: &Cell| match cell {
            Cell::Text(text) => Value::from(text.as_str()),
            Cell::Integer(number) => Value::from(*number),
            Cell::Number(number) => Value::from(*number),
            Cell::Missing => Value::Null,
        };
        let object = |row: &Vec<Cell>| -> Map<String, Value> {
            let names = self.columns.iter().map(|column| column.name.clone());
            names.zip(row.iter().map(value)).collect()
        };
        crate::data::to_json(&self.rows.iter().map(object).collect::<Vec<_>>())
    }

    /// The table as Markdown with padded columns, numbers as their columns say.
    pub fn to_markdown(&self) -> String {
        let heads = self
            .columns
            .iter()
            .map(|column| escaped(&column.name))
            .collect();
        let body = self.rows.iter().map(|row| {
            row.iter()
                .zip(&self.columns)
                .map(|(cell, c)| shown(cell, c.format))
                .collect()
        });
        let lines: Vec<Vec<String>> = std::iter::once(heads).chain(body).collect();
        let widths: Vec<usize> = (0..self.columns.len())
            .map(|k| {
                lines
                    .iter()
                    .map(|line| line[k].chars().count())
                    .fold(3, usize::max)
            })
            .collect();
        let mut text = String::new();
        for (number, line) in lines.iter().enumerate() {
            for ((cell, &width), column) in line.iter().zip(&widths).zip(&self.columns) {
                let padded = if column.format == Format::Text {
                    format!("| {cell:<width$} ")
                } else {
                    format!("| {cell:>width$} ")
                };
                text.push_str(&padded);
            }
            text.push_str("|\n");
            if number == 0 {
                for (&width, column) in widths.iter().zip(&self.columns) {
                    let rule = "-".repeat(width);
                    text.push_str(if column.format == Format::Text {
                        "|:"
                    } else {
                        "|-"
                    });
                    text.push_str(&rule);
                    text.push(if column.format == Format::Text {
                        '-'
                    } else {
                        ':'
                    });
                }
                text.push_str("|\n");
            }
        }
        text
    }

    /// Writes `<stem>.csv` and `<stem>.md`.
    ///
    /// # Errors
    ///
    /// As [`Table::to_csv`], or [`Error::Write`].
    pub fn write(&self, folder: &OutputDir, stem: &str) -> Result<[PathBuf; 2]> {
        Ok([
            folder.write(&format!("{stem}.csv"), self.to_csv()?)?,
            folder.write(&format!("{stem}.md"), self.to_markdown())?,
        ])
    }
}

/// A [table of records](Table::of) that grows column by column.
#[derive(Debug, Clone)]
#[must_use]
pub struct Tabulated<'a, R> {
    records: &'a [R],
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
}

impl<'a, R> Tabulated<'a, R> {
    /// Adds a column of text.
    pub fn text<S: Into<String>>(
        self,
        name: impl Into<String>,
        value: impl Fn(&'a R) -> S,
    ) -> Self {
        self.number(name, Format::Text, |record| {
            Cell::Text(value(record).into())
        })
    }

    /// Adds a column of numbers.
    pub fn number<C: Into<Cell>>(
        mut self,
        name: impl Into<String>,
        format: Format,
        value: impl Fn(&'a R) -> C,
    ) -> Self {
        self.columns.push(Column::number(name, format));
        for (row, record) in self.rows.iter_mut().zip(self.records) {
            row.push(value(record).into());
        }
        self
    }

    /// The finished table.
    ///
    /// # Errors
    ///
    /// As [`Table::push`].
    pub fn finish(self) -> Result<Table> {
        let mut table = Table::new(self.columns);
        self.rows.into_iter().try_for_each(|row| table.push(row))?;
        Ok(table)
    }
}

/// Keeps text from ending its cell or its row.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\")
        .replace('|', "\\|")
        .replace(['\n', '\r'], " ")
}

fn shown(cell: &Cell, format: Format) -> String {
    match cell {
        Cell::Text(text) => escaped(text),
        Cell::Integer(number) => number.to_string(),
        Cell::Missing => "–".to_owned(),
        Cell::Number(number) => match format {
            Format::Text | Format::Shortest => crate::data::shortest(*number),
            Format::Fixed(decimals) => format!("{number:.decimals$}"),
            Format::Scientific(decimals) => scientific(*number, decimals),
            Format::Percent(decimals) => format!("{:.decimals$} %", 100.0 * number),
        },
    }
}

/// `1.25·10⁻³`; plain where the power is 10⁰.
fn scientific(number: f64, decimals: usize) -> String {
    let text = format!("{number:.decimals$e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => match exponent.parse() {
            Ok(0) | Err(_) => mantissa.to_owned(),
            Ok(exponent) => format!("{mantissa}·{}", power_of_ten(exponent)),
        },
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Table {
        let mut table = Table::new([
            Column::text("method"),
            Column::number("N", Format::Shortest),
            Column::number("error", Format::Scientific(2)),
            Column::number("share", Format::Percent(1)),
        ]);
        let number = 1.0 / 3.0;
        table
            .push([
                "a|b, \"c\"".into(),
                128_usize.into(),
                1.2345e-6.into(),
                number.into(),
            ])
            .unwrap();
        table
            .push([
                "plain".into(),
                64_usize.into(),
                None::<f64>.into(),
                1.0.into(),
            ])
            .unwrap();
        table
    }

    #[test]
    fn csv_quotes_and_keeps_every_digit() {
        let text = example().to_csv().unwrap();
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        assert_eq!(reader.headers().unwrap().iter().next_back(), Some("share"));
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(&rows[0][0], "a|b, \"c\"");
        assert_eq!(
            rows[0][3].parse::<f64>().unwrap().to_bits(),
            (1.0_f64 / 3.0).to_bits()
        );
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
        assert!(
            lines[2].contains("a\\|b") && lines[2].contains("1.23·10⁻⁶"),
            "{text}"
        );
        assert!(
            lines[2].contains("33.3 %") && lines[3].contains(" – "),
            "{text}"
        );
        let widths: Vec<usize> = lines.iter().map(|line| line.chars().count()).collect();
        assert!(widths.iter().all(|&w| w == widths[0]), "{text}");
    }

    #[test]
    fn bad_rows_are_refused_with_their_place() {
        let mut table = example();
        let error = table.push(["x".into()]).unwrap_err();
        assert!(matches!(
            error,
            Error::RowLength {
                row: 2,
                expected: 4,
                found: 1
            }
        ));
        let error = table
            .push(["x".into(), Cell::Missing, f64::NAN.into(), Cell::Missing])
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("\"error\"") && error.contains("row 2"),
            "{error}"
        );
        assert_eq!(table.rows().len(), 2);
    }
}
