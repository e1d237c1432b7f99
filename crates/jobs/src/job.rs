//! Jobs that make runs, from their options to the first step.

use engine::{Flow, Storage, Store};

use crate::case::with_round_edges;
use crate::command::Command;
use crate::input::{InitialShape, Loaded, Reader};
use crate::made::{Made, Results};
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

impl Command {
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
pub fn run_in_folder(command: Command, watcher: &dyn Watcher) -> Result<Outcome> {
    let (job, loaded) = Job::load(command, watcher)?;
    match loaded {
        Loaded::Plane(start) => job.start(start),
        Loaded::Space(start) => job.start(start),
    }
}

/// Makes a run in memory. Nothing is written: options of files are ignored.
///
/// # Errors
/// Refused options or input; whatever stops a flow; [`Error::Interrupted`].
pub fn run_in_memory(mut command: Command, watcher: &dyn Watcher) -> Result<Results> {
    command.options().save = None;
    let (job, loaded) = Job::load(command, watcher)?;
    Ok(match loaded {
        Loaded::Plane(start) => Results::Plane(job.make(start)?),
        Loaded::Space(start) => Results::Space(job.make(start)?),
    })
}

/// Continues a stored run, perhaps to more steps, with the options that it [was started with](settings::stored).
///
/// # Errors
/// As [`run_in_folder`], and for folders that hold no such run.
pub fn resume(
    mut command: Command,
    stored: StoredRun,
    more: Option<usize>,
    watcher: &dyn Watcher,
) -> Result<Outcome> {
    command.check()?;
    let usual = command.usual_steps();
    let options = command.options();
    // A run that has gone on once notes its steps.
    let noted = engine::notes(&stored)["steps"].as_u64();
    let noted = noted.map(|steps| steps as usize);
    options.steps = more.or(noted).or(options.steps).or(Some(usual));
    // That its folder is gone is no reason not to go on with a run.
    let is_gone = |save: &mut PathBuf| !save.parent().is_some_and(Path::is_dir);
    if let Some(path) = options.save.take_if(is_gone) {
        watcher.warning(&Warning::FolderGone { path });
    }
    let job = Job::new(command, watcher)?;
    match engine::dimension(&stored)? {
        2 => job.resume::<2, Plane>(stored, more),
        _ => job.resume::<3, Space>(stored, more),
    }
}

struct Job<'a> {
    command: Command,
    device: ComputeDevice,
    watcher: &'a dyn Watcher,
}

impl<'a> Job<'a> {
    fn new(mut command: Command, watcher: &'a dyn Watcher) -> Result<Self> {
        let options = command.options();
        options.operator.fill_in()?;
        if let Some(save) = &mut options.save {
            *save = absolute(&*save)?;
            options.force.check(save)?;
        }
        let device = options.common.open_device()?;
        Ok(Self {
            command,
            device,
            watcher,
        })
    }

    /// Reads the input.
    fn load(mut command: Command, watcher: &'a dyn Watcher) -> Result<(Self, Loaded)> {
        command.check()?;
        let steps = command.usual_steps();
        command.options().steps.get_or_insert(steps);
        let mut job = Self::new(command, watcher)?;
        let kind = job.device.kind();
        let loaded = match &mut job.command {
            Command::Fair(fair) => fair.load(kind, watcher),
            Command::Inpaint(inpaint) => inpaint.load(kind, watcher),
            Command::Mcf(mcf) => {
                let mut reader = mcf.run.reader(kind, watcher)?;
                reader.whole = Some((kind, Flow::MeanCurvature));
                reader.load()
            }
            Command::Flow(flow) => flow.run.reader(kind, watcher)?.load(),
        };
        Ok((job, loaded?))
    }

    /// The flow from a shape.
    fn prepare<const D: usize, O: Presentation<D>>(
        &mut self,
        mut start: InitialShape<D, O>,
    ) -> Result<(Case<D>, O)> {
        start.presentation.turn(&mut self.command.options().up)?;
        if let Some(options) = self.command.willmore() {
            options.check_sizes::<D>(self.watcher)?;
        }
        if let Command::Flow(options) = &mut self.command {
            with_round_edges(options, &mut start.initial, &self.device, self.watcher)?;
        }
        self.command.case(start)
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
        let save = self.command.options().save.as_deref();
        save.map_or(Ok(()), O::check_saved)?;
        let (case, presentation) = self.prepare(start)?;
        let options = self.options_to_store()?;
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
        let mut files = vec![(settings::FILE, options.as_bytes())];
        files.extend(inputs.iter().map(|(name, bytes)| (&**name, &bytes[..])));
        let store = Store::create(folder, &files, &run, notes, plan.checkpoints())?;
        plan.go_on(store, run)
    }

    /// The options of which the same run can be made again.
    fn options_to_store(&self) -> Result<String> {
        let mut noted = self.command.clone();
        if noted.options().saves_once {
            noted.options().save = None;
        }
        // Where the noise ends the flow, no steps were chosen, and to say so would be to choose.
        if matches!(&noted, Command::Fair(fair) if !fair.ends) {
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

    fn plan<const D: usize, O>(&mut self, presentation: O) -> Plan<'a, D, O> {
        let format = match &self.command {
            Command::Fair(fair) => fair.format.clone(),
            _ => None,
        };
        Plan {
            command: self.command.name(),
            presentation,
            format,
            options: self.command.options().clone(),
            watcher: self.watcher,
        }
    }
}
