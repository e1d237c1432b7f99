//! What metrics mean: patterns of their names, and the page `results/METRICS.md`.
//!
//! In a pattern, words in capitals stand for what a [`Word`] says, and what is in square brackets may be absent.

use std::collections::BTreeSet;

use crate::experiment::Experiment;

/// A table of `results/METRICS.md`.
pub struct MetricTable {
    pub title: &'static str,
    /// What stands above the table; may be empty.
    pub note: &'static str,
    /// The words in capitals that are explained nowhere else.
    pub words: &'static [Word],
    /// Patterns, separated by commas, with what such metrics are.
    pub rows: &'static [(&'static str, &'static str)],
}

/// A word in capitals, and what it stands for: what is in code spans, or numbers if it says so first.
pub type Word = (&'static str, &'static str);

/// Words of all tables.
pub const NUMBERS: [Word; 2] = [
    (
        "N",
        "a number; in `nN` the number of cells per unit length, `h = 1/N`",
    ),
    (
        "K",
        "a number of the usual time steps: so many have been made, or so much time has passed; 0 is the initial shape",
    ),
];

/// The methods that are compared.
pub const METHOD: Word = (
    "METHOD",
    "`hybrid`, the learned operator in the paper's scheme; `hybrid_calibrated`, the same network in the \
     [calibrated](../docs/calibration.md) scheme; `hybrid_accurate`, the calibrated scheme with the network of the \
     accurate recipe; `fe_implicit` and `fe_semi`, implicit and semi-implicit finite elements; \
     `fe_implicit_calibrated` and `fe_semi_calibrated`, those in the calibrated scheme",
);

/// The metric of every run.
pub const ALL: MetricTable = MetricTable {
    title: "All runs",
    note: "",
    words: &[],
    rows: &[(
        "seconds",
        "wall time of the last run of the program; results that were stored before are not computed again",
    )],
};

/// The tables of these experiments, each with the names of the folders that have such metrics.
fn tables(experiments: &[&Experiment]) -> Vec<(&'static MetricTable, Vec<&'static str>)> {
    let mut tables: Vec<(&MetricTable, Vec<&str>)> = Vec::new();
    for experiment in experiments {
        let folders = experiment.results.iter().map(|folder| folder.name);
        for table in experiment.metrics {
            match tables
                .iter_mut()
                .find(|(other, _)| other.title == table.title)
            {
                Some((_, known)) => known.extend(folders.clone()),
                None => tables.push((table, folders.clone().collect())),
            }
        }
    }
    tables
}

/// The words of an experiment: those of all, of its tables, and its own.
pub fn words(experiment: &Experiment) -> Vec<Word> {
    let tables = experiment.metrics.iter().flat_map(|table| table.words);
    let own = tables.chain(experiment.words).copied();
    NUMBERS.into_iter().chain(own).collect()
}

/// Whether the tables of an experiment explain this metric.
pub fn is_explained(experiment: &Experiment, name: &str) -> bool {
    let words = words(experiment);
    let tables = [&ALL].into_iter().chain(experiment.metrics.iter().copied());
    let mut rows = tables.flat_map(|table| table.rows);
    rows.any(|(row, _)| is_of(row, name, &words))
}

/// The rows of the tables, with their titles, that explain none of the metrics which these folders of results have.
pub fn unused_rows<'a>(
    experiments: &[&Experiment],
    metrics: impl Fn(&str) -> Vec<&'a str>,
) -> Vec<(&'static str, &'static str)> {
    let (mut all, mut used) = (BTreeSet::new(), BTreeSet::new());
    for experiment in experiments {
        let words = words(experiment);
        let folders = experiment.results.iter();
        let names: Vec<&str> = folders.flat_map(|folder| metrics(folder.name)).collect();
        for table in experiment.metrics {
            for (row, _) in table.rows {
                all.insert((table.title, *row));
                if names.iter().any(|name| is_of(row, name, &words)) {
                    used.insert((table.title, *row));
                }
            }
        }
    }
    all.difference(&used).copied().collect()
}

/// Whether a metric is one of a row.
fn is_of(row: &str, name: &str, words: &[Word]) -> bool {
    row.split(", ").any(|pattern| fits(pattern, name, words))
}

/// Whether a name is one that a pattern describes.
fn fits(pattern: &str, name: &str, words: &[Word]) -> bool {
    if let Some((before, rest)) = pattern.split_once('[') {
        let (optional, after) = rest.split_once(']').expect("a closing bracket");
        return fits(&format!("{before}{after}"), name, words)
            || fits(&format!("{before}{optional}{after}"), name, words);
    }
    let Some(start) = pattern.find(|c: char| c.is_ascii_uppercase()) else {
        return pattern == name;
    };
    let Some(rest) = name.strip_prefix(&pattern[..start]) else {
        return false;
    };
    let pattern = &pattern[start..];
    let end = pattern.find(|c: char| !c.is_ascii_uppercase());
    let (word, tail) = pattern.split_at(end.unwrap_or(pattern.len()));
    let meanings = words.iter().filter(|(known, _)| *known == word);
    let mut meanings = meanings.map(|(_, meaning)| *meaning).peekable();
    assert!(meanings.peek().is_some(), "nothing explains {word}");
    meanings.any(|meaning| {
        let mut ends = (1..=rest.len()).filter(|end| rest.is_char_boundary(*end));
        ends.any(|end| can_be(&rest[..end], meaning) && fits(tail, &rest[end..], words))
    })
}

/// Whether a word with this meaning can stand for a text.
fn can_be(text: &str, meaning: &str) -> bool {
    if is_number(meaning) {
        let digits = text.chars().all(|c| c.is_ascii_digit() || c == '.');
        return digits && text.parse::<f64>().is_ok();
    }
    values(meaning).any(|value| value == text)
}

/// Whether a word with this meaning stands for numbers.
pub fn is_number(meaning: &str) -> bool {
    meaning.starts_with("a number")
}

/// What stands in code spans.
pub fn values(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// What each word means in which experiments, in the order in which they use it.
fn meanings<'a>(experiments: &[&'a Experiment]) -> Vec<(&'a str, Vec<(&'a str, Vec<&'a str>)>)> {
    let mut known: Vec<(&str, Vec<(&str, Vec<&str>)>)> = Vec::new();
    for experiment in experiments {
        for (word, meaning) in words(experiment) {
            let of_word = entry(&mut known, word);
            entry(of_word, meaning).push(experiment.name);
        }
    }
    known
}

fn entry<'a, 'k, V: Default>(known: &'k mut Vec<(&'a str, V)>, key: &'a str) -> &'k mut V {
    let found = known.iter().position(|(other, _)| *other == key);
    let index = found.unwrap_or_else(|| {
        known.push((key, V::default()));
        known.len() - 1
    });
    &mut known[index].1
}

fn code(names: &[&str]) -> String {
    let names: Vec<_> = names.iter().map(|name| format!("`{name}`")).collect();
    names.join(", ")
}

/// The tables of `results/METRICS.md`, from the one of the words on.
pub fn page(experiments: &[&Experiment]) -> String {
    let known = meanings(experiments);
    let words = known.iter().map(|(word, meanings)| {
        let meaning = match &meanings[..] {
            [(meaning, _)] => (*meaning).to_owned(),
            several => {
                let each = several.iter();
                let each = each.map(|(meaning, users)| format!("in {}: {meaning}", code(users)));
                each.collect::<Vec<_>>().join("; ")
            }
        };
        format!("| `{word}` | {meaning} |")
    });
    let mut lines = vec!["| in names | stands for |".into(), "|---|---|".to_owned()];
    lines.extend(words);
    let everywhere = (&ALL, Vec::new());
    for (table, folders) in [everywhere].into_iter().chain(tables(experiments)) {
        let colon = if folders.is_empty() { "" } else { ": " };
        let title = format!("## {}{colon}{}", table.title, code(&folders));
        lines.extend([String::new(), title, String::new()]);
        if !table.note.is_empty() {
            lines.extend([table.note.to_owned(), String::new()]);
        }
        lines.extend(["| metric | meaning |".to_owned(), "|---|---|".to_owned()]);
        let rows = table.rows.iter();
        lines.extend(rows.map(|(patterns, meaning)| {
            format!("| `{}` | {meaning} |", patterns.replace(", ", "`, `"))
        }));
    }
    lines.join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_of_metrics() {
        let words = [
            ("N", "a number `x`"),
            ("METHOD", "`hybrid`; `hybrid_accurate`, b"),
            ("METHOD", "`taubin`"),
        ];
        for (pattern, name, expected) in [
            ("a.nN.l2.stepN", "a.n128.l2.step64", true),
            ("a.nN.l2.stepN", "a.n128.l2.step", false),
            ("a.nN.l2", "a.n128.l2.step64", false),
            ("noiseN.fair", "noise0.3.fair", true),
            ("noiseN.fair", "noise0.3.0.fair", false),
            ("a[.METHOD].w", "a.w", true),
            ("a[.METHOD].w", "a.hybrid_accurate.w", true),
            ("a[.METHOD].w", "a.taubin.w", true),
            ("a[.METHOD].w", "a.fe.w", false),
        ] {
            assert_eq!(fits(pattern, name, &words), expected, "{pattern}, {name}");
        }
    }
}
