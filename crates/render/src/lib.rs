//! Pictures of surfaces.

mod animation;
mod camera;
mod colour;
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
pub use camera::{Axis, Bounds, Camera, Framing, Projection};
pub use colour::Rgb;
pub use error::Error;
pub use light::{Lighting, Material};
pub use picture::Picture;
pub use scene::{Background, Quality, Scene, Size};
pub use tube::Tube;
