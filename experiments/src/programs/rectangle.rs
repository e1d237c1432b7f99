use crate::comparison::{self, Setting};
use crate::prelude::*;
use crate::programs::cross;
use crate::truth;

pub const EXPERIMENT: Experiment = Experiment {
    name: "rectangle",
    summary: "The rectangle under Willmore flow.",
    program: |own| comparison::run(own, &SETTING),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "rectangle",
        title: "Willmore flow of a rectangle",
        description: "All methods against nested implicit finite elements on a finer grid.",
        figures: comparison::FIGURES,
        options: Some("--full"),
    }],
    metrics: &[&comparison::METRICS],
    words: &[("SHAPE", "`rectangle`")],
};

const SETTING: Setting = Setting {
    program: EXPERIMENT.name,
    title: EXPERIMENT.results[0].title,
    about: "Willmore flow of a rectangle with sides 0.4 and 0.2, eps = 2^-6, tau = tautilde = 2^-14, until t = 2^-7, by all methods \
            and resolutions (finite elements from n = 256 on, where they are stable): L2 distance to a finer implicit \
            finite-element run, and shapes",
    shape: "rectangle 0.4 x 0.2",
    sample: truth::RECTANGLE,
    window: 0.5,
    ..cross::SETTING
};
