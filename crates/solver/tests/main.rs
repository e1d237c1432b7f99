//! Minimizations, flows and their parts.

mod bounds;
mod bricks;
mod calibration;
mod common;
mod constraints;
mod domain;
mod flow;
mod helfrich;
mod measured;
mod minimization;
mod profile;
mod region;
mod second_order;
mod start;
mod terms;
