//! `willmore flow`, and what it has in common with the other commands that make runs.

use engine::{ErrorControl, Flow, Held, Helfrich, TimeSteps};
use solver::NewtonParams;

use super::{open_device, operator};
use crate::cli::{CommonOptions, SchemeOptions};
use crate::prelude::*;
use crate::run::Plan;
use crate::{sizes, volume};

/// Steps of a run that has no other end.
const STEPS: usize = 20;
/// In a step the interface moves by at most so many widths of it.
const LONGEST_MOVE: f64 = 2.0;
const SAVED: [&str; 5] = ["ply", "obj", "stl", "png", "svg"];

/// A command that makes a run.
pub trait FlowCommand: Serialize + Clone {
    const NAME: &'static str;
    const FLOW: Flow = Flow::Willmore;
    /// Steps of a run that ends at a time or an energy.
    const MANY_STEPS: usize = 1000;

    fn load(&mut self, say: SayOptions) -> Result<Loaded, Error> {
        let shared = self.shared();
        input::load(shared.input, shared.scheme.eps_over_h(), say)
    }

    /// Whether something besides time and energy ends it.
    fn ends(&self) -> bool {
        false
    }

    /// The Willmore energy at which it ends, as a part of that at the beginning.
    fn energy_ratio(&self) -> Option<f64> {
        None
    }

    fn shared(&mut self) -> Shared<'_>;

    fn method(&self) -> Method {
        Method::Hybrid
    }

    /// Refuses options before anything is read.
    fn check(&mut self) -> Result<(), Error> {
        Ok(())
    }

    /// What becomes of the input before it flows.
    fn prepare(&self, input: Loaded) -> Result<Loaded, Error> {
        Ok(input)
    }

    /// The rule for time steps, filled in for these scales and the length that a unit of the usual box has: time steps that follow from
    /// the inner step do so in a box of that size.
    fn rule(&mut self, scales: &Scales, unit: f64) -> StepRule;

    /// The options of Willmore flow; mean curvature flow has no energy and no controlled steps.
    fn willmore(&mut self) -> Option<&mut FlowOptions> {
        None
    }

    fn format(&self) -> Option<String> {
        None
    }
}

pub struct Shared<'a> {
    pub input: &'a mut InputOptions,
    pub scheme: &'a mut SchemeOptions,
    pub steps: &'a mut Option<usize>,
    pub time: Option<f64>,
    pub energy: Option<f64>,
    pub keep: &'a mut KeepOptions,
    pub common: &'a mut CommonOptions,
}

impl FlowCommand for FlowOptions {
    const NAME: &'static str = "flow";

    fn shared(&mut self) -> Shared<'_> {
        Shared {
            input: &mut self.input,
            scheme: &mut self.scheme,
            steps: &mut self.steps,
            time: self.time,
            energy: self.energy,
            keep: &mut self.keep,
            common: &mut self.common,
        }
    }

    fn check(&mut self) -> Result<(), Error> {
        self.check_tolerance(StepRule::Controlled)
    }

    fn willmore(&mut self) -> Option<&mut FlowOptions> {
        Some(self)
    }

    fn rule(&mut self, scales: &Scales, unit: f64) -> StepRule {
        let rule = self.tau.unwrap_or(StepRule::Controlled);
        *self
            .tau
            .insert(rule.resolved(scales.mcf_step * unit.powi(2)))
    }
}

impl FlowOptions {
    /// Refuses a tolerance that the time steps do not look at.
    pub fn check_tolerance(&self, usual: StepRule) -> Result<(), Error> {
        match self.tolerance {
            Some(tolerance) if self.tau.unwrap_or(usual) != StepRule::Controlled => {
                Err(Error::options(format!(
                    "--tolerance {tolerance} is for controlled time steps: give --tau controlled, or leave it out"
                )))
            }
            _ => Ok(()),
        }
    }

    /// Spontaneous curvature, tension and pressure, in the units of the input.
    fn energy(&self) -> Result<Helfrich, Error> {
        let finite = |name: &str, value: Option<f64>| match value.unwrap_or(0.0) {
            value if value.is_finite() => Ok(value),
            value => Err(Error::options(format!(
                "{name} {value} must be a finite number"
            ))),
        };
        Ok(Helfrich {
            spontaneous_curvature: finite("--spontaneous-curvature", self.spontaneous_curvature)?,
            tension: finite("--tension", self.tension)?,
            pressure: finite("--pressure", self.pressure)?,
        })
    }
}

impl Shared<'_> {
    /// Refuses what cannot be done before anything is computed.
    fn check(&mut self) -> Result<(), Error> {
        self.scheme.fill_in()?;
        for (name, value) in [("--time", self.time), ("--energy", self.energy)] {
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                return Err(Error::options(format!("{name} {value} must be positive")));
            }
        }
        for (name, value) in [
            ("--steps", *self.steps),
            ("--frames", self.keep.frames),
            ("--checkpoint-every", Some(self.keep.checkpoint_every)),
        ] {
            if value == Some(0) {
                return Err(Error::options(format!("{name} must be at least 1")));
            }
        }
        let force = self.keep.force;
        if let Some(save) = &mut self.keep.save {
            if !SAVED.contains(&&*input::extension(save)) {
                return Err(Error::options(format!(
                    "--save {} must end in .{}",
                    save.display(),
                    SAVED.join(", .")
                )));
            }
            *save = input::absolute(&*save)?;
            force.check("--save", save)?;
            if !save.parent().is_some_and(Path::is_dir) {
                return Err(Error::options(format!(
                    "--save {}: there is no such folder",
                    save.display()
                )));
            }
        }
        Ok(())
    }

    fn stops(&self, rule: StepRule) -> Vec<Stop> {
        // What has gone wrong is said before what was asked for.
        let mut stops = vec![Stop::Vanished, Stop::NoSurface, Stop::AtTheSide];
        stops.extend(self.steps.map(Stop::Steps));
        stops.extend(self.time.map(Stop::Time));
        stops.extend(self.energy.map(Stop::Energy));
        if matches!(rule, StepRule::ByEnergy(_) | StepRule::Controlled) {
            stops.push(Stop::EnergyAtRest);
        }
        stops
    }
}

/// Makes a run, or continues one that is stored.
pub fn run<C: FlowCommand>(
    mut command: C,
    say: SayOptions,
    stored: Option<(StoredRun, Option<usize>)>,
) -> Result<ExitCode, Error> {
    if let Some(path) = volume::of_all_labels(command.shared().input)? {
        return each_label(&command, &path, say);
    }
    command.check()?;
    let ends = command.ends();
    let mut shared = command.shared();
    let until = ends || shared.time.is_some() || shared.energy.is_some();
    let steps = if until { C::MANY_STEPS } else { STEPS };
    shared.steps.get_or_insert(steps);
    if let Some((stored, more)) = &stored {
        // A run that has gone on once notes its steps.
        let noted = engine::notes(stored)["steps"].as_u64();
        let steps = more.or(noted.map(|steps| steps as usize));
        *shared.steps = steps.or(*shared.steps);
    }
    shared.check()?;
    let device = open_device(shared.common)?;
    let mut job = Job {
        command,
        device,
        say,
    };
    if let Some((stored, more)) = stored {
        return match engine::dimension(&stored)? {
            2 => job.resume::<2, Plane>(stored, more),
            _ => job.resume::<3, Space>(stored, more),
        };
    }
    let loaded = job.command.load(say)?;
    match job.command.prepare(loaded)? {
        Loaded::Plane(start, _) => job.start(start),
        Loaded::Space(start) => job.start(start),
    }
}

/// One run for each label of a volume, until one is interrupted.
fn each_label<C: FlowCommand>(
    command: &C,
    path: &Path,
    say: SayOptions,
) -> Result<ExitCode, Error> {
    for label in volume::labels(path)? {
        let mut one = command.clone();
        let Shared { input, keep, .. } = one.shared();
        input.label = Some(Label::One(label));
        for name in keep.output.iter_mut().chain(&mut keep.save) {
            *name = volume::named(name, label);
        }
        let code = run(one, say, None)?;
        if code != ExitCode::SUCCESS {
            return Ok(code);
        }
    }
    Ok(ExitCode::SUCCESS)
}

struct Job<C> {
    command: C,
    device: ComputeDevice,
    say: SayOptions,
}

impl<C: FlowCommand> Job<C> {
    fn start<const D: usize, O: Outlet<D>>(
        mut self,
        mut start: Start<D, O>,
    ) -> Result<ExitCode, Error> {
        let keep = self.command.shared().keep;
        start.outlet.turn(&mut keep.up)?;
        keep.save.as_deref().map_or(Ok(()), O::check_saved)?;
        if C::NAME == FlowOptions::NAME {
            self.round_edges(&mut start.field)?;
        }
        let case = self.case(&start.name, start.field, start.region, &start.outlet)?;
        let config = config::resolved(C::NAME, &self.command)?;
        let plan = self.plan(start.name, start.outlet);
        plan.start(case, &config, &self.device)
    }

    /// Where area and volume are to be held, [rounds the edges](sizes::with_round_edges) of the start.
    fn round_edges<const D: usize>(&mut self, field: &mut Field<D>) -> Result<(), Error> {
        let scheme = self.command.shared().scheme.clone();
        let options = self.command.willmore();
        let Some(options) = options.filter(|options| options.holds_both()) else {
            return Ok(());
        };
        let operator = operator(&scheme, Method::Hybrid, field.grid())?;
        let round = sizes::with_round_edges(options, field, operator, &self.device)?;
        if let Some((round, note)) = round {
            self.say.note(&note);
            *field = round;
        }
        Ok(())
    }

    fn resume<const D: usize, O: Outlet<D>>(
        mut self,
        stored: StoredRun,
        more: Option<usize>,
    ) -> Result<ExitCode, Error> {
        let notes = engine::notes(&stored);
        let name = notes["about"]["name"].as_str().unwrap_or("run").to_owned();
        let mut outlet = O::deserialize(&notes["outlet"]).map_err(|reason| {
            let path = stored.path().display();
            Error::options(format!(
                "{path} cannot be resumed: {reason}; start a new run"
            ))
        })?;
        let (field, region) = engine::initial(&stored)?;
        outlet.restore(&stored)?;
        let case = self.case(&name, field, region, &outlet)?;
        self.plan(name, outlet)
            .resume(stored, case, &self.device, more)
    }

    fn case<const D: usize>(
        &mut self,
        name: &str,
        initial: Field<D>,
        region: Option<Vec<bool>>,
        outlet: &impl Outlet<D>,
    ) -> Result<Case<D>, Error> {
        let method = self.command.method();
        let options = self.command.willmore().map(|options| options.clone());
        let (mut scales, operator) =
            operator(self.command.shared().scheme, method, initial.grid())?;
        let box_side = self.command.shared().input.box_side;
        let unit = initial.grid().side() / box_side.unwrap_or(input::usual_box::<D>().1);
        let rule = self.command.rule(&scales, unit);
        let steps = match rule {
            StepRule::Controlled => {
                scales.newton = NewtonParams {
                    precision: scales.newton.precision,
                    ..NewtonParams::second_order()
                };
                let mut control = ErrorControl::default();
                match options.as_ref().and_then(|options| options.tolerance) {
                    Some(Amount::Value(length)) => control.length = Some(length),
                    Some(Amount::Percent(percent)) => control.relative = percent / 100.0,
                    None => (),
                }
                // On coarse grids the usual first step is long against the shape.
                let shorter = scales.mcf_step * unit.powi(2) / 16.0;
                control.first = Some(shorter.min(16.0 * scales.eps.powi(4)));
                TimeSteps::controlled(control)
            }
            rule => TimeSteps {
                longest_move: (C::FLOW == Flow::Willmore).then_some(LONGEST_MOVE),
                ..rule.into()
            },
        };
        let mut stops = self.command.shared().stops(rule);
        stops.extend(self.command.energy_ratio().map(Stop::EnergyRatio));
        stops.extend(outlet.stops(&initial));
        let eps = scales.eps;
        let (energy, held) = match &options {
            Some(options) => {
                let volume = outlet.volume();
                (options.energy()?, options.held(&initial, eps, volume)?)
            }
            None => (Helfrich::default(), Held::default()),
        };
        let mut measures = vec![Measure::zero_set(eps, &held)];
        measures.extend(outlet.measures(&initial, eps)?);
        Ok(Case {
            shape: name.to_owned(),
            initial,
            region,
            energy,
            held,
            flow: C::FLOW,
            operator,
            scales,
            steps,
            stops,
            measures,
        })
    }

    fn plan<O>(&mut self, name: String, outlet: O) -> Plan<O> {
        Plan {
            command: C::NAME,
            name,
            outlet,
            format: self.command.format(),
            keep: self.command.shared().keep.clone(),
            say: self.say,
        }
    }
}
