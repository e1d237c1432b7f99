//! Calibrations on planes, and what is measured of steps whose symbols and factors are known.

mod calibration;
mod common;
mod measured;
