//! What nearly every program needs.

pub use std::process::ExitCode;

pub use clap::Parser;
pub use engine::{Case, Flow, Measure, Method, Operator, Record, Run, Scales, Scheme, StepRule};
pub use geometry::{Field, Grid, phase_field};
pub use operators::ComputeDevice;
pub use report::Format::{self, Fixed, Scientific, Shortest};
pub use report::{Axis, Colour, Figure, LegendEntry, LineChart, LineStyle, Marker, Series};
pub use serde::Serialize;
pub use serde_json::json;

pub use crate::options::{FigureOptions, RunOptions};
pub use crate::session::Session;
pub use crate::sheet::Sheet;
pub use crate::{Error, harness, require};
