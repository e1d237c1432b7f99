//! The learned operator $`V[u] = F(K * u)`$, a step of mean curvature flow: network, training, quality, calibration, storage.
//! [`MeanCurvatureOperator`] is a [`mean_curvature::MeanCurvatureStep`].
//!
//! ```
//! use geometry::{Grid, exact::mean_curvature_radius, measure::l2_distance, phase_field, shapes::Ball};
//! use model::{MeanCurvatureOperator, Ratios, Shipped};
//! use operators::ComputeDevice;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // One step of mean curvature flow of a disc, at h = 1/128 with eps = 2 h and tautilde = h^2.
//! let grid = Grid::<2>::per_unit(128, 1.0)?;
//! let (eps, step) = (2.0 * grid.spacing(), grid.spacing().powi(2));
//! let network = Shipped::Paper.find(Ratios::of_run(2, 17, grid.spacing(), eps, step))?;
//!
//! let device = ComputeDevice::default_compiled()?;
//! let operator = MeanCurvatureOperator::<2>::new(&network, &device)?;
//! let disc = |radius| phase_field(grid, &Ball::<2>::new([0.0, 0.0], radius)?, eps);
//! let u = device.tensor::<2>(disc(0.2)?.values(), grid.shape());
//! let v = geometry::Field::from_values(grid, device.values(operator.apply(u))?)?;
//!
//! let exact = disc(mean_curvature_radius(0.2, step, 2))?;
//! assert!(l2_distance(&v, &exact)? < 0.05 * l2_distance(&disc(0.2)?, &exact)?);
//! # Ok(())
//! # }
//! ```
//!
//! # The network
//!
//! $`K`$ is a convolution kernel of odd width $`n_K`$. $`F: \mathbb{R} \to \mathbb{R}`$ is a perceptron `1-32-16-8-4-2-1` ([`Mlp`]). Both are
//! trained so that shrinking spheres follow mean curvature flow (Bretin, Denis, Masnou and Terii, J. Comput. Phys. 470,
//! 2022). Rumpf, Sassen and Norden-Smoch use this form. Let $`\varepsilon`$ be the width of the interface, $`h`$ the spacing of the grid and
//! $`\tilde\tau`$ the size of the step. The operator depends only on the ratios $`\varepsilon / h`$ and $`\tilde\tau / h^2`$ ([`Ratios`]). So one
//! network serves every grid with these ratios. [`Networks`] chooses among your networks and the shipped ones.
//!
//! # Training
//!
//! [`training::adam`] is the method of Rumpf, Sassen and Norden-Smoch. [`training::levenberg_marquardt`] minimizes their loss to its floor in
//! about half a minute. The smallest spheres dominate this loss, so losses for different radii cannot be compared. [`Quality`] measures the loss
//! on two fixed sets of radii. For Willmore flow a small loss is not enough: see [`mean_curvature::calibration`].
//!
//! Errors of the device and of the crates that this crate depends on pass through unchanged.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

mod calibration;
mod error;
mod mlp;
mod network;
mod networks;
mod operator;
mod pretrained;
mod quality;
mod ratios;
mod separable;
mod store;
pub mod training;

pub use error::Error;
pub use mlp::{Mlp, PAPER_LAYERS, forward, parameter_count};
pub use network::{Network, Provenance};
pub use networks::{NamedNetwork, NeededNetwork, Networks};
pub use operator::MeanCurvatureOperator;
pub use pretrained::Shipped;
pub use quality::{Quality, REFERENCE_RADII, displacement_errors};
pub use ratios::Ratios;
pub use separable::{BrickOperator, SeparableOperator};
