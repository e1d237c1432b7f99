//! The cells of a figure.

use derive_more::From;

use crate::error::Result;
use crate::geom::{Margins, Rect};
use crate::heatmap::Heatmap;
use crate::legend::LegendEntry;
use crate::plot::LineChart;
use crate::raster::Raster;
use crate::shapes::Shapes;
use crate::style::Fonts;
use crate::surface::Surface;

/// One cell of a figure.
#[allow(missing_docs, reason = "the types of these names say it")]
#[derive(Debug, Clone, PartialEq, From)]
#[non_exhaustive]
pub enum Panel {
    Line(LineChart),
    Heatmap(Heatmap),
    Shapes(Shapes),
    Raster(Raster),
}

impl Panel {
    /// Title above, caption in the middle below, remark in small type below; each may be empty.
    pub(crate) fn texts(&self) -> [&str; 3] {
        match self {
            Self::Line(chart) => [&chart.title, "", &chart.note],
            Self::Heatmap(map) => [&map.title, "", ""],
            Self::Shapes(shapes) => [&shapes.caption, "", ""],
            Self::Raster(raster) => ["", &raster.caption, ""],
        }
    }

    /// What is drawn, checked.
    pub(crate) fn checked(&self, fonts: Fonts) -> Result<Box<dyn Drawable + '_>> {
        Ok(match self {
            Self::Line(chart) => Box::new(chart.checked(fonts)?),
            Self::Heatmap(map) => Box::new(map.checked(fonts)?),
            Self::Shapes(shapes) => Box::new(shapes.checked()?),
            Self::Raster(raster) => Box::new(raster.checked()?),
        })
    }
}

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
