"""Options of the library by their names."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ._willmore import Error

Named = list[tuple[str, "str | None"]]


def named(options: dict[str, Any]) -> Named:
    """Names and texts of the options that are given."""
    pairs: Named = []
    for name, value in options.items():
        if value is None or value is False:
            continue
        pairs.append((name, None if value is True else _text(name, value)))
    return pairs


def _text(name: str, value: Any) -> str:
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    raise Error(f"`{name}` must be a number or a text, not {type(value).__name__}")
