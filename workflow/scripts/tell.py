"""Prints what came of a sweep, with a line for each run that the program has refused."""

import json
import sys
from collections import Counter
from pathlib import Path

import yaml
from sweeps import tables

config = yaml.safe_load(Path(sys.argv[1]).read_text(encoding="utf-8"))
counts: Counter[str] = Counter()
for group, runs in tables.load(config.get("runs"), config.get("folders")).items():
    for run in runs:
        outcome = json.loads(Path(f"results/outcomes/{group}/{run.name}.json").read_text(encoding="utf-8"))
        counts[outcome["status"]] += 1
        if outcome["status"] != "finished":
            print(f"{outcome['status']}: {run.name}: {outcome['message']}")
print(", ".join(f"{counts[status]} {status}" for status in ("finished", "failed", "refused") if counts[status]))
print("tables are in results/tables, figures in results/figures, the report is results/report.zip")
