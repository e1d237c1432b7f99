# Tables and figures of all runs of a group.
localrules:
    all,
    gather,
    energy,
    figure,
    shapes,


rule gather:
    input:
        outcomes_of,
    output:
        csv="results/tables/{group}.csv",
        parquet="results/tables/{group}.parquet",
        html=report("results/tables/{group}.html", caption="../report/table.rst", category="{group}", labels={"what": "table of the runs"}),
        steps_csv="results/tables/{group}_steps.csv",
        steps_parquet="results/tables/{group}_steps.parquet",
    log:
        "results/logs/gather/{group}.log",
    conda:
        "../envs/scripts.yaml"
    script:
        "../scripts/gather.py"


rule energy:
    input:
        runs="results/tables/{group}.parquet",
        steps="results/tables/{group}_steps.parquet",
    output:
        report("results/figures/{group}/energy.svg", caption="../report/energy.rst", category="{group}", labels={"what": "energy over time"}),
    log:
        "results/logs/energy/{group}.log",
    conda:
        "../envs/scripts.yaml"
    params:
        unit=config.get("unit", "length"),
    script:
        "../scripts/energy.py"


rule figure:
    input:
        "results/tables/{group}.parquet",
    output:
        report("results/figures/{group}/{figure}.svg", caption="../report/figure.rst", category="{group}", labels={"what": "{figure}"}),
    log:
        "results/logs/figure/{group}/{figure}.log",
    conda:
        "../envs/scripts.yaml"
    params:
        figure=lambda wildcards: FIGURES[wildcards.figure],
        unit=config.get("unit", "length"),
    script:
        "../scripts/figure.py"


rule shapes:
    input:
        "results/tables/{group}.parquet",
    output:
        report("results/figures/{group}/shapes.png", caption="../report/shapes.rst", category="{group}", labels={"what": "shapes at the end"}),
    log:
        "results/logs/shapes/{group}.log",
    conda:
        "../envs/scripts.yaml"
    script:
        "../scripts/shapes.py"
