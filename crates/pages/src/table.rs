//! Tables from rows, CSV or Markdown.

use std::fmt::Write;

use crate::error::{Error, Result};
use crate::escape::escaped;

/// A table of text, its columns of numbers aligned right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    caption: String,
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table from its parts.
    ///
    /// # Errors
    /// [`Error::RowLength`]; [`Error::Table`] without columns.
    pub fn new(
        caption: impl Into<String>,
        head: impl IntoIterator<Item = impl Into<String>>,
        rows: impl IntoIterator<Item = impl IntoIterator<Item = impl Into<String>>>,
    ) -> Result<Self> {
        let (caption, head) = (caption.into(), words(head));
        if head.is_empty() {
            return Err(Error::Table {
                name: caption,
                problem: "it has no columns".to_owned(),
            });
        }
        let rows: Vec<Vec<String>> = rows.into_iter().map(words).collect();
        if let Some(row) = rows.iter().position(|row| row.len() != head.len()) {
            return Err(Error::RowLength {
                name: caption,
                row,
                expected: head.len(),
                found: rows[row].len(),
            });
        }
        Ok(Self {
            caption,
            head,
            rows,
        })
    }

    /// A table from CSV with a head.
    ///
    /// # Errors
    /// [`Error::Table`] if it cannot be read; as [`Table::new`].
    pub fn from_csv(caption: impl Into<String>, csv: &str) -> Result<Self> {
        let caption = caption.into();
        let failed = |error: csv::Error| Error::Table {
            name: caption.clone(),
            problem: error.to_string(),
        };
        // Rows of other lengths are reported by `new`.
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .from_reader(csv.as_bytes());
        let head = words(reader.headers().map_err(failed)?);
        let rows = reader
            .records()
            .map(|record| record.map(|record| words(&record)))
            .collect::<Result<Vec<_>, _>>()
            .map_err(failed)?;
        Self::new(caption, head, rows)
    }

    /// The first table of a Markdown text, such as `report::Table::to_markdown` writes.
    ///
    /// # Errors
    /// [`Error::Table`] without one; as [`Table::new`].
    pub fn from_markdown(caption: impl Into<String>, markdown: &str) -> Result<Self> {
        let caption = caption.into();
        let lines: Vec<&str> = markdown.lines().map(str::trim).collect();
        let rule = lines.iter().position(|line| is_rule(line));
        let Some(rule) = rule.filter(|&line| line > 0 && lines[line - 1].starts_with('|')) else {
            return Err(Error::Table {
                name: caption,
                problem: "it has no line such as |---|---| below a line of heads".to_owned(),
            });
        };
        let rows = lines[rule + 1..]
            .iter()
            .take_while(|line| line.starts_with('|'))
            .map(|line| cells(line));
        Self::new(caption, cells(lines[rule - 1]), rows)
    }

    /// Its caption.
    pub fn caption(&self) -> &str {
        &self.caption
    }

    /// Names of the columns.
    pub fn head(&self) -> &[String] {
        &self.head
    }

    /// Its rows.
    pub fn rows(&self) -> &[Vec<String>] {
        &self.rows
    }

    /// Whether a column has numbers, if anything.
    fn is_numeric(&self, column: usize) -> bool {
        let mut cells = self.rows.iter().map(|row| row[column].as_str());
        cells.all(|cell| is_missing(cell) || is_number(cell))
    }

    pub(crate) fn html(&self) -> String {
        let numeric: Vec<bool> = (0..self.head.len()).map(|k| self.is_numeric(k)).collect();
        let class = |k: usize| if numeric[k] { " class=\"n\"" } else { "" };
        let head_class = |k: usize| match (numeric[k], is_short(&self.head[k])) {
            (true, true) => " class=\"n s\"",
            (false, true) => " class=\"s\"",
            (_, false) => class(k),
        };
        let caption = escaped(&self.caption);
        // Wide tables scroll, also by keyboard.
        let mut html = format!(
            "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{caption}\">\
             <table>\n<caption>{caption}</caption>\n<thead><tr>"
        );
        for (k, name) in self.head.iter().enumerate() {
            let _ = write!(
                html,
                "<th scope=\"col\"{}>{}</th>",
                head_class(k),
                escaped(name)
            );
        }
        html.push_str("</tr></thead>\n<tbody>\n");
        for row in &self.rows {
            html.push_str("<tr>");
            for (k, cell) in row.iter().enumerate() {
                let _ = write!(html, "<td{}>{}</td>", class(k), escaped(cell));
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</tbody></table></div>\n");
        html
    }
}

fn words(cells: impl IntoIterator<Item = impl Into<String>>) -> Vec<String> {
    cells.into_iter().map(Into::into).collect()
}

/// Heads that look better on one line; a minus sign must not end a line, for example.
fn is_short(head: &str) -> bool {
    head.chars().count() <= 14
}

fn is_missing(cell: &str) -> bool {
    matches!(cell.trim(), "" | "-" | "–" | "—")
}

/// Decimal numbers, per cent, and powers of ten as in `7.6·10⁻⁸`.
fn is_number(cell: &str) -> bool {
    let cell = cell.trim();
    let cell = cell.strip_suffix('%').map_or(cell, str::trim_end);
    let mantissa = match cell.split_once("·10") {
        Some((mantissa, exponent)) if exponent.chars().all(|c| "⁻⁰¹²³⁴⁵⁶⁷⁸⁹".contains(c)) => {
            mantissa
        }
        Some(_) => return false,
        None => cell,
    };
    mantissa
        .replace('\u{2212}', "-")
        .parse::<f64>()
        .is_ok_and(f64::is_finite)
}

/// Whether a line of Markdown separates the heads of a table from its rows.
fn is_rule(line: &str) -> bool {
    line.starts_with('|') && line.contains('-') && line.chars().all(|c| "|:- ".contains(c))
}

/// The cells of a line of a Markdown table; `\|` and `\\` stand for themselves.
fn cells(line: &str) -> Vec<String> {
    let line = line.strip_prefix('|').unwrap_or(line);
    let (mut cells, mut cell) = (Vec::new(), String::new());
    let mut characters = line.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '\\' if matches!(characters.peek(), Some('|' | '\\')) => cell.extend(characters.next()),
            '|' => cells.push(std::mem::take(&mut cell)),
            _ => cell.push(character),
        }
    }
    if !cell.trim().is_empty() {
        cells.push(cell);
    }
    cells.iter().map(|cell| cell.trim().to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markdown_and_csv_give_the_same_table() {
        let markdown =
            "Intro.\n\n| method | \\|F\\| \\\\ |\n|:--|--:|\n| a | 1.5 |\n| b | – |\n\nEnd";
        let table = Table::from_markdown("t", markdown).unwrap();
        let csv = Table::from_csv("t", "method,|F| \\\na,1.5\nb,–\n").unwrap();
        assert_eq!(table, csv);
        assert_eq!(table.head(), ["method", "|F| \\"]);
        assert_eq!(table.rows(), [["a", "1.5"], ["b", "–"]]);
    }

    #[test]
    fn numbers_are_told_from_text() {
        for cell in ["1", "-0.5", "1e-3", "7.63·10⁻⁸", "12.5 %", "\u{2212}3"] {
            assert!(is_number(cell), "{cell}");
        }
        for cell in ["x", "1 2", "nan", "2·10x", "256x256", "·10⁻⁸"] {
            assert!(!is_number(cell), "{cell}");
        }
        let table = Table::from_csv("t", "a,b,c\nx,1,z\ny,–,3\n").unwrap();
        let numeric: Vec<bool> = (0..3).map(|k| table.is_numeric(k)).collect();
        assert_eq!(numeric, [false, true, false]);
        let html = table.html();
        let count = |part: &str| html.matches(part).count();
        assert_eq!((count("<td class=\"n\">"), count("<td>")), (2, 4));
        assert_eq!(
            (count("<th scope=\"col\" class=\"n s\">"), count("<th ")),
            (1, 3)
        );
    }

    #[test]
    fn what_is_no_table_is_named() {
        let message = |result: Result<Table>| result.unwrap_err().to_string();
        let text = message(Table::from_markdown("notes.md", "no table | here"));
        assert!(
            text.contains("notes.md") && text.contains("|---|"),
            "{text}"
        );
        let text = message(Table::from_csv("uneven.csv", "a,b\n1\n"));
        assert!(
            text.contains("uneven.csv") && text.contains("row 0") && text.contains("1 cells"),
            "{text}"
        );
        let text = message(Table::from_csv("empty.csv", ""));
        assert!(text.contains("empty.csv"), "{text}");
    }
}
