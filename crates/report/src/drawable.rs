//! What figures ask of the content of a panel.

use crate::geom::{Margins, Rect};
use crate::legend::LegendEntry;
use crate::surface::Surface;

/// A panel whose content is checked.
pub(crate) trait Drawable {
    /// Groups of entries for the legend.
    fn legend(&self) -> Vec<Vec<LegendEntry>> {
        Vec::new()
    }

    /// Height over width of the plot box, if that is fixed.
    fn aspect(&self) -> Option<f64> {
        None
    }

    /// Room for axes around a plot box of the given size; without any, for its outline.
    fn margins(&self, _width: f64, _height: f64) -> Margins {
        Margins {
            left: 1.0,
            right: 1.0,
            top: 1.0,
            bottom: 1.0,
        }
    }

    /// Draws into the plot box, and axes around it.
    fn draw(&self, surface: &mut dyn Surface, plot: Rect);
}
