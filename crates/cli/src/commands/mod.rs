//! The subcommands, each in the module of its name.

pub mod check;
pub mod fair;
pub mod flow;
pub mod info;
pub mod inpaint;
pub mod networks;
pub mod resume;
pub mod sample;
pub mod shell;
pub mod train;
