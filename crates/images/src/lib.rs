//! Phase fields from images, and drawings of phase fields: image files, outlines, signed distances.
//!
//! ```
//! use geometry::{Grid, Placement, phase_field};
//! use images::{Frame, Outline, Side, drawing, read, svg, interface};
//! use render::Rgb;
//!
//! fn main() -> Result<(), images::Error> {
//! #   let folder = tempfile::tempdir().expect("a folder for temporary files");
//! #   let folder = folder.path();
//! #   let disc = geometry::shapes::Ball::new([50.0, 40.0], 30.0)?;
//! #   let frame = Frame::new([100, 80], [0.0, 80.0], 1.0)?;
//! #   drawing(&frame, &disc, Some(Rgb::WHITE))?.write_png(folder.join("logo.png"))?;
//!     // A black disc of radius 30 pixels on white, of 100 times 80 pixels.
//!     let image = read(folder.join("logo.png"))?;
//!     let side = Side::of(&image, 0.5)?;
//!     let outline = Outline::of_image(&image, side)?;
//!     println!("{side}, area {:.0} pixels", outline.area()); // 900 pi = 2827.4
//! #   assert_eq!(format!("{side}, {:.0}", outline.area()), "darker than 0.5000, 2829");
//!
//!     // Its phase field in the box (-1,1)^2, the longer side of the image 1.6 long.
//!     let grid = Grid::<2>::centred(128, 2.0)?;
//!     let eps = 2.0 * grid.spacing();
//!     let placement = Placement::fit(&image.bounding_box(), &grid, 1.6)?;
//!     let distance = outline.placed(&placement).distance();
//!     let u = phase_field(grid, &distance, eps)?;
//!
//!     // Back as pixels of the same size, and as curves.
//!     let frame = Frame::of_box(&grid, 125)?;
//!     let interface = interface(&u, eps)?;
//!     drawing(&frame, &interface, None)?.write_png(folder.join("again.png"))?;
//!     let curves = Outline::of_phase_field(&u)?;
//!     files::write_atomically(folder.join("again.svg"), |out| {
//!         out.write_all(svg(&frame, &curves).as_bytes())
//!     })?;
//!     Ok(())
//! }
//! ```
//! prints
//! ```text
//! darker than 0.5000, area 2829 pixels
//! ```
//!
//! # Conventions
//!
//! - Pixels are stored row by row from the top. In the plane the second axis points upwards, and the side of a pixel is the unit. The
//!   image fills `[0, width] x [0, height]` until a [`geometry::Placement`] puts it into the box of a
//!   grid.
//! - Grey values are compared and mixed as they are stored, in sRGB and not in linear light. Drawing programs blend edges in this way. A
//!   pixel half covered by black on white has the value 0.5.
//! - Distances are negative inside, phase fields positive. Curves have the inside on their left.
//! - Points beyond the image, or beyond the box of a grid, are outside of the shape. Images are not periodic.
//! - Everything with a signed distance can be drawn: outlines, the interface of a field, the shapes
//!   of [`geometry`] and their combinations.
//! - The same input gives the same bytes, for any number of threads.
//! - Errors of the crates that this crate depends on pass through unchanged. If a function can also refuse an input on its own, its documentation
//!   says so.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

mod distance;
mod drawing;
mod error;
mod frame;
mod image;
mod limits;
mod outline;
mod read;
mod selection;
mod svg;

pub use distance::interface;
pub use drawing::drawing;
pub use error::{Error, FormatError};
pub use frame::Frame;
pub use image::Image;
pub use limits::{LARGEST_IMAGE, LARGEST_OUTLINE};
pub use outline::Outline;
pub use read::{colours, decode, is_deep, read};
pub use selection::{Side, Tones};
pub use svg::svg;
