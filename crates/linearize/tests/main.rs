//! Derivatives against independent ones, replay against tracing.

mod burn_internals;
mod common;
mod energies;
#[cfg(feature = "flex")]
mod extensions;
mod operations;
mod replay;
