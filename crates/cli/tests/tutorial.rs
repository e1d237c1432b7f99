//! The tutorial, run as it is printed.
//!
//! Of `docs/tutorial.md` this takes
//! - every line of its `sh` blocks, which is a command of `willmore`;
//! - comments `<!-- quick: OPTIONS -->`: options that are put behind every command of the next block, and win over those
//!   before them, so that the test takes seconds;
//! - file names in `code`, which must be there in the end;
//! - comments `<!-- value: NUMBER = FILE KEY -->`: a number that the text prints, and where the run has it;
//! - comments `<!-- picture: docs/NAME = FILE -->`: a picture of the tutorial and the file that it is a copy of
//!   (`scripts/regenerate_tutorial` makes the copies).

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::common::{program, text};

/// Larger pictures do not belong into a repository.
const LARGEST_PICTURE: u64 = 300 * 1024;
/// What is a file and not a word.
const EXTENSIONS: [&str; 9] = [
    "csv", "html", "json", "npy", "ply", "png", "svg", "toml", "vti",
];

/// A number that the text prints.
struct Printed {
    number: String,
    /// Where the run has it: a JSON file, and the name there.
    file: String,
    key: String,
}

struct Tutorial {
    /// With the options that make them quick.
    commands: Vec<Vec<String>>,
    values: Vec<Printed>,
    /// Files that the text names.
    files: BTreeSet<String>,
    /// Pictures with the files that they are copies of.
    pictures: Vec<(String, String)>,
    /// Pictures that are shown.
    shown: BTreeSet<String>,
}

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs")
}

/// What stands between the delimiters, in every place of a line.
fn between<'a>(line: &'a str, open: &str, close: &str) -> Vec<&'a str> {
    let parts = line.split(open).skip(1);
    parts
        .filter_map(|part| Some(part.split_once(close)?.0))
        .collect()
}

impl Tutorial {
    fn read() -> Self {
        let markdown = std::fs::read_to_string(docs().join("tutorial.md")).unwrap();
        let mut tutorial = Self {
            commands: Vec::new(),
            values: Vec::new(),
            files: BTreeSet::new(),
            pictures: Vec::new(),
            shown: BTreeSet::new(),
        };
        let mut quick: Vec<String> = Vec::new();
        let mut block: Option<String> = None;
        for line in markdown.lines() {
            if let Some(info) = line.strip_prefix("```") {
                if block.is_some() {
                    quick.clear();
                }
                block = block.is_none().then(|| info.to_owned());
            } else if let Some(info) = &block {
                if info == "sh" {
                    let words = line.split_whitespace().map(str::to_owned);
                    tutorial.commands.push(words.chain(quick.clone()).collect());
                }
            } else {
                for options in between(line, "<!-- quick:", "-->") {
                    quick = options.split_whitespace().map(str::to_owned).collect();
                }
                for value in between(line, "<!-- value:", "-->") {
                    let (number, place) = value.split_once('=').unwrap();
                    let (file, key) = place.trim().split_once(' ').unwrap();
                    let [number, file, key] =
                        [number, file, key].map(|word| word.trim().to_owned());
                    let has_it = |text: &str| text.split(['|', ' ']).any(|word| word == number);
                    let mut lines = markdown.lines().filter(|line| !line.starts_with("<!--"));
                    assert!(lines.any(has_it), "{number} is not printed");
                    tutorial.values.push(Printed { number, file, key });
                }
                for copy in between(line, "<!-- picture:", "-->") {
                    let (picture, file) = copy.split_once('=').unwrap();
                    let pair = (picture.trim().to_owned(), file.trim().to_owned());
                    tutorial.pictures.push(pair);
                }
                tutorial.note(line);
            }
        }
        tutorial
    }

    /// Files and pictures in a line of text.
    fn note(&mut self, line: &str) {
        let code = line.split('`').skip(1).step_by(2);
        let is_file = |word: &&str| {
            let extension = word.rsplit_once('.').map(|(_, extension)| extension);
            !word.contains(' ') && extension.is_some_and(|e| EXTENSIONS.contains(&e))
        };
        self.files.extend(code.filter(is_file).map(str::to_owned));
        for part in line.split("![").skip(1) {
            let target = part.split_once("](").unwrap().1.split_once(')').unwrap().0;
            self.shown.insert(target.to_owned());
        }
    }
}

#[test]
fn the_tutorial_runs_as_printed() {
    let tutorial = Tutorial::read();
    let folder = tempfile::tempdir().unwrap();
    // The first ones twice: what they leave behind is in nobody's way.
    let again = tutorial.commands.iter().take(2);
    for command in tutorial.commands.iter().chain(again) {
        assert_eq!(command[0], "willmore", "{command:?}");
        let output = program(folder.path()).args(&command[1..]).output().unwrap();
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{command:?}: {error}");
    }
    for Printed { number, file, key } in &tutorial.values {
        let found = std::fs::read_to_string(folder.path().join(file)).unwrap();
        let found: serde_json::Value = serde_json::from_str(&found).unwrap();
        let digits = number.split_once('.').map_or(0, |(_, digits)| digits.len());
        let found = format!("{:.digits$}", found[key].as_f64().unwrap());
        assert_eq!(*number, found, "{key} of {file}");
    }
    let names = tutorial.pictures.iter().map(|(_, file)| file);
    for name in tutorial.files.iter().chain(names) {
        assert!(folder.path().join(name).is_file(), "no {name} was written");
    }
    // Three worked examples at least, and text that names what they write.
    assert!(tutorial.commands.len() >= 7, "{:?}", tutorial.commands);
    assert!(tutorial.files.len() >= 7, "{:?}", tutorial.files);
}

#[test]
fn the_pictures_of_the_tutorial_are_there_and_small() {
    let tutorial = Tutorial::read();
    let kept: BTreeSet<String> = tutorial
        .pictures
        .iter()
        .map(|(picture, _)| picture.strip_prefix("docs/").unwrap().to_owned())
        .collect();
    assert_eq!(kept, tutorial.shown, "pictures and where they come from");
    for picture in &kept {
        let path = docs().join(picture);
        let length = std::fs::metadata(&path).unwrap().len();
        assert!(length <= LARGEST_PICTURE, "{picture} has {length} bytes");
        images::read(&path).unwrap();
    }
}
