//! A person's own files: parts of a mesh that stay, standard input and output, fields on other grids.

use std::collections::HashMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use chacha20::ChaCha8Rng;
use geometry::shapes::Ball;
use geometry::{Grid, npy, phase_field};
use rand::{RngExt, SeedableRng};
use surfaces::{ClosedMesh, TriangleMesh};

use crate::common::{outcome, program, run, text};

/// A ball of radius 3 about (1, 0, 0) with noise.
fn noisy_ball() -> TriangleMesh {
    let grid = Grid::<3>::centred(24, 1.0).unwrap();
    let u = phase_field(grid, &Ball::new([0.0; 3], 0.4).unwrap(), 0.1).unwrap();
    let mut mesh = surfaces::phase_field_surface(&u, 0.1).unwrap();
    mesh.normals = None;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for x in &mut mesh.vertices {
        let factor = 7.5 * (1.0 + 0.01 * rng.random_range(-1.7..1.7));
        *x = [1.0 + factor * x[0], factor * x[1], factor * x[2]];
    }
    mesh
}

/// How many vertices moved, of which none may have been `kept`.
fn moved(from: &TriangleMesh, to: &Path, kept: impl Fn([f64; 3]) -> bool) -> usize {
    let to = surfaces::read(to).unwrap();
    let pairs = from.vertices.iter().zip(&to.vertices);
    let differ = |(a, b): &(&[f64; 3], &[f64; 3])| a.map(f64::to_bits) != b.map(f64::to_bits);
    let moved: Vec<_> = pairs.filter(differ).map(|(a, _)| *a).collect();
    assert!(!moved.iter().any(|x| kept(*x)), "a kept vertex moved");
    moved.len()
}

/// What is sharp on purpose cannot be told from noise where all vertices are near it.
#[test]
fn edges_between_flat_sides_are_told_before_they_become_round() {
    let folder = tempfile::tempdir().unwrap();
    let mut octahedron = noisy_ball();
    for x in &mut octahedron.vertices {
        let length = (x[0] - 1.0).abs() + x[1].abs() + x[2].abs();
        *x = [(x[0] - 1.0) / length, x[1] / length, x[2] / length];
    }
    for (name, mesh, is_noisy) in [
        ("octahedron.ply", octahedron, false),
        ("ball.ply", noisy_ball(), true),
    ] {
        surfaces::write(folder.path().join(name), &mesh).unwrap();
        let said = run(folder.path(), &["fair", name, "--cells", "32"]);
        let error = text(&said.stderr);
        assert_eq!(said.status.success(), is_noisy, "{error}");
        assert_eq!(error.contains("is the shape itself"), !is_noisy, "{error}");
    }
}

/// A block of 24 by 24 by 12 squares of side 1, each of two triangles.
fn block() -> TriangleMesh {
    const SIZE: [i32; 3] = [24, 24, 12];
    let mut mesh = TriangleMesh::default();
    let mut numbers = HashMap::new();
    for (axis, side) in (0..3).flat_map(|axis| [(axis, false), (axis, true)]) {
        let [across, along] = [(axis + 1) % 3, (axis + 2) % 3];
        let steps = (0..SIZE[across]).flat_map(|i| (0..SIZE[along]).map(move |j| [i, j]));
        for [i, j] in steps {
            let mut corner = |a: i32, b: i32| {
                let mut at = [0; 3];
                (at[axis], at[across], at[along]) = (i32::from(side) * SIZE[axis], i + a, j + b);
                *numbers.entry(at).or_insert_with(|| {
                    mesh.vertices.push(at.map(f64::from));
                    mesh.vertices.len() as u32 - 1
                })
            };
            let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            let [b, d] = if side { [b, d] } else { [d, b] };
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

#[test]
fn sharp_edges_of_a_noisy_block_stay_unless_they_are_to_become_round() {
    let folder = tempfile::tempdir().unwrap();
    let clean = block();
    let (solid, _) = ClosedMesh::new(clean.clone()).unwrap();
    let distance = surfaces::MeshDistance::new(&solid);
    let mut noisy = clean.clone();
    noisy.roughen(0.25, 3);
    surfaces::write(folder.path().join("block.ply"), &noisy).unwrap();
    let faired = |rule: &[&str]| {
        let fair = [
            "fair",
            "block.ply",
            "--cells",
            "48",
            "--save",
            "out.ply",
            "--force",
        ];
        let outcome = outcome(folder.path(), &[&fair[..], rule].concat());
        let mesh = surfaces::read(folder.path().join("out.ply")).unwrap();
        let distances = distance.signed_distances(&mesh.vertices);
        let squares: f64 = distances.iter().map(|d| d * d).sum();
        (
            outcome["mesh"].clone(),
            (squares / distances.len() as f64).sqrt(),
        )
    };
    let (told, kept) = faired(&["--output", "auto"]);
    // Twelve edges, 240 long.
    let count = told["kept_edges"].as_u64().unwrap();
    assert!((220..=245).contains(&count), "{told}");
    let length = told["kept_edges_length"].as_f64().unwrap();
    assert!((length / 240.0 - 1.0).abs() < 0.1, "{told}");
    let (told, round) = faired(&["--output", "round", "--edges", "round"]);
    assert!(told["kept_edges"].is_null(), "{told}");
    assert!(kept < 0.7 * round, "{kept} {round}");
}

#[test]
fn a_mask_and_a_colour_keep_parts_of_a_mesh_and_the_page_shows_how_far_the_others_went() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mesh = noisy_ball();
    let right = |x: [f64; 3]| x[0] > 1.0;
    let mut lines: Vec<String> = Vec::new();
    for x in &mesh.vertices {
        let [r, g] = if right(*x) { [1, 0] } else { [0, 1] };
        lines.push(format!("v {} {} {} {r} {g} 0", x[0], x[1], x[2]));
    }
    for face in &mesh.faces {
        let [a, b, c] = face.map(|v| v + 1);
        lines.push(format!("f {a} {b} {c}"));
    }
    fs::write(at("ball.obj"), lines.join("\n")).unwrap();
    let mut half = TriangleMesh::default();
    let cube = |k: usize, axis: usize| f64::from(u8::from(k >> axis & 1 == 1));
    half.vertices = (0..8)
        .map(|k| {
            [
                1.0 + 5.0 * cube(k, 0),
                10.0 * cube(k, 1) - 5.0,
                10.0 * cube(k, 2) - 5.0,
            ]
        })
        .collect();
    half.faces = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
    ]
    .into_iter()
    .chain([
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ])
    .collect();
    surfaces::write(at("half.stl"), &half).unwrap();
    for (keep, name) in [("half.stl", "mask"), ("colour:ff0000", "colour")] {
        let fair = [
            "fair", "ball.obj", "--cells", "40", "--steps", "2", "--noise", "0.03",
        ];
        let kept = ["--keep", keep, "--output", name];
        outcome(folder.path(), &[&fair[..], &kept].concat());
        let count = moved(&mesh, &at(name).join("final.obj"), right);
        assert!(count > mesh.vertices.len() / 3, "{name}: {count}");
        let html = fs::read_to_string(at(name).join("index.html")).unwrap();
        assert!(
            html.contains("How far the surface has gone at its vertices"),
            "{name}"
        );
        let svg = fs::read_to_string(at(name).join("final.displacement.svg")).unwrap();
        assert!(svg.contains("in the units of the mesh"), "{name}");
    }
    // The mask is in the folder: it takes nothing else to go on.
    fs::remove_file(at("half.stl")).unwrap();
    outcome(folder.path(), &["resume", "mask", "--steps", "3"]);
    moved(&mesh, &at("mask/final.obj"), right);
    for (keep, reason) in [
        ("colour:red", "six hexadecimal digits"),
        ("colour:0000ff", "contains no vertex"),
        ("missing.ply", "could not read"),
        ("ball.obj", "contains all of the mesh"),
    ] {
        let refused = run(folder.path(), &["fair", "ball.obj", "--keep", keep]);
        let said = text(&refused.stderr);
        assert!(
            !refused.status.success() && said.contains(reason),
            "{keep}: {said}"
        );
    }
}

/// An octahedron with whole numbers, which are no places to move to.
/// Its flow begins away from the sides of the box, so that it has the energy of a ball.
#[test]
fn a_mesh_has_the_volume_to_which_the_flow_has_gone() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    surfaces::write(at("ball.obj"), &noisy_ball()).unwrap();
    let target = ["--volume", "95%", "--ramp", "2", "--steps", "3"];
    let files = ["--cells", "32", "--save", "out.obj"];
    let ended = outcome(
        folder.path(),
        &[&["fair", "ball.obj"][..], &target, &files].concat(),
    );
    let number = |name: &str| ended[name].as_f64().unwrap();
    let (closed, _) = ClosedMesh::new(surfaces::read(at("out.obj")).unwrap()).unwrap();
    let off = closed.volume() / number("volume") - 1.0;
    assert!(off.abs() < 1e-6, "{off:e}");
    assert!((number("energy_over_8_pi") - 1.0).abs() < 0.05, "{ended}");
}

#[test]
fn coordinates_that_cannot_change_are_refused_before_the_flow() {
    let folder = tempfile::tempdir().unwrap();
    let octahedron = "ply\nformat ascii 1.0\nelement vertex 6\n\
         property int x\nproperty int y\nproperty int z\n\
         element face 8\nproperty list uchar int vertex_indices\nend_header\n\
         9 0 0\n-9 0 0\n0 9 0\n0 -9 0\n0 0 9\n0 0 -9\n\
         3 0 2 4\n3 2 1 4\n3 1 3 4\n3 3 0 4\n3 2 0 5\n3 1 2 5\n3 3 1 5\n3 0 3 5\n";
    fs::write(folder.path().join("whole.ply"), octahedron).unwrap();
    let fair = ["fair", "whole.ply", "--cells", "32", "--steps", "1"];
    let refused = run(folder.path(), &fair);
    let said = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(
        said.contains("float or double; write it anew") && said.contains("--remesh"),
        "{said}"
    );
    assert!(!folder.path().join("runs").exists());
    outcome(
        folder.path(),
        &["sample", "whole.ply", "--save", "real.ply"],
    );
    outcome(
        folder.path(),
        &[&["fair", "real.ply"][..], &fair[2..]].concat(),
    );
}

#[test]
fn meshes_and_pictures_go_through_pipes() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (shape, file) in [
        ("sphere", "in.ply"),
        ("sphere", "in.stl"),
        ("sphere", "in.off"),
        ("disc", "in.png"),
    ] {
        let shape = format!("builtin:{shape}");
        let sample = ["sample", &shape, "--cells", "32", "--save", file];
        outcome(folder.path(), &sample);
        let flow = ["flow", "-", "--cells", "32", "--steps", "1", "--save", "-"];
        let piped = program(folder.path())
            .args(flow)
            .args(["--output", &format!("run-{file}")])
            .stdin(File::open(at(file)).unwrap())
            .output()
            .unwrap();
        assert!(piped.status.success(), "{file}: {}", text(&piped.stderr));
        if file == "in.png" {
            assert!(piped.stdout.starts_with(b"\x89PNG"));
        } else {
            let mesh = surfaces::decode(&piped.stdout, file).unwrap();
            assert!(mesh.faces.len() > 100, "{file}");
        }
    }
    let input = fs::read_to_string(at("run-in.stl/config.toml")).unwrap();
    let input = input.lines().find_map(|line| line.strip_prefix("input = "));
    let input = PathBuf::from(input.unwrap().trim_matches('"'));
    assert!(!input.parent().unwrap().exists(), "{}", input.display());
    let stored = fs::read_to_string(at("run-in.ply/config.toml")).unwrap();
    assert!(!stored.contains("save"), "{stored}");
    let check = program(folder.path())
        .args(["check", "-", "--cells", "32"])
        .stdin(File::open(at("in.png")).unwrap())
        .output()
        .unwrap();
    assert!(check.status.success(), "{}", text(&check.stderr));
    let json = run(folder.path(), &["flow", "in.ply", "--save", "-"]);
    assert!(text(&json.stderr).contains("--json and --save -"));
    let vanishing = [
        "mcf",
        "builtin:disc",
        "--side-length",
        "0.4",
        "--steps",
        "500",
    ];
    let vanished = program(folder.path())
        .args(vanishing)
        .args(["--cells", "32", "--save", "-"])
        .output()
        .unwrap();
    let error = text(&vanished.stderr);
    assert_eq!(vanished.status.code(), Some(2), "{error}");
    assert!(
        error.contains("nothing is written to standard output"),
        "{error}"
    );
    let empty = run(folder.path(), &["flow", "-"]);
    assert!(text(&empty.stderr).contains("standard input is empty"));
    fs::write(at("open.off"), "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").unwrap();
    fs::write(at("words.txt"), "no mesh\n").unwrap();
    for (file, expected) in [
        (
            "words.txt",
            "error: standard input cannot be read as a mesh: the file has 0 vertices and no faces",
        ),
        ("open.off", "error: all vertices are at the boundary"),
    ] {
        let refused = program(folder.path())
            .args(["fair", "-"])
            .stdin(File::open(at(file)).unwrap())
            .output()
            .unwrap();
        let error = text(&refused.stderr);
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn fields_are_taken_to_other_grids() {
    let folder = tempfile::tempdir().unwrap();
    let grid = Grid::<2>::centred(48, 1.0).unwrap();
    let disc = Ball::new([0.1, 0.0], 0.3).unwrap();
    let u = phase_field(grid, &disc, 2.0 * grid.spacing()).unwrap();
    npy::write(folder.path().join("disc.npy"), &u).unwrap();
    for cells in ["32", "96"] {
        let sample = ["sample", "disc.npy", "--box-side", "1", "--cells", cells];
        outcome(
            folder.path(),
            &[&sample[..], &["--save", "fine.npy", "--force"]].concat(),
        );
        let fine = npy::read(folder.path().join("fine.npy"), |n| {
            Grid::<2>::centred(n, 1.0)
        });
        let fine = fine.unwrap();
        let count: usize = cells.parse().unwrap();
        assert_eq!(fine.grid().cells(), count);
        let exact = phase_field(*fine.grid(), &disc, 2.0 * fine.grid().spacing()).unwrap();
        let pairs = fine.values().iter().zip(exact.values());
        let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.05, "{cells}: {off}");
    }
    let few = run(folder.path(), &["flow", "disc.npy", "--cells", "2"]);
    assert!(text(&few.stderr).contains("--cells 2 resolves nothing"));
}

/// Names of files are bytes, which messages show as well as they can.
#[cfg(target_os = "linux")]
#[test]
fn names_that_are_no_text_are_names() {
    use std::ffi::OsString;
    use std::os::unix::ffi::OsStringExt;
    let folder = tempfile::tempdir().unwrap();
    let named = |before: &str, after: &str| {
        let bytes = [before.as_bytes(), b"caf\xe9", after.as_bytes()].concat();
        OsString::from_vec(bytes)
    };
    let run = |arguments: &[OsString]| {
        let output = program(folder.path()).args(arguments).output().unwrap();
        (output.status.code(), text(&output.stderr))
    };
    let typed = |text: &str| -> Vec<OsString> { text.split(' ').map(Into::into).collect() };
    let (mesh, moved, output) = (named("", ".ply"), named("", "-2.ply"), named("", "-run"));
    let keep = named("keep-", ".ply");
    let mut sample = typed("sample builtin:sphere --cells 24 --save");
    sample.push(mesh.clone());
    assert_eq!(run(&sample), (Some(0), String::new()));
    let mut sample = typed("sample ball:0.2,0,0,0.1 --cells 24 --save");
    sample.push(keep.clone());
    assert_eq!(run(&sample), (Some(0), String::new()));
    let mut fair = typed("fair --cells 24 --noise 0.01 --steps 1 --quiet --save");
    fair.extend([
        moved.clone(),
        "--output".into(),
        output.clone(),
        "--keep".into(),
        keep,
        mesh,
    ]);
    assert_eq!(run(&fair), (Some(0), String::new()));
    let saved = fs::read(folder.path().join(&moved)).unwrap();
    assert!(saved.starts_with(b"ply"));
    fs::remove_file(folder.path().join(&moved)).unwrap();
    let mut resume = typed("resume --steps 2 --quiet");
    resume.push(output);
    assert_eq!(run(&resume), (Some(0), String::new()));
    assert!(folder.path().join(&moved).exists());
    let mut missing = typed("flow");
    missing.push(named("no", ".ply"));
    let (code, error) = run(&missing);
    assert_eq!(code, Some(2));
    assert!(error.contains("nocaf\u{fffd}.ply: No such file"), "{error}");
}
