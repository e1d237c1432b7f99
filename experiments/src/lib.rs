//! The harness of the experiments: options, errors, stored partial results, and the runs themselves.
//!
//! The [`programs`] read options, call what is here, and write figures, tables and summaries with the `report` crate; the
//! executables only call them. Numerics live in the library crates; the only computation here is the comparison with
//! exact solutions.
//!
//! ```
//! use engine::Flow;
//! use experiments::circles;
//!
//! // The paper's circles live on boxes just large enough that the phase field's tails do not matter.
//! let radii = circles::radii(circles::COUNT);
//! let smallest = circles::box_cells(Flow::MeanCurvature, radii[0], 64, 128);
//! let largest = circles::box_cells(Flow::Willmore, radii[29], 64, 128);
//! assert!(smallest < largest && largest < 256);
//! ```
//!
//! # Conventions
//!
//! - `n` is the number of cells per unit length, `h = 1/n`.
//! - Errors are true `L2` norms, `sqrt(h^D sum u^2)`.
//! - Every failure is one line on standard error and exit code 2; options are checked before any output is touched.
//! - Results are collected in a fixed order: the same input gives the same bytes, wall times aside.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]
#![allow(missing_docs, reason = "of fields whose names say it")]

pub mod circles;
pub mod comparison;
pub mod equilibria;
mod error;
pub mod harness;
pub mod inpainting;
pub mod look;
pub mod mesh_flow;
pub mod meshes;
pub mod networks;
pub mod options;
pub mod prelude;
pub mod products;
pub mod programs;
pub mod quality;
pub mod session;
pub mod smoothing;
pub mod steps;
pub mod storages;
pub mod study;
pub mod surfaces;
pub mod timing;
pub mod training;
pub mod truth;

pub use error::{Error, Result, require};
