//! What nearly every module needs of other crates.

pub(crate) use std::path::{Path, PathBuf};
pub(crate) use std::str::FromStr;

pub(crate) use engine::{Case, Formulation, Measure, Method, Record, Run, Scales, StepRule, Stop};
pub(crate) use geometry::measure::{BoundingBox, has_interface};
pub(crate) use geometry::{
    Field, Grid, NodeSet, PhaseField, Placement, SignedDistance, Stored, UpAxis, ZeroSet, npy,
    optimal_profile, phase_field, stored_phase_field, vti,
};
pub(crate) use operators::{ComputeDevice, DeviceKind};
pub(crate) use render::{Picture, Scene};
pub(crate) use runs::{RunDirectory, StoredRun};
pub(crate) use serde::{Deserialize, Serialize, Serializer};
pub(crate) use serde_json::{Value, json};
pub(crate) use surfaces::shapes::Region;
pub(crate) use surfaces::{ClosedMesh, Fairing, MeshDistance, TriangleMesh};

pub(crate) use crate::error::{Error, Result};
pub(crate) use crate::events::{Note, Warning, Watcher};
pub(crate) use crate::refusal::Refusal;
