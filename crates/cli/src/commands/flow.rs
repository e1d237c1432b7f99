//! `willmore flow`, and what it has in common with the other commands that make runs.

use engine::{ErrorControl, Flow, Held, Helfrich, Store, TimeSteps};
use solver::NewtonParams;

use crate::cli::{McfOptions, MessageOptions, RunCommand, RunOptions};
use crate::config;
use crate::input::{Loaded, Reader, Start, usual_box};
use crate::paths::absolute;
use crate::plane::Plane;
use crate::prelude::*;
use crate::presentation::{self, Presentation};
use crate::run::{Plan, free_folder, make_way};
use crate::sizes;
use crate::space::Space;
use crate::values::{Amount, Label};
use crate::volume;

/// In a step the interface moves by at most so many widths of it.
const LONGEST_MOVE: f64 = 2.0;
/// The usual step of inpainting in units of the inner one,
const INPAINT_STEP: f64 = 16.0;
/// which a ramp reaches that starts this many times halved: at the border of the region there is a jump.
const INPAINT_HALVINGS: u32 = 12;

impl RunCommand {
    /// Refuses options before anything is read.
    fn check(&mut self) -> Result<()> {
        match self {
            Self::Flow(_) => (),
            Self::Fair(fair) => fair.check()?,
            Self::Inpaint(inpaint) => inpaint.check()?,
            Self::Mcf(McfOptions { method, run }) => {
                let chosen = run.scheme.network.is_some() || run.scheme.scheme != Scheme::Accurate;
                if chosen && !method.is_learned() {
                    refuse!(
                        "--network and --scheme have no meaning for finite elements: leave them out, or choose --method network"
                    );
                }
            }
        }
        let usual = self.usual_rule(f64::NAN, f64::NAN);
        if let Some(flow) = self.willmore()
            && let Some(tolerance) = flow.tolerance
            && flow.tau.unwrap_or(usual) != StepRule::Controlled
        {
            refuse!(
                "--tolerance {tolerance} is for controlled time steps: give --tau controlled, or leave it out"
            );
        }
        if let Some(flow) = self.willmore()
            && let (Some(ramp), None, None, None) =
                (flow.ramp, flow.volume, flow.area, flow.reduced_volume)
        {
            refuse!(
                "--ramp {ramp} is for sizes that go to a target: give --volume, --area or --reduced-volume, or leave it out"
            );
        }
        Ok(())
    }

    /// The rule for the time steps of Willmore flow unless one is chosen, for this inner step and spacing of the grid.
    fn usual_rule(&self, inner: f64, spacing: f64) -> StepRule {
        match self {
            Self::Fair(fair) if fair.takes_small_steps() => StepRule::Graded {
                first: Fairing::first_step(spacing),
                part: Fairing::GROWTH,
            },
            Self::Inpaint(_) => StepRule::Ramp {
                tau: INPAINT_STEP * inner,
                halvings: INPAINT_HALVINGS,
            },
            _ => StepRule::Controlled,
        }
    }

    /// The rule for time steps, filled in for these scales and the length that a unit of the usual box has: time steps that follow from
    /// the inner step do so in a box of that size.
    fn rule(&mut self, scales: &Scales, unit: f64, spacing: f64) -> StepRule {
        let inner = scales.mcf_step * unit.powi(2);
        let usual = self.usual_rule(inner, spacing);
        match self.willmore() {
            Some(flow) => {
                let rule = flow.tau.unwrap_or(usual).resolved(inner);
                flow.tau = Some(rule);
                rule
            }
            None => StepRule::Constant(scales.mcf_step),
        }
    }

    /// How many steps are made unless it is said: few, or many where something else ends the run; those of mean curvature flow are short.
    fn usual_steps(&mut self) -> usize {
        let fairs = matches!(self, Self::Fair(fair) if fair.takes_small_steps());
        let energy = self.willmore().and_then(|flow| flow.energy);
        let has_an_end = fairs || energy.is_some() || self.options().time.is_some();
        match self {
            _ if !has_an_end => 20,
            Self::Mcf(_) => 100_000,
            _ => 1000,
        }
    }

    /// The input, as it is before it flows.
    fn load(&mut self, messages: MessageOptions) -> Result<Loaded> {
        match self {
            Self::Fair(fair) => fair.load(messages),
            Self::Inpaint(inpaint) => inpaint.load(messages),
            Self::Flow(_) | Self::Mcf(_) => self.options().reader(messages)?.load(),
        }
    }

    fn stops(&mut self, rule: StepRule) -> Vec<Stop> {
        // What has gone wrong is said before what was asked for.
        let mut stops = vec![Stop::Vanished, Stop::NoSurface, Stop::AtTheSide];
        let options = self.options();
        stops.extend(options.steps.map(Stop::Steps));
        stops.extend(options.time.map(Stop::Time));
        let energy = self.willmore().and_then(|flow| flow.energy);
        stops.extend(energy.map(Stop::Energy));
        if matches!(rule, StepRule::ByEnergy(_) | StepRule::Controlled) {
            stops.push(Stop::EnergyAtRest);
        }
        if let Self::Fair(fair) = self {
            stops.extend(fair.energy_ratio.map(Stop::EnergyRatio));
        }
        stops
    }
}

impl RunOptions {
    /// Reads the input.
    pub fn reader(&mut self, messages: MessageOptions) -> Result<Reader<'_>> {
        Reader::of(&mut self.input, self.scheme.eps_over_h(), messages)
    }

    /// Refuses what cannot be done before anything is computed.
    fn check(&mut self) -> Result<()> {
        self.scheme.fill_in()?;
        let force = self.force;
        if let Some(save) = &mut self.save {
            *save = absolute(&*save)?;
            force.check("--save", save)?;
        }
        Ok(())
    }
}

/// Makes a run, or continues one that is stored, perhaps to more steps.
pub fn run(
    mut command: RunCommand,
    messages: MessageOptions,
    stored: Option<(StoredRun, Option<usize>)>,
) -> Result<()> {
    if let Some(labels) = volume::all_labels(&command.options().input)? {
        return volume::for_each(labels, messages, |label| {
            let mut one = command.clone();
            let options = one.options();
            options.input.label = Some(Label::One(label));
            for name in options.output.iter_mut().chain(&mut options.save) {
                *name = volume::named(name, label);
            }
            run(one, messages, None)
        });
    }
    command.check()?;
    let steps = command.usual_steps();
    let options = command.options();
    options.steps.get_or_insert(steps);
    if let Some((stored, more)) = &stored {
        // A run that has gone on once notes its steps.
        let noted = engine::notes(stored)["steps"].as_u64();
        let steps = more.or(noted.map(|steps| steps as usize));
        options.steps = steps.or(options.steps);
    }
    options.check()?;
    let device = options.common.open_device()?;
    let mut job = Job {
        command,
        device,
        messages,
    };
    if let Some((stored, more)) = stored {
        return match engine::dimension(&stored)? {
            2 => job.resume::<2, Plane>(stored, more),
            _ => job.resume::<3, Space>(stored, more),
        };
    }
    match job.command.load(messages)? {
        Loaded::Plane(start) => job.start(start),
        Loaded::Space(start) => job.start(start),
    }
}

struct Job {
    command: RunCommand,
    device: ComputeDevice,
    messages: MessageOptions,
}

impl Job {
    fn start<const D: usize, O: Presentation<D>>(mut self, mut start: Start<D, O>) -> Result<()> {
        let options = self.command.options();
        start.presentation.turn(&mut options.up)?;
        options.save.as_deref().map_or(Ok(()), O::check_saved)?;
        if let RunCommand::Flow(options) = &mut self.command {
            sizes::round_edges(options, &mut start.initial, &self.device, self.messages)?;
        }
        let case = self.case(
            &start.name,
            start.initial,
            start.region,
            &start.presentation,
        )?;
        let options = config::resolved(self.command.name(), &self.to_store())?;
        let plan = self.plan(start.name, start.presentation);
        let notes = plan.notes(&case, &self.device);
        let run = Run::new(case, &self.device)?;
        let folder = match &plan.options.output {
            Some(folder) => folder.clone(),
            None => free_folder(&format!("{}-{}", plan.name, plan.command)),
        };
        if plan.options.force.force {
            make_way(&folder, &plan.options.input)?;
        }
        let inputs = plan.presentation.inputs()?;
        let mut files = vec![(config::FILE, options.as_bytes())];
        files.extend(inputs.iter().map(|(name, bytes)| (&**name, &bytes[..])));
        let store = Store::create(folder, &files, &run, notes, plan.checkpoints())?;
        plan.go_on(store, run)
    }

    /// The options of which the same run can be made again.
    fn to_store(&self) -> RunCommand {
        let mut command = self.command.clone();
        // Standard output is not there any more when a run is resumed.
        if self.messages.to_pipe {
            command.options().save = None;
        }
        // Where the noise ends the flow, no steps were chosen, and to say so would be to choose.
        if matches!(&command, RunCommand::Fair(fair) if !fair.ends) {
            command.options().steps = None;
        }
        command
    }

    /// Continues a run from its last checkpoint, a finished one to more steps.
    fn resume<const D: usize, O: Presentation<D>>(
        mut self,
        stored: StoredRun,
        more: Option<usize>,
    ) -> Result<()> {
        let mut notes = engine::notes(&stored).clone();
        let name = notes["about"]["name"].as_str().unwrap_or("run").to_owned();
        let mut presentation = O::deserialize(&notes["presentation"]).map_err(|reason| {
            let path = stored.path().display();
            Error::options(format!(
                "{path} cannot be resumed: {reason}; start a new run"
            ))
        })?;
        let (initial, region) = engine::initial(&stored)?;
        presentation.restore(&stored)?;
        let case = self.case(&name, initial, region, &presentation)?;
        let plan = self.plan(name, presentation);
        let checkpoints = plan.checkpoints();
        let (store, run) = match more {
            Some(steps) => {
                notes["steps"] = steps.into();
                let with = (checkpoints, notes);
                Store::extend(stored, case, &self.device, with, presentation::is_of_end)?
            }
            None => Store::resume(stored, case, &self.device, checkpoints)?,
        };
        plan.go_on(store, run)
    }

    fn case<const D: usize>(
        &mut self,
        name: &str,
        initial: Stored<D>,
        region: Option<Vec<bool>>,
        presentation: &impl Presentation<D>,
    ) -> Result<Case<D>> {
        let (flow, method) = match &self.command {
            RunCommand::Mcf(mcf) => (Flow::MeanCurvature, mcf.method),
            _ => (Flow::Willmore, Method::Hybrid),
        };
        let RunOptions { scheme, input, .. } = self.command.options();
        let (mut scales, operator) = scheme.operator(method, initial.grid())?;
        let unit = initial.grid().side() / input.box_side.unwrap_or(usual_box::<D>().1);
        let spacing = initial.grid().spacing();
        let rule = self.command.rule(&scales, unit, spacing);
        let stops = self.command.stops(rule);
        let options = self.command.willmore().map(|options| &*options);
        let steps = match rule {
            StepRule::Controlled => {
                scales.newton = NewtonParams {
                    precision: scales.newton.precision,
                    ..NewtonParams::second_order()
                };
                let mut control = ErrorControl::default();
                match options.and_then(|options| options.tolerance) {
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
                longest_move: (flow == Flow::Willmore).then_some(LONGEST_MOVE),
                ..rule.into()
            },
        };
        let eps = scales.eps;
        let known = presentation.known(&initial, eps)?;
        let (mut energy, mut held) = (Helfrich::default(), Held::default());
        if let Some(options) = options {
            energy.spontaneous_curvature = options.spontaneous_curvature.unwrap_or(0.0);
            energy.tension = options.tension.unwrap_or(0.0);
            energy.pressure = options.pressure.unwrap_or(0.0);
            held = options.held(&initial, eps, known.volume)?;
        }
        let mut measures = vec![Measure::zero_set(eps, &held)];
        measures.extend(known.measures);
        Ok(Case {
            shape: name.to_owned(),
            initial,
            region,
            energy,
            held,
            flow,
            operator,
            scales,
            steps,
            stops: [stops, known.stops].concat(),
            measures,
        })
    }

    fn plan<const D: usize, O>(&mut self, name: String, presentation: O) -> Plan<D, O> {
        let format = match &self.command {
            RunCommand::Fair(fair) => fair.format.clone(),
            _ => None,
        };
        Plan {
            command: self.command.name(),
            name,
            presentation,
            format,
            options: self.command.options().clone(),
            messages: self.messages,
        }
    }
}
