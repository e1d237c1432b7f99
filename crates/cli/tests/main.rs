//! The program from outside.

mod commands;
mod common;
#[cfg(target_os = "linux")]
mod disks;
mod energies;
mod exact;
mod examples;
#[cfg(unix)]
mod killed;
mod library;
mod meshes;
mod messages;
mod options;
mod own;
mod page;
mod refusals;
#[cfg(unix)]
mod resume;
mod shared;
mod trust;
mod tutorial;
mod volumes;
