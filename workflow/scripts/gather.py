"""Writes the tables of all runs of a group and of all their steps."""

from pathlib import Path

from sweeps import gather, logs

with logs.to(snakemake.log[0]):
    outcomes = gather.read(snakemake.input)
    runs, steps = gather.runs_table(outcomes), gather.steps_table(outcomes)
    runs.to_csv(snakemake.output.csv, index=False)
    runs.to_parquet(snakemake.output.parquet, index=False)
    steps.to_csv(snakemake.output.steps_csv, index=False)
    steps.to_parquet(snakemake.output.steps_parquet, index=False)
    Path(snakemake.output.html).write_text(gather.page(runs), encoding="utf-8")
