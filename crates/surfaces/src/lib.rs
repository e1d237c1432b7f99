//! Triangle meshes.
mod closed;
mod distance;
mod error;
mod format;
mod isosurface;
mod mesh;
mod placement;
mod read;
pub mod samples;
mod vector;
mod write;

pub use closed::{ClosedMesh, Warning};
pub use distance::MeshDistance;
pub use error::Error;
pub use isosurface::{isosurface, phase_field_surface};
pub use mesh::{BoundingBox, TriangleMesh};
pub use placement::Placement;
pub use read::{FormatError, read};
pub use write::write;
