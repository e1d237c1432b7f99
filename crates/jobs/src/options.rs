//! The options of jobs. Programs can read them with clap. An option that is not given gets a default, which may depend on the input.

use clap::{Args, ValueEnum};
use engine::Storage;
use model::Ratios;
use surfaces::Edges;

use crate::file::Input;
use crate::keep;
use crate::paths::{self, MESHES};
use crate::prelude::*;
use crate::values::{
    Amount, Ansatz, Label, SizeTarget, count, finite, positive, whole, whole_if_given,
};

const INPUT: &str = "Input";
const GRID: &str = "Shape and grid";
const FLOW: &str = "Flow";
const SIZES: &str = "Sizes and energy";
const OUTPUT: &str = "Output";
const RUN: &str = "Run";
const ADVANCED: &str = "Advanced";

/// Where the shape comes from and how large it is.
#[derive(Args, Serialize, Clone, Debug, Default)]
#[serde(rename_all = "kebab-case")]
pub struct InputOptions {
    /// A mesh, an image, a volume of voxels, a field, a built-in shape or a region
    ///
    /// A mesh is .obj, .stl, .ply or .off. An image is .png, .jpg, .webp, .gif, .tif or .bmp. A volume of voxels is .nii, .nii.gz, .nrrd, .nhdr, .mgh,
    /// .mgz, .mrc, .map, .tif with several pages, or .npy with labels in 3D. A field is .npy. A built-in shape is builtin:NAME, where NAME is disc,
    /// ring, cross, rectangle, sphere, cube, torus, coin, figure or lever. A region in 2D is box:x0,y0,x1,y1 or ball:x,y,r. A region in 3D is
    /// box:x0,y0,z0,x1,y1,z1 or ball:x,y,z,r. The input - is standard input. `willmore fair` takes shapes in 3D alone.
    pub input: Option<Input>,

    /// Cells per unit length of the box [default: depends on the input]
    ///
    /// By default, a mesh, an image or a volume gets the coarsest of a few grids that resolves its thin parts. For a volume, the cells are also no wider
    /// than its voxels, if one of these grids is so fine. For `fair` of a mesh, it is the first of 128, 160 and 192 on which the parts and holes of the
    /// mesh are the same. A field keeps its own grid. Other shapes get 128 cells per unit length in 2D and 64 in 3D.
    #[arg(long, value_name = "N", help_heading = GRID)]
    #[serde(serialize_with = "whole_if_given")]
    pub cells: Option<usize>,

    /// Side of the periodic box [default: 2 in 2D, 1 in 3D]
    #[arg(long, value_name = "LENGTH", help_heading = GRID, hide_short_help = true)]
    pub box_side: Option<f64>,

    /// Longest side of the shape in the box, in the same unit as `box_side` [default: 0.6 of the side of the box]
    ///
    /// A mesh, an image or a volume is scaled to this size in the box. Other options take lengths in the units of the input, except for `box_side`.
    /// For `fair` of a mesh, the default is 0.9 of the side of the box if noise is taken off, and 0.8 if not. For `fair` of a segmentation, it is 0.9
    /// if details are taken off. On coarse grids it is less, so that three interface widths stay free at each side.
    #[arg(long, value_name = "LENGTH", help_heading = GRID, hide_short_help = true)]
    pub side_length: Option<f64>,

    /// Which pixels of an image are inside [default: auto]
    #[arg(long, value_name = "SIDE", value_enum, help_heading = INPUT, hide_short_help = true)]
    pub inside: Option<Inside>,

    /// Value that separates inside and outside [default: 0.5 for an image]
    ///
    /// For an image it is a grey value or an opacity from 0 to 1. For voxels it is in the units of their values, and larger values are inside. With
    /// it, a .npy of floats in 3D is a volume.
    #[arg(long, value_name = "VALUE", help_heading = INPUT, hide_short_help = true)]
    pub threshold: Option<f64>,

    /// Label of the voxels that are inside, or the word all [default: if there are two labels, the one with the greater value]
    ///
    /// With all, each label except 0 becomes a surface of its own. Only `willmore fair` can make them share their walls (`shared`).
    #[arg(long, value_name = "LABEL", conflicts_with = "threshold", help_heading = INPUT)]
    pub label: Option<Label>,

    /// Number of the volume in a file with several, counted from 0
    ///
    /// A file has several volumes if it is NIfTI with more than three axes, NRRD with four, MGH with several frames, or TIFF with several channels or
    /// times. In TIFF they are counted in the order of their pages.
    #[arg(long, value_name = "N", help_heading = INPUT, hide_short_help = true)]
    #[serde(serialize_with = "whole_if_given")]
    pub frame: Option<u64>,

    /// Repair a mesh that is open, crosses itself, or has triangles of inconsistent orientation
    ///
    /// Bodies that are apart stay apart. Smooth lids close holes, and all else stays. Parts that cross themselves or each other are made anew, on as many
    /// cells along the mesh as `cells` says. The program reports the changes.
    #[arg(long, help_heading = INPUT, hide_short_help = true)]
    pub repair: bool,

    /// Kind of the values of a field [default: phase-field]
    #[arg(long, alias = "holds", value_name = "KIND", value_enum, help_heading = INPUT, hide_short_help = true)]
    pub field_kind: Option<FieldKind>,
}

/// Which pixels of an image are inside.
#[derive(ValueEnum, Serialize, Clone, Copy, Debug, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Inside {
    /// Opaque pixels if some are transparent; else dark ones, or light ones if most of the border is dark
    Auto,
    /// Dark pixels
    Dark,
    /// Light pixels
    Light,
}

/// What makes the time steps of Willmore flow.
#[derive(ValueEnum, Serialize, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Stepper {
    /// Minimizations with the learned operator; the energy falls
    #[default]
    Minimizing,
    /// Convolutions without a minimization: nearer to the exact flow on smooth shapes, but nothing guarantees that the energy falls
    Direct,
}

/// The kind of the values of a field.
#[derive(ValueEnum, Serialize, Clone, Copy, Debug, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum FieldKind {
    /// 1 inside, -1 outside
    PhaseField,
    /// Signed distances, negative inside
    Distance,
}

/// The operator and its scales.
#[derive(Args, Serialize, Clone, Debug)]
#[serde(rename_all = "kebab-case")]
pub struct OperatorOptions {
    /// Interface width in cells [default: 2; with `network`, the width that the network was trained for]
    #[arg(long, value_name = "RATIO", help_heading = ADVANCED, hide_short_help = true)]
    pub eps_over_h: Option<f64>,

    /// Formulation of a time step
    ///
    /// The descriptions of the possible values use two terms, calibration and the paper. Calibration corrects the error of the network in the energy:
    /// it divides the motion and the bending energy, the two terms that a time step minimizes, by a factor each. The paper is that of Rumpf, Sassen
    /// and Norden-Smoch.
    #[arg(
        long = "scheme",
        value_name = "NAME",
        value_enum,
        default_value = "accurate",
        help_heading = ADVANCED,
        hide_short_help = true
    )]
    #[serde(rename = "scheme")]
    pub formulation: Formulation,

    /// Use the network in this file, which `willmore train` has made
    #[arg(long, value_name = "FILE", help_heading = ADVANCED, hide_short_help = true)]
    #[serde(serialize_with = "paths::serialized")]
    pub network: Option<PathBuf>,

    /// Part of the phase field that is stored: dense, bricks or auto [default: auto]
    ///
    /// dense stores the whole grid. bricks stores only blocks of cells near the surface. auto stores bricks if they are less than half of the grid,
    /// else the whole grid. Mean curvature flow, finite elements, direct steps and the paper's networks need the whole grid.
    #[arg(
        long,
        value_name = "PART",
        value_enum,
        hide_possible_values = true,
        help_heading = ADVANCED,
        hide_short_help = true
    )]
    pub storage: Option<Storage>,
}

impl Default for OperatorOptions {
    fn default() -> Self {
        Self {
            eps_over_h: None,
            formulation: Formulation::Accurate,
            network: None,
            storage: None,
        }
    }
}

/// Whether files and runs are overwritten.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct ForceOption {
    /// Overwrite an existing file, or the run in an existing folder
    #[arg(long, help_heading = OUTPUT, hide_short_help = true)]
    pub force: bool,
}

/// Where computations run.
#[derive(Args, Serialize, Clone, Debug)]
pub struct CommonOptions {
    /// Device: flex or ndarray (CPU), wgpu or cuda (GPU), if compiled in [default: the first compiled in]
    #[arg(long, value_name = "NAME", help_heading = RUN, hide_short_help = true)]
    pub device: Option<String>,

    /// Seed of the random numbers of `check` and `train`; flows use none
    #[arg(long, default_value_t = 1, help_heading = RUN, hide_short_help = true)]
    #[serde(serialize_with = "whole")]
    pub seed: u64,
}

impl Default for CommonOptions {
    fn default() -> Self {
        Self {
            device: None,
            seed: 1,
        }
    }
}

/// Options of every job that makes a run.
#[derive(Args, Serialize, Clone, Debug)]
#[serde(rename_all = "kebab-case")]
pub struct RunOptions {
    /// Make at most this many steps [default: 20, with sizes that are held 20 more than --ramp, or 1000 if something else ends the run, for `mcf` 100000]
    #[arg(long, value_name = "COUNT", value_parser = count, help_heading = FLOW)]
    #[serde(serialize_with = "whole_if_given")]
    pub steps: Option<usize>,

    /// Stop at this time, which is in (units of length of the input)^4
    #[arg(long, value_name = "T", value_parser = positive, help_heading = FLOW)]
    pub time: Option<f64>,

    /// Keep a picture, the field and the shape after every N steps, and make an animation of the pictures
    #[arg(long, value_name = "N", value_parser = count, help_heading = OUTPUT)]
    #[serde(serialize_with = "whole_if_given")]
    pub frames: Option<usize>,

    /// Steps between two checkpoints
    #[arg(
        long,
        value_name = "STEPS",
        value_parser = count,
        default_value_t = 5,
        help_heading = RUN,
        hide_short_help = true
    )]
    #[serde(serialize_with = "whole")]
    pub checkpoint_every: usize,

    /// Axis that points up in pictures, on the page and in written meshes: x, y or z [default: depends on the input]
    ///
    /// By default it is the axis that a comment in the mesh names. Without such a comment it is y for .obj and builtin:figure, and z for all other
    /// inputs.
    #[arg(long, value_name = "AXIS", help_heading = OUTPUT, hide_short_help = true)]
    pub up: Option<UpAxis>,

    /// Do not write index.html, the page of the run for the browser
    #[arg(long, help_heading = OUTPUT, hide_short_help = true)]
    pub no_page: bool,

    /// Folder of the run [default: runs/NAME-COMMAND; a number is added if this folder exists]
    #[arg(long, value_name = "DIR", help_heading = OUTPUT)]
    #[serde(skip)]
    pub output: Option<PathBuf>,

    /// Write the result to this file too
    ///
    /// In 3D the result is a mesh (.ply, .obj, .stl, .off), in 2D a picture (.png, .svg). The name - means standard output.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    #[serde(serialize_with = "paths::serialized")]
    pub save: Option<PathBuf>,

    /// Whether files and runs are overwritten.
    #[command(flatten)]
    #[serde(skip)]
    pub force: ForceOption,
}

impl Default for RunOptions {
    fn default() -> Self {
        Self {
            steps: None,
            time: None,
            frames: None,
            checkpoint_every: 5,
            up: None,
            no_page: false,
            output: None,
            save: None,
            force: ForceOption::default(),
        }
    }
}

/// How Willmore flow goes: its time steps, the sizes that it holds, its energy.
#[derive(Args, Serialize, Clone, Debug, Default)]
#[serde(rename_all = "kebab-case")]
pub struct WillmoreOptions {
    /// Rule for the time steps [default: depends on the command]
    ///
    /// VALUE and FIRST are in (units of length of the input)^4. The rule is one of these:
    /// "controlled" makes steps of second order, whose estimated errors control their sizes;
    /// "VALUE" makes equal steps;
    /// "doubling:FIRST" makes each step twice as long as the one before;
    /// "graded:FIRST,PART" makes each step PART times the time since the start, and at least FIRST;
    /// "growing:VALUE,COUNT" makes COUNT steps of the size VALUE, and then each step twice as long as the one before;
    /// "ramp:VALUE,HALVINGS" makes two steps of the size VALUE / 2^HALVINGS, and then steps that double until they have the size VALUE;
    /// "auto" or "auto:FIRST" doubles a step after one that lowers the energy by little, and halves it after one that lowers it by much.
    ///
    /// The default of `flow` is controlled, and that of `inpaint` is a ramp. The default of `fair` is graded steps, or controlled ones if only
    /// `steps` or `time` ends the run.
    #[arg(long, value_name = "TAU", help_heading = FLOW, hide_short_help = true)]
    pub tau: Option<StepRule>,

    /// What makes the time steps: minimizing or direct [default: minimizing]
    ///
    /// minimizing: each step minimizes an energy with the learned operator. direct: each step convolves the signed distance, and then measures the
    /// distances to the new curve or surface. A direct step is divided into parts, which are short where the curvature is large. Direct steps hold no
    /// sizes and take no tension, pressure or spontaneous curvature. They store the whole grid. They are for smooth shapes: a corner takes many short
    /// parts. With them, the default of `tau` is auto.
    #[arg(
        long,
        value_name = "NAME",
        value_enum,
        hide_possible_values = true,
        help_heading = FLOW,
        hide_short_help = true
    )]
    pub stepper: Option<Stepper>,

    /// Tolerated error of controlled time steps, a LENGTH or PERCENT [default: 1.5%]
    ///
    /// A length is in the units of the input, and limits the error of the whole run. A percentage limits the error of each step, relative to the
    /// distance that the surface moves in this step.
    #[arg(long, value_name = "LENGTH", value_parser = Amount::tolerance, allow_hyphen_values = true, help_heading = FLOW, hide_short_help = true)]
    pub tolerance: Option<Amount>,

    /// In 3D, hold or change the volume: keep, a VALUE, or PERCENT such as 90% [default: keep for `fair` of a segmentation]
    ///
    /// A value is in the units of the input. A percentage is relative to the volume at the beginning. For a segmentation, the volume at the
    /// beginning is that of its voxels. Specks do not count: parts and holes of a few voxels, which are left out. With keep, each part of a segmentation
    /// keeps its own volume.
    #[arg(long, value_name = "TARGET", help_heading = SIZES)]
    pub volume: Option<SizeTarget>,

    /// In 2D, hold or change the length of the curve: keep, a VALUE, or PERCENT such as 105%
    ///
    /// `flow` first rounds corners whose radius is smaller than the interface is wide. This changes the length. Then the length goes to its target in
    /// `ramp` steps.
    #[arg(long, value_name = "TARGET", help_heading = SIZES, hide_short_help = true)]
    pub length: Option<SizeTarget>,

    /// Hold or change the area of the surface (3D) or of the inside (2D): keep, a VALUE, or PERCENT such as 105%
    ///
    /// In 3D, `flow` first rounds edges whose radius is smaller than the interface is wide. This changes the area. Then the area goes to its target
    /// in `ramp` steps.
    #[arg(long, value_name = "TARGET", help_heading = SIZES)]
    pub area: Option<SizeTarget>,

    /// Keep the area of the surface, and change the volume until the reduced volume is PART, between 0 and 1
    ///
    /// The reduced volume is 6 sqrt(pi) V / A^(3/2) for a volume V and an area A. It is 1 for a ball and 0.64 for a red blood cell. In 2D the length
    /// L stays constant, and the area A changes until 4 pi A / L^2 is PART.
    #[arg(long, value_name = "PART", conflicts_with_all = ["volume", "area", "length"], help_heading = SIZES, hide_short_help = true)]
    pub reduced_volume: Option<f64>,

    /// Number of steps in which sizes go to their targets [default: 20]
    #[arg(long, value_name = "STEPS", help_heading = SIZES, hide_short_help = true)]
    #[serde(serialize_with = "whole_if_given")]
    pub ramp: Option<usize>,

    /// Spontaneous curvature c0, in 1 / length [default: 0]
    ///
    /// The energy is 1/2 int (kappa - c0)^2 dA. kappa is the sum of the principal curvatures, which is positive for a ball.
    #[arg(long, value_name = "C0", value_parser = finite, allow_hyphen_values = true, help_heading = SIZES, hide_short_help = true)]
    pub spontaneous_curvature: Option<f64>,

    /// Surface tension, in 1 / length^2 [default: 0]
    ///
    /// SIGMA times the area of the surface is added to the energy. In 2D, SIGMA times the length of the curve is added.
    #[arg(long, value_name = "SIGMA", value_parser = finite, allow_hyphen_values = true, help_heading = SIZES, hide_short_help = true)]
    pub tension: Option<f64>,

    /// Pressure, in 1 / length^3 [default: 0]
    ///
    /// P times the volume is added to the energy. In 2D, P times the area of the inside is added.
    #[arg(long, value_name = "P", value_parser = finite, allow_hyphen_values = true, help_heading = SIZES, hide_short_help = true)]
    pub pressure: Option<f64>,

    /// Stop when the energy is no more than W
    ///
    /// The Willmore energy of a sphere is 8 pi = 25.13. That of a circle of radius R is pi / R. Terms that are added to it, such as that of `tension`,
    /// count, too. `willmore fair` takes no W below 30.2, since it would leave a ball.
    #[arg(long, value_name = "W", value_parser = positive, help_heading = FLOW, hide_short_help = true)]
    pub energy: Option<f64>,
}

/// Options of Willmore flow.
#[derive(Args, Serialize, Clone, Debug, Default)]
pub struct FlowOptions {
    /// The flow.
    #[command(flatten)]
    #[serde(flatten)]
    pub willmore: WillmoreOptions,
    /// The input.
    #[command(flatten)]
    #[serde(flatten)]
    pub input: InputOptions,
    /// The operator.
    #[command(flatten)]
    #[serde(flatten)]
    pub operator: OperatorOptions,
    /// The run.
    #[command(flatten)]
    #[serde(flatten)]
    pub run: RunOptions,
    /// Device and seed.
    #[command(flatten)]
    #[serde(flatten)]
    pub common: CommonOptions,
}

/// Options of fairing.
#[derive(Args, Serialize, Clone, Debug, Default)]
#[serde(rename_all = "kebab-case")]
pub struct FairOptions {
    /// The options of the flow.
    #[command(flatten)]
    #[serde(flatten)]
    pub willmore: WillmoreOptions,
    /// The input.
    #[command(flatten)]
    #[serde(flatten)]
    pub input: InputOptions,
    /// The operator.
    #[command(flatten)]
    #[serde(flatten)]
    pub operator: OperatorOptions,
    /// The run.
    #[command(flatten)]
    #[serde(flatten)]
    pub run: RunOptions,
    /// Device and seed.
    #[command(flatten)]
    #[serde(flatten)]
    pub common: CommonOptions,

    /// Standard deviation of the noise that is taken off, in the units of the mesh [default: estimated]
    ///
    /// Only the deviation along the normals counts. If `time`, `energy`, `energy_ratio` or `steps` says when to stop, the default is 0. For a
    /// segmentation, `noise` is refused: see `detail`.
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_hyphen_values = true, help_heading = FLOW)]
    pub noise: Option<f64>,

    /// Whether sharp edges stay sharp where noise is taken off: auto, keep or round [default: auto]
    ///
    /// auto keeps them in each closed part of a mesh for which the evidence is clear, such as a machine part, and leaves round shapes alone. keep also keeps
    /// those for which the evidence near them is weak. round keeps none. The report says how many edges of the mesh are kept, and their length. With `remesh`
    /// or without noise, edges are always round.
    #[arg(long, value_name = "RULE", value_enum, hide_possible_values = true, help_heading = FLOW)]
    pub edges: Option<Edges>,

    /// Radius below which details of a segmentation are smoothed away, in the units of the input [default: 1.25 voxels]
    ///
    /// The flow stops at the time (0.8 LENGTH)^4. A bump with the radius LENGTH / 2 keeps 12 % of its height, one with the radius LENGTH 37 %, and
    /// one with the radius 2 LENGTH 79 %. (At its radius, a bump has half of its height.) With the default, the flow also stops when the surface has
    /// moved by 0.35 of a voxel, root of the mean square. If `time`, `energy`,
    /// `energy_ratio` or `steps` says when to stop, there is no default.
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_hyphen_values = true, help_heading = FLOW)]
    pub detail: Option<f64>,

    /// Largest distance of the vertices from the surface of the input, in its units [default: half a voxel, none for a mesh]
    ///
    /// The surface of a segmentation is the one between its voxels. The bound wins over `noise` and `detail`: a larger detail needs a larger bound. If
    /// the other vertices cannot give back the volume that vertices at the bound take, the volume changes. The report says how many vertices are at the bound. If `time`,
    /// `energy`, `energy_ratio` or `steps` says when to stop and `detail` is not given, there is no default.
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_hyphen_values = true, help_heading = FLOW)]
    pub max_distance: Option<f64>,

    /// With `label` all, smooth all labels together, so that neighbours share their walls
    ///
    /// Every point belongs to one label, of which 0 is the background: there are no gaps and no overlaps. Each label keeps the volume of its voxels. The
    /// result goes to the file of `save` alone. A .ply or .obj has every wall once, with the labels behind and ahead of each triangle, as two properties or
    /// in the name of its group. With .stl, each label gets a mesh of its own, whose vertices on shared walls are those of the neighbour. A .nii or .nii.gz
    /// has the smooth labels in the voxels of the input.
    #[arg(long, help_heading = OUTPUT)]
    #[serde(skip)]
    pub shared: bool,

    /// Stop as soon as the Willmore energy is no more than PART of the energy at the beginning
    ///
    /// The volume changes, unless it is held by the option `volume` with the value keep.
    #[arg(long, value_name = "PART", value_parser = positive, allow_hyphen_values = true, help_heading = FLOW)]
    pub energy_ratio: Option<f64>,

    /// Part of the mesh that does not move: a box, a ball, the inside of a closed mesh, or a colour
    ///
    /// A box is box:x0,y0,z0,x1,y1,z1, and a ball is ball:x,y,z,r. A closed mesh is a file (.obj, .stl, .ply, .off). All three are in the coordinates of
    /// the input. colour:ff0000 means the vertices of this colour.
    #[arg(long, value_name = "REGION", allow_hyphen_values = true, value_parser = keep::parser(), help_heading = FLOW)]
    pub keep: Option<String>,

    /// Write a new mesh; otherwise the result is the mesh of the input with moved vertices
    ///
    /// The new mesh is the zero level set of the phase field on the grid. With `repair`, the input need not be closed. A segmentation always gives a
    /// new mesh.
    #[arg(long, help_heading = OUTPUT)]
    pub remesh: bool,

    /// Go on even if the grid is too coarse for thin parts of the input
    #[arg(long, help_heading = GRID, hide_short_help = true)]
    pub allow_loss: bool,

    /// Format of the mesh in the run's folder [default: that of the input]
    #[arg(long, value_name = "NAME", value_parser = MESHES, help_heading = OUTPUT, hide_short_help = true)]
    pub format: Option<String>,
}

/// Options of inpainting.
#[derive(Args, Serialize, Clone, Debug, Default)]
pub struct InpaintOptions {
    /// The options of the flow.
    #[command(flatten)]
    #[serde(flatten)]
    pub willmore: WillmoreOptions,
    /// The input.
    #[command(flatten)]
    #[serde(flatten)]
    pub input: InputOptions,
    /// The operator.
    #[command(flatten)]
    #[serde(flatten)]
    pub operator: OperatorOptions,
    /// The run.
    #[command(flatten)]
    #[serde(flatten)]
    pub run: RunOptions,
    /// Device and seed.
    #[command(flatten)]
    #[serde(flatten)]
    pub common: CommonOptions,

    /// Region to fill: an image, box:x0,y0,x1,y1 or ball:x,y,r, in 3D box:x0,y0,z0,x1,y1,z1 or ball:x,y,z,r
    ///
    /// If input and mask are images, they have the same width and height. If only the mask is an image, it is a square that covers the whole box. The
    /// region consists of the opaque pixels if some pixels are transparent. Otherwise it consists of the dark pixels, or of the light ones if most of
    /// the border is dark.
    #[arg(long, value_name = "REGION", allow_hyphen_values = true, help_heading = INPUT)]
    pub mask: Option<Input>,

    /// Shape in the region at the beginning: keep, empty, full, box:... or ball:...
    #[arg(long, value_name = "SHAPE", default_value = "keep", help_heading = FLOW)]
    pub ansatz: Ansatz,
}

/// Options of mean curvature flow.
#[derive(Args, Serialize, Clone, Debug)]
pub struct McfOptions {
    /// Method for the steps of mean curvature flow
    #[arg(long, value_name = "NAME", value_enum, default_value = "network", help_heading = FLOW)]
    pub method: Method,

    /// The input.
    #[command(flatten)]
    #[serde(flatten)]
    pub input: InputOptions,
    /// The operator.
    #[command(flatten)]
    #[serde(flatten)]
    pub operator: OperatorOptions,
    /// The run.
    #[command(flatten)]
    #[serde(flatten)]
    pub run: RunOptions,
    /// Device and seed.
    #[command(flatten)]
    #[serde(flatten)]
    pub common: CommonOptions,
}

impl Default for McfOptions {
    fn default() -> Self {
        Self {
            method: Method::Hybrid,
            input: InputOptions::default(),
            operator: OperatorOptions::default(),
            run: RunOptions::default(),
            common: CommonOptions::default(),
        }
    }
}

/// Options of writing an input to a file.
#[derive(Args, Clone, Debug)]
pub struct SampleOptions {
    /// The input.
    #[command(flatten)]
    pub input: InputOptions,

    /// The file to write
    ///
    /// It is a picture (.png, or .svg for a shape in 2D), a mesh (.ply, .obj, .stl, .off), a field (.npy, .vti) or a segmentation (.nii, .nii.gz).
    #[arg(long, value_name = "FILE")]
    pub save: PathBuf,

    /// Cut this region out: box:x0,y0,x1,y1 or ball:x,y,r, in 3D box:x0,y0,z0,x1,y1,z1 or ball:x,y,z,r
    ///
    /// The option may be given several times.
    #[arg(long, value_name = "REGION", allow_hyphen_values = true)]
    pub without: Vec<Region>,

    /// Move the vertices of a mesh along their normals by random lengths, at most LENGTH
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0)]
    pub noise: f64,

    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,

    /// Write the zero level set on the grid, also if the input is a mesh
    ///
    /// By default, the file is the mesh of the input with its vertices and triangles. `without`, `cells`, `box_side` and `side_length` also make a
    /// new mesh.
    #[arg(long)]
    pub resample: bool,

    /// Axis that points up in the picture or the mesh: x, y or z [default: depends on the input]
    ///
    /// By default it is the axis that a comment in the mesh names. Without such a comment it is y for .obj and builtin:figure, and z for all other
    /// inputs.
    #[arg(long, value_name = "AXIS")]
    pub up: Option<UpAxis>,

    /// Whether files are overwritten.
    #[command(flatten)]
    pub force: ForceOption,
}

/// Options of checking derivatives and device.
#[derive(Args, Clone, Debug, Default)]
pub struct CheckOptions {
    /// The input.
    #[command(flatten)]
    pub input: InputOptions,
    /// The operator.
    #[command(flatten)]
    pub operator: OperatorOptions,
    /// Device and seed.
    #[command(flatten)]
    pub common: CommonOptions,
}

/// Options of training a network.
#[derive(Args, Clone, Debug, Default)]
pub struct TrainOptions {
    /// Dimension of space, 2 or 3; required, like `width`, `eps_over_h` and `save`
    #[arg(long, value_name = "D")]
    pub dimension: Option<usize>,

    /// Width of the kernel in cells, an odd number
    #[arg(long, value_name = "CELLS")]
    pub width: Option<usize>,

    /// Interface width in cells
    #[arg(long, value_name = "RATIO")]
    pub eps_over_h: Option<f64>,

    /// Time step of mean curvature flow in cells squared [default: `eps_over_h`^2 / 4, which flows need]
    #[arg(long, value_name = "RATIO")]
    pub step_over_h2: Option<f64>,

    /// The file to write, .safetensors
    #[arg(long, value_name = "FILE")]
    pub save: Option<PathBuf>,

    /// Train for a few seconds only, to try the command; the network is not accurate
    #[arg(long)]
    pub quick: bool,

    /// Whether files are written over.
    #[command(flatten)]
    pub force: ForceOption,

    /// Device and seed.
    #[command(flatten)]
    pub common: CommonOptions,
}

impl InputOptions {
    /// The options of this input, all others with their defaults.
    pub fn of(input: impl Into<Input>) -> Self {
        Self {
            input: Some(input.into()),
            ..Self::default()
        }
    }
}

impl FlowOptions {
    /// The options for this input, with the defaults of the program.
    pub fn of(input: impl Into<Input>) -> Self {
        Self {
            input: InputOptions::of(input),
            ..Self::default()
        }
    }
}

impl FairOptions {
    /// The options for this mesh or segmentation, with the defaults of the program.
    pub fn of(input: impl Into<Input>) -> Self {
        Self {
            input: InputOptions::of(input),
            ..Self::default()
        }
    }
}

impl InpaintOptions {
    /// The options for this input and the region to fill, with the defaults of the program.
    pub fn of(input: impl Into<Input>, mask: impl Into<Input>) -> Self {
        Self {
            input: InputOptions::of(input),
            mask: Some(mask.into()),
            ..Self::default()
        }
    }
}

impl McfOptions {
    /// The options for this input and the method of the network, with the defaults of the program.
    pub fn of(input: impl Into<Input>) -> Self {
        Self {
            input: InputOptions::of(input),
            ..Self::default()
        }
    }
}

impl SampleOptions {
    /// The options that write this input to this file unchanged.
    pub fn of(input: impl Into<Input>, save: impl Into<PathBuf>) -> Self {
        Self {
            input: InputOptions::of(input),
            save: save.into(),
            without: Vec::new(),
            noise: 0.0,
            seed: 1,
            resample: false,
            up: None,
            force: ForceOption::default(),
        }
    }
}

impl CheckOptions {
    /// At this input, with the defaults of the program.
    pub fn of(input: impl Into<Input>) -> Self {
        Self {
            input: InputOptions::of(input),
            ..Self::default()
        }
    }
}

impl TrainOptions {
    /// For these ratios, to this file, with the defaults of the program.
    pub fn of(ratios: Ratios, save: impl Into<PathBuf>) -> Self {
        Self {
            dimension: Some(ratios.dimension),
            width: Some(ratios.width),
            eps_over_h: Some(ratios.eps_over_h),
            step_over_h2: Some(ratios.step_over_h2),
            save: Some(save.into()),
            ..Self::default()
        }
    }
}
