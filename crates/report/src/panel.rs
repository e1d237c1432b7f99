//! The cells of a figure.

use derive_more::From;

use crate::drawable::Drawable;
use crate::error::Result;
use crate::heatmap::Heatmap;
use crate::plot::LineChart;
use crate::raster::Raster;
use crate::shapes::Shapes;
use crate::style::Fonts;

/// One cell of a figure.
#[derive(Debug, Clone, PartialEq, From)]
#[non_exhaustive]
pub enum Panel {
    /// A line chart.
    Line(LineChart),
    /// A heat map.
    Heatmap(Heatmap),
    /// Plane curves.
    Shapes(Shapes),
    /// A picture.
    Raster(Raster),
}

impl Panel {
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
