//! Jobs that make runs, from their options to the first step.

use engine::{Flow, Storage, Store};

use crate::case::with_round_edges;
use crate::input::{InitialShape, Loaded, Reader};
use crate::job::Job;
use crate::made::{Made, Results};
use crate::notes::RunNotes;
use crate::options::{ForceOption, McfOptions, RunOptions};
use crate::outcome::Outcome;
use crate::paths::absolute;
use crate::plane::Plane;
use crate::prelude::*;
use crate::presentation::{self, Presentation};
use crate::run::{Plan, free_folder, make_way};
use crate::settings;
use crate::space::Space;

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

impl Job {
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
                        "`network` and `scheme` have no meaning for finite elements: leave them out, or choose `method` network"
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
                "`tolerance` {tolerance} is for controlled time steps: give `tau` controlled, or leave it out"
            );
        }
        let sizes = [flow.length, flow.area, flow.volume];
        if let Some(ramp) = flow.ramp
            && flow.reduced_volume.is_none()
            && sizes.iter().all(Option::is_none)
        {
            refuse!(
                "`ramp` {ramp} is for sizes that go to a target: give `length`, `area`, `volume` or `reduced_volume`, or leave it out"
            );
        }
        Ok(())
    }
}

impl RunOptions {
    /// Reads the input, for Willmore flow on a device.
    pub(crate) fn reader<'a>(
        &'a mut self,
        device: DeviceKind,
        watcher: &'a dyn Watcher,
    ) -> Result<Reader<'a>> {
        let mut reader = Reader::of(&mut self.input, self.operator.eps_over_h(), watcher)?;
        let is_dense = self.operator.storage == Some(Storage::Dense);
        reader.whole = is_dense.then_some((device, Flow::Willmore));
        Ok(reader)
    }
}

/// Makes a run in a folder, from its beginning.
///
/// # Errors
/// Refused options or input; whatever stops a flow. [`Error::Interrupted`] is none of them: an interrupted run is an outcome without a summary.
pub fn run_in_folder(job: Job, watcher: &dyn Watcher) -> Result<Outcome> {
    let (session, loaded) = Session::load(job, watcher)?;
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
    job.options().save = None;
    let (session, loaded) = Session::load(job, watcher)?;
    Ok(match loaded {
        Loaded::Plane(start) => Results::Plane(session.make(start)?),
        Loaded::Space(start) => Results::Space(session.make(start)?),
    })
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
    let options = job.options();
    // A run that has gone on once notes its steps.
    let noted = RunNotes::of(&stored)?.steps;
    options.steps = more.or(noted).or(options.steps).or(Some(usual));
    // That its folder is gone is no reason not to go on with a run.
    let is_gone = |save: &mut PathBuf| !save.parent().is_some_and(Path::is_dir);
    if let Some(path) = options.save.take_if(is_gone) {
        watcher.warning(&Warning::FolderGone { path });
    }
    let session = Session::new(job, watcher)?;
    match engine::dimension(&stored)? {
        2 => session.resume::<2, Plane>(stored, more),
        _ => session.resume::<3, Space>(stored, more),
    }
}

struct Session<'a> {
    job: Job,
    device: ComputeDevice,
    watcher: &'a dyn Watcher,
}

impl<'a> Session<'a> {
    fn new(mut job: Job, watcher: &'a dyn Watcher) -> Result<Self> {
        let options = job.options();
        options.operator.fill_in()?;
        if let Some(save) = &mut options.save {
            *save = absolute(&*save)?;
            options.force.check(save)?;
        }
        let device = options.common.open_device()?;
        Ok(Self {
            job,
            device,
            watcher,
        })
    }

    /// Reads the input.
    fn load(mut job: Job, watcher: &'a dyn Watcher) -> Result<(Self, Loaded)> {
        job.check()?;
        let steps = job.usual_steps();
        job.options().steps.get_or_insert(steps);
        let mut session = Self::new(job, watcher)?;
        let kind = session.device.kind();
        let loaded = match &mut session.job {
            Job::Fair(fair) => fair.load(kind, watcher),
            Job::Inpaint(inpaint) => inpaint.load(kind, watcher),
            Job::Mcf(mcf) => {
                let mut reader = mcf.run.reader(kind, watcher)?;
                reader.whole = Some((kind, Flow::MeanCurvature));
                reader.load()
            }
            Job::Flow(flow) => flow.run.reader(kind, watcher)?.load(),
        };
        Ok((session, loaded?))
    }

    /// The flow from a shape.
    fn prepare<const D: usize, O: Presentation<D>>(
        &mut self,
        mut start: InitialShape<D, O>,
    ) -> Result<(Case<D>, O)> {
        start.presentation.turn(&mut self.job.options().up)?;
        if let Some(options) = self.job.willmore() {
            options.check_sizes::<D>(self.watcher)?;
        }
        if let Job::Flow(options) = &mut self.job {
            with_round_edges(options, &mut start.initial, &self.device, self.watcher)?;
        }
        self.job.case(start)
    }

    fn make<const D: usize, O: Presentation<D>>(
        mut self,
        start: InitialShape<D, O>,
    ) -> Result<Made<D>> {
        let (case, presentation) = self.prepare(start)?;
        let run = Run::new(case, &self.device)?;
        self.plan(presentation).make(run)
    }

    fn start<const D: usize, O: Presentation<D>>(
        mut self,
        start: InitialShape<D, O>,
    ) -> Result<Outcome> {
        let save = self.job.options().save.as_deref();
        save.map_or(Ok(()), O::check_saved)?;
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
            make_way(&folder, &plan.options.input)?;
        }
        let inputs = plan.presentation.inputs()?;
        let mut files = vec![(settings::FILE, options.as_bytes())];
        files.extend(inputs.iter().map(|(name, bytes)| (&**name, &bytes[..])));
        let store = Store::create(folder, &files, &run, notes, plan.checkpoints())?;
        plan.go_on(store, run)
    }

    /// The options of which the same run can be made again.
    fn options_to_store(&self) -> Result<String> {
        let mut noted = self.job.clone();
        if noted.options().saves_once {
            noted.options().save = None;
        }
        // Where the noise ends the flow, no steps were chosen, and to say so would be to choose.
        if matches!(&noted, Job::Fair(fair) if !fair.ends) {
            noted.options().steps = None;
        }
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
        let (case, presentation) = self.job.case(InitialShape {
            name,
            initial,
            presentation,
            region,
        })?;
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
            options: self.job.options().clone(),
            watcher: self.watcher,
        }
    }
}
