//! The one error type of the crate.

use std::path::PathBuf;

/// What can go wrong while describing, drawing or writing results.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A chart, heat map or drawing without a single point that can be drawn.
    #[error(
        "nothing to draw in {chart:?}: no series has a finite point \
         (positive on a logarithmic axis)"
    )]
    Empty {
        /// Title of the panel.
        chart: String,
    },
    /// A picture without pixels.
    #[error("the picture {chart:?} has no pixels")]
    NoPixels {
        /// Title or caption of the panel.
        chart: String,
    },
    /// A figure without panels.
    #[error("the figure has no panels: add one with `Figure::with_panel`")]
    NoPanels,
    /// An axis or colour range that is empty, not finite, or not positive where it must be.
    #[error(
        "the range [{low}, {high}] of axis {axis:?} must be finite, increasing by more than \
         rounding, and positive on a logarithmic scale"
    )]
    Range {
        /// Label of the axis.
        axis: String,
        /// Lower end as given.
        low: f64,
        /// Upper end as given.
        high: f64,
    },
    /// An array whose length does not match its shape.
    #[error("the array of {chart:?} has {found} values where its shape {shape:?} needs {expected}")]
    ArrayShape {
        /// Title of the panel.
        chart: String,
        /// Shape as given.
        shape: [usize; 2],
        /// Product of the shape.
        expected: usize,
        /// Length of the array.
        found: usize,
    },
    /// A figure size that leaves no room to draw, or more pixels than can be meant.
    #[error(
        "a figure of {width} x {height} units cannot be drawn: give it between {min} and {max} \
         a side and at least 40 for every panel"
    )]
    FigureSize {
        /// Width in layout units (pixels at scale 1).
        width: f64,
        /// Height in layout units (pixels at scale 1).
        height: f64,
        /// Smallest allowed side.
        min: f64,
        /// Largest allowed side.
        max: f64,
    },
    /// A metric, table cell or data point that is NaN or infinite.
    #[error("{what} is {value}, which is not a finite number")]
    NotFinite {
        /// Name of the metric, column or series, with the row where there is one.
        what: String,
        /// The offending value.
        value: f64,
    },
    /// A metric name outside the allowed grammar.
    #[error(
        "metric name {name:?} is not allowed: use lower-case words of letters, digits and '_', \
         joined by '.' and beginning with a letter, such as \"circle.error_l2\""
    )]
    MetricName {
        /// The name as given.
        name: String,
    },
    /// A metric inserted twice.
    #[error("metric {name:?} is already set to {value}")]
    DuplicateMetric {
        /// The name as given.
        name: String,
        /// The value it already has.
        value: String,
    },
    /// A table row with the wrong number of cells.
    #[error("row {row} of the table has {found} cells where there are {expected} columns")]
    RowLength {
        /// Index of the row, from 0.
        row: usize,
        /// Number of columns.
        expected: usize,
        /// Number of cells given.
        found: usize,
    },
    /// An output folder that cannot be created or written.
    #[error("cannot write to folder {}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A file that could not be written; what was there before is untouched.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the operating system or the producer of the content said.
        source: std::io::Error,
    },
    /// A file name that is not a single plain component.
    #[error("file name {name:?} is not allowed: give one plain name without separators")]
    FileName {
        /// The name as given.
        name: String,
    },
    /// A value that cannot be turned into JSON, or JSON that is not what it should be.
    #[error("{what} is not valid as JSON: {source}")]
    Json {
        /// What was being written or read.
        what: String,
        /// The cause.
        source: serde_json::Error,
    },
    /// Run parameters that are not a map from names to values.
    #[error("the run parameters of {experiment:?} must serialise to a map, for example a struct")]
    Parameters {
        /// Name of the experiment.
        experiment: String,
    },
    /// A record that cannot be turned into a CSV row.
    #[error("cannot write the records as CSV: {source}")]
    Csv {
        /// The cause.
        #[from]
        source: csv::Error,
    },
    /// The drawing backend refused an operation.
    #[error("cannot draw the figure: {cause}")]
    Draw {
        /// What the backend said.
        cause: String,
    },
}

/// Shorthand used throughout the crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;
