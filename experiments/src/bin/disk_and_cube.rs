//! A cube and a thick disk under Willmore flow.

use experiments::prelude::*;
use experiments::surfaces::{Flowed, SchemeOptions, Setting, Surface, SurfaceFlows, View};
use geometry::shapes::{Cuboid, Cylinder};
use geometry::{SignedDistanceExt, UpAxis};

const PROGRAM: &str = "disk_and_cube";
/// Cells per unit length of a quick run and of the paper.
const CELLS: [usize; 2] = [24, 64];
/// Size of a time step.
const TAU: f64 = 1.0 / 262_144.0;
const STEPS: usize = 100;
/// Half the side of the cube, radius and half the height of the disk; the paper does not say, but these fit its initial energies.
const CUBE_HALF_SIDE: f64 = 0.25;
const DISK: [f64; 2] = [0.29, 0.1];
/// The Willmore energies that the paper reports for the hybrid scheme.
const CUBE_ENERGIES: [(usize, f64); 3] = [(0, 132.65), (1, 52.26), (STEPS, 25.78)];
const DISK_ENERGIES: [(usize, f64); 3] = [(0, 87.15), (1, 50.49), (STEPS, 25.59)];
const VIEW: View = View {
    up: UpAxis::Z,
    azimuth: 30.0,
    elevation: 25.0,
};

/// Willmore flow of a cube and of a thick disk, n = 64, eps = 2^-5, tautilde = 2^-12, tau = 2^-18, by the hybrid scheme and by
/// nested implicit finite elements: pictures, Willmore energies w and L2 distances after 0, 1 and 100 steps.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    figure: FigureOptions,

    /// Number of time steps [default: 100]
    #[arg(long, value_name = "COUNT")]
    steps: Option<usize>,

    /// Methods, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum, default_values_t = [Method::Hybrid, Method::FeImplicit])]
    methods: Vec<Method>,

    #[command(flatten)]
    schemes: SchemeOptions,
}

impl Options {
    /// Finite elements are the paper's reference, unless another scheme is wanted of all.
    fn variants(&self) -> Vec<(Method, Scheme)> {
        let schemes = |method: Method| match (method.is_learned(), self.schemes.scheme) {
            (true, _) => self.schemes.schemes(),
            (false, None | Some(Scheme::Paper)) => vec![Scheme::Paper],
            (false, Some(_)) => vec![Scheme::Calibrated],
        };
        let variants = |&method: &Method| schemes(method).into_iter().map(move |s| (method, s));
        self.methods.iter().flat_map(variants).collect()
    }
}

fn main() -> ExitCode {
    harness::main(program)
}

fn program(options: &Options) -> Result<(), Error> {
    let [radius, half_height] = DISK;
    let run = &options.figure.run;
    let steps = (options.steps).unwrap_or(if run.quick { 2 } else { STEPS });
    let variants = options.variants();
    require(
        steps > 0 && !variants.is_empty(),
        "--steps must be at least 1, and --methods must name a method",
    )?;
    let device = run.open_device()?;
    let setting = Setting::new(&options.figure, CELLS, 1.0)?;
    let (grid, eps) = (setting.grid, setting.scales.eps);
    let cube = Cuboid::new([CUBE_HALF_SIDE; 3])?.translated([0.5; 3]);
    let disk = Cylinder::new(radius, half_height)?.translated([0.5; 3]);
    let (cube, disk) = (
        phase_field(grid, &cube, eps)?,
        phase_field(grid, &disk, eps)?,
    );
    let parameters = setting.parameters(json!({
        "tau": TAU, "steps": steps, "variants": variants, "cube_half_side": CUBE_HALF_SIDE, "disk_radius": radius,
        "disk_half_height": half_height,
    }))?;
    let session = Session::open(PROGRAM, run, device, parameters)?;
    let flows = SurfaceFlows {
        program: PROGRAM,
        title: "Willmore flow of a cube and of a thick disk".to_owned(),
        surfaces: vec![
            (surface("cube", "cube", CUBE_ENERGIES), cube),
            (surface("disk", "thick disk", DISK_ENERGIES), disk),
        ],
        variants,
        time: (StepRule::Constant(TAU), steps),
        tau_in_words: "τ = 2⁻¹⁸",
    };
    flows.run(session, &setting, compare_with_finite_elements)
}

fn surface(key: &'static str, title: &str, energies: [(usize, f64); 3]) -> Surface {
    Surface {
        key,
        title: title.to_owned(),
        shown: energies.map(|(step, w)| (step, Some(w))).to_vec(),
        view: VIEW,
    }
}

/// Adds the L2 distances of the learned operators to the finite elements, where both ran, to captions and metrics.
fn compare_with_finite_elements(
    session: &mut Session<'_>,
    all: &mut [Flowed],
) -> Result<String, Error> {
    let method = |one: &Flowed| one.trajectory.case.operator.method;
    let (elements, mut others): (Vec<_>, Vec<_>) =
        (all.iter_mut()).partition(|one| method(one) == Method::FeImplicit);
    for one in others.iter_mut().filter(|one| method(one).is_learned()) {
        let Some(elements) = elements.iter().find(|e| e.surface.key == one.surface.key) else {
            continue;
        };
        let key = one.key();
        for shown in one.snapshots.iter_mut().filter(|shown| shown.step > 0) {
            let step = shown.step;
            let l2 = one.trajectory.distance(step, &elements.trajectory, step)?;
            shown.caption = format!("{}\nL² distance to FE {l2:.4}", shown.caption);
            session.metric(&format!("{key}.l2_to_fe.step{step}"), l2)?;
        }
    }
    Ok(String::new())
}
