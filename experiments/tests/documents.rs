//! The documents of the repository: what follows from the list of experiments is as it says, every metric is explained, every number of a
//! checked table is that of a summary, and what they link to and call is there.

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;

use experiments::derived::{self, root};
use experiments::experiment::ResultFolder;
use experiments::metrics;
use experiments::programs::EXPERIMENTS;

type Summary = BTreeMap<String, f64>;

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

#[test]
fn what_follows_from_the_list_is_up_to_date() {
    for (path, text) in derived::files(&root(), EXPERIMENTS).unwrap() {
        let path_is = path.strip_prefix(root()).unwrap().display();
        let command = derived::COMMAND;
        let found = fs::read_to_string(&path).unwrap_or_default();
        assert!(found == text, "{path_is} is not what `{command}` writes");
    }
    for file in fs::read_dir(root().join("experiments/src/bin")).unwrap() {
        let path = file.unwrap().path();
        let name = path.file_stem().and_then(|stem| stem.to_str());
        let mut all = EXPERIMENTS.iter();
        assert!(
            all.any(|experiment| Some(experiment.name) == name),
            "src/programs.rs has no experiment for {}",
            path.display()
        );
    }
    for file in fs::read_dir(root().join("experiments/src/programs")).unwrap() {
        let name = file.unwrap().file_name().into_string().unwrap();
        let mut all = EXPERIMENTS.iter();
        assert!(
            all.any(|experiment| name == format!("{}.rs", experiment.name)),
            "src/programs.rs does not declare {name}"
        );
    }
}

#[test]
fn the_results_are_those_of_the_experiments() {
    let summaries = summaries();
    let mut folders: Vec<&str> = Vec::new();
    for experiment in EXPERIMENTS {
        let mut usual = true;
        for folder in experiment.results {
            let name = folder.name;
            assert!(!folder.figures.is_empty(), "{name} has no figures");
            assert!(!folders.contains(&name), "{name} is there twice");
            assert_eq!(name == experiment.name, usual, "{name} in the wrong place");
            assert!(
                summaries.contains_key(name),
                "results/{name} has no summary"
            );
            folders.push(name);
            usual = false;
        }
    }
    for folder in summaries.keys() {
        let message = "is not among the results of an experiment";
        assert!(folders.contains(&&folder[..]), "results/{folder} {message}");
    }
    let runs = derived::runs(&root(), EXPERIMENTS);
    assert!(runs.contains(&"stomatocytes vesicles --branches stomatocyte".to_owned()));
    let last = runs.last().map(String::as_str);
    assert_eq!(last, Some("paper_numbers paper_numbers"));
}

#[test]
fn results_that_are_not_made_again_are_named() {
    let script = read("scripts/regenerate_figures");
    let header = script.split("set -euo").next().unwrap_or_default();
    let page = read("results/README.md");
    let sentence = page.split("makes them again, but for").nth(1);
    let sentence = sentence.and_then(|rest| rest.split("The numbers of").next());
    let sentence = sentence.expect("it says what is not made again");
    let folders = EXPERIMENTS.iter().flat_map(|one| one.results);
    for ResultFolder { name, .. } in folders.filter(|folder| folder.options.is_none()) {
        let is_named = header.contains(&format!("results/{name}"));
        assert!(is_named, "scripts/regenerate_figures does not name {name}");
        let is_named = sentence.contains(&format!("`{name}`"));
        assert!(is_named, "results/README.md does not name {name}");
    }
}

#[test]
fn every_metric_is_explained_and_every_explanation_is_of_a_metric() {
    let summaries = summaries();
    let mut all: Vec<&str> = Vec::new();
    for experiment in EXPERIMENTS {
        for folder in experiment.results {
            for metric in summaries[folder.name].keys() {
                assert!(
                    metrics::is_explained(experiment, metric),
                    "the tables of {} do not explain {metric} of results/{}",
                    experiment.name,
                    folder.name
                );
                all.push(metric);
            }
        }
    }
    let tables = || EXPERIMENTS.iter().flat_map(|one| one.metrics);
    for table in tables() {
        let mut same = tables().filter(|other| other.title == table.title);
        let title = table.title;
        assert!(same.all(|other| other.rows == table.rows), "two of {title}");
    }
    let names = |folder: &str| summaries[folder].keys().map(String::as_str).collect();
    let unused = metrics::unused_rows(EXPERIMENTS, names);
    assert!(unused.is_empty(), "no summary has metrics of {unused:?}");
    for (word, meaning) in EXPERIMENTS.iter().flat_map(|one| metrics::words(one)) {
        let is_kept = |value: &&str| !meaning.contains(&format!("`{value}` in quick runs"));
        let values = metrics::values(meaning).filter(|_| !metrics::is_number(meaning));
        for value in values.filter(is_kept) {
            let part = format!(".{value}.");
            assert!(
                all.iter().any(|name| format!(".{name}.").contains(&part)),
                "no summary has a metric with {value} for {word}"
            );
        }
    }
}

/// Whoever makes results anew runs `paper_numbers` again after that.
#[test]
fn the_numbers_beside_those_of_the_paper_are_those_of_the_summaries() {
    let summaries = summaries();
    let list = read("experiments/paper_numbers.txt");
    let rows = list.lines().filter(|line| !line.starts_with('#'));
    for (row, line) in (1..).zip(rows) {
        let fields: Vec<&str> = line.split('|').map(str::trim).collect();
        let (folder, metric) = fields[4].split_once(' ').unwrap();
        let shown = summaries["paper_numbers"].get(&format!("row{row}.here"));
        let found = summaries[folder].get(metric);
        assert_eq!(shown, found, "run paper_numbers again: row {row}, {line}");
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
fn the_readme_has_programs_that_are_there_and_the_command_of_the_tests() {
    let readme = read("README.md");
    let rows = readme.split("| program |").nth(1).unwrap().lines().skip(2);
    let rows = rows.map_while(cells);
    for name in rows.flat_map(|row| spans(row[0]).collect::<Vec<_>>()) {
        let mut all = EXPERIMENTS.iter();
        assert!(all.any(|one| one.name == name), "{name} is no experiment");
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
