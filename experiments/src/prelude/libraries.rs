//! What nearly every file needs of the libraries, and of the root of this crate.

pub use std::collections::{BTreeMap, BTreeSet};
pub use std::f64::consts::PI;
pub use std::path::{Path, PathBuf};
pub use std::process::ExitCode;
pub use std::time::Instant;

pub use clap::{Args, Parser, ValueEnum};
pub use engine::{
    Case, Discretization, ErrorControl, Flow, Formulation, Held, Measure, Method, Operator, Order,
    Record, Run, Samples, Scales, StepRule, Stop, Storage, Target, TimeSteps, Trajectory,
    energy_increases, mean_hvp, minimizations, total_hvp,
};
pub use geometry::measure::{BoundingBox, l2_distance, zero_set_volume};
pub use geometry::shapes::{Ball, Cross, Cuboid, Cylinder, Ellipse};
pub use geometry::{
    Field, Grid, NodeSet, PhaseField, Placement, SignedDistance, SignedDistanceExt, Stored, UpAxis,
    ZeroSet, optimal_profile, phase_field,
};
pub use indicatif::ProgressBar;
pub use operators::{ComputeDevice, DeviceKind, memory};
pub use report::Format::{self, Fixed, Scientific, Shortest};
pub use report::{
    Axis, Cell, Colour, Curve, Figure, LegendEntry, LineChart, LineStyle, Marker, Numbers,
    OutputDir, ProgressBars, Raster, Series, Shapes, Sheet,
};
pub use serde::Serialize;
pub use serde_json::{Value, json};
pub use solver::{NewtonParams, StepRecord};
pub use surfaces::{ClosedMesh, MeshDistance, TriangleMesh};

pub use crate::{Error, Result, require};
