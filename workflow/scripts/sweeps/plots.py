"""Figures of many runs."""

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import pandas

from .gather import varied

matplotlib.use("Agg")
# Files do not depend on the time at which they are made, nor on chance.
matplotlib.rcParams.update({"svg.hashsalt": "willmore", "font.size": 10, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True})
matplotlib.rcParams.update({"grid.color": "#dddddd", "grid.linewidth": 0.6, "legend.frameon": False})

import matplotlib.image  # noqa: E402
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.axes import Axes  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.ticker import MaxNLocator  # noqa: E402

# Colours by Okabe and Ito, which people with any sight of colours can tell apart.
COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"]
STYLES = ["-", "--", ":", "-."]
MARKERS = ["o", "s", "^", "D", "v", "P", "X"]
# More runs than that are drawn as thin lines of one colour.
MOST_ENTRIES = 12
MOST_PANELS = 9
# Shorter runs have a point for each step.
FEW_STEPS = 8

NAMES = {
    "time": "time",
    "energy": "Willmore energy",
    "energy_over_8_pi": "Willmore energy / (8 π)",
    "volume_change_percent": "change of volume",
    "area_change_percent": "change of area",
    "length_change_percent": "change of length",
    "mesh.displacement_rms": "displacement, root mean square",
    "mesh.displacement_largest": "largest displacement",
    "time_steps.estimated_error": "estimated error of the time steps",
    "seconds": "time for all steps",
    "--cells": "cells per unit length of the box",
    "--tolerance": "tolerated error of a time step",
}
# Dimensions of sizes, as powers of a length.
POWERS = {
    "volume": 3,
    "area": 2,
    "length": 1,
    "displacement": 1,
    "mesh.displacement_rms": 1,
    "mesh.displacement_largest": 1,
    "time_steps.estimated_error": 1,
    "time_steps.path": 1,
}
SUPERSCRIPTS = {1: "", 2: "²", 3: "³", 4: "⁴"}


def name_of(figure: dict[str, str]) -> str:
    """The name of the file of a figure."""
    parts = [figure["y"], "over", figure["x"], *(f"by-{figure[key]}" for key in ("colour", "panel") if key in figure)]
    return "_".join(part.lstrip("-") for part in parts)


def energy(runs: pandas.DataFrame, steps: pandas.DataFrame, unit: str) -> Figure:
    """The energy of all runs over time; where runs have none, as under mean curvature flow, the area."""
    has_energy = "willmore_energy" in steps and steps["willmore_energy"].notna().any()
    column, metric = ("willmore_energy", "energy") if has_energy else ("area", "area")
    if not len(steps):
        return _empty("No run has made a step.")
    runs = _with_defaults(runs)
    panel = "input" if 1 < runs["input"].nunique() <= MOST_PANELS else None
    colour, style = _roles(runs, [name for name in varied(runs) if name != panel])
    paths = dict(list(steps.groupby("folder")))
    figure, panels = _panels(runs, panel)
    for axis, part in panels:
        for row in part.to_dict("records"):
            if row["folder"] in paths:
                path = paths[row["folder"]]
                times, values = list(path["time"]), list(path[column])
                if has_energy and not _is_log("x", steps["time"]):
                    times, values = [0.0, *times], [row["first_energy"], *values]
                axis.plot(times, values, linewidth=1.4, marker="." if len(times) < FEW_STEPS else None, **_look(runs, row, colour, style))
        axis.set_xlabel(_label("time", runs, unit))
        _scale(axis, "x", steps["time"])
        _scale(axis, "y", steps[column])
    figure.supylabel(_label(metric, runs, unit), fontsize="medium")
    _legend(figure, runs, colour, style)
    return figure


def metric(runs: pandas.DataFrame, wanted: dict[str, str], unit: str) -> Figure:
    """A result over a parameter."""
    runs = _with_defaults(runs[runs["folder"].notna()])
    x, y, colour, panel = (_column(runs, wanted.get(key)) for key in ("x", "y", "colour", "panel"))
    if not len(runs):
        return _empty("No run is finished.")
    if x is None or y is None:
        return _empty(f"No run has {wanted['x'] if x is None else wanted['y']}.")
    runs = _filled(runs[runs[x].notna()], [name for name in (colour, panel) if name is not None], "none")
    figure, panels = _panels(runs, panel)
    places = _places(runs[x])
    for axis, part in panels:
        for line in _lines(part, x):
            value = None if colour is None else line[colour].iloc[0]
            look = {"color": _colour(runs, colour, value), "marker": _marker(runs, colour, value)}
            points = sorted(zip((places[str(v)] for v in line[x]), pandas.to_numeric(line[y], errors="coerce")))
            axis.plot(*zip(*points), markersize=5, linewidth=1.2, **look)
        axis.set_xlabel(_label(x, runs, unit))
        _scale(axis, "y", pandas.to_numeric(runs[y], errors="coerce"), wanted.get("log", "auto"))
        if _numbers(runs[x]) is not None:
            _scale(axis, "x", pandas.Series(places.values()), wanted.get("log", "auto"))
        _ticks(axis, runs[x], places)
    figure.supylabel(_label(y, runs, unit), fontsize="medium")
    _legend(figure, runs, colour, None, with_markers=True)
    return figure


def shapes(runs: pandas.DataFrame) -> Figure:
    """The pictures of all shapes, and in their place the lines of those that were refused."""
    columns = 6 if len(runs) <= 36 else 10
    rows = math.ceil(len(runs) / columns)
    side = 12 / columns
    figure, axes = plt.subplots(rows, columns, figsize=(12, rows * (side + 0.45)), squeeze=False, layout="constrained")
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[], box_aspect=1)
        axis.grid(False)
        axis.spines[:].set(visible=True, color="#dddddd")
    for axis in axes.flat[len(runs) :]:
        axis.set_visible(False)
    for axis, row in zip(axes.flat, runs.to_dict("records")):
        label = "" if _is_missing(row["label"]) else f", label {row['label']}"
        axis.set_title("\n".join(textwrap.wrap(f"{row['run']}{label}".replace("_", " "), 28)), fontsize=6.5)
        picture = None if _is_missing(row["folder"]) else Path(row["folder"]) / "final.png"
        if picture and picture.is_file():
            axis.imshow(matplotlib.image.imread(picture))
        else:
            text = "\n".join(textwrap.wrap(f"{row['status']}: {row['message']}", 34)[:9])
            axis.text(0.03, 0.96, text, transform=axis.transAxes, va="top", fontsize=5.5, color="#a03c00")
    return figure


def _with_defaults(runs: pandas.DataFrame) -> pandas.DataFrame:
    """The runs, with a word in place of options that are not given."""
    return _filled(runs, [name for name in runs if name.startswith("--")], "default")


def _filled(runs: pandas.DataFrame, names: list[str], word: str) -> pandas.DataFrame:
    """The runs, with a word in place of the empty cells of these columns."""
    with_gaps = [name for name in names if runs[name].isna().any()]
    return runs.assign(**{name: runs[name].astype(object).where(runs[name].notna(), word) for name in with_gaps})


def _column(runs: pandas.DataFrame, name: str | None) -> str | None:
    """The column of a result, or of an option, which may be named without --; None if all of its cells are empty."""
    return next((column for column in (name, f"--{name}") if column in runs and runs[column].notna().any()), None)


def _lines(runs: pandas.DataFrame, x: str) -> list[pandas.DataFrame]:
    """Runs that a line joins: they differ in nothing but one parameter."""
    others = [name for name in varied(runs) if name != x]
    return [part for _, part in runs.groupby(others, sort=False)] if others else [runs]


def _numbers(values: pandas.Series) -> pandas.Series | None:
    """The values as numbers, also those in percent; None if some are texts."""
    texts = values.dropna().astype(str)
    if texts.str.endswith("%").all():
        texts = texts.str.removesuffix("%")
    numbers = pandas.to_numeric(texts, errors="coerce")
    return None if numbers.isna().any() else numbers


def _places(values: pandas.Series) -> dict[str, float]:
    """Where the values of a parameter are on its axis."""
    texts = values.dropna().astype(str)
    numbers = _numbers(values)
    return dict(zip(texts, numbers)) if numbers is not None else {text: place for place, text in enumerate(dict.fromkeys(texts))}


def _ticks(axis: Axes, values: pandas.Series, places: dict[str, float]) -> None:
    """Marks the values of a parameter that are texts, or few."""
    if _numbers(values) is None or len(places) <= 8:
        axis.set_xticks(list(places.values()), [text.removesuffix("%").removeprefix("builtin:") for text in places])
        axis.minorticks_off()


def _panels(runs: pandas.DataFrame, panel: str | None) -> tuple[Figure, list[tuple[Axes, pandas.DataFrame]]]:
    """A figure with one panel for each value of a column."""
    groups = [("", runs)] if panel is None else list(runs.groupby(panel, sort=False))
    columns = min(3, len(groups))
    rows = math.ceil(len(groups) / columns)
    size = (3.6 * columns + 1.6, 3.4 * rows + 0.2) if len(groups) > 1 else (7.5, 4.6)
    figure, axes = plt.subplots(rows, columns, figsize=size, squeeze=False, sharey=True, layout="constrained")
    for axis in axes.flat[len(groups) :]:
        axis.set_visible(False)
    for axis, (value, _) in zip(axes.flat, groups):
        axis.set_title(str(value).removeprefix("builtin:"))
    return figure, [(axis, part) for axis, (_, part) in zip(axes.flat, groups)]


def _roles(runs: pandas.DataFrame, names: Sequence[str]) -> tuple[str | None, str | None]:
    """The options that colours and styles of lines tell: the one with most values has the colours."""
    few = [name for name in names if runs[name].nunique() <= MOST_ENTRIES]
    few.sort(key=lambda name: -runs[name].nunique())
    colour = few[0] if few else None
    style = next((name for name in few[1:] if runs[name].nunique() <= len(STYLES)), None)
    return colour, style


def _look(runs: pandas.DataFrame, row: dict[str, Any], colour: str | None, style: str | None) -> dict[str, Any]:
    look: dict[str, Any] = {"color": _colour(runs, colour, row.get(colour or ""))}
    if style is not None:
        look["linestyle"] = STYLES[_values(runs, style).index(row[style])]
    if colour is None and len(runs) > 1:
        look["alpha"] = 0.5
    return look


def _values(runs: pandas.DataFrame, name: str) -> list[Any]:
    """The values of an option, in the order of the numbers or of the table."""
    values = list(runs[name].dropna().unique())
    numbers = _numbers(pandas.Series(values))
    return values if numbers is None else [value for _, value in sorted(zip(numbers, values))]


def _colour(runs: pandas.DataFrame, name: str | None, value: Any) -> Any:
    """Numbers have colours from dark to light, texts have colours that differ."""
    if name is None or _is_missing(value):
        return COLOURS[0]
    values = _values(runs, name)
    place = values.index(value)
    if _numbers(pandas.Series(values)) is not None and len(values) > 2:
        return matplotlib.colormaps["viridis"](0.88 * place / (len(values) - 1))
    return COLOURS[place % len(COLOURS)]


def _marker(runs: pandas.DataFrame, name: str | None, value: Any) -> str:
    return MARKERS[0] if name is None else MARKERS[_values(runs, name).index(value) % len(MARKERS)]


def _legend(figure: Figure, runs: pandas.DataFrame, colour: str | None, style: str | None, with_markers: bool = False) -> None:
    """One legend to the right of all panels, in which the names of the options are headings."""
    entries: list[Any] = []
    for name in (colour, style):
        if name is None:
            continue
        entries.append(plt.Line2D([], [], linestyle="none", label=("\n" if entries else "") + name.removeprefix("--")))
        for place, value in enumerate(_values(runs, name)):
            look = {"color": _colour(runs, colour, value)} if name == colour else {"color": "#444444", "linestyle": STYLES[place]}
            if with_markers:
                look["marker"] = _marker(runs, name, value)
            entries.append(plt.Line2D([], [], label=str(value).removeprefix("builtin:"), **look))
    if entries:
        figure.legend(handles=entries, loc="outside right upper")


def _scale(axis: Axes, which: str, values: pandas.Series, log: str = "auto") -> None:
    """A logarithmic axis where that helps or was asked for, and whole numbers for whole values."""
    values = values.dropna()
    if (values == values.round()).all():
        (axis.xaxis if which == "x" else axis.yaxis).set_major_locator(MaxNLocator(integer=True))
    if _is_log(which, values, log):
        (axis.set_xscale if which == "x" else axis.set_yscale)("log")


def _is_log(which: str, values: pandas.Series, log: str = "auto") -> bool:
    """Whether an axis is logarithmic: its values are positive, and differ by more than a factor of ten unless it was asked for."""
    positive = len(values) > 0 and values.min() > 0
    return bool(positive and (log in (which, "both") or log == "auto" and values.max() > 10 * values.min()))


def _label(name: str, runs: pandas.DataFrame, unit: str) -> str:
    """The name of a quantity and its unit."""
    text = NAMES.get(name, name.removeprefix("--").replace(".", ", ").replace("_", " "))
    plane = "length" in runs and runs["length"].notna().any()
    dimension = _unit(name, runs, unit, plane)
    return f"{text} ({dimension})" if dimension else text


def _unit(name: str, runs: pandas.DataFrame, unit: str, plane: bool) -> str:
    if name.endswith("percent") or name == "--tolerance" and runs[name].dropna().astype(str).str.endswith("%").all():
        return "%"
    if name == "seconds":
        return "s"
    if name == "energy":
        return f"1/{unit}" if plane else ""
    if name == "time":
        return unit + SUPERSCRIPTS[2 if set(runs["command"]) == {"mcf"} else 4]
    power = 1 if name == "--tolerance" else POWERS.get(name, 0)
    return unit + SUPERSCRIPTS[power] if power else ""


def _is_missing(value: Any) -> bool:
    return value is None or value != value


def _empty(text: str) -> Figure:
    figure, axis = plt.subplots(figsize=(5, 2))
    axis.set_axis_off()
    axis.text(0.5, 0.5, text, ha="center")
    return figure
