//! A run from its start, or from where it was stopped, to its end.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fmt::Write;
use std::time::Instant;

use engine::{Checkpoints, Event, Observer, Store, energy_increases, estimated_time_error};
use files::FileSystem as _;
use geometry::measure::touches_side;
use solver::{PhaseTimes, StepEstimates};

use crate::events::{MEASURES, OTHER_OF_STEPS, OUTPUT, PAGE, PICTURES, Progress, SURFACE, timed};
use crate::faired::{Faired, MeshReport};
use crate::made::{Made, Shape};
use crate::notes::{About, NetworkNote, RunNotes};
use crate::options::{InputOptions, RunOptions};
use crate::outcome::{
    DirectReport, GridSummary, Outcome, Remedies, Room, SIZES, Summary, TimeAccuracy,
};
use crate::page;
use crate::paths::extension;
use crate::prelude::*;
use crate::presentation::{self, Presentation, Topology};

/// Everything about a run but its case.
pub struct Plan<'a, const D: usize, O> {
    pub command: &'static str,
    pub presentation: O,
    pub options: RunOptions,
    pub steps: usize,
    /// The file to which the result goes besides.
    pub save: Option<PathBuf>,
    /// The extension of meshes, if it is not the usual one.
    pub format: Option<String>,
    /// What gives the shape room in its box.
    pub room: Room,
    pub watcher: &'a dyn Watcher,
}

impl<const D: usize, O: Presentation<D>> Plan<'_, D, O> {
    /// What is kept with the run.
    pub fn notes(&self, case: &Case<D>, device: &ComputeDevice) -> RunNotes {
        let network = case.operator.network();
        let before = self.format.as_deref().unwrap_or(O::USUAL);
        RunNotes {
            about: About {
                command: self.command.to_owned(),
                name: case.shape.clone(),
                program: format!("willmore {}", env!("CARGO_PKG_VERSION")),
                network: network.map(|named| NetworkNote {
                    name: named.name.clone(),
                    checksum: named.network.fingerprint(),
                }),
                device: format!("{} {:?}", device.kind(), device.dtype()).to_lowercase(),
            },
            presentation: json!(self.presentation),
            extensions: [before, self.extension()].map(str::to_owned),
            steps: None,
            was_over: false,
        }
    }

    pub fn checkpoints(&self) -> Checkpoints {
        Checkpoints::EverySteps(self.options.checkpoint_every)
    }

    /// The extension of the shape at the end.
    pub fn extension(&self) -> &str {
        let chosen = self.format.as_deref();
        chosen.unwrap_or_else(|| self.presentation.extension())
    }

    /// From the last checkpoint to the end.
    pub fn go_on(&self, mut store: Store, mut run: Run<D>) -> Result<Outcome> {
        let folder = store.directory().path().to_owned();
        (self.watcher).stores(self.command, &folder, self.save.as_deref());
        let clock = Instant::now();
        let ended = self.advance(Some(&mut store), &mut run)?;
        let seconds = clock.elapsed().as_secs_f64();
        let mut summary = None;
        if ended {
            let finish = || self.finish(store, &run);
            summary = Some(timed(self.watcher, OUTPUT, finish)?);
        } else {
            drop(store);
        }
        let page = (!self.options.no_page).then(|| folder.join(presentation::PAGE));
        if page.is_some() {
            let write = || page::write(&RunDirectory::open(&folder)?);
            timed(self.watcher, PAGE, write)?;
        }
        Ok(Outcome {
            command: self.command,
            folder,
            steps: run.steps(),
            time: run.time(),
            ended: run.ended(),
            summary,
            page,
            save: self.save.clone(),
            seconds,
        })
    }

    /// From the beginning to the end, in memory.
    pub fn make(&self, mut run: Run<D>) -> Result<Made<D>> {
        self.complete(&mut run)?;
        self.made(&run)
    }

    /// From the beginning to the end, in memory; nothing is made of the end.
    pub fn complete(&self, run: &mut Run<D>) -> Result<()> {
        if self.advance(None, run)? {
            Ok(())
        } else {
            Err(Error::Interrupted)
        }
    }

    /// The results so far, in memory.
    pub fn made(&self, run: &Run<D>) -> Result<Made<D>> {
        let (u, eps) = (run.stored(), run.case().scales.eps);
        let (mut mesh, mut topology, mut shape) = (None, Topology::default(), None);
        if has_interface(u) {
            let faired = self.presentation.faired(&run.case().initial, u, eps)?;
            mesh = faired.as_ref().map(|faired| faired.report.clone());
            topology = self.presentation.topology(u)?;
            shape = Some(self.presentation.shape(u, eps, faired)?);
        }
        Ok(Made {
            summary: self.summary(run, topology, mesh)?,
            ended: run.ended(),
            records: run.records().to_vec(),
            field: seen(run),
            shape,
        })
    }

    /// The shape of a phase field of the run that began at `start`, unless it has vanished.
    pub fn shape(&self, start: &Stored<D>, u: &Stored<D>, eps: f64) -> Result<Option<Shape>> {
        if !has_interface(u) {
            return Ok(None);
        }
        let faired = self.presentation.faired(start, u, eps)?;
        Ok(Some(self.presentation.shape(u, eps, faired)?))
    }

    /// Makes the steps, and says whether the run is over and was not interrupted.
    fn advance(&self, store: Option<&mut Store>, run: &mut Run<D>) -> Result<bool> {
        let interrupt = self.watcher.interrupt()?;
        let stored = run.stored_cells();
        self.watcher.note(&Note::Storage {
            part: stored as f64 / run.case().grid().len() as f64,
            bytes: run.case().bytes(stored),
        });
        let title = format!("{} of {}", self.command, run.case().shape);
        let progress = self.watcher.begins(&title, self.steps as u64);
        let mut steps = Steps(&*progress);
        let mut pictures = Pictures {
            plan: self,
            topology: None,
        };
        let observers: &mut [&mut dyn Observer<D>] = &mut [&mut steps, &mut pictures];
        let (clock, before) = (Instant::now(), run.records().len());
        let ended = run.advance(store, observers, &interrupt)?;
        self.tell_times(&run.records()[before..], clock.elapsed().as_secs_f64());
        Ok(ended.is_some())
    }

    /// Tells where the time of some steps went.
    fn tell_times(&self, made: &[Record], seconds: f64) {
        let mut steps = 0.0;
        let mut times = PhaseTimes::default();
        for made in engine::minimizations(made) {
            (steps, times) = (steps + made.seconds, times + made.times);
        }
        let mut named = 0.0;
        for (part, seconds) in times.parts() {
            self.watcher.spent(part, seconds);
            named += seconds;
        }
        self.watcher.spent(OTHER_OF_STEPS, steps - named);
        self.watcher.spent(MEASURES, seconds - steps);
    }

    fn finish(&self, mut store: Store, run: &Run<D>) -> Result<Summary> {
        let (case, u, presentation) = (run.case(), run.stored(), &self.presentation);
        let (start, eps) = (&case.initial, case.scales.eps);
        let directory = store.directory();
        // Those of an earlier end of a run that went on.
        directory.remove_others(|name| presentation::is_of_end(name, self.extension()))?;
        Event {
            run,
            directory: Some(directory),
        }
        .write_field("final.npy")?;
        // What has vanished leaves no shape behind.
        let (mut faired, mut topology) = (None, Topology::default());
        if has_interface(u) {
            let make = || presentation.faired(start, u, eps);
            faired = timed(self.watcher, SURFACE, make)?;
        }
        self.write(run, faired.as_ref(), presentation::FINAL, directory)?;
        if has_interface(u) {
            topology = timed(self.watcher, SURFACE, || presentation.topology(u))?;
            if let Some(path) = &self.save {
                self.save(u, eps, faired.as_ref(), path)?;
            }
        } else if self.save.is_some() {
            self.watcher.warning(&Warning::NothingSaved);
        }
        if self.options.frames.is_some() {
            write_film(run, directory)?;
        }
        let summary = self.summary(run, topology, faired.map(|faired| faired.report))?;
        let text = format!("{:#}\n", summary.to_json());
        directory.write_file(presentation::SUMMARY, text.as_bytes())?;
        store.finish(run)?;
        Ok(summary)
    }

    fn summary(
        &self,
        run: &Run<D>,
        topology: Topology,
        mesh: Option<MeshReport>,
    ) -> Result<Summary> {
        let (case, u) = (run.case(), run.stored());
        let eps = case.scales.eps;
        let before = match self.presentation.input() {
            Some(of_input) => of_input,
            None => self.presentation.topology(&case.initial)?,
        };
        let (first, last) = (run.records().first(), run.records().last());
        let energy = last.and_then(Record::willmore_energy);
        let first_energy = first.and_then(Record::energy_at_rest);
        let is_willmore = case.energy.is_willmore();
        let spheres = energy.filter(|_| D == 3 && is_willmore);
        let targets = case.stops.iter().filter_map(|stop| match stop {
            Stop::Energy(target) => Some(*target),
            Stop::EnergyRatio(part) => Some(part * first_energy?),
            _ => None,
        });
        let slope = ZeroSet::of(u, eps)?.slope;
        let has_end_time = self.options.time.is_some();
        // The first one that is reached ends the flow.
        let target = targets.reduce(f64::max);
        Ok(Summary {
            command: self.command.to_owned(),
            finished: true,
            steps: run.steps(),
            time: run.time(),
            time_steps: time_accuracy(run.records(), eps).filter(|_| has_interface(u)),
            direct_steps: direct_report(run.records(), case.grid().spacing()),
            shortened_steps: run.records().iter().filter(|r| is_shortened(r)).count(),
            first_energy,
            energy,
            energy_terms: energy.filter(|_| !is_willmore).map(|_| case.energy),
            energy_over_8_pi: spheres.map(|energy| energy / (8.0 * PI)),
            energy_reached: target.map(|target| energy.is_some_and(|energy| energy <= target)),
            sizes_reached: (case.held.steps() > 0).then(|| run.sizes_are_reached()),
            interface_slope: slope.is_finite().then_some(slope),
            components: topology.components,
            euler_characteristic: topology.euler_characteristic,
            same_topology: topology == before,
            touches_box: touches_box(run),
            mesh,
            grid: GridSummary {
                cells: case.grid().cells(),
                spacing: case.grid().spacing(),
                origin: case.grid().origin().to_vec(),
                interface_width: eps,
                stored_cells: run.stored_cells(),
            },
            measures: measures(run),
            remedies: Remedies::of(run.ended().as_ref(), has_end_time, self.room),
        })
    }

    /// Writes the field for ParaView and, unless the shape has vanished, a picture and the shape to files `stem.*` of a run.
    fn write(
        &self,
        run: &Run<D>,
        faired: Option<&Faired>,
        stem: &str,
        directory: &mut RunDirectory,
    ) -> Result<()> {
        let u = run.stored();
        if has_interface(u) {
            let (start, eps) = (&run.case().initial, run.case().scales.eps);
            let of_shape =
                || -> Result<Vec<u8>> { Ok(self.presentation.picture(start, u, eps)?.to_png()?) };
            let of_displacement = || {
                faired
                    .map(|faired| -> Result<String> { Ok(faired.displacement.figure()?.to_svg()?) })
            };
            let draw = || rayon::join(of_shape, of_displacement);
            let (picture, figure) = timed(self.watcher, PICTURES, draw);
            directory.write_file(&format!("{stem}.png"), &picture?)?;
            if let Some(figure) = figure.transpose()? {
                directory.write_file(presentation::DISPLACEMENT, figure.as_bytes())?;
            }
            self.write_shape(u, eps, faired, stem, directory)?;
        }
        let name = format!("{stem}.vti");
        let path = directory.path().join(&name);
        vti::write(path, "phase_field", &run.current())?;
        Ok(directory.adopt_file(&name)?)
    }

    /// Writes the shape to a file `stem.*` of a run.
    fn write_shape(
        &self,
        u: &Stored<D>,
        eps: f64,
        faired: Option<&Faired>,
        stem: &str,
        run: &mut RunDirectory,
    ) -> Result<()> {
        let usual = faired.map_or(O::USUAL, |_| self.presentation.extension());
        let name = format!("{stem}.{}", self.format.as_deref().unwrap_or(usual));
        self.save(u, eps, faired, &run.path().join(&name))?;
        Ok(run.adopt_file(&name)?)
    }

    /// Writes the shape, or what became of the surface that it was, to a file.
    fn save(&self, u: &Stored<D>, eps: f64, faired: Option<&Faired>, path: &Path) -> Result<()> {
        let format = extension(path);
        let bytes = match faired {
            Some(faired) => faired.surface.encode(&format)?,
            None => self.presentation.encode(u, eps, &format)?,
        };
        if format == "stl" {
            warn_of_single_precision(&bytes, path, self.watcher);
        }
        Ok(files::write_atomically(path, |out| out.write_all(&bytes))?)
    }
}

/// Warns if the coordinates of an STL file, which are in single precision, are rounded by much for its triangles.
fn warn_of_single_precision(bytes: &[u8], path: &Path, watcher: &dyn Watcher) {
    /// The part of an edge that is told.
    const MUCH: f64 = 1e-3;
    // What cannot be read again has no edges any more.
    let part = surfaces::decode(bytes, path).map_or(1.0, |mesh| mesh.single_rounding());
    if part > MUCH {
        let path = path.to_owned();
        watcher.warning(&Warning::SinglePrecision { path, part });
    }
}

/// The phase field at the present time, with the values that a region keeps where no brick is stored.
pub fn seen<const D: usize>(run: &Run<D>) -> Stored<D> {
    match run.case().region {
        Some(_) => Stored::whole(run.field().clone()),
        None => run.stored().clone(),
    }
}

/// Whether the shape touches the side of the box, beyond which its periodic image is.
pub fn touches_box<const D: usize>(run: &Run<D>) -> bool {
    touches_side(run.stored(), -0.5)
}

/// The measures at the end, and by how much in percent sizes have changed.
fn measures<const D: usize>(run: &Run<D>) -> BTreeMap<String, Option<f64>> {
    let last = run.records().last();
    let mut all = BTreeMap::new();
    for (name, value) in last.map_or(run.start(), |record| &record.measures) {
        all.insert(name.clone(), Some(*value).filter(|value| value.is_finite()));
        let before = run.start().get(name).filter(|_| SIZES.contains(&&**name));
        if let Some(before) = before.filter(|before| **before > 0.0) {
            let change = 100.0 * (value / before - 1.0);
            all.insert(format!("{name}_change_percent"), Some(change));
        }
    }
    all
}

/// Writes the animation of the frames and their list for `ParaView`. There are none of a shape that is never there.
fn write_film<const D: usize>(run: &Run<D>, directory: &mut RunDirectory) -> Result<()> {
    let (pictures, series) = frames(directory.path(), run.records());
    if pictures.is_empty() {
        return Ok(());
    }
    let frame = |index: usize| -> Result<Picture> {
        let picture = &pictures[index];
        Ok(images::colours(picture, &files::read(picture)?)?)
    };
    let animation = render::animation(pictures.len(), frame)?;
    directory.write_file(presentation::ANIMATION, &animation)?;
    directory.write_file(presentation::SERIES, series.as_bytes())?;
    Ok(())
}

/// Tells how many steps are complete.
struct Steps<'a>(&'a dyn Progress);

impl<const D: usize> Observer<D> for Steps<'_> {
    fn observe(&mut self, event: &mut Event<'_, D>) -> Result<(), engine::Error> {
        if let Some(step) = event.step() {
            self.0.reach(step as u64);
        }
        Ok(())
    }
}

/// Writes the shape at the beginning, unless it is the input, and pictures of it in between, and says when its parts or holes change.
struct Pictures<'a, const D: usize, O> {
    plan: &'a Plan<'a, D, O>,
    topology: Option<Topology>,
}

impl<const D: usize, O: Presentation<D>> Observer<D> for Pictures<'_, D, O> {
    fn observe(&mut self, event: &mut Event<'_, D>) -> Result<(), engine::Error> {
        // An inpainted region may have been all of the shape.
        let (Some(step), true) = (event.step(), has_interface(event.run.stored())) else {
            return Ok(());
        };
        let (case, u, plan) = (event.run.case(), event.run.stored(), self.plan);
        let eps = case.scales.eps;
        let failed = |error: Error| engine::Error::Observer(error.into());
        let frames = plan.options.frames;
        if let Some(directory) = event.directory.as_deref_mut() {
            if step == 0 && !plan.presentation.starts_as_input() {
                let written = plan.write_shape(u, eps, None, presentation::START, directory);
                written.map_err(failed)?;
            }
            if frames.is_some_and(|every| step.is_multiple_of(every)) {
                let name = presentation::frame(step);
                let written = plan.write(event.run, None, &name, directory);
                written.map_err(failed)?;
            }
        }
        let now = plan.presentation.topology(u).map_err(failed)?;
        if let Some(before) = self.topology.replace(now).filter(|before| *before != now) {
            let time = event.run.time();
            plan.watcher.note(&Note::TopologyChanged {
                step,
                time,
                before,
                now,
            });
        }
        Ok(())
    }
}

/// Removes the run in a folder, if there is one that nobody works on. A folder of something else stays, and so does one with something else,
/// or with the input.
pub fn make_way(folder: &Path, input: &InputOptions) -> Result<()> {
    let stored = match RunDirectory::recover(folder) {
        Ok(stored) => stored,
        Err(error @ (runs::Error::Locked(_) | runs::Error::Version { .. })) => {
            return Err(error.into());
        }
        Err(_) => return Ok(()),
    };
    let whole = |path: &Path| path.canonicalize().ok();
    if let (Some(input), Some(folder)) = (&input.input, whole(folder))
        && whole(&input.path()).is_some_and(|input| input.starts_with(folder))
    {
        return Err(Error::InputInTheRun(input.to_string()));
    }
    stored.tidy()?;
    if let Some(other) = foreign(&stored) {
        return Err(Error::NotOfTheRun(other));
    }
    // The folder itself stays: it may be the one that the program works in, a link, or a disk.
    let empty = || -> std::io::Result<()> {
        std::fs::read_dir(folder)?.try_for_each(|entry| files::Disk.remove(&entry?.path()))
    };
    Ok(empty().map_err(files::Error::of("empty", folder))?)
}

/// What is in the folder of a run, or of its frames, and not of the run.
fn foreign(stored: &StoredRun) -> Option<PathBuf> {
    // Of another program, nothing is known.
    let extensions = RunNotes::of(stored).map_or_else(|_| Default::default(), |n| n.extensions);
    let frames = stored.path().join(presentation::FRAMES);
    // Where no commit knows a frame, none are listed but their folder.
    let left = stored.leftovers().flat_map(|path| match path.read_dir() {
        Ok(entries) if path == frames => entries.flatten().map(|entry| entry.path()).collect(),
        _ => vec![path.to_owned()],
    });
    let is_own = |path: &Path| {
        let name = path.strip_prefix(stored.path());
        path.is_file() && name.is_ok_and(|name| presentation::is_written(name, &extensions))
    };
    left.filter(|path| path.exists()).find(|path| !is_own(path))
}

/// `runs/NAME`, with the first number that is free.
pub fn free_folder(name: &str) -> PathBuf {
    let numbered = (2..).map(|k| format!("{name}-{k}"));
    let names = std::iter::once(name.to_owned()).chain(numbered);
    let mut folders = names.map(|name| Path::new("runs").join(name));
    let free = folders.find(|folder| !folder.exists());
    free.expect("some number is free")
}

/// Whether a step was made shorter than its rule wanted it. Controlled steps have no such size: they are made again until they are accurate enough.
fn is_shortened(record: &Record) -> bool {
    record.halvings > 0 && estimates(record).is_none()
}

/// What a controlled step says of itself.
fn estimates(record: &Record) -> Option<StepEstimates> {
    record.minimization?.estimates
}

/// What controlled steps say of themselves: their [estimated error](estimated_time_error), the way of the place that moves farthest in each,
/// and the longest displacement of a stage in interface widths.
fn time_accuracy(records: &[Record], eps: f64) -> Option<TimeAccuracy> {
    let estimates = records.iter().filter_map(estimates);
    let longest = estimates.clone().map(|e| e.displacement);
    let longest = longest.reduce(f64::max)?;
    Some(TimeAccuracy {
        estimated_error: estimated_time_error(records),
        path: estimates.map(|e| e.motion).sum::<f64>(),
        longest_displacement_in_widths: longest / eps,
    })
}

/// What direct steps say of themselves.
fn direct_report(records: &[Record], spacing: f64) -> Option<DirectReport> {
    let steps = records.iter().filter_map(Record::direct);
    let last = steps.clone().next_back()?;
    Some(DirectReport {
        convolutions: steps.map(|step| step.convolutions).sum(),
        run_distance: last.run_distance,
        reach_in_cells: Some(last.reach / spacing),
        energy_increases: energy_increases(records),
    })
}

/// The files of the pictures of the frames in the folder of a run, and their fields with their times, for `ParaView`.
fn frames(run: &Path, records: &[Record]) -> (Vec<PathBuf>, String) {
    let mut pictures = Vec::new();
    let mut series =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n  <Collection>\n"
            .to_owned();
    let complete = records.iter().filter(|record| record.completes_step);
    let times = complete.map(|record| (record.step, record.time));
    for (step, time) in std::iter::once((0, 0.0)).chain(times) {
        let name = presentation::frame(step);
        let picture = run.join(format!("{name}.png"));
        if picture.exists() {
            pictures.push(picture);
            let _ = writeln!(
                series,
                "    <DataSet timestep=\"{time}\" file=\"{name}.vti\"/>"
            );
        }
    }
    (pictures, series + "  </Collection>\n</VTKFile>\n")
}
