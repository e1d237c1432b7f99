//! Runs from their start to their end, in one go and with interruptions.

mod common;
mod held;
mod resuming;
mod steps;
mod stops;
mod storage;
