"""A sweep of 24 runs and a folder of 30 files, killed and started again."""

import fcntl
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy
import pandas
import pytest
import scans
import yaml
from conftest import WORKFLOW, folders_of_runs, outcomes, start
from kills import assert_runs_are_those_without_kills, kill_at_random, tables
from sweeps.program import newest_step

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def finished(sweep: Path, chance: random.Random) -> Path:
    """The sweep of .test, killed once and started again."""
    kill_at_random(sweep, 1, chance)
    return sweep


def test_killed_runs_are_the_same(finished: Path, program: str):
    runs = tables(finished)["sweep"]
    assert len(runs) == 24
    assert_runs_are_those_without_kills(finished, program, runs)


@pytest.mark.slow
def test_killed_runs_of_a_folder_are_the_same(finished: Path, program: str):
    assert_runs_are_those_without_kills(finished, program, tables(finished)["scans"])


def test_the_table_of_runs(finished: Path):
    table = pandas.read_csv(finished / "results/tables/sweep.csv")
    assert list(table["status"]) == 24 * ["finished"]
    assert list(table["run"]) == [run.name for run in tables(finished)["sweep"]]
    assert set(table["--tolerance"]) == {"0.1%", "0.3%", "1%", "3%"} and set(table["--cells"]) == {48, 64}
    parquet = pandas.read_parquet(finished / "results/tables/sweep.parquet")
    # An empty cell of the CSV is None in a column of texts.
    pandas.testing.assert_frame_equal(table, parquet.fillna(numpy.nan), check_dtype=False)
    for row in table.to_dict("records"):
        summary = json.loads((finished / row["folder"] / "summary.json").read_text())
        assert (row["energy"], row["grid.spacing"], row["steps"]) == (summary["energy"], summary["grid"]["spacing"], summary["steps"])
    steps = pandas.read_parquet(finished / "results/tables/sweep_steps.parquet")
    assert len(steps) == table["steps"].sum() and steps["willmore_energy"].gt(0).all()


def test_the_code_of_the_document_runs(finished: Path, tmp_path: Path):
    document = Path(__file__).resolve().parents[2] / "docs/sweeps.md"
    blocks = re.findall(r"^```python\n(.*?)^```$", document.read_text(), re.MULTILINE | re.DOTALL)
    (tmp_path / "my-sweep").symlink_to(finished)
    code = "\n".join(blocks)
    assert "read_parquet" in code
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)


def test_a_folder_of_thirty_files(finished: Path):
    table = pandas.read_csv(finished / "results/tables/scans.csv")
    assert len(table) == 30 and set(table["run"]) == {run.name for run in tables(finished)["scans"]}
    refused = table[table["status"] == "refused"].set_index("run")["message"]
    assert set(refused.index) == {"broken.ply", "empty.stl", "fan.obj"}
    assert "truncated" in refused["broken.ply"] and "is empty" in refused["empty.stl"] and "nothing could move" in refused["fan.obj"]
    good = table[table["status"] == "finished"]
    assert len(good) == scans.GOOD
    for column in ("volume", "mesh.volume_change_percent", "mesh.displacement_rms", "mesh.displacement_largest"):
        assert good[column].notna().all(), column
    for mesh in good["mesh"]:
        assert (finished / mesh).stat().st_size > 1000
    assert {Path(mesh).suffix for mesh in good["mesh"]} == {".ply", ".obj", ".stl"}


def test_another_start_makes_nothing(finished: Path):
    before = {path: path.stat().st_mtime_ns for path in finished.glob("results/**/*") if path.is_file() and path.name != "report.zip"}
    told = start(finished)
    assert "Nothing to be done" in told and "51 finished, 3 refused" in told
    assert "refused: empty.stl: " in told
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_two_starts_at_once_are_refused(finished: Path):
    with (finished / ".start.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        told = start(finished, code=2)
    assert re.fullmatch(r"start: another start works on .*; wait for it or stop it\n", told)


def test_figures_have_names_units_and_legends(finished: Path):
    figures = finished / "results/figures"
    assert {path.name for path in (figures / "sweep").iterdir()} == {
        "energy.svg",
        "shapes.png",
        "energy_over_tolerance_by-cells_by-input.svg",
        "seconds_over_cells_by-tolerance.svg",
    }
    # Texts are paths; their sources are comments.
    texts = re.findall(r"<!-- (.*?) -->", (figures / "sweep/energy_over_tolerance_by-cells_by-input.svg").read_text())
    assert {"cross", "ring", "tolerated error of a time step (%)", "Willmore energy (1/length)", "cells", "48", "64"} <= set(texts)
    assert {path.name for path in (figures / "scans").iterdir()} == {"energy.svg", "shapes.png"}


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_the_report_opens_in_a_browser(finished: Path, tmp_path: Path):
    with zipfile.ZipFile(finished / "results/report.zip") as archive:
        archive.extractall(tmp_path)
    arguments = ["--headless", "--no-sandbox", "--disable-dev-shm-usage", "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr"]
    page = f"file://{tmp_path}/report/report.html"
    call = [BROWSER, *arguments, f"--user-data-dir={tmp_path}/profile", "--virtual-time-budget=5000", "--dump-dom", page]
    done = subprocess.run(call, capture_output=True, text=True, timeout=120, check=True)
    errors = [line for line in done.stderr.splitlines() if "CONSOLE" in line and re.search("error|failed|uncaught", line, re.IGNORECASE)]
    assert not errors, errors
    # What scripts have made of it: the entries of the menu and the text about the workflow.
    body = re.sub(r"<script.*?</script>", "", done.stdout, flags=re.DOTALL)
    for text in ("Workflow", "Statistics", "Results", "Runs of the program"):
        assert text in body, text
    names = {path.name for path in tmp_path.glob("report/data/raw/*/*")}
    assert {"energy.svg", "shapes.png", "sweep.html", "scans.html"} <= names


def test_refused_runs_are_made_again_on_demand(finished: Path):
    (finished / "scans/empty.stl").write_bytes((finished / "scans/scan 02.stl").read_bytes())
    before = outcomes_by_time(finished)
    assert "52 finished, 2 refused" in start(finished, "--retry")
    changed = {path.name for path, moment in outcomes_by_time(finished).items() if before[path] != moment}
    assert changed == {"broken.ply.json", "empty.stl.json", "fan.obj.json"}
    assert list(pandas.read_csv(finished / "results/tables/scans.csv")["status"]).count("refused") == 2


def outcomes_by_time(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in outcomes(folder)}


def test_lint():
    call = ["snakemake", "--lint", "--snakefile", WORKFLOW / "Snakefile", "--directory", WORKFLOW]
    done = subprocess.run(call, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_environments_have_the_same_versions():
    pinned = dict(line.split("==") for line in (WORKFLOW / "requirements.txt").read_text().splitlines() if "==" in line)
    names = {"matplotlib-base": "matplotlib", "pyyaml": "PyYAML"}
    conda = [entry.split("=") for entry in yaml.safe_load((WORKFLOW / "envs/scripts.yaml").read_text())["dependencies"]]
    for name, version in conda:
        if name != "python":
            assert pinned[names.get(name, name)] == version, name


@pytest.mark.slow
def test_three_kills(tmp_path: Path, program: str, chance: random.Random):
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text("runs: config/runs.yaml\n")
    entry = {
        "run": "plane",
        "command": "flow",
        "input": ["builtin:cross", "builtin:rectangle", "builtin:ring"],
        "cells": [96, 128],
        "tolerance": ["0.05%", "0.1%", "0.2%", "0.4%"],
        "steps": 60,
    }
    (tmp_path / "config/runs.yaml").write_text(yaml.safe_dump([entry]))
    # At least one of two runs that are made at a time is in the middle.
    assert kill_at_random(tmp_path, 3, chance) >= 3
    assert len(outcomes(tmp_path)) == 24
    assert_runs_are_those_without_kills(tmp_path, program, tables(tmp_path)["sweep"])


@pytest.mark.slow
def test_ctrl_c_stores_the_steps_that_are_being_made(tmp_path: Path):
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text("runs: config/runs.yaml\n")
    entry = {"run": "one", "command": "flow", "input": "builtin:torus", "cells": 64, "tau": 1e-8, "steps": 1000}
    (tmp_path / "config/runs.yaml").write_text(yaml.safe_dump([entry]))
    started = subprocess.Popen([WORKFLOW / "start", tmp_path], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    while not list(tmp_path.glob("results/runs/sweep/*/checkpoints/step-*[1-9].ckpt")):
        assert started.poll() is None
        time.sleep(0.05)
    os.killpg(started.pid, signal.SIGINT)
    assert started.wait(60) != 0
    (told,) = tmp_path.glob("results/runs/sweep/*.jsonl")
    outcome = json.loads(told.read_text())
    (folder,) = folders_of_runs(tmp_path)
    assert not outcome["finished"] and outcome["steps"] == newest_step(folder) > 0
