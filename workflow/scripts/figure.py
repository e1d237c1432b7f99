"""Draws a result of all runs over a parameter."""

import pandas
from sweeps import logs, plots

with logs.to(snakemake.log[0]):
    runs = pandas.read_parquet(snakemake.input[0])
    plots.metric(runs, snakemake.params.figure, snakemake.params.unit).savefig(snakemake.output[0], metadata={"Date": None})
