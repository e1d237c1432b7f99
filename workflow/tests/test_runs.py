"""One run: started, resumed, refused."""

import fcntl
import json
import subprocess
import threading
import time
from pathlib import Path

import numpy
import pytest
from sweeps.program import Program, Stopped, folder_of, outcome_of, refusals
from sweeps.tables import Run

SHORT = {"cells": 32, "steps": 6}


@pytest.fixture
def willmore(program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Program:
    monkeypatch.chdir(tmp_path)
    return Program(program)


def test_a_finished_run_makes_no_step_again(willmore: Program):
    run = Run("sweep", "a", "flow", "builtin:cross", SHORT)
    first = outcome_of(run, willmore)
    assert first["status"] == "finished" and first["results"][0]["ended"] == "6 steps are made"
    assert first["results"][0]["summary"]["steps"] == 6
    # The seconds of each step are those of its making.
    assert outcome_of(run, willmore) == first


def test_a_start_that_was_killed_before_its_first_checkpoint_starts_again(willmore: Program):
    run = Run("sweep", "a", "flow", "builtin:cross", SHORT)
    folder = folder_of(run)
    folder.mkdir(parents=True)
    for name in ("lock", "start.svg", "config.toml"):
        (folder / name).touch()
    assert outcome_of(run, willmore)["status"] == "finished"


def test_a_run_waits_for_a_process_that_still_works_on_it(willmore: Program):
    run = Run("sweep", "a", "flow", "builtin:cross", SHORT)
    first = outcome_of(run, willmore)
    with (folder_of(run) / "lock").open("rb+") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        again = threading.Thread(target=outcome_of, args=(run, willmore))
        again.start()
        time.sleep(1)
        assert again.is_alive()
    again.join(30)
    assert not again.is_alive() and outcome_of(run, willmore) == first


def test_other_options_and_another_input_are_another_run(willmore: Program, tmp_path: Path):
    (tmp_path / "a.ply").write_text("one")
    first = folder_of(Run("g", "a", "fair", "a.ply", {"cells": 32}))
    (tmp_path / "b.ply").write_text("one")
    assert folder_of(Run("g", "a", "fair", "b.ply", {"cells": 32})) == first
    (tmp_path / "a.ply").write_text("two")
    others = [
        Run("g", "a", "fair", "a.ply", {"cells": 32}),
        Run("g", "a", "fair", "b.ply", {"cells": 33}),
        Run("g", "a", "flow", "b.ply", {"cells": 32}),
    ]
    assert len({first, *map(folder_of, others)}) == 4


def test_a_refusal_is_an_outcome(willmore: Program):
    outcome = outcome_of(Run("sweep", "a", "flow", "builtin:torus", {"cells": 16}), willmore)
    assert (outcome["status"], outcome["results"]) == ("refused", [])
    assert outcome["message"] == "the kernel is 17 cells wide, but the grid has only 16; use a larger box or a finer grid"


def test_what_another_start_can_do_is_no_refusal():
    assert refusals(0, ["warning: thin"]) == []
    for code, lines in ((-9, []), (130, []), (137, ["error: killed"]), (2, []), (2, ["error: another process works on the run in a: wait"])):
        with pytest.raises(Stopped):
            refusals(code, lines)


@pytest.fixture
def labels(tmp_path: Path) -> str:
    volume = numpy.zeros((24, 24, 24), numpy.uint8)
    volume[3:10, 3:20, 3:20] = 1
    volume[13:20, 3:20, 3:20] = 2
    numpy.save(tmp_path / "labels.npy", volume)
    return "labels.npy"


def test_all_labels_and_the_labels_that_a_kill_left(willmore: Program, labels: str, tmp_path: Path):
    run = Run("organs", "labels.npy", "fair", labels, {"cells": 32, "steps": 2, "label": "all"})
    first = outcome_of(run, willmore)
    assert [result["label"] for result in first["results"]] == [1, 2]
    meshes = [tmp_path / result["mesh"] for result in first["results"]]
    assert [mesh.name for mesh in meshes] == ["labels.npy-label1.ply", "labels.npy-label2.ply"]
    bytes_before = [mesh.read_bytes() for mesh in meshes]
    # As if a kill had come before the first checkpoint of the second label.
    second = tmp_path / first["results"][1]["folder"]
    for file in (second / "checkpoints").iterdir():
        file.unlink()
    again = outcome_of(run, willmore)
    assert (again["status"], again["message"], again["warnings"]) == ("finished", None, first["warnings"])
    assert [mesh.read_bytes() for mesh in meshes] == bytes_before
    assert again["results"][0] == first["results"][0]
    assert again["results"][1]["summary"] == first["results"][1]["summary"]


def test_labels_that_fail(willmore: Program, labels: str):
    outcome = outcome_of(Run("organs", "labels.npy", "fair", labels, {"cells": 20, "eps-over-h": 8, "label": "all"}), willmore)
    assert (outcome["status"], outcome["results"]) == ("refused", [])
    assert outcome["message"].startswith("label 1: ") and " label 2: " in outcome["message"]


def test_labels_that_an_earlier_start_has_made_do_not_fail():
    made = "warning: label 1: cannot start a run in a-label1: it holds step-00000002.ckpt; resume the run that is there"
    lines = [made, "warning: label 5: too thin", "error: these labels failed, as the warnings say: 1, 5"]
    assert refusals(2, lines) == ["label 5: too thin"]
    assert refusals(2, [made, "error: these labels failed, as the warnings say: 1"]) == []


def test_warnings_of_a_start_that_was_killed_are_kept(willmore: Program):
    subprocess.run([willmore.path, "sample", "builtin:lever", "--cells", "40", "--noise", "0.006", "--save", "lever.ply", "--quiet"], check=True)
    run = Run("scans", "lever.ply", "fair", "lever.ply", {"cells": 48, "steps": 1})
    first = outcome_of(run, willmore)
    assert len(first["warnings"]) == 1 and "thinner than" in first["warnings"][0]
    # A resumed run does not tell them again.
    assert outcome_of(run, willmore)["warnings"] == first["warnings"]
    assert json.loads((Path(first["results"][0]["folder"]) / "summary.json").read_text()) == first["results"][0]["summary"]
