//! Learning what a direct step of Willmore flow misses: curves with their exact flow, corrections of the step, and their training.

mod corrections;
mod curves;
mod training;

pub use corrections::{Correction, Form, Network, Rows};
pub use curves::{Curves, Example, Pair};
pub use training::{AdamParams, Taught, energy_of_exact_steps, from_energy, from_pairs};
