//! What nearly every module needs.

pub use std::path::{Path, PathBuf};
pub use std::process::ExitCode;
pub use std::str::FromStr;

pub use engine::{Case, Measure, Method, Record, Run, Scales, Scheme, StepRule, Stop};
pub use geometry::measure::{BoundingBox, has_interface};
pub use geometry::{
    Field, Grid, Placement, SignedDistance, UpAxis, ZeroSet, npy, optimal_profile, phase_field, vti,
};
pub use operators::{ComputeDevice, DeviceKind};
pub use render::{Picture, Scene};
pub use runs::{Interrupt, RunDirectory, StoredRun};
pub use serde::{Deserialize, Serialize, Serializer};
pub use serde_json::{Value, json};
pub use surfaces::shapes::Region;
pub use surfaces::{ClosedMesh, Fairing, MeshDistance, TriangleMesh};

pub use crate::cli::{Amount, FlowOptions, InputOptions, KeepOptions, SayOptions, SizeTarget};
pub use crate::error::Error;
pub use crate::input::{Loaded, Start, extension};
pub use crate::outlet::{MESHES, Outlet, Space, Topology};
pub use crate::own::OwnMesh;
pub use crate::plane::Plane;
pub use crate::volume::Label;
pub(crate) use crate::{config, input, outlet, page};
