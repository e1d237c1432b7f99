//! What can be typed.

use std::fmt::Display;
use std::io::Write;

use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use engine::Storage;
use report::ProgressBars;

use crate::paths::MESHES;
use crate::prelude::*;
use crate::values::{Amount, Ansatz, Label, SizeTarget, count, finite, positive};

const EXIT_CODES: &str = "Exit codes: 0 success; 2 bad input or failure, one line on standard error; 130 interrupted (Ctrl-C): \
of a run the last step was finished and stored, and `willmore resume` goes on.";

/// Willmore flow of meshes, images and fields.
///
/// Surfaces and curves are made smooth by the gradient flow of their bending energy, with the hybrid scheme of Rumpf, Sassen
/// and Norden-Smoch: a learned step of mean curvature flow inside a minimizing movement.
#[derive(Parser, Debug)]
#[command(name = "willmore", version, after_help = EXIT_CODES, max_term_width = 120)]
#[command(args_override_self = true, disable_help_subcommand = true)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
    #[command(flatten)]
    pub messages: MessageOptions,
}

#[derive(Subcommand, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one of them")]
pub enum Command {
    #[command(flatten)]
    Run(RunCommand),
    /// Continue an interrupted run, to the same final bytes as if it had not been interrupted
    #[command(after_help = "Examples:
  willmore resume runs/bunny
  willmore resume runs/bunny --steps 40")]
    Resume(ResumeOptions),
    /// Write a built-in shape or another input to a file, possibly with noise and holes: something to try the program on
    #[command(after_help = "Examples:
  willmore sample builtin:figure --noise 0.005 --save scan.ply
  willmore sample builtin:ring --without ball:0.4,0.2,0.1 --save logo.png
  willmore sample ball:0.4,0.2,0.15 --save mask.png
  willmore sample scan.obj --save scan.stl
  willmore sample scan.obj --repair --save whole.ply")]
    Sample(SampleOptions),
    /// List the networks that come with the program, or show one
    #[command(after_help = "Examples:
  willmore networks
  willmore networks show d2_k17_eps2_step1
  willmore networks show mine.safetensors")]
    Networks {
        #[command(subcommand)]
        show: Option<NetworksCommand>,
    },
    /// Versions, devices and features of this program
    #[command(after_help = "Example:
  willmore info --json")]
    Info,
    /// Check derivatives, symmetry and device on your own input
    #[command(after_help = "Examples:
  willmore check logo.png
  willmore check builtin:torus --device wgpu")]
    Check(CheckOptions),
    /// Train a network for other ratios than those of the networks that come with the program
    #[command(after_help = "Example:
  willmore train --dimension 2 --width 25 --eps-over-h 3 --step-over-h2 2.25 --save mine.safetensors
  willmore flow logo.png --network mine.safetensors")]
    Train(TrainOptions),
    /// Print completions for a shell
    #[command(after_help = "Example:
  willmore completions bash > ~/.local/share/bash-completion/completions/willmore")]
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Print the manual page
    #[command(after_help = "Example:\n  willmore man > willmore.1")]
    Man,
}

/// The subcommands that make runs.
#[derive(Subcommand, Serialize, Clone, Debug)]
#[serde(untagged)]
pub enum RunCommand {
    /// Willmore flow of a mesh, an image, a field or a built-in shape
    #[command(after_help = "Examples:
  willmore flow bunny.ply --steps 12 --output runs/bunny
  willmore flow logo.png --frames 1 --save smooth.svg
  willmore flow builtin:cube --tau doubling:1e-6 --steps 10
  willmore flow builtin:ring --tension 4 --steps 12
Lengths, areas, volumes and times (length^4) are in the units of the mesh, in pixels of the image, or in those of the box.
The Willmore energy is 1/2 int H^2 dA in space, H the sum of the principal curvatures (a sphere has 8 pi, no closed surface less),
and 1/2 int kappa^2 ds in the plane (a circle of radius R has pi / R).
Ctrl-C (exit code 130) leaves a run that `willmore resume DIR` continues.")]
    Flow(FlowOptions),
    /// Take the noise off a mesh, whose vertices move while all else of the file stays, or make a smooth mesh of a segmentation
    #[command(after_help = "Examples:
  willmore fair scan.stl --save smooth.stl
  willmore fair scan.obj --noise 0.2 --keep box:-5,-5,0,5,5,2
  willmore fair scan.ply --energy-ratio 0.5 --remesh
  willmore fair organs.nii.gz --label all --save organ.stl")]
    Fair(FairOptions),
    /// Fill a region of a shape smoothly; the pixels outside of it and the phase field there stay bit for bit, and a mesh becomes a new one
    #[command(after_help = "Examples:
  willmore inpaint drawing.png --mask damage.png --steps 40
  willmore inpaint builtin:disc --mask box:0.2,0.2,0.9,0.9 --ansatz empty
  willmore inpaint bunny.ply --mask ball:0.1,0.2,0,0.15
Regions are in the coordinates of the input: of the mesh or field, in pixels from the lower left corner of an image, of the box about 0.")]
    Inpaint(InpaintOptions),
    /// Mean curvature flow, by the network or by finite elements
    #[command(after_help = "Examples:
  willmore mcf logo.png --steps 64
  willmore mcf builtin:torus --method fe-implicit --frames 4")]
    #[command(mut_arg("steps", |steps| steps.help(MCF_STEPS)), mut_arg("time", |time| time.help(MCF_TIME)))]
    Mcf(McfOptions),
}

const MCF_STEPS: &str = "Stop after this many steps, of (eps/h)^2/4 cells squared each [default: 20, or 100000 with --time]";
const MCF_TIME: &str =
    "Stop with the step that reaches this time, a squared length in the units of the input";

/// Where the shape comes from and how large it is.
#[derive(Args, Serialize, Clone, Debug)]
#[serde(rename_all = "kebab-case")]
pub struct InputOptions {
    /// A mesh (.obj, .stl, .ply), an image (.png, .jpg, .webp, .gif, .tif, .bmp), a volume of voxels (.nii, .nii.gz, .mrc, .map, and .tif
    /// of several pages), a field (.npy), builtin:NAME with
    /// NAME one of disc, ring, cross, rectangle, sphere, cube, torus, coin, figure, lever, a region as box:x0,y0,x1,y1 or ball:x,y,r, in 3D with z,
    /// or - for standard input
    pub input: Option<String>,

    /// Cells per unit length of the box [default: 128 in 2D, 64 in 3D; those of a field; for a mesh, image or volume the coarsest of a few that
    /// holds its thin parts]
    #[arg(long, value_name = "N")]
    pub cells: Option<usize>,

    /// Side of the periodic box [default: 2 in 2D, 1 in 3D]
    #[arg(long, value_name = "LENGTH")]
    pub box_side: Option<f64>,

    /// Longest side of the shape in units of --box-side; the box is scaled to meshes, images and volumes, so that all other lengths are in
    /// the units of the input [default: 0.6 of the box, for `fair` of a mesh 0.8 or 0.9]
    #[arg(long, value_name = "LENGTH")]
    pub side_length: Option<f64>,

    /// Which pixels of an image are inside [default: auto]
    #[arg(long, value_name = "SIDE", value_enum)]
    pub inside: Option<Inside>,

    /// Value between inside and outside: of an image its grey value from 0 to 1, or opacity [default: 0.5]; of a volume in its units
    #[arg(long, value_name = "VALUE")]
    pub threshold: Option<f64>,

    /// The label of a volume that is inside, or all: each but 0 becomes a surface of its own [default: the larger of two values]
    #[arg(long, value_name = "LABEL", conflicts_with = "threshold")]
    pub label: Option<Label>,

    /// Mend a mesh that is open, crosses itself or is not oriented alike: a new mesh is made, and it is said what was changed
    #[arg(long)]
    pub repair: bool,

    /// What the values of a field are [default: phase-field]
    #[arg(long, value_name = "KIND", value_enum)]
    pub holds: Option<Holds>,
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

/// What the values of a field are.
#[derive(ValueEnum, Serialize, Clone, Copy, Debug, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Holds {
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
    #[arg(long, value_name = "RATIO")]
    pub eps_over_h: Option<f64>,

    /// Which formulation of a step: accurate, the most accurate network, calibrated; calibrated, the paper's network, calibrated; or paper, as
    /// in the paper
    #[arg(
        long = "scheme",
        value_name = "NAME",
        value_enum,
        default_value = "accurate"
    )]
    #[serde(rename = "scheme")]
    pub formulation: Formulation,

    /// Use this network, as `willmore train` makes them
    #[arg(long, value_name = "FILE")]
    pub network: Option<PathBuf>,

    /// What of the phase field is stored: dense, the whole grid; bricks, what is near the surface; auto, bricks where they are less than half of
    /// the grid; mean curvature flow, finite elements and the paper's networks always take the whole grid [default: auto]
    #[arg(long, value_name = "WHAT", value_enum, hide_possible_values = true)]
    pub storage: Option<Storage>,
}

/// What is there stays, unless this is given.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct ForceOption {
    /// Write over what is there: a file, or the run in a folder
    #[arg(long)]
    pub force: bool,
}

/// Options of every command that computes.
#[derive(Args, Serialize, Clone, Debug)]
pub struct CommonOptions {
    /// Where to compute: flex or ndarray (CPU), wgpu or cuda (GPU), if compiled in [default: the first compiled in]
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,

    /// Seed of the random numbers of check and train; flows have none
    #[arg(long, default_value_t = 1)]
    pub seed: u64,

    /// Read options from a file, `name = value`; those on the command line win
    #[arg(long, value_name = "FILE.toml")]
    #[serde(skip)]
    pub config: Option<PathBuf>,
}

/// What is printed.
#[derive(Args, Clone, Copy, Debug)]
pub struct MessageOptions {
    /// Print nothing but errors
    #[arg(long, global = true)]
    pub quiet: bool,

    /// Print the outcome as JSON: one object, with --label all one for each label; the networks as an array
    #[arg(long, global = true)]
    pub json: bool,

    /// Whether standard output is a result, beside which only warnings are told.
    #[arg(skip)]
    pub to_pipe: bool,
}

/// Options of every command that makes runs.
#[derive(Args, Serialize, Clone, Debug)]
#[serde(rename_all = "kebab-case")]
pub struct RunOptions {
    #[command(flatten)]
    #[serde(flatten)]
    pub input: InputOptions,
    #[command(flatten)]
    #[serde(flatten)]
    pub operator: OperatorOptions,

    /// Stop after this many steps [default: 20, or 1000 where something else ends the run]
    #[arg(long, value_name = "COUNT", value_parser = count)]
    pub steps: Option<usize>,

    /// Stop at this time, a length to the fourth power in the units of the input
    #[arg(long, value_name = "T", value_parser = positive)]
    pub time: Option<f64>,

    /// Keep a picture, the field and the shape every so many steps, and an animation
    #[arg(long, value_name = "EVERY", value_parser = count)]
    pub frames: Option<usize>,

    /// Steps between two checkpoints
    #[arg(long, value_name = "STEPS", value_parser = count, default_value_t = 5)]
    pub checkpoint_every: usize,

    /// Axis that points up in pictures, on the page and in meshes that are written: x, y or z [default: the one that the mesh names, or
    /// else y for .obj and builtin:figure, z for all others]
    #[arg(long, value_name = "AXIS")]
    pub up: Option<UpAxis>,

    /// Leave out index.html, the page of the run for a browser
    #[arg(long)]
    pub no_page: bool,

    /// Folder of the run [default: runs/NAME-COMMAND, with a number if that is there]
    #[arg(long, value_name = "DIR")]
    #[serde(skip)]
    pub output: Option<PathBuf>,

    /// Write the result to this file too: a mesh (.ply, .obj, .stl) in space, a picture (.png, .svg) in the plane, - for standard output
    #[arg(long, value_name = "FILE")]
    pub save: Option<PathBuf>,

    #[command(flatten)]
    #[serde(skip)]
    pub force: ForceOption,
    #[command(flatten)]
    #[serde(flatten)]
    pub common: CommonOptions,
}

#[derive(Args, Serialize, Clone, Debug)]
#[serde(rename_all = "kebab-case")]
pub struct FlowOptions {
    /// Time steps, in lengths of the input to the fourth power: controlled (of second order, by their error), auto (by the energy),
    /// auto:FIRST, VALUE, doubling:FIRST, graded:FIRST,PART (of the time reached), growing:VALUE,COUNT, which doubles after so many, or
    /// ramp:VALUE,HALVINGS, whose first step is divided [default: controlled; inpaint: a ramp; fair: graded, but controlled where only --steps
    /// or --time end it]
    #[arg(long, value_name = "TAU")]
    pub tau: Option<StepRule>,

    /// About what estimated time error controlled steps may make: a LENGTH in the units of the input for the whole run, or for each step a
    /// part of how far the surface moves in it in percent [default: 1.5%]
    #[arg(long, value_name = "LENGTH", value_parser = Amount::tolerance, allow_hyphen_values = true)]
    pub tolerance: Option<Amount>,

    /// Hold the volume (the area of a plane shape): keep, a VALUE in the units of the input, or PERCENT of that at the beginning, as 90%;
    /// of a segmentation it is that of the voxels without specks [default: keep for `fair` of a segmentation]
    #[arg(long, value_name = "TARGET")]
    pub volume: Option<SizeTarget>,

    /// Hold the area of the surface (the length of a plane curve): keep, VALUE, or PERCENT, as 105%. With `flow`, edges
    /// sharper than the interface become round first, and the area comes back over the ramp
    #[arg(long, value_name = "TARGET")]
    pub area: Option<SizeTarget>,

    /// Keep the area of the surface (the length) and change the volume to that with this reduced volume, above 0 and below 1:
    /// 6 sqrt(pi) V / A^(3/2), and 4 pi A / L^2 in the plane; a ball has 1, a red blood cell 0.64
    #[arg(long, value_name = "PART", conflicts_with_all = ["volume", "area"])]
    pub reduced_volume: Option<f64>,

    /// Steps over which --volume, --area and --reduced-volume go to their targets [default: 20]
    #[arg(long, value_name = "STEPS")]
    pub ramp: Option<usize>,

    /// The curvature c0 that bends for nothing, one over a length: the energy is 1/2 int (kappa - c0)^2 dA, kappa the sum of the
    /// principal curvatures, positive for a ball [default: 0]
    #[arg(long, value_name = "C0", value_parser = finite, allow_hyphen_values = true)]
    pub spontaneous_curvature: Option<f64>,

    /// Add this times the area of the surface (the length) to the energy; one over a length squared [default: 0]
    #[arg(long, value_name = "SIGMA", value_parser = finite, allow_hyphen_values = true)]
    pub tension: Option<f64>,

    /// Add this times the volume (the area of a plane shape) to the energy; one over a length cubed [default: 0]
    #[arg(long, value_name = "P", value_parser = finite, allow_hyphen_values = true)]
    pub pressure: Option<f64>,

    /// Stop when the Willmore energy is no more than this; a sphere has 8 pi = 25.13, a circle of radius R pi / R
    #[arg(long, value_name = "W", value_parser = positive)]
    pub energy: Option<f64>,

    #[command(flatten)]
    #[serde(flatten)]
    pub run: RunOptions,
}

#[derive(Args, Serialize, Clone, Debug)]
#[serde(rename_all = "kebab-case")]
pub struct FairOptions {
    #[command(flatten)]
    #[serde(flatten)]
    pub flow: FlowOptions,

    /// Take off noise of this standard deviation along the normals, in the units of the mesh [default: estimated from the mesh,
    /// unless --time, --energy, --energy-ratio or --steps says when to stop; a segmentation flows for (1.6 voxels)^4, or until it has gone by .35 of a voxel]
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_hyphen_values = true)]
    pub noise: Option<f64>,

    /// Stop as soon as the Willmore energy is no more than this part of that at the beginning; the volume is kept by --volume keep
    #[arg(long, value_name = "PART", value_parser = positive, allow_hyphen_values = true)]
    pub energy_ratio: Option<f64>,

    /// Leave this where it is: everything in box:x0,y0,z0,x1,y1,z1, in ball:x,y,z,r or inside a closed mesh (.obj, .stl, .ply), in the
    /// coordinates of the input, or its vertices of a colour, as colour:ff0000
    #[arg(long, value_name = "REGION", allow_hyphen_values = true)]
    pub keep: Option<String>,

    /// Write a new mesh, the zero level set on the grid, in place of the input with its vertices moved; with --repair the input need not be
    /// closed. A segmentation always gives a new mesh
    #[arg(long)]
    pub remesh: bool,

    /// Go on even if the grid is too coarse for thin parts of the input
    #[arg(long)]
    pub allow_loss: bool,

    /// Format of the mesh in the run's folder [default: that of the input]
    #[arg(long, value_name = "NAME", value_parser = MESHES)]
    pub format: Option<String>,

    /// Whether an option other than --noise says when to stop.
    #[arg(skip)]
    #[serde(skip)]
    pub ends: bool,
}

#[derive(Args, Serialize, Clone, Debug)]
pub struct InpaintOptions {
    #[command(flatten)]
    #[serde(flatten)]
    pub flow: FlowOptions,

    /// The region that is filled: an image of the size of the input, or a square for the box of another input (its opaque pixels if some
    /// are not, else the dark ones, or the light ones if most of its border is dark), box:x0,y0,x1,y1, ball:x,y,r, and in 3D
    /// box:x0,y0,z0,x1,y1,z1, ball:x,y,z,r
    #[arg(long, value_name = "REGION", allow_hyphen_values = true)]
    pub mask: Option<String>,

    /// What the region holds at the beginning: keep, empty, full, or a region as box:... or ball:...
    #[arg(long, value_name = "SHAPE", default_value = "keep")]
    pub ansatz: Ansatz,
}

#[derive(Args, Serialize, Clone, Debug)]
pub struct McfOptions {
    /// The step of mean curvature flow
    #[arg(long, value_name = "NAME", value_enum, default_value = "network")]
    pub method: Method,

    #[command(flatten)]
    #[serde(flatten)]
    pub run: RunOptions,
}

#[derive(Args, Clone, Debug)]
pub struct SampleOptions {
    #[command(flatten)]
    pub input: InputOptions,

    /// The file to write: a picture (.png, of a plane shape .svg), a mesh (.ply, .obj, .stl), a field (.npy, .vti) or a segmentation (.nii, .nii.gz)
    #[arg(long, value_name = "FILE")]
    pub save: PathBuf,

    /// Cut this region out: box:x0,y0,x1,y1 or ball:x,y,r, in 3D with z; may be given again
    #[arg(long, value_name = "REGION", allow_hyphen_values = true)]
    pub without: Vec<Region>,

    /// Move the vertices of a mesh along their normals by random lengths of up to this
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0)]
    pub noise: f64,

    /// Seed of the noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,

    /// Write the zero level set on the grid in place of a mesh that is converted as it is, as with --cells and --without
    #[arg(long)]
    pub resample: bool,

    /// Axis that points up in a picture or a mesh that is written: x, y or z [default: the one that the input names, or else y for
    /// .obj and builtin:figure, z for all others]
    #[arg(long, value_name = "AXIS")]
    pub up: Option<UpAxis>,

    #[command(flatten)]
    pub force: ForceOption,
}

#[derive(Args, Clone, Debug)]
pub struct ResumeOptions {
    /// The folder of the run
    pub run: PathBuf,

    /// Go on from the newest undamaged state of a run in which files are damaged or missing
    #[arg(long)]
    pub recover: bool,

    /// Go on to so many steps in all, also with a finished run
    #[arg(long, value_name = "COUNT", value_parser = count)]
    pub steps: Option<usize>,

    #[command(flatten)]
    pub force: ForceOption,
}

#[derive(Subcommand, Clone, Debug)]
pub enum NetworksCommand {
    /// Everything about one network
    Show {
        /// Name in the list, or a file
        network: String,
    },
}

#[derive(Args, Clone, Debug)]
pub struct CheckOptions {
    #[command(flatten)]
    pub input: InputOptions,
    #[command(flatten)]
    pub operator: OperatorOptions,
    #[command(flatten)]
    pub common: CommonOptions,
}

#[derive(Args, Clone, Debug)]
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

    #[command(flatten)]
    pub force: ForceOption,

    #[command(flatten)]
    pub common: CommonOptions,
}

impl RunCommand {
    pub fn name(&self) -> &'static str {
        match self {
            Self::Flow(_) => "flow",
            Self::Fair(_) => "fair",
            Self::Inpaint(_) => "inpaint",
            Self::Mcf(_) => "mcf",
        }
    }

    /// What it has in common with all others.
    pub fn options(&mut self) -> &mut RunOptions {
        match self {
            Self::Flow(flow) => &mut flow.run,
            Self::Fair(fair) => &mut fair.flow.run,
            Self::Inpaint(inpaint) => &mut inpaint.flow.run,
            Self::Mcf(mcf) => &mut mcf.run,
        }
    }

    /// The options of Willmore flow; mean curvature flow has no energy and no controlled steps.
    pub fn willmore(&mut self) -> Option<&mut FlowOptions> {
        match self {
            Self::Flow(flow) => Some(flow),
            Self::Fair(fair) => Some(&mut fair.flow),
            Self::Inpaint(inpaint) => Some(&mut inpaint.flow),
            Self::Mcf(_) => None,
        }
    }
}

impl MessageOptions {
    /// Prints the outcome of a command: an object, or a text for people.
    pub fn report(self, outcome: &Value, text: &str) -> Result<()> {
        let shown: &dyn Display = if self.json { outcome } else { &text };
        if self.to_pipe || self.quiet && !self.json {
            return Ok(());
        }
        write_out(format!("{shown}\n").as_bytes())
    }

    pub fn warn(self, what: &str) {
        if !self.quiet {
            // A closed pipe is no reason to fail here either.
            let _ = writeln!(std::io::stderr(), "warning: {what}");
        }
    }

    pub fn note(self, what: &str) {
        if !self.quiet && !self.json && !self.to_pipe {
            let _ = writeln!(std::io::stderr(), "{what}");
        }
    }

    pub fn progress(self) -> ProgressBars {
        ProgressBars::new(self.quiet || self.json || self.to_pipe)
    }
}

/// Writes to standard output. A closed pipe (`| head`) is no failure.
pub fn write_out(text: &[u8]) -> Result<()> {
    let mut out = std::io::stdout();
    match out.write_all(text).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(files::Error::of("write", "standard output")(error).into())
        }
        _ => Ok(()),
    }
}

impl ForceOption {
    /// Refuses a file to save that is there, or whose folder is not.
    pub fn check(self, path: &Path) -> Result<()> {
        let (folder, shown) = (path.parent().unwrap_or(path), path.display());
        if !(folder.as_os_str().is_empty() || folder.is_dir()) {
            refuse!("--save {shown}: there is no such folder");
        }
        if path.exists() && !self.force {
            refuse!(
                "--save {shown} is there already: give another name, or --force to write over it"
            );
        }
        Ok(())
    }
}
