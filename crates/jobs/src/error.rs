//! Why a job refuses its input or its options, or stops.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::events::{Loss, ThinParts};
use crate::refusal::Refusal;

/// What can fail as a job does, unless it says otherwise.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Why a job does not begin, or stops. Every message is one line and says what to do; options are named in backticks.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no input.
    #[error(
        "there is no input: give a file, builtin:NAME, or a region as box:... or ball:..., or `input = ...` in a file of options"
    )]
    NoInput,
    /// A file of VTK.
    #[error(
        "{0} is for ParaView and is not read: give the same values as .npy, such as the final.npy beside a final.vti"
    )]
    ParaView(String),
    /// Something that no job takes.
    #[error(
        "{0} is no input: give a mesh (.obj, .stl, .ply, .off), an image (.png, .jpg, .webp, .gif, .tif, .bmp), a volume (.nii, .nii.gz, .nrrd, .nhdr, \
         .mgh, .mgz, .mrc, .map, .tif of several pages, .npy of labels), a field (.npy), builtin:NAME, or a region as box:... or ball:..."
    )]
    UnknownInput(String),
    /// An option that says nothing about the input, or in this dimension.
    #[error("`{option}`{value} has no meaning for {what}: leave it out")]
    Foreign {
        /// The option.
        option: &'static str,
        /// A blank and its value, or nothing.
        value: String,
        /// The kind of the input, or the dimension.
        what: &'static str,
    },
    /// Options that contradict each other, or do not fit the input.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// A file of options that cannot be read.
    #[error("{}: {problem}", path.display())]
    Settings {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A name that no job has.
    #[error("{0:?} is no job")]
    NoJob(String),
    /// Options by names that cannot be read.
    #[error("{0}")]
    Named(String),
    /// A grid that resolves nothing.
    #[error("`cells` {cells} resolves nothing: use at least {fewest} per unit length")]
    TooFewCells {
        /// Cells per unit length.
        cells: usize,
        /// The fewest.
        fewest: usize,
    },
    /// A grid that no memory holds.
    #[error(
        "`cells` {cells} makes {nodes:.1e} nodes in a box of side {box_side}, more than {most:.1e}: use fewer"
    )]
    TooManyNodes {
        /// Cells per unit length.
        cells: usize,
        /// The nodes of the grid.
        nodes: f64,
        /// The side of the box.
        box_side: f64,
        /// The most.
        most: f64,
    },
    /// The interface is too narrow or too wide for a grid.
    #[error("`eps_over_h` {0} is not possible: an interface is from 0.5 to 64 cells wide")]
    InterfaceWidth(f64),
    /// A shape that does not fit into the box.
    #[error(
        "`side_length` {side} does not fit the box of side {box_side}, whose sides are to be an interface width away: give a positive length of at most \
         {most:.4}"
    )]
    SideLength {
        /// The longest side of the shape.
        side: f64,
        /// The side of the box.
        box_side: f64,
        /// The most.
        most: f64,
    },
    /// A box that has no room for any shape.
    #[error(
        "the box of side {box_side} with `cells` {cells} has no room for a shape, whose distance from each side is to be an interface width: use more \
         `cells` or a larger `box_side`"
    )]
    NoRoom {
        /// The side of the box.
        box_side: f64,
        /// Cells per unit length.
        cells: usize,
    },
    /// Parts or holes would be lost on the grid.
    #[error("{loss}; {}", advice(*may_allow, *vertices_follow))]
    Lost {
        /// Which.
        loss: Box<Loss>,
        /// Whether there is an option that allows it.
        may_allow: bool,
        /// Whether the vertices of the mesh were to follow the flow.
        vertices_follow: bool,
    },
    /// Much of the shape is too thin for the grid.
    #[error("{thin}: give a larger `side_length`, or `cells`{} to go on all the same", or_allow_loss(*may_allow))]
    Thin {
        /// How much.
        thin: Box<ThinParts>,
        /// Whether there is an option that allows it.
        may_allow: bool,
    },
    /// A photograph instead of a drawing.
    #[error(
        "{} has continuous tones, as a photograph: {:.0} % of its pixels have none of two. A shape has two: with `threshold` {threshold:.2}, which separates \
         them best, the pixels {side}, {:.0} % of all, would be inside, and all other tones of them would be lost; say so by `threshold` or `inside`",
        path.display(), 100.0 * between, 100.0 * inside
    )]
    Photograph {
        /// The image.
        path: PathBuf,
        /// The part of its pixels between two tones.
        between: f64,
        /// The threshold that separates them best.
        threshold: f64,
        /// On which side of it the inside is.
        side: String,
        /// The part of the pixels there.
        inside: f64,
    },
    /// Values that no phase field has.
    #[error(
        "{} holds the value {value}, which no phase field has; give `field_kind` distance if these are signed distances",
        path.display()
    )]
    NoPhase {
        /// The file.
        path: PathBuf,
        /// The value.
        value: f64,
    },
    /// Values of which none is that of the outside in a phase field.
    #[error(
        "{} holds values from {low:.4} to {high:.4}, and a phase field goes from -1 outside to 1 inside: {}, or `field_kind` if it is a field all the same",
        path.display(), not_a_field(*dimension)
    )]
    NoneOutside {
        /// The file.
        path: PathBuf,
        /// The lowest value.
        low: f64,
        /// The highest one.
        high: f64,
        /// The dimension of the array.
        dimension: usize,
    },
    /// A shape of which there is nothing on the grid, or nothing else.
    #[error(
        "{input} has {inside} of {nodes} nodes inside, so that there is nothing to move: use more `cells`, or another size"
    )]
    NothingMoves {
        /// The input.
        input: String,
        /// Nodes inside the shape.
        inside: usize,
        /// Nodes of the grid.
        nodes: usize,
    },
    /// A mesh that bounds nothing, and that can perhaps be repaired.
    #[error("{error}, or give {}", if *vertices_follow { "`remesh` and `repair`" } else { "`repair`" })]
    Repairable {
        /// What is wrong with it.
        error: surfaces::Error,
        /// Whether the vertices of the mesh were to follow the flow.
        vertices_follow: bool,
    },
    /// A result that has no such format.
    #[error("`save` {}: a result in {dimension}D is saved as .{}", path.display(), formats.join(" or ."))]
    Format {
        /// The file.
        path: PathBuf,
        /// The dimension of the shape.
        dimension: usize,
        /// The extensions that it can have.
        formats: &'static [&'static str],
    },
    /// The folder for a file is not there.
    #[error("`save` {}: there is no such folder", .0.display())]
    NoFolder(PathBuf),
    /// A file that would be written over.
    #[error("`save` {} is there already: give another name, or `force` to write over it", .0.display())]
    Exists(PathBuf),
    /// A file that a run that goes on would write over.
    #[error("{} of `save` is there already: move it away, or give `force` to write over it", .0.display())]
    ExistsByNow(PathBuf),
    /// A file among those of the run.
    #[error("`save` {}: it would be in the folder of `output`, which is for the files of the run: give another folder", .0.display())]
    SavedInTheRun(PathBuf),
    /// A file in the folder of a run that is not of the run.
    #[error(
        "{} is not of the run in this folder, which `force` would remove: move it away, or give another `output`",
        .0.display()
    )]
    NotOfTheRun(PathBuf),
    /// The input is in the folder that would be removed.
    #[error(
        "{0} is in the folder of `output`, which `force` would remove: copy it elsewhere, or give another `output`"
    )]
    InputInTheRun(String),
    /// The options of a run that cannot be stored, such as paths that are no text.
    #[error("the options cannot be stored: {0}")]
    UnwritableOptions(toml::ser::Error),
    /// A run with the notes of another program.
    #[error("{} cannot be resumed: {reason}; start a new run", path.display())]
    OtherNotes {
        /// The folder of the run.
        path: PathBuf,
        /// What is wrong with the notes.
        reason: serde_json::Error,
    },
    /// The outcome in the folder of a run is none.
    #[error("the stored outcome: {0}")]
    StoredOutcome(serde_json::Error),
    /// The options in the folder of a run are none.
    #[error("the stored options: {0}")]
    StoredOptions(toml::de::Error),
    /// The flow was interrupted.
    #[error("interrupted")]
    Interrupted,
    /// Time steps became too small.
    #[error("{}; the shape is not resolved, use more `cells`", files::with_causes(.0))]
    TooStiff(engine::Error),
    /// Sizes change too fast.
    #[error("{}; give a larger `ramp`", files::with_causes(.0))]
    Hurried(engine::Error),
    /// From the loop over steps.
    #[error(transparent)]
    Engine(engine::Error),
    /// From reading and writing files.
    #[error(transparent)]
    Files(#[from] files::Error),
    /// From grids and shapes.
    #[error(transparent)]
    Geometry(#[from] geometry::Error),
    /// From images.
    #[error(transparent)]
    Images(#[from] images::Error),
    /// From networks.
    #[error(transparent)]
    Model(#[from] model::Error),
    /// From devices.
    #[error(transparent)]
    Operators(#[from] operators::Error),
    /// From pages.
    #[error(transparent)]
    Pages(#[from] pages::Error),
    /// From figures.
    #[error(transparent)]
    Report(#[from] report::Error),
    /// From pictures.
    #[error(transparent)]
    Render(#[from] render::Error),
    /// From the folders of runs.
    #[error(transparent)]
    Runs(#[from] runs::Error),
    /// From time steps.
    #[error(transparent)]
    Solver(#[from] solver::Error),
    /// From meshes.
    #[error(transparent)]
    Surfaces(#[from] surfaces::Error),
    /// From segmentations.
    #[error(transparent)]
    Volumes(#[from] volumes::Error),
}

/// What values are that no phase field has.
fn not_a_field(dimension: usize) -> &'static str {
    if dimension == 2 {
        "save a mask as an image (.png)"
    } else {
        "give `threshold` VALUE to read it as a volume, whose larger values are inside"
    }
}

/// What helps against losses.
fn advice(may_allow: bool, vertices_follow: bool) -> String {
    if vertices_follow {
        return "use more `cells`, or `allow_loss` to go on without them".to_owned();
    }
    format!(
        "give a larger `side_length` or more `cells`, or these `cells`{} to go on without them",
        or_allow_loss(may_allow)
    )
}

fn or_allow_loss(may_allow: bool) -> &'static str {
    if may_allow { " or `allow_loss`" } else { "" }
}

impl From<engine::Error> for Error {
    fn from(error: engine::Error) -> Self {
        match &error {
            engine::Error::Step { source, .. }
                if matches!(**source, solver::Error::Rushed { .. }) =>
            {
                Self::Hurried(error)
            }
            engine::Error::TooStiff { source, .. }
                if !matches!(**source, solver::Error::NonFinite { .. }) =>
            {
                Self::TooStiff(error)
            }
            _ => Self::Engine(error),
        }
    }
}

impl Error {
    /// Of a file of options. Messages on damaged files may be as long as these.
    pub(crate) fn settings(path: &Path, problem: &str) -> Self {
        Self::Settings {
            path: path.to_owned(),
            problem: files::shortened(problem, 400),
        }
    }

    pub(crate) fn foreign(
        option: &'static str,
        value: impl fmt::Display,
        what: &'static str,
    ) -> Self {
        let value = match value.to_string() {
            value if value.is_empty() => value,
            value => format!(" {value}"),
        };
        Self::Foreign {
            option,
            value,
            what,
        }
    }

    /// Of a mesh that may bound nothing.
    pub(crate) fn mesh(error: surfaces::Error) -> Self {
        Self::repairable(error, false)
    }

    /// Of one whose vertices were to follow the flow.
    pub(crate) fn own_mesh(error: surfaces::Error) -> Self {
        Self::repairable(error, true)
    }

    pub(crate) fn repairable(error: surfaces::Error, vertices_follow: bool) -> Self {
        use surfaces::Error::{
            LidCrosses, Loose, MixedOrientation, Nesting, NoArea, NonManifold, Open, Overlap,
        };
        match error {
            Open { .. }
            | NonManifold { .. }
            | MixedOrientation { .. }
            | Nesting { .. }
            | Overlap(_)
            | LidCrosses { .. }
            | Loose { .. }
            | NoArea { .. } => Self::Repairable {
                error,
                vertices_follow,
            },
            error => error.into(),
        }
    }
}
