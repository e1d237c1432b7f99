//! What a network depends on.

use derive_more::Display;
use serde::{Deserialize, Serialize};

/// What a network depends on; one network serves every grid with these ratios.
#[derive(Clone, Copy, Debug, PartialEq, Display, Serialize, Deserialize)]
#[display("{dimension}D, n_K = {width}, eps/h = {eps_over_h}, tautilde/h^2 = {step_over_h2}")]
pub struct Ratios {
    /// Dimension `D` of space.
    pub dimension: usize,
    /// Kernel width `n_K`, odd.
    pub width: usize,
    /// Interface width over grid spacing, `eps / h`.
    pub eps_over_h: f64,
    /// Time step of the mean curvature flow over the squared spacing, `tautilde / h^2`.
    pub step_over_h2: f64,
}

impl Ratios {
    /// The ratios of a run with interface width `eps` and inner step `mcf_step` on a grid of spacing `h`.
    pub const fn of_run(dimension: usize, width: usize, h: f64, eps: f64, mcf_step: f64) -> Self {
        Self {
            dimension,
            width,
            eps_over_h: eps / h,
            step_over_h2: mcf_step / (h * h),
        }
    }

    /// Whether `other` differs by no more than rounding.
    pub fn matches(&self, other: &Self) -> bool {
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(b.abs());
        self.dimension == other.dimension
            && self.width == other.width
            && close(self.eps_over_h, other.eps_over_h)
            && close(self.step_over_h2, other.step_over_h2)
    }

    /// Time step of the mean curvature flow over the squared interface width, `tautilde / eps^2`.
    pub fn step_over_eps2(&self) -> f64 {
        self.step_over_h2 / self.eps_over_h.powi(2)
    }

    /// Number of kernel entries, `n_K^D`.
    pub fn kernel_len(&self) -> usize {
        self.width.pow(self.dimension as u32)
    }
}

/// Offsets from the centre of all entries of a `width^dimension` kernel, in cells, row-major.
pub(crate) fn offsets(dimension: usize, width: usize) -> impl Iterator<Item = Vec<isize>> {
    (0..width.pow(dimension as u32)).map(move |mut i| {
        let mut offset = vec![0; dimension];
        for along in offset.iter_mut().rev() {
            *along = (i % width) as isize - (width / 2) as isize;
            i /= width;
        }
        offset
    })
}
