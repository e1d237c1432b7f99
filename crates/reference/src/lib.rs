//! Exact flows and equilibria of curves and of surfaces of revolution, as references for other methods. They do not use phase fields.
//!
//! - [`planar`]: Willmore flow and curve shortening of plane curves, also of polygons, to about 1e-8 of their size.
//! - [`revolution`]: Willmore and mean curvature flow of spheres, thick disks, tori and other closed surfaces of revolution, to about 1e-6
//!   of their size.
//! - [`equilibria`]: axisymmetric vesicles of given area and volume, and closed elastic curves of given length and area.
//!
//! Curves are counterclockwise, and the curvature `kappa` of a circle is positive. On surfaces `kappa` is the sum of the principal
//! curvatures, positive on spheres. The energy is `1/2 int kappa^2`, `8 pi` for spheres. [`Flow`] states the normal velocities. Time is the
//! time of the `L2` gradient flow. Coordinates and times have any consistent units.

mod corner;
mod curve;
mod dense;
pub mod equilibria;
mod error;
mod exponential;
mod flow;
pub mod planar;
mod polygon;
pub mod revolution;
mod rosenbrock;
mod shape;
mod spectral;
mod stepping;

pub use curve::Curve;
pub use error::Error;
pub use flow::{Accuracy, Flow};
pub use shape::Shape;
