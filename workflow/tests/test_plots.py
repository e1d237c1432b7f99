"""Figures of runs, some of which lack what the figure is about."""

import io
from typing import Any

import pandas
import pytest
from matplotlib.figure import Figure
from sweeps import gather, plots


def runs_with(volumes: dict[str, float | None]) -> pandas.DataFrame:
    """A run for each volume, with other cells and another tolerance."""
    return gather.runs_table([outcome(run, 32 * number, volume) for number, (run, volume) in enumerate(volumes.items(), 1)])


def outcome(run: str, cells: int, volume: float | None) -> dict[str, Any]:
    summary = {"energy": cells / 32, **({} if volume is None else {"volume": volume})}
    return {
        **{"run": run, "status": "finished", "message": None, "warnings": [], "command": "flow", "input": "builtin:cross"},
        **{"options": {"cells": cells, "tolerance": f"{cells}%"}, "log": "log", "program": "0.1.0"},
        "results": [{"label": None, "folder": run, "seconds": 1.0, "summary": summary}],
    }


def points(figure: Figure) -> list[list[tuple[float, float]]]:
    """What each panel shows. The figure is drawn, too."""
    figure.savefig(io.BytesIO())
    return [[(float(x), float(y)) for line in axis.lines for x, y in line.get_xydata()] for axis in figure.axes]


@pytest.mark.parametrize(
    ("role", "expected"),
    [("x", [[(2.0, 1.0)]]), ("colour", [[(32.0, 1.0), (64.0, 2.0)]]), ("panel", [[(32.0, 1.0)], [(64.0, 2.0)]])],
)
def test_a_run_without_a_result(role: str, expected: list[list[tuple[float, float]]]):
    figure = plots.metric(runs_with({"a": 2.0, "b": None}), {"x": "cells", "y": "energy", role: "volume"}, "mm")
    assert points(figure) == expected
    names = [axis.get_title() for axis in figure.axes] + [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert ("none" in names) == (role != "x")


@pytest.mark.parametrize("role", ["x", "y", "colour", "panel"])
def test_a_result_that_no_run_has(role: str):
    runs = runs_with({"a": None, "b": None}).assign(volume=None)
    figure = plots.metric(runs, {"x": "cells", "y": "energy", role: "volume"}, "mm")
    if role in ("colour", "panel"):
        assert points(figure) == [[(32.0, 1.0), (64.0, 2.0)]]
    else:
        assert points(figure) == [[]] and figure.axes[0].texts[0].get_text() == "No run has volume."
