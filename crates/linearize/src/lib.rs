//! Forward-mode differentiation for [Burn](burn): Hessian-vector products at the price of a gradient.
//!
//! Write a scalar function of tensors once, in ordinary Burn. This crate traces it together with its
//! reverse-mode gradient, differentiates the recorded graph again in forward mode, and replays the
//! result on a backend: `hvp = linearize(grad(E))`, forward over reverse. Values that depend on the
//! point alone are computed once per point. For each direction, only a short sequence of linear
//! operations remains.
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
//! // However the double well is written, it costs one elementwise multiplication per direction.
//! assert_eq!(program.statistics().tangent["Mul"], 1);
//! # Ok(())
//! # }
//! ```
//!
//! # Conventions
//!
//! - *Variables* are differentiated. *Parameters* are inputs held constant. Both may change their values
//!   at every call without tracing again, but not their shapes and element types. Numbers in the
//!   function are part of the graph. A number that changes has to be a parameter.
//! - [`Graph::gradient`] records value and gradient, so that [`Linearization::apply`] is a
//!   Hessian-vector product. [`Graph::trace`] records any function, and `apply` is its
//!   Jacobian-vector product.
//! - Gradients are Burn's: derivatives by each element, without the weight of an inner product.
//! - Precision follows the variables. When you create a tensor outside of the traced function, pass
//!   `(&device, DType::F64)` for its device. Otherwise Burn casts to the device's default type. Inside
//!   the traced function, [`Inputs::device`] has the right default. But methods named after `f32`,
//!   like `from_floats`, round to single precision first.
//! - The traced function sees no values. Control flow that depends on values is not recorded:
//!   use masks. Piecewise functions have the derivative of the piece that a value is on.
//! - Burn's `detach` changes the gradient that Burn computes. The linearization then differentiates
//!   this gradient, as if there were no `detach` in it.
//! - Nothing here checks for NaN or infinity.
//!
//! # What happens
//!
//! [`Graph::linearize`] shares common subexpressions, removes products with ones and sums with zeros,
//! and keeps a constant as one number instead of a grid of equal numbers. As long as operations are
//! elementwise, the tangent of a value is kept as a sum. Each summand is a coefficient times the
//! tangent of an earlier value. So pointwise second derivatives merge into one coefficient, which is
//! computed once per point. [`Program::statistics`] counts the remaining operations. If asked to,
//! [`Graph::linearize`] runs the products in another precision than values and gradients.
//!
//! The program knows the last use of every value, so backends compute in place. Between
//! [`at`](Linearization::at) and [`apply`](Linearization::apply) it keeps only the values that the
//! tangent program reads. Backends with a handler for [`ELEMENTWISE`] run many elementwise operations
//! in one pass over memory.
//!
//! Rules cover arithmetic with broadcasting, elementary functions, reductions, matrix products,
//! convolutions and linear layers with their backward passes, indexing, masks, and the operations in
//! Burn's gradients of these. If a tangent reaches an operation without a rule, the error is
//! [`Error::NoRule`]. Custom operations bring a [`Rule`] and handlers for each backend in
//! [`Extensions`].
//!
//! # Checks
//!
//! [`taylor`] tests derivatives by the decay of Taylor remainders. [`dual`] computes Hessian-vector
//! products in another way, reverse over forward. Both work for your own energies, too.
//!
//! # Features
//!
//! `flex` (default) and `ndarray` run on the CPU in double or single precision, `wgpu` and `cuda` on
//! GPUs. One of them is enough. Double precision on `wgpu` is wrong in Burn 0.22.1.

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
