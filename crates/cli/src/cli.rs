//! What can be typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use jobs::values::count;
use jobs::{
    CheckOptions, FairOptions, FlowOptions, ForceOption, InpaintOptions, InputOptions, McfOptions,
    RunOptions, SampleOptions, TrainOptions,
};

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
    Check(Configured<CheckOptions>),
    /// Train a network for other ratios than those of the networks that come with the program
    #[command(after_help = "Example:
  willmore train --dimension 2 --width 25 --eps-over-h 3 --step-over-h2 2.25 --save mine.safetensors
  willmore flow logo.png --network mine.safetensors")]
    Train(Configured<TrainOptions>),
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
#[derive(Subcommand, Clone, Debug)]
pub enum RunCommand {
    /// Willmore flow of a mesh, an image, a field or a built-in shape
    #[command(after_help = "Examples:
  willmore flow bunny.ply --steps 12 --output runs/bunny
  willmore flow logo.png --frames 1 --save smooth.svg
  willmore flow builtin:cube --tau doubling:1e-6 --steps 10
  willmore flow builtin:ring --tension 4 --steps 12
Lengths, areas, volumes and times (length^4) are in the units of the mesh, in pixels of the image, or in those of the box.
The Willmore energy is 1/2 int kappa^2 dA in space, with the sum kappa of the principal curvatures (a sphere has 8 pi, no closed surface less),
and 1/2 int kappa^2 ds in the plane (a circle of radius R has pi / R).
Ctrl-C (exit code 130) leaves a run that `willmore resume DIR` continues.")]
    Flow(Configured<FlowOptions>),
    /// Take the noise off a mesh, whose vertices move while all else of the file stays, or make a smooth mesh of a segmentation
    #[command(after_help = "Examples:
  willmore fair scan.stl --save smooth.stl
  willmore fair scan.obj --noise 0.2 --keep box:-5,-5,0,5,5,2
  willmore fair scan.ply --energy-ratio 0.5 --remesh
  willmore fair organs.nii.gz --label all --save organ.stl")]
    Fair(Configured<FairOptions>),
    /// Fill a region of a shape smoothly; the pixels outside of it and the phase field there stay bit for bit, and a mesh becomes a new one
    #[command(after_help = "Examples:
  willmore inpaint drawing.png --mask damage.png --steps 40
  willmore inpaint builtin:disc --mask box:0.2,0.2,0.9,0.9 --ansatz empty
  willmore inpaint bunny.ply --mask ball:0.1,0.2,0,0.15
Regions are in the coordinates of the input: of the mesh or field, in pixels from the lower left corner of an image, of the box about 0.")]
    Inpaint(Configured<InpaintOptions>),
    /// Mean curvature flow, by the network or by finite elements
    #[command(after_help = "Examples:
  willmore mcf logo.png --steps 64
  willmore mcf builtin:torus --method fe-implicit --frames 4")]
    #[command(mut_arg("steps", |steps| steps.help(MCF_STEPS)), mut_arg("time", |time| time.help(MCF_TIME)))]
    Mcf(Configured<McfOptions>),
}

const MCF_STEPS: &str = "Stop after this many steps, of (eps/h)^2/4 cells squared each [default: 20, or 100000 with --time]";
const MCF_TIME: &str =
    "Stop with the step that reaches this time, a squared length in the units of the input";

/// Options that can also stand in a file.
#[derive(Args, Clone, Debug)]
pub struct Configured<O: Args> {
    #[command(flatten)]
    pub options: O,

    /// Read options from a file, `name = value`; those on the command line win
    #[arg(
        long,
        value_name = "FILE.toml",
        help_heading = "Run",
        hide_short_help = true
    )]
    pub config: Option<PathBuf>,
}

/// What is printed.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct MessageOptions {
    /// Print nothing but errors
    #[arg(long, global = true, help_heading = "Output")]
    pub quiet: bool,

    /// Print the outcome as JSON: one object, with --label all one for each label; the networks as an array
    #[arg(long, global = true, help_heading = "Output")]
    pub json: bool,
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

impl RunCommand {
    /// The job and its options.
    pub fn job(self) -> jobs::Job {
        match self {
            Self::Flow(flow) => jobs::Job::Flow(flow.options),
            Self::Fair(fair) => jobs::Job::Fair(fair.options),
            Self::Inpaint(inpaint) => jobs::Job::Inpaint(inpaint.options),
            Self::Mcf(mcf) => jobs::Job::Mcf(mcf.options),
        }
    }

    /// The options of its input and of its run.
    pub fn options(&mut self) -> (&mut InputOptions, &mut RunOptions) {
        match self {
            Self::Flow(flow) => (&mut flow.options.input, &mut flow.options.run),
            Self::Fair(fair) => (&mut fair.options.input, &mut fair.options.run),
            Self::Inpaint(inpaint) => (&mut inpaint.options.input, &mut inpaint.options.run),
            Self::Mcf(mcf) => (&mut mcf.options.input, &mut mcf.options.run),
        }
    }
}
