"""Tables: what they become, and the lines about their errors."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from conftest import WORKFLOW
from sweeps import tables

HEADER = "run\tcommand\tinput\tcells\ttolerance\tnoise\n"


@pytest.fixture
def sweep_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text("runs: config/runs.tsv\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def lines(folder: Path, expected: int = 2) -> list[str]:
    """What the check of a sweep prints."""
    done = subprocess.run([sys.executable, WORKFLOW / "scripts/check.py", "config/config.yaml"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == expected, done.stderr
    return done.stderr.splitlines()


@pytest.mark.parametrize(
    ("row", "line"),
    [
        (
            "a\tflow\tbuiltin:cross\tthirty",
            'row 2 (a), column cells: "thirty" is not a whole number of cells, such as 64; correct it, or leave the cell empty',
        ),
        (
            "a\tflow\tbuiltin:cross\t-3",
            'row 2 (a), column cells: "-3" is not a whole number of cells, such as 64; correct it, or leave the cell empty',
        ),
        (
            "a\tflow\tbuiltin:cross\t32\t1.5 %",
            'row 2 (a), column tolerance: "1.5 %" is not a length or a percentage, such as 1.5%; correct it, or leave the cell empty',
        ),
        (
            "a\tflow\tbuiltin:cross\t32\t\t0.1",
            "row 2 (a), column noise: the command flow has no such option; leave the cell empty, or take the command fair",
        ),
        ("a\tflo\tbuiltin:cross", 'row 2 (a), column command: "flo" is not one of the commands flow, fair, inpaint and mcf; correct it'),
        ("a\tflow", "row 2 (a), column input: the cell is empty; give a file, a built-in shape or a region, such as builtin:cross"),
        ("a b\tflow\tbuiltin:cross", 'row 2 (a b), column run: "a b" is not a name of letters, digits and . _ = + -; correct it'),
        ("a\tflow\tscans/a.ply", "row 2 (a), column input: there is no file scans/a.ply; correct its path, which begins at the folder of the sweep"),
        ("a\tflow\tbuiltin:cross\t32\t\t\t7", "row 2: 7 cells, but the header has 6 columns; remove a tab, or name the column"),
    ],
)
def test_an_error_names_row_and_column_and_what_to_do(sweep_folder: Path, row: str, line: str):
    (sweep_folder / "config/runs.tsv").write_text(HEADER + row + "\n")
    assert lines(sweep_folder) == [f"config/runs.tsv, {line}"]


def test_all_errors_are_told_at_once_and_rows_are_those_of_the_file(sweep_folder: Path):
    text = HEADER + "# a comment\n\na\tflow\tbuiltin:cross\tx\nb\tflow\tbuiltin:cross\t32\ny\tfair\tscans/a.ply\t32\n"
    (sweep_folder / "config/runs.tsv").write_text(text)
    found = lines(sweep_folder)
    assert [line.split(",")[1] for line in found] == [" row 4 (a)", " row 6 (y)"]


def test_columns_with_a_wrong_name(sweep_folder: Path):
    (sweep_folder / "config/runs.tsv").write_text("run\tcommand\tinput\tcels\na\tflow\tbuiltin:cross\t32\n")
    assert lines(sweep_folder) == ["config/runs.tsv, row 2 (a), column cels: there is no such option; a similar one is cells"]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "config/runs.tsv: the table has no rows; add one below the header"),
        ("run command input\n", "config/runs.tsv, row 1: the header has no tab; separate columns by tabs"),
        ("run\trun\n", "config/runs.tsv, row 1, column run: two columns have this name; remove one"),
        ("run\t\tinput\n", "config/runs.tsv, row 1: column 2 has no name; name it, or remove it"),
    ],
)
def test_a_wrong_header(sweep_folder: Path, text: str, line: str):
    (sweep_folder / "config/runs.tsv").write_text(text)
    assert lines(sweep_folder) == [line]


def test_names_of_runs_are_unique(sweep_folder: Path):
    (sweep_folder / "config/runs.tsv").write_text(HEADER + 2 * "a\tflow\tbuiltin:cross\n")
    assert lines(sweep_folder) == ["config/runs.tsv, column run: two runs have the name a; give one of them another name"]


@pytest.mark.parametrize(
    ("row", "line"),
    [
        (
            "sweep\tscans\t",
            'row 2 (sweep), column folder: "sweep" is not a name of letters, digits and . _ = + -, other than sweep and without _steps at its end; correct it',
        ),
        (
            "a_steps\tscans\t",
            'row 2 (a_steps), column folder: "a_steps" is not a name of letters, digits and . _ = + -, other than sweep and without _steps at its end; correct it',
        ),
        ("a\tnowhere\t", "row 2 (a), column path: there is no folder nowhere; correct the path, which begins at the folder of the sweep"),
        ("a\tscans\t*.nii", "row 2 (a), column path: scans has no meshes or volumes that match *.nii; correct the path or the column files"),
    ],
)
def test_errors_of_folders(sweep_folder: Path, row: str, line: str):
    (sweep_folder / "config/config.yaml").write_text("folders: config/folders.tsv\n")
    (sweep_folder / "scans").mkdir()
    (sweep_folder / "scans/a.ply").touch()
    (sweep_folder / "config/folders.tsv").write_text(f"folder\tpath\tfiles\n{row}\n")
    assert lines(sweep_folder) == [f"config/folders.tsv, {line}"]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("runs: config/none.tsv", "config/none.tsv: there is no such table; write one, or correct its name in config.yaml"),
        ("threads: 1", "config.yaml names no table: add a line such as `runs: config/runs.tsv`"),
        ("rums: config/runs.tsv", "config/config.yaml, rums: there is no such entry; a similar one is runs"),
        ("threads: two", "config/config.yaml, threads: 'two' is not of type 'integer'; give a whole number of threads from 1 on"),
        ("runs: [", "config/config.yaml: no YAML: "),
    ],
)
def test_errors_of_the_configuration(sweep_folder: Path, text: str, line: str):
    (sweep_folder / "config/config.yaml").write_text(text)
    found = lines(sweep_folder)
    assert len(found) == 1 and found[0].startswith(line)


def test_numbers_as_unknown_entries_of_the_configuration(sweep_folder: Path):
    (sweep_folder / "config/config.yaml").write_text("7: config/runs.tsv\nrums: config/runs.tsv\n")
    entry = "config/config.yaml, {}: there is no such entry; {}"
    assert lines(sweep_folder) == [entry.format("7", "remove it"), entry.format("rums", "a similar one is runs")]


def test_a_program_that_is_missing(sweep_folder: Path):
    (sweep_folder / "config/config.yaml").write_text("runs: config/runs.tsv\nprogram: wilmore\n")
    (sweep_folder / "config/runs.tsv").write_text(HEADER + "a\tflow\tbuiltin:cross\n")
    assert lines(sweep_folder) == [
        "config/config.yaml, program: there is no program wilmore; install it by `cargo install --path crates/cli`, or give its path"
    ]


def test_lists_become_all_combinations(sweep_folder: Path):
    entry = {
        "run": "plane",
        "command": "flow",
        "input": ["builtin:cross", "builtin:ring"],
        "tolerance": ["1%", 1e-3],
        "time": "1e-4",
        "repair": False,
    }
    (sweep_folder / "runs.yaml").write_text(yaml.safe_dump([entry, {"run": "one", "command": "mcf", "input": "builtin:disc"}]))
    runs = tables.load("runs.yaml", None)["sweep"]
    assert [run.name for run in runs] == ["plane_cross_1pct", "plane_cross_0.001", "plane_ring_1pct", "plane_ring_0.001", "one"]
    assert runs[1].options == {"tolerance": 0.001, "time": 1e-4, "repair": False}


def test_whole_numbers_with_a_point_are_whole_numbers(sweep_folder: Path):
    entry = {"run": "a", "command": "fair", "input": "builtin:figure", "cells": [64.0, 32.5], "label": 3.0, "noise": 2.0}
    (sweep_folder / "runs.yaml").write_text(yaml.safe_dump([{**entry, "cells": 64.0}]))
    (run,) = tables.load("runs.yaml", None)["sweep"]
    assert {name: repr(value) for name, value in run.options.items()} == {"cells": "64", "label": "3", "noise": "2.0"}
    (sweep_folder / "runs.yaml").write_text(yaml.safe_dump([entry]))
    with pytest.raises(tables.TableError, match='"32.5" is not a whole number of cells'):
        tables.load("runs.yaml", None)


def test_files_of_folders_have_names_of_their_own(sweep_folder: Path):
    (sweep_folder / "scans").mkdir()
    for name in ("a b.ply", "a_b.ply", "c.nii.gz", "c.NII", "notes.txt", "{c}.obj"):
        (sweep_folder / "scans" / name).touch()
    (sweep_folder / "folders.tsv").write_text("folder\tpath\nscans\tscans\n")
    runs = tables.load(None, "folders.tsv")["scans"]
    assert {run.input for run in runs} == {f"scans/{name}" for name in ("a b.ply", "a_b.ply", "c.nii.gz", "c.NII", "{c}.obj")}
    assert len({run.name for run in runs}) == 5 and all(re.fullmatch(r"[A-Za-z0-9._=+-]+", run.name) for run in runs)
    assert {run.command for run in runs} == {"fair"}


def test_the_schema_has_the_options_of_the_program(program: str):
    # Of these the workflow takes care itself, `shared` makes no folder of a run, and no flow depends on the seed.
    own = {"help", "quiet", "json", "no-page", "output", "save", "shared", "force", "checkpoint-every", "config", "seed"}
    rules = tables.schema("runs")["properties"]
    for command in ("flow", "fair", "inpaint", "mcf"):
        text = subprocess.run([program, command, "--help"], check=True, capture_output=True, text=True).stdout
        options = set(re.findall(r"^ +(?:-h, )?--([a-z-]+)", text, re.MULTILINE)) - own
        known = {name for name, rule in rules.items() if command in rule.get("commands", [command])} - tables.OWN_COLUMNS
        assert known == options, command
