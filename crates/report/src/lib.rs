//! Plots, tables, summaries and run manifests from results.
//!
//! This crate takes numbers and writes files. It does not depend on solvers. One description of a
//! figure gives an SVG and a PNG that look alike. Files appear complete or not at all.
//!
//! ```
//! use report::{Axis, Figure, LineChart, LineStyle, Manifest, Marker, OutputDir, Series, Summary};
//!
//! # fn main() -> Result<(), report::Error> {
//! let root = std::env::temp_dir().join("report-first-steps");
//! let folder = OutputDir::create(&root)?; // fails now, not after hours of computing
//! let parameters = serde_json::json!({ "exponent": 2 });
//! let mut manifest = Manifest::start("decay", &parameters, ["none", "cpu", "f64"], 1)?;
//!
//! let steps = [32.0, 64.0, 128.0, 256.0].map(f64::recip);
//! let error = |h: f64| 0.7 * h.powi(2) + 0.1 * h.powi(3);
//! let measured = Series::of("measured", steps, |h| [h, error(h)]).with_marker(Marker::Circle);
//! let order = Series::of("order 2", steps, |h| [h, h.powi(2)]).with_style(LineStyle::Dashed);
//! let chart = LineChart::new("Convergence", Axis::log("h"), Axis::log("L² error"))
//!     .with_curves([measured, order.with_colour(1)]);
//! manifest.phase("plot", || Figure::from(chart).write(&folder, "convergence"))?;
//!
//! let mut summary = Summary::default();
//! summary.insert("error_finest", error(steps[3]))?;
//! summary.write(&folder)?;
//! manifest.write(&folder)?;
//! assert!(folder.path("convergence.png")?.exists());
//! # std::fs::remove_dir_all(&root).expect("the folder was made above");
//! # Ok(())
//! # }
//! ```
//!
//! # Conventions
//!
//! - Points are `[x, y]`, `y` pointing up. Arrays are row-major with the last axis fastest. Axis 0
//!   is drawn to the right, axis 1 upwards.
//! - Sizes are in layout units: one CSS pixel in SVG, two pixels in PNG. By default figures are 800
//!   units wide, and are to be read at this width.
//! - Colours come from the palette of Okabe and Ito ([`OKABE_ITO`]) and from viridis, both safe for the colour-blind.
//! - In PNG, text is set in the embedded `DejaVu Sans` 2.37, and in SVG in a sans-serif family. No system
//!   font is used. (`DejaVu Sans` is from the `dejavu` crate. It has the licence of Bitstream Vera, and
//!   what DejaVu changed in that font is in the public domain.)
//! - A value that cannot be shown (NaN, or zero on a logarithmic axis) is left out of pictures, and its
//!   curve is interrupted there. [`Summary`] and [`Table`] refuse such a value.
//! - The same input gives the same bytes, except for manifests.
//! - Every [`Error`] names the refused input. Functions say which inputs they refuse, unless the types do.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

mod axes;
mod axis;
mod bitmap;
mod colour;
mod drawable;
mod encode;
mod error;
mod figure;
mod font;
mod geom;
mod heatmap;
mod legend;
mod manifest;
mod output;
mod panel;
mod plot;
mod progress_bars;
mod raster;
mod shapes;
mod sheet;
mod style;
mod summary;
mod surface;
mod svg;
mod table;

pub use axis::{Axis, signed, superscript};
pub use colour::{Colour, OKABE_ITO, viridis};
pub use error::{Error, Result};
pub use figure::Figure;
pub use heatmap::Heatmap;
pub use legend::LegendEntry;
pub use manifest::Manifest;
pub use output::OutputDir;
pub use panel::Panel;
pub use plot::{LineChart, Series};
pub use progress_bars::ProgressBars;
pub use raster::Raster;
pub use shapes::{Curve, Shapes};
pub use sheet::{Numbers, Sheet};
pub use srgb::Rgb;
pub use style::{LineStyle, Marker};
pub use summary::Summary;
pub use table::{Cell, Format, Table};
