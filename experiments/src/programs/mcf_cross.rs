use crate::comparison::{self, Setting};
use crate::prelude::*;
use crate::programs::cross;

pub const EXPERIMENT: Experiment = Experiment {
    name: "mcf_cross",
    summary: "The cross under mean curvature flow.",
    program: |own| comparison::run(own, &SETTING),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "mcf_cross",
        title: "Mean curvature flow of a cross",
        description: "A cross that is not convex under mean curvature flow, against finite elements on a finer grid with \
                 smaller steps.",
        figures: comparison::FIGURES,
        options: Some("--full --reference-n 2048"),
    }],
    metrics: &[&comparison::METRICS],
    words: &[("SHAPE", "`mcf_cross`")],
};

const SETTING: Setting = Setting {
    program: EXPERIMENT.name,
    title: EXPERIMENT.results[0].title,
    about: "Mean curvature flow of a non-convex cross, eps = 2^-6, tautilde = 2^-14, until t = 2^-7, by all methods and resolutions: \
            L2 distance to a finer implicit finite-element run with time step 2^-16, and shapes",
    flow: Flow::MeanCurvature,
    shown: &[0, 64, 128],
    reference_ratio: 4,
    ..cross::SETTING
};
