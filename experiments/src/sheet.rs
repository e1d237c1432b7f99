//! One list of measures for the columns of a table and for the metrics of its rows.

use report::{Cell, Format, Table, Tabulated};

use crate::timing::Numbers;

/// Rows, and what is measured of each: as a column, as a metric, or as both.
#[must_use]
pub struct Sheet<'a, R> {
    rows: &'a [R],
    key: Box<dyn Fn(&'a R, &str) -> String + 'a>,
    pub(crate) table: Tabulated<'a, R>,
    pub(crate) metrics: Vec<(String, Cell)>,
}

impl<'a, R> Sheet<'a, R> {
    pub fn of(rows: &'a [R]) -> Self {
        Self {
            rows,
            key: Box::new(|_, name| name.to_owned()),
            table: Table::of(rows),
            metrics: Vec::new(),
        }
    }

    /// How the metric of a row with a name is called.
    pub fn keyed(mut self, key: impl Fn(&'a R, &str) -> String + 'a) -> Self {
        self.key = Box::new(key);
        self
    }

    pub fn text<S: Into<String>>(mut self, head: &str, value: impl Fn(&'a R) -> S) -> Self {
        self.table = self.table.text(head, value);
        self
    }

    pub fn column<C: Into<Cell>>(
        mut self,
        head: impl Into<String>,
        format: Format,
        value: impl Fn(&'a R) -> C,
    ) -> Self {
        self.table = self.table.number(head, format, value);
        self
    }

    /// A metric; rows where it is missing have none.
    pub fn metric<C: Into<Cell>>(mut self, name: &str, value: impl Fn(&'a R) -> C) -> Self {
        let metric = |row| ((self.key)(row, name), value(row).into());
        self.metrics.extend(self.rows.iter().map(metric));
        self
    }

    /// A metric with a column of the given heading and format.
    pub fn measure<C: Into<Cell>>(
        self,
        name: &str,
        (head, format): (&str, Format),
        value: impl Fn(&'a R) -> C,
    ) -> Self {
        self.metric(name, &value).column(head, format, value)
    }

    /// A column for each of these numbers, given by heading, format and name.
    pub fn columns(
        self,
        columns: &[(&str, Format, &str)],
        of: impl Fn(&'a R) -> &'a Numbers,
    ) -> Self {
        columns.iter().fold(self, |sheet, &(head, format, name)| {
            sheet.column(head, format, |row| of(row).get(name).copied())
        })
    }

    /// A metric for every number, and such columns.
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
}
