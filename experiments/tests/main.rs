//! The programs from outside.

mod common;
mod documents;
mod programs;
#[cfg(unix)]
mod regenerate;
mod surfaces;
