"""Progress of long work."""

from __future__ import annotations

import sys
from typing import Any, Callable, Union

Progress = Union[bool, Callable[[str, int, int], Any]]


def told(progress: Progress) -> Callable[[str, int, int], Any] | None:
    """The function that is told how far long work is, if somebody wants to know."""
    if progress is True:
        return _Bars()
    return progress or None


class _Bars:
    """Bars of tqdm, or a line on standard error for each part of the work without it."""

    def __init__(self) -> None:
        self._title, self._bar = "", None

    def __call__(self, title: str, done: int, parts: int) -> None:
        if title != self._title:
            self._begin(title, parts)
        if self._bar is not None:
            self._bar.update(done - self._bar.n)
            if done >= parts:
                self._bar.close()

    def _begin(self, title: str, parts: int) -> None:
        self._title = title
        try:
            from tqdm.auto import tqdm
        except ImportError:
            print(f"{title} ...", file=sys.stderr)
            return
        if self._bar is not None:
            self._bar.close()
        self._bar = tqdm(total=parts, desc=title, leave=False)
