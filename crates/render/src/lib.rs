//! Pictures of surfaces given as phase fields or signed distances, without a GPU or a display.
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
//!         .elevation(35.0)
//!         .colour(Rgb::SKY)
//!         .tube(Tube::new(circle, 0.005).closed())
//!         .quality(Quality::Draft);
//!     let picture = scene.render((160, 120))?;
//! #   let folder = tempfile::tempdir().expect("a folder for temporary files");
//! #   let path = folder.path().join("torus.png");
//!     picture.write_png(&path)?;
//!
//!     let blue = picture.pixels().iter().filter(|[r, _, b, _]| b > r).count();
//!     println!("{} x {} pixels, {} per cent blue", picture.width(), picture.height(),
//!         100 * blue / picture.pixels().len());
//! #   assert_eq!(100 * blue / picture.pixels().len(), 57);
//!     Ok(())
//! }
//! ```
//! prints
//! ```text
//! 160 x 120 pixels, 57 per cent blue
//! ```
//!
//! # Conventions
//!
//! - The solid is where `u > 0`, or where a signed distance is negative, inside the box of the
//!   grid. What lies beyond the box is outside: a picture repeats nothing.
//! - The surface drawn is the zero level set of a cubic B-spline with the (softly clamped) nodal
//!   distances as coefficients. It is smooth at any magnification; it differs from the interface by
//!   `h^2 / 6` times the mean curvature, and rounds edges over a cell.
//! - Angles are in degrees, lengths in the units of the grid, sizes of pictures in pixels.
//! - Lights are fixed to the camera, so that every view is lit alike.
//! - Light is computed and blended linearly; colours given and pixels returned are sRGB.
//! - Ambient occlusion and shadows come from rays. Sampling patterns are fixed: same input, same
//!   bytes, on any number of threads.

mod animation;
mod camera;
mod emptiness;
mod error;
mod film;
mod light;
mod picture;
mod sampling;
mod scene;
mod spline;
mod tube;
mod volume;

pub use animation::Animation;
pub use camera::{Bounds, Camera, Framing, Projection};
pub use error::Error;
pub use film::Quality;
pub use light::{Lighting, Material};
pub use picture::{LARGEST_SIDE, Picture};
pub use scene::{Background, Scene, Size};
pub use srgb::Rgb;
pub use tube::Tube;
