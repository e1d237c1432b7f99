//! Jobs that make runs, from their options to the first step.

use engine::{Flow, Storage, Store};

use crate::case::with_round_edges;
use crate::events::{INPUT, PREPARATION, Silent, timed};
use crate::input::{InitialShape, Loaded, Opened, Reader};
use crate::job::Job;
use crate::made::{Made, Results};
use crate::notes::RunNotes;
use crate::options::{
    FairOptions, ForceOption, InputOptions, OperatorOptions, RunOptions, Stepper,
};
use crate::outcome::{Outcome, Room};
use crate::parts::Voxels;
use crate::paths::{absolute, real};
use crate::plane::Plane;
use crate::prelude::*;
use crate::presentation::{self, Presentation};
use crate::run::{Plan, free_folder, make_way};
use crate::settings;
use crate::space::Space;
use crate::steps::Steps;

impl ForceOption {
    /// Refuses a file to save that is there, or whose folder is not.
    ///
    /// # Errors
    /// [`Error::NoFolder`], [`Error::Exists`]
    pub fn check(self, path: &Path) -> Result<()> {
        let folder = path.parent().unwrap_or(path);
        if !(folder.as_os_str().is_empty() || folder.is_dir()) {
            return Err(Error::NoFolder(path.to_owned()));
        }
        if path.exists() && !self.force {
            return Err(Error::Exists(path.to_owned()));
        }
        Ok(())
    }
}

impl RunOptions {
    /// Refuses a file to save in the folder of the run: under the name of a file of the run it would damage it.
    fn check_apart(&self, save: &Path) -> Result<()> {
        let Some(output) = &self.output else {
            return Ok(());
        };
        let folder = output.canonicalize().or_else(|_| real(output))?;
        if real(save)?.starts_with(folder) {
            return Err(Error::SavedInTheRun(save.to_owned()));
        }
        Ok(())
    }
}

impl Job {
    /// Refuses options before anything is read.
    fn check(&mut self) -> Result<()> {
        match self {
            Self::Flow(_) => (),
            Self::Fair(fair) => fair.check()?,
            Self::Inpaint(inpaint) => inpaint.check()?,
            Self::Mcf(mcf) => {
                let operator = &mcf.operator;
                let chosen =
                    operator.network.is_some() || operator.formulation != Formulation::Accurate;
                if chosen && !mcf.method.is_learned() {
                    return Err(Refusal::FiniteElements.into());
                }
            }
        }
        let usual = self.usual_rule(f64::NAN, f64::NAN);
        let Some(options) = self.willmore() else {
            return Ok(());
        };
        if let Some(tolerance) = options.tolerance
            && options.tau.unwrap_or(usual) != StepRule::Controlled
        {
            return Err(Refusal::Tolerance(tolerance).into());
        }
        let rule = options.tau.unwrap_or(usual);
        if options.stepper == Some(Stepper::Direct) && rule == StepRule::Controlled {
            return Err(Refusal::ControlledDirect.into());
        }
        let sizes = [options.length, options.area, options.volume];
        if let Some(ramp) = options.ramp
            && options.reduced_volume.is_none()
            && sizes.iter().all(Option::is_none)
        {
            return Err(Refusal::Ramp(ramp).into());
        }
        Ok(())
    }
}

impl InputOptions {
    /// Reads the input, for Willmore flow by an operator on a device.
    pub(crate) fn reader<'a>(
        &'a mut self,
        operator: &OperatorOptions,
        device: DeviceKind,
        watcher: &'a dyn Watcher,
    ) -> Result<Reader<'a>> {
        let mut reader = Reader::of(self, operator.eps_over_h(), watcher)?;
        let is_dense = operator.storage == Some(Storage::Dense);
        reader.whole = is_dense.then_some((device, Flow::Willmore));
        reader.takes_bricks = !is_dense;
        Ok(reader)
    }
}

/// Makes a run in a folder, from its beginning.
///
/// # Errors
/// Refused options or input; whatever stops a flow. [`Error::Interrupted`] is none of them: an interrupted run is an outcome without a summary.
pub fn run_in_folder(job: Job, watcher: &dyn Watcher) -> Result<Outcome> {
    start(job, None, watcher)
}

/// Makes a run in a folder, and writes its result to this file in place of `save`. The folder does not name the file, so that a run that is
/// resumed does not write it again.
///
/// # Errors
/// As [`run_in_folder`].
pub fn run_and_save(mut job: Job, file: &Path, watcher: &dyn Watcher) -> Result<Outcome> {
    job.run().save = None;
    start(job, Some(file), watcher)
}

fn start(job: Job, save: Option<&Path>, watcher: &dyn Watcher) -> Result<Outcome> {
    let (session, loaded) = timed(watcher, INPUT, || Session::load(job, save, watcher))?;
    match loaded {
        Loaded::Plane(start) => session.start(start),
        Loaded::Space(start) => session.start(start),
    }
}

/// Makes a run in memory. Nothing is written: options of files are ignored.
///
/// # Errors
/// Refused options or input; whatever stops a flow; [`Error::Interrupted`].
pub fn run_in_memory(mut job: Job, watcher: &dyn Watcher) -> Result<Results> {
    job.run().save = None;
    let (session, loaded) = Session::load(job, None, watcher)?;
    Ok(match loaded {
        Loaded::Plane(start) => Results::Plane(session.make(start)?),
        Loaded::Space(start) => Results::Space(session.make(start)?),
    })
}

/// A flow in memory, and the voxels from which it came.
pub(crate) struct Flowed {
    /// The phase field at the end.
    pub field: Stored<3>,
    /// The interface width.
    pub eps: f64,
    /// The voxels, and the parts of them that did not flow.
    pub voxels: Voxels,
}

/// Makes the flow of a segmentation in memory; nothing is made of its end.
///
/// # Errors
/// As [`run_in_memory`].
pub(crate) fn flow_of_voxels(mut options: FairOptions, watcher: &dyn Watcher) -> Result<Flowed> {
    options.run.save = None;
    let (session, loaded) = Session::load(Job::Fair(options), None, watcher)?;
    match loaded {
        Loaded::Space(start) if start.presentation.voxels.is_some() => session.flowed(start),
        _ => Err(Refusal::SharedOfNoLabels.into()),
    }
}

/// Begins a job in memory whose steps are made one at a time. Nothing is written: options of files are ignored.
///
/// # Errors
/// Refused options or input.
pub fn begin(mut job: Job, watcher: &dyn Watcher) -> Result<Steps> {
    job.run().save = None;
    let (session, loaded) = Session::load(job, None, watcher)?;
    match loaded {
        Loaded::Plane(start) => session.begin(start),
        Loaded::Space(start) => session.begin(start),
    }
}

/// Continues a stored run, perhaps to more steps, with the options that it was started with: those of its [file](crate::settings::FILE).
///
/// # Errors
/// As [`run_in_folder`], and for folders that hold no such run.
pub fn resume(
    mut job: Job,
    stored: StoredRun,
    more: Option<usize>,
    watcher: &dyn Watcher,
) -> Result<Outcome> {
    job.check()?;
    let usual = job.usual_steps();
    let options = job.run();
    // A run that has gone on once notes its steps.
    let noted = RunNotes::of(&stored)?.steps;
    let steps = more.or(noted).or(options.steps).unwrap_or(usual);
    // That its folder is gone is no reason not to go on with a run.
    let is_gone = |save: &mut PathBuf| !save.parent().is_some_and(Path::is_dir);
    if let Some(path) = options.save.take_if(is_gone) {
        watcher.warning(&Warning::FolderGone { path });
    }
    let session = Session::new(job, steps, None, watcher).map_err(|error| match error {
        // There is no other name to give.
        Error::Exists(path) => Error::ExistsByNow(path),
        error => error,
    })?;
    match engine::dimension(&stored)? {
        2 => session.resume::<2, Plane>(stored, more),
        _ => session.resume::<3, Space>(stored, more),
    }
}

struct Session<'a> {
    job: Job,
    /// The run has no more steps.
    steps: usize,
    /// The file to which the result goes besides.
    save: Option<PathBuf>,
    device: ComputeDevice,
    watcher: &'a dyn Watcher,
}

impl<'a> Session<'a> {
    /// Resolves the options. The result goes to the file of `save` unless there is another one.
    fn new(
        mut job: Job,
        steps: usize,
        save: Option<&Path>,
        watcher: &'a dyn Watcher,
    ) -> Result<Self> {
        let options = job.groups();
        options.operator.fill_in()?;
        if let Some(save) = &mut options.run.save {
            *save = absolute(&*save)?;
        }
        let save = save.map(Path::to_owned).or(options.run.save.clone());
        if let Some(save) = &save {
            options.run.force.check(save)?;
            options.run.check_apart(save)?;
        }
        let device = options.common.open_device()?;
        Ok(Self {
            job,
            steps,
            save,
            device,
            watcher,
        })
    }

    /// Reads the input.
    fn load(mut job: Job, save: Option<&Path>, watcher: &'a dyn Watcher) -> Result<(Self, Loaded)> {
        job.check()?;
        let usual = job.usual_steps();
        let steps = job.run().steps.unwrap_or(usual);
        let mut session = Self::new(job, steps, save, watcher)?;
        let kind = session.device.kind();
        let loaded = match &mut session.job {
            Job::Fair(fair) => fair.load(kind, watcher),
            Job::Inpaint(inpaint) => inpaint.load(kind, watcher),
            Job::Mcf(mcf) => {
                let mut reader = mcf.input.reader(&mcf.operator, kind, watcher)?;
                reader.whole = Some((kind, Flow::MeanCurvature));
                reader.takes_bricks = false;
                reader.load()
            }
            Job::Flow(flow) => flow.input.reader(&flow.operator, kind, watcher)?.load(),
        };
        Ok((session, loaded?))
    }

    /// The flow from a shape.
    fn prepare<const D: usize, O: Presentation<D>>(
        &mut self,
        mut start: InitialShape<D, O>,
    ) -> Result<(Case<D>, O)> {
        start.presentation.turn(&mut self.job.run().up)?;
        if let Some(options) = self.job.willmore() {
            options.check_sizes::<D>(self.watcher)?;
        }
        if let Job::Flow(options) = &mut self.job {
            with_round_edges(options, &mut start.initial, &self.device, self.watcher)?;
        }
        self.job.case(start, self.steps)
    }

    fn make<const D: usize, O: Presentation<D>>(
        mut self,
        start: InitialShape<D, O>,
    ) -> Result<Made<D>> {
        let (case, presentation) = self.prepare(start)?;
        let run = Run::new(case, &self.device)?;
        self.plan(presentation).make(run)
    }

    fn flowed(mut self, start: InitialShape<3, Space>) -> Result<Flowed> {
        let (case, presentation) = self.prepare(start)?;
        let mut run = Run::new(case, &self.device)?;
        let mut plan = self.plan(presentation);
        plan.complete(&mut run)?;
        Ok(Flowed {
            field: run.stored().clone(),
            eps: run.case().scales.eps,
            voxels: plan.presentation.voxels.take().expect("there are voxels"),
        })
    }

    fn begin<const D: usize, O>(mut self, start: InitialShape<D, O>) -> Result<Steps>
    where
        O: Presentation<D> + Send + Sync + 'static,
        Made<D>: Into<Results>,
        Stored<D>: Into<Opened>,
    {
        let (case, presentation) = self.prepare(start)?;
        let run = Run::new(case, &self.device)?;
        let plan = Plan {
            watcher: &Silent,
            ..self.plan(presentation)
        };
        Ok(Steps::new(plan, run))
    }

    fn start<const D: usize, O: Presentation<D>>(
        mut self,
        start: InitialShape<D, O>,
    ) -> Result<Outcome> {
        let watcher = self.watcher;
        let (plan, store, run) = timed(watcher, PREPARATION, || self.stored(start))?;
        plan.go_on(store, run)
    }

    /// A run at its beginning, in its folder.
    fn stored<const D: usize, O: Presentation<D>>(
        &mut self,
        start: InitialShape<D, O>,
    ) -> Result<(Plan<'a, D, O>, Store, Run<D>)> {
        self.save.as_deref().map_or(Ok(()), O::check_saved)?;
        let (case, presentation) = self.prepare(start)?;
        let options = self.options_to_store()?;
        let plan = self.plan(presentation);
        let notes = plan.notes(&case, &self.device).to_json();
        let run = Run::new(case, &self.device)?;
        let folder = match &plan.options.output {
            Some(folder) => folder.clone(),
            None => free_folder(&format!("{}-{}", run.case().shape, plan.command)),
        };
        if plan.options.force.force {
            make_way(&folder, self.job.input())?;
        }
        let inputs = plan.presentation.inputs()?;
        let mut files = vec![(settings::FILE, options.as_bytes())];
        files.extend(inputs.iter().map(|(name, bytes)| (&**name, &bytes[..])));
        let store = Store::create(folder, &files, &run, notes, plan.checkpoints())?;
        Ok((plan, store, run))
    }

    /// The options of which the same run can be made again.
    fn options_to_store(&self) -> Result<String> {
        let mut noted = self.job.clone();
        // Where the noise ends the flow, no steps were chosen, and to say so would be to choose.
        let noise_ends = matches!(&noted, Job::Fair(fair) if !fair.says_when_to_end());
        noted.run().steps = Some(self.steps).filter(|_| !noise_ends);
        settings::resolved(&noted)
    }

    /// Continues a run from its last checkpoint, a finished one to more steps.
    fn resume<const D: usize, O: Presentation<D>>(
        mut self,
        stored: StoredRun,
        more: Option<usize>,
    ) -> Result<Outcome> {
        let mut notes = RunNotes::of(&stored)?;
        let name = notes.about.name.clone();
        let mut presentation: O = notes.presentation(&stored)?;
        let (initial, region) = engine::initial(&stored)?;
        presentation.restore(&stored)?;
        let start = InitialShape {
            name,
            initial,
            presentation,
            region,
        };
        let (case, presentation) = self.job.case(start, self.steps)?;
        let plan = self.plan(presentation);
        let checkpoints = plan.checkpoints();
        let (store, run) = match more {
            Some(steps) => {
                notes.steps = Some(steps);
                notes.was_over |= stored.is_finished();
                let notes = notes.to_json();
                let ends = |name: &str| presentation::is_of_end(name, plan.extension());
                Store::extend(stored, case, &self.device, checkpoints, notes, ends)?
            }
            None => Store::resume(stored, case, &self.device, checkpoints)?,
        };
        plan.go_on(store, run)
    }

    fn plan<const D: usize, O>(&mut self, presentation: O) -> Plan<'a, D, O> {
        let format = match &self.job {
            Job::Fair(fair) => fair.format.clone(),
            _ => None,
        };
        Plan {
            command: self.job.name(),
            presentation,
            format,
            options: self.job.run().clone(),
            steps: self.steps,
            save: self.save.clone(),
            room: Room::of(self.job.input()),
            watcher: self.watcher,
        }
    }
}
