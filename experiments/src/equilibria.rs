//! Curves and surfaces that come to rest with given perimeter and volume, against exact equilibria.

use std::f64::consts::TAU;

use reference::equilibria::Branch;

use crate::prelude::*;
use crate::truth::nearest;

/// What is said about vesicles and elastic curves.
pub const METRICS: MetricTable = MetricTable {
    title: "Equilibria",
    note: "",
    words: &[(
        "BRANCH",
        "`prolate`, `oblate`, `stomatocyte`: the branches of vesicles",
    )],
    rows: &[
        (
            "vesicles.BRANCH.vN.w_over_8pi, vesicles.BRANCH.vN.exact",
            "Willmore energy at rest over that of a sphere, by coarea sums, and of the exact vesicle with the reduced \
             volume N",
        ),
        (
            "vesicles.crossing.prolate_oblate, vesicles.crossing.exact",
            "reduced volume at which prolate and oblate shapes have the same energy, by straight lines between the \
             reduced volumes of both; the same of the exact vesicles",
        ),
        (
            "vesicles.BRANCH.vN.area_drift, vesicles.BRANCH.vN.volume_drift",
            "largest relative distance of area and volume from their targets, from the end of the ramp on",
        ),
        (
            "elastica.qN.w_over_circle, elastica.qN.exact",
            "energy at rest over that of the circle with the same length, and of the exact curve with the \
             isoperimetric quotient N",
        ),
        (
            "elastica.qN.length_drift, elastica.qN.area_drift",
            "as for vesicles",
        ),
        (
            "vesicles.BRANCH.vN.tension, vesicles.BRANCH.vN.exact_tension, elastica.qN.tension, \
             elastica.qN.exact_tension",
            "multiplier of the perimeter: minus the derivative of the energy by it",
        ),
        (
            "vesicles.BRANCH.vN.pressure, vesicles.BRANCH.vN.exact_pressure, elastica.qN.pressure, \
             elastica.qN.exact_pressure",
            "multiplier of the volume, likewise",
        ),
        (
            "vesicles.BRANCH.vN.steps, vesicles.BRANCH.vN.hvp_total, vesicles.BRANCH.vN.seconds, elastica.qN.steps, \
             elastica.qN.hvp_total, elastica.qN.seconds",
            "time steps, Hessian-vector products and wall time until rest",
        ),
    ],
};

/// Steps in which the sizes of the start go to the given ones, and the most steps until rest.
const RAMP: usize = 8;
const MOST: usize = 200;

/// An equilibrium: its perimeter is that of the ball of this radius, its volume a part of that ball's, which is the reduced volume in
/// space and the isoperimetric quotient in the plane.
pub struct Equilibrium {
    pub key: String,
    pub title: String,
    pub radius: f64,
    pub ratio: f64,
    /// Of vesicles.
    pub branch: Option<Branch>,
    /// The exact energy `w = 1/2 int kappa^2` at this radius, and its derivatives `-dw/dA` by the perimeter and `-dw/dV` by the volume.
    pub energy: f64,
    pub tension: f64,
    pub pressure: f64,
    /// The exact curve or profile with the perimeter of the unit ball.
    pub curve: reference::Curve,
}

impl Equilibrium {
    fn sizes<const D: usize>(&self) -> [f64; 2] {
        let (r, v) = (self.radius, self.ratio);
        match D {
            2 => [TAU * r, v * PI * r * r],
            _ => [4.0 * PI * r * r, v * 4.0 / 3.0 * PI * r.powi(3)],
        }
    }

    /// Half axes of the ellipse, or of the spheroid across and along its axis, with about these sizes: by the approximations of
    /// Ramanujan to the length and of Thomsen to the area, whose errors the first steps take away.
    fn half_axes<const D: usize>(&self) -> [f64; 2] {
        const THOMSEN: f64 = 1.6075;
        let axes = |slenderness: f64| {
            let across = (self.ratio / slenderness).powf(1.0 / D as f64);
            [across, slenderness * across]
        };
        let perimeter = |[a, c]: [f64; 2]| match D {
            2 => 0.5 * (3.0 * (a + c) - ((3.0 * a + c) * (a + 3.0 * c)).sqrt()),
            _ => {
                let mean = (a.powf(2.0 * THOMSEN) + 2.0 * (a * c).powf(THOMSEN)) / 3.0;
                mean.powf(1.0 / THOMSEN)
            }
        };
        let prolate = self.branch == Some(Branch::Prolate);
        let (mut round, mut slender) = (1.0, if prolate { 100.0 } else { 0.01 });
        for _ in 0..60 {
            let middle = f64::sqrt(round * slender);
            if perimeter(axes(middle)) < 1.0 {
                round = middle;
            } else {
                slender = middle;
            }
        }
        axes(round).map(|axis| axis * self.radius)
    }

    /// The ellipse or spheroid from which the flow starts, around a centre; for a stomatocyte the exact shape.
    pub fn start<const D: usize>(&self, grid: Grid<D>, eps: f64, centre: f64) -> Result<Field<D>> {
        let profile: Box<dyn SignedDistance<2>> = match self.branch {
            Some(Branch::Stomatocyte) => Box::new(Polygon(self.outline())),
            _ => Box::new(Ellipse::new(self.half_axes::<D>())?),
        };
        let distance = |x: [f64; D]| {
            let along = x[D - 1] - centre;
            let across = x[..D - 1].iter().map(|x| (x - centre).powi(2));
            profile.signed_distance([across.sum::<f64>().sqrt(), along])
        };
        Ok(phase_field(grid, &distance, eps)?)
    }

    /// The exact curve at this radius.
    fn outline(&self) -> Vec<[f64; 2]> {
        let points = self.curve.points().into_iter();
        points.map(|p| p.map(|x| self.radius * x)).collect()
    }

    /// Lets a flow come to rest with these sizes: [implicit steps by the energy](StepRule::ByEnergy).
    pub fn relax<const D: usize>(
        self,
        session: &mut Session,
        shape: &str,
        initial: Field<D>,
        operator: Operator<D>,
        mut scales: Scales,
        steps: Option<usize>,
    ) -> Result<AtRest<D>> {
        let (initial, eps) = (Stored::from(initial), scales.eps);
        let start = ZeroSet::of(&initial, eps)?;
        let [perimeter, volume] = self.sizes::<D>();
        let over = RAMP;
        let ramp = |from, to| Some(Target { from, to, over });
        // In long steps flat vesicles and cups break through in the middle.
        let flat = self.branch.is_some_and(|branch| branch != Branch::Prolate);
        let time_steps = TimeSteps {
            longest_move: Some(if flat { 0.3 } else { 1.0 }),
            ..StepRule::ByEnergy(None).into()
        };
        // Steps that succeed take about four Newton steps. With the usual limit a step that is too long takes minutes until it is halved.
        scales.newton.newton_iterations = 15;
        let most = steps.unwrap_or(MOST);
        let mut case = Case::willmore(shape, initial, operator, scales, time_steps, most);
        case.held = Held {
            perimeter: ramp(start.perimeter, perimeter),
            volume: ramp(start.volume, volume),
        };
        let ends = [Stop::EnergyAtRest, Stop::NoSurface, Stop::AtTheSide];
        case.stops.extend(ends);
        case.measures = vec![Measure::zero_set(eps, &case.held)];
        let samples = Samples::every(usize::MAX);
        let trajectory = session.trajectory(&self.title, case, &self.key, &samples)?;
        let field = trajectory.field(trajectory.steps())?;
        Ok(AtRest {
            equilibrium: self,
            trajectory,
            willmore_energy: ZeroSet::of(&field, eps)?.willmore_energy,
            field,
        })
    }
}

/// What a polygon encloses.
struct Polygon(Vec<[f64; 2]>);

impl SignedDistance<2> for Polygon {
    fn signed_distance(&self, [x, y]: [f64; 2]) -> f64 {
        let [a, b] = nearest(&self.0, [x, y]);
        let distance = (a - x).hypot(b - y);
        let crosses_to_the_right = |k: &usize| {
            let (a, b) = (self.0[*k], self.0[(k + 1) % self.0.len()]);
            (a[1] > y) != (b[1] > y) && a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) > x
        };
        let crossings = (0..self.0.len()).filter(crosses_to_the_right).count();
        let is_inside = crossings % 2 == 1;
        if is_inside { -distance } else { distance }
    }
}

pub struct AtRest<const D: usize> {
    pub equilibrium: Equilibrium,
    pub trajectory: Trajectory<D>,
    pub field: Field<D>,
    willmore_energy: f64,
}

impl<const D: usize> AtRest<D> {
    /// The energy of the ball of the same perimeter, in space that of any ball.
    fn unit(&self) -> f64 {
        match D {
            2 => PI / self.equilibrium.radius,
            _ => 8.0 * PI,
        }
    }

    pub fn energy(&self) -> f64 {
        self.willmore_energy / self.unit()
    }

    pub fn exact_energy(&self) -> f64 {
        self.equilibrium.energy / self.unit()
    }

    /// The shape, or the plane through its axis, and the exact curve, in a window of so many radii.
    pub fn panel(&self, caption: String, plane: &Field<2>, radii: f64) -> Shapes {
        let half = radii * self.equilibrium.radius;
        let exact = self.equilibrium.outline();
        Shapes::new(caption, [[-half, half]; 2])
            .with_curve(study::zero_level_curve(plane).filled(Colour::LightGrey))
            .with_curve(Curve::new([exact]).with_colour(0).with_width(1.0))
    }

    /// The largest relative distance of a size from its target after the ramp; a step that is halved takes sizes that part of the way.
    fn drift(&self, name: &str, target: f64) -> Option<f64> {
        let mut steps = 0.0;
        let held = self.trajectory.records.iter().filter(|record| {
            steps += 0.5_f64.powi(record.halvings as i32);
            steps >= RAMP as f64 - 1e-9
        });
        let drift = held.filter_map(|r| Some((r.measure(name)? / target - 1.0).abs()));
        drift.max_by(f64::total_cmp)
    }

    fn last(&self, of: fn(&StepRecord) -> Option<f64>) -> Option<f64> {
        minimizations(&self.trajectory.records)
            .filter_map(of)
            .last()
    }
}

/// Energies in units of that of the ball of the same perimeter or, in space, of any ball, `8 pi`; drifts, multipliers and work.
pub fn sheet<const D: usize>(all: &[AtRest<D>]) -> Sheet<'_, AtRest<D>> {
    let (energy, head, sizes) = match D {
        2 => ("w_over_circle", "energy / circle's", ["length", "area"]),
        _ => ("w_over_8pi", "energy / ball's", ["area", "volume"]),
    };
    let error = |one: &AtRest<D>| one.willmore_energy / one.equilibrium.energy - 1.0;
    let (energies, forces) = (Fixed(4), Fixed(3));
    let mut sheet = Sheet::of(all)
        .keyed(|one, name| format!("{}.{name}", one.equilibrium.key))
        .text("equilibrium", |one| one.equilibrium.title.as_str())
        .measure(energy, head, energies, AtRest::energy)
        .measure("exact", "exact energy", energies, AtRest::exact_energy)
        .column("error in %", Fixed(2), |one| 100.0 * error(one));
    for (k, name) in sizes.into_iter().enumerate() {
        let (metric, head) = (format!("{name}_drift"), format!("drift of the {name}"));
        sheet = sheet.measure(&metric, &head, Scientific(1), |one| {
            one.drift(name, one.equilibrium.sizes::<D>()[k])
        });
    }
    sheet
        .measure("tension", "tension", forces, |one| {
            one.last(|made| made.tension)
        })
        .measure("exact_tension", "exact tension", forces, |one| {
            one.equilibrium.tension
        })
        .measure("pressure", "pressure", forces, |one| {
            one.last(|made| made.pressure)
        })
        .measure("exact_pressure", "exact pressure", forces, |one| {
            one.equilibrium.pressure
        })
        .measure("steps", "steps", Shortest, |one| one.trajectory.steps())
        .measure("hvp_total", "HVP", Fixed(0), |one| {
            total_hvp(&one.trajectory.records)
        })
        .measure("seconds", "s", Fixed(0), |one| one.trajectory.seconds())
}
