//! The rectangle under Willmore flow.

use crate::comparison::Setting;
use crate::prelude::*;
use crate::truth;

pub const SETTING: Setting = Setting {
    program: "rectangle",
    title: "Willmore flow of a rectangle",
    about: "Willmore flow of a rectangle with sides 0.4 and 0.2, eps = 2^-6, tau = tautilde = 2^-14, until t = 2^-7, by all methods \
            and resolutions (finite elements from n = 256 on, where they are stable): L2 distance to a finer implicit \
            finite-element run, and shapes",
    shape: "rectangle 0.4 x 0.2",
    sample: truth::RECTANGLE,
    flow: Flow::Willmore,
    steps: 128,
    shown: &[0, 32, 64, 96, 128],
    reference_ratio: 1,
    window: 0.5,
};
