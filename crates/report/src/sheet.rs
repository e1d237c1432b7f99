//! One list of measures for the columns of a table and for the metrics of its rows.

use std::collections::BTreeMap;

use crate::error::{Error, Result};
use crate::table::{Cell, Column, Format, Table};

/// Numbers by the names of their metrics; what is not known is absent.
pub type Numbers = BTreeMap<&'static str, f64>;

/// Records, and what is measured of each: as a column, as a metric, or as both.
///
/// ```
/// use report::{Format::Shortest, Sheet};
/// let circles = [(1, 2_usize), (2, 3)];
/// let sheet = Sheet::of(&circles)
///     .keyed(|(radius, _), name| format!("circle{radius}.{name}"))
///     .text("circle", |(radius, _)| format!("R = {radius}"))
///     .measure("newton", "iterations", Shortest, |&(_, count)| count);
/// let (table, metrics) = sheet.finish()?;
/// assert_eq!(table.to_csv(), "circle,iterations\nR = 1,2\nR = 2,3\n");
/// assert_eq!(metrics[1], ("circle2.newton".to_owned(), 3_usize.into()));
/// # Ok::<(), report::Error>(())
/// ```
#[must_use]
pub struct Sheet<'a, R> {
    rows: &'a [R],
    key: Box<dyn Fn(&'a R, &str) -> String + 'a>,
    table: Table,
    metrics: Vec<(String, Cell)>,
}

impl<'a, R> Sheet<'a, R> {
    /// A row for every record, and no columns yet.
    pub fn of(rows: &'a [R]) -> Self {
        let table = Table {
            columns: Vec::new(),
            rows: vec![Vec::new(); rows.len()],
        };
        Self {
            rows,
            key: Box::new(|_, name| name.to_owned()),
            table,
            metrics: Vec::new(),
        }
    }

    /// How the metric of a row with a name is called.
    pub fn keyed(mut self, key: impl Fn(&'a R, &str) -> String + 'a) -> Self {
        self.key = Box::new(key);
        self
    }

    /// Adds a column of text.
    pub fn text<S: Into<String>>(self, head: &str, value: impl Fn(&'a R) -> S) -> Self {
        self.with_column(head.into(), None, |row| Cell::Text(value(row).into()))
    }

    /// Adds a column of numbers.
    pub fn column<C: Into<Cell>>(
        self,
        head: impl Into<String>,
        format: Format,
        value: impl Fn(&'a R) -> C,
    ) -> Self {
        self.with_column(head.into(), Some(format), |row| value(row).into())
    }

    /// Adds a column for programs: text, or numbers with as many digits as they have, up to nine.
    pub fn data<C: Into<Cell>>(self, head: &str, value: impl Fn(&'a R) -> C) -> Self {
        self.column(head, Format::Shortest, value)
    }

    fn with_column(
        mut self,
        name: String,
        format: Option<Format>,
        cell: impl Fn(&'a R) -> Cell,
    ) -> Self {
        self.table.columns.push(Column { name, format });
        for (cells, row) in self.table.rows.iter_mut().zip(self.rows) {
            cells.push(cell(row));
        }
        self
    }

    /// Adds a metric; rows where it is missing have none.
    pub fn metric<C: Into<Cell>>(mut self, name: &str, value: impl Fn(&'a R) -> C) -> Self {
        let metric = |row| ((self.key)(row, name), value(row).into());
        self.metrics.extend(self.rows.iter().map(metric));
        self
    }

    /// Adds a metric with a column of the given heading and format.
    pub fn measure<C: Into<Cell>>(
        self,
        name: &str,
        head: &str,
        format: Format,
        value: impl Fn(&'a R) -> C,
    ) -> Self {
        let mut sheet = self.column(head, format, value);
        let rows = sheet.rows.iter().zip(&sheet.table.rows);
        let metric = |(row, cells): (&'a R, &Vec<Cell>)| {
            Some(((sheet.key)(row, name), cells.last()?.clone()))
        };
        sheet.metrics.extend(rows.filter_map(metric));
        sheet
    }

    /// Adds a column for each of these numbers, given by heading, format and name.
    pub fn columns(
        self,
        columns: &[(&str, Format, &str)],
        of: impl Fn(&'a R) -> &'a Numbers,
    ) -> Self {
        columns.iter().fold(self, |sheet, &(head, format, name)| {
            sheet.column(head, format, |row| of(row).get(name).copied())
        })
    }

    /// Adds a metric for every number, and such columns.
    pub fn numbers(
        mut self,
        columns: &[(&str, Format, &str)],
        of: impl Fn(&'a R) -> &'a Numbers,
    ) -> Self {
        for row in self.rows {
            let metric = |(name, value): (&&str, &f64)| ((self.key)(row, name), (*value).into());
            self.metrics.extend(of(row).iter().map(metric));
        }
        self.columns(columns, of)
    }

    /// The table, whose numbers must be finite, and the metrics with their names.
    pub fn finish(self) -> Result<(Table, Vec<(String, Cell)>)> {
        for (k, row) in self.table.rows.iter().enumerate() {
            for (cell, column) in row.iter().zip(&self.table.columns) {
                if let Cell::Number(value) = *cell
                    && !value.is_finite()
                {
                    let what = format!("column {:?} of table row {k}", column.name);
                    return Err(Error::NotFinite { what, value });
                }
            }
        }
        Ok((self.table, self.metrics))
    }
}
