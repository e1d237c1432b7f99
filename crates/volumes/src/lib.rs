//! Closed surfaces from volumes of voxels, such as segmentations.
//!
//! ```
//! use volumes::{Inside, Volume, read, write};
//!
//! fn main() -> Result<(), volumes::Error> {
//!     // A ball of radius 8 in voxels of 1 x 1 x 2, labelled 3.
//!     let (size, sides) = ([24, 24, 12], [1.0, 1.0, 2.0]);
//!     let centre = [0, 1, 2].map(|axis| 0.5 * (size[axis] - 1) as f64 * sides[axis]);
//!     let label = |voxel: usize| {
//!         let index = [voxel % 24, voxel / 24 % 24, voxel / (24 * 24)];
//!         let offset = [0, 1, 2].map(|axis| index[axis] as f64 * sides[axis] - centre[axis]);
//!         let distance = offset.iter().map(|x| x * x).sum::<f64>().sqrt();
//!         if distance < 8.0 { 3 } else { 0 }
//!     };
//!     let labels = (0..size.iter().product()).map(label).collect();
//!     let volume = Volume::of_labels(size, [0.0; 3], sides, labels)?;
//!
//!     // Write the volume to a file, read it again, and make a surface that encloses the volume of the voxels of label 3.
//! #   let folder = tempfile::tempdir().expect("a folder for temporary files");
//! #   let path = folder.path().join("ball.nii.gz");
//!     write(&path, &volume)?;
//!     let volume = read(&path)?;
//!     for (label, count) in volume.labels().unwrap_or_default() {
//!         println!("label {label}: {count} voxels");
//!     }
//!     let body = volume.body(Inside::Label(3.0))?;
//!     let area = body.surface.area(); // 4 pi 8^2 = 804.2
//!     println!("volume {:.1}, area {area:.0}", body.surface.volume()); // 4/3 pi 8^3 = 2144.7
//! #   assert_eq!(format!("{:.1}, {area:.0}", body.surface.volume()), "2208.0, 824");
//!     Ok(())
//! }
//! ```
//! prints
//! ```text
//! label 0: 5808 voxels
//! label 3: 1104 voxels
//! volume 2208.0, area 824
//! ```
//!
//! # Conventions
//!
//! - Voxels are counted from zero. The first axis runs fastest, as in the files. A volume knows where the centres of its voxels are, in
//!   the units of the file. Surfaces are in these coordinates.
//! - Faces are counter-clockwise seen from outside, also where the axes of the voxels are left-handed.
//! - The same input gives the same bytes, for any number of threads.
//! - Errors of the crates that this crate depends on pass through unchanged. If a function can also refuse an input on its own, its documentation
//!   says so.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

mod body;
mod error;
mod read;
mod volume;
mod warning;
mod write;

pub use body::{Body, Inside, Speck};
pub use error::{Error, FormatError};
pub use read::{decode, decode_frame, holds_stack, is_stack, read, read_frame};
pub use volume::{Values, Volume};
pub use warning::Warning;
pub use write::write;
