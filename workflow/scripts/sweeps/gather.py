"""Tables of all runs and of all steps."""

import html
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pandas

# Of a summary: what the table has already.
TOLD = {"command", "finished"}
# Columns of the page, if the table has them, beside the options that differ.
SHOWN = {
    "label": "label",
    "steps": "steps",
    "energy": "energy",
    "volume": "volume",
    "area": "area",
    "volume_change_percent": "change of volume (%)",
    "mesh.volume_change_percent": "change of the volume of the mesh (%)",
    "mesh.displacement_rms": "displacement, root mean square",
    "mesh.displacement_largest": "largest displacement",
    "seconds": "seconds",
}


def read(outcomes: Iterable[str]) -> list[dict[str, Any]]:
    return [json.loads(Path(path).read_text(encoding="utf-8")) for path in outcomes]


def runs_table(outcomes: list[dict[str, Any]]) -> pandas.DataFrame:
    """A row for each run, for each label with all labels. Names of options begin with --, so that none is that of a result."""
    return _plain(pandas.DataFrame([row for outcome in outcomes for row in _rows(outcome)]))


def _rows(outcome: dict[str, Any]) -> Iterator[dict[str, Any]]:
    options = {f"--{name}": value for name, value in outcome["options"].items()}
    for result in outcome["results"] or [{}]:
        yield {
            "run": outcome["run"],
            "label": result.get("label"),
            "status": outcome["status"],
            "message": outcome["message"],
            "warnings": " | ".join(outcome["warnings"]) or None,
            "command": outcome["command"],
            "input": outcome["input"],
            **options,
            "ended": result.get("ended"),
            "mesh": result.get("mesh"),
            "folder": result.get("folder"),
            "log": outcome["log"],
            "program": outcome["program"],
            "seconds": result.get("seconds"),
            **{name: value for name, value in _flat(result.get("summary", {})) if name not in TOLD},
        }


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """The numbers and texts inside of an object, with the path to each, such as grid.cells."""
    if isinstance(value, (dict, list)):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, inner in items:
            yield from _flat(inner, f"{name}.{key}" if name else str(key))
    else:
        yield name, value


def _plain(table: pandas.DataFrame) -> pandas.DataFrame:
    """Columns of texts and numbers become texts, since a column of Parquet has one type."""
    for name in table:
        values = table[name].dropna()
        if {isinstance(value, str) for value in values} == {True, False}:
            table[name] = table[name].map(lambda value: value if value is None or value != value else str(value))
    return table


def steps_table(outcomes: list[dict[str, Any]]) -> pandas.DataFrame:
    """A row for each step of all runs."""
    tables = []
    for outcome in outcomes:
        for result in outcome["results"]:
            steps = pandas.read_csv(Path(result["folder"]) / "metrics.csv")
            for place, (name, value) in enumerate({"run": outcome["run"], "label": result["label"], "folder": result["folder"]}.items()):
                steps.insert(place, name, value)
            tables.append(steps)
    return _plain(pandas.concat(tables, ignore_index=True)) if tables else pandas.DataFrame(columns=["run", "label", "folder", "step", "time"])


def varied(runs: pandas.DataFrame) -> list[str]:
    """The columns of inputs and options in which runs differ."""
    names = [name for name in runs if name in ("command", "input") or name.startswith("--")]
    return [name for name in names if runs[name].nunique(dropna=False) > 1]


def page(runs: pandas.DataFrame) -> str:
    """The most important columns as a page for the browser."""
    columns = {name: name for name in ["run", "status", *varied(runs)] if name != "input" or "run" not in runs}
    columns |= {name: title for name, title in SHOWN.items() if name in runs and runs[name].notna().any()}
    head = "".join(f"<th>{html.escape(title)}</th>" for title in [*columns.values(), "what the program told"])
    rows = [(row, [*(row[name] for name in columns), _told(row)]) for row in runs.to_dict("records")]
    body = "".join(f'<tr class="{row["status"]}">{"".join(map(_cell, cells))}</tr>\n' for row, cells in rows)
    count = runs.drop_duplicates("run")["status"].value_counts()
    title = ", ".join(f"{number} {status}" for status, number in count.items())
    return PAGE.replace("TITLE", title).replace("HEAD", head).replace("BODY", body)


def _told(row: dict[str, Any]) -> str:
    """Why a run ended, its warnings, and why it was refused."""
    return "; ".join(row[name] for name in ("ended", "warnings", "message") if isinstance(row[name], str))


def _cell(value: Any) -> str:
    if value is None or value != value:
        return "<td></td>"
    if isinstance(value, float):
        return f'<td class="number">{value:.5g}</td>'
    return f"<td{' class=number' if isinstance(value, int) else ''}>{html.escape(str(value))}</td>"


PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>TITLE</title><style>
body { font: 14px/1.4 system-ui, sans-serif; margin: 1em; color: #222; background: #fff; }
table { border-collapse: collapse; }
th, td { padding: 0.25em 0.7em; border-bottom: 1px solid #ddd; text-align: left; vertical-align: top; }
th { position: sticky; top: 0; background: #f3f3f3; }
.number { text-align: right; font-variant-numeric: tabular-nums; }
.refused td, .failed td { background: #fdf0e6; }
</style></head><body><h1>TITLE</h1>
<table><thead><tr>HEAD</tr></thead><tbody>
BODY</tbody></table></body></html>
"""
