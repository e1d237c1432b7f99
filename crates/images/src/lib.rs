//! Images in and out of phase fields: PNG and JPEG files, outlines, signed distances, drawings.

mod distance;
mod drawing;
mod error;
mod frame;
mod image;
mod interface;
mod mask;
mod outline;
mod placement;
mod read;
mod selection;
mod svg;

pub use distance::OutlineDistance;
pub use drawing::Drawing;
pub use error::Error;
pub use frame::Frame;
pub use image::{Image, LARGEST_IMAGE};
pub use interface::Interface;
pub use mask::Mask;
pub use outline::{LARGEST_OUTLINE, Outline};
pub use placement::Placement;
pub use read::{FormatError, decode, read};
pub use selection::{Inside, Side, Threshold};
pub use svg::Svg;
