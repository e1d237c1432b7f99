//! Tables from rows, CSV or Markdown.

use maud::{Markup, Render, html};
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};

use crate::error::{Error, Result};
use crate::text::{inline, unbroken};

/// A table of text, its columns of numbers aligned right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TableElement {
    pub(crate) caption: String,
    head: Vec<String>,
    rows: Vec<Vec<String>>,
    /// Whether the cells are Markdown.
    marked: bool,
}

impl TableElement {
    /// A table from its parts: a column or more, and rows of as many cells.
    pub fn new(
        caption: impl Into<String>,
        head: impl IntoIterator<Item = impl Into<String>>,
        rows: impl IntoIterator<Item = impl IntoIterator<Item = impl Into<String>>>,
    ) -> Result<Self> {
        let (name, head) = (caption.into(), words(head));
        let rows: Vec<Vec<String>> = rows.into_iter().map(words).collect();
        let other = rows.iter().position(|row| row.len() != head.len());
        let problem = match other {
            _ if head.is_empty() => "it has no columns".to_owned(),
            Some(row) => {
                let (found, expected) = (rows[row].len(), head.len());
                format!("row {row} has {found} cells where there are {expected} columns")
            }
            None => {
                return Ok(Self {
                    caption: name,
                    head,
                    rows,
                    marked: false,
                });
            }
        };
        Err(Error::Table { name, problem })
    }

    /// A table from CSV with a head.
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

    /// The first table of a Markdown text, which must have one, such as `report::Table::to_markdown` writes.
    pub fn from_markdown(caption: impl Into<String>, markdown: &str) -> Result<Self> {
        let mut rows: Vec<Vec<String>> = Vec::new();
        for (event, range) in Parser::new_ext(markdown, Options::ENABLE_TABLES).into_offset_iter() {
            match event {
                Event::Start(Tag::TableHead | Tag::TableRow) => rows.push(Vec::new()),
                Event::Start(Tag::TableCell) => {
                    if let Some(row) = rows.last_mut() {
                        row.push(markdown[range].trim().to_owned());
                    }
                }
                Event::End(TagEnd::Table) => break,
                _ => {}
            }
        }
        if rows.is_empty() {
            return Err(Error::Table {
                name: caption.into(),
                problem: "it has no line such as |---|---| below a line of heads".to_owned(),
            });
        }
        let head = rows.remove(0);
        let mut table = Self::new(caption, head, rows)?;
        table.marked = true;
        Ok(table)
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

    fn cell(&self, text: &str) -> Markup {
        if self.marked {
            inline(text)
        } else {
            html! { (unbroken(text)) }
        }
    }
}

impl Render for TableElement {
    fn render(&self) -> Markup {
        let numeric: Vec<bool> = (0..self.head.len()).map(|k| self.is_numeric(k)).collect();
        // Wide tables scroll, also by keyboard.
        html! {
            div.scroll tabindex="0" role="region" aria-label=(self.caption) {
                table {
                    caption { (self.caption) }
                    thead {
                        tr {
                            @for (name, numeric) in self.head.iter().zip(&numeric) {
                                th scope="col" class=[head_class(name, *numeric)] { (self.cell(name)) }
                            }
                        }
                    }
                    tbody {
                        @for row in &self.rows {
                            tr {
                                @for (cell, numeric) in row.iter().zip(&numeric) {
                                    td class=[numeric.then_some("n")] { (self.cell(cell)) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn words(cells: impl IntoIterator<Item = impl Into<String>>) -> Vec<String> {
    cells.into_iter().map(Into::into).collect()
}

/// Numbers stand on the right, and short heads on one line: a minus sign must not end a line.
fn head_class(head: &str, numeric: bool) -> Option<&'static str> {
    match (numeric, head.chars().count() <= 14) {
        (true, true) => Some("n s"),
        (true, false) => Some("n"),
        (false, true) => Some("s"),
        (false, false) => None,
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markdown_and_csv_give_the_same_table() {
        let markdown =
            "Intro.\n\n| method | \\|F\\| \\\\ |\n|:--|--:|\n| a | 1.5 |\n| b | – |\n\nEnd";
        let table = TableElement::from_markdown("t", markdown).unwrap();
        let csv = TableElement::from_csv("t", "method,|F| \\\na,1.5\nb,–\n").unwrap();
        assert_eq!(table.render().0, csv.render().0);
        assert_eq!(table.rows(), [["a", "1.5"], ["b", "–"]]);
        assert_eq!(csv.head(), ["method", "|F| \\"]);
        for table in [
            TableElement::from_csv("t", "seconds of all steps at n = 128\n1\n"),
            TableElement::from_markdown("t", "| seconds of all steps at n = 128 |\n|---|\n| 1 |\n"),
        ] {
            let html = table.unwrap().render().0;
            assert!(html.contains("n\u{a0}=\u{a0}128"), "{html}");
        }
        let linked = "| a |\n|---|\n| [b](c.png) `d` |\n";
        let html = TableElement::from_markdown("t", linked).unwrap().render().0;
        assert!(html.contains("<td>b <code>d</code></td>"), "{html}");
    }

    #[test]
    fn numbers_are_told_from_text() {
        for cell in ["1", "-0.5", "1e-3", "7.63·10⁻⁸", "12.5 %", "\u{2212}3"] {
            assert!(is_number(cell), "{cell}");
        }
        for cell in ["x", "1 2", "nan", "2·10x", "256x256", "·10⁻⁸"] {
            assert!(!is_number(cell), "{cell}");
        }
        let table = TableElement::from_csv("t", "a,b,c\nx,1,z\ny,–,3\n").unwrap();
        let numeric: Vec<bool> = (0..3).map(|k| table.is_numeric(k)).collect();
        assert_eq!(numeric, [false, true, false]);
        let html = table.render().0;
        let count = |part: &str| html.matches(part).count();
        assert_eq!((count("<td class=\"n\">"), count("<td>")), (2, 4));
        assert_eq!(
            (count("<th scope=\"col\" class=\"n s\">"), count("<th ")),
            (1, 3)
        );
    }

    #[test]
    fn what_is_no_table_is_named() {
        let message = |result: Result<TableElement>| result.unwrap_err().to_string();
        let text = message(TableElement::from_markdown("notes.md", "no table | here"));
        assert!(
            text.contains("notes.md") && text.contains("|---|"),
            "{text}"
        );
        let text = message(TableElement::from_csv("uneven.csv", "a,b\n1\n"));
        assert!(
            text.contains("uneven.csv") && text.contains("row 0") && text.contains("1 cells"),
            "{text}"
        );
        let text = message(TableElement::from_csv("empty.csv", ""));
        assert!(text.contains("empty.csv"), "{text}");
    }
}
