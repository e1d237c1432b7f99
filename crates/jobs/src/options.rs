//! The options of jobs. Programs can read them with clap; what is left open has a default that depends on the input.

use clap::{Args, ValueEnum};
use engine::Storage;
use model::Ratios;

use crate::file::Input;
use crate::paths::MESHES;
use crate::prelude::*;
use crate::values::{Amount, Ansatz, Label, SizeTarget, count, finite, positive};

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
    /// A mesh (.obj, .stl, .ply), an image (.png, .jpg, .webp, .gif, .tif, .bmp), a volume of voxels (.nii, .nii.gz, .mrc, .map, and .tif
    /// of several pages), a field (.npy), builtin:NAME with NAME one of disc, ring, cross, rectangle, sphere, cube, torus, coin, figure,
    /// lever, a region as box:x0,y0,x1,y1 or ball:x,y,r, in 3D with z, or - for standard input
    pub input: Option<Input>,

    /// Cells per unit length of the box [default: depends on the input]
    ///
    /// Without it a mesh, an image or a volume gets the coarsest of a few grids that holds its thin parts. A field keeps its own grid. Other shapes
    /// get 128 cells in the plane and 64 in space.
    #[arg(long, value_name = "N", help_heading = GRID)]
    pub cells: Option<usize>,

    /// Side of the periodic box [default: 2 in 2D, 1 in 3D]
    #[arg(long, value_name = "LENGTH", help_heading = GRID, hide_short_help = true)]
    pub box_side: Option<f64>,

    /// Longest side of the shape in units of --box-side [default: 0.6 of the box, for `fair` of a mesh 0.8 or 0.9]
    ///
    /// The box is scaled to a mesh, an image or a volume. All other lengths are in the units of the input.
    #[arg(long, value_name = "LENGTH", help_heading = GRID, hide_short_help = true)]
    pub side_length: Option<f64>,

    /// Which pixels of an image are inside [default: auto]
    #[arg(long, value_name = "SIDE", value_enum, help_heading = INPUT, hide_short_help = true)]
    pub inside: Option<Inside>,

    /// Value between inside and outside [default: 0.5 for an image]
    ///
    /// For an image it is a grey value or an opacity from 0 to 1. For a volume it is in the units of the volume, and larger values are inside.
    #[arg(long, value_name = "VALUE", help_heading = INPUT, hide_short_help = true)]
    pub threshold: Option<f64>,

    /// The label of a volume that is inside, or all [default: the larger of two values]
    ///
    /// With all, each label but 0 becomes a surface of its own.
    #[arg(long, value_name = "LABEL", conflicts_with = "threshold", help_heading = INPUT)]
    pub label: Option<Label>,

    /// Repair a mesh that is open, crosses itself or is not oriented alike
    ///
    /// The repair makes a new mesh, and the program reports the changes.
    #[arg(long, help_heading = INPUT, hide_short_help = true)]
    pub repair: bool,

    /// The kind of the values of a field [default: phase-field]
    #[arg(long, alias = "holds", value_name = "KIND", value_enum, help_heading = INPUT, hide_short_help = true)]
    pub field_kind: Option<FieldKind>,
}

/// Which pixels of an image are inside.
#[derive(ValueEnum, Serialize, Clone, Copy, Debug, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Inside {
    /// Opaque ones, or those unlike the border
    Auto,
    /// Dark ones
    Dark,
    /// Light ones
    Light,
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

/// Which operator, at which scales.
#[derive(Args, Serialize, Clone, Debug)]
#[serde(rename_all = "kebab-case")]
pub struct OperatorOptions {
    /// Interface width in cells [default: 2, or that of --network]
    #[arg(long, value_name = "RATIO", help_heading = ADVANCED, hide_short_help = true)]
    pub eps_over_h: Option<f64>,

    /// Formulation of a time step
    ///
    /// accurate: the most accurate network, calibrated. calibrated: the paper's network, calibrated. paper: as in the paper.
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

    /// Use this network, as `willmore train` makes them
    #[arg(long, value_name = "FILE", help_heading = ADVANCED, hide_short_help = true)]
    pub network: Option<PathBuf>,

    /// Part of the phase field that is stored: dense, bricks or auto [default: auto]
    ///
    /// dense stores the whole grid, and bricks stores cells near the surface. auto takes bricks where they are less than half of the grid. Mean
    /// curvature flow, finite elements and the paper's networks always take the whole grid.
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

/// What is there stays, unless this is given.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct ForceOption {
    /// Write over what is there: a file, or the run in a folder
    #[arg(long, help_heading = OUTPUT, hide_short_help = true)]
    pub force: bool,
}

/// Where computations run.
#[derive(Args, Serialize, Clone, Debug)]
pub struct CommonOptions {
    /// Device: flex or ndarray (CPU), wgpu or cuda (GPU), if compiled in [default: the first compiled in]
    #[arg(long, value_name = "NAME", help_heading = RUN, hide_short_help = true)]
    pub device: Option<String>,

    /// Seed of the random numbers of check and train; flows have none
    #[arg(long, default_value_t = 1, help_heading = RUN, hide_short_help = true)]
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
    /// Stop after this many steps [default: 20, or 1000 where something else ends the run]
    #[arg(long, value_name = "COUNT", value_parser = count, help_heading = FLOW)]
    pub steps: Option<usize>,

    /// Stop at this time, a length to the fourth power in the units of the input
    #[arg(long, value_name = "T", value_parser = positive, help_heading = FLOW)]
    pub time: Option<f64>,

    /// Keep a picture, the field and the shape every so many steps, and an animation
    #[arg(long, value_name = "EVERY", value_parser = count, help_heading = OUTPUT)]
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
    pub checkpoint_every: usize,

    /// Axis that points up in pictures, on the page and in written meshes: x, y or z [default: depends on the input]
    ///
    /// Without it the axis is the one that the mesh names, or else y for .obj and builtin:figure, and z for all others.
    #[arg(long, value_name = "AXIS", help_heading = OUTPUT, hide_short_help = true)]
    pub up: Option<UpAxis>,

    /// Leave out index.html, the page of the run for a browser
    #[arg(long, help_heading = OUTPUT, hide_short_help = true)]
    pub no_page: bool,

    /// Folder of the run [default: runs/NAME-COMMAND, with a number if that is there]
    #[arg(long, value_name = "DIR", help_heading = OUTPUT)]
    #[serde(skip)]
    pub output: Option<PathBuf>,

    /// Write the result to this file too
    ///
    /// In space it is a mesh (.ply, .obj, .stl), in the plane a picture (.png, .svg). - is standard output.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub save: Option<PathBuf>,

    /// Whether files and runs are written over.
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
    /// Rule for the time steps, in lengths of the input to the fourth power [default: controlled]
    ///
    /// controlled: steps of second order, whose errors control their sizes. auto, auto:FIRST: steps that follow the energy. VALUE: equal steps.
    /// doubling:FIRST: each step is twice the one before. graded:FIRST,PART: each step is a part of the time that is reached.
    /// growing:VALUE,COUNT: steps double after COUNT of them. ramp:VALUE,HALVINGS: steps grow to VALUE from VALUE halved so often. `inpaint`
    /// takes a ramp unless this is given. `fair` takes graded steps, and controlled ones if only --steps or --time ends it.
    #[arg(long, value_name = "TAU", help_heading = FLOW, hide_short_help = true)]
    pub tau: Option<StepRule>,

    /// Tolerated error of controlled time steps, a LENGTH or PERCENT [default: 1.5%]
    ///
    /// A length, in the units of the input, is for the whole run. A percentage is for each step: a part of the way of the surface in the step.
    #[arg(long, value_name = "LENGTH", value_parser = Amount::tolerance, allow_hyphen_values = true, help_heading = FLOW, hide_short_help = true)]
    pub tolerance: Option<Amount>,

    /// Hold the volume in space: keep, a VALUE, or PERCENT, as 90% [default: keep for `fair` of a segmentation]
    ///
    /// A value is in the units of the input. A percentage is of the volume at the beginning. For a segmentation that is the volume of its voxels
    /// without specks.
    #[arg(long, value_name = "TARGET", help_heading = SIZES)]
    pub volume: Option<SizeTarget>,

    /// Hold the length of a curve in the plane: keep, a VALUE, or PERCENT, as 105%
    ///
    /// `flow` first makes edges round that are sharper than the interface. The length comes back over the ramp.
    #[arg(long, value_name = "TARGET", help_heading = SIZES, hide_short_help = true)]
    pub length: Option<SizeTarget>,

    /// Hold the area, in space of the surface, in the plane of the inside: keep, a VALUE, or PERCENT, as 105%
    ///
    /// In space `flow` first makes edges round that are sharper than the interface. The area comes back over the ramp.
    #[arg(long, value_name = "TARGET", help_heading = SIZES)]
    pub area: Option<SizeTarget>,

    /// Keep the area of the surface, and drive the volume to this reduced volume, above 0 and below 1
    ///
    /// The reduced volume is 6 sqrt(pi) V / A^(3/2) for a volume V and an area A. A ball has 1, a red blood cell 0.64. In the plane the length L
    /// stays, and the area A goes to this value of 4 pi A / L^2.
    #[arg(long, value_name = "PART", conflicts_with_all = ["volume", "area", "length"], help_heading = SIZES, hide_short_help = true)]
    pub reduced_volume: Option<f64>,

    /// Steps over which sizes go to their targets [default: 20]
    #[arg(long, value_name = "STEPS", help_heading = SIZES, hide_short_help = true)]
    pub ramp: Option<usize>,

    /// Spontaneous curvature c0, one over a length [default: 0]
    ///
    /// The energy is 1/2 int (kappa - c0)^2 dA with the sum kappa of the principal curvatures, which is positive for a ball.
    #[arg(long, value_name = "C0", value_parser = finite, allow_hyphen_values = true, help_heading = SIZES, hide_short_help = true)]
    pub spontaneous_curvature: Option<f64>,

    /// Surface tension, one over a length squared [default: 0]
    ///
    /// It adds this times the area of the surface to the energy, in the plane this times the length of the curve.
    #[arg(long, value_name = "SIGMA", value_parser = finite, allow_hyphen_values = true, help_heading = SIZES, hide_short_help = true)]
    pub tension: Option<f64>,

    /// Pressure, one over a length cubed [default: 0]
    ///
    /// It adds this times the volume to the energy, in the plane this times the area of the inside.
    #[arg(long, value_name = "P", value_parser = finite, allow_hyphen_values = true, help_heading = SIZES, hide_short_help = true)]
    pub pressure: Option<f64>,

    /// Stop when the Willmore energy is no more than this
    ///
    /// A sphere has 8 pi = 25.13, a circle of radius R has pi / R.
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

    /// Standard deviation of the noise that is taken off, in the units of the mesh [default: estimated]
    ///
    /// It is measured along the normals. It is estimated unless --time, --energy, --energy-ratio or --steps says when to stop. A segmentation has no such
    /// noise: it flows for the time (1.6 voxels)^4, or until its surface has moved by 0.35 of a voxel.
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_hyphen_values = true, help_heading = FLOW)]
    pub noise: Option<f64>,

    /// Stop as soon as the Willmore energy is no more than this part of the energy at the beginning
    ///
    /// The volume changes, unless --volume keep holds it.
    #[arg(long, value_name = "PART", value_parser = positive, allow_hyphen_values = true, help_heading = FLOW)]
    pub energy_ratio: Option<f64>,

    /// Region of the mesh that stays where it is: a box, a ball, a closed mesh, or a colour
    ///
    /// Regions are box:x0,y0,z0,x1,y1,z1, ball:x,y,z,r, or the inside of a closed mesh in a file (.obj, .stl, .ply), in the coordinates of the
    /// input. colour:ff0000 names the vertices of a colour.
    #[arg(long, value_name = "REGION", allow_hyphen_values = true, help_heading = FLOW)]
    pub keep: Option<String>,

    /// Write a new mesh in place of the input with its vertices moved
    ///
    /// The new mesh is the zero level set on the grid. With --repair the input need not be closed. A segmentation always gives a new mesh.
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

    /// The region that is filled: an image, box:x0,y0,x1,y1, or ball:x,y,r, in 3D with z
    ///
    /// An image has the size of the input; for an input that is no image it is a square, which fills the box. Its opaque pixels are the region if some
    /// pixels are transparent. Otherwise the dark pixels are the region, or the light ones if most of the border is dark.
    #[arg(long, value_name = "REGION", allow_hyphen_values = true, help_heading = INPUT)]
    pub mask: Option<String>,

    /// Shape in the region at the beginning: keep, empty, full, or box:... or ball:...
    #[arg(long, value_name = "SHAPE", default_value = "keep", help_heading = FLOW)]
    pub ansatz: Ansatz,
}

/// Options of mean curvature flow.
#[derive(Args, Serialize, Clone, Debug)]
pub struct McfOptions {
    /// The step of mean curvature flow
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
    /// A picture (.png, of a plane shape .svg), a mesh (.ply, .obj, .stl), a field (.npy, .vti) or a segmentation (.nii, .nii.gz).
    #[arg(long, value_name = "FILE")]
    pub save: PathBuf,

    /// Cut this region out: box:x0,y0,x1,y1 or ball:x,y,r, in 3D with z
    ///
    /// It may be given several times.
    #[arg(long, value_name = "REGION", allow_hyphen_values = true)]
    pub without: Vec<Region>,

    /// Move the vertices of a mesh along their normals by random lengths of up to this
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0)]
    pub noise: f64,

    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,

    /// Write the zero level set on the grid, also where a mesh would be converted as it is
    #[arg(long)]
    pub resample: bool,

    /// Axis that points up in the picture or the mesh: x, y or z [default: depends on the input]
    ///
    /// Without it the axis is the one that the input names, or else y for .obj and builtin:figure, and z for all others.
    #[arg(long, value_name = "AXIS")]
    pub up: Option<UpAxis>,

    /// Whether files are written over.
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
    /// Dimension of space, 2 or 3; required, like --width, --eps-over-h and --save
    #[arg(long, value_name = "D")]
    pub dimension: Option<usize>,

    /// Width of the kernel in cells, odd
    #[arg(long, value_name = "CELLS")]
    pub width: Option<usize>,

    /// Interface width in cells
    #[arg(long, value_name = "RATIO")]
    pub eps_over_h: Option<f64>,

    /// Time step of the mean curvature flow in cells squared [default: (eps/h)^2/4, what the other commands need]
    #[arg(long, value_name = "RATIO")]
    pub step_over_h2: Option<f64>,

    /// The file to write, .safetensors
    #[arg(long, value_name = "FILE")]
    pub save: Option<PathBuf>,

    /// A network of seconds, for trying out the command
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
    /// Of this input, with all that is left to it.
    pub fn of(input: impl Into<Input>) -> Self {
        Self {
            input: Some(input.into()),
            ..Self::default()
        }
    }
}

impl FlowOptions {
    /// Of this input, with the defaults of the program.
    pub fn of(input: impl Into<Input>) -> Self {
        Self {
            input: InputOptions::of(input),
            ..Self::default()
        }
    }
}

impl FairOptions {
    /// Of this mesh or segmentation, with the defaults of the program.
    pub fn of(input: impl Into<Input>) -> Self {
        Self {
            input: InputOptions::of(input),
            ..Self::default()
        }
    }
}

impl InpaintOptions {
    /// Of this input and the region in it that is filled, with the defaults of the program.
    pub fn of(input: impl Into<Input>, mask: impl Into<String>) -> Self {
        Self {
            input: InputOptions::of(input),
            mask: Some(mask.into()),
            ..Self::default()
        }
    }
}

impl McfOptions {
    /// Of this input, by the network, with the defaults of the program.
    pub fn of(input: impl Into<Input>) -> Self {
        Self {
            input: InputOptions::of(input),
            ..Self::default()
        }
    }
}

impl SampleOptions {
    /// Of this input, to this file, as it is.
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
