"""Forgets the outcomes of runs that the program has refused, so that they are made again."""

import json
from pathlib import Path

for path in Path("results/outcomes").glob("*/*.json"):
    if json.loads(path.read_text(encoding="utf-8"))["status"] != "finished":
        path.unlink()
