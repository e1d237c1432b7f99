//! What nearly every module needs of other crates.

pub use std::path::{Path, PathBuf};
pub use std::str::FromStr;

pub use engine::{Case, Formulation, Measure, Method, Record, Run, Scales, StepRule, Stop};
pub use geometry::measure::{BoundingBox, has_interface};
pub use geometry::{
    Field, Grid, NodeSet, PhaseField, Placement, SignedDistance, Stored, UpAxis, ZeroSet, npy,
    optimal_profile, phase_field, stored_phase_field, vti,
};
pub use operators::{ComputeDevice, DeviceKind};
pub use render::{Picture, Scene};
pub use runs::{Interrupt, RunDirectory, StoredRun};
pub use serde::{Deserialize, Serialize, Serializer};
pub use serde_json::{Value, json};
pub use surfaces::shapes::Region;
pub use surfaces::{ClosedMesh, Fairing, MeshDistance, TriangleMesh};

pub(crate) use crate::error::refuse;
pub use crate::error::{Error, Result};
