"""A sweep on a cluster: 24 runs, and one that takes longer than the time limit of a job. with_slurm starts the cluster of one node."""

import random
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml
from conftest import CLUSTER, WORKFLOW, start
from kills import assert_runs_are_those_without_kills, kill_at_random, tables

IS_CLUSTER = shutil.which("sinfo") is not None and subprocess.run("sinfo", capture_output=True).returncode == 0
pytestmark = [pytest.mark.slow, pytest.mark.skipif(not IS_CLUSTER, reason="no cluster: scripts/test_sweeps --slurm")]


def profile_without_database(folder: Path, runtime: int) -> None:
    """The profile for Slurm with the lines for a cluster without slurmdbd, one thread, and a time limit in minutes."""
    text = (WORKFLOW / "profiles/slurm/config.yaml").read_text()
    profile = yaml.safe_load(text.replace("# slurm-status-command", "slurm-status-command").replace("# slurm-no-account", "slurm-no-account"))
    assert profile["slurm-status-command"] == "squeue" and profile["slurm-no-account"] is True
    profile["default-resources"] |= {"runtime": runtime, "mem_mb": 500}
    assert profile["set-resources"]["run"]["mem_mb"] == "4000 * attempt"
    profile["set-resources"]["run"]["mem_mb"] = "300 * attempt"
    profile["set-threads"]["run"] = 1
    profile |= {"latency-wait": 5, "slurm-init-seconds-before-status-checks": 3}
    (folder / "profiles/slurm").mkdir(parents=True)
    (folder / "profiles/slurm/config.yaml").write_text(yaml.safe_dump(profile))


def jobs() -> list[list[str]]:
    """State, time limit, memory and GPUs of all jobs."""
    columns = "State:.12,TimeLimit:.12,MinMemory:.12,tres-per-job:.30"
    done = subprocess.run(["squeue", "--states=all", "--noheader", "--sort=i", f"--Format={columns}"], capture_output=True, text=True, check=True)
    return [line.split() for line in done.stdout.splitlines()]


def test_a_sweep_that_is_killed_goes_on(tmp_path: Path, program: str, chance: random.Random):
    (tmp_path / "config").mkdir()
    shutil.copy(WORKFLOW / ".test/config/runs.tsv", tmp_path / "config")
    (tmp_path / "config/config.yaml").write_text("runs: config/runs.tsv\n")
    profile_without_database(tmp_path, 10)
    kill_at_random(tmp_path, 1, chance, CLUSTER)
    assert_runs_are_those_without_kills(tmp_path, program, tables(tmp_path)["sweep"])
    assert len(tables(tmp_path)["sweep"]) == 24
    assert len([job for job in jobs() if job[:2] == ["COMPLETED", "10:00"]]) >= 24


def test_a_job_that_its_time_limit_kills_goes_on_in_the_next_one(tmp_path: Path, program: str):
    (tmp_path / "config").mkdir()
    entry = {"run": "long", "command": "flow", "input": "builtin:torus", "cells": 64, "tau": 1e-8, "steps": 600}
    (tmp_path / "config/runs.yaml").write_text(yaml.safe_dump([entry]))
    (tmp_path / "config/config.yaml").write_text("runs: config/runs.yaml\n")
    profile_without_database(tmp_path, 1)
    start(tmp_path, on=CLUSTER)
    (log,) = tmp_path.glob("results/runs/sweep/*.log")
    starts = re.findall(r"== (start|resume)(?:.* from step (\d+))?", log.read_text())
    print(f"steps at which jobs began: {starts}")
    assert starts[0] == ("start", "") and len(starts) > 1
    steps = [int(step) for what, step in starts if what == "resume"]
    assert steps == sorted(set(steps)) and steps[0] > 0
    # Each job asks for more memory than the one before, in case the memory was short.
    made = [(state, memory) for state, limit, memory, _ in jobs() if limit == "1:00"]
    assert made == [("TIMEOUT" if number < len(starts) else "COMPLETED", f"{300 * number}M") for number in range(1, len(starts) + 1)]
    assert_runs_are_those_without_kills(tmp_path, program, tables(tmp_path)["sweep"])


def test_a_run_on_a_gpu_asks_for_one(tmp_path: Path):
    (tmp_path / "config").mkdir()
    rows = [
        {"run": name, "command": "flow", "input": "builtin:cross", "cells": 32, "steps": 1, **device}
        for name, device in (("cpu", {}), ("gpu", {"device": "cuda"}))
    ]
    (tmp_path / "config/runs.yaml").write_text(yaml.safe_dump(rows))
    (tmp_path / "config/config.yaml").write_text("runs: config/runs.yaml\n")
    profile_without_database(tmp_path, 7)
    # The program of the tests has no cuda compiled in, and says so.
    assert "refused: gpu: " in start(tmp_path, on=CLUSTER)
    asked = sorted(gpus for _, limit, _, gpus in jobs() if limit == "7:00")
    assert asked == ["N/A", "gres:gpu:1"]
