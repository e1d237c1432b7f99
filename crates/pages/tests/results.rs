//! Pages of folders of results.

use std::fs;
use std::path::Path;
use std::process::Command;

use pages::Pictures;
use pages::results::{Problem, index_page, run_page};

const MANIFEST: &str = r#"{"experiment": "cross", "parameters": {"n": [64]}, "commit": "abc123",
    "device": "cpu", "dtype": "f64", "backend": "flex", "seed": 1, "wall_seconds": 2.5}"#;
const README: &str =
    "| paper | here | state |\n|---|---|---|\n| a cross | [cross](cross) | n = 64 only |\n";

fn png(shade: u8) -> Vec<u8> {
    let picture = render::Picture::new(8, 6, vec![[shade, 0, 0, 255]; 48]).unwrap();
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
    for (k, name) in ["shapes.png", "errors.png", "turn_000.png", "turn_001.png"]
        .iter()
        .enumerate()
    {
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
fn others(problems: Vec<Problem>) -> Vec<Problem> {
    let is_folder = |p: &Problem| !p.file.contains(['/', '.']);
    problems.into_iter().filter(|p| !is_folder(p)).collect()
}

#[test]
fn a_folder_becomes_a_section() {
    let root = tempfile::tempdir().unwrap();
    run(&root.path().join("cross"));
    write(root.path(), "README.md", README);
    let (page, problems) = index_page(root.path(), Pictures::Linked).unwrap();
    assert_eq!(others(problems), []);
    let html = page.to_html();
    for part in [
        "<h2 id=\"cross\">Willmore flow of a cross</h2>",
        "<li>In the paper: a cross. Here: n = 64 only.</li>",
        "<img src=\"cross/shapes.png\"",
        "<a href=\"cross/errors.svg\">SVG</a>",
        "data-label=\"001\"><img src=\"cross/turn_001.png\"",
        "<caption>Error table</caption>",
        "<summary>Steps (2 rows)</summary>",
        "<dt>cross.error</dt><dd>0.12500</dd>",
        "<dt>commit</dt><dd>abc123</dd>",
        "<dt>device</dt><dd>cpu, flex, f64</dd>",
        "img-src data: 'self' file:;",
    ] {
        assert!(html.contains(part), "{part}");
    }
    // The shapes come first, and each table once.
    assert!(html.find("shapes.png").unwrap() < html.find("errors.png").unwrap());
    assert_eq!(html.matches("<caption>Error table</caption>").count(), 1);
    // Nothing says where the folder is.
    assert!(!html.contains(&*root.path().to_string_lossy()));
}

#[test]
fn the_place_and_the_time_do_not_matter() {
    let page = |pictures| {
        let root = tempfile::tempdir().unwrap();
        run(&root.path().join("cross"));
        run(&root.path().join("another_one"));
        write(root.path(), "README.md", README);
        index_page(root.path(), pictures).unwrap().0.to_html()
    };
    for pictures in [Pictures::Linked, Pictures::Embedded] {
        assert_eq!(page(pictures), page(pictures));
    }
    assert!(page(Pictures::Linked).contains("<h2 id=\"another_one\">Another one</h2>"));
}

#[test]
fn a_run_is_one_file() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("x");
    run(&folder);
    let (page, problems) = run_page(&folder).unwrap();
    assert_eq!(problems, []);
    let html = page.to_html();
    assert!(html.contains("<title>Willmore flow of a cross</title>"));
    assert_eq!(html.matches("src=\"data:image/png;base64,").count(), 4);
    assert!(!html.contains("href=\""));
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
    let (page, problems) = index_page(root.path(), Pictures::Linked).unwrap();
    let problems = others(problems);
    let html = page.to_html();
    let files = [
        "README.md",
        "cross/manifest.json",
        "cross/shapes.png",
        "cross/errors.png",
        "cross/error_table.md",
        "cross/summary.json",
    ];
    let found: Vec<&str> = problems.iter().map(|p| p.file.as_str()).collect();
    assert_eq!(found, files);
    for problem in &problems {
        assert!(html.contains(&format!("<code>{}</code>", problem.file)));
        assert!(!problem.to_string().contains('\n'), "{problem}");
    }
    // What is left is shown.
    assert!(html.contains("turn_000.png") && html.contains("<summary>Steps (2 rows)</summary>"));

    let nowhere = root.path().join("nowhere");
    let message = index_page(&nowhere, Pictures::Linked)
        .unwrap_err()
        .to_string();
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
        warnings.contains("warning: cross/shapes.png: it is missing\n"),
        "{warnings}"
    );
    let linked = fs::read_to_string(root.path().join("index.html")).unwrap();
    let (page, _) = index_page(root.path(), Pictures::Linked).unwrap();
    assert_eq!(linked, page.to_html());

    // Anywhere else the pictures have to be inside.
    let elsewhere = tempfile::tempdir().unwrap();
    let path = elsewhere.path().join("page.html");
    assert!(
        program(&["--output", path.to_str().unwrap()])
            .status
            .success()
    );
    let embedded = fs::read_to_string(&path).unwrap();
    assert!(embedded.contains("src=\"data:image/png") && !embedded.contains("src=\"cross/"));

    assert_eq!(program(&["--strict"]).status.code(), Some(1));
    assert_eq!(
        program(&["--output", "/no/such/folder/x.html"])
            .status
            .code(),
        Some(2)
    );
}
