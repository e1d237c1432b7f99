//! A run from its start, or from where it was stopped, to its end.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use geometry::{Field, Grid};
use operators::ComputeDevice;
use render::{Animation, Picture};
use report::Progress;
use runs::{
    GridShape, Identity, Interrupt, NetworkName, Resumed, RunDirectory, State, StoredRun,
    fingerprint,
};
use serde_json::{Map, Value, json};
use solver::FlowState;

use crate::cli::{KeepOptions, MeshFormat, SayOptions};
use crate::error::Error;
use crate::input::Start;
use crate::motion::{Memory, Motion};
use crate::outlet::{self, Outlet};
use crate::page;
use crate::scales;

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// All is done.
    Done,
    /// A signal came.
    Interrupted,
}

/// How far a run goes: to whatever comes first.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Number of steps.
    pub steps: usize,
    /// Time.
    pub time: Option<f64>,
    /// Willmore energy.
    pub energy: Option<f64>,
}

/// Everything about a run but its phase field.
pub struct Plan {
    /// Name of the subcommand.
    pub command: &'static str,
    /// All options, resolved.
    pub config: String,
    /// The network, if one is used.
    pub network: Option<NetworkName>,
    /// Interface width in cells.
    pub eps_over_h: f64,
    /// How far.
    pub stop: Stop,
    /// What is kept.
    pub keep: KeepOptions,
    /// Format of meshes.
    pub format: MeshFormat,
    /// A mesh to be written besides.
    pub save: Option<PathBuf>,
    /// The device.
    pub device: ComputeDevice,
    /// What is printed.
    pub say: SayOptions,
}

/// Time that a picture is shown.
const DELAY: Duration = Duration::from_millis(200);

/// Prints the outcome of a command: an object, or a text for people.
pub fn report(say: SayOptions, outcome: &Value, text: &str) {
    use std::io::Write;
    // A closed pipe (`| head`) is no reason to fail after the results have been written.
    if say.json {
        let _ = writeln!(std::io::stdout(), "{outcome}");
    } else if !say.quiet {
        let _ = writeln!(std::io::stdout(), "{text}");
    }
}

/// Progress bars, if anybody wants to see them.
pub fn progress(say: SayOptions) -> Progress {
    Progress::new(say.quiet || say.json)
}

impl Plan {
    fn identity<const D: usize>(&self, grid: &Grid<D>) -> Identity {
        Identity {
            kind: self.command.to_owned(),
            program: format!("willmore {}", env!("CARGO_PKG_VERSION")),
            grid: GridShape {
                cells: vec![grid.cells() as u64; D],
                side: grid.side(),
                origin: grid.origin().to_vec(),
            },
            network: self.network.clone(),
            options: fingerprint(&self.config),
        }
    }

    /// Refuses what cannot be done before anything is computed.
    ///
    /// # Errors
    /// [`Error::Options`].
    pub fn check(&self) -> Result<(), Error> {
        scales::check_eps_over_h(self.eps_over_h)?;
        let positive = |name: &str, value: Option<f64>| match value {
            Some(value) if !(value.is_finite() && value > 0.0) => {
                Err(Error::options(format!("{name} {value} must be positive")))
            }
            _ => Ok(()),
        };
        positive("--time", self.stop.time)?;
        positive("--energy", self.stop.energy)?;
        for (name, value) in [
            ("--steps", Some(self.stop.steps)),
            ("--frames", self.keep.frames),
            ("--checkpoint-every", Some(self.keep.checkpoint_every)),
        ] {
            if value == Some(0) {
                return Err(Error::options(format!("{name} must be at least 1")));
            }
        }
        Ok(())
    }

    /// Starts a run, and goes on to its end.
    ///
    /// # Errors
    /// What the run directory, the flow and the outlets raise.
    pub fn start<const D: usize, O: Outlet<D>>(
        &self,
        start: &Start<D, O>,
        motion: impl FnOnce(&Start<D, O>, &FlowState<D>) -> Result<Motion<D>, Error>,
        stored: Option<StoredRun>,
    ) -> Result<Ending, Error> {
        let identity = self.identity(start.field.grid());
        let state = FlowState {
            current: start.field.clone(),
            previous: None,
            half_motions: Vec::new(),
            step: 0,
            time: 0.0,
        };
        let motion = motion(start, &state)?;
        let mut run = match stored {
            // It was killed before its first commit.
            Some(stored) => stored.resume(&identity)?.run,
            None => {
                let folder = match &self.keep.output {
                    Some(folder) => folder.clone(),
                    None => free_folder(&format!("{}-{}", start.name, self.command)),
                };
                let manifest = json!({
                    "command": self.command,
                    "name": start.name,
                    "program": identity.program,
                    "network": self.network,
                    "device": format!("{} {:?}", self.device.kind(), self.device.dtype()).to_lowercase(),
                });
                RunDirectory::create(folder, &identity, &manifest, &self.config)?
            }
        };
        // Touching sheets have no topology; that is no reason not to flow.
        let topology = start.outlet.topology(&start.field, self.eps(&start.field));
        let memory = Memory {
            topology: topology.unwrap_or_default(),
            free: f64::from(!outlet::touches_box(&start.field)),
            ..Memory::START
        };
        // An inpainted region may have been all of it.
        if outlet::has_interface(&start.field) {
            let eps = self.eps(&start.field);
            (start.outlet).write_shape(&start.field, eps, outlet::START, self.format, &mut run)?;
        }
        if self.keep.frames.is_some() {
            self.frame(&start.outlet, &start.field, 0, &mut run)?;
        }
        run.commit(&pack(&state, &memory, start)?)?;
        self.go_on(run, start, motion, memory)
    }

    /// Continues a run from its last commit.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn resume<const D: usize, O: Outlet<D>>(
        &self,
        stored: StoredRun,
        motion: impl FnOnce(&Start<D, O>, &FlowState<D>) -> Result<Motion<D>, Error>,
    ) -> Result<Ending, Error> {
        let grid = grid_of::<D>(&stored.identity().grid)?;
        let Resumed { run, state, .. } = stored.resume(&self.identity(&grid))?;
        let state = state.ok_or_else(|| damaged(&run, "it has no checkpoint"))?;
        let (state, memory, start) = unpack::<D, O>(state, grid, &run)?;
        let motion = motion(&start, &state)?;
        self.go_on(run, &start, motion, memory)
    }

    fn go_on<const D: usize, O: Outlet<D>>(
        &self,
        mut run: RunDirectory,
        start: &Start<D, O>,
        mut motion: Motion<D>,
        mut memory: Memory,
    ) -> Result<Ending, Error> {
        let interrupt = Interrupt::catch()?;
        let progress = progress(self.say);
        let bar = progress.bar(
            format!("{} of {}", self.command, start.name),
            self.stop.steps as u64,
        );
        let clock = Instant::now();
        let ending = loop {
            let (step, time) = motion.position();
            bar.set_position(step as u64);
            let ended = self.is_over(step, time, &memory) || motion.is_still(&memory);
            if ended || is_gone(&motion.field()?, &memory) {
                break Ending::Done;
            }
            let row = match motion.advance(&mut memory, self.stop.time) {
                Ok(row) => row,
                Err(error) => {
                    // What was reached is kept.
                    run.commit(&pack(&motion.state()?, &memory, start)?)?;
                    return Err(error);
                }
            };
            run.metric(&row)?;
            if self
                .keep
                .frames
                .is_some_and(|every| row.step.is_multiple_of(every))
            {
                self.frame(&start.outlet, &motion.field()?, row.step, &mut run)?;
            }
            let interrupted = interrupt.requested();
            if interrupted || row.step.is_multiple_of(self.keep.checkpoint_every) {
                run.commit(&pack(&motion.state()?, &memory, start)?)?;
            }
            if interrupted {
                break Ending::Interrupted;
            }
        };
        let seconds = clock.elapsed().as_secs_f64();
        run.write_timings(&json!({ "seconds": seconds }))?;
        let folder = run.path().to_owned();
        let outcome = match ending {
            Ending::Interrupted => {
                let (step, time) = motion.position();
                drop(run);
                json!({ "command": self.command, "finished": false, "steps": step, "time": time })
            }
            Ending::Done => self.finish(run, start, &motion, &memory)?,
        };
        if !self.keep.no_page {
            page::write(&RunDirectory::open(&folder)?)?;
        }
        bar.finish();
        progress.clear();
        self.tell(outcome, &folder, seconds);
        Ok(ending)
    }

    fn eps<const D: usize>(&self, u: &Field<D>) -> f64 {
        self.eps_over_h * u.grid().spacing()
    }

    fn is_over(&self, step: usize, time: f64, memory: &Memory) -> bool {
        // What is left of a sum of steps after the last one is rounding.
        let reached = |end: f64| end - time <= 1e-12 * end;
        step >= self.stop.steps
            || self.stop.time.is_some_and(reached)
            || self
                .stop
                .energy
                .is_some_and(|energy| memory.energy <= energy)
    }

    fn frame<const D: usize, O: Outlet<D>>(
        &self,
        outlet: &O,
        u: &Field<D>,
        step: usize,
        run: &mut RunDirectory,
    ) -> Result<(), Error> {
        if !outlet::has_interface(u) {
            return Ok(());
        }
        outlet::write_picture(
            &outlet.picture(u, self.eps(u))?,
            &format!("{}/step-{step:06}.png", outlet::FRAMES),
            run,
        )
    }

    fn finish<const D: usize, O: Outlet<D>>(
        &self,
        mut run: RunDirectory,
        start: &Start<D, O>,
        motion: &Motion<D>,
        memory: &Memory,
    ) -> Result<Value, Error> {
        let state = motion.state()?;
        let u = &state.current;
        let measures = outlet::write_final(&start.outlet, u, self.eps(u), self.format, &mut run)?;
        if let Some(path) = &self.save {
            start.outlet.save(u, self.eps(u), path)?;
        }
        if self.keep.frames.is_some() {
            let animation =
                Animation::new(frames(&run.path().join(outlet::FRAMES))?, DELAY)?.to_apng()?;
            run.write_file("animation.png", |out| out.write_all(&animation))?;
        }
        let mut outcome = Map::new();
        outcome.insert("command".into(), self.command.into());
        outcome.insert("finished".into(), true.into());
        outcome.insert("steps".into(), state.step.into());
        outcome.insert("time".into(), state.time.into());
        if memory.energy.is_finite() {
            outcome.insert("first_energy".into(), memory.first_energy.into());
            outcome.insert("energy".into(), memory.energy.into());
        }
        if let Some(target) = self.stop.energy {
            outcome.insert("energy_reached".into(), (memory.energy <= target).into());
        }
        let first = memory.topology;
        outcome.insert("same_topology".into(), (measures.topology == first).into());
        if let Ok(Value::Object(measures)) = serde_json::to_value(&measures) {
            outcome.extend(measures);
        }
        let outcome = Value::Object(outcome);
        let text = format!("{outcome:#}\n");
        run.write_file(outlet::SUMMARY, |out| out.write_all(text.as_bytes()))?;
        run.finish(&pack(&state, memory, start)?)?;
        Ok(outcome)
    }

    fn tell(&self, outcome: Value, folder: &Path, seconds: f64) {
        let number = |name: &str| outcome.get(name).and_then(Value::as_f64);
        let steps = outcome.get("steps").and_then(Value::as_u64).unwrap_or(0);
        let time = number("time").unwrap_or(0.0);
        let finished = outcome.get("finished") == Some(&Value::Bool(true));
        let is = |name: &str, value: bool| outcome.get(name) == Some(&Value::Bool(value));
        let mut text = vec![format!("{steps} steps to t = {time:.4e} in {seconds:.1} s")];
        if let (Some(first), Some(energy)) = (number("first_energy"), number("energy")) {
            text.push(format!("Willmore energy {energy:.4}, before {first:.4}"));
        }
        let notes = [
            (
                is("energy_reached", false),
                "the energy asked for was not reached, go on with more --steps or --time",
            ),
            (
                outcome.get("components") == Some(&json!(0)),
                "the shape has vanished",
            ),
            (
                is("same_topology", false),
                "parts or holes have come or gone: if they should not, use more --cells or a larger --side-length",
            ),
            (
                is("touches_box", true),
                "the shape has come to the side of the box: start with a smaller --side-length",
            ),
        ];
        text.extend(
            notes
                .into_iter()
                .filter(|(holds, _)| *holds)
                .map(|(_, note)| note.to_owned()),
        );
        text.push(if finished {
            let page = if self.keep.no_page {
                String::new()
            } else {
                format!(", to look at: {}", folder.join(page::NAME).display())
            };
            format!("results are in {}{page}", folder.display())
        } else {
            format!(
                "interrupted, go on with: willmore resume {}",
                folder.display()
            )
        });
        let mut outcome = outcome;
        if let Value::Object(map) = &mut outcome {
            map.insert("run".into(), folder.to_string_lossy().into());
            map.insert("seconds".into(), seconds.into());
        }
        report(self.say, &outcome, &text.join("\n"));
    }
}

/// Whether the shape has vanished, or has come to the side of the box, where it would act on itself.
fn is_gone<const D: usize>(u: &Field<D>, memory: &Memory) -> bool {
    !outlet::has_interface(u) || (memory.free > 0.5 && outlet::touches_box(u))
}

fn damaged(run: &RunDirectory, what: &str) -> Error {
    Error::options(format!(
        "{} cannot be resumed: {what}; start a new run",
        run.path().display()
    ))
}

/// The grid that a run is on.
fn grid_of<const D: usize>(shape: &GridShape) -> Result<Grid<D>, Error> {
    let origin: Option<[f64; D]> = shape.origin.as_slice().try_into().ok();
    let cells = shape.cells.first().and_then(|&n| usize::try_from(n).ok());
    match (origin, cells) {
        (Some(origin), Some(cells)) => Ok(Grid::new(cells, shape.side)?.with_origin(origin)?),
        _ => Err(Error::options(format!(
            "{shape} is no grid in {D}D; start a new run"
        ))),
    }
}

/// What is committed: a run goes on from it without its input.
fn pack<const D: usize, O: Outlet<D>>(
    state: &FlowState<D>,
    memory: &Memory,
    start: &Start<D, O>,
) -> Result<State, Error> {
    let outlet = serde_json::to_value(&start.outlet)
        .map_err(|error| Error::options(format!("the view cannot be stored: {error}")))?;
    let mut packed = State::new(state.step as u64, state.time);
    packed.notes = json!({ "name": start.name, "outlet": outlet, "topology": memory.topology });
    packed = packed.with_array("current", state.current.values().to_vec());
    let mut last = f64::NAN;
    if let Some((previous, tau)) = &state.previous {
        packed = packed.with_array("previous", previous.values().to_vec());
        last = *tau;
    }
    let Memory {
        next,
        first_energy,
        energy,
        free,
        still,
        ..
    } = *memory;
    packed = packed.with_array(
        "memory",
        vec![last, next, first_energy, energy, free, still],
    );
    if let Some(region) = &start.region {
        packed = packed.with_array("region", region.iter().map(|&r| f64::from(r)).collect());
    }
    Ok(packed)
}

fn unpack<const D: usize, O: Outlet<D>>(
    mut packed: State,
    grid: Grid<D>,
    run: &RunDirectory,
) -> Result<(FlowState<D>, Memory, Start<D, O>), Error> {
    let has = |packed: &State, name: &str| packed.arrays.iter().any(|(other, _)| other == name);
    let notes = packed.notes.take();
    let name = notes["name"].as_str().unwrap_or("run").to_owned();
    let outlet = serde_json::from_value(notes["outlet"].clone())
        .map_err(|error| damaged(run, &error.to_string()))?;
    let [last, next, first_energy, energy, free, still] = packed.take_array("memory")?[..] else {
        return Err(damaged(run, "its checkpoint is of another version"));
    };
    let current = Field::from_values(grid, packed.take_array("current")?)?;
    let previous = if has(&packed, "previous") {
        Some((
            Field::from_values(grid, packed.take_array("previous")?)?,
            last,
        ))
    } else {
        None
    };
    let region = if has(&packed, "region") {
        Some(
            packed
                .take_array("region")?
                .iter()
                .map(|&r| r > 0.5)
                .collect(),
        )
    } else {
        None
    };
    let start = Start {
        name,
        field: current.clone(),
        outlet,
        region,
    };
    let step =
        usize::try_from(packed.step).map_err(|_| damaged(run, "its step is no number of steps"))?;
    let state = FlowState {
        current,
        previous,
        half_motions: Vec::new(),
        step,
        time: packed.time,
    };
    let topology = serde_json::from_value(notes["topology"].clone())
        .map_err(|error| damaged(run, &error.to_string()))?;
    let memory = Memory {
        next,
        first_energy,
        energy,
        free,
        topology,
        still,
    };
    Ok((state, memory, start))
}

/// `runs/NAME`, with the first number that is free.
fn free_folder(name: &str) -> PathBuf {
    let folder = Path::new("runs").join(name);
    let numbered = (2..).map(|k| Path::new("runs").join(format!("{name}-{k}")));
    std::iter::once(folder)
        .chain(numbered)
        .find(|folder| !folder.exists())
        .expect("some number is free")
}

/// The pictures in a folder, in the order of their names.
fn frames(folder: &Path) -> Result<Vec<Picture>, Error> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| Error::Io {
            action: "read",
            path,
            source,
        }
    };
    let mut paths = std::fs::read_dir(folder)
        .and_then(|entries| {
            entries
                .map(|entry| Ok(entry?.path()))
                .collect::<Result<Vec<_>, _>>()
        })
        .map_err(failed(folder))?;
    paths.sort();
    paths
        .iter()
        .map(|path| {
            let bytes = std::fs::read(path).map_err(failed(path))?;
            decode(&bytes).map_err(|error| failed(path)(error.into()))?
        })
        .collect()
}

/// A picture that this program has written: eight bits, with or without opacity.
fn decode(bytes: &[u8]) -> Result<Result<Picture, Error>, png::DecodingError> {
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info()?;
    let size = reader.output_buffer_size().unwrap_or(0);
    let mut data = vec![0; size];
    let info = reader.next_frame(&mut data)?;
    let channels = info.color_type.samples();
    let pixels = data[..info.buffer_size()].chunks_exact(channels).map(|p| {
        [
            p[0],
            p[1 % channels],
            p[2 % channels],
            p.get(3).copied().unwrap_or(255),
        ]
    });
    Ok(Picture::new(info.width, info.height, pixels.collect()).map_err(Error::from))
}
