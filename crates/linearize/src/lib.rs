//! Forward-mode differentiation for [Burn](burn): Hessian-vector products at the price of a gradient.
//!
//! Write a scalar function of tensors once, in ordinary Burn. This crate traces it together with its
//! reverse-mode gradient, differentiates the recorded graph again in forward mode, and replays the
//! result on a backend: `hvp = linearize(grad(E))`, forward over reverse. What depends on the point
//! alone is computed once per point; what remains per direction is a short linear program.
//!
//! ```
//! use burn::tensor::{DType, Device, Tensor, TensorData};
//! use burn_linearize::{Extensions, Graph};
//!
//! // Ginzburg-Landau energy on a periodic line of unit spacing:
//! // E(u) = Σ ε/2 (uᵢ₊₁ − uᵢ)² + 1/(4ε) (1 − uᵢ²)²
//! fn energy(u: Tensor<1>, eps: f64) -> Tensor<1> {
//!     let n = u.dims()[0];
//!     let right = Tensor::cat(vec![u.clone().slice(1..n), u.clone().slice(0..1)], 0);
//!     let slope = right - u.clone();
//!     let well = u.powi_scalar(2).neg() + 1.0;
//!     slope.powi_scalar(2).sum() * (0.5 * eps) + well.powi_scalar(2).sum() * (0.25 / eps)
//! }
//!
//! # fn main() -> Result<(), burn_linearize::Error> {
//! let device = Device::default();
//! let tensor = |data: [f64; 4]| {
//!     Tensor::<1>::from_data(TensorData::from(data), (&device, DType::F64))
//! };
//! let u = tensor([1.0, 1.0, -1.0, -1.0]);
//!
//! // Once: record the energy and its gradient, transform, load onto the device.
//! let graph = Graph::gradient(&[(&u).into()], &[], |inputs| energy(inputs.variable(0), 0.5))?;
//! let extensions = Extensions::new();
//! let program = graph.linearize(&extensions, None)?;
//! let mut linearization = program.on(&device, &extensions)?;
//!
//! // Once per point: energy and gradient.
//! let at = linearization.at(&[(&u).into()], &[])?;
//! assert_eq!(at.value.to_vec(), [2.0]);
//! assert_eq!(at.gradients[0].to_vec(), [1.0, 1.0, -1.0, -1.0]);
//!
//! // Once per direction: Hessian-vector product. Where u = ±1 the Hessian is −ε Δ + 2/ε.
//! let product = linearization.apply(&[tensor([1.0, 0.0, 0.0, 0.0]).into()])?;
//! assert_eq!(product[0].to_vec(), [5.0, -0.5, 0.0, -0.5]);
//!
//! // The double well, however it is written, costs one product per direction.
//! assert_eq!(program.statistics().tangent["Mul"], 1);
//! # Ok(())
//! # }
//! ```
//!
//! # Conventions
//!
//! - *Variables* are differentiated, *parameters* are inputs held constant. Both may change at every
//!   call without tracing again; their shapes and element types may not. Numbers in the function are
//!   part of the graph: make what changes a parameter.
//! - [`Graph::gradient`] records value and gradient, so that [`Linearization::apply`] is a
//!   Hessian-vector product. [`Graph::trace`] records any function, and `apply` is its
//!   Jacobian-vector product.
//! - Gradients are Burn's: derivatives by each element, without any inner product's weight.
//! - Precision follows the variables. Say `(&device, DType::F64)` when creating tensors outside;
//!   Burn casts to the device's default type otherwise. Inside a traced function,
//!   [`Inputs::device`] has the right default, but methods named after `f32`, like `from_floats`, have
//!   single precision before they reach it.
//! - The traced function has no data to look at. Control flow that depends on values is not recorded:
//!   use masks. Piecewise functions have the derivative of the piece that a value is on.
//! - Burn's `detach` stops Burn's gradient, but the gradient that results is differentiated as it is.
//! - Nothing here checks for NaN or infinity.
//!
//! # What happens
//!
//! [`Graph::linearize`] shares common subexpressions, removes products with ones and sums with zeros,
//! and never spreads a number over a grid. Tangents stay sums of *coefficient times tangent* as long as
//! operations are elementwise, so that pointwise second derivatives merge into one coefficient that is
//! computed once per point. [`Program::statistics`] counts what is left. Last uses are known, so backends compute
//! in place, and between [`at`](Linearization::at) and [`apply`](Linearization::apply) only what the
//! tangent program reads is kept. Backends with a handler for [`ELEMENTWISE`] run elementwise operations gathered, a pass over memory
//! for many of them. [`Graph::linearize`] runs the products in another precision than values and
//! gradients if asked to.
//!
//! Rules cover arithmetic with broadcasting, elementary functions, reductions, matrix products,
//! convolutions and linear layers with their backward passes, indexing, masks, and what Burn's autodiff
//! makes of them. An operation that a tangent reaches and no rule covers is [`Error::NoRule`]. Custom
//! operations bring a [`Rule`] and handlers for each backend in [`Extensions`].
//!
//! # Checks
//!
//! [`taylor`] tests derivatives by the decay of Taylor remainders; [`dual`] computes Hessian-vector
//! products in another way, reverse over forward. Both serve a user's own energies as well.
//!
//! # Features
//!
//! `flex` (default) and `ndarray` run on the CPU in double or single precision, `wgpu` and `cuda` on
//! GPUs; each alone is enough. Double precision on `wgpu` is wrong in Burn 0.22.1.

#[cfg(not(any(
    feature = "flex",
    feature = "ndarray",
    feature = "wgpu",
    feature = "cuda"
)))]
compile_error!("linearize needs a backend: enable one of the features flex, ndarray, wgpu, cuda");

pub mod dual;
pub mod taylor;

mod conversion;
mod emit;
mod error;
mod extensions;
mod fusion;
mod ir;
mod precision;
mod program;
mod replay;
mod rules;
mod tangent;
mod trace;
mod value;

pub use burn::backend::ir::{CustomOpIr, HandleContainer, OperationIr, ScalarIr, TensorIr};

pub use error::Error;
pub use extensions::{CustomOpRegistry, Extensions, Rule};
pub use fusion::{Arithmetic, ELEMENTWISE, Elementwise, Instruction, Output, Right};
pub use program::{Program, Statistics};
pub use replay::{Evaluation, Linearization};
pub use tangent::{Builder, Tangents, multilinear};
pub use trace::{Graph, Inputs};
pub use value::Value;

/// The program of the front page is compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
