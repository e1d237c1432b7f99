//! A cube and a thick disk under Willmore flow.

use std::process::ExitCode;

use clap::Parser;
use engine::{Method, Operator, Scheme, StepRule, checksum};
use experiments::options::FigureOptions;
use experiments::session::Session;
use experiments::surfaces::{
    self, Flowed, SchemeOptions, Surface, View, centred_box, needed_network, scales,
};
use experiments::{Error, harness};
use geometry::shapes::{Cuboid, Cylinder};
use geometry::{Field, SignedDistanceExt, UpAxis, phase_field};
use serde_json::json;

const PROGRAM: &str = "disk_and_cube";
const TITLE: &str = "Willmore flow of a cube and of a thick disk";
/// Cells per unit length of a quick run and of the paper.
const CELLS: [usize; 2] = [24, 64];
/// Size of a time step.
const TAU: f64 = 1.0 / 262_144.0;
const STEPS: usize = 100;
/// The Willmore energies that the paper reports for the hybrid scheme.
const CUBES: [(usize, f64); 3] = [(0, 132.65), (1, 52.26), (STEPS, 25.78)];
const DISKS: [(usize, f64); 3] = [(0, 87.15), (1, 50.49), (STEPS, 25.59)];
const VIEW: View = View {
    up: UpAxis::Z,
    azimuth: 30.0,
    elevation: 25.0,
};

/// Willmore flow of a cube and of a thick disk, n = 64, eps = 2^-5, tautilde = 2^-12, tau = 2^-18, by the hybrid scheme and by
/// nested implicit finite elements: pictures, Willmore energies w and L2 distances after 0, 1 and 100 steps.
///
/// Runs are kept in the folder `fields` of the output; an interrupted one continues.
#[derive(Parser, Debug)]
#[command(name = PROGRAM, version)]
struct Options {
    #[command(flatten)]
    figure: FigureOptions,

    /// Number of time steps [default: 100]
    #[arg(long, value_name = "COUNT")]
    steps: Option<usize>,

    /// Half the side of the cube; the paper does not say, but its initial energy fits a cube of side 0.5
    #[arg(long, value_name = "LENGTH", default_value_t = 0.25)]
    cube_half_side: f64,

    /// Radius of the disk; the paper does not say, but its initial energy fits about 0.29
    #[arg(long, value_name = "LENGTH", default_value_t = 0.29)]
    disk_radius: f64,

    /// Half the height of the disk; the paper does not say
    #[arg(long, value_name = "LENGTH", default_value_t = 0.1)]
    disk_half_height: f64,

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
    let options = Options::parse();
    harness::run(|| program(&options))
}

fn program(options: &Options) -> Result<(), Error> {
    let Options {
        cube_half_side,
        disk_radius,
        disk_half_height,
        ..
    } = *options;
    let run = &options.figure.run;
    let n = options.figure.cells(CELLS);
    let steps = options.steps.unwrap_or(if run.quick { 2 } else { STEPS });
    if steps == 0 || options.methods.is_empty() {
        return Err(Error::Options(
            "--steps must be at least 1, and --methods must name a method".to_owned(),
        ));
    }
    let device = run.open_device()?;
    let networks = options.figure.networks.load(&[needed_network()])?;
    let network = networks.find(Scheme::Paper, &needed_network())?.network;
    let (grid, scales) = (centred_box(n, 1.0)?, scales(n));
    let cube = Cuboid::new([cube_half_side; 3])?.translated([0.5; 3]);
    let disk = Cylinder::new(disk_radius, disk_half_height)?.translated([0.5; 3]);
    let solids: [(_, _, Field<3>, _); 2] = [
        ("cube", "cube", phase_field(grid, &cube, scales.eps)?, CUBES),
        (
            "disk",
            "thick disk",
            phase_field(grid, &disk, scales.eps)?,
            DISKS,
        ),
    ];
    let variants = options.variants();
    let parameters = json!({
        "n": n, "eps": scales.eps, "mcf_step": scales.mcf_step, "tau": TAU, "steps": steps, "variants": variants,
        "cube_half_side": cube_half_side, "disk_radius": disk_radius, "disk_half_height": disk_half_height,
        "network": checksum(&network), "quick": run.quick,
    });
    let mut session = Session::open(PROGRAM, run, device, &parameters)?;
    let mut all = Vec::new();
    for (key, title, initial, papers) in &solids {
        for &(method, scheme) in &variants {
            let needed = needed_network();
            let networks = networks.of(scheme);
            let operator = Operator::new((method, scheme), &networks, &needed, &grid, &scales)?;
            let comparable = (method, scheme) == (Method::Hybrid, Scheme::Paper);
            let time = (StepRule::Constant(TAU), steps);
            let case = surfaces::willmore_flow(title, initial.clone(), operator, scales, time);
            let surface = Surface {
                key,
                title: (*title).to_owned(),
                shown: papers
                    .map(|(step, w)| (step, comparable.then_some(w)))
                    .to_vec(),
                view: VIEW,
            };
            all.push(surface.flow(case, &mut session)?);
        }
    }
    compare_with_finite_elements(&mut all)?;
    let note = format!(
        "n = {n}, ε = 2/n, inner step 1/n², τ = 2⁻¹⁸. w: Willmore energy with the implicit finite-element step; a sphere has 8π = 25.13."
    );
    let table = surfaces::write(&mut session, TITLE, note, &all)?;
    session.finish(TITLE, surfaces::summary(&all)?, &table)
}

/// Adds the L2 distances between the learned operators and the finite elements, where both ran, to captions and metrics.
fn compare_with_finite_elements(all: &mut [Flowed]) -> Result<(), Error> {
    let method = |one: &Flowed| one.trajectory.case.operator.method;
    for k in 0..all.len() {
        let is_partner = |one: &&Flowed| {
            one.surface.key == all[k].surface.key && method(one) == Method::FeImplicit
        };
        let Some(elements) = all
            .iter()
            .find(is_partner)
            .filter(|_| method(&all[k]).is_learned())
        else {
            continue;
        };
        let shown = all[k].snapshots.iter().map(|shown| shown.step).enumerate();
        let distance = |(shown, step)| {
            Ok((
                shown,
                step,
                all[k]
                    .trajectory
                    .distance(step, &elements.trajectory, step)?,
            ))
        };
        let distances = shown
            .filter(|(_, step)| *step > 0)
            .map(distance)
            .collect::<Result<Vec<_>, Error>>()?;
        for (shown, step, l2) in distances {
            all[k].snapshots[shown].caption += &format!("\nL² distance to FE {l2:.4}");
            all[k].metrics.push((format!("l2_to_fe.step{step}"), l2));
        }
    }
    Ok(())
}
