"""Runs in folders."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

from . import _inputs, _meshes, _willmore
from ._options import named
from ._progress import Progress, told
from ._results import columns, renamed, tell
from ._training import Network
from ._willmore import Error


class Run:
    """The folder of a run, as the program ``willmore`` makes them.

    Attributes
    ----------
    folder : pathlib.Path
        The folder.
    report : dict
        What is known of a run that is over: ``summary.json``; empty until then.
    metrics : dict of arrays
        Time, energy, sizes and costs of every step: ``metrics.csv``. Numbers that a step does not have are NaN.
    """

    def __init__(self, folder: str | os.PathLike[str]):
        # Here and not at the beginning, as csv below: the package is imported for less than a run in a folder.
        from pathlib import Path

        self.folder = Path(folder)

    @classmethod
    def open(cls, folder: str | os.PathLike[str]) -> Run:
        """The run in a folder.

        Parameters
        ----------
        folder
            The folder.

        Returns
        -------
        Run

        Raises
        ------
        Error
            A folder without a run.
        """
        run = cls(folder)
        if not (run.folder / "config.toml").exists():
            raise Error(f"{run.folder} is not the folder of a run")
        return run

    @classmethod
    def start(
        cls,
        job: str,
        shape: Any,
        folder: str | os.PathLike[str],
        *,
        mask: Any = None,
        spacing: float | None = None,
        origin: Any = None,
        progress: Progress = False,
        **options: Any,
    ) -> Run:
        """Makes a run in a folder, with checkpoints, pictures and a page for a browser.

        Parameters
        ----------
        job : {"flow", "fair", "inpaint", "mcf"}
            The job.
        shape, mask, spacing, origin
            As in the function of this name.
        folder
            The folder that is made.
        progress : bool or callable
            Show progress, or call ``progress(title, done, parts)``.
        **options
            Those of the program, with underscores. A ``network`` must be a file, which is there when the run is resumed.

        Returns
        -------
        Run
            When it is over. Ctrl-C raises `KeyboardInterrupt` after the step is stored; `resume` goes on.

        Raises
        ------
        Error
            A shape or an option that is refused.
        """
        if isinstance(options.get("network"), Network):
            raise Error("`network` of a run must be a file, which is there when the run is resumed: save the network, and give its path")
        source = _inputs.of_shape(shape, spacing=spacing, origin=origin)
        region = None if mask is None else _inputs.of_mask(shape, mask, spacing, origin, options)
        given = named({**source.options, **options, "output": folder})
        outcome, warnings = _willmore.run_in_folder(job, source.input, given, told(progress), region)
        return cls(folder)._ended(outcome, warnings)

    def resume(self, *, steps: int | None = None, progress: Progress = False) -> Run:
        """Continues the run. It ends with the same bytes as a run that was not interrupted.

        Parameters
        ----------
        steps : int, optional
            Go on to so many steps in all, also with a run that is over.
        progress : bool or callable
            Show progress, or call ``progress(title, done, parts)``.

        Returns
        -------
        Run
            This one.

        Raises
        ------
        Error
            A folder that is damaged, or that another program works in.
        """
        if self.finished and steps is None:
            return self
        outcome, warnings = _willmore.resume(os.fspath(self.folder), steps, told(progress))
        return self._ended(outcome, warnings)

    def _ended(self, outcome: str, warnings: list[str]) -> Run:
        tell(warnings)
        if not json.loads(outcome).get("finished"):
            raise KeyboardInterrupt
        return self

    @property
    def finished(self) -> bool:
        """Whether the run is over."""
        return (self.folder / "summary.json").exists()

    @property
    def report(self) -> dict[str, Any]:
        path = self.folder / "summary.json"
        report: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        return report

    @property
    def metrics(self) -> dict[str, np.ndarray]:
        import csv

        with open(self.folder / "metrics.csv", newline="", encoding="utf-8") as file:
            rows = [{name: _number(text) for name, text in row.items()} for row in csv.DictReader(file)]
        return columns([renamed(row) for row in rows])

    @property
    def field(self) -> np.ndarray:
        """The phase field at the end."""
        path = self.folder / "final.npy"
        if not path.exists():
            raise Error(f"{self.folder} has no field yet: resume the run")
        field: np.ndarray = np.load(path)
        return field

    @property
    def mesh(self) -> _meshes.Arrays | None:
        """The surface at the end; None for a curve."""
        for ending in ("ply", "obj", "stl", "off"):
            path = self.folder / f"final.{ending}"
            if path.exists():
                vertices, faces = _willmore.read_mesh(os.fspath(path))
                return _meshes.Arrays(vertices, faces.astype(np.int64))
        return None

    def __repr__(self) -> str:
        steps = self.report.get("steps")
        return f"<Run in {self.folder}, {'not finished' if steps is None else f'{steps} steps, finished'}>"


def _number(text: str) -> Any:
    """A number, NaN for none, or a text."""
    if text == "":
        return np.nan
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return {"true": True, "false": False}.get(text, text)
