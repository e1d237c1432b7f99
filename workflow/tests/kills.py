"""Sweeps that are killed at random moments, and what must then be as without the kills."""

import json
import os
import random
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import yaml
from conftest import HERE, folders_of_runs, outcomes, start, start_and_kill
from sweeps.program import checkpoints, newest_step, start_arguments
from sweeps.tables import Run, load

# Of a run: times, what a process holds, and files whose format is free to change.
FREE = {"timings.json", "lock", "checkpoints"}


def steps_made(folder: Path) -> dict[Path, list[float]]:
    """The seconds of each step that has a checkpoint. A step that is made again takes other nanoseconds."""
    begun = [run for run in folders_of_runs(folder) if checkpoints(run) and (run / "timings.json").exists()]
    return {run: json.loads((run / "timings.json").read_text())[: newest_step(run)] for run in begun}


def kill_at_random(folder: Path, kills: int, chance: random.Random, on: tuple[str, ...] = HERE) -> int:
    """Kills a sweep at random moments. Returns how many runs were in the middle of their steps then, and checks that their steps are kept."""
    runs = sum(map(len, tables(folder).values()))
    made: list[dict[Path, list[float]]] = []
    for number in range(kills):
        goal = chance.randrange(runs * number // kills, runs * (number + 1) // kills)
        delay = chance.uniform(0, 0.5)
        reached: list[float] = []

        def moment(goal: int = goal, delay: float = delay, reached: list[float] = reached) -> bool:
            if len(outcomes(folder)) >= goal and folders_of_runs(folder):
                reached.append(time.monotonic())
            return bool(reached) and time.monotonic() >= reached[0] + delay

        start_and_kill(folder, moment, on)
        made.append(steps_made(folder))
        print(f"killed with {len(outcomes(folder))} of {runs} outcomes, at {sum(map(len, made[-1].values()))} steps")
    start(folder, on=on)
    last = steps_made(folder)
    for before in made:
        for run, seconds in before.items():
            assert last[run][: len(seconds)] == seconds, f"steps of {run} were made again"
    return sum(0 < len(seconds) < len(last[run]) for before in made for run, seconds in before.items())


def tables(folder: Path) -> dict[str, list[Run]]:
    config = yaml.safe_load((folder / "config/config.yaml").read_text())
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return load(config.get("runs"), config.get("folders"))


def assert_runs_are_those_without_kills(folder: Path, program: str, runs: list[Run]) -> None:
    """Compares runs with calls of the program that nobody has killed."""

    def compare(run: Run) -> None:
        expected = folder / "expected" / run.group / run.name
        expected.parent.mkdir(parents=True, exist_ok=True)
        environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
        done = subprocess.run([program, *start_arguments(run, expected)], cwd=folder, capture_output=True, env=environment)
        outcome = json.loads((folder / f"results/outcomes/{run.group}/{run.name}.json").read_text())
        assert (done.returncode == 0) == (outcome["status"] == "finished"), run
        made = [files(folder / result["folder"]) for result in outcome["results"]]
        assert made == ([files(expected)] if done.returncode == 0 else []), run

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(compare, runs))


def files(folder: Path) -> dict[str, bytes]:
    """The files of a run that do not depend on times."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name not in FREE}
