//! What the program prints: the documents in the folder `messages`.
//!
//! A block of a document has a command after `$ `, its exit code after `? ` unless that is 0, and the lines that it prints, first those on standard
//! error; `[..]` stands for any text within a line. With the variable `WRITE_MESSAGES` the documents are written anew; `[..]` has to be put in again.
//! The commands of a document run one after the other in a folder with the files of `NAME.in`.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{program, text};

const START: &str = "```console\n$ ";
const END: &str = "```\n";

/// Runs the commands of a document, which leave these files and folders behind.
fn check(name: &str, left: &[&str]) {
    let messages = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/messages");
    let path = messages.join(format!("{name}.md"));
    let document = fs::read_to_string(&path).unwrap();
    let folder = tempfile::tempdir().unwrap();
    copy(&messages.join(format!("{name}.in")), folder.path());
    let before = entries(folder.path());
    let mut found = String::new();
    let mut parts = document.split(START);
    found += parts.next().unwrap_or_default();
    for part in parts {
        let (block, after) = part.split_once(END).expect("a block ends");
        let command = block.lines().next().unwrap_or_default();
        let printed = run(folder.path(), command);
        let printed = if matches(block, &printed) {
            block
        } else {
            &*printed
        };
        let _ = write!(found, "{START}{printed}{END}{after}");
    }
    if std::env::var_os("WRITE_MESSAGES").is_some() {
        fs::write(&path, &found).unwrap();
    }
    for (found, expected) in found.split(START).zip(document.split(START)) {
        assert!(
            found == expected,
            "{name}.md has\n{expected}\nand the program printed\n{found}"
        );
    }
    let new: BTreeSet<PathBuf> = &entries(folder.path()) - &before;
    assert_eq!(new, left.iter().map(PathBuf::from).collect());
}

/// What a block would have for a command.
fn run(folder: &Path, command: &str) -> String {
    let arguments = command.split_whitespace().skip(1);
    let output = program(folder).args(arguments).output().unwrap();
    let mut block = format!("{command}\n");
    match output.status.code() {
        Some(0) => (),
        code => {
            let _ = writeln!(block, "? {}", code.unwrap_or(-1));
        }
    }
    let printed = text(&output.stderr) + &text(&output.stdout);
    // Files have the names that they have in the folder.
    block + &printed.replace(&format!("{}/", folder.display()), "")
}

/// Whether lines are as expected, with any text where `[..]` stands.
fn matches(expected: &str, found: &str) -> bool {
    let is_like = |(expected, found): (&str, &str)| {
        let mut rest = found;
        let mut parts = expected.split("[..]");
        let first = parts.next().unwrap_or_default();
        let Some(after) = rest.strip_prefix(first) else {
            return false;
        };
        rest = after;
        for part in parts {
            let Some((_, after)) = rest.split_once(part) else {
                return false;
            };
            // The last part is the end of the line.
            rest = if part.is_empty() { "" } else { after };
        }
        rest.is_empty()
    };
    expected.lines().count() == found.lines().count()
        && expected.lines().zip(found.lines()).all(is_like)
}

fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).into_iter().flatten() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        if entry.path().is_dir() {
            fs::create_dir(&to).unwrap();
            copy(&entry.path(), &to);
        } else {
            fs::copy(entry.path(), to).unwrap();
        }
    }
}

/// What is in a folder, but not in its folders.
fn entries(folder: &Path) -> BTreeSet<PathBuf> {
    let entries = fs::read_dir(folder).unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().into())
        .collect()
}

#[test]
fn lines_match_around_what_is_left_out() {
    assert!(matches("a [..] b\nc", "a x y b\nc"));
    assert!(matches("[..] s", "3.1 s") && matches("a[..]", "abc"));
    assert!(!matches("a [..] b", "a x y") && !matches("a", "a\nb") && !matches("a", "ab"));
}

#[test]
fn refusals_are_one_clear_line_and_leave_nothing_behind() {
    check("refusals", &[]);
}

#[test]
fn runs_tell_what_came_out() {
    check("runs", &["disc", "edges", "fair", "ring", "rough.ply"]);
}
