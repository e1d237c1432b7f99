"""Checks the configuration and the tables of a sweep: a line for each error. Snakemake does so, too, but with its own lines around."""

import shutil
import sys
from pathlib import Path
from typing import Any

import yaml
from sweeps import tables


def errors(path: str) -> list[str]:
    try:
        config: Any = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        return [f"{path}: no YAML: {' '.join(str(error).split())}"]
    if not isinstance(config, dict):
        return [f"{path}: no entries; give at least `runs: config/runs.tsv`"]
    found = tables.check_config(config, path)
    if found:
        return found
    program = config.get("program", "willmore")
    if shutil.which(program) is None:
        found.append(f"{path}, program: there is no program {program}; install it by `cargo install --path crates/cli`, or give its path")
    try:
        tables.load(config.get("runs"), config.get("folders"))
    except tables.TableError as error:
        found += error.lines
    return found


if __name__ == "__main__":
    lines = errors(sys.argv[1])
    print(*lines, sep="\n", end="\n" if lines else "", file=sys.stderr)
    sys.exit(2 if lines else 0)
