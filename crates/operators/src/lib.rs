//! Burn extension operations on periodic grids, and the choice of the device they run on.
//!
//! ```
//! use operators::{ComputeDevice, circular_convolution};
//!
//! # fn main() -> Result<(), operators::Error> {
//! // A discrete unit impulse, smoothed by a 3 x 3 box kernel with periodic wrap-around.
//! let device = ComputeDevice::default_compiled()?;
//! let mut impulse = vec![0.0; 36];
//! impulse[0] = 9.0;
//! let u = device.tensor::<2>(&impulse, [6, 6]);
//! let kernel = device.tensor::<2>(&[1.0 / 9.0; 9], [3, 3]);
//! let smooth = device.values(circular_convolution(u, kernel, false))?;
//! assert!((smooth[35] - 1.0).abs() < 1e-5, "node (5, 5) is a neighbour of node (0, 0)");
//! assert!(smooth[14].abs() < 1e-5, "node (2, 2) is not");
//! # Ok(())
//! # }
//! ```
//!
//! | operation | formula | derivative |
//! |---|---|---|
//! | [`circular_convolution`] | `y_a = sum_b K_b x_{a+b}` | by `x`: the same operation with `adjoint` flipped; by `K`: `c_b = sum_a g_a x_{a+b}` for the gradient `g` of the output |
//! | [`brick_convolution`] | `y_a = sum t_b .. t_c x_{a+(b,..,c)}` on active bricks (`geometry::Bricks`) | the same operation with `adjoint` flipped |
//! | [`brick_pass`] | `y_a = sum t_b x_{a + b e}` on active bricks, along one axis `e` | its transpose |
//! | [`tabulated`] | `y_a = F^(k)(w_a)`, `F` a quintic Hermite table | the same operation with `k + 1` |
//! | [`spectral_filter`] | `y = F^-1[symbol F[x]]` | none (preconditioners) |
//! | [`inner_product`], [`squared_distance`], [`scaled`], [`add_scaled`], [`combined`] | `sum a b`, `sum (a - b)^2`, `a x`, `x + alpha y`, `a x + b y` | none (iterative solvers) |
//! | [`update_on_host`] | a vector changed by a computation on the host | none (iterative solvers) |
//! | [`retract`], [`extrapolate`] | motions in the variable `atanh u` | none (line searches) |
//!
//! # Conventions
//!
//! - Grids are row-major, the last axis fastest.
//! - A kernel has the same odd width on every axis, and its centre is in the middle. If a tensor has more axes than the kernel, the leading
//!   ones are a batch.
//! - The CPU backends (`flex`, `ndarray`) compute in the tensor's own precision, `f64` unless asked otherwise. They use real FFTs of any length
//!   (realfft, rustfft).
//! - On a GPU the operations are CubeCL kernels, or composed of Burn's operations. They compute in `f32` on `wgpu`, and usually in `f64` on
//!   `cuda`.
//! - On a CPU the same input gives the same bytes, for any number of threads.

// Burn 0.22 deprecates its ndarray backend in favour of flex; it stays selectable here until it is gone.
#![cfg_attr(feature = "ndarray", allow(deprecated))]
// A GPU-only build compares with the host kernels at start-up but runs none of the rest.
#![cfg_attr(
    not(any(feature = "flex", feature = "ndarray")),
    allow(dead_code, unused_macros, unused_imports)
)]

pub mod memory;
pub mod recording;
pub mod slices;

mod brick_convolution;
mod convolution;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
mod cube;
mod device;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
mod device_check;
mod elementwise;
mod error;
mod fft;
mod filter;
mod fresh;
#[macro_use]
mod host;
mod interpolation;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
mod kernels;
mod lanes;
mod open;
mod ops;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
mod primitive;
mod profile;
mod rules;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
mod spectral;
mod table;
mod tensor;
mod vector;

pub use brick_convolution::{convolution_of_outside, pass_of_outside};
pub use convolution::kernel_symbol;
pub use device::{ComputeDevice, DeviceKind};
pub use error::Error;
pub use fft::{Real, Transform};
pub use filter::SpectralFilter;
pub use interpolation::Interpolation;
pub use ops::{GridOps, Operation};
pub use rules::extensions;
pub use table::{COEFFICIENTS, HermiteTable, TableRange};
pub use tensor::{brick_convolution, brick_pass, circular_convolution, tabulated};
pub use vector::{
    HostUpdate, Motion, SharedUpdate, VectorOps, add_scaled, combined, extrapolate, inner_product,
    retract, scaled, scaled_as, spectral_filter, squared_distance, update_on_host,
};

/// Reproducible numbers in `[-1/2, 1/2)`.
#[cfg(test)]
fn noise(count: usize, seed: u64) -> Vec<f64> {
    use rand::{RngExt, SeedableRng};
    let mut rng = chacha20::ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| rng.random_range(-0.5..0.5)).collect()
}
