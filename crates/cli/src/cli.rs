//! What can be typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use jobs::values::count;
use jobs::{
    CheckOptions, FairOptions, FlowOptions, ForceOption, InpaintOptions, InputOptions, McfOptions,
    RunOptions, SampleOptions, TrainOptions,
};

const EXIT_CODES: &str = "Exit codes: 0 success; 2 bad input or failure, with one line on standard error; 130 interrupted (Ctrl-C). \
An interrupted run drops the step that it is making, and ends within two seconds. `willmore resume` continues it, with the same results.";

/// Willmore flow of meshes, images and fields.
///
/// Willmore flow lowers the bending energy of surfaces and curves, and so makes them smooth. The program computes it by the hybrid scheme of Rumpf,
/// Sassen and Norden-Smoch: each time step minimizes an energy, and the curvature in this energy comes from a short, learned step of mean curvature
/// flow.
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
    /// Continue an interrupted run; its files become the same as without the interruption
    #[command(after_help = "Examples:
  willmore resume runs/bunny
  willmore resume runs/bunny --steps 40")]
    Resume(ResumeOptions),
    /// Write a built-in shape or another input to a file, also with noise or holes, to try the program
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
    /// Show version, devices and networks of this program
    #[command(after_help = "Example:
  willmore info --json")]
    Info,
    /// Check the computation of a time step on your own input
    ///
    /// Taylor tests check the gradient and the Hessian of the energy of a time step, with the network of the scheme and without its calibration. The
    /// Hessian must be symmetric. If the program contains a CPU backend that is not the chosen device, it also compares the gradients that the two
    /// compute.
    #[command(after_help = "Examples:
  willmore check logo.png
  willmore check builtin:torus --device wgpu")]
    Check(Configured<CheckOptions>),
    /// Train a network for a kernel width or an interface width that no network of the program has
    ///
    /// Networks are trained on a CPU.
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
Lengths, areas, volumes and times (length^4) are in the units of the mesh or volume. For an image they are in pixels. \
For other inputs they are in the units of the box.
In 3D the Willmore energy is 1/2 int kappa^2 dA, where kappa is the sum of the principal curvatures. A sphere has 8 pi, and no closed surface \
has less.
In 2D the Willmore energy is 1/2 int kappa^2 ds, where kappa is the curvature. A circle of radius R has pi / R.
After Ctrl-C (exit code 130), `willmore resume DIR` continues the run.")]
    Flow(Configured<FlowOptions>),
    /// Take the noise off a mesh, or make a smooth mesh of a segmentation
    ///
    /// In the file of a mesh, only the positions of the vertices change. With --remesh the result is a new mesh.
    #[command(after_help = "Examples:
  willmore fair scan.stl --save smooth.stl
  willmore fair scan.obj --noise 0.2 --keep box:-5,-5,0,5,5,2
  willmore fair scan.ply --energy-ratio 0.5 --remesh
  willmore fair organs.nii.gz --label all --save organ.stl")]
    Fair(Configured<FairOptions>),
    /// Fill a region of a shape smoothly
    ///
    /// Outside of the region, the pixels of an image and the values of the phase field do not change at all. If the input is a mesh, the result is a
    /// new mesh.
    #[command(after_help = "Examples:
  willmore inpaint drawing.png --mask damage.png --steps 40
  willmore inpaint builtin:disc --mask box:0.2,0.2,0.9,0.9 --ansatz empty
  willmore inpaint bunny.ply --mask ball:0.1,0.2,0,0.15
Regions are in the coordinates of the input. For an image they are in pixels from its lower left corner. \
For a built-in shape they are in the coordinates of the box, whose centre is 0.")]
    Inpaint(Configured<InpaintOptions>),
    /// Mean curvature flow by a learned network or by finite elements
    #[command(after_help = "Examples:
  willmore mcf logo.png --steps 64
  willmore mcf builtin:torus --method fe-implicit --frames 4")]
    #[command(mut_arg("steps", |steps| steps.help(MCF_STEPS)), mut_arg("time", |time| time.help(MCF_TIME)))]
    Mcf(Configured<McfOptions>),
}

const MCF_STEPS: &str = "Stop after this many steps; the size of a step is eps^2 / 4 for the interface width eps \
[default: 20, or 100000 with --time]";
const MCF_TIME: &str =
    "Stop with the step that reaches this time, which is in (units of length of the input)^2";

/// Options that can also stand in a file.
#[derive(Args, Clone, Debug)]
pub struct Configured<O: Args> {
    #[command(flatten)]
    pub options: O,

    /// Read options from a file with lines `name = value`; options on the command line take precedence
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

    /// Print the outcome as JSON
    ///
    /// The outcome is one object. With --label all there is one object for each label, but one for all with --shared. The list of `networks` is an array.
    #[arg(long, global = true, help_heading = "Output")]
    pub json: bool,
}

#[derive(Args, Clone, Debug)]
pub struct ResumeOptions {
    /// The folder of the run
    pub run: PathBuf,

    /// Continue from the newest undamaged state if files of the run are damaged or missing
    #[arg(long)]
    pub recover: bool,

    /// Continue until the run has COUNT steps in total, even if it is finished
    #[arg(long, value_name = "COUNT", value_parser = count)]
    pub steps: Option<usize>,

    #[command(flatten)]
    pub force: ForceOption,
}

#[derive(Subcommand, Clone, Debug)]
pub enum NetworksCommand {
    /// Show everything about one network
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
