//! Runs against the exact flow of their curves, and of their surfaces of revolution.

use engine::estimated_time_error;
use geometry::contour::zero_level;
use geometry::distance_from_phase_field;
use reference::revolution::{self, Surface};
use reference::{Curve, Shape, planar};
use surfaces::phase_field_surface;

use crate::prelude::*;

/// A shape whose exact flow is known, around the origin; in space a body of revolution about the third axis.
pub struct Sample<const D: usize> {
    pub key: &'static str,
    pub title: &'static str,
    /// Side of the periodic box, which is at least six interface widths from the shape in the experiments.
    pub side: f64,
    pub initial: fn(Grid<D>, f64) -> Result<Field<D>, geometry::Error>,
    /// The curve, or the profile of the surface.
    pub curve: fn() -> Result<Shape, reference::Error>,
    /// Points of the zero level of a phase field with an interface width: of the curve, or of the profile.
    pub level: fn(&Field<D>, f64) -> Result<Vec<[f64; 2]>, surfaces::Error>,
}

/// The non-convex cross: arms of half length 0.8 and half width 0.27.
pub const CROSS: Sample<2> = Sample {
    key: "cross",
    title: "Cross",
    side: 2.0,
    initial: |grid, eps| phase_field(grid, &Cross::new(0.8, 0.27)?, eps),
    curve: || Shape::cross(0.8, 0.27),
    level,
};

/// The rectangle with sides 0.4 and 0.2; it ends within 0.36 of the origin.
pub const RECTANGLE: Sample<2> = Sample {
    key: "rectangle",
    title: "Rectangle",
    side: 1.5,
    initial: |grid, eps| phase_field(grid, &Cuboid::new([0.2, 0.1])?, eps),
    curve: || Shape::rectangle(0.2, 0.1),
    level,
};

pub const ELLIPSE: Sample<2> = Sample {
    key: "ellipse",
    title: "Ellipse",
    side: 1.5,
    initial: |grid, eps| phase_field(grid, &Ellipse::new([0.3, 0.2])?, eps),
    curve: || Shape::ellipse(0.3, 0.2),
    level,
};

/// Radius and half the height of the thick disk; the paper does not say, but these fit its initial energy.
pub const THICK_DISK: [f64; 2] = [0.29, 0.1];

pub const DISK: Sample<3> = Sample {
    key: "disk",
    title: "Thick disk",
    side: 1.0,
    initial: |grid, eps| {
        let [radius, half_height] = THICK_DISK;
        phase_field(grid, &Cylinder::new(radius, half_height)?, eps)
    },
    curve: || Shape::rectangle(THICK_DISK[0], THICK_DISK[1]),
    level: profile,
};

/// A smooth surface: the flat spheroid 3:2.
pub const ELLIPSOID: Sample<3> = Sample {
    key: "ellipsoid",
    title: "Ellipsoid",
    side: 1.5,
    initial: |grid, eps| {
        let profile = Ellipse::new([0.3, 0.2])?;
        let distance = |[x, y, z]: [f64; 3]| profile.signed_distance([x.hypot(y), z]);
        phase_field(grid, &distance, eps)
    },
    curve: || Shape::ellipse(0.3, 0.2),
    level: profile,
};

/// Cells per unit length of runs by the accurate operator, two to `eps`.
pub const CELLS: [usize; 2] = [64, 128];

/// Controlled steps with a time error well below that in `eps`; their minimizations are accurate, too. The first step is as long as that of other
/// controlled steps, since at corners it belongs to the error in `eps`.
pub const STRICT: ErrorControl = ErrorControl {
    relative: 0.002,
    length: None,
    longest: 0.5,
    first: None,
};

/// A corner has a radius of about `t^(1/4)` at the time `t`, and is round on a grid if `eps` is at most this part of that.
const ROUND: f64 = 0.65;

/// Nodes of a grid beyond which only what is near the surface is stored, where that is less.
const MOST_STORED: usize = 1 << 22;

/// The times `end / 2^k` for `k` up to `halvings`.
#[derive(Clone, Copy)]
pub struct Halves {
    pub end: f64,
    pub halvings: u32,
}

/// Controlled steps that end at these times, among others.
pub fn controlled(control: ErrorControl, halves: Halves) -> TimeSteps {
    let Halves { end, halvings } = halves;
    TimeSteps {
        order: Order::Controlled(control),
        ..StepRule::Ramp { tau: end, halvings }.into()
    }
}

/// A run: its name, its time steps, and the time up to which it goes.
#[derive(Clone, Copy)]
pub struct Course<'a> {
    pub name: &'a str,
    pub steps: TimeSteps,
    pub end: f64,
}

impl<const D: usize> Sample<D> {
    /// The exact flow at times, each with a number that names it.
    pub fn exact(&self, flow: Flow, marks: &[(usize, f64)]) -> Result<Vec<Truth>> {
        let flow = match flow {
            Flow::Willmore => reference::Flow::Willmore,
            Flow::MeanCurvature => reference::Flow::MeanCurvature,
        };
        let (shape, times) = ((self.curve)()?, marks.iter().map(|(_, time)| *time));
        let times: Vec<f64> = times.collect();
        let marks = marks.iter().map(|(mark, _)| *mark);
        Ok(if D == 2 {
            let curves = planar::evolve(&shape, flow, &times, &planar::ACCURACY)?;
            let truth = |(mark, curve)| Truth::of_curve(mark, curve);
            marks.zip(curves).map(truth).collect()
        } else {
            let surfaces = revolution::evolve(&shape, flow, &times, &revolution::ACCURACY)?;
            let truth = |(mark, surface)| Truth::of_surface(mark, &surface);
            marks.zip(surfaces).map(truth).collect()
        })
    }

    /// Willmore flow on `n` cells per unit length, so many to `eps`.
    pub fn run(
        &self,
        session: &mut Session,
        n: usize,
        eps_over_h: f64,
        discretization: Discretization,
        course: Course<'_>,
    ) -> Result<Trajectory<D>> {
        let grid = Grid::<D>::per_unit(n, self.side)?;
        let initial = (self.initial)(grid, eps_over_h * grid.spacing())?;
        let name = &format!("{}-n{n}-{}", self.key, course.name);
        let course = Course { name, ..course };
        flow(
            session,
            self.key,
            initial,
            eps_over_h,
            discretization,
            course,
        )
    }

    /// What controlled steps of second order with two cells to `eps` reach at the times of the exact flow, some of the halves or
    /// the last one, and [the same extrapolated](Self::extrapolated); adds the metrics `KEY.nN.controlled` and
    /// `KEY.extrapolated`.
    pub fn second_order(
        &self,
        session: &mut Session,
        n: usize,
        halves: Halves,
        exact: &[&Truth],
    ) -> Result<[Vec<Reached>; 2]> {
        let course = Course {
            name: "controlled",
            steps: controlled(ErrorControl::default(), halves),
            end: last(exact),
        };
        let run = self.run(session, n, 2.0, ACCURATE, course)?;
        let reached = exact.iter().map(|exact| Reached::of(self, &run, exact));
        let reached = reached.collect::<Result<Vec<_>, _>>()?;
        let key = format!("{}.n{n}.controlled", self.key);
        (reached.iter()).try_for_each(|reached| reached.record(session, &key))?;
        Ok([reached, self.extrapolated(session, halves, exact)?])
    }

    /// The flow at such times extrapolated to `eps = 0` from strictly controlled runs on two grids, the finer one with half the `eps`: the coarsest
    /// two on which a corner is round by then. Adds the metrics `KEY.extrapolated`. A quick look takes coarser ones.
    pub fn extrapolated(
        &self,
        session: &mut Session,
        halves: Halves,
        exact: &[&Truth],
    ) -> Result<Vec<Reached>> {
        // With two cells to eps the lattice holds slow flows back by as much as the extrapolation leaves. In space no network has more.
        let (cells, eps_over_h): (&[usize], f64) = match (D, session.options.quick) {
            (2, false) => (&[256, 512], 4.0),
            (2, true) => (&[64, 128], 4.0),
            (_, false) => (&[64, 128, 256], 2.0),
            (_, true) => (&[32, 64], 2.0),
        };
        let pairs = cells.len() - 1;
        let coarser = |truth: &Truth| {
            let radius = truth.time().powf(0.25);
            let round = |&n: &usize| eps_over_h / n as f64 <= ROUND * radius;
            cells[..pairs].iter().position(round).unwrap_or(pairs - 1)
        };
        let mut runs = Vec::new();
        for (k, &n) in cells.iter().enumerate() {
            let in_its_pair = |truth: &&&Truth| k == coarser(truth) || k == coarser(truth) + 1;
            let used: Vec<&Truth> = exact.iter().filter(in_its_pair).copied().collect();
            let course = Course {
                name: "controlled_strict",
                steps: controlled(STRICT, halves),
                end: last(&used),
            };
            let run = || self.run(session, n, eps_over_h, ACCURATE, course);
            runs.push((!used.is_empty()).then(run).transpose()?);
        }
        let (key, mut all) = (format!("{}.extrapolated", self.key), Vec::new());
        for exact in exact {
            let at = |k: usize| {
                let run = runs[k].as_ref().expect("it is run for this time");
                Reached::of(self, run, exact)
            };
            let k = coarser(exact);
            let reached = Reached::extrapolated(&at(k)?, &at(k + 1)?, exact);
            reached.record(session, &key)?;
            all.push(reached);
        }
        Ok(all)
    }
}

fn last(exact: &[&Truth]) -> f64 {
    exact.iter().map(|truth| truth.time()).fold(0.0, f64::max)
}

/// Willmore flow of a phase field with so many cells to `eps`, a shape of this name.
pub fn flow<const D: usize>(
    session: &mut Session,
    shape: &str,
    initial: Field<D>,
    eps_over_h: f64,
    discretization: Discretization,
    course: Course<'_>,
) -> Result<Trajectory<D>> {
    let Course { name, steps, end } = course;
    let newton = match steps.order {
        Order::First | Order::Direct(_) => NewtonParams::default(),
        Order::Controlled(STRICT) => NewtonParams {
            tolerance: 0.01,
            cg_tolerance: 0.05,
            ..NewtonParams::default()
        },
        Order::Second | Order::Controlled(_) => NewtonParams::second_order(),
    };
    let grid = *initial.grid();
    let scales = Scales {
        newton,
        ..Scales::of_grid(grid.spacing(), eps_over_h)
    };
    let mut operator = operator(discretization, &grid, &scales)?;
    if grid.len() > MOST_STORED {
        operator.storage = Storage::Auto;
    }
    let mut case = Case::willmore(shape, initial, operator, scales, steps, 1);
    case.stops = vec![Stop::Time(end)];
    case.measures = Measure::crossings(0.0);
    session.trajectory(name, case, name, &Samples::every(1))
}

/// The exact flow at a time.
pub struct Truth {
    pub mark: usize,
    /// The curve, or the profile of the surface.
    pub outline: Curve,
    /// Of a curve the extent from the origin along the x axis and along the diagonal, the enclosed area, the length, and
    /// `w = 1/2 int kappa^2`; of a surface area, volume, and `w = 1/2 int kappa^2`.
    pub sizes: Numbers,
}

impl Truth {
    fn of_curve(mark: usize, outline: Curve) -> Self {
        let along = |direction| outline.distance_along(direction).unwrap_or(f64::NAN);
        let sizes = Numbers::from([
            ("tip", along([1.0, 0.0])),
            ("diagonal", along([1.0, 1.0])),
            ("area", outline.area()),
            ("perimeter", outline.length()),
            ("w", outline.energy()),
        ]);
        Self {
            mark,
            outline,
            sizes,
        }
    }

    fn of_surface(mark: usize, surface: &Surface) -> Self {
        let [area, volume, w] = [surface.area(), surface.volume(), surface.energy()];
        Self {
            mark,
            outline: surface.profile().clone(),
            sizes: [("area", area), ("volume", volume), ("w", w)].into(),
        }
    }

    fn time(&self) -> f64 {
        self.outline.time()
    }

    /// Adds its sizes as metrics `KEY.exact.SIZE.stepMARK`.
    pub fn record(&self, session: &mut Session, key: &str) -> Result<()> {
        record(session, &format!("{key}.exact"), self.mark, &self.sizes)
    }
}

#[expect(clippy::unnecessary_wraps, reason = "isosurfaces may fail")]
fn level(field: &Field<2>, _: f64) -> Result<Vec<[f64; 2]>, surfaces::Error> {
    let curves = zero_level(field).into_iter();
    Ok(curves.flat_map(|curve| curve.points).collect())
}

/// Distance from the axis and height of the vertices of the isosurface, around the origin: from the upper pole to the lower one, and back on the
/// other side of the axis. The grid and the surface are symmetric, so that an eighth of the vertices is enough.
fn profile(field: &Field<3>, eps: f64) -> Result<Vec<[f64; 2]>, surfaces::Error> {
    let vertices = phase_field_surface(field, eps)?.vertices.into_iter();
    let eighth = vertices.filter(|[x, y, _]| (0.0..=*x).contains(y));
    let mut points: Vec<[f64; 2]> = eighth.map(|[x, y, z]| [x.hypot(y), z]).collect();
    let angle = |[r, z]: &[f64; 2]| r.atan2(*z);
    points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    let mirrored: Vec<_> = points.iter().rev().map(|[r, z]| [-r, *z]).collect();
    points.extend(mirrored);
    Ok(points)
}

/// Adds metrics `KEY.NAME.stepMARK`.
fn record(session: &mut Session, key: &str, mark: usize, numbers: &Numbers) -> Result<()> {
    let mut numbers = numbers.iter();
    numbers
        .try_for_each(|(name, value)| session.metric(&format!("{key}.{name}.step{mark}"), *value))
}

/// The records of a run up to the first one at a time or later.
pub fn until<const D: usize>(run: &Trajectory<D>, time: f64) -> &[Record] {
    let earlier = |record: &Record| record.time < time * (1.0 - 1e-9);
    &run.records[..=run.records.partition_point(earlier)]
}

/// The last of them.
pub fn at<const D: usize>(run: &Trajectory<D>, time: f64) -> &Record {
    let so_far = until(run, time);
    &so_far[so_far.len() - 1]
}

/// What a run has reached at a time at which one of its steps ends.
pub struct Reached {
    pub mark: usize,
    /// The sizes of its zero level, as those of the [exact flow](Truth), and `distance_to_exact`, the largest distance to that; `hvp_total`,
    /// `seconds` and `steps`, all so far; of steps of second order `estimated_error` in time, absent in the first three.
    pub numbers: Numbers,
    /// The sizes of the exact flow.
    pub exact: Numbers,
    points: Vec<[f64; 2]>,
}

impl Reached {
    fn new(exact: &Truth, points: Vec<[f64; 2]>, mut numbers: Numbers) -> Self {
        let distance = exact.outline.largest_distance_of(&points);
        numbers.insert("distance_to_exact", distance);
        Self {
            mark: exact.mark,
            numbers,
            exact: exact.sizes.clone(),
            points,
        }
    }

    /// Compares a run of a sample with the exact flow at a time.
    pub fn of<const D: usize>(
        sample: &Sample<D>,
        run: &Trajectory<D>,
        exact: &Truth,
    ) -> Result<Self> {
        let so_far = until(run, exact.time());
        let last = at(run, exact.time());
        let (field, eps) = (run.field(last.step)?, run.case.scales.eps);
        let zero_set = ZeroSet::of(&field, eps)?;
        let size = |name| match (D, name) {
            (2, "area") | (_, "volume") => zero_set.volume,
            (_, "area" | "perimeter") => zero_set.perimeter,
            (_, "w") => zero_set.willmore_energy,
            (_, name) => last.measure(name).unwrap_or(f64::NAN),
        };
        let sizes = exact.sizes.keys().map(|&name| (name, size(name)));
        let work = [
            ("hvp_total", total_hvp(so_far)),
            ("seconds", so_far.iter().map(|record| record.seconds).sum()),
            ("steps", so_far.len() as f64),
        ];
        let estimated = estimated_time_error(so_far).map(|error| ("estimated_error", error));
        let numbers = sizes.chain(work).chain(estimated).collect();
        Ok(Self::new(exact, (sample.level)(&field, eps)?, numbers))
    }

    /// Adds its numbers, but `seconds`, as metrics `KEY.NAME.stepMARK`.
    fn record(&self, session: &mut Session, key: &str) -> Result<()> {
        let mut numbers = self.numbers.clone();
        numbers.remove("seconds");
        record(session, key, self.mark, &numbers)
    }

    /// The same at `eps = 0` from runs at `2 eps` and at `eps`, the error being of second order in `eps`: sizes are `(4 b - a) / 3`, and the
    /// points of the finer level move on by a third of the way from the coarser one. The work is that of both, and the estimated error the
    /// larger one.
    fn extrapolated(double: &Self, single: &Self, exact: &Truth) -> Self {
        let number = |(&name, b): (&&'static str, &f64)| {
            let a = double.numbers.get(name)?;
            let number = match name {
                "hvp_total" | "seconds" | "steps" => a + b,
                "estimated_error" => a.max(*b),
                _ => (4.0 * b - a) / 3.0,
            };
            Some((name, number))
        };
        let moved = |p: &[f64; 2]| {
            let [x, y] = nearest(&double.points, *p);
            [p[0] + (p[0] - x) / 3.0, p[1] + (p[1] - y) / 3.0]
        };
        let points = single.points.iter().map(moved).collect();
        let numbers = single.numbers.iter().filter_map(number).collect();
        Self::new(exact, points, numbers)
    }
}

/// How far the zero levels of two nearly equal phase fields are apart: the largest difference of the distances that their profiles have at
/// nodes within a cell of the first level.
pub fn distance_of_levels<const D: usize>(first: &Field<D>, second: &Field<D>, eps: f64) -> f64 {
    let distance = |u: &f64| distance_from_phase_field(*u, eps);
    let distances = |field: &Field<D>| field.values().iter().map(distance).collect::<Vec<_>>();
    let both = distances(first).into_iter().zip(distances(second));
    let near = both.filter(|(d, _)| d.abs() <= first.grid().spacing());
    near.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The point of a closed polygon that is nearest to `p`.
pub fn nearest(polygon: &[[f64; 2]], p: [f64; 2]) -> [f64; 2] {
    let foot = |k: usize| {
        let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
        let (along, from) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
        let squared = along[0].powi(2) + along[1].powi(2);
        let part = (from[0] * along[0] + from[1] * along[1]) / squared.max(f64::MIN_POSITIVE);
        let part = part.clamp(0.0, 1.0);
        [a[0] + part * along[0], a[1] + part * along[1]]
    };
    let distance = |q: &[f64; 2]| (q[0] - p[0]).powi(2) + (q[1] - p[1]).powi(2);
    (0..polygon.len())
        .map(foot)
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .unwrap_or(p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_is_a_foot_or_a_corner() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        for (p, expected) in [
            ([0.3, -2.0], [0.3, 0.0]),
            ([-1.0, 0.4], [0.0, 0.4]),
            ([2.0, 3.0], [1.0, 1.0]),
        ] {
            let [x, y] = nearest(&square, p);
            assert!((x - expected[0]).hypot(y - expected[1]) < 1e-15, "{p:?}");
        }
    }

    #[test]
    fn extrapolated_profiles_are_so_at_the_poles() {
        let grid = Grid::<3>::per_unit(32, 1.0).unwrap();
        let reached = |radius: f64| {
            let ball = phase_field(grid, &Ball::new([0.0; 3], radius).unwrap(), 1.0 / 16.0);
            profile(&ball.unwrap(), 1.0 / 16.0).unwrap()
        };
        let (double, single) = (reached(0.28), reached(0.27));
        for p in single.iter().filter(|[r, _]| r.abs() < 0.1) {
            let [x, y] = nearest(&double, *p);
            let gone = (p[0] - x).hypot(p[1] - y);
            assert!((gone - 0.01).abs() < 1e-3, "{p:?} {gone}");
        }
    }

    #[test]
    fn the_cross_is_the_documented_one() {
        let grid = Grid::<2>::per_unit(64, CROSS.side).unwrap();
        let field = (CROSS.initial)(grid, 1.0 / 64.0).unwrap();
        let area = geometry::measure::zero_set_volume(&field);
        let exact = 2.0 * 1.6 * 0.54 - 0.54 * 0.54;
        assert!((area - exact).abs() < 2e-3, "{area} {exact}");
    }
}
