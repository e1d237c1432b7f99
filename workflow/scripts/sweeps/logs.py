"""Messages of scripts."""

import contextlib
import traceback
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def to(path: str) -> Iterator[None]:
    """Sends what is printed to a file, and the error that ends the script, too."""
    with Path(path).open("w", encoding="utf-8") as file, contextlib.redirect_stdout(file), contextlib.redirect_stderr(file):
        try:
            yield
        except Exception:
            traceback.print_exc()
            raise
