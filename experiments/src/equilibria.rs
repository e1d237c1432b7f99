//! Curves and surfaces that come to rest with given perimeter and volume, against exact equilibria.

use std::f64::consts::TAU;

use crate::prelude::*;

/// Steps in which the sizes of the start go to the given ones, and the most steps until rest.
const RAMP: usize = 8;
const MOST: usize = 200;

/// The exact energy `w = 1/2 int h^2`, and the derivatives `-dw/dA` by the perimeter and `-dw/dV` by the volume.
#[derive(Clone, Copy)]
pub struct Exact {
    pub energy: f64,
    pub tension: f64,
    pub pressure: f64,
}

/// An equilibrium: its perimeter is that of the ball of this radius, its volume a part of that ball's, which is the reduced volume in
/// space and the isoperimetric quotient in the plane.
pub struct Equilibrium {
    pub key: String,
    pub title: String,
    pub radius: f64,
    pub ratio: f64,
    /// Whether the start is longer than wide, in space.
    pub prolate: bool,
    /// The exact energy `1/2 int h^2`, tension and pressure at this radius.
    pub exact: Exact,
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
        let (mut round, mut slender) = (1.0, if self.prolate { 100.0 } else { 0.01 });
        for _ in 0..60 {
            let middle = f64::sqrt(round * slender);
            let end = if perimeter(axes(middle)) < 1.0 {
                &mut round
            } else {
                &mut slender
            };
            *end = middle;
        }
        axes(round).map(|axis| axis * self.radius)
    }

    /// The ellipse or spheroid from which the flow starts, around a centre.
    pub fn start<const D: usize>(
        &self,
        grid: Grid<D>,
        eps: f64,
        centre: f64,
    ) -> Result<Field<D>, Error> {
        let profile = Ellipse::new(self.half_axes::<D>())?;
        let distance = |x: [f64; D]| {
            let along = x[D - 1] - centre;
            let across = x[..D - 1].iter().map(|x| (x - centre).powi(2));
            profile.signed_distance([across.sum::<f64>().sqrt(), along])
        };
        Ok(phase_field(grid, &distance, eps)?)
    }

    /// Lets a flow come to rest with these sizes: [implicit steps by the energy](StepRule::ByEnergy).
    pub fn relax<const D: usize>(
        self,
        session: &mut Session<'_>,
        mut case: Case<D>,
        steps: Option<usize>,
    ) -> Result<AtRest<D>, Error> {
        let eps = case.scales.eps;
        let start = ZeroSet::of(&case.initial, eps)?;
        let [perimeter, volume] = self.sizes::<D>();
        let over = |from, to| {
            Some(Target {
                from,
                to,
                over: RAMP,
            })
        };
        case.held = Held {
            perimeter: over(start.perimeter, perimeter),
            volume: over(start.volume, volume),
        };
        // In long steps flat vesicles break through in the middle.
        let flat = D == 3 && !self.prolate;
        case.steps = TimeSteps {
            longest_move: Some(if flat { 0.3 } else { 1.0 }),
            ..StepRule::ByEnergy(None).into()
        };
        case.stops = vec![
            Stop::Steps(steps.unwrap_or(MOST)),
            Stop::EnergyAtRest,
            Stop::NoSurface,
            Stop::AtTheSide,
        ];
        case.measures = vec![Measure::zero_set(eps, &case.held)];
        let samples = Samples::every(usize::MAX);
        let trajectory = session.trajectory(&self.title, case, &self.key, &samples)?;
        let field = trajectory.field(trajectory.steps())?;
        let zero_set = ZeroSet::of(&field, eps)?;
        Ok(AtRest {
            equilibrium: self,
            trajectory,
            field,
            zero_set,
        })
    }
}

pub struct AtRest<const D: usize> {
    pub equilibrium: Equilibrium,
    pub trajectory: Trajectory<D>,
    pub field: Field<D>,
    pub zero_set: ZeroSet,
}

impl<const D: usize> AtRest<D> {
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

    fn last(&self, of: fn(&solver::StepRecord) -> Option<f64>) -> Option<f64> {
        let records = self.trajectory.records.iter().rev();
        records.filter_map(|r| r.minimization.as_ref()).find_map(of)
    }
}

/// Energies in units of that of the ball of the same perimeter or, in space, of any ball, `8 pi`; drifts, multipliers and work.
pub fn sheet<const D: usize>(all: &[AtRest<D>]) -> Sheet<'_, AtRest<D>> {
    let (energy, [perimeter, volume], drifts) = match D {
        2 => (
            "w_over_circle",
            ["length", "area"],
            ["length_drift", "area_drift"],
        ),
        _ => (
            "w_over_8pi",
            ["area", "volume"],
            ["area_drift", "volume_drift"],
        ),
    };
    let ball = |one: &AtRest<D>| match D {
        2 => PI / one.equilibrium.radius,
        _ => 8.0 * PI,
    };
    let sizes = |one: &AtRest<D>| one.equilibrium.sizes::<D>();
    Sheet::of(all)
        .keyed(|one, name| format!("{}.{name}", one.equilibrium.key))
        .text("equilibrium", |one| one.equilibrium.title.as_str())
        .measure(energy, ("energy / ball's", Fixed(4)), move |one| {
            one.zero_set.willmore_energy / ball(one)
        })
        .measure("exact", ("exact", Fixed(4)), move |one| {
            one.equilibrium.exact.energy / ball(one)
        })
        .column("error in %", Fixed(2), |one| {
            100.0 * (one.zero_set.willmore_energy / one.equilibrium.exact.energy - 1.0)
        })
        .measure(
            drifts[0],
            (&format!("drift of the {perimeter}"), Scientific(1)),
            move |one| one.drift(perimeter, sizes(one)[0]),
        )
        .measure(
            drifts[1],
            (&format!("drift of the {volume}"), Scientific(1)),
            move |one| one.drift(volume, sizes(one)[1]),
        )
        .measure("tension", ("tension", Fixed(3)), |one| {
            one.last(|made| made.tension)
        })
        .measure("exact_tension", ("exact", Fixed(3)), |one| {
            one.equilibrium.exact.tension
        })
        .measure("pressure", ("pressure", Fixed(3)), |one| {
            one.last(|made| made.pressure)
        })
        .measure("exact_pressure", ("exact", Fixed(3)), |one| {
            one.equilibrium.exact.pressure
        })
        .measure("steps", ("steps", Shortest), |one| one.trajectory.steps())
        .measure("hvp_total", ("HVP", Fixed(0)), |one| {
            let hvp = one.trajectory.records.iter().filter_map(Record::hvp);
            hvp.sum::<f64>()
        })
        .measure("seconds", ("s", Fixed(0)), |one| one.trajectory.seconds())
}
