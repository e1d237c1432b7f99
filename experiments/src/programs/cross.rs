use crate::comparison::{self, Setting};
use crate::prelude::*;
use crate::truth;

pub const EXPERIMENT: Experiment = Experiment {
    name: "cross",
    summary: "The cross under Willmore flow.",
    program: |own| comparison::run(own, &SETTING),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "cross",
        title: "Willmore flow of a cross",
        description: "All methods against nested implicit finite elements on a finer grid.",
        figures: comparison::FIGURES,
        options: Some("--full"),
    }],
    metrics: &[&comparison::METRICS],
    words: &[("SHAPE", "`cross`")],
};

/// The cross; others are like it.
pub const SETTING: Setting = Setting {
    program: EXPERIMENT.name,
    title: EXPERIMENT.results[0].title,
    about: "Willmore flow of a non-convex cross, eps = 2^-6, tau = tautilde = 2^-14, until t = 2^-7, by all methods and resolutions \
            (finite elements from n = 256 on, where they are stable): L2 distance to a finer implicit finite-element run, and shapes",
    shape: "cross [-.8,.8] x [-.27,.27]",
    sample: truth::CROSS,
    flow: Flow::Willmore,
    shown: &[0, 32, 64, 96, 128],
    reference_ratio: 1,
    window: 0.95,
};
