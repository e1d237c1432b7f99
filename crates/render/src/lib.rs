//! Pictures of surfaces given as phase fields or meshes, without a GPU or a display.
//!
//! ```
//! use geometry::shapes::Torus;
//! use geometry::{Grid, SignedDistanceExt, phase_field};
//! use render::{Quality, Rgb, Scene, Tube};
//!
//! fn main() -> Result<(), render::Error> {
//!     // The Clifford torus in the unit box, with its largest circle.
//!     let grid = Grid::<3>::new(64, 1.0)?;
//!     let eps = 2.0 * grid.spacing();
//!     let torus = Torus::clifford(0.36)?;
//!     let u = phase_field(grid, &torus.translated([0.5; 3]), eps)?;
//!     let circle: Vec<[f64; 3]> = (0..120)
//!         .map(|k| std::f64::consts::TAU * f64::from(k) / 120.0)
//!         .map(|a| [0.5 + 0.36 * a.cos(), 0.5 + 0.36 * a.sin(), 0.5])
//!         .collect();
//!
//!     let scene = Scene::new(&u, eps)?
//!         .colour(Rgb::SKY)
//!         .tubes([Tube { closed: true, ..Tube::new(circle, 0.005) }])
//!         .quality(Quality::Draft);
//!     let picture = scene.render([160, 120])?;
//! #   let folder = tempfile::tempdir().expect("a folder for temporary files");
//! #   let path = folder.path().join("torus.png");
//!     picture.write_png(&path)?;
//!
//!     let blue = picture.pixels().iter().filter(|[r, _, b, _]| b > r).count();
//!     println!("{} x {} pixels, {} per cent blue", picture.size()[0], picture.size()[1],
//!         100 * blue / picture.pixels().len());
//! #   assert_eq!(100 * blue / picture.pixels().len(), 60);
//!     Ok(())
//! }
//! ```
//! prints
//! ```text
//! 160 x 120 pixels, 60 per cent blue
//! ```
//!
//! # Conventions
//!
//! - The solid is where `u > 0` inside the box of the grid. Points beyond the box are outside of the solid. Pictures are not periodic.
//! - The triangles of [`surfaces::isosurface`] are drawn with interpolated normals, and sorted by depth
//!   for several samples of every pixel.
//! - Ambient occlusion and shadows are computed at the vertices, for as many directions of light as the [`Quality`] says.
//! - Lights are fixed to the camera, so that every view is lit alike.
//! - Light is computed and blended linearly. Given colours and returned pixels are sRGB.
//! - The same input gives the same bytes, for any number of threads.
//! - Angles are in degrees, lengths in the units of the surface, sizes of pictures in pixels.
//! - Errors of the crates that this crate depends on pass through unchanged. If a function can also refuse an input on its own, its documentation
//!   says so.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

mod camera;
mod error;
mod light;
mod model;
mod picture;
mod raster;
mod scene;
mod shadow;

pub use camera::View;
pub use error::Error;
pub use model::Tube;
pub use picture::{Picture, animation, checked_size};
pub use scene::{Quality, Scene};
pub use srgb::Rgb;
