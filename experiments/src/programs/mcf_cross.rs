//! The cross under mean curvature flow.

use crate::comparison::Setting;
use crate::prelude::*;
use crate::truth;

pub const SETTING: Setting = Setting {
    program: "mcf_cross",
    title: "Mean curvature flow of a cross",
    about: "Mean curvature flow of a non-convex cross, eps = 2^-6, tautilde = 2^-14, until t = 2^-7, by all methods and resolutions: \
            L2 distance to a finer implicit finite-element run with time step 2^-16, and shapes",
    shape: "cross [-.8,.8] x [-.27,.27]",
    sample: truth::CROSS,
    flow: Flow::MeanCurvature,
    steps: 128,
    shown: &[0, 64, 128],
    reference_ratio: 4,
    window: 0.95,
};
