//! Plans of discrete Fourier transforms. This crate compiles the generic code of the FFT libraries once. The crates that transform need not
//! compile it again.

use std::sync::Arc;

use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftNum, FftPlanner};

/// Transforms of the lines along the axes of a grid; none is normalized.
pub struct Plans<T> {
    /// Of the last axis, to the half spectrum.
    pub real: Arc<dyn RealToComplex<T>>,
    /// Its inverse.
    pub real_inverse: Arc<dyn ComplexToReal<T>>,
    /// Of the other axes in their order: forward and inverse.
    pub complex: Vec<[Arc<dyn Fft<T>>; 2]>,
}

/// `f64` or `f32`.
pub trait Planned: FftNum {
    /// Plans for a grid of at least one axis.
    fn plans(shape: &[usize]) -> Plans<Self>;
}

impl Planned for f32 {
    fn plans(shape: &[usize]) -> Plans<Self> {
        plans(shape)
    }
}

impl Planned for f64 {
    fn plans(shape: &[usize]) -> Plans<Self> {
        plans(shape)
    }
}

fn plans<T: FftNum>(shape: &[usize]) -> Plans<T> {
    let (&last, others) = shape.split_last().expect("a grid has an axis");
    let mut planner = RealFftPlanner::new();
    let real = planner.plan_fft_forward(last);
    let real_inverse = planner.plan_fft_inverse(last);
    let mut planner = FftPlanner::new();
    let mut both = |&n: &usize| [planner.plan_fft_forward(n), planner.plan_fft_inverse(n)];
    Plans {
        real,
        real_inverse,
        complex: others.iter().map(&mut both).collect(),
    }
}
