//! The programs from outside.

mod common;
mod programs;
mod surfaces;
