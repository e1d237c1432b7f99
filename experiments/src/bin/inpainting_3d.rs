//! Inpainting of surfaces: Willmore flow of the values in a region, the rest of the surface held.

use std::process::ExitCode;
use std::time::Instant;

use clap::{Parser, ValueEnum};
use experiments::evolution::{NamedRegion, TimeSteps};
use experiments::inpainting::{self, Inpainted, STILL, Window, division};
use experiments::method::{Method, Scheme};
use experiments::networks::{NetworkOptions, checksum};
use experiments::options::RunOptions;
use experiments::surfaces::{
    Finished, Setting, Snapshot, SurfaceRun, View, Workshop, centred_box, ratios, scales, since,
    table,
};
use experiments::{Error, harness};
use geometry::shapes::{Ball, Cuboid, Cylinder};
use geometry::{Field, Grid, SignedDistance, SignedDistanceExt, UpAxis, phase_field};
use render::Rgb;
use report::{Figure, Summary};
use serde::Serialize;

const PROGRAM: &str = "inpainting_3d";
/// Size of the paper's time steps.
const TAU: f64 = 1.0 / 2_097_152.0;
/// Middle of the box.
const CENTRE: f64 = 0.5;
/// Radius of the ball.
const RADIUS: f64 = 0.34;
/// The cut-out corner: everything beyond this along all three axes, from the middle.
const CORNER: f64 = 0.05;
/// The region of the ball, from the middle along all three axes.
const BALL_REGION: [f64; 2] = [0.0, 0.39];
/// Radius of the tubes, and where they end.
const TUBE: [f64; 2] = [0.11, 0.42];
/// Half side of the region of the tubes.
const TUBES_REGION: f64 = 0.24;
/// Radius of the edges of the region in the pictures.
const EDGE: f64 = 0.003;
/// Side of a picture in pixels.
const SIDE: u32 = 480;
/// Pictures side by side.
const COLUMNS: usize = 3;
/// After so many doublings a step has size 8: nothing moves for long.
const MOST_EXTRA: usize = 24;
const GREEN: Rgb = Rgb(0, 140, 60);

/// Inpainting of surfaces: a ball grows its missing corner again, and six tubes are blended in the middle. Only the values in the
/// region D move (green in the pictures); all others stay bit for bit.
///
/// Frames are those of the paper's 5 and 8 steps of tau = 2^-21. Further steps follow, each twice as long as the one before, until
/// nothing moves any more.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    #[command(flatten)]
    networks: NetworkOptions,

    /// Cells per unit length; eps = 2/n and tautilde = 1/n^2 follow [default: 128, as in the paper]
    #[arg(long, value_name = "N")]
    cells: Option<usize>,

    /// Steps beyond the paper's, each twice as long as the one before
    #[arg(long, value_name = "COUNT", default_value_t = 20)]
    extra_steps: usize,

    /// One shape alone
    #[arg(long, value_name = "NAME", value_enum)]
    only: Option<Shape>,

    /// Weights of the energy and network: paper, calibrated or accurate
    #[arg(long, value_name = "NAME", value_enum, default_value_t = Scheme::Accurate)]
    scheme: Scheme,
}

#[derive(ValueEnum, Serialize, Clone, Copy, Debug, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum Shape {
    /// The ball with a cut-out corner
    Ball,
    /// The six tubes
    Tubes,
}

impl Shape {
    const ALL: [Self; 2] = [Self::Ball, Self::Tubes];

    fn key(self) -> &'static str {
        match self {
            Self::Ball => "ball",
            Self::Tubes => "tubes",
        }
    }

    fn title(self) -> &'static str {
        match self {
            Self::Ball => "ball with a cut-out corner",
            Self::Tubes => "six tubes",
        }
    }

    /// The paper's frames.
    fn papers(self) -> &'static [usize] {
        match self {
            Self::Ball => &[0, 1, 3, 5],
            Self::Tubes => &[0, 1, 4, 8],
        }
    }

    /// And one on the way to the end.
    fn shown(self) -> Vec<usize> {
        let [.., last] = self.papers() else {
            return Vec::new();
        };
        [self.papers(), &[last + 6]].concat()
    }

    fn initial(self, grid: Grid<3>, eps: f64) -> Result<Field<3>, Error> {
        let centre = [CENTRE; 3];
        Ok(match self {
            Self::Ball => {
                let half = 0.5 * (0.5 - CORNER);
                let corner = Cuboid::new([half; 3])?.translated([CORNER + half; 3]);
                let shape = Ball::new([0.0; 3], RADIUS)?.difference(corner);
                phase_field(grid, &shape.translated(centre), eps)?
            }
            Self::Tubes => {
                let [radius, end] = TUBE;
                let pair = Cylinder::new(radius, end)?;
                // The ansatz in the middle is that they meet.
                let tubes = move |[x, y, z]: [f64; 3]| {
                    [[x, y, z], [y, z, x], [z, x, y]]
                        .map(|x| pair.signed_distance(x))
                        .into_iter()
                        .fold(f64::INFINITY, f64::min)
                };
                phase_field(grid, &tubes.translated(centre), eps)?
            }
        })
    }

    /// What it should become, if that is known.
    fn whole(self, grid: Grid<3>, eps: f64) -> Result<Option<Field<3>>, Error> {
        Ok(match self {
            Self::Ball => {
                let ball = Ball::new([CENTRE; 3], RADIUS)?;
                Some(phase_field(grid, &ball, eps)?)
            }
            Self::Tubes => None,
        })
    }

    /// D.
    fn region(self) -> Window<3> {
        let [low, high] = match self {
            Self::Ball => BALL_REGION,
            Self::Tubes => [-TUBES_REGION, TUBES_REGION],
        };
        Window {
            low: [CENTRE + low; 3],
            high: [CENTRE + high; 3],
        }
    }

    fn view(self) -> View {
        let (azimuth, elevation) = match self {
            Self::Ball => (30.0, 25.0),
            Self::Tubes => (25.0, 25.0),
        };
        View {
            up: UpAxis::Z,
            azimuth,
            elevation,
        }
    }
}

#[derive(Serialize)]
struct Parameters {
    n: usize,
    eps: f64,
    mcf_step: f64,
    tau: f64,
    scheme: Scheme,
    shapes: Vec<Shape>,
    extra_steps: usize,
    first_part: f64,
    still: f64,
    network: String,
    quick: bool,
}

/// A shape before it flows.
struct Start {
    shape: Shape,
    initial: Field<3>,
    whole: Option<Field<3>>,
    region: NamedRegion,
}

fn main() -> ExitCode {
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let quick = options.run.quick;
    let n = options.cells.unwrap_or(if quick { 32 } else { 128 });
    if options.extra_steps > MOST_EXTRA {
        return Err(Error::Options(format!(
            "--extra-steps {} is too many: each step is twice as long as the one before; give at most {MOST_EXTRA}",
            options.extra_steps
        )));
    }
    let device = options.run.open_device()?;
    let networks = options.networks.find(&[ratios()])?;
    let (grid, params) = (centred_box(n, 1.0)?, scales(n));
    let shapes: Vec<Shape> = (Shape::ALL.into_iter())
        .filter(|p| options.only.is_none_or(|only| only == *p))
        .collect();
    let output = options.run.open_output(PROGRAM)?;
    let parameters = Parameters {
        n,
        eps: params.eps,
        mcf_step: params.mcf_step,
        tau: TAU,
        scheme: options.scheme,
        shapes: shapes.clone(),
        extra_steps: options.extra_steps,
        first_part: division(params.eps, &[]).first,
        still: STILL,
        network: checksum(&networks[0]),
        quick,
    };
    let mut manifest = options.run.manifest(PROGRAM, &parameters, &device)?;
    let progress = options.run.progress();
    let clock = Instant::now();
    let workshop = Workshop {
        side: SIDE,
        ..Workshop::new(&options.run, &device, &networks[0], &output, &progress)
    };
    let starts = (shapes.into_iter())
        .map(|shape| {
            Ok(Start {
                shape,
                initial: shape.initial(grid, params.eps)?,
                whole: shape.whole(grid, params.eps)?,
                region: shape.region().nodes(&grid),
            })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let mut finished: Vec<Finished<'_>> = Vec::new();
    for start in &starts {
        finished.push(workshop.run(&mut manifest, start.run(options, n))?);
    }
    let measured = (starts.iter().zip(&finished))
        .map(|(start, finished)| start.measure(finished))
        .collect::<Result<Vec<_>, Error>>()?;
    for ((start, finished), measured) in starts.iter().zip(&finished).zip(&measured) {
        let shape = start.shape;
        let panels = manifest.phase(format!("{}: pictures", shape.title()), || {
            let edges = |_: usize| shape.region().edges(EDGE, GREEN);
            workshop.panels(finished, &|snapshot| caption(measured, snapshot), &edges)
        })?;
        let title = format!("Inpainting: {}", shape.title());
        (panels.into_iter())
            .fold(
                Figure::new(options.run.title(&title), COLUMNS),
                Figure::with_panel,
            )
            .with_note(note(n, measured))
            .write(&output, &format!("{}_frames", shape.key()))?;
    }
    inpainting::energies(&options.run, &measured).write(&output, "energies")?;
    output.write("steps.csv", inpainting::steps_csv(&measured)?)?;
    table(&finished)?.write(&output, "shapes")?;
    let table = inpainting::table(&measured)?;
    table.write(&output, "inpainting")?;
    let mut summary = Summary::new();
    for (finished, measured) in finished.iter().zip(&measured) {
        finished.summarize_shapes(&finished.run.key, &mut summary)?;
        measured.summarize(&mut summary)?;
    }
    summary.insert("seconds", since(clock))?;
    summary.write(&output)?;
    manifest.write(&output)?;
    progress.clear();
    options.run.say(&format!(
        "{}\n{}\nResults are in {}",
        options.run.title("Inpainting of surfaces"),
        table.to_markdown(),
        output.as_path().display()
    ));
    Ok(())
}

impl Start {
    fn run(&self, options: &Options, n: usize) -> SurfaceRun<'_> {
        let shape = self.shape;
        let papers = shape.papers().last().copied().unwrap_or_default();
        SurfaceRun {
            key: shape.key().to_owned(),
            title: shape.title().to_owned(),
            method: Method::Hybrid,
            n,
            tau: TimeSteps::Growing {
                tau: TAU,
                alike: papers,
            },
            steps: papers + options.extra_steps,
            setting: Setting {
                scheme: options.scheme,
                region: Some(self.region.clone()),
                division: Some(division(scales(n).eps, &[])),
                still: Some(STILL),
            },
            shown: (shape.shown().into_iter())
                .map(|step| (step, None))
                .collect(),
            initial: &self.initial,
            identity: format!("inpainted {}", shape.title()),
            view: shape.view(),
        }
    }

    fn measure<'a>(&self, finished: &'a Finished<'_>) -> Result<Inpainted<'a, 3>, Error> {
        let shape = self.shape;
        Inpainted::measure(
            (shape.key(), shape.title()),
            &finished.trajectory,
            &self.region.nodes,
            &shape.shown(),
            self.whole.as_ref(),
        )
    }
}

fn caption(measured: &Inpainted<'_, 3>, snapshot: &Snapshot) -> String {
    let step = snapshot.step;
    let distance = (measured.distances.iter())
        .find(|(k, _)| *k == step && measured.key == Shape::Ball.key())
        .map_or(String::new(), |(_, l2)| {
            format!("\nL² distance to the ball {l2:.4}")
        });
    let after = (snapshot.time / TAU).round();
    let time = if after > step as f64 {
        format!(" (t = {after} τ)")
    } else {
        String::new()
    };
    format!("step {step}{time}: w = {:.2}{distance}", snapshot.w)
}

fn note(n: usize, measured: &Inpainted<'_, 3>) -> String {
    let alike = match measured.trajectory.evolution.tau {
        TimeSteps::Growing { alike, .. } => alike,
        _ => 0,
    };
    let end = measured.still_from().map_or(String::new(), |still| {
        format!(" The shape stands still from t = {} τ on.", still.round())
    });
    format!(
        "n = {n}, ε = 2/n, inner step 1/n², τ = 2⁻²¹, doubled every step from step {} on; only the values in the green box move.{end} \
         w: Willmore energy with the implicit finite-element step.",
        alike + 1
    )
}
