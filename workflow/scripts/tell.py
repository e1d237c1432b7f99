"""Prints what came of a sweep, with a line for each run that the program has refused."""

import json
from collections import Counter
from pathlib import Path

outcomes = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(Path("results/outcomes").glob("*/*.json"))]
for outcome in outcomes:
    if outcome["status"] != "finished":
        print(f"{outcome['status']}: {outcome['run']}: {outcome['message']}")
counts = Counter(outcome["status"] for outcome in outcomes)
print(", ".join(f"{counts[status]} {status}" for status in ("finished", "failed", "refused") if counts[status]))
print("tables are in results/tables, figures in results/figures, the report is results/report.zip")
