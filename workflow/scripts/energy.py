"""Draws the energy of all runs of a group over time."""

import pandas
from sweeps import logs, plots

with logs.to(snakemake.log[0]):
    runs, steps = pandas.read_parquet(snakemake.input.runs), pandas.read_parquet(snakemake.input.steps)
    plots.energy(runs, steps, snakemake.params.unit).savefig(snakemake.output[0], metadata={"Date": None})
