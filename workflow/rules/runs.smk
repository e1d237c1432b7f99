# One job for each run. The folder of a run is no output, since Snakemake deletes outputs before a job and after a failed one.
rule run:
    input:
        lambda wildcards: run_of(wildcards).files(),
    output:
        "results/outcomes/{group}/{run}.json",
    log:
        "results/logs/run/{group}/{run}.log",
    conda:
        "../envs/scripts.yaml"
    params:
        run=lambda wildcards: asdict(run_of(wildcards)),
        program=PROGRAM,
    threads: config.get("threads", 1)
    resources:
        gpu=lambda wildcards: run_of(wildcards).gpus(),
    script:
        "../scripts/run.py"
