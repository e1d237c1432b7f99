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
