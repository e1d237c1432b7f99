"""Flows step by step."""

from __future__ import annotations

import json
from functools import cached_property
from typing import Any, Iterator

import numpy as np

from . import _results
from ._inputs import Source
from ._results import Result, Shaped, tell
from ._willmore import State as _State
from ._willmore import Steps


class State(Shaped):
    """A shape after a step of a flow, which stays as it is when the flow goes on.

    Attributes
    ----------
    step : int
        The number of the step, from 1; 0 at the beginning.
    time : float
        The time, a length to the fourth power.
    energy : float or None
        The energy after the step. At the beginning it is None until the first step has measured it; `willmore.energy` measures it before.
    sizes : dict of float
        Length and area of a curve, area and volume of a surface, and the reduced volume.
    record : dict
        Everything that is known of the step: its row in ``metrics.csv`` of a run, and more.
    field : array of float
        The phase field, 1 inside and -1 outside.
    spacing, origin
        The side of a cell of the field, and the position of its first node.
    mesh
        The surface, as in `Result`; None for a curve.
    image : array or None
        The picture of a curve, as in `Result`.
    curves : list of (n, 2) arrays
        The closed curves of a flow in the plane.
    """

    def __init__(self, state: _State, source: Source, record: dict[str, Any], sizes: dict[str, float]):
        super().__init__(state, source)
        self.record, self.sizes = record, sizes
        self.step: int = record.get("step", 0)
        self.time: float = record.get("time", 0.0)
        self.energy: float | None = record.get("energy")

    @cached_property
    def curves(self) -> list[np.ndarray]:
        from ._shapes import zero_level

        return zero_level(self.field, spacing=self.spacing, origin=self.origin) if self.field.ndim == 2 else []

    def __repr__(self) -> str:
        energy = "" if self.energy is None else f", energy {self.energy:.6g}"
        return f"<State: step {self.step}, t = {self.time:.4g}{energy}>"


class Flow(Iterator[State]):
    """A flow that makes a step whenever the next state is asked for.

    A step that was interrupted by Ctrl-C is complete, and the flow can go on: ask for the next state.

    Attributes
    ----------
    start : State
        The shape at the beginning.
    warnings, notes : list of str
        What you should know before you trust the result, and which choices were made.
    ended : str or None
        The rule that ended the flow, once it is over.
    """

    def __init__(self, steps: Steps, source: Source):
        self._steps, self._source = steps, source
        self.warnings: list[str] = steps.warnings
        self.notes: list[str] = steps.notes
        self.start = State(steps.state, source, {}, json.loads(steps.start))
        # Records that became states.
        self._told = 0
        self._touches_box = steps.touches_box

    @property
    def ended(self) -> str | None:
        return self._steps.ended

    def __next__(self) -> State:
        while True:
            # A step that Ctrl-C came after is made, and not told yet.
            if self._told == self._steps.made and not self._steps.step():
                raise StopIteration
            record = json.loads(self._steps.record(self._told) or "{}")
            self._told += 1
            self.start.energy = self._steps.first_energy
            if record["completes_step"]:
                self._doubt(record["step"])
                return State(self._steps.state, self._source, _results.row(record), record["measures"])

    def _doubt(self, step: int) -> None:
        """Warns when parts or holes come or go, and when the shape touches the side of the box."""
        change, touches_box = self._steps.change(), self._steps.touches_box
        doubts = [] if change is None else [change]
        if touches_box and not self._touches_box:
            doubts.append(
                f"step {step}: the shape has come to the side of the box, beyond which is its periodic image: "
                "a larger `box_side` or a smaller `side_length` gives it room"
            )
        self._touches_box = touches_box
        self.warnings += doubts
        tell(doubts)

    def run(self) -> Result:
        """Makes all steps to the end of the flow, and returns what came out."""
        for _ in self:
            pass
        return self.result()

    def result(self) -> Result:
        """What has come out so far."""
        return Result(self._steps.results(), self._source)

    def __repr__(self) -> str:
        return f"<Flow: {self.ended or 'goes on'}>"
