//! What nearly every program needs.

pub use std::collections::BTreeMap;
pub use std::f64::consts::PI;
pub use std::path::{Path, PathBuf};
pub use std::process::ExitCode;
pub use std::time::Instant;

pub use clap::{Args, Parser, ValueEnum};
pub use engine::{
    Case, ErrorControl, Flow, Held, Measure, Method, Operator, Order, Record, Run, Samples, Scales,
    Scheme, StepRule, Stop, Target, TimeSteps, Trajectory, energy_increases, mean_hvp,
    minimizations,
};
pub use geometry::measure::{l2_distance, zero_set_volume};
pub use geometry::shapes::{Ball, Cross, Cuboid, Cylinder, Ellipse};
pub use geometry::{
    Field, Grid, Placement, SignedDistance, SignedDistanceExt, UpAxis, ZeroSet, optimal_profile,
    phase_field,
};
pub use indicatif::ProgressBar;
pub use operators::{ComputeDevice, DeviceKind};
pub use report::Format::{self, Fixed, Scientific, Shortest};
pub use report::{
    Axis, Cell, Colour, Curve, Figure, LegendEntry, LineChart, LineStyle, Marker, Numbers,
    OutputDir, Progress, Raster, Series, Shapes, Sheet,
};
pub use serde::Serialize;
pub use serde_json::{Value, json};
pub use solver::{NewtonParams, StepRecord};

pub use crate::flows::{ACCURATE, PAPERS, operator, planar_flow, willmore_flow};
pub use crate::networks::{EPS, NetworkOptions, STEP};
pub use crate::options::{FigureOptions, RunOptions};
pub use crate::session::{Session, Stage};
pub use crate::{Error, harness, look, require};
