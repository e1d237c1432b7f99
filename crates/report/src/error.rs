//! The one error type of the crate.

#![allow(missing_docs, reason = "messages and names say it")]

/// What can go wrong while describing, drawing or writing results.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    #[error(
        "nothing to draw in {0:?}: it has no finite point (positive on a logarithmic axis) and no pixel"
    )]
    Empty(String),
    #[error("the figure has no panels: add one with `Figure::with_panel`")]
    NoPanels,
    #[error(
        "the range [{low}, {high}] of axis {axis:?} must be finite, increasing by more than \
         rounding, and positive on a logarithmic scale"
    )]
    Range { axis: String, low: f64, high: f64 },
    #[error(
        "the array of {chart:?} has {found} values where its shape {shape:?} needs {}",
        shape[0].saturating_mul(shape[1])
    )]
    ArrayShape {
        chart: String,
        shape: [usize; 2],
        found: usize,
    },
    #[error(
        "a figure of {width} x {height} units cannot be drawn: give it between 80 and 2600 \
         a side and at least 40 for every panel"
    )]
    FigureSize {
        width: f64,
        /// Height in layout units, 0 if it is not known.
        height: f64,
    },
    #[error("{what} is {value}, which is not a finite number")]
    NotFinite { what: String, value: f64 },
    #[error(
        "metric name {0:?} is not allowed: use lower-case words of letters, digits and '_', \
         joined by '.' and beginning with a letter, such as \"circle.error_l2\""
    )]
    MetricName(String),
    #[error("metric {name:?} is already set to {value}")]
    DuplicateMetric { name: String, value: String },
    /// A file or folder that could not be written; what was there before is untouched.
    #[error(transparent)]
    File(#[from] files::Error),
    #[error("file name {0:?} is not allowed: give one plain name without separators")]
    FileName(String),
    #[error("{what} is not valid as JSON: {source}")]
    Json {
        what: String,
        source: serde_json::Error,
    },
}

impl Error {
    /// Whether an array has the length that its shape says, and that is not 0.
    pub(crate) fn check_shape(chart: &str, shape: [usize; 2], found: usize) -> Result<()> {
        let chart = chart.to_owned();
        match shape[0].saturating_mul(shape[1]) == found {
            true if found == 0 => Err(Self::Empty(chart)),
            true => Ok(()),
            false => Err(Self::ArrayShape {
                chart,
                shape,
                found,
            }),
        }
    }

    pub(crate) fn json(what: impl Into<String>) -> impl FnOnce(serde_json::Error) -> Self {
        let what = what.into();
        move |source| Self::Json { what, source }
    }
}

/// Shorthand used throughout the crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;
