//! `willmore flow`, and what it has in common with the other commands that make runs.

use engine::{Flow, Storage, Store};

use crate::case::with_round_edges;
use crate::cli::{McfOptions, MessageOptions, RunCommand, RunOptions};
use crate::config;
use crate::input::{InitialShape, Loaded, Reader};
use crate::paths::absolute;
use crate::plane::Plane;
use crate::prelude::*;
use crate::presentation::{self, Presentation};
use crate::run::{Plan, free_folder, make_way};
use crate::space::Space;
use crate::values::Label;
use crate::volume;

impl RunCommand {
    /// Refuses options before anything is read.
    fn check(&mut self) -> Result<()> {
        match self {
            Self::Flow(_) => (),
            Self::Fair(fair) => fair.check()?,
            Self::Inpaint(inpaint) => inpaint.check()?,
            Self::Mcf(McfOptions { method, run }) => {
                let options = &run.operator;
                let chosen =
                    options.network.is_some() || options.formulation != Formulation::Accurate;
                if chosen && !method.is_learned() {
                    refuse!(
                        "--network and --scheme have no meaning for finite elements: leave them out, or choose --method network"
                    );
                }
            }
        }
        let usual = self.usual_rule(f64::NAN, f64::NAN);
        let Some(flow) = self.willmore() else {
            return Ok(());
        };
        if let Some(tolerance) = flow.tolerance
            && flow.tau.unwrap_or(usual) != StepRule::Controlled
        {
            refuse!(
                "--tolerance {tolerance} is for controlled time steps: give --tau controlled, or leave it out"
            );
        }
        if let (Some(ramp), None, None, None) =
            (flow.ramp, flow.volume, flow.area, flow.reduced_volume)
        {
            refuse!(
                "--ramp {ramp} is for sizes that go to a target: give --volume, --area or --reduced-volume, or leave it out"
            );
        }
        Ok(())
    }
}

impl RunOptions {
    /// Reads the input, for Willmore flow on a device.
    pub fn reader(&mut self, device: DeviceKind, messages: MessageOptions) -> Result<Reader<'_>> {
        let mut reader = Reader::of(&mut self.input, self.operator.eps_over_h(), messages)?;
        let is_dense = self.operator.storage == Some(Storage::Dense);
        reader.whole = is_dense.then_some((device, Flow::Willmore));
        Ok(reader)
    }
}

/// Makes a run, or continues one that is stored, perhaps to more steps.
pub fn run(
    mut command: RunCommand,
    messages: MessageOptions,
    stored: Option<(StoredRun, Option<usize>)>,
) -> Result<()> {
    let input = command.options().input.clone();
    let mut is_first = true;
    let of_label = |label| {
        // A signal may have come after the last step of the label before. Before the first one none is caught: it ends the reading at once.
        if !std::mem::take(&mut is_first) && Interrupt::catch()?.requested() {
            messages.note(&format!("interrupted before label {label}"));
            return Err(Error::Interrupted);
        }
        let mut one = command.clone();
        let options = one.options();
        options.input.label = Some(Label::One(label));
        for name in options.output.iter_mut().chain(&mut options.save) {
            *name = volume::named(name, label);
        }
        run(one, messages, None)
    };
    if volume::with_each_label(&input, messages, of_label)? {
        return Ok(());
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
    options.operator.fill_in()?;
    // That its folder is gone is no reason not to go on with a run.
    let is_gone = |save: &mut PathBuf| stored.is_some() && !save.parent().is_some_and(Path::is_dir);
    if let Some(save) = options.save.take_if(is_gone) {
        let shown = save.display();
        messages.warn(&format!(
            "nothing will be saved to {shown}: its folder is gone"
        ));
    }
    if let Some(save) = &mut options.save {
        *save = absolute(&*save)?;
        options.force.check(save)?;
    }
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
    let kind = job.device.kind();
    let loaded = match &mut job.command {
        RunCommand::Fair(fair) => fair.load(kind, messages),
        RunCommand::Inpaint(inpaint) => inpaint.load(kind, messages),
        RunCommand::Mcf(mcf) => {
            let mut reader = mcf.run.reader(kind, messages)?;
            reader.whole = Some((kind, Flow::MeanCurvature));
            reader.load()
        }
        RunCommand::Flow(flow) => flow.run.reader(kind, messages)?.load(),
    };
    match loaded? {
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
    fn start<const D: usize, O: Presentation<D>>(
        mut self,
        mut start: InitialShape<D, O>,
    ) -> Result<()> {
        let options = self.command.options();
        start.presentation.turn(&mut options.up)?;
        options.save.as_deref().map_or(Ok(()), O::check_saved)?;
        if let RunCommand::Flow(options) = &mut self.command {
            with_round_edges(options, &mut start.initial, &self.device, self.messages)?;
        }
        let (case, presentation) = self.command.case(start)?;
        // The options of which the same run can be made again.
        let mut noted = self.command.clone();
        // Standard output is not there any more when a run is resumed.
        if self.messages.to_pipe {
            noted.options().save = None;
        }
        // Where the noise ends the flow, no steps were chosen, and to say so would be to choose.
        if matches!(&noted, RunCommand::Fair(fair) if !fair.ends) {
            noted.options().steps = None;
        }
        let options = config::resolved(noted.name(), &noted)?;
        let plan = self.plan(presentation);
        let notes = plan.notes(&case, &self.device);
        let run = Run::new(case, &self.device)?;
        let folder = match &plan.options.output {
            Some(folder) => folder.clone(),
            None => free_folder(&format!("{}-{}", run.case().shape, plan.command)),
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
        let (case, presentation) = self.command.case(InitialShape {
            name,
            initial,
            presentation,
            region,
        })?;
        let plan = self.plan(presentation);
        let checkpoints = plan.checkpoints();
        let (store, run) = match more {
            Some(steps) => {
                notes["steps"] = steps.into();
                if stored.is_finished() {
                    notes["was_over"] = true.into();
                }
                let ends = |name: &str| presentation::is_of_end(name, plan.extension());
                Store::extend(stored, case, &self.device, checkpoints, notes, ends)?
            }
            None => Store::resume(stored, case, &self.device, checkpoints)?,
        };
        plan.go_on(store, run)
    }

    fn plan<const D: usize, O>(&mut self, presentation: O) -> Plan<D, O> {
        let format = match &self.command {
            RunCommand::Fair(fair) => fair.format.clone(),
            _ => None,
        };
        Plan {
            command: self.command.name(),
            presentation,
            format,
            options: self.command.options().clone(),
            messages: self.messages,
        }
    }
}
