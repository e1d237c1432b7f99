//! Phase fields from triangle meshes, and triangle meshes from phase fields: files, closed surfaces,
//! signed distances, isosurfaces.
//!
//! ```
//! use geometry::{Grid, Placement, optimal_profile, phase_field, shapes::Ball};
//! use surfaces::{ClosedMesh, MeshDistance, phase_field_surface, read, write};
//!
//! fn main() -> Result<(), surfaces::Error> {
//!     // A ball as a phase field, its surface as a mesh.
//!     let grid = Grid::<3>::centred(64, 1.0)?;
//!     let eps = 2.0 * grid.spacing();
//!     let u = phase_field(grid, &Ball::new([0.0; 3], 0.3)?, eps)?;
//!     let (ball, _) = ClosedMesh::new(phase_field_surface(&u, eps)?)?;
//!     // 4 pi 0.3^2 = 1.13097 and 4/3 pi 0.3^3 = 0.11310.
//!     println!("area {:.4}, volume {:.4}", ball.area(), ball.volume());
//!     println!("Euler characteristic {}", ball.euler_characteristic());
//! #   assert_eq!(format!("{:.4} {:.4}", ball.area(), ball.volume()), "1.1306 0.1130");
//! #   assert_eq!(ball.euler_characteristic(), 2);
//!
//!     // To a file and back, and into a phase field again, twice as large.
//!     let folder = tempfile::tempdir().expect("a folder for temporary files");
//!     let path = folder.path().join("ball.ply");
//!     write(&path, ball.mesh())?;
//!     let (ball, warnings) = ClosedMesh::new(read(&path)?)?;
//!     for warning in warnings {
//!         println!("{warning}");
//!     }
//!     let coarse = Grid::<3>::centred(32, 2.0)?;
//!     let eps = 2.0 * coarse.spacing();
//!     let placement = Placement::fit(&ball.bounding_box(), &coarse, 1.2)?;
//!     let distance = MeshDistance::new(&ball.placed(&placement));
//!     let s = distance.sample(coarse, &|| ())?;
//!     let u = s.map(|s| optimal_profile(s, eps));
//!     let (again, _) = ClosedMesh::new(phase_field_surface(&u, eps)?)?;
//!     println!("volume {:.3}", again.volume()); // 4/3 pi 0.6^3 = 0.905
//! #   assert_eq!(format!("{:.3}", again.volume()), "0.902");
//!     Ok(())
//! }
//! ```
//! prints
//! ```text
//! area 1.1306, volume 0.1130
//! Euler characteristic 2
//! volume 0.902
//! ```
//!
//! # Conventions
//!
//! - Faces are counter-clockwise seen from outside. Distances are negative inside, phase fields
//!   positive.
//! - A [`TriangleMesh`] may have any triangles. A [`ClosedMesh`] bounds a solid. Only a closed mesh has a
//!   volume and a [`MeshDistance`].
//! - Vertices and faces are counted from zero, lines of files from one.
//! - There are two kinds of isosurfaces. [`phase_field_surface`] is quick and has the symmetries of the field, for measurements and
//!   pictures. [`remeshed_surface`] has well-shaped triangles, for files that other programs read.
//! - Meshes are not periodic: they lie in the box of a grid, with a margin of a few `eps`.
//! - The same input gives the same bytes, for any number of threads.

mod bound;
mod closed;
mod covering;
mod crossings;
mod distance;
mod edges;
mod error;
mod fairing;
mod filling;
mod format;
mod half_edges;
mod hierarchy;
mod isosurface;
mod joined;
mod label_mesh;
mod level_set;
mod lids;
mod mending;
mod mesh;
mod nesting;
mod noise;
mod parts;
mod read;
mod remeshing;
mod repair;
mod risk;
pub mod samples;
mod selection;
pub mod shapes;
mod signs;
mod smoothing;
mod tetrahedra;
mod topology;
mod triangle;
mod union;
mod vector;
mod write;

pub use bound::Bound;
pub use closed::{ClosedMesh, Warning};
pub use covering::Covered;
pub use crossings::Overlap;
pub use distance::{MeshDistance, hausdorff_distance};
pub use edges::{Edges, KeptEdges};
pub use error::Error;
pub use fairing::{FairedMesh, Fairing, Followed};
pub use filling::{Cells, Filling};
pub use format::{up_axis, up_axis_of, usual_up_axis};
pub use isosurface::{isosurface, lattice_surface, phase_field_surface};
pub use label_mesh::{BACKGROUND, DepthDifference, LabelLattice, LabelMesh};
pub use lids::Lids;
pub use mending::Mended;
pub use mesh::{PlaceHasher, TriangleMesh};
pub use noise::NoiseEstimate;
pub use parts::Parts;
pub use read::error::FormatError;
pub use read::{decode, is_binary_stl, read, rewrite, vertex_colours};
pub use remeshing::remeshed_surface;
pub use repair::{RepairChanges, Repaired, repair};
pub use signs::mend_signs;
pub use smoothing::TAUBIN;
pub use topology::{Topology, phase_field_topology};
pub use union::united;
pub use write::{encode, encode_with_up, write, write_with_up};
