"""Runs of the program `willmore`: started, or resumed where an earlier start has left a checkpoint."""

import fcntl
import glob
import hashlib
import json
import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .tables import SWEEP, Run

RUNS = Path("results/runs")
MESHES = Path("results/meshes")
MESH_SUFFIXES = {".ply", ".obj", ".stl", ".off"}
# How messages of the program begin, and parts of three of them.
ERROR, WARNING = "error: ", "warning: "
HELD = "cannot start a run in"
BUSY = "another process works on the run"
LABELS_FAILED = "these labels failed"
# The exit code of a refusal.
REFUSED = 2


class Stopped(Exception):
    """The program ended before the run did: it was killed, or interrupted. The next start goes on from the newest checkpoint."""


@dataclass
class Program:
    """The program, and how it is called."""

    path: str
    threads: int = 1

    def version(self) -> str:
        return subprocess.run([self.path, "--version"], check=True, capture_output=True, text=True).stdout.split()[-1]

    def call(self, arguments: Sequence[str], record: "Record") -> list[str]:
        """Runs the program and returns its refusals, none after a success. Messages go to files at once, so that a kill loses none of them."""
        environment = {**os.environ, "RAYON_NUM_THREADS": str(self.threads)}
        with record.messages.open("ab") as messages, record.outcomes.open("ab") as outcomes:
            begin = messages.seek(0, os.SEEK_END)
            code = subprocess.run([self.path, *arguments], env=environment, stdin=subprocess.DEVNULL, stdout=outcomes, stderr=messages).returncode
        return refusals(code, record.messages.read_bytes()[begin:].decode(errors="replace").splitlines())


def refusals(code: int, messages: Sequence[str]) -> list[str]:
    """The lines by which the program refuses a run. Raises Stopped where another start can go on."""
    if code == 0:
        return []
    errors = [line.removeprefix(ERROR) for line in messages if line.startswith(ERROR)]
    if code != REFUSED or not errors or any(BUSY in line for line in errors):
        raise Stopped(errors[0] if errors else f"willmore ended with the code {code}")
    if errors[0].startswith(LABELS_FAILED):
        # Labels that an earlier start has made are refused, too, and are none of the failures.
        return [line.removeprefix(WARNING) for line in messages if line.startswith(f"{WARNING}label ") and HELD not in line]
    return errors


@dataclass
class Record:
    """Files beside the folder of a run, to which every start adds: messages, and outcomes as JSON."""

    folder: Path

    @property
    def messages(self) -> Path:
        return beside(self.folder, ".log")

    @property
    def outcomes(self) -> Path:
        return beside(self.folder, ".jsonl")

    def note(self, what: str) -> None:
        """Writes down what comes next."""
        with self.messages.open("a", encoding="utf-8") as file:
            file.write(f"== {what}\n")

    def warnings(self) -> list[str]:
        """The warnings of all starts, each once, without those that only say that a label was made before."""
        lines = self.messages.read_text(encoding="utf-8", errors="replace").splitlines()
        return list(dict.fromkeys(line.removeprefix(WARNING) for line in lines if line.startswith(WARNING) and HELD not in line))

    def ended(self, folder: Path) -> str | None:
        """Why the run in a folder ended, as the program has told."""
        for line in reversed(self.outcomes.read_text(encoding="utf-8").splitlines()):
            try:
                outcome = json.loads(line)
            except json.JSONDecodeError:  # a kill in the middle of a line
                continue
            if Path(outcome.get("run", "")) == folder and "ended" in outcome:
                return outcome["ended"]
        return None


def beside(folder: Path, suffix: str) -> Path:
    """A file beside another one, or beside a folder."""
    return folder.with_name(folder.name + suffix)


def folder_of(run: Run) -> Path:
    """The folder of a run. Its name depends on the options and on the content of the input, so that no run is resumed with other ones."""
    digest = hashlib.sha256()
    options = {name: value for name, value in run.options.items() if Path(str(value)) not in map(Path, run.files())}
    digest.update(json.dumps([run.name, run.command, options], sort_keys=True).encode())
    for value in [run.input, *sorted(set(run.files()) - {run.input})]:
        digest.update(_content(value) if value in run.files() else value.encode())
    # Without dots, before which the program would put the name of a label.
    return RUNS / run.group / f"{run.name.replace('.', '_')}-{digest.hexdigest()[:8]}"


def _content(path: str) -> bytes:
    """The checksum of a file. What cannot be read is for the program to refuse."""
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").digest()
    except OSError as error:
        return str(error).encode()


def checkpoints(folder: Path) -> list[Path]:
    return sorted((folder / "checkpoints").glob("step-*.ckpt"))


def newest_step(folder: Path) -> int:
    """The step of the newest checkpoint."""
    return int(re.sub(r"\D", "", checkpoints(folder)[-1].stem))


def outcome_of(run: Run, program: Program) -> dict[str, Any]:
    """Starts or resumes a run, and tells what came of it."""
    folder = folder_of(run)
    folder.parent.mkdir(parents=True, exist_ok=True)
    record = Record(folder)
    lines = start_or_resume(run, folder, program, record)
    results = [result_of(run, folder, part, record) for part in parts(folder) if (part / "summary.json").exists()]
    return {
        "run": run.name,
        "command": run.command,
        "input": run.input,
        "options": run.options,
        "program": program.version(),
        "status": ("failed" if parts(folder) else "refused") if lines else "finished",
        "message": " ".join(lines) or None,
        "warnings": record.warnings(),
        "log": str(record.messages),
        "results": results,
    }


def start_or_resume(run: Run, folder: Path, program: Program, record: Record) -> list[str]:
    """Makes the steps that are left of a run, and returns the lines by which the program refuses it."""
    begun = []
    for part in parts(folder):
        wait_for_lock(part)
        if checkpoints(part):
            begun.append(part)
        else:
            # A start was killed before its first checkpoint. There is nothing to resume, and the program starts in empty folders alone.
            shutil.rmtree(part)
    lines = []
    for part in begun:
        record.note(f"resume {part.name} from step {newest_step(part)}")
        lines += program.call(["resume", str(part), "--json"], record)
    # With all labels, a start makes those that an earlier one has not come to.
    if not begun or run.options.get("label") == "all":
        record.note(f"start {folder.name}")
        lines += program.call(start_arguments(run, folder), record)
    return lines


def parts(folder: Path) -> list[Path]:
    """The folders of a run: one, or with all labels one for each label."""
    found = [folder, *folder.parent.glob(f"{glob.escape(folder.name)}-label*")]
    return sorted((part for part in found if part.is_dir()), key=_label)


def _label(part: Path) -> int:
    match = re.search(r"-label(-?\d+)$", part.name)
    return int(match[1]) if match else 0


def wait_for_lock(folder: Path) -> None:
    """Waits for a process of a killed start that still works on a run."""
    lock = folder / "lock"
    if lock.exists():
        with lock.open("rb+") as file:
            fcntl.flock(file, fcntl.LOCK_EX)


def start_arguments(run: Run, folder: Path) -> list[str]:
    """The arguments that start a run, which keeps every step."""
    arguments = [run.command, run.input]
    for name, value in run.options.items():
        if value is True:
            arguments.append(f"--{name}")
        elif value is not False:
            # One argument, since a value may begin with a minus.
            arguments.append(f"--{name}={value}")
    return [*arguments, f"--output={folder}", "--checkpoint-every=1", "--no-page", "--json"]


def result_of(run: Run, folder: Path, part: Path, record: Record) -> dict[str, Any]:
    """What a finished run has in its folder."""
    return {
        "label": _label(part) if part != folder else run.options.get("label"),
        "folder": str(part),
        "ended": record.ended(part),
        "seconds": sum(json.loads((part / "timings.json").read_text(encoding="utf-8"))),
        "mesh": str(copy_mesh(run, folder, part) or "") or None,
        "summary": json.loads((part / "summary.json").read_text(encoding="utf-8")),
    }


def copy_mesh(run: Run, folder: Path, part: Path) -> Path | None:
    """Copies the mesh of a run of a folder to where the meshes of this folder are."""
    found = [file for file in part.glob("final.*") if file.suffix in MESH_SUFFIXES]
    if run.group == SWEEP or not found:
        return None
    label = part.name.removeprefix(folder.name)
    mesh = MESHES / run.group / f"{run.name.removesuffix(found[0].suffix)}{label}{found[0].suffix}"
    mesh.parent.mkdir(parents=True, exist_ok=True)
    whole = beside(mesh, ".part")
    shutil.copyfile(found[0], whole)
    return whole.replace(mesh)
