//! What lines, markers and letters look like.

use glam::{DVec2, dvec2};

use crate::geom::disc;

/// How a curve is stroked.
#[allow(missing_docs, reason = "names say it")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LineStyle {
    #[default]
    Solid,
    Dashed,
    ShortDashed,
    Dotted,
    DashDotDot,
    /// No line: only the markers are drawn.
    None,
}

impl LineStyle {
    /// Pen-down and pen-up lengths in layout units.
    pub(crate) const fn pattern(self) -> &'static [f64] {
        match self {
            Self::Solid | Self::None => &[],
            Self::Dashed => &[8.5, 4.5],
            Self::ShortDashed => &[4.6, 3.2],
            Self::Dotted => &[2.2, 3.2],
            Self::DashDotDot => &[9.0, 3.2, 2.2, 3.2, 2.2, 3.2],
        }
    }
}

/// The symbol at a data point.
#[allow(missing_docs, reason = "names say it")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    Circle,
    Square,
    Diamond,
    Triangle,
}

impl Marker {
    /// Half the size, in layout units.
    pub(crate) const RADIUS: f64 = 3.8;
    /// Width of the white rim.
    pub(crate) const RIM: f64 = 1.0;

    /// The corners of a marker of any radius.
    pub(crate) fn outline(self, centre: DVec2, radius: f64) -> Vec<DVec2> {
        let corners: &[(f64, f64)] = match self {
            Self::Circle => return disc(centre, radius),
            Self::Square => &[(-0.88, -0.88), (0.88, -0.88), (0.88, 0.88), (-0.88, 0.88)],
            Self::Diamond => &[(0.0, -1.2), (1.2, 0.0), (0.0, 1.2), (-1.2, 0.0)],
            Self::Triangle => &[(0.0, -1.15), (1.1, 0.8), (-1.1, 0.8)],
        };
        let place = |&(x, y)| centre + radius * dvec2(x, y);
        corners.iter().map(place).collect()
    }
}

/// Letter sizes (em, in layout units) of one figure.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fonts {
    pub title: f64,
    pub label: f64,
    /// Of the numbers at axes, and of legends.
    pub tick: f64,
}

impl Fonts {
    pub const HEADING: f64 = 17.5;
    pub const NOTE: f64 = 12.0;

    /// Sizes for a figure with this many panels side by side.
    pub fn for_columns(columns: usize) -> Self {
        let (title, label, tick) = match columns {
            0 | 1 => (17.0, 15.0, 13.5),
            2 => (15.0, 13.5, 12.5),
            _ => (14.0, 13.0, 12.0),
        };
        Self { title, label, tick }
    }
}
