"""Starts or resumes a run, and writes its outcome. A refusal by the program is an outcome, too, so that it stops no other run."""

import json
import signal
import sys
from pathlib import Path

from sweeps.program import Program, Stopped, beside, outcome_of
from sweeps.tables import Run

# Ctrl-C and the time limit of a cluster reach the program as well, which finishes its step. This script waits for it.
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, lambda *_: None)
try:
    outcome = outcome_of(Run(**snakemake.params.run), Program(snakemake.params.program, snakemake.threads))
except Stopped as stopped:
    Path(snakemake.log[0]).write_text(f"{stopped}\n", encoding="utf-8")
    sys.exit(f"{snakemake.wildcards.run}: {stopped}; the next start goes on from the newest checkpoint")
# Whole or not at all: a kill leaves no half of a file that looks like an outcome.
whole = beside(Path(snakemake.output[0]), ".part")
whole.write_text(json.dumps(outcome, indent=2) + "\n", encoding="utf-8")
whole.replace(snakemake.output[0])
Path(snakemake.log[0]).write_text(f"{outcome['status']}\nmessages of the program: {outcome['log']}\n", encoding="utf-8")
