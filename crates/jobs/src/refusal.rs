//! Options that contradict each other, or do not fit the input.

use std::path::PathBuf;

use crate::values::Amount;

/// Why options are refused. Every message is one line and says what to do; options are named in backticks.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// A value that cannot be read.
    #[error("`{option}`{}: {reason}", after_blank(value.as_deref()))]
    Value {
        /// The option.
        option: &'static str,
        /// Its value, where the reason does not show it.
        value: Option<String>,
        /// What is wrong with it.
        reason: String,
    },
    /// A region that cannot be read, as the input.
    #[error("{0}")]
    Region(String),

    /// A network or a scheme, for finite elements.
    #[error(
        "`network` and `scheme` have no meaning for finite elements: leave them out, or choose `method` network"
    )]
    FiniteElements,
    /// A tolerance, for time steps that no error controls.
    #[error("`tolerance` {0} is for controlled time steps: give `tau` controlled, or leave it out")]
    Tolerance(Amount),
    /// Controlled steps, of a stepper that estimates no errors of steps.
    #[error(
        "`tau` controlled is for minimizing steps: with `stepper` direct give another rule, such as auto"
    )]
    ControlledDirect,
    /// A ramp of so many steps, but no size that goes to a target.
    #[error(
        "`ramp` {0} is for sizes that go to a target: give `length`, `area`, `volume` or `reduced_volume`, or leave it out"
    )]
    Ramp(usize),
    /// Two words for the area in the plane.
    #[error("in the plane `volume` is another word for `area`: give one of them")]
    AreaAndVolume,
    /// A term of the energy, of a size that is held.
    #[error(
        "`{option}` has no effect where the {size} is held: leave it out, or let the {size} be free"
    )]
    NoEffect {
        /// The option.
        option: &'static str,
        /// The size.
        size: &'static str,
    },
    /// A spontaneous curvature whose radius is smaller than the grid resolves.
    #[error(
        "`spontaneous_curvature` {curvature} has the radius {}, which is less than two widths {} of the interface: give a smaller curvature, or more `cells`",
        solver::rounded(1.0 / curvature.abs()), solver::rounded(*eps)
    )]
    SharpCurvature {
        /// The curvature.
        curvature: f64,
        /// The width of the interface.
        eps: f64,
    },
    /// Both sizes of a shape with edges that cannot be made round.
    #[error(
        "{boundary} and {inside} cannot both be held: the grid does not resolve parts of the shape, and so their {boundary}; give more \
         `cells`, or hold one of them"
    )]
    BothSizes {
        /// What the size of the boundary is called: length or area.
        boundary: &'static str,
        /// What the size of the inside is called: area or volume.
        inside: &'static str,
    },

    /// No file of a mesh, to repair.
    #[error("only meshes are repaired, and {0} is none")]
    NotRepaired(String),
    /// A repair, where the vertices of the mesh are to follow the flow.
    #[error(
        "`repair` makes a new mesh: write it by `willmore sample --repair --save`, which can then be faired, or give `remesh`"
    )]
    RepairWithoutRemesh,
    /// A part of the energy that is no less than all of it.
    #[error("`energy_ratio` {0} is reached before the first step: give a part below 1")]
    EnergyRatio(f64),
    /// An energy near that of a ball.
    #[error(
        "`energy` {0} is too near to that of a ball, 8 pi = 25.13, so that nothing of the shape would be left: give at least 30.2, leave it out \
         to take off the noise, or give `energy_ratio` 0.5 for half the energy that there is"
    )]
    EnergyOfBall(f64),
    /// Noise, of what is no mesh in a file.
    #[error(
        "only a mesh in a file has noise to take off: say how smooth the surface is to become, by `energy_ratio`, `time`, \
         `energy` or `steps`, without `noise`, `edges` and `keep`"
    )]
    NoiseOfNoMesh,
    /// A mesh without noise, to be estimated.
    #[error(
        "the mesh has no noise that could be estimated: give `noise` LENGTH, or say how smooth the surface is to become, by \
         `energy_ratio`, `time`, `energy` or `steps`"
    )]
    NoNoise,
    /// What looks like noise is the shape.
    #[error(
        "no noise was found: {percent:.2} % of the longest side, as much as the vertices are off the middle of those around them, is the shape itself, with \
         its edges and few faces: give `noise` LENGTH, or say how smooth the surface is to become, by `energy_ratio`, `time`, `energy` or `steps`"
    )]
    NoiseOfShape {
        /// What it would be, in percent of the longest side.
        percent: f64,
    },
    /// Noise, where the volume is to change.
    #[error(
        "the volume stays where noise is taken off: leave out `volume` and `reduced_volume`, or `noise` and say how smooth the surface is \
         to become, by `energy_ratio`, `time`, `energy` or `steps`"
    )]
    NoiseAndVolume,
    /// A shape in the plane, to be faired.
    #[error(
        "`fair` is for surfaces in space; for images and shapes in the plane there is `willmore flow`"
    )]
    FairInPlane,
    /// A file of a mesh whose vertices cannot be moved.
    #[error(
        "the vertices of {} cannot be moved: {problem}; write it anew by `willmore sample --save`, which can then be faired, or give \
         `remesh`",
        path.display()
    )]
    NotMovable {
        /// The file.
        path: PathBuf,
        /// Why.
        problem: surfaces::FormatError,
    },

    /// Something that is no colour, for what stays of a mesh.
    #[error("`keep` {0}: give six hexadecimal digits, as colour:ff0000")]
    KeepColour(String),
    /// A colour, for what stays of a mesh without colours.
    #[error("`keep` colour:... needs a mesh whose vertices have colours, in PLY or OBJ")]
    KeepWithoutColours,
    /// All of the mesh stays.
    #[error("`keep` contains all of the mesh: nothing could move")]
    KeepsAll,
    /// An open mesh without vertices that may move.
    #[error(
        "all vertices are at the boundary of the surface, which stays: nothing could move; subdivide the mesh, or give `remesh` and `repair`"
    )]
    NothingInside,
    /// Nothing of the mesh stays.
    #[error("`keep` contains no vertex of the mesh, which goes from {lower:?} to {upper:?}")]
    KeepsNothing {
        /// The lower corner of the mesh.
        lower: [f64; 3],
        /// The upper one.
        upper: [f64; 3],
    },

    /// No region to fill.
    #[error("say which region to fill: `mask` IMAGE, box:x0,y0,x1,y1 or ball:x,y,r")]
    NoMask,
    /// A mask that is no region, where it has to be one.
    #[error("`mask` {mask} is no region in {dimension}D: give box:... or ball:...")]
    MaskOfImage {
        /// The mask.
        mask: String,
        /// The dimension of the shape.
        dimension: usize,
    },
    /// A mask of another size than the image that is the input.
    #[error(
        "`mask` {mask} has {} x {} pixels; it must have {} x {}, as the input",
        size[0], size[1], of_input[0], of_input[1]
    )]
    MaskSize {
        /// The mask.
        mask: String,
        /// Its width and height in pixels.
        size: [u32; 2],
        /// Those of the input.
        of_input: [u32; 2],
    },
    /// A mask that does not fill the box.
    #[error(
        "`mask` {mask} has {} x {} pixels; it must be a square, which fills the box",
        size[0], size[1]
    )]
    MaskNotSquare {
        /// The mask.
        mask: String,
        /// Its width and height in pixels.
        size: [u32; 2],
    },
    /// A mask without a pixel of the image that is the input.
    #[error("`mask` contains no pixel of {}: nothing would be drawn", .0.display())]
    MaskWithoutPixels(PathBuf),
    /// A mask without a node of the grid.
    #[error(
        "`mask` {mask} contains no node of the box from {origin:?} of side {side}: nothing could move"
    )]
    MaskWithoutNodes {
        /// The mask.
        mask: String,
        /// The lower corner of the box.
        origin: Vec<f64>,
        /// The side of the box.
        side: f64,
    },

    /// An array of labels or of truth values in the plane.
    #[error(
        "{} is an array of whole numbers or bool in the plane: save it as an image (.png), of which the light or dark pixels are inside, or a \
         phase field as float64",
        .0.display()
    )]
    LabelsInThePlane(PathBuf),
    /// All labels, for a job that takes one.
    #[error("`label` all makes a surface of each label, and this job takes one: give its number")]
    AllLabels,
    /// A volume of several labels, of which one has to be chosen.
    #[error(
        "{} holds the values {}{}: give `label` N of one of them, `label` all, or `threshold` VALUE, above which is inside",
        path.display(), joined(first), if *more { ", ..." } else { "" }
    )]
    SeveralLabels {
        /// The volume.
        path: PathBuf,
        /// Its first labels.
        first: Vec<f64>,
        /// Whether there are more.
        more: bool,
    },
    /// A volume of values that are no labels.
    #[error(
        "{} holds values from {lowest} to {highest}: give `label` N, or `threshold` VALUE, above which is inside",
        path.display()
    )]
    NoThreshold {
        /// The volume.
        path: PathBuf,
        /// The lowest value.
        lowest: f64,
        /// The highest one.
        highest: f64,
    },
    /// A volume without labels, all of which were to become surfaces.
    #[error(
        "{} holds no labels, which are whole numbers other than 0: give `threshold` VALUE, above which is inside",
        .0.display()
    )]
    NoLabels(PathBuf),
    /// Shared walls, of less than all labels of a volume.
    #[error(
        "`shared` makes the walls between all labels of a segmentation: give `label` all, or leave it out"
    )]
    SharedOfNoLabels,
    /// An option that says nothing about shared walls.
    #[error(
        "`{option}` has no meaning with `shared`{}: leave it out",
        after_comma(why)
    )]
    Shared {
        /// The option.
        option: &'static str,
        /// Why.
        why: &'static str,
    },
    /// No file for shared walls, or one of another kind.
    #[error(
        "with `shared` the result goes to the file of `save` alone, {}: give .ply or .obj for all walls with the labels on their sides, .stl for a mesh of each          label, or .nii or .nii.gz for the smooth labels",
        file.as_ref().map_or("which is not given".to_owned(), |file| format!("and {} is of another kind", file.display()))
    )]
    SharedFile {
        /// The file.
        file: Option<PathBuf>,
    },
    /// Labels so far apart for their voxels that no memory holds the lattice of their walls.
    #[error(
        "the walls of all labels take a lattice of {nodes:.1e} voxels, more than {most:.1e}: cut the volume, or leave out `shared`"
    )]
    TooManySharedNodes {
        /// The nodes of the lattice.
        nodes: f64,
        /// The most.
        most: f64,
    },
    /// Labels that have no place in a file.
    #[error(
        "label {0} is no whole number of 32 bits, which files of shared walls and of voxels hold: give it a smaller number"
    )]
    LargeLabel(i64),

    /// No value of an option without which nothing is trained.
    #[error(
        "train needs `{option}`; for example: willmore train --dimension 2 --width 25 --eps-over-h 3 --save mine.safetensors"
    )]
    TrainNeeds {
        /// The option.
        option: &'static str,
    },

    /// A file for an input whose extension says nothing.
    #[error(
        "`save` {} must end in .png, .svg, .ply, .obj, .stl, .off, .npy, .vti, .nii or .nii.gz",
        .0.display()
    )]
    SampleFormat(PathBuf),
    /// A segmentation of a shape without voxels.
    #[error("`save` {}: a shape in {dimension}D has no voxels", path.display())]
    NoVoxels {
        /// The file.
        path: PathBuf,
        /// The dimension of the shape.
        dimension: usize,
    },
    /// Negative noise.
    #[error("`noise` {0} must not be negative")]
    NegativeNoise(f64),
    /// Noise, in a file of another kind than a mesh.
    #[error(
        "`noise` moves the vertices of meshes: leave it out, or save a mesh in place of {}",
        .0.display()
    )]
    NoiseInNoMesh(PathBuf),
}

fn after_blank(value: Option<&str>) -> String {
    value.map_or(String::new(), |value| format!(" {value}"))
}

fn after_comma(why: &str) -> String {
    match why {
        "" => String::new(),
        _ => format!(", {why}"),
    }
}

fn joined(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(ToString::to_string).collect();
    values.join(", ")
}
