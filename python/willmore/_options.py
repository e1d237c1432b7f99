"""Options of the library by their names."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ._willmore import Error

Named = list[tuple[str, "str | None"]]

_OF_FOLDERS = {"checkpoint_every", "force", "format", "frames", "no_page", "output", "save"}


def named(options: dict[str, Any]) -> Named:
    """Names and texts of the options that are given."""
    pairs: Named = []
    for name, value in options.items():
        if value is None or isinstance(value, (bool, np.bool_)) and not value:
            continue
        pairs.append((name, None if isinstance(value, (bool, np.bool_)) else _text(name, value)))
    return pairs


def in_memory(options: dict[str, Any]) -> Named:
    """Names and texts of the options of a job without a folder."""
    given = named(options)
    for name, _ in given:
        if name.replace("-", "_") in _OF_FOLDERS:
            raise Error(f"`{name}` is an option of runs in folders: see `Run.start`. Without a folder, results have a method `save`")
    return given


def _text(name: str, value: Any) -> str:
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    raise Error(f"`{name}` must be a number or a text, not {type(value).__name__}")
