"""Draws the shapes of all runs of a group."""

import pandas
from sweeps import logs, plots

with logs.to(snakemake.log[0]):
    plots.shapes(pandas.read_parquet(snakemake.input[0])).savefig(snakemake.output[0], dpi=150)
