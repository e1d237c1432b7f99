//! What lines, markers and letters look like.

use crate::geom::{Point, disc, point};

/// How a curve is stroked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LineStyle {
    /// Unbroken.
    #[default]
    Solid,
    /// Long dashes.
    Dashed,
    /// Short dashes.
    ShortDashed,
    /// Dots.
    Dotted,
    /// Dashes, each followed by two dots.
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
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    /// A disc.
    Circle,
    /// An axis-parallel square.
    Square,
    /// A square on its corner.
    Diamond,
    /// A triangle pointing up.
    Triangle,
}

impl Marker {
    /// Half the size, in layout units.
    pub(crate) const RADIUS: f64 = 3.8;
    /// Width of the white rim.
    pub(crate) const RIM: f64 = 1.0;

    /// The corners of a marker of any radius.
    pub(crate) fn outline(self, centre: Point, radius: f64) -> Vec<Point> {
        let corners: &[(f64, f64)] = match self {
            Self::Circle => return disc(centre, radius),
            Self::Square => &[(-0.88, -0.88), (0.88, -0.88), (0.88, 0.88), (-0.88, 0.88)],
            Self::Diamond => &[(0.0, -1.2), (1.2, 0.0), (0.0, 1.2), (-1.2, 0.0)],
            Self::Triangle => &[(0.0, -1.15), (1.1, 0.8), (-1.1, 0.8)],
        };
        let place = |&(x, y)| point(centre.x + radius * x, centre.y + radius * y);
        corners.iter().map(place).collect()
    }
}

/// Letter sizes (em, in layout units) of one figure.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fonts {
    pub heading: f64,
    pub title: f64,
    pub label: f64,
    pub tick: f64,
    pub legend: f64,
    pub note: f64,
}

impl Fonts {
    /// Sizes for a figure with this many panels side by side.
    pub fn for_columns(columns: usize) -> Self {
        let (title, label, tick) = match columns {
            0 | 1 => (17.0, 15.0, 13.5),
            2 => (15.0, 13.5, 12.5),
            _ => (14.0, 13.0, 12.0),
        };
        Self {
            heading: 17.5,
            title,
            label,
            tick,
            legend: tick,
            note: 12.0,
        }
    }
}
