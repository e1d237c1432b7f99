//! The documents of the repository: every metric is explained, every number of a checked table is that of a summary, and what
//! they link to and call is there.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

type Summary = BTreeMap<String, f64>;

fn root() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    folder.canonicalize().unwrap()
}

fn read(file: &str) -> String {
    fs::read_to_string(root().join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// The summaries of all results, by folder, as git has them for the next commit: a run of one's own replaces the files. Where there is no git, the
/// files.
fn summaries() -> BTreeMap<String, Summary> {
    let mut all = BTreeMap::new();
    for folder in fs::read_dir(root().join("results")).unwrap() {
        let folder = folder.unwrap();
        let name = folder.file_name().into_string().unwrap();
        let in_file = || fs::read_to_string(folder.path().join("summary.json")).ok();
        if let Some(text) = staged(&format!("results/{name}/summary.json")).or_else(in_file) {
            all.insert(name, serde_json::from_str(&text).unwrap());
        }
    }
    assert!(!all.is_empty());
    all
}

/// A file as git has it for the next commit.
fn staged(file: &str) -> Option<String> {
    let mut git = Command::new("git");
    git.arg("-C").arg(root());
    let output = git.arg("show").arg(format!(":./{file}")).output().ok()?;
    (output.status.success()).then(|| String::from_utf8(output.stdout).unwrap())
}

/// What stands in code spans.
fn spans(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// The cells of a row of a table.
fn cells(line: &str) -> Option<Vec<&str>> {
    let inner = line.strip_prefix('|')?.strip_suffix('|')?;
    Some(inner.split('|').map(str::trim).collect())
}

/// What the words in capitals stand for: the first table of `results/METRICS.md`. A word without a list stands for numbers.
struct Words(BTreeMap<String, Vec<String>>);

impl Words {
    fn of(metrics: &str) -> Self {
        let lines = metrics.lines().take_while(|line| !line.starts_with("## "));
        let rows = lines
            .filter_map(cells)
            .filter(|row| row[0].starts_with('`'));
        Self(
            rows.map(|row| {
                let number = row[1].starts_with("a number");
                let values = spans(row[1]).filter(|_| !number).map(str::to_owned);
                (spans(row[0]).next().unwrap().to_owned(), values.collect())
            })
            .collect(),
        )
    }

    /// The beginnings of a key that a word can stand for.
    fn beginnings<'a>(&self, word: &str, key: &'a str) -> Vec<&'a str> {
        let values = self.0.get(word);
        let values = values.unwrap_or_else(|| panic!("results/METRICS.md does not explain {word}"));
        let is_number = |c: char| c.is_ascii_digit() || c == '.';
        let longest = key.find(|c| !is_number(c)).unwrap_or(key.len());
        let fits = |end: &usize| {
            let beginning = &key[..*end];
            match &values[..] {
                [] => *end <= longest && beginning.parse::<f64>().is_ok(),
                values => values.iter().any(|value| value == beginning),
            }
        };
        (1..=key.len())
            .filter(fits)
            .map(|end| &key[..end])
            .collect()
    }

    /// Whether a key is one that a pattern describes.
    fn matches(&self, pattern: &str, key: &str) -> bool {
        if let Some((before, rest)) = pattern.split_once('[') {
            let (optional, after) = rest.split_once(']').expect("a closing bracket");
            return self.matches(&format!("{before}{after}"), key)
                || self.matches(&format!("{before}{optional}{after}"), key);
        }
        let Some(start) = pattern.find(|c: char| c.is_ascii_uppercase()) else {
            return pattern == key;
        };
        let Some(rest) = key.strip_prefix(&pattern[..start]) else {
            return false;
        };
        let pattern = &pattern[start..];
        let end = pattern.find(|c: char| !c.is_ascii_uppercase());
        let (word, tail) = pattern.split_at(end.unwrap_or(pattern.len()));
        let beginnings = self.beginnings(word, rest).into_iter();
        beginnings
            .map(|beginning| &rest[beginning.len()..])
            .any(|rest| self.matches(tail, rest))
    }
}

#[test]
fn patterns_of_metrics() {
    let words =
        Words::of("| `N` | a number `x` |\n| `METHOD` | `hybrid`; `hybrid_accurate`, b |\n");
    for (pattern, key, fits) in [
        ("a.nN.l2.stepN", "a.n128.l2.step64", true),
        ("a.nN.l2.stepN", "a.n128.l2.step", false),
        ("a.nN.l2", "a.n128.l2.step64", false),
        ("noiseN.fair", "noise0.3.fair", true),
        ("noiseN.fair", "noise0.3.0.fair", false),
        ("a[.METHOD].w", "a.w", true),
        ("a[.METHOD].w", "a.hybrid_accurate.w", true),
        ("a[.METHOD].w", "a.fe.w", false),
    ] {
        assert_eq!(words.matches(pattern, key), fits, "{pattern} and {key}");
    }
}

/// A row of `results/METRICS.md`: folders of results that have such metrics, and their patterns.
struct Entry<'a> {
    folders: Vec<&'a str>,
    patterns: Vec<&'a str>,
    line: &'a str,
}

/// The folders are those that the heading names, or all.
fn entries<'a>(text: &'a str, summaries: &'a BTreeMap<String, Summary>) -> Vec<Entry<'a>> {
    let mut entries = Vec::new();
    let mut folders: Option<Vec<&str>> = None;
    for line in text.lines() {
        if let Some(title) = line.strip_prefix("## ") {
            let named: Vec<&str> = spans(title).collect();
            let all = || summaries.keys().map(String::as_str).collect();
            folders = Some(if named.is_empty() { all() } else { named });
        } else if let (Some(folders), Some(row)) = (&folders, cells(line))
            && row[0].starts_with('`')
        {
            entries.push(Entry {
                folders: folders.clone(),
                patterns: spans(row[0]).collect(),
                line,
            });
        }
    }
    entries
}

#[test]
fn every_metric_is_explained_and_every_explanation_is_of_a_metric() {
    let text = read("results/METRICS.md");
    let (words, summaries) = (Words::of(&text), summaries());
    let entries = entries(&text, &summaries);
    let fits = |entry: &Entry, folder: &str, key: &str| {
        let mut patterns = entry.patterns.iter();
        entry.folders.contains(&folder) && patterns.any(|pattern| words.matches(pattern, key))
    };
    let metrics = || {
        let all = summaries.iter();
        all.flat_map(|(folder, summary)| summary.keys().map(|key| (&folder[..], &key[..])))
    };
    for (folder, key) in metrics() {
        assert!(
            entries.iter().any(|entry| fits(entry, folder, key)),
            "results/METRICS.md does not explain {key} of results/{folder}"
        );
    }
    for entry in &entries {
        assert!(
            metrics().any(|(folder, key)| fits(entry, folder, key)),
            "no summary has a metric of this row of results/METRICS.md: {}",
            entry.line
        );
        for folder in &entry.folders {
            assert!(
                summaries.contains_key(*folder),
                "results/{folder} has no summary"
            );
        }
    }
    for value in words.0.values().flatten() {
        assert!(
            metrics().any(|(_, key)| format!(".{key}.").contains(&format!(".{value}."))),
            "no summary has a metric with {value}"
        );
    }
}

#[test]
fn all_results_are_in_the_catalogue() {
    let catalogue = read("crates/pages/assets/catalogue.toml");
    for folder in summaries().keys() {
        let entry = format!("folder = \"{folder}\"\n");
        assert!(catalogue.contains(&entry), "{folder} is not");
    }
}

/// A table is checked if the head of its last column is "metric". Its cells hold the folder of the results and the metric; words in
/// capitals stand for the code or the last word in the head of the column. A metric without capitals is that of the column before.
#[test]
fn numbers_of_checked_tables_are_those_of_the_summaries() {
    let (text, summaries) = (read("results/README.md"), summaries());
    let mut checked = 0;
    let mut wrong = Vec::new();
    let mut head: Option<Vec<&str>> = None;
    for line in text.lines() {
        let Some(row) = cells(line) else {
            head = None;
            continue;
        };
        let Some(head) = &head else {
            head = Some(row);
            continue;
        };
        let (Some(&"metric"), Some((source, numbers))) = (head.last(), row.split_last()) else {
            continue;
        };
        let source: Vec<&str> = spans(source).collect();
        let [folder, metric] = source[..] else {
            continue;
        };
        let constant = !source.concat().contains(|c: char| c.is_ascii_uppercase());
        let first = if constant { numbers.len() - 1 } else { 1 };
        for (title, number) in head.iter().zip(numbers).skip(first) {
            let number = number.trim_matches('*');
            if number.is_empty() {
                continue;
            }
            let word = spans(title)
                .next()
                .or(title.split(' ').next_back())
                .unwrap();
            let filled = |text: &str| text.replace(|c: char| c.is_ascii_uppercase(), word);
            let (folder, metric) = (filled(folder), filled(metric));
            let value = summaries
                .get(&folder)
                .and_then(|summary| summary.get(&metric));
            let value = value.unwrap_or_else(|| panic!("results/{folder} has no metric {metric}"));
            let digits = number.split_once('.').map_or(0, |(_, digits)| digits.len());
            let right = format!("{value:.digits$}");
            if number != right {
                wrong.push(format!("{number} should be {right}, {metric} of {folder}"));
            }
            checked += 1;
        }
    }
    assert!(wrong.is_empty(), "results/README.md:\n{}", wrong.join("\n"));
    assert!(checked > 50, "only {checked} numbers are checked");
}

/// The documents that people read.
fn documents() -> Vec<String> {
    let mut files = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"]
        .map(str::to_owned)
        .to_vec();
    for folder in ["docs", "results"] {
        for file in fs::read_dir(root().join(folder)).unwrap() {
            let name = file.unwrap().file_name().into_string().unwrap();
            if name
                .rsplit_once('.')
                .is_some_and(|(_, extension)| extension == "md")
            {
                files.push(format!("{folder}/{name}"));
            }
        }
    }
    files
}

#[test]
fn links_lead_somewhere() {
    for file in documents() {
        let text = read(&file);
        let folder = root().join(&file).parent().unwrap().to_path_buf();
        let targets = text
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split(')').next());
        for target in targets.filter(|target| !target.contains("://")) {
            let path = target.split('#').next().unwrap();
            assert!(folder.join(path).exists(), "{file} links to {target}");
        }
    }
}

/// Names of letters, digits and underscores behind a word, without placeholders such as `NAME`.
fn names_behind<'a>(text: &'a str, word: &'a str) -> impl Iterator<Item = &'a str> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let name = move |rest: &'a str| rest.split(|c| !is_part(c)).next().unwrap_or("");
    let names = text.split(word).skip(1).map(name);
    names.filter(|name| name.starts_with(|c: char| c.is_ascii_lowercase()))
}

#[test]
fn commands_and_paths_are_there() {
    let root = root();
    let program = |name: &str| {
        let file = format!("src/bin/{name}.rs");
        let folders = ["experiments", "crates/pages"];
        name == "willmore" || folders.iter().any(|f| root.join(f).join(&file).exists())
    };
    let starts = [
        "crates/",
        "experiments/",
        "scripts/",
        "tests/",
        "results/",
        ".ci/",
    ];
    let is_path = |span: &&str| {
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "._-/".contains(c);
        starts.iter().any(|start| span.starts_with(start)) && span.chars().all(plain)
    };
    for file in documents() {
        let text = read(&file);
        for name in names_behind(&text, "--bin ") {
            assert!(program(name), "{file} calls {name}");
        }
        for name in names_behind(&text, "scripts/") {
            assert!(
                root.join("scripts").join(name).exists(),
                "{file} calls scripts/{name}"
            );
        }
        for path in spans(&text).filter(is_path) {
            assert!(root.join(path).exists(), "{file} names {path}");
        }
    }
}

#[test]
fn the_readme_has_every_program_and_the_command_of_the_tests() {
    let readme = read("README.md");
    for program in fs::read_dir(root().join("experiments/src/bin")).unwrap() {
        let path = program.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        assert!(
            readme.contains(&format!("`{name}`")),
            "{name} is not in README.md"
        );
    }
    let command = readme.lines().find(|line| line.starts_with("cargo test"));
    let command = command
        .and_then(|line| line.split('#').next())
        .map(str::trim);
    let ci = read(".ci/run");
    assert!(
        ci.lines().any(|line| Some(line) == command),
        ".ci/run does not run {command:?}"
    );
}
