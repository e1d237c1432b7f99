//! Whatever is wrong is said in one line on standard error, with exit code 2.

use crate::common::{self, run, text};

/// An array of 2 x 3 zeros.
fn plane() -> Vec<u8> {
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }";
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{header:117}\n").bytes());
    bytes.extend([0; 48]);
    bytes
}

#[test]
fn every_mistake_is_one_clear_line() {
    let folder = tempfile::tempdir().unwrap();
    let write =
        |name: &str, content: &[u8]| std::fs::write(folder.path().join(name), content).unwrap();
    write("broken.png", b"no image");
    write("broken.ply", b"ply\nformat ascii 1.0\n");
    write("open.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n");
    write("broken.npy", b"no array");
    write("final.vti", b"<VTKFile");
    write("plane.npy", &plane());
    write("notes.txt", b"");
    write("net.safetensors", b"no network");
    write("syntax.toml", b"steps = 3\ncells = = 4\n");
    write("unknown.toml", b"stepz = 3\n");
    write("type.toml", b"steps = [3]\n");
    write("value.toml", b"steps = \"many\"\n");
    write("other.toml", b"command = \"mcf\"\nsteps = 3\n");
    let simplex = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    write("simplex.obj", simplex.as_bytes());
    let white = render::Picture::new([8, 8], vec![[255; 4]; 64]).unwrap();
    white.write_png(folder.path().join("white.png")).unwrap();
    let is_black =
        |pixel: usize| (8..24).contains(&(pixel % 32)) && (8..24).contains(&(pixel / 32));
    let pixels = (0..1024).map(|pixel| {
        let tone = if is_black(pixel) { 0 } else { 255 };
        [tone, tone, tone, 255]
    });
    let square = render::Picture::new([32, 32], pixels.collect()).unwrap();
    square.write_png(folder.path().join("square.png")).unwrap();
    std::fs::create_dir(folder.path().join("full")).unwrap();
    write("full/mine", b"");
    std::fs::create_dir(folder.path().join("old")).unwrap();
    write("old/index.json", b"{}");
    let table: &[(&[&str], &str)] = &[
        (&[], "there is no command"),
        (&["flaw"], "unrecognized subcommand 'flaw'"),
        (&["flow"], "there is no input"),
        (
            &["flow", "builtin:teapot"],
            "there is no built-in shape \"teapot\"; there are disc, ",
        ),
        (&["flow", "missing.obj"], "missing.obj"),
        (
            &[
                "fair",
                "simplex.obj",
                "--keep",
                "ball:0,0,0,1",
                "--keep=ball:1,1,1,1",
            ],
            "--keep is given twice",
        ),
        (
            &["inpaint", "square.png", "--mask", "box:40,40,50,50"],
            "square.png: nothing would be drawn",
        ),
        (&["flow", "missing.png"], "missing.png"),
        (&["flow", "missing.npy"], "missing.npy"),
        (&["flow", "notes.txt"], "is no input: give a mesh"),
        (&["flow", "broken.png"], "broken.png"),
        (&["flow", "broken.ply"], "broken.ply"),
        (&["flow", "open.obj"], "close the holes"),
        (&["flow", "broken.npy"], "not an NPY file"),
        (
            &["flow", "final.vti"],
            "is not read: give the same values as .npy",
        ),
        (
            &["flow", "white.png", "--inside", "dark"],
            "nothing is inside",
        ),
        (
            &["flow", "builtin:disc", "--bogus"],
            "unexpected argument '--bogus'",
        ),
        (
            &["flow", "builtin:disc", "--cells", "many"],
            "invalid value 'many' for '--cells <N>'",
        ),
        (
            &["flow", "builtin:disc", "--cells", "4"],
            "--cells 4 resolves nothing",
        ),
        (
            &[
                "flow",
                "builtin:disc",
                "--cells",
                "10",
                "--box-side",
                "0.33",
            ],
            "0.33",
        ),
        (
            &[
                "mcf",
                "builtin:disc",
                "--box-side",
                "1e6",
                "--cells",
                "1000",
            ],
            "makes 1.0e18 nodes",
        ),
        (&["flow", "plane.npy"], "but all its sides must be equal"),
        (
            &["flow", "builtin:disc", "--side-length", "3"],
            "--side-length 3 does not fit the box of side 2",
        ),
        (
            &["flow", "builtin:cube", "--side-length", "1"],
            "give a positive length of at most 0.9375",
        ),
        (
            &["flow", "builtin:disc", "--cells", "-5"],
            "it must be a whole number, not negative",
        ),
        (&["flow", "builtin:disc", "--box-side=-1"], "side"),
        (
            &["flow", "builtin:disc", "--reduced-volume", "1.2"],
            "a reduced volume of 1.2 is not possible: a ball has 1",
        ),
        (
            &[
                "flow",
                "builtin:disc",
                "--reduced-volume",
                "0.8",
                "--length",
                "keep",
            ],
            "cannot be used with",
        ),
        (
            &["flow", "builtin:disc", "--volume", "100"],
            "a volume of 100 does not fit a box of volume 4",
        ),
        (
            &["flow", "builtin:disc", "--area", "keep", "--length", "80%"],
            "above 1; the perimeter has to be at least",
        ),
        (
            &["flow", "builtin:disc", "--volume", "keep", "--area", "keep"],
            "in the plane --volume is another word for --area",
        ),
        (
            &["flow", "builtin:cube", "--length", "keep"],
            "--length has no meaning for a surface in space",
        ),
        (
            &["flow", "builtin:disc", "--volume=-3%"],
            "is no positive number; give keep, a value, or a part",
        ),
        (
            &["flow", "builtin:disc", "--tension", "nan"],
            "'--tension <SIGMA>': it must be a finite number",
        ),
        (
            &["flow", "builtin:disc", "--steps", "0"],
            "'--steps <COUNT>': it must be at least 1",
        ),
        (
            &["flow", "builtin:disc", "--frames", "0"],
            "'--frames <EVERY>': it must be at least 1",
        ),
        (
            &["flow", "builtin:disc", "--checkpoint-every", "0"],
            "'--checkpoint-every <STEPS>': it must be at least 1",
        ),
        (
            &["flow", "builtin:disc", "--time", "0"],
            "'0' for '--time <T>': it must be positive",
        ),
        (
            &["flow", "builtin:disc", "--energy", "nan"],
            "'nan' for '--energy <W>': it must be positive",
        ),
        (
            &["flow", "builtin:disc", "--tau", "fast"],
            "\"fast\" is no positive number",
        ),
        (
            &["flow", "builtin:disc", "--tau", "halving:1"],
            "\"halving:1\" is no rule",
        ),
        (
            &["flow", "builtin:disc", "--tau", "ramp:1"],
            "\"ramp:1\" is no rule",
        ),
        (
            &["flow", "builtin:disc", "--scheme", "best"],
            "accurate, calibrated, paper",
        ),
        (
            &["flow", "builtin:disc", "--eps-over-h", "3"],
            "willmore train --dimension 2 --width 25 --eps-over-h 3 --step-over-h2 2.25",
        ),
        (
            &["flow", "builtin:cube", "--eps-over-h", "4"],
            "willmore train --dimension 3",
        ),
        (
            &["flow", "builtin:disc", "--eps-over-h", "0"],
            "--eps-over-h 0 is not possible",
        ),
        (
            &["flow", "builtin:disc", "--network", "missing.safetensors"],
            "missing.safetensors",
        ),
        (
            &["flow", "builtin:disc", "--network", "net.safetensors"],
            "net.safetensors",
        ),
        (&["flow", "builtin:disc", "--device", "abacus"], "abacus"),
        (
            &["flow", "builtin:disc", "--inside", "dark"],
            "--inside has no meaning for a built-in shape",
        ),
        (
            &["flow", "white.png", "--field-kind", "distance"],
            "--field-kind has no meaning for an image",
        ),
        (
            &["flow", "broken.npy", "--side-length", "1"],
            "--side-length has no meaning for a field",
        ),
        (&["flow", "builtin:disc", "--output", "full"], "holds mine"),
        (
            &["flow", "--config", "missing.toml"],
            "could not read missing.toml",
        ),
        (
            &["flow", "builtin:disc", "--config", "syntax.toml"],
            "syntax.toml: line 2",
        ),
        (
            &["flow", "builtin:disc", "--config", "unknown.toml"],
            "unknown.toml: unexpected argument '--stepz'",
        ),
        (
            &["flow", "builtin:disc", "--config", "type.toml"],
            "type.toml: steps must be a number",
        ),
        (
            &["flow", "builtin:disc", "--config", "value.toml"],
            "value.toml: invalid value 'many'",
        ),
        (
            &["flow", "builtin:disc", "--config", "other.toml"],
            "other.toml: it is for the command \"mcf\"",
        ),
        (&["fair"], "there is no input"),
        (
            &["fair", "simplex.obj", "--noise", "0.01", "--volume", "90%"],
            "the volume stays where noise is taken off",
        ),
        (
            &["fair", "builtin:sphere"],
            "say how smooth the surface is to become",
        ),
        (
            &["fair", "builtin:sphere", "--energy", "26"],
            "nothing of the shape would be left",
        ),
        (
            &["fair", "builtin:sphere", "--energy-ratio", "2"],
            "reached before the first step",
        ),
        (
            &["fair", "builtin:sphere", "--noise", "-1"],
            "'-1' for '--noise <LENGTH>': it must be positive",
        ),
        (
            &["fair", "builtin:disc", "--steps", "1"],
            "`fair` is for surfaces in space",
        ),
        (
            &["fair", "builtin:sphere", "--steps", "1", "--save", "a.png"],
            "a result in 3D is saved as .ply or .obj or .stl",
        ),
        (
            &[
                "fair",
                "builtin:sphere",
                "--steps",
                "1",
                "--save",
                "no/a.ply",
            ],
            "there is no such folder",
        ),
        (
            &["fair", "builtin:sphere", "--steps", "1", "--format", "step"],
            "ply, obj, stl",
        ),
        (&["inpaint", "builtin:disc"], "say which region to fill"),
        (
            &["inpaint", "builtin:disc", "--mask", "box:0,0,1"],
            "has 3 numbers, and a box in 2D has 4",
        ),
        (
            &["inpaint", "builtin:disc", "--mask", "box:1,1,0,0"],
            "is empty: give the lower corner first",
        ),
        (
            &["inpaint", "builtin:disc", "--mask", "ball:5,5,0.1"],
            "contains no node",
        ),
        (
            &["inpaint", "builtin:disc", "--mask", "ball:0,0,x"],
            "is no finite number",
        ),
        (
            &["inpaint", "builtin:cube", "--mask", "white.png"],
            "is no region in 3D",
        ),
        (
            &["inpaint", "builtin:disc", "--mask", "missing.png"],
            "missing.png",
        ),
        (
            &[
                "inpaint",
                "builtin:disc",
                "--mask",
                "ball:0,0,1",
                "--ansatz",
                "star",
            ],
            "is no ansatz",
        ),
        (
            &["mcf", "builtin:disc", "--method", "magic"],
            "network, fe-implicit, fe-semi",
        ),
        (
            &[
                "mcf",
                "builtin:disc",
                "--method",
                "fe-semi",
                "--scheme",
                "paper",
            ],
            "no meaning for finite elements",
        ),
        (
            &["mcf", "builtin:disc", "--tau", "1"],
            "unexpected argument '--tau'",
        ),
        (
            &["flow", "builtin:disc", "--up", "z"],
            "--up z has no meaning for a shape in the plane",
        ),
        (
            &["flow", "builtin:cube", "--up", "w"],
            "\"w\" is no axis: choose x, y or z",
        ),
        (&["resume", "old"], "format version 1"),
        (&["resume", "missing"], "missing"),
        (&["resume", "full"], "holds no run"),
        (
            &["networks", "show", "none"],
            "there is no network \"none\"",
        ),
        (&["networks", "show", "net.safetensors"], "net.safetensors"),
        (&["check"], "there is no input"),
        (&["sample", "builtin:disc"], "not provided: --save <FILE>"),
        (
            &["sample", "builtin:disc", "--save", "a.jpg"],
            "must end in .png, .svg, .ply, .obj, .stl, .npy, .vti, .nii or .nii.gz",
        ),
        (
            &["sample", "builtin:disc", "--save", "a.ply"],
            "a result in 2D is saved as .png or .svg",
        ),
        (
            &["sample", "builtin:disc", "--save", "white.png"],
            "is there already",
        ),
        (
            &[
                "sample",
                "builtin:disc",
                "--save",
                "a.png",
                "--noise",
                "0.1",
            ],
            "--noise moves the vertices of meshes",
        ),
        (
            &["sample", "builtin:cube", "--save", "a.ply", "--noise=-1"],
            "--noise -1 must not be negative",
        ),
        (
            &[
                "sample",
                "builtin:disc",
                "--save",
                "a.png",
                "--without",
                "ball:0,0,1",
            ],
            "the shape that --without leaves has 0 of",
        ),
        (
            &["sample", "box:0,0,1", "--save", "a.png"],
            "has 3 numbers, and a box in 2D has 4",
        ),
        (
            &["flow", "ball:0,0,0.5", "--side-length", "1"],
            "--side-length has no meaning for a region",
        ),
        (&["train"], "train needs --eps-over-h"),
        (
            &[
                "train",
                "--dimension",
                "2",
                "--width",
                "8",
                "--eps-over-h",
                "1",
                "--save",
                "a.safetensors",
            ],
            "must be odd",
        ),
        (
            &[
                "train",
                "--dimension",
                "2",
                "--width",
                "9",
                "--eps-over-h",
                "1",
                "--save",
                "notes.txt",
            ],
            "is there already",
        ),
    ];
    for (arguments, expected) in table {
        let mut all = arguments.to_vec();
        // Nothing may be left behind, wherever a run would have been.
        if all.len() > 1
            && !all.contains(&"--output")
            && ["flow", "fair", "inpaint", "mcf"].contains(&all[0])
        {
            all.extend(["--output", "run"]);
        }
        let output = if all.is_empty() {
            common::program(folder.path()).output().unwrap()
        } else {
            run(folder.path(), &all)
        };
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(
            stderr.starts_with("error: ") && stderr.lines().count() == 1,
            "{arguments:?}: {stderr}"
        );
        assert!(stderr.contains(expected), "{arguments:?}: {stderr}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert!(
            !folder.path().join("run").exists(),
            "{arguments:?} left something behind"
        );
    }
}

/// A whole grid of this size takes 291 GB, which is said before the distances from the mesh, and not after them.
#[cfg(target_os = "linux")]
#[test]
fn what_does_not_fit_into_memory_is_refused_before_it_takes_long() {
    if operators::memory::available().is_some_and(|bytes| bytes > 290e9) {
        return common::skip("a refusal", "there is memory for it");
    }
    let folder = tempfile::tempdir().unwrap();
    let arguments = "flow builtin:figure --cells 990 --storage dense --output run";
    let arguments: Vec<&str> = arguments.split(' ').collect();
    let clock = std::time::Instant::now();
    let output = run(folder.path(), &arguments);
    // The distances take minutes.
    assert!(clock.elapsed().as_secs() < 20);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("needs about 291.1 GB of memory"),
        "{stderr}"
    );
    assert!(stderr.contains("or bricks near the surface"), "{stderr}");
    assert!(!folder.path().join("run").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn an_outcome_that_cannot_be_printed_is_a_failure() {
    let folder = tempfile::tempdir().unwrap();
    let full = std::fs::File::options().write(true).open("/dev/full");
    let mut command = common::program(folder.path());
    let output = command.args(["info", "--json"]).stdout(full.unwrap());
    let output = output.output().unwrap();
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(
        stderr.contains("could not write standard output"),
        "{stderr}"
    );
}

#[test]
fn help_has_examples_and_exit_codes() {
    let folder = tempfile::tempdir().unwrap();
    let help = |arguments: &[&str]| {
        let output = common::program(folder.path())
            .args(arguments)
            .arg("--help")
            .output()
            .unwrap();
        assert!(output.status.success());
        text(&output.stdout)
    };
    assert!(help(&[]).contains("130 interrupted"));
    let commands = [
        "flow",
        "resume",
        "fair",
        "inpaint",
        "mcf",
        "sample",
        "networks",
        "info",
        "check",
        "train",
        "completions",
        "man",
    ];
    for command in commands {
        assert!(
            help(&[command]).contains(&format!("willmore {command}")),
            "{command}"
        );
        assert!(help(&[command]).contains("Example"), "{command}");
    }
}
