//! The programs from outside.

mod common;
mod documents;
mod programs;
mod surfaces;
