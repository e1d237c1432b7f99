//! What the layout of a figure asks of its panels.

use crate::geom::{Margins, Rect};
use crate::legend::LegendEntry;
use crate::surface::Surface;

/// A panel whose content is checked.
pub(crate) trait Drawable {
    /// Title above, caption in the middle below, remark in small type below; each may be empty.
    fn texts(&self) -> [&str; 3];

    /// Groups of entries for the legend.
    fn legend(&self) -> Vec<Vec<LegendEntry>> {
        Vec::new()
    }

    /// Height over width of the plot box, if that is fixed.
    fn aspect(&self) -> Option<f64>;

    /// Room for axes around a plot box of the given size; without any, for its outline.
    fn margins(&self, _width: f64, _height: f64) -> Margins {
        Margins::even(1.0)
    }

    /// Draws into the plot box, and axes around it.
    fn draw(&self, surface: &mut dyn Surface, plot: Rect);
}
