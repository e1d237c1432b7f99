//! Run directories against faults, kills and damage.

mod common;
mod damage;
mod faults;
#[cfg(unix)]
mod killed;
