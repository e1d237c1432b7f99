//! The cells of a figure.

use derive_more::From;
use plotters_backend::text_anchor::HPos;

use crate::axes::Margins;
use crate::colour::{GREY, INK};
use crate::error::Result;
use crate::font::TextStyle;
use crate::geom::Rect;
use crate::heatmap::Heatmap;
use crate::legend::LegendEntry;
use crate::plot::LineChart;
use crate::raster::Raster;
use crate::shapes::Shapes;
use crate::style::Fonts;
use crate::surface::Surface;

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

    /// Text above.
    pub(crate) fn title(&self) -> &str {
        match self {
            Self::Line(chart) => &chart.title,
            Self::Heatmap(map) => &map.title,
            Self::Shapes(shapes) => &shapes.caption,
            Self::Raster(_) => "",
        }
    }

    /// Text below.
    pub(crate) fn remark(&self, fonts: Fonts) -> (&str, TextStyle) {
        let note = TextStyle::new(fonts.note, GREY).aligned(HPos::Left);
        match self {
            Self::Line(chart) => (chart.note.as_deref().unwrap_or(""), note),
            Self::Raster(raster) => (&raster.caption, TextStyle::new(fonts.label, INK)),
            Self::Heatmap(_) | Self::Shapes(_) => ("", note),
        }
    }

    /// Groups of entries for the legend.
    pub(crate) fn legend(&self) -> Vec<Vec<LegendEntry>> {
        match self {
            Self::Line(chart) => chart.legend(),
            _ => Vec::new(),
        }
    }
}

/// What the layout asks of a panel whose content is checked.
pub(crate) trait Drawable {
    /// Height over width of the plot box, if that is fixed.
    fn aspect(&self) -> Option<f64>;

    /// Room for axes around a plot box of the given size.
    fn margins(&self, width: f64, height: f64) -> Margins;

    /// Draws into the plot box, and axes around it.
    fn draw(&self, surface: &mut dyn Surface, plot: Rect) -> Result<()>;
}
