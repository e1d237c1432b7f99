//! What a job tells while it runs, as values: whoever starts it decides how to show them.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

use pages::five_digits;
use runs::Interrupt;

use crate::parts::PartReport;
use crate::presentation::Topology;

/// What looks after a job. By default nothing is told, and nothing interrupts it.
pub trait Watcher: Sync {
    /// Something that the person should know before trusting the result.
    fn warning(&self, _: &Warning) {}

    /// A choice that the job made, or how far it is.
    fn note(&self, _: &Note) {}

    /// Long work begins, of so many parts.
    fn begins(&self, _title: &str, _parts: u64) -> Box<dyn Progress> {
        Box::new(Untold)
    }

    /// The run of a job is stored in a folder from now on, and can be resumed from there; its result goes to a file besides.
    fn stores(&self, _command: &'static str, _folder: &Path, _save: Option<&Path>) {}

    /// A part of the job took so long: one of [`PARTS`], or of the flow one of [`solver::PhaseTimes::PARTS`]. A part is told each time that
    /// it is over. By default nobody is told.
    fn spent(&self, _part: &'static str, _seconds: f64) {}

    /// The flag that ends the steps of a flow, and drops the one that is being made; asked for before the first step.
    ///
    /// # Errors
    /// [`runs::Error::Signals`] where signals cannot be caught.
    fn interrupt(&self) -> Result<Interrupt, runs::Error> {
        Ok(Interrupt::never())
    }
}

/// Parts of a job besides those of the flow that [`Watcher::spent`] tells.
///
/// - `input`: all that is read and made of the input, `signed distances` among it.
/// - `preparation`: from there to the first step; the folder of the run is made.
/// - `other work of steps`: what the parts of the flow leave of minimizations.
/// - `measures`: what is done between minimizations: lengths of motions, stop rules, topology, checkpoints.
/// - `output`: all that is made of the end, `surface` and `pictures` among it.
/// - `page`: the page for the browser.
pub const PARTS: [&str; 9] = [
    INPUT,
    DISTANCES,
    PREPARATION,
    OTHER_OF_STEPS,
    MEASURES,
    OUTPUT,
    SURFACE,
    PICTURES,
    PAGE,
];
pub(crate) const INPUT: &str = "input";
pub(crate) const DISTANCES: &str = "signed distances";
pub(crate) const PREPARATION: &str = "preparation";
pub(crate) const OTHER_OF_STEPS: &str = "other work of steps";
pub(crate) const MEASURES: &str = "measures";
pub(crate) const OUTPUT: &str = "output";
pub(crate) const SURFACE: &str = "surface";
pub(crate) const PICTURES: &str = "pictures";
pub(crate) const PAGE: &str = "page";

/// Tells a watcher how long some work took.
pub(crate) fn timed<T>(watcher: &dyn Watcher, part: &'static str, work: impl FnOnce() -> T) -> T {
    let clock = Instant::now();
    let result = work();
    watcher.spent(part, clock.elapsed().as_secs_f64());
    result
}

/// A watcher that tells nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Watcher for Silent {}

/// How far long work is; it is over when this is dropped.
pub trait Progress: Sync {
    /// There are so many parts, as is found out only now.
    fn expect(&self, _parts: u64) {}
    /// So many parts are done.
    fn reach(&self, parts: u64);
    /// One more is.
    fn advance(&self);
}

struct Untold;

impl Progress for Untold {
    fn reach(&self, _: u64) {}
    fn advance(&self) {}
}

/// What a person should know before trusting a result.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// The file of a mesh was mended while it was read.
    Mended {
        /// The file.
        path: PathBuf,
        /// How.
        change: surfaces::Warning,
        /// Whether the mesh that is written does not have the change, since its vertices follow the flow and all else of the file stays.
        only_for_flow: bool,
    },
    /// A new mesh was made of one that is open, crosses itself or is not oriented alike.
    Repaired {
        /// The file.
        path: PathBuf,
        /// What was done.
        changes: surfaces::RepairChanges,
    },
    /// A volume has voxels without a value, or not all that is needed to place it.
    Volume {
        /// The file.
        path: PathBuf,
        /// What is missing.
        warning: volumes::Warning,
    },
    /// Parts or holes are lost on the grid.
    Lost(Loss),
    /// Bodies of a mesh overlap.
    Overlap(surfaces::Overlap),
    /// A part of the boundary is at parts or gaps that are thin for the interface.
    Thin(ThinParts),
    /// Much of a mesh is at such parts, where its vertices stay.
    ThinStays {
        /// Vertices that stay.
        vertices: usize,
        /// All vertices.
        all: usize,
    },
    /// Nodes that the faces of a mesh that crosses itself put on the wrong side were put right.
    SignsMended {
        /// How many.
        nodes: usize,
    },
    /// Small parts or holes of a segmentation are left out, as noise.
    Specks(Vec<volumes::Speck>),
    /// Parts of a segmentation are too small for the grid, and stay as they are.
    SmallParts(Vec<PartReport>),
    /// The estimated noise of a mesh may be its edges.
    Flat {
        /// The part of the vertices that lie in a plane with those around them.
        part: f64,
    },
    /// An image has more than eight bits for a tone, and its repair has eight.
    Deep {
        /// The file.
        path: PathBuf,
    },
    /// A file of single precision holds a mesh that is far from the origin.
    SinglePrecision {
        /// The file.
        path: PathBuf,
        /// The rounding of coordinates over the mean length of edges.
        part: f64,
    },
    /// The folder of the file to save is gone.
    FolderGone {
        /// The file.
        path: PathBuf,
    },
    /// There is no shape left to save.
    NothingSaved,
}

/// Parts or gaps that a grid does not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss {
    /// Cells per unit length.
    pub cells: usize,
    /// Thinner parts and gaps come and go with the place of the grid.
    pub thinnest: f64,
    /// The longest side of the mesh.
    pub longest_side: f64,
    /// Parts and holes of the mesh.
    pub of_mesh: Topology,
    /// Parts and holes of its surface on the grid.
    pub on_grid: Topology,
    /// The distance of that surface from the mesh.
    pub distance: GridDistance,
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "with {} cells per unit length (`cells`) parts and gaps thinner than {:.3e} ({:.2} % of the longest side) are lost: the mesh has {}, the \
             grid {}; its surface is {}",
            self.cells,
            self.thinnest,
            100.0 * self.thinnest / self.longest_side,
            self.of_mesh,
            self.on_grid,
            self.distance,
        )
    }
}

/// How far the surface on a grid is from the mesh that it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GridDistance {
    /// The Hausdorff distance.
    AtMost {
        /// In the units of the mesh.
        length: f64,
        /// The longest side of the mesh.
        longest_side: f64,
    },
    /// The surface touches itself, so that there is no distance.
    TouchesItself,
    /// There is no surface.
    Nothing,
}

impl fmt::Display for GridDistance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtMost {
                length,
                longest_side,
            } => {
                let percent = 100.0 * length / longest_side;
                write!(
                    f,
                    "at most {length:.3e} ({percent:.3} % of the longest side) from that of the mesh"
                )
            }
            Self::TouchesItself => f.write_str("one that touches itself"),
            Self::Nothing => f.write_str("not there at all"),
        }
    }
}

/// Parts or gaps that are thin for the interface.
#[derive(Clone, Debug, PartialEq)]
pub struct ThinParts {
    /// The part of the boundary at them.
    pub part: f64,
    /// The thickness below which parts and gaps are thin, in the units of the input.
    pub below: f64,
    /// This thickness in interface widths.
    pub widths: f64,
    /// Cells per unit length.
    pub cells: usize,
    /// Whether vertices follow the surface, which they do less well there; otherwise thin parts do not last.
    pub vertices_follow: bool,
}

impl fmt::Display for ThinParts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let consequence = if self.vertices_follow {
            "where vertices follow less well"
        } else {
            "which will not last"
        };
        write!(
            f,
            "{:.1} % of the boundary is at parts or gaps thinner than {:.3e}, {} interface widths with {} cells per unit length (`cells`), {consequence}",
            100.0 * self.part,
            self.below,
            self.widths,
            self.cells,
        )
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mended {
                path,
                change,
                only_for_flow,
            } => {
                let only = if *only_for_flow {
                    " for the flow, and not in the mesh that is written"
                } else {
                    ""
                };
                write!(f, "{}: {change}{only}", path.display())
            }
            Self::Repaired { path, changes } => write!(f, "{}: {changes}", path.display()),
            Self::Volume { path, warning } => write!(f, "{}: {warning}", path.display()),
            Self::Overlap(overlap) => overlap.fmt(f),
            Self::Lost(loss) => loss.fmt(f),
            Self::Thin(thin) => thin.fmt(f),
            Self::ThinStays { vertices, all } => write!(
                f,
                "{vertices} of {all} vertices, at such thin parts or gaps, stay where they are; more `cells` hold more of them, and `allow_loss` lets them move"
            ),
            Self::SignsMended { nodes } => write!(
                f,
                "the mesh crosses itself: {nodes} nodes of the grid, which its faces put on the wrong side, were put right"
            ),
            Self::Specks(specks) => LeftOut(specks).fmt(f),
            Self::SmallParts(parts) => write!(
                f,
                "{} parts or holes are too small for the grid, which more `cells` make finer: they stay as they are between the voxels, with their \
                 volumes: {}",
                parts.len(),
                listed(parts, PartReport::found_at)
            ),
            Self::Flat { part } => write!(
                f,
                "{:.0} % of the vertices lie in a plane with those around them, where noise leaves none: what was taken for noise may be the \
                 edges of the mesh, which may become round; `noise` says how much noise there is",
                100.0 * part
            ),
            Self::Deep { path } => write!(
                f,
                "{} has more than 8 bits for a tone; the repaired image has 8",
                path.display()
            ),
            Self::SinglePrecision { path, part } => {
                write!(
                    f,
                    "{}: coordinates of STL files are in single precision, which rounds these by up to {:.1} % of an edge: save .ply, .obj or .off, or \
                     move the mesh to the origin",
                    path.display(),
                    100.0 * part
                )
            }
            Self::FolderGone { path } => {
                write!(
                    f,
                    "nothing will be saved to {}: its folder is gone",
                    path.display()
                )
            }
            Self::NothingSaved => {
                f.write_str("nothing is saved to the file of `save`: the shape has vanished")
            }
        }
    }
}

/// How many parts are listed.
const LISTED: usize = 10;

/// The first of some parts, and that there are others.
fn listed<T>(parts: &[T], each: impl Fn(&T) -> String) -> String {
    let first = parts.iter().take(LISTED).map(each);
    let rest = (parts.len() > LISTED).then(|| "and others".to_owned());
    first.chain(rest).collect::<Vec<_>>().join("; ")
}

/// Parts and holes that are left out.
struct LeftOut<'a>(&'a [volumes::Speck]);

impl fmt::Display for LeftOut<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let filled: isize = self.0.iter().map(|speck| speck.filled).sum();
        let each = |speck: &volumes::Speck| {
            let [x, y, z] = speck.place.map(five_digits);
            format!("{:+} at {x}, {y}, {z}", speck.filled)
        };
        let list = listed(self.0, each);
        write!(
            f,
            "{} parts or holes of a few voxels are left out, which changes the volume by {filled:+} voxels: {list}",
            self.0.len()
        )
    }
}

/// A choice that a job made, or how far it is.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Note {
    /// The noise that was estimated.
    Noise {
        /// Standard deviation along the normals.
        noise: f64,
        /// The longest side of the mesh.
        longest_side: f64,
    },
    /// The grid that was chosen for a mesh whose vertices follow the flow.
    Grid {
        /// Cells per unit length.
        cells: usize,
        /// The side of a cell.
        spacing: f64,
        /// How far the surface there is from the mesh.
        distance: GridDistance,
    },
    /// Cells are wider than the voxels.
    CoarserThanVoxels {
        /// How many voxels wide.
        voxels: f64,
        /// Cells per unit length.
        cells: usize,
    },
    /// An array of 0 and 1 is taken for a volume of labels.
    Mask {
        /// The file.
        path: PathBuf,
    },
    /// Edges sharper than the interface became round.
    RoundEdges {
        /// Whether it is a curve, whose length it is about, and not a surface with an area.
        is_curve: bool,
        /// The length or area with round edges.
        round: f64,
        /// The length or area before.
        sharp: f64,
        /// The length or area to which it goes.
        target: f64,
    },
    /// In the plane the area is that of the inside. Before version 0.1 the option held the length.
    AreaInThePlane,
    /// How much of the grid is stored.
    Storage {
        /// The part of the grid.
        part: f64,
        /// Bytes of memory, about.
        bytes: f64,
    },
    /// Parts or holes have come or gone.
    TopologyChanged {
        /// The step after which.
        step: usize,
        /// Its time.
        time: f64,
        /// Parts and holes before the step.
        before: Topology,
        /// Parts and holes after it.
        now: Topology,
    },
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Noise {
                noise,
                longest_side,
            } => write!(
                f,
                "noise: {noise:.3e}, {:.3} % of the longest side, estimated (`noise`)",
                100.0 * noise / longest_side
            ),
            Self::Grid {
                cells,
                spacing,
                distance,
            } => write!(
                f,
                "grid: {cells} cells per unit length, {spacing:.3e} wide (`cells`); its surface is {distance}"
            ),
            Self::CoarserThanVoxels { voxels, cells } => write!(
                f,
                "a cell is {voxels:.1} voxels wide: with more `cells` than {cells} smaller details last"
            ),
            Self::Mask { path } => write!(
                f,
                "{} holds 0 and 1: it is read as a mask, in voxels of side 1, and not as a phase field, which goes from -1 to 1",
                path.display()
            ),
            Self::RoundEdges {
                is_curve,
                round,
                sharp,
                target,
            } => {
                let size = if *is_curve { "length" } else { "area" };
                write!(
                    f,
                    "edges sharper than the interface became round: {size} {round:.4} instead of {sharp:.4}; it goes to {target:.4} over the steps of \
                     `ramp`"
                )
            }
            Self::AreaInThePlane => f.write_str(
                "`area` holds the area of the inside; `length` holds the length of the curve",
            ),
            Self::Storage { part, bytes } => {
                let what = if *part < 1.0 {
                    format!("bricks near the surface, {:.0} % of the grid", 100.0 * part)
                } else {
                    "the whole grid".to_owned()
                };
                let gigabytes = 1e-9 * bytes;
                write!(
                    f,
                    "storage: {what}, about {gigabytes:.1} GB of memory (`storage`)"
                )
            }
            Self::TopologyChanged {
                step,
                time,
                before,
                now,
            } => write!(
                f,
                "step {step}, t = {time:.4e}: parts or holes have come or gone, {now} where there were {before}"
            ),
        }
    }
}
