//! Geometry on periodic grids: signed distances, phase fields, their measures and files.
//!
//! ```
//! use geometry::shapes::{Ball, Cuboid};
//! use geometry::{Error, Grid, SignedDistance, SignedDistanceExt, contour, measure, phase_field};
//!
//! fn main() -> Result<(), Error> {
//!     // The box (-1,1)^2 with 128 cells per unit length, and an interface of width eps = 2h.
//!     let grid = Grid::<2>::per_unit(128, 2.0)?;
//!     let eps = 2.0 * grid.spacing();
//!
//!     // A disc with a turned square hole; closures are shapes.
//!     let square = Cuboid::new([0.2, 0.2])?;
//!     let (sin, cos) = 0.5_f64.sin_cos();
//!     let hole = |[x, y]: [f64; 2]| square.signed_distance([cos * x + sin * y, cos * y - sin * x]);
//!     let u = phase_field(grid, &Ball::new([0.0, 0.0], 0.6)?.difference(hole), eps)?;
//!
//!     let area = measure::zero_set_volume(&u); // pi 0.6^2 - 0.4^2 = 0.97097
//!     let length = measure::perimeter(&u, eps)?; // 2 pi 0.6 + 4 * 0.4 = 5.36991
//!     println!("area {area:.4}, perimeter {length:.3}");
//!
//!     let curves = contour::zero_level(&u);
//!     let tip = contour::ray_crossing(&u, [0.4, 0.0], [1.0, 0.0])?;
//!     println!("{} curves, right end at x = {:.5}", curves.len(), 0.4 + tip.unwrap_or(0.0));
//! #   assert_eq!(format!("{area:.4}, {length:.3}"), "0.9710, 5.360");
//! #   assert_eq!(format!("{}, {:.5}", curves.len(), 0.4 + tip.unwrap_or(0.0)), "2, 0.60000");
//!     Ok(())
//! }
//! ```
//! prints
//! ```text
//! area 0.9710, perimeter 5.360
//! 2 curves, right end at x = 0.60000
//! ```
//!
//! # Conventions
//!
//! - A [`Grid`] is a periodic cube of side `L` with `N` cells per side and the spacing `h = L/N`. Its
//!   `N^D` nodes are `origin + i h`, `i = 0..N-1`. The repeated last layer is not stored. Values are
//!   ordered row-major, last axis fastest.
//! - Signed distances $`s`$ are negative inside. Phase fields are $`u = \tanh(-3 s / (4 \varepsilon))`$ with the
//!   width $`\varepsilon`$ of the interface: positive inside, zero on the interface.
//! - The double well is $`\Psi(v) = \frac{9}{16} (1 - v^2)^2`$. The perimeter is
//!   $`P_\varepsilon[v] = \frac{1}{2} \int \varepsilon |\nabla v|^2 + \Psi(v) / \varepsilon`$. It equals length or area in the
//!   limit of small $`\varepsilon`$.
//! - The $`L^2`$ norm is $`(h^D \sum u^2)^{1/2}`$, an integral and not a mean.
//! - Mean curvature is the sum of the principal curvatures. [`exact`] has flows and energies.
//! - Items are generic over the dimension `D`, unless they make sense only in the plane or only in space.
//! - The same input gives the same bytes: parallel sums have a fixed order.

mod bricks;
mod bspline;
mod error;
mod field;
mod grid;
mod node_set;
mod nodes;
mod placement;
mod profile;
mod redistancing;
mod spline;
mod stored;
mod thickness;
mod transfer;
mod up;
mod vector;

mod clifford;
pub mod contour;
pub mod distance;
pub mod exact;
pub mod measure;
pub mod npy;
pub mod parallel;
pub mod shapes;
pub mod vti;
pub mod zero_set;

pub use bricks::Bricks;
pub use bspline::{BSpline, Jet};
pub use clifford::CliffordTorus;
pub use distance::{SignedDistance, SignedDistanceExt};
pub use error::{Error, positive, require};
pub use field::Field;
pub use grid::Grid;
pub use node_set::NodeSet;
pub use nodes::{Lookup, Nodes, PhaseField, Row, check_values};
pub use placement::Placement;
pub use profile::{
    PURE_BEYOND, distance_from_phase_field, distances_from_phase_field, optimal_profile,
    phase_field, profile_variable, stored_phase_field,
};
pub use redistancing::{DistanceRange, LevelPoint, Redistanced};
pub use stored::Stored;
pub use thickness::{is_thin, thickness, thin_part};
pub use up::UpAxis;
pub use zero_set::ZeroSet;
