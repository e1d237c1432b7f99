//! Inpainting, in any dimension: Willmore flow of the values in a region, the rest held.

use report::Rgb;

use crate::prelude::*;

/// What is said about inpainting.
pub const METRICS: MetricTable = MetricTable {
    title: "Inpainting",
    note: "",
    words: &[],
    rows: &[
        (
            "SHAPE.distance.stepK",
            "L2 distance to the whole disk or ball; for the cross and the tubes to the initial shape",
        ),
        (
            "SHAPE.changed_outside",
            "nodes outside the region whose bits changed; 0 is right",
        ),
        ("SHAPE.steps", "time steps until the shape was stationary"),
        (
            "SHAPE.still_from",
            "time, in the paper's steps, from which on the shape is stationary",
        ),
        (
            "SHAPE.parts_of_step1",
            "substeps into which the first step was divided",
        ),
        ("SHAPE.hvp_per_part", "Hessian-vector products per substep"),
        (
            "SHAPE.energy_increases, SHAPE.seconds",
            "substeps in which the energy rose, wall time of all of them",
        ),
    ],
};

/// A shape is stationary once it moves by less than this part of the way it has come per step.
const STILL: f64 = 1e-5;
/// The first substep of the first step, in units of `eps^4`: the time in which a corner becomes about as round as the interface is wide.
const FIRST_SUBSTEP: f64 = 32.0;
/// Colour of the region in the pictures.
pub const GREEN: Rgb = Rgb(0, 140, 60);

#[derive(Args, Clone, Debug)]
pub struct InpaintingOptions {
    #[command(flatten)]
    pub figure: FigureOptions,

    /// Weights of the energy and network: paper, calibrated or accurate
    #[arg(long = "scheme", value_name = "NAME", value_enum, default_value_t = Formulation::Accurate)]
    pub formulation: Formulation,
}

pub struct Shape<const D: usize> {
    /// Prefix of its metrics and files.
    pub key: &'static str,
    pub title: &'static str,
    /// The shape with its fault.
    pub initial: Box<dyn SignedDistance<D>>,
    /// What it should become, if that is known.
    pub whole: Option<Box<dyn SignedDistance<D>>>,
    /// Where it may change: `D` holds the points all of whose coordinates lie between these.
    pub region: [f64; 2],
    /// Sizes of the steps, which are made in substeps,
    pub rule: StepRule,
    /// and most of them.
    pub steps: usize,
    pub shown: Vec<usize>,
}

impl<const D: usize> Shape<D> {
    pub fn case(&self, grid: Grid<D>, scales: Scales, operator: &Operator<D>) -> Result<Case<D>> {
        let [low, high] = self.region;
        let moves = |node| grid.node(node).iter().all(|x| low < *x && *x < high);
        let title = format!("inpainted {}", self.title);
        let initial = phase_field(grid, &self.initial, scales.eps)?;
        let (operator, rule) = (operator.clone(), self.rule);
        let mut case = Case::willmore(&title, initial, operator, scales, rule, self.steps);
        case.region = Some((0..grid.len()).map(moves).collect());
        case.steps.first_substep = Some(first_substep(scales.eps));
        case.stops.insert(0, Stop::Motion(STILL));
        Ok(case)
    }
}

fn first_substep(eps: f64) -> f64 {
    FIRST_SUBSTEP * eps.powi(4)
}

pub fn parameters<const D: usize>(
    n: usize,
    scales: &Scales,
    operator: &Operator<D>,
    shapes: &[Shape<D>],
) -> Value {
    json!({
        "n": n, "eps": scales.eps, "mcf_step": scales.mcf_step, "scheme": operator.discretization.formulation,
        "shapes": shapes.iter().map(|shape| shape.key).collect::<Vec<_>>(),
        "tau": shapes.iter().map(|shape| shape.rule).collect::<Vec<_>>(),
        "steps": shapes.iter().map(|shape| shape.steps).collect::<Vec<_>>(),
        "first_substep": first_substep(scales.eps), "still": STILL,
        "network": operator.network().map(|named| named.network.fingerprint()),
    })
}

pub struct Inpainted<'a, const D: usize> {
    pub shape: &'a Shape<D>,
    pub trajectory: &'a Trajectory<D>,
    /// The distance to what it should become, or to the beginning, at the steps that are shown and at the last one.
    pub distances: Vec<(usize, f64)>,
    /// Nodes outside the region whose bits changed.
    changed_outside: usize,
}

impl<'a, const D: usize> Inpainted<'a, D> {
    pub fn measure(shape: &'a Shape<D>, trajectory: &'a Trajectory<D>) -> Result<Self> {
        let (case, steps) = (&trajectory.case, trajectory.steps());
        let start = case.initial.field()?;
        let goal = match &shape.whole {
            Some(whole) => phase_field(*case.grid(), whole, case.scales.eps)?,
            None => start.clone(),
        };
        let mut distances = Vec::new();
        let shown = shape.shown.iter().copied().filter(|&k| k < steps);
        for k in shown.chain([steps]) {
            distances.push((k, l2_distance(&trajectory.field(k)?, &goal)?));
        }
        let (last, moves) = (
            trajectory.field(steps)?,
            case.region.iter().flat_map(NodeSet::iter),
        );
        let values = last.values().iter().zip(start.values());
        let changed_outside = values
            .zip(moves)
            .filter(|((u, start), inside)| !inside && u.to_bits() != start.to_bits())
            .count();
        Ok(Self {
            shape,
            trajectory,
            distances,
            changed_outside,
        })
    }

    /// The paper's time step.
    pub fn tau(&self) -> f64 {
        self.shape.rule.size(1)
    }

    /// The time in the paper's steps from which on the shape is stationary, if it is.
    pub fn still_from(&self) -> Option<f64> {
        let last = self.trajectory.records.last()?;
        let stands_still = matches!(self.trajectory.ended, Stop::Motion(_));
        stands_still.then_some((last.time - last.tau) / self.tau())
    }
}

/// Writes the energies, the records of all steps, the table of distances and the metrics, and ends the program.
pub fn finish<const D: usize>(
    mut session: Session,
    title: &str,
    all: &[Inpainted<'_, D>],
) -> Result<()> {
    let energies = all.iter().map(|one| {
        let point = |r: &Record| Some([r.time, r.willmore_energy()?]);
        let points: Vec<_> = one.trajectory.records.iter().filter_map(point).collect();
        let (time, w) = (Axis::log("time t"), Axis::linear("Willmore energy w"));
        LineChart::new(one.shape.title, time, w).with_curves([Series::new("", points)])
    });
    let energies = Figure::new("Willmore energy while inpainting", 2).with_panels(energies);
    session.figure(energies, "energies")?;
    let runs = all.iter().map(|one| (one.shape.key, one.trajectory));
    step_table::write(&session, "shape", runs)?;
    let mut rows = Vec::new();
    for one in all {
        for &(step, distance) in &one.distances {
            rows.push((one, step, distance, one.trajectory.record(step)));
        }
    }
    let head = "L² distance to the whole, or to the start";
    let shown = Sheet::of(&rows)
        .keyed(|(one, step, ..), name| format!("{}.{name}.step{step}", one.shape.key))
        .text("shape", |(one, ..)| one.shape.title)
        .column("step", Shortest, |(_, step, ..)| *step)
        .column("time in steps", Shortest, |(one, .., record)| {
            record.map_or(0.0, |r| r.time / one.tau())
        })
        .measure("distance", head, Fixed(5), |(.., distance, _)| *distance)
        .column("Willmore energy", Fixed(3), |(.., record)| {
            record.and_then(Record::willmore_energy)
        });
    session.sheet(shown, "inpainting")?;
    for one in all {
        let (trajectory, records) = (one.trajectory, &one.trajectory.records);
        let metrics = [
            ("energy_increases", energy_increases(records).into()),
            ("changed_outside", one.changed_outside.into()),
            ("steps", trajectory.steps().into()),
            ("parts_of_step1", trajectory.substeps(1).len().into()),
            ("still_from", one.still_from().into()),
            ("hvp_per_part", mean_hvp(records).into()),
            ("seconds", trajectory.seconds().into()),
        ];
        session.metrics(one.shape.key, metrics)?;
    }
    session.finish(title)
}
