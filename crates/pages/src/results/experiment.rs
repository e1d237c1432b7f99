//! One folder of results as a section.

use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::facts::{Facts, natural};
use crate::frames::Frames;
use crate::image::{Image, Pictures};
use crate::results::catalogue::{self, Entry};
use crate::results::readme::States;
use crate::results::{Problem, manifest};
use crate::section::{Block, Details, Figure, Section};
use crate::table::Table;
use crate::text::Text;

/// Longer tables are folded away.
const LONGEST_OPEN_TABLE: usize = 24;
/// Longer CSV files are data and no tables to read.
const LONGEST_CSV: usize = 60;
/// Larger CSV files are not even looked at.
const LARGEST_CSV: u64 = 64 * 1024;

/// A folder of results.
pub(crate) struct Experiment<'a> {
    /// Where the page lies.
    root: &'a Path,
    /// The folder below that, empty if it is the same.
    name: &'a str,
    pictures: Pictures,
}

impl<'a> Experiment<'a> {
    pub fn new(root: &'a Path, name: &'a str, pictures: Pictures) -> Self {
        Self {
            root,
            name,
            pictures,
        }
    }

    /// The section; what is missing or broken is added to `problems`.
    pub fn section(&self, states: &States, problems: &mut Vec<Problem>) -> Section {
        let files = match self.files() {
            Ok(files) => files,
            Err(error) => {
                problems.push(Problem::because(self.name, &error));
                Vec::new()
            }
        };
        let facts = self.facts("manifest.json", manifest::facts, problems);
        let key = facts
            .as_ref()
            .filter(|_| self.name.is_empty())
            .and_then(|facts| facts.entries().first())
            .map_or(self.name, |(_, experiment)| experiment.as_str());
        let entry = catalogue::entry(key);
        let title = entry.map_or_else(|| spelled_out(key), |entry| entry.title.to_owned());
        let mut section = Section::new(title).named(key);
        if let Some(entry) = entry {
            section.push(entry.description);
        }
        if let Some(states) = states.get(self.name) {
            let item = |(what, state): &(String, String)| {
                Text::from(format!("In the paper: {what}. Here: {state}."))
            };
            section.push(states.iter().map(item).collect::<Vec<_>>());
        }
        for block in self.figures(&files, entry, problems) {
            section.push(block);
        }
        for block in self.tables(&files, problems) {
            section.push(block);
        }
        if let Some(summary) = self.facts("summary.json", Facts::from_summary, problems) {
            let mut details = Details::new("Metrics");
            if self.pictures == Pictures::Linked {
                let note = Text::from("Five digits of each; all of them, for programs, are in ");
                details = self.with_link(details, note, "summary.json");
            }
            section.push(details.with(summary));
        }
        if let Some(facts) = facts {
            section.push(Details::new("How it was computed").with(facts));
        }
        if self.pictures == Pictures::Linked {
            let mut details = Details::new("Files");
            let mut list = Text::default();
            for (k, file) in files.iter().enumerate() {
                let separator = if k == 0 { "" } else { ", " };
                let link = Text::default().link(file, &self.path(file));
                list = list
                    .then(separator)
                    .appended(&link.unwrap_or_else(|_| file.as_str().into()));
            }
            details = details.with(list);
            section.push(details);
        }
        section
    }

    /// Names of the plain files, in natural order.
    fn files(&self) -> Result<Vec<String>> {
        let folder = self.root.join(self.name);
        let failed = |source| Error::Read {
            path: folder.clone(),
            source,
        };
        let mut names = Vec::new();
        for entry in fs::read_dir(&folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            if let Some(name) = entry.file_name().to_str().filter(|n| !n.starts_with('.'))
                && entry.path().is_file()
            {
                names.push(name.to_owned());
            }
        }
        names.sort_by(|a, b| natural(a, b));
        Ok(names)
    }

    /// A file relative to the page.
    fn path(&self, file: &str) -> String {
        if self.name.is_empty() {
            file.to_owned()
        } else {
            format!("{}/{file}", self.name)
        }
    }

    fn read(&self, file: &str) -> Result<String> {
        let path: PathBuf = self.root.join(self.path(file));
        fs::read_to_string(&path).map_err(|source| Error::Read { path, source })
    }

    fn with_link(&self, details: Details, text: Text, file: &str) -> Details {
        match text.link(file, &self.path(file)) {
            Ok(text) => details.with(text.then(".")),
            Err(_) => details,
        }
    }

    fn facts(
        &self,
        file: &str,
        parse: impl FnOnce(&str, &str) -> Result<Facts>,
        problems: &mut Vec<Problem>,
    ) -> Option<Facts> {
        let facts = self
            .read(file)
            .and_then(|json| parse(&self.path(file), &json));
        kept(facts, &self.path(file), problems)
    }

    /// Figures of the catalogue, then others, then sequences.
    fn figures(
        &self,
        files: &[String],
        entry: Option<&Entry>,
        problems: &mut Vec<Problem>,
    ) -> Vec<Block> {
        let has = |file: &str| files.iter().any(|f| f == file);
        let (mut single, mut sequences) = pictures(files);
        let mut ordered: Vec<(String, String)> = Vec::new();
        for (stem, caption) in entry.map_or(&[][..], |entry| entry.figures) {
            if let Some(k) = single.iter().position(|file| stem_of(file) == *stem) {
                ordered.push((single.remove(k), (*caption).to_owned()));
            } else {
                problems.push(Problem::missing(self.path(&format!("{stem}.png"))));
            }
        }
        ordered.extend(single.into_iter().map(|file| {
            let caption = format!("{}.", spelled_out(stem_of(&file)));
            (file, caption)
        }));
        let mut blocks: Vec<Block> = Vec::new();
        for (file, caption) in ordered {
            let path = self.path(&file);
            let image = Image::beside(self.root, &path, self.pictures);
            let Some(image) = kept(image, &path, problems) else {
                continue;
            };
            let mut figure = Figure::new(image, &caption);
            let drawing = format!("{}.svg", stem_of(&file));
            if self.pictures == Pictures::Linked && drawing != file && has(&drawing) {
                // The drawing is not shown, but must not be broken either.
                let path = self.path(&drawing);
                let intact = Image::beside(self.root, &path, self.pictures);
                let link = intact.and_then(|_| Text::from(" ").link("SVG", &path));
                if let Some(link) = kept(link, &path, problems) {
                    figure = figure.with_note(&link);
                }
            }
            blocks.push(figure.into());
        }
        sequences.sort_by(|a, b| natural(&a.0, &b.0));
        for (name, files) in sequences {
            let frames: Vec<(String, Image)> = files
                .iter()
                .filter_map(|file| {
                    let path = self.path(file);
                    let image = Image::beside(self.root, &path, self.pictures);
                    Some((number_of(file)?.1.to_owned(), kept(image, &path, problems)?))
                })
                .collect();
            if let Ok(frames) = Frames::new(format!("{}.", spelled_out(&name)), frames) {
                blocks.push(frames.into());
            }
        }
        blocks
    }

    /// Markdown tables; short CSV files without one, folded away.
    fn tables(&self, files: &[String], problems: &mut Vec<Problem>) -> Vec<Block> {
        let mut blocks: Vec<Block> = Vec::new();
        let has = |file: &str| files.iter().any(|f| f == file);
        for file in files {
            let stem = stem_of(file);
            let caption = spelled_out(stem);
            let markdown = match extension_of(file) {
                "md" if file != "README.md" => true,
                "csv" if !has(&format!("{stem}.md")) => false,
                _ => continue,
            };
            let path = self.path(file);
            if !markdown {
                let size = fs::metadata(self.root.join(&path)).map(|data| data.len());
                if size.is_ok_and(|size| size > LARGEST_CSV) {
                    continue;
                }
            }
            let table = self.read(file).and_then(|text| {
                if markdown {
                    Table::from_markdown(&caption, &text)
                } else {
                    Table::from_csv(&caption, &text)
                }
            });
            let Some(table) = kept(table, &path, problems) else {
                continue;
            };
            let rows = table.rows().len();
            if markdown && rows <= LONGEST_OPEN_TABLE {
                blocks.push(table.into());
            } else if markdown || rows <= LONGEST_CSV {
                let summary = format!("{caption} ({rows} rows)");
                blocks.push(Details::new(summary).with(table).into());
            }
        }
        // What is folded away comes last.
        blocks.sort_by_key(|block| matches!(block, Block::Details(_)));
        blocks
    }
}

/// What is there; otherwise a problem more.
fn kept<T>(result: Result<T>, path: &str, problems: &mut Vec<Problem>) -> Option<T> {
    result
        .map_err(|error| problems.push(Problem::because(path, &error)))
        .ok()
}

fn extension_of(file: &str) -> &str {
    file.rsplit_once('.').map_or("", |(_, extension)| extension)
}

fn stem_of(file: &str) -> &str {
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}

/// `name` and `012` of `name_012.png`.
fn number_of(file: &str) -> Option<(&str, &str)> {
    let (name, number) = stem_of(file).rsplit_once(['_', '-'])?;
    let is_number = number.len() >= 3 && number.bytes().all(|b| b.is_ascii_digit());
    is_number.then_some((name, number))
}

/// Single pictures, a PNG before the SVG of the same name, and numbered ones by their name.
fn pictures(files: &[String]) -> (Vec<String>, Vec<(String, Vec<String>)>) {
    let (mut single, mut sequences) = (Vec::new(), Vec::<(String, Vec<String>)>::new());
    let is_png = |file: &str| matches!(extension_of(file), "png" | "apng");
    for file in files {
        match (extension_of(file), number_of(file)) {
            ("png", Some((name, _))) => match sequences.iter_mut().find(|(n, _)| n == name) {
                Some((_, files)) => files.push(file.clone()),
                None => sequences.push((name.to_owned(), vec![file.clone()])),
            },
            ("png" | "apng", _) => single.push(file.clone()),
            ("svg", _) => {
                let twin = |other: &String| is_png(other) && stem_of(other) == stem_of(file);
                if !files.iter().any(twin) {
                    single.push(file.clone());
                }
            }
            _ => {}
        }
    }
    // One number is no sequence.
    sequences.retain_mut(|(_, files)| {
        let several = files.len() > 1;
        if !several {
            single.append(files);
        }
        several
    });
    (single, sequences)
}

/// `Error over radius` of `error_over_radius`.
fn spelled_out(name: &str) -> String {
    let text = name.replace(['_', '-'], " ");
    let mut characters = text.chars();
    match characters.next() {
        Some(first) => first.to_uppercase().chain(characters).collect(),
        None => "Results".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_sorted_into_figures_and_sequences() {
        let files = [
            "a.png",
            "a.svg",
            "b.svg",
            "turn_000.png",
            "turn_001.png",
            "x-123.png",
            "t.csv",
        ];
        let files: Vec<String> = files.map(str::to_owned).into();
        let (single, sequences) = pictures(&files);
        assert_eq!(single, ["a.png", "b.svg", "x-123.png"]);
        let turn = vec!["turn_000.png".to_owned(), "turn_001.png".to_owned()];
        assert_eq!(sequences, [("turn".to_owned(), turn)]);
    }

    #[test]
    fn names_are_spelled_out() {
        assert_eq!(spelled_out("error_over_radius"), "Error over radius");
        assert_eq!(spelled_out(""), "Results");
    }
}
