//! The subcommands, each in the module of its name, and those that say something of the program in one.

pub mod about;
pub mod check;
pub mod labels;
pub mod resume;
pub mod run;
pub mod sample;
pub mod train;
