"""The workflow as a person starts it, kills it and starts it again."""

import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
import scans

WORKFLOW = Path(__file__).parents[1]
START = WORKFLOW / "start"
sys.path.insert(0, str(WORKFLOW / "scripts"))

# Where cargo puts the program. Where there is none, that of PATH is tested.
BUILT = WORKFLOW.parent / "target" / "debug"
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), str(BUILT), os.environ["PATH"]])


@pytest.fixture(scope="session")
def program() -> str:
    found = shutil.which("willmore")
    assert found, "there is no program willmore: cargo build --bin willmore"
    return found


@pytest.fixture(scope="session")
def chance() -> random.Random:
    """Random numbers, whose seed a failed test shows. SWEEP_SEED makes them again."""
    seed = int(os.environ.get("SWEEP_SEED", time.time_ns() % 10**6))
    print(f"SWEEP_SEED={seed}")
    return random.Random(seed)


@pytest.fixture(scope="session")
def sweep(tmp_path_factory: pytest.TempPathFactory, program: str) -> Path:
    """A folder with the tables of .test and the scans that they name."""
    folder = tmp_path_factory.mktemp("sweep") / "folder"
    shutil.copytree(WORKFLOW / ".test", folder, ignore=shutil.ignore_patterns("results", ".snakemake"))
    scans.make(folder / "scans", program)
    return folder


HERE = ("default", "--cores", "2")
CLUSTER = ("slurm",)


def start(folder: Path, *arguments: str, on: tuple[str, ...] = HERE, code: int = 0) -> str:
    """Starts a sweep with a profile and its arguments, and returns what it printed."""
    call = [START, "--profile", on[0], folder, *on[1:], *arguments]
    done = subprocess.run(call, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == code, done.stdout[-5000:]
    return done.stdout


def start_and_kill(folder: Path, moment: Callable[[], bool], on: tuple[str, ...] = HERE) -> None:
    """Starts a sweep, and kills all of its processes by SIGKILL when the moment has come."""
    call = [START, "--profile", on[0], folder, *on[1:]]
    started = subprocess.Popen(call, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    while not moment():
        assert started.poll() is None, "the sweep ended before it was killed"
        time.sleep(0.02)
    while left := list(of_session(started.pid)):
        for process in left:
            with_no_such_process(process.kill)
        started.poll()


def of_session(session: int) -> Iterator[psutil.Process]:
    """The living processes of a session."""
    for process in psutil.process_iter():
        try:
            if os.getsid(process.pid) == session and process.status() != psutil.STATUS_ZOMBIE:
                yield process
        except (psutil.NoSuchProcess, ProcessLookupError):
            continue


def with_no_such_process(kill: Callable[[], None]) -> None:
    try:
        kill()
    except psutil.NoSuchProcess:
        pass


def outcomes(folder: Path) -> list[Path]:
    return sorted(folder.glob("results/outcomes/*/*.json"))


def folders_of_runs(folder: Path, group: str = "*") -> list[Path]:
    return sorted(path for path in folder.glob(f"results/runs/{group}/*") if path.is_dir())
