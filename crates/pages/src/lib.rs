//! HTML pages in one file: figures, tables, sequences of pictures, and surfaces that can be turned.
//!
//! ```
//! use pages::{Facts, ImageElement, Page, Section, TableElement, View, viewer};
//! use geometry::{Grid, phase_field, shapes::Ball};
//!
//! fn main() -> Result<(), Box<dyn std::error::Error>> {
//!     let grid = Grid::<3>::centred(32, 1.0)?;
//!     let eps = 2.0 * grid.spacing();
//!     let u = phase_field(grid, &Ball::new([0.0; 3], 0.3)?, eps)?;
//!     let mesh = surfaces::phase_field_surface(&u, eps)?;
//!     let picture = render::Scene::new(&u, eps)?
//!         .quality(render::Quality::Draft)
//!         .render([160, 120])?;
//!
//!     let poster = ImageElement::from_bytes("ball", &picture.to_png()?)?;
//!     let posters = [("step 0".to_owned(), poster)];
//!     let ball = viewer("A ball", &posters, View::default(), [("step 0", &mesh)])?;
//!     let table = TableElement::from_csv("Errors", "n,error\n64,0.01\n128,0.0025\n")?;
//!     let parameters = Section::new("Parameters").with(Facts::default().with("eps", "2 h"));
//!     let page = Page::new("Balls & spheres")
//!         .with_lead("What a ball looks like.")
//!         .with(Section::new("Surface").with(ball))
//!         .with(Section::new("Numbers").with(table).with(parameters));
//!     let html = page.to_html();
//!     assert!(html.contains("<h1>Balls &amp; spheres</h1>"));
//! #   let folder = tempfile::tempdir()?;
//! #   let path = folder.path().join("ball.html");
//!     page.write(path)?;
//!     Ok(())
//! }
//! ```
//!
//! # Conventions
//!
//! - A page works from a disk, from a server and from a mail. It asks the network for nothing.
//! - Text is shown as it is, and not read as markup. There are two exceptions: the text that is given to
//!   [`markdown`], and the cells of a table that is read from Markdown. They cannot bring in scripts or
//!   pictures.
//! - Without JavaScript, sequences are strips and surfaces are pictures. Everything can be reached by
//!   keyboard, and every picture has a text for readers who cannot see it.
//! - Pictures have a white background, also on a dark page: figures are drawn for paper.
//! - The same input gives the same bytes.
//! - A page that is opened as `page.html#check` starts its viewers, and checks its pictures and links. It lists
//!   failures in the attribute `data-check` of its root element. `scripts/check_pages` reads this attribute.
//! - Errors of the crates that this crate depends on pass through unchanged. If a function can also refuse an input on its own, its documentation
//!   says so.

#![expect(clippy::missing_errors_doc, reason = "said once for all of them")]

pub mod results;

mod error;
mod facts;
mod image;
mod page;
mod surface;
mod table;
mod text;
mod viewer;

pub use error::{Error, Result};
pub use facts::{Facts, five_digits};
pub use image::ImageElement;
pub use maud::Markup;
pub use page::{Page, Section, figure, frames, thinned};
pub use render::View;
pub use table::TableElement;
pub use text::{markdown, paragraph};
pub use viewer::viewer;
