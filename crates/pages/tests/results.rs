//! Pages of folders of results.

use std::fs;
use std::path::Path;
use std::process::Command;

use pages::Error;
use pages::results::index_page;

const MANIFEST: &str = r#"{"experiment": "cross", "parameters": {"n": [64]}, "commit": "abc123",
    "device": "cpu", "dtype": "f64", "backend": "flex", "seed": 1, "wall_seconds": 2.5}"#;
const README: &str = "# Title\n\n| paper | here |\n|---|---|\n| a cross | [cross](cross/errors.png), [x](../x.md) |\n";

fn png(shade: u8) -> Vec<u8> {
    let picture = render::Picture::new([8, 6], vec![[shade, 0, 0, 255]; 48]).unwrap();
    picture.to_png().unwrap()
}

fn write(folder: &Path, name: &str, content: impl AsRef<[u8]>) {
    fs::write(folder.join(name), content).unwrap();
}

/// A folder of a run with everything in order.
fn run(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    write(folder, "manifest.json", MANIFEST);
    write(folder, "summary.json", "{\"cross.error\": 0.125}");
    for (k, name) in ["shapes.png", "errors.png", "turn.png"].iter().enumerate() {
        write(folder, name, png(k as u8));
    }
    write(
        folder,
        "errors.svg",
        "<svg xmlns=\"http://www.w3.org/2000/svg\"/>",
    );
    write(
        folder,
        "error_table.md",
        "| method | error |\n|---|---|\n| a | 0.5 |\n",
    );
    write(folder, "error_table.csv", "method,error\na,0.5\n");
    write(folder, "steps.csv", "step,w\n0,25.1\n1,25.2\n");
}

/// Problems but for the experiments that are not there.
fn others(problems: &[Error]) -> Vec<String> {
    let problems = problems.iter().map(ToString::to_string);
    problems
        .filter(|problem| problem.contains(['/', '.']))
        .collect()
}

#[test]
fn a_folder_becomes_a_section() {
    let root = tempfile::tempdir().unwrap();
    run(&root.path().join("cross"));
    write(root.path(), "README.md", README);
    let (page, problems) = index_page(root.path()).unwrap();
    assert_eq!(others(&problems), [""; 0]);
    let html = page.to_html();
    for part in [
        "<h2 id=\"cross\">Willmore flow of a cross</h2>",
        "<td><a href=\"#cross\">cross</a>, x</td>",
        "<figcaption>L² distance to the reference, and distance to the exact flow, against time.</figcaption>",
        "<figcaption>Turn.</figcaption>",
        "<caption>Error table</caption>",
        "<summary>Steps (2 rows)</summary>",
        "<dt>cross.error</dt><dd>0.12500</dd>",
        "<dt>commit</dt><dd>abc123</dd>",
        "<dt>device</dt><dd>cpu</dd>",
    ] {
        assert!(html.contains(part), "{part}");
    }
    // Before all text and tables the first figure of each experiment is a link to it.
    let gallery = html.find("<ul class=\"gallery\">").unwrap();
    assert!(gallery < html.find(">Beside the paper</h2>").unwrap());
    let card = html[gallery..].split("</li>").next().unwrap();
    for part in [
        "<a href=\"#cross\"><img ",
        "<span>Willmore flow of a cross</span></a>",
        "<p>All methods against nested implicit finite elements on a finer grid.</p>",
    ] {
        assert!(card.contains(part), "{part}");
    }
    // The shapes come first, and each table once.
    assert!(
        html.find("<figcaption>The curve at").unwrap()
            < html.find("<figcaption>L² distance").unwrap()
    );
    assert_eq!(html.matches("<caption>Error table</caption>").count(), 1);
    // Nothing says where the folder is.
    assert!(!html.contains(&*root.path().to_string_lossy()));
}

#[test]
fn the_place_and_the_time_do_not_matter() {
    let page = || {
        let root = tempfile::tempdir().unwrap();
        run(&root.path().join("cross"));
        run(&root.path().join("another_one"));
        write(root.path(), "README.md", README);
        index_page(root.path()).unwrap().0.to_html()
    };
    assert_eq!(page(), page());
    assert!(page().contains("<h2 id=\"another_one\">Another one</h2>"));
}

#[test]
fn missing_and_broken_files_are_named() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("cross");
    run(&folder);
    write(&folder, "manifest.json", "{");
    write(&folder, "summary.json", "{\"a\": \"b\"}");
    write(&folder, "errors.png", &png(1)[..40]);
    write(&folder, "errors.svg", "<svg>");
    write(&folder, "error_table.md", "no table");
    fs::remove_file(folder.join("shapes.png")).unwrap();
    let (page, problems) = index_page(root.path()).unwrap();
    let problems = others(&problems);
    let html = page.to_html();
    let files = [
        "README.md",
        "cross/manifest.json",
        "cross/shapes.png",
        "cross/errors.png",
        "cross/error_table.md",
        "cross/summary.json",
    ];
    assert_eq!(problems.len(), files.len());
    for (problem, file) in problems.iter().zip(files) {
        assert!(
            problem.contains(file) && !problem.contains('\n'),
            "{problem}"
        );
    }
    assert!(html.contains("<p>cross/shapes.png is missing</p>"));
    // What is left is shown.
    assert!(html.contains("Turn") && html.contains("<summary>Steps (2 rows)</summary>"));

    let nowhere = root.path().join("nowhere");
    let message = index_page(&nowhere).unwrap_err().to_string();
    assert!(message.contains("nowhere"), "{message}");
}

#[test]
fn the_program_writes_the_page_and_names_what_is_missing() {
    let root = tempfile::tempdir().unwrap();
    run(&root.path().join("cross"));
    write(root.path(), "README.md", README);
    fs::remove_file(root.path().join("cross/shapes.png")).unwrap();
    let program = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_results_page"))
            .arg("--results")
            .arg(root.path())
            .args(arguments)
            .output()
            .unwrap()
    };
    let output = program(&[]);
    assert!(output.status.success());
    let warnings = String::from_utf8(output.stderr).unwrap();
    assert!(
        warnings.contains("warning: cross/shapes.png is missing\n"),
        "{warnings}"
    );
    let written = fs::read_to_string(root.path().join("index.html")).unwrap();
    let (page, _) = index_page(root.path()).unwrap();
    assert_eq!(written, page.to_html());

    let elsewhere = tempfile::tempdir().unwrap();
    let path = elsewhere.path().join("page.html");
    assert!(
        program(&["--output", path.to_str().unwrap()])
            .status
            .success()
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), written);

    assert_eq!(program(&["--strict"]).status.code(), Some(1));
    assert_eq!(
        program(&["--output", "/no/such/folder/x.html"])
            .status
            .code(),
        Some(2)
    );
}
