# The configuration and the tables, checked, and what the rules ask of them.
import re
import sys
from dataclasses import asdict
from pathlib import Path

from snakemake.exceptions import WorkflowError

sys.path.insert(0, str(Path(workflow.basedir) / "scripts"))
from sweeps import gather, plots, tables

_errors = tables.check_config(config, "config/config.yaml")
if _errors:
    raise WorkflowError("\n".join(_errors))
try:
    GROUPS = tables.load(config.get("runs"), config.get("folders"))
except tables.TableError as error:
    raise WorkflowError(str(error)) from None

RUNS = {(run.group, run.name): run for runs in GROUPS.values() for run in runs}
FIGURES = {plots.name_of(figure): figure for figure in config.get("figures", [])}
PROGRAM = config.get("program", "willmore")


wildcard_constraints:
    group="|".join(map(re.escape, GROUPS)),
    run="|".join(re.escape(name) for _, name in RUNS),
    figure="|".join(map(re.escape, FIGURES)) or "none",


def run_of(wildcards):
    return RUNS[wildcards.group, wildcards.run]


def outcomes_of(wildcards):
    return [f"results/outcomes/{wildcards.group}/{run.name}.json" for run in GROUPS[wildcards.group]]


def targets(wildcards):
    """Outcomes, tables and figures of every group. Without the outcomes, tables that are there would hide those that `--retry` has taken away."""
    files = []
    for group, runs in GROUPS.items():
        files += [f"results/outcomes/{group}/{run.name}.json" for run in runs]
        files += [f"results/tables/{group}.{suffix}" for suffix in ("csv", "parquet", "html")]
        files += [f"results/tables/{group}_steps.{suffix}" for suffix in ("csv", "parquet")]
        files += [f"results/figures/{group}/{name}" for name in ("energy.svg", "shapes.png")]
        if group == tables.SWEEP:
            files += [f"results/figures/{group}/{figure}.svg" for figure in FIGURES]
    return files
