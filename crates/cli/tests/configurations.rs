//! Damaged and malicious configurations.

use std::path::Path;

use clap::CommandFactory;
use fuzzing::{CountingAllocator, Fuzz, Limit, assert_short_line, peak_of};

use jobs::settings::{job, resolved};
use jobs::{FairOptions, FlowOptions, InpaintOptions, McfOptions};

use super::{LONGEST, parse_both};
use crate::cli::{Cli, Command, RunCommand};
use crate::error::Error;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// As documented in the module.
const LIMIT: Limit = Limit {
    times: 0,
    plus: 16 << 20,
};

const PATH: &str = "some/config.toml";

const FLOW: &str = "command = \"flow\"\ninput = \"builtin:cube\"\ncells = 64\nbox-side = 1.0\n\
                    side-length = 6e-1\nsteps = 12\ntau = \"doubling:1e-6\"\nno-page = true\n# the end\n";
const INPAINT: &str = "command = 'inpaint'\n\"input\" = 'a b.png'\nmask = \"\"\"box:0.2,0.2,0.9,0.9\"\"\"\n\
                       threshold = 0.25\ninside = \"dark\"\ntime = 1_000.5\ncells = 0x40\n";
const FAIR: &str = "command = \"fair\"\ninput = \"\\u00e9.stl\"\nenergy = 26\nsave = \"b.stl\"\n";
const MCF: &str = "command = \"mcf\"\ninput = \"c.npy\"\nmethod = \"fe-implicit\"\nframes = 4\n";

/// A resolved configuration, as text: the options have no other way to be compared.
fn text(cli: &Cli) -> Option<String> {
    let Command::Run(command) = &cli.command else {
        return None;
    };
    resolved(&command.clone().job()).ok()
}

fn utf8(bytes: &[u8]) -> Result<&str, Error> {
    std::str::from_utf8(bytes).map_err(|error| Error::options(error.to_string()))
}

fn configurations(name: &'static str) -> Fuzz<'static> {
    Fuzz::new(name, LIMIT)
        .starts(["command = ", "command = \"flow\"\n", "["])
        .words([
            "command = ",
            "input = ",
            "config = \"a\"\n",
            "help = true\n",
            "steps = ",
            "tau = ",
            "device = ",
            "network = ",
            "\"--help\"",
            "'-'",
            "true",
            "false",
            "nan",
            "-inf",
            "1979-05-27T07:32:00Z",
            "[a]\n",
            "[[a]]\n",
            "a.b = 1\n",
            "\"\"\"",
            "'''",
            "\\u0000",
            "\\",
            "\n",
            "=",
            "#",
            ",",
            "[",
            "]",
            "{a=",
            "}",
            "\"",
            "a.",
            "[a.b]\n",
        ])
}

/// What was accepted is stored as what gives the same again.
#[test]
fn resolved_configurations() {
    let read = |bytes: &[u8]| Ok::<_, Error>(job(utf8(bytes)?, Path::new(PATH))?);
    configurations("resolved configurations")
        .valid([FLOW, INPAINT, FAIR, MCF].map(|text| text.as_bytes().to_vec()))
        .run(read, |_, read| {
            let stored = resolved(&read).unwrap();
            let again = job(&stored, Path::new(PATH)).unwrap();
            assert_eq!(resolved(&again).unwrap(), stored);
        });
}

/// What is stored of an option is read as what it was, however large a number is.
#[test]
fn the_largest_numbers_come_back() {
    let program = Cli::command();
    let mut read = Vec::new();
    for command in ["flow", "fair", "inpaint", "mcf"] {
        let options = program.find_subcommand(command).unwrap().get_arguments();
        for name in options.filter_map(clap::Arg::get_long) {
            let named = [(name, Some(u64::MAX.to_string()))];
            let Ok(typed) = jobs::Job::of_named(command, named) else {
                continue;
            };
            let stored = resolved(&typed).unwrap();
            let again = job(&stored, Path::new(PATH)).unwrap();
            assert_eq!(resolved(&again).unwrap(), stored);
            read.push(name);
        }
    }
    // Numbers of TOML end at 2^63 - 1.
    for name in [
        "cells",
        "checkpoint-every",
        "frame",
        "frames",
        "ramp",
        "seed",
        "steps",
    ] {
        assert!(read.contains(&name), "{name}: {read:?}");
    }
}

/// The defaults of the library are those of the program.
#[test]
fn defaults_are_those_of_the_library() {
    let typed = |command: &str| {
        let arguments = ["willmore", command, "a.ply"].map(Into::into);
        let cli = crate::config::parse(&arguments);
        text(&cli.unwrap()).unwrap()
    };
    for (of_library, name) in [
        (jobs::Job::Flow(FlowOptions::of("a.ply")), "flow"),
        (jobs::Job::Fair(FairOptions::of("a.ply")), "fair"),
        (jobs::Job::Mcf(McfOptions::of("a.ply")), "mcf"),
    ] {
        assert_eq!(resolved(&of_library).unwrap(), typed(name));
    }
    let inpainting = jobs::Job::Inpaint(InpaintOptions::of("a.ply", "m.png"));
    let masked = resolved(&inpainting).unwrap();
    assert_eq!(masked.replace("mask = \"m.png\"\n", ""), typed("inpaint"));
}

/// Together with options that were typed.
#[test]
fn named_configurations() {
    let arguments = [
        "willmore", "flow", "--config", PATH, "a.ply", "--steps", "3",
    ];
    let arguments = arguments.map(Into::into);
    let matches = Cli::command().try_get_matches_from(&arguments).unwrap();
    let (command, typed) = matches.subcommand().unwrap();
    let read = |bytes: &[u8]| parse_both(&arguments, command, typed, utf8(bytes)?, Path::new(PATH));
    configurations("named configurations")
        .valid([FLOW.as_bytes().to_vec()])
        .run(read, |_, cli| {
            let Command::Run(RunCommand::Flow(flow)) = &cli.command else {
                panic!("{cli:?}");
            };
            let input = flow.options.input.input.as_ref();
            assert_eq!(input.map(jobs::Input::name), Some("a.ply"));
        });
}

/// Files that make the most of every byte.
#[test]
fn the_worst_files_stay_within_the_limit() {
    let keys = (0..5000)
        .map(|k| format!("k{k}=true\n"))
        .collect::<Vec<_>>()
        .concat();
    for worst in [
        "a=[".to_owned() + &"0,".repeat(32_000) + "]",
        "a=[".to_owned() + &"{},".repeat(21_000) + "]",
        "a=".to_owned() + &"[".repeat(65_000),
        "a.".repeat(32_000) + "b=1",
        "[[a]]\n".repeat(10_000),
        "[a".to_owned() + &".a".repeat(32_000) + "]",
        keys,
        "\n".repeat(65_000),
        "cells=".to_owned() + &"9".repeat(65_000),
        "input=\"".to_owned() + &"x".repeat(65_000) + "\"",
        "x".repeat(65_000) + "=1",
    ] {
        let file = format!("command = \"flow\"\n{worst}");
        let (result, peak) = peak_of(|| job(&file, Path::new(PATH)));
        println!("{} bytes: {peak}", file.len());
        if let Err(error) = &result {
            assert_short_line(error);
        }
        assert!(peak <= LIMIT.plus, "{peak}: {:?}", &worst[..20]);
    }
    let long = format!("command = \"flow\"\n{}", "#".repeat(LONGEST));
    let message = job(&long, Path::new(PATH)).unwrap_err();
    assert_eq!(
        message.to_string(),
        format!("{PATH}: a configuration has at most 65536 bytes")
    );
}

#[test]
fn what_is_no_option_is_refused() {
    for (line, expected) in [
        ("help = true", "\"help\" is no option"),
        ("version = true", "\"version\" is no option"),
        ("\"steps=3\" = true", "\"steps=3\" is no option"),
        ("\"\" = 1", "\"\" is no option"),
        ("input = 3", "input must be a text"),
    ] {
        let text = format!("command = \"flow\"\n{line}\n");
        let message = job(&text, Path::new(PATH)).unwrap_err();
        assert_eq!(message.to_string(), format!("{PATH}: {expected}"));
    }
    let message = job("command = \"--help\"", Path::new(PATH)).unwrap_err();
    assert_eq!(
        message.to_string(),
        format!("{PATH}: \"--help\" is no command")
    );
}
