use direct::DirectParams;
use geometry::{DistanceRange, Redistanced, distance_from_phase_field};
use rand::{RngExt, SeedableRng};
use reference::{Curve, Shape, planar, revolution};

use crate::circles;
use crate::prelude::*;
use crate::truth::{self, Course, STRICT};

pub const EXPERIMENT: Experiment = Experiment {
    name: "direct_step",
    summary: "Steps of Willmore flow without a minimization, against the exact flow and other steps.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "direct_step",
        title: "Direct steps",
        description: "The outlook of the paper: a step of Willmore flow without a minimization, by one convolution and distances. Compared with \
                 minimizations and finite elements on exact flows, in the plane and in space.",
        figures: &[
            (
                "curves",
                "Largest distance from the exact curve on the way against convolutions of the grid.",
            ),
            ("seconds", "The same against wall time."),
            (
                "surfaces",
                "Largest distance from the exact surface, in spacings of the grid, and the error of the energy.",
            ),
        ],
        options: Some(""),
    }],
    metrics: &[&METRICS],
    words: &[
        (
            "SURFACE",
            "`ellipsoid`, 3:2, `disk`, the thick disk from the exact surface at 8 2^-14 on",
        ),
        (
            "START",
            "`cross32`, `rectangle32`: the exact curve at t = 32 2^-14, run to 128 2^-14; `cross`, `rectangle`: from the corners to that time; \
         `ellipse`, `random`: smooth curves, until half of the way to the circle",
        ),
    ],
};

const METRICS: MetricTable = MetricTable {
    title: "Direct steps",
    note: "",
    words: &[(
        "STEPS",
        "`direct0.004`, `direct0.002`, `direct0.001`, `direct0.0007` and `direct0.0005`, direct steps by their longest part over the fourth power of the reach; `controlled` and \
         `controlled_strict`, minimizations of second order; `euler1` and `euler2`, implicit Euler with so many steps in 2^-14; `elements`, implicit \
         Euler with nested finite elements; `then_direct`, second order to 8 2^-14 and then direct",
    )],
    rows: &[
        (
            "START.nN.STEPS.distance, START.nN.STEPS.convolutions, START.nN.STEPS.steps, START.nN.STEPS.seconds",
            "largest distance of the zero level from the exact curve at four times, convolutions of the grid, of which a Hessian-vector product counts \
             as four, and time steps or parts of them. The box of direct runs of the cross has the side 3 in place of 2, but for `direct0.004` with N = 128",
        ),
        (
            "START.nN.direct.order",
            "observed order in the longest part of a step, between 0.002 and 0.001",
        ),
        (
            "ellipse.half_time, random.half_time",
            "the time of half of the way to the circle",
        ),
        (
            "circles.nN.STEPS.l2, circles.nN.STEPS.convolutions",
            "mean L2 error of the 30 circles of `circle_convergence` after the time `64 2^-14`, and mean convolutions",
        ),
        (
            "waves.amplitude.start, waves.amplitude.end, waves.parts",
            "amplitude of waves on a circle, and what is left of it after so many parts of steps",
        ),
        (
            "sphere.nN.drift, sphere.nN.parts",
            "change of the radius of a sphere of radius 0.3, over that, after so many parts of steps",
        ),
        (
            "SURFACE.nN.STEPS.distance.stepK, SURFACE.nN.STEPS.energy_error.stepK, SURFACE.nN.STEPS.convolutions.stepK",
            "largest distance of the zero level from the exact surface in spacings of the grid, and the relative error of its energy, at `t = K 2^-14`",
        ),
    ],
};

const TITLE: &str = "Direct steps of Willmore flow";

/// With their colours and marks in the figures.
const KINDS: [(&str, usize, Marker); 4] = [
    (DIRECT, 0, Marker::Circle),
    (CONTROLLED, 2, Marker::Triangle),
    (EULER, 1, Marker::Square),
    (NESTED, 4, Marker::Diamond),
];
const DIRECT: &str = "direct steps";
const CONTROLLED: &str = "second order, controlled steps";
const EULER: &str = "implicit Euler, equal steps";
const NESTED: &str = "finite elements, implicit Euler";

/// The longest parts of direct steps, over the fourth power of the reach.
const LONGEST: [f64; 4] = [4e-3, 2e-3, 1e-3, 5e-4];
/// Times at which a run is compared, besides its start.
const TIMES: usize = 4;
/// When corners are smooth enough for direct steps, in units of `2^-14`.
const SMOOTH: usize = 8;

/// Willmore flow of curves and surfaces by direct steps, by minimizations and by finite elements, against the exact flow: crosses and rectangles
/// from their corners and from a smooth state, an ellipse and a random curve until half of the way to the circle, circles, waves on a circle, a
/// sphere, an ellipsoid and a thick disk.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,
}

fn program(Options { run: options }: &Options) -> Result<()> {
    let parameters = json!({ "longest": LONGEST, "time_unit": STEP, "eps_over_h": 2 });
    let mut session = Session::open(EXPERIMENT.name, options, parameters)?;
    let mut rows = Vec::new();
    for start in starts(options.quick)? {
        rows.extend(start.compare(&mut session)?);
    }
    circles(&mut session)?;
    waves(&mut session)?;
    sphere(&mut session)?;
    let surfaces = surfaces(&mut session)?;
    session.figure(curves(&rows, "convolutions"), "curves")?;
    session.figure(curves(&rows, "seconds"), "seconds")?;
    session.figure(surfaces_figure(&surfaces), "surfaces")?;
    session.sheet(sheet(&rows), "curves")?;
    session.finish(TITLE)
}

/// A way to make time steps.
#[derive(Clone, Copy)]
enum Way {
    /// Direct steps with this longest part.
    Direct(f64),
    /// Second order, controlled.
    Controlled(&'static str, ErrorControl),
    /// Implicit Euler with so many steps in `2^-14`.
    Euler(f64),
    /// The same with nested finite elements.
    Elements,
    /// Second order until the shape is smooth, and then direct.
    ThenDirect(f64),
}

impl Way {
    fn key(self) -> String {
        match self {
            Self::Direct(longest) => format!("direct{longest}"),
            Self::Controlled(name, _) => name.to_owned(),
            Self::Euler(parts) => format!("euler{parts}"),
            Self::Elements => "elements".to_owned(),
            Self::ThenDirect(_) => "then_direct".to_owned(),
        }
    }

    fn kind(self) -> &'static str {
        match self {
            Self::Direct(_) | Self::ThenDirect(_) => DIRECT,
            Self::Controlled(..) => CONTROLLED,
            Self::Euler(_) => EULER,
            Self::Elements => NESTED,
        }
    }

    fn discretization(self) -> Discretization {
        match self {
            Self::Elements => ELEMENTS,
            _ => ACCURATE,
        }
    }

    /// The time steps of a run that is compared at multiples of `every`.
    fn steps(self, every: f64) -> TimeSteps {
        let equal = |parts: f64| TimeSteps::from(StepRule::Constant(every / parts));
        // As many to each comparison as have nearly the wanted size.
        let parts = |tau: f64| (every / tau).round().max(1.0);
        match self {
            Self::Direct(longest) | Self::ThenDirect(longest) => {
                TimeSteps::direct(StepRule::Constant(every), DirectParams { longest })
            }
            Self::Controlled(_, control) => TimeSteps {
                order: Order::Controlled(control),
                ..equal(1.0)
            },
            Self::Euler(steps) => equal(parts(STEP / steps)),
            Self::Elements => equal(parts(4.0 * STEP)),
        }
    }
}

/// Where a comparison in the plane starts, and the exact flow from there.
struct Start {
    key: &'static str,
    title: &'static str,
    /// Side of the box.
    side: f64,
    /// Times of the exact flow since its own start, at the start of the run and at equal times after it.
    times: Vec<f64>,
    exact: Vec<Curve>,
    /// The phase field of the start, where the exact curve has corners.
    corners: Option<fn(Grid<2>, f64) -> Result<Field<2>, geometry::Error>>,
    /// Whether direct runs on the coarser grid have a box of side 3, so that kernels do not see the periodic images.
    wide: bool,
    quick: bool,
}

/// The largest errors and the work of a run.
struct Row {
    start: &'static str,
    title: &'static str,
    n: usize,
    way: Way,
    numbers: Numbers,
}

fn starts(quick: bool) -> Result<Vec<Start>> {
    let mut all = Vec::new();
    for (sample, smooth) in [(truth::CROSS, "cross32"), (truth::RECTANGLE, "rectangle32")] {
        for from in [32, 0] {
            let times =
                (0..=TIMES).map(|k| time(from) + time(128 - from) * k as f64 / TIMES as f64);
            let times: Vec<f64> = times.collect();
            let evolved = if from == 0 { &times[1..] } else { &times[..] };
            let willmore = reference::Flow::Willmore;
            let exact = planar::evolve(&(sample.curve)()?, willmore, evolved, &planar::ACCURACY)?;
            all.push(Start {
                key: if from == 0 { sample.key } else { smooth },
                title: sample.title,
                side: sample.side,
                times,
                exact,
                corners: (from == 0).then_some(sample.initial),
                wide: sample.side > 1.8,
                quick,
            });
        }
    }
    let smooth = [
        ("ellipse", "Ellipse", Shape::ellipse(0.3, 0.2)?),
        ("random", "Random curve", random()?),
    ];
    for (key, title, shape) in smooth {
        let times = to_half(&shape)?;
        let willmore = reference::Flow::Willmore;
        let exact = planar::evolve(&shape, willmore, &times, &planar::ACCURACY)?;
        all.push(Start {
            key,
            title,
            side: 1.5,
            times,
            exact,
            corners: None,
            wide: false,
            quick,
        });
    }
    Ok(if quick { all.split_off(4) } else { all })
}

/// A smooth closed curve with random coefficients, which nothing was fitted to.
fn random() -> Result<Shape> {
    const SEED: u64 = 20_261_128;
    let mut random = chacha20::ChaCha8Rng::seed_from_u64(SEED);
    let waves: Vec<[f64; 2]> = (2..6_i32)
        .map(|wave| {
            let size = random.random_range(0.5..1.0) * 0.35 / f64::from(wave * wave);
            [size, random.random_range(0.0..2.0 * PI)]
        })
        .collect();
    let point = |i: usize| {
        let angle = 2.0 * PI * i as f64 / 256.0;
        let of_wave =
            |(k, [size, phase]): (usize, &[f64; 2])| size * ((k + 2) as f64 * angle + phase).cos();
        let radius = 0.33 * (1.0 + waves.iter().enumerate().map(of_wave).sum::<f64>());
        [radius * angle.cos(), radius * angle.sin()]
    };
    Ok(Shape::smooth(&(0..256).map(point).collect::<Vec<_>>())?)
}

/// Equal times from the start until the distances from the centre differ by half as much.
fn to_half(shape: &Shape) -> Result<Vec<f64>> {
    const FIRST: f64 = 1e-9;
    const FACTOR: f64 = 1.05;
    let times: Vec<f64> = (0..300).map(|k| FIRST * FACTOR.powi(k)).collect();
    let curves = planar::evolve(shape, reference::Flow::Willmore, &times, &planar::ACCURACY)?;
    let spread = |curve: &Curve| {
        let [x, y] = curve.centre();
        let radii = curve
            .points()
            .into_iter()
            .map(|p| (p[0] - x).hypot(p[1] - y));
        let (least, most) = radii.fold((f64::INFINITY, 0.0_f64), |(a, b), r| (a.min(r), b.max(r)));
        most - least
    };
    let first = spread(&curves[0]);
    let half = curves.iter().find(|curve| spread(curve) <= 0.5 * first);
    let end = half.map_or(times[times.len() - 1], Curve::time);
    Ok((0..=TIMES)
        .map(|k| FIRST + (end - FIRST) * k as f64 / TIMES as f64)
        .collect())
}

impl Start {
    /// The ways of this start, each with cells per unit length and the side of its box.
    fn ways(&self) -> Vec<(usize, f64, Way)> {
        let [coarse, fine] = if self.quick { [32, 64] } else { truth::CELLS };
        let mut all = Vec::new();
        // At corners parts are short, and on the finer grid there are many of them.
        let longest = match (self.quick, &self.corners) {
            (true, _) => &LONGEST[..1],
            (false, Some(_)) => &LONGEST[..2],
            (false, None) => &LONGEST[..],
        };
        for &longest in longest {
            let side = if self.wide { 3.0 } else { self.side };
            all.push((coarse, side, Way::Direct(longest)));
            // In a small box kernels see the periodic images unless parts are short.
            if self.corners.is_none() && (!self.wide || longest > 3e-3) {
                all.push((fine, self.side, Way::Direct(longest)));
            }
        }
        let controlled = Way::Controlled("controlled", ErrorControl::default());
        if self.quick {
            all.push((coarse, self.side, controlled));
            return all;
        }
        for n in [coarse, fine] {
            let strict = Way::Controlled("controlled_strict", STRICT);
            let others = [controlled, strict, Way::Euler(1.0), Way::Euler(2.0)];
            all.extend(others.map(|way| (n, self.side, way)));
        }
        all.push((coarse, self.side, Way::Elements));
        if self.corners.is_some() {
            let side = if self.wide { 3.0 } else { self.side };
            all.push((fine, side, Way::ThenDirect(1e-3)));
        }
        all
    }

    fn initial(&self, grid: Grid<2>) -> Result<Field<2>> {
        let eps = 2.0 * grid.spacing();
        Ok(match self.corners {
            Some(initial) => initial(grid, eps)?,
            None => phase_field(grid, &self.exact[0].signed_distance(), eps)?,
        })
    }

    /// Runs all ways from this start, and records what they reach.
    fn compare(&self, session: &mut Session) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        if self.corners.is_none() && !self.key.ends_with("32") {
            session.metric(&format!("{}.half_time", self.key), self.times[TIMES])?;
        }
        for (n, side, way) in self.ways() {
            let numbers = self.run(session, n, side, way)?;
            rows.push(Row {
                start: self.key,
                title: self.title,
                n,
                way,
                numbers,
            });
        }
        for n in truth::CELLS {
            let direct = |row: &&Row| row.n == n && matches!(row.way, Way::Direct(_));
            let errors: Vec<f64> = rows
                .iter()
                .filter(direct)
                .map(|row| row.numbers["distance"])
                .collect();
            if let [_, longer, shorter, _] = errors[..] {
                let name = format!("{}.n{n}.direct.order", self.key);
                session.metric(&name, (longer / shorter).log2())?;
            }
        }
        Ok(rows)
    }

    /// The largest error of a run at the times, and its work.
    fn run(&self, session: &mut Session, n: usize, side: f64, way: Way) -> Result<Numbers> {
        let grid = Grid::<2>::per_unit(n, side)?;
        let (mut begin, mut work) = (self.times[0], Numbers::new());
        let mut field = self.initial(grid)?;
        let name = |part: &str| format!("{}-n{n}-{}{part}", self.key, way.key());
        if let Way::ThenDirect(_) = way {
            let controlled = Way::Controlled("", ErrorControl::default());
            let until = Times::once(time(SMOOTH));
            let run = self.course(session, &name("-before"), field, controlled, until)?;
            (field, begin) = (run.field(run.steps())?, time(SMOOTH));
            add(&mut work, &run.records);
        }
        let mut largest = 0.0_f64;
        let exact = self.exact.iter().rev().take(TIMES).rev();
        let mut parts: Vec<(f64, &Curve)> = self.times[1..].iter().copied().zip(exact).collect();
        if begin > self.times[0] {
            let until = Times::once(self.times[1] - begin);
            let run = self.course(session, &name("-first"), field, way, until)?;
            add(&mut work, &run.records);
            field = run.field(run.steps())?;
            largest = largest.max(distance(parts[0].1, &field));
            begin = parts.remove(0).0;
        }
        let times = Times {
            every: self.times[1] - self.times[0],
            end: self.times[TIMES] - begin,
        };
        let run = self.course(session, &name(""), field, way, times)?;
        add(&mut work, &run.records);
        for (at, exact) in parts {
            let step = truth::at(&run, at - begin).step;
            largest = largest.max(distance(exact, &run.field(step)?));
        }
        work.insert("distance", largest);
        Ok(work)
    }

    /// A run from a phase field until a time, which stops at multiples of another one.
    fn course(
        &self,
        session: &mut Session,
        name: &str,
        field: Field<2>,
        way: Way,
        times: Times,
    ) -> Result<Trajectory<2>> {
        let (steps, end) = (way.steps(times.every), times.end);
        let course = Course { name, steps, end };
        truth::flow(session, self.key, field, 2.0, way.discretization(), course)
    }
}

/// Until when a run goes, and when it stops on the way.
#[derive(Clone, Copy)]
struct Times {
    every: f64,
    end: f64,
}

impl Times {
    /// Without a stop.
    fn once(end: f64) -> Self {
        Self { every: end, end }
    }
}

/// Adds the work of the records of a run.
fn add(work: &mut Numbers, records: &[Record]) {
    let direct = |record: &Record| record.direct().map(|direct| direct.convolutions as f64);
    let convolutions =
        |record: &Record| direct(record).unwrap_or(4.0 * record.hvp().unwrap_or(0.0));
    let steps = |record: &Record| record.direct().map_or(1.0, |direct| direct.parts as f64);
    *work.entry("convolutions").or_default() += records.iter().map(convolutions).sum::<f64>();
    *work.entry("seconds").or_default() += records.iter().map(|record| record.seconds).sum::<f64>();
    *work.entry("steps").or_default() += records.iter().map(steps).sum::<f64>();
}

/// The largest distance of the zero level of a phase field from a curve.
fn distance(exact: &Curve, field: &Field<2>) -> f64 {
    exact.largest_distance_of(&level(field))
}

/// Points of the zero level of a phase field of two cells to `eps`, to sixth order.
fn level<const D: usize>(field: &Field<D>) -> Vec<[f64; D]> {
    let grid = *field.grid();
    let distance = |u| distance_from_phase_field(u, 2.0 * grid.spacing());
    let range = DistanceRange {
        precise: 0.0,
        largest: grid.spacing(),
    };
    let made = Redistanced::from_distances(grid, field.map(distance).values(), range);
    made.points.iter().map(|point| point.position).collect()
}

/// The circles of `circle_convergence` at n = 128 by direct steps and by controlled ones: their mean L2 error, and mean convolutions.
fn circles(session: &mut Session) -> Result<()> {
    let (count, steps) = session
        .options
        .either((2, 4), (circles::COUNT, circles::STEPS));
    let n = truth::CELLS[1];
    let ways = [
        Way::Direct(2e-3),
        Way::Direct(1e-3),
        Way::Direct(7e-4),
        Way::Controlled("controlled", ErrorControl::default()),
    ];
    for way in &ways[..session.options.either(1, ways.len())] {
        let (mut l2, mut work) = (0.0, Numbers::new());
        for (k, radius) in circles::radii(count).into_iter().enumerate() {
            let grid = wide_grid(radius, steps, n)?;
            let disc = |radius| phase_field(grid, &Ball::new([0.0; 2], radius)?, EPS);
            let course = Course {
                name: &format!("circle{k:02}-{}", way.key()),
                steps: way.steps(time(steps)),
                end: time(steps),
            };
            let initial = disc(radius)?;
            let run = truth::flow(
                session,
                "circle",
                initial,
                2.0,
                way.discretization(),
                course,
            )?;
            let exact = disc(circles::radius_at(Flow::Willmore, radius, time(steps)))?;
            l2 += l2_distance(&run.field(run.steps())?, &exact)? / count as f64;
            add(&mut work, &run.records);
        }
        let convolutions = work["convolutions"] / count as f64;
        let metrics = [("l2", l2.into()), ("convolutions", convolutions.into())];
        session.metrics(&format!("circles.n{n}.{}", way.key()), metrics)?;
    }
    Ok(())
}

/// A box in which a circle is as far from its periodic images as from its centre.
fn wide_grid(radius: f64, steps: usize, n: usize) -> Result<Grid<2>> {
    let last = circles::radius_at(Flow::Willmore, radius, time(steps));
    // Numbers of cells that are good for Fourier transforms.
    let cells = ((4.0 * last * n as f64) / 32.0).ceil() as usize * 32;
    Ok(Grid::centred(cells, cells as f64 / n as f64)?)
}

/// Waves on a circle over more than a thousand parts of steps: what is left of them.
fn waves(session: &mut Session) -> Result<()> {
    const RADIUS: f64 = 0.35;
    const AMPLITUDE: f64 = 1e-3;
    const LENGTH: f64 = 2e-4;
    let parts = session.options.either(50.0, 1200.0);
    let grid = Grid::<2>::per_unit(64, 1.5)?;
    let shape = |x: [f64; 2]| {
        let angle = x[1].atan2(x[0]);
        let wave = |k: f64| (k * angle + k).cos();
        x[0].hypot(x[1]) - RADIUS - AMPLITUDE * (wave(5.0) + wave(11.0) + wave(23.0))
    };
    let initial = phase_field(grid, &shape, 2.0 * grid.spacing())?;
    let amplitude = |field: &Field<2>| {
        let radii: Vec<f64> = level(field).iter().map(|x| x[0].hypot(x[1])).collect();
        let extent = radii
            .iter()
            .fold([f64::INFINITY, 0.0_f64], |[a, b], r| [a.min(*r), b.max(*r)]);
        0.5 * (extent[1] - extent[0])
    };
    let before = amplitude(&initial);
    let course = Course {
        name: "waves",
        steps: Way::Direct(LENGTH).steps(parts / 20.0 * LENGTH * RADIUS.powi(4)),
        end: parts * LENGTH * RADIUS.powi(4),
    };
    let run = truth::flow(session, "waves", initial, 2.0, ACCURATE, course)?;
    let mut work = Numbers::new();
    add(&mut work, &run.records);
    let after = amplitude(&run.field(run.steps())?);
    session.metrics(
        "waves",
        [
            ("amplitude.start", before.into()),
            ("amplitude.end", after.into()),
            ("parts", work["steps"].into()),
        ],
    )
}

/// A sphere, which is at rest, over two hundred parts of steps.
fn sphere(session: &mut Session) -> Result<()> {
    const RADIUS: f64 = 0.3;
    const LONGEST_PART: f64 = 1e-3;
    let (n, parts) = session.options.either((32, 10.0), (64, 200.0));
    let grid = Grid::<3>::per_unit(n, 1.25)?;
    let initial = phase_field(grid, &Ball::new([0.0; 3], RADIUS)?, 2.0 * grid.spacing())?;
    let end = parts * LONGEST_PART * RADIUS.powi(4);
    let course = Course {
        name: "sphere",
        steps: Way::Direct(LONGEST_PART).steps(end / 5.0),
        end,
    };
    let run = truth::flow(session, "sphere", initial, 2.0, ACCURATE, course)?;
    let mut work = Numbers::new();
    add(&mut work, &run.records);
    let radius = |x: &[f64; 3]| (x[0].hypot(x[1]).hypot(x[2]) / RADIUS - 1.0).abs();
    let drift = level(&run.field(run.steps())?)
        .iter()
        .map(radius)
        .fold(0.0, f64::max);
    let metrics = [("drift", drift.into()), ("parts", work["steps"].into())];
    session.metrics(&format!("sphere.n{n}"), metrics)
}

/// What a run of a surface has reached at a time.
struct SurfaceRow {
    title: &'static str,
    n: usize,
    way: Way,
    time: f64,
    /// Largest distance in spacings, and relative error of the energy.
    distance: f64,
    energy_error: f64,
}

fn surfaces(session: &mut Session) -> Result<Vec<SurfaceRow>> {
    let quick = session.options.quick;
    let mut rows = Vec::new();
    let ellipsoid = SurfaceStart {
        key: "ellipsoid",
        title: "Ellipsoid 3:2",
        side: 1.25,
        shape: (truth::ELLIPSOID.curve)()?,
        from: 1e-9,
        marks: vec![1, 2, 4, 8],
    };
    let disk = SurfaceStart {
        key: "disk",
        title: "Thick disk",
        side: truth::DISK.side,
        shape: (truth::DISK.curve)()?,
        from: time(8),
        marks: vec![9, 10, 12],
    };
    let controlled = Way::Controlled("controlled", ErrorControl::default());
    let sizes: &[usize] = if quick { &[32] } else { &[32, 64] };
    for start in &[ellipsoid, disk][..if quick { 1 } else { 2 }] {
        for &n in sizes {
            rows.extend(start.compare(session, n, Way::Direct(2e-3))?);
            if !quick {
                rows.extend(start.compare(session, n, controlled)?);
            }
        }
    }
    Ok(rows)
}

/// Where a comparison in space starts: a surface of revolution.
struct SurfaceStart {
    key: &'static str,
    title: &'static str,
    side: f64,
    shape: Shape,
    /// The time of the exact flow at the start of the run, and the times at which they are compared, in units of `2^-14`.
    from: f64,
    marks: Vec<usize>,
}

impl SurfaceStart {
    fn compare(&self, session: &mut Session, n: usize, way: Way) -> Result<Vec<SurfaceRow>> {
        let marks = self.marks.iter().map(|mark| time(*mark));
        let times: Vec<f64> = std::iter::once(self.from).chain(marks).collect();
        let willmore = reference::Flow::Willmore;
        let exact = revolution::evolve(&self.shape, willmore, &times, &revolution::ACCURACY)?;
        let grid = Grid::<3>::per_unit(n, self.side)?;
        let profile = exact[0].profile().signed_distance();
        let body = move |[x, y, z]: [f64; 3]| profile([x.hypot(y), z]);
        let mut field = phase_field(grid, &body, 2.0 * grid.spacing())?;
        let (mut work, mut rows) = (Numbers::new(), Vec::new());
        for (k, exact) in exact.iter().enumerate().skip(1) {
            let end = times[k] - times[k - 1];
            let course = Course {
                name: &format!("{}-n{n}-{}-{k}", self.key, way.key()),
                steps: way.steps(end),
                end,
            };
            let run = truth::flow(session, self.key, field, 2.0, ACCURATE, course)?;
            add(&mut work, &run.records);
            field = run.field(run.steps())?;
            let points = level(&field).into_iter();
            let points: Vec<[f64; 2]> = points.map(|[x, y, z]| [x.hypot(y), z]).collect();
            let distance = exact.profile().largest_distance_of(&points) / grid.spacing();
            let energy = ZeroSet::of(&field, 2.0 * grid.spacing())?.willmore_energy;
            let energy_error = (energy / exact.energy() - 1.0).abs();
            let key = format!("{}.n{n}.{}", self.key, way.key());
            let mark = self.marks[k - 1];
            for (name, value) in [
                ("distance", distance),
                ("energy_error", energy_error),
                ("convolutions", work["convolutions"]),
            ] {
                session.metric(&format!("{key}.{name}.step{mark}"), value)?;
            }
            rows.push(SurfaceRow {
                title: self.title,
                n,
                way,
                time: times[k] / STEP,
                distance,
                energy_error,
            });
        }
        Ok(rows)
    }
}

const COLUMNS: [(&str, Format, &str); 4] = [
    ("largest distance", Scientific(2), "distance"),
    ("convolutions", Fixed(0), "convolutions"),
    ("steps", Fixed(0), "steps"),
    ("s", Fixed(1), "seconds"),
];

fn sheet(rows: &[Row]) -> Sheet<'_, Row> {
    let key = |row: &Row, name: &str| format!("{}.n{}.{}.{name}", row.start, row.n, row.way.key());
    Sheet::of(rows)
        .keyed(key)
        .text("start", |row| row.start)
        .column("n", Shortest, |row| row.n)
        .text("time steps", |row| row.way.key())
        .numbers(&COLUMNS, |row| &row.numbers)
}

/// Largest distances from the exact curves against work, a number of this name.
fn curves(rows: &[Row], work: &str) -> Figure {
    let mut panels: Vec<(&str, &str)> = rows.iter().map(|row| (row.start, row.title)).collect();
    panels.dedup();
    let mut figure = Figure::new(format!("{TITLE}: work and precision"), 2);
    for (start, title) in panels {
        let from = match start {
            "cross" | "rectangle" => "from the corners",
            "ellipse" | "random" => "half of the way to the circle",
            _ => "from t = 32·2⁻¹⁴",
        };
        let mut lines: Vec<Series> = Vec::new();
        for (style, grid, fine) in [
            (LineStyle::Dashed, "coarse", false),
            (LineStyle::Solid, "fine", true),
        ] {
            for (kind, colour, marker) in KINDS {
                let own = rows.iter().filter(|row| {
                    row.start == start && row.way.kind() == kind && (row.n > 64) == fine
                });
                let mut line = Series::of(format!("{kind}, {grid}"), own, |row| {
                    [work, "distance"].map(|name| row.numbers[name])
                });
                line.points.sort_by(|a, b| a[0].total_cmp(&b[0]));
                let line = line.with_colour(colour).with_style(style);
                lines.push(line.with_marker(marker));
            }
        }
        let title = format!("{title}, {from}");
        let chart = LineChart::new(title, Axis::log(work), Axis::log("largest distance"));
        figure = figure.with_panel(chart.with_curves(lines));
    }
    figure.with_shared_legend().with_note(
        "Fine: eps = 2h = 1/64; coarse: twice that. A Hessian-vector product counts as four convolutions.",
    )
}

/// Distances from the exact surfaces, and errors of the energy.
fn surfaces_figure(rows: &[SurfaceRow]) -> Figure {
    let mut titles: Vec<&str> = rows.iter().map(|row| row.title).collect();
    titles.dedup();
    let mut figure = Figure::new(format!("{TITLE} in space"), 2);
    for title in titles {
        let values: [(&str, fn(&SurfaceRow) -> f64); 2] = [
            ("largest distance / h", |row| row.distance),
            ("relative error of the energy", |row| row.energy_error),
        ];
        for (axis, value) in values {
            let mut lines: Vec<Series> = Vec::new();
            for (style, n) in [(LineStyle::Dashed, 32), (LineStyle::Solid, 64)] {
                for (kind, colour, marker) in &KINDS[..2] {
                    let own = rows
                        .iter()
                        .filter(|row| row.title == title && row.way.kind() == *kind && row.n == n);
                    let line = Series::of(format!("{kind}, n = {n}"), own, |row| {
                        [row.time, value(row)]
                    });
                    let line = line.with_colour(*colour).with_style(style);
                    lines.push(line.with_marker(*marker));
                }
            }
            let chart = LineChart::new(title, Axis::log("t / 2⁻¹⁴"), Axis::log(axis));
            figure = figure.with_panel(chart.with_curves(lines));
        }
    }
    figure.with_shared_legend()
}
