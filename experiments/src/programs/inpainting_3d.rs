use crate::inpainting::{self, GREEN, Inpainted, InpaintingOptions, Shape};
use crate::prelude::*;
use crate::surfaces::{
    self, Flowed, Setting, Snapshot, Surface, VIEW, View, measured, write_snapshots,
};
use render::Tube;

pub const EXPERIMENT: Experiment = Experiment {
    name: "inpainting_3d",
    summary: "Inpainting of surfaces: Willmore flow of the values in a region, the rest of the surface held.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "inpainting_3d",
        title: "Inpainting of surfaces",
        description: "Willmore flow of what lies inside the green box; everything else is held.",
        figures: &[
            ("ball_frames", "A ball whose corner was cut out."),
            ("tubes_frames", "Six tubes that are blended."),
            ("energies", "Willmore energy against time."),
        ],
        options: Some(""),
    }],
    metrics: &[&inpainting::METRICS, &surfaces::METRICS],
    words: &[("SHAPE", "`ball`, `tubes`"), ("SURFACE", "`ball`, `tubes`")],
};

const TITLE: &str = "Inpainting of surfaces";
/// Cells per unit length of a quick run and of the paper.
const CELLS: [usize; 2] = [32, 128];
const TAU: f64 = 1.0 / 2_097_152.0;
const CENTRE: f64 = 0.5;
const RADIUS: f64 = 0.34;
/// The cut-out corner: everything beyond this along all three axes, from the middle.
const CORNER: f64 = 0.05;
/// Radius of the edges of the region in the pictures.
const EDGE: f64 = 0.003;
const SIDE: u32 = 480;
const COLUMNS: usize = 3;
/// After so many doublings a step has size 8: nothing moves for long.
const MOST_EXTRA: usize = 24;

/// Inpainting of surfaces: a ball grows its missing corner again, and six tubes are blended in the middle. Only the values in the
/// region D move (green in the pictures); all others stay bit for bit.
///
/// Frames are those of the paper's 5 and 8 steps of tau = 2^-21. Further steps follow, each twice as long as the one before, until
/// nothing moves any more. The paper has n = 128; eps = 2/n and tautilde = 1/n^2.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    common: InpaintingOptions,

    /// Steps beyond the paper's, each twice as long as the one before
    #[arg(long, value_name = "COUNT", default_value_t = 20)]
    extra_steps: usize,
}

/// The shapes with the azimuths from which they are looked at. The last step shown is one on the way to the end.
fn shapes(extra_steps: usize) -> Result<[(Shape<3>, f64); 2]> {
    let ball = Ball::new([0.0; 3], RADIUS)?;
    let half = 0.5 * (0.5 - CORNER);
    let corner = Cuboid::new([half; 3])?.translated([CORNER + half; 3]);
    let [radius, end] = [0.11, 0.42];
    let pair = Cylinder::new(radius, end)?;
    // The ansatz in the middle is that they meet.
    let tubes = move |[x, y, z]: [f64; 3]| {
        let pairs = [[x, y, z], [y, z, x], [z, x, y]].map(|x| pair.signed_distance(x));
        pairs.into_iter().fold(f64::INFINITY, f64::min)
    };
    let ball_shape = Shape {
        key: "ball",
        title: "ball with a cut-out corner",
        initial: Box::new(ball.difference(corner).translated([CENTRE; 3])),
        whole: Some(Box::new(ball.translated([CENTRE; 3]))),
        region: [CENTRE, CENTRE + 0.39],
        rule: growing(5),
        steps: 5 + extra_steps,
        shown: vec![0, 1, 3, 5, 11],
    };
    let tubes_shape = Shape {
        key: "tubes",
        title: "six tubes",
        initial: Box::new(tubes.translated([CENTRE; 3])),
        whole: None,
        region: [CENTRE - 0.24, CENTRE + 0.24],
        rule: growing(8),
        steps: 8 + extra_steps,
        shown: vec![0, 1, 4, 8, 14],
    };
    Ok([(ball_shape, 30.0), (tubes_shape, 25.0)])
}

/// The paper's steps, and further ones each twice as long as the one before.
fn growing(papers: usize) -> StepRule {
    StepRule::Growing {
        tau: TAU,
        alike: papers,
    }
}

fn program(options: &Options) -> Result<()> {
    let run = &options.common.figure.run;
    let extra_steps = options.extra_steps;
    let message = format!(
        "--extra-steps {extra_steps} is too many: each step is twice as long as the one before; give at most {MOST_EXTRA}"
    );
    require(extra_steps <= MOST_EXTRA, message)?;
    let discretization = Discretization::new(Method::Hybrid, options.common.formulation);
    let setting = Setting::new(&options.common.figure, &[discretization], CELLS, 1.0)?;
    let (n, grid, scales) = (setting.n, setting.grid, setting.scales);
    let operator = setting.operator(discretization)?;
    let (shapes, azimuths): (Vec<_>, Vec<_>) = shapes(extra_steps)?.into_iter().unzip();
    let parameters = inpainting::parameters(n, &scales, &operator, &shapes);
    let mut session = Session::open(EXPERIMENT.name, run, parameters)?;
    let mut flowed = Vec::new();
    for (shape, azimuth) in shapes.iter().zip(azimuths) {
        let surface = Surface {
            key: shape.key,
            title: shape.title.to_owned(),
            shown: shape.shown.iter().map(|&step| (step, None)).collect(),
            view: View { azimuth, ..VIEW },
        };
        let case = shape.case(grid, scales, &operator)?;
        flowed.push(surface.flow(case, &mut session)?);
    }
    let key = |one: &Flowed| one.surface.key.to_owned();
    write_snapshots(&mut session, &flowed, "shapes", key)?;
    let mut inpainted = Vec::new();
    for (shape, one) in shapes.iter().zip(&mut flowed) {
        let measured = Inpainted::measure(shape, &one.trajectory)?;
        decorate(&mut one.snapshots, &measured);
        let title = format!("{}: pictures", shape.title);
        let pictures = session.phase(title, |stage| one.pictures(stage, SIDE))?;
        let title = format!("Inpainting: {}", shape.title);
        let figure = Figure::new(title, COLUMNS).with_panels(pictures);
        let figure = figure.with_note(note(&measured, n));
        session.figure(figure, &format!("{}_frames", shape.key))?;
        inpainted.push(measured);
    }
    inpainting::finish(session, TITLE, &inpainted)
}

/// Draws the region, and tells the time and the distance to the whole shape.
fn decorate(snapshots: &mut [Snapshot], measured: &Inpainted<'_, 3>) {
    let [low, high] = measured.shape.region;
    for snapshot in snapshots {
        let (step, run) = (snapshot.step, measured.trajectory);
        let after = run.record(step).map_or(0.0, |r| (r.time / TAU).round());
        let time = (after > step as f64).then(|| format!(" (t = {after} τ)"));
        let distance = measured.distances.iter().find(|(k, _)| *k == step);
        let distance = distance.filter(|_| measured.shape.whole.is_some());
        let distance = distance.map(|(_, l2)| format!("\nL² distance to the ball {l2:.4}"));
        let [time, distance] = [time, distance].map(Option::unwrap_or_default);
        let [finite_elements, scheme] = ["w", "w_scheme"].map(|w| snapshot.measures.get(w));
        let w = finite_elements.or(scheme).map(|w| format!(": w = {w:.2}"));
        let w = w.unwrap_or_default();
        snapshot.caption = format!("step {step}{time}{w}{distance}");
        snapshot.tubes = Tube::edges_of_box([low; 3], [high; 3], EDGE);
        for edge in &mut snapshot.tubes {
            edge.colour = GREEN;
        }
    }
}

fn note(one: &Inpainted<'_, 3>, n: usize) -> String {
    let StepRule::Growing { alike, .. } = one.shape.rule else {
        unreachable!("steps grow");
    };
    let end = one.still_from().map_or(String::new(), |still| {
        format!(" The shape is stationary from t = {} τ on.", still.round())
    });
    format!(
        "n = {n}, ε = 2/n, inner step 1/n², τ = 2⁻²¹, doubled every step from step {} on; only the values in the green box move.{end} \
         w: Willmore energy {}.",
        alike + 1,
        measured(one.trajectory.case.grid())
    )
}
