//! A run from its start, or from where it was stopped, to its end.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use engine::{Case, Checkpoints, Ending, Event, Observer, Record, Run, Stop, Store};
use geometry::measure::{has_interface, touches_side};
use operators::ComputeDevice;
use render::Picture;
use runs::{Interrupt, RunDirectory, StoredRun};
use serde_json::{Value, json};

use crate::cli::{KeepOptions, MeshFormat, SayOptions};
use crate::config;
use crate::error::Error;
use crate::outlet::{self, Outlet};
use crate::own::Faired;
use crate::page;

/// Everything about a run but its case.
pub struct Plan<O> {
    /// Name of the subcommand.
    pub command: &'static str,
    /// Name of the input.
    pub name: String,
    /// How the shape is shown.
    pub outlet: O,
    /// What is kept.
    pub keep: KeepOptions,
    /// Format of meshes.
    pub format: Option<MeshFormat>,
    /// A mesh to be written besides.
    pub save: Option<PathBuf>,
    /// What is printed.
    pub say: SayOptions,
}

/// Time that a picture is shown.
const DELAY: Duration = Duration::from_millis(200);

impl<O> Plan<O> {
    /// Starts a run, and goes on to its end.
    pub fn start<const D: usize>(
        &self,
        case: Case<D>,
        options: &str,
        device: &ComputeDevice,
    ) -> Result<ExitCode, Error>
    where
        O: Outlet<D>,
    {
        let network = case.operator.network();
        let notes = json!({
            "about": {
                "command": self.command,
                "name": self.name,
                "program": format!("willmore {}", env!("CARGO_PKG_VERSION")),
                "network": network.map(|n| json!({ "name": n.name, "checksum": n.network.fingerprint() })),
                "device": format!("{} {:?}", device.kind(), device.dtype()).to_lowercase(),
            },
            "outlet": self.outlet,
        });
        let run = Run::new(case, device)?;
        let folder = match &self.keep.output {
            Some(folder) => folder.clone(),
            None => free_folder(&format!("{}-{}", self.name, self.command)),
        };
        let mut files = vec![(config::FILE, options.as_bytes())];
        files.extend(self.outlet.input());
        let store = Store::create(folder, &files, &run, notes, self.checkpoints())?;
        self.go_on(store, run)
    }

    /// Continues a run from its last checkpoint.
    pub fn resume<const D: usize>(
        &self,
        stored: StoredRun,
        case: Case<D>,
        device: &ComputeDevice,
    ) -> Result<ExitCode, Error>
    where
        O: Outlet<D>,
    {
        let (store, run) = Store::resume(stored, case, device, self.checkpoints())?;
        self.go_on(store, run)
    }

    fn checkpoints(&self) -> Checkpoints {
        Checkpoints::EverySteps(self.keep.checkpoint_every)
    }

    fn go_on<const D: usize>(&self, mut store: Store, mut run: Run<D>) -> Result<ExitCode, Error>
    where
        O: Outlet<D>,
    {
        let interrupt = Interrupt::catch()?;
        let folder = store.directory().path().to_owned();
        let steps = run.case().stops.iter().find_map(|stop| match stop {
            Stop::Steps(steps) => Some(*steps as u64),
            _ => None,
        });
        let progress = self.say.progress();
        let title = format!("{} of {}", self.command, self.name);
        let mut bar = progress.bar(title, steps.unwrap_or(0));
        let clock = Instant::now();
        let mut pictures = Pictures(self);
        let observers: &mut [&mut dyn Observer<D>] = &mut [&mut bar, &mut pictures];
        let ending = run.advance(Some(&mut store), observers, &interrupt)?;
        let seconds = clock.elapsed().as_secs_f64();
        let outcome = match ending {
            Ending::Stopped(_) => self.finish(store, &run)?,
            Ending::Interrupted => {
                drop(store);
                let (steps, time) = (run.steps(), run.time());
                json!({ "command": self.command, "finished": false, "steps": steps, "time": time })
            }
        };
        if !self.keep.no_page {
            page::write(&RunDirectory::open(&folder)?)?;
        }
        bar.finish();
        progress.clear();
        self.tell(outcome, &folder, run.ended(), seconds);
        Ok(match ending {
            Ending::Stopped(_) => ExitCode::SUCCESS,
            Ending::Interrupted => ExitCode::from(Interrupt::EXIT_CODE),
        })
    }

    fn finish<const D: usize>(&self, mut store: Store, run: &Run<D>) -> Result<Value, Error>
    where
        O: Outlet<D>,
    {
        let (case, u) = (run.case(), run.field());
        let eps = case.scales.eps;
        let directory = store.directory();
        // What has vanished leaves no vertices behind.
        let faired = has_interface(u).then(|| self.outlet.faired(&case.initial, u, eps));
        let faired = faired.transpose()?.flatten();
        let topology = outlet::write_final(
            &self.outlet,
            &case.initial,
            u,
            eps,
            faired.as_ref(),
            self.format,
            directory,
        )?;
        if let Some(path) = &self.save {
            match &faired {
                Some(faired) => faired.write(path)?,
                None => self.outlet.save(u, eps, path)?,
            }
        }
        if self.keep.frames.is_some() {
            let frames = frames(&directory.path().join(outlet::FRAMES))?;
            let animation = render::animation(&frames, DELAY)?;
            directory.write_file("animation.png", |out| out.write_all(&animation))?;
        }
        // Touching sheets have no topology; that is no reason not to flow.
        let before = match &faired {
            Some(faired) => faired.topology,
            None => self.outlet.topology(&case.initial, eps).unwrap_or_default(),
        };
        let mut outcome = json!({
            "command": self.command,
            "finished": true,
            "steps": run.steps(),
            "time": run.time(),
            "components": topology.components,
            "same_topology": topology == before,
            "touches_box": touches_side(u),
        });
        if let Some(number) = topology.euler_characteristic {
            outcome["euler_characteristic"] = number.into();
        }
        let (first, last) = (run.records().first(), run.records().last());
        for (name, value) in last.map_or(run.start(), |record| &record.measures) {
            outcome[name] = (*value).into();
        }
        let energy = last.and_then(Record::willmore_energy);
        if let (Some(first), Some(energy)) = (first.and_then(|r| r.minimization), energy) {
            outcome["first_energy"] = first.energy_at_rest().into();
            outcome["energy"] = energy.into();
        }
        for stop in &case.stops {
            if let Stop::Energy(target) = stop {
                let reached = energy.is_some_and(|energy| energy <= *target);
                outcome["energy_reached"] = reached.into();
            }
        }
        if let Some(Faired { report, .. }) = faired {
            outcome["mesh"] = report;
        }
        let text = format!("{outcome:#}\n");
        directory.write_file(outlet::SUMMARY, |out| out.write_all(text.as_bytes()))?;
        store.finish(run)?;
        Ok(outcome)
    }

    fn tell(&self, mut outcome: Value, folder: &Path, ended: Option<Stop>, seconds: f64) {
        let number = |name: &str| outcome[name].as_f64();
        let steps = outcome["steps"].as_u64().unwrap_or(0);
        let time = number("time").unwrap_or(0.0);
        let reason = match ended {
            None | Some(Stop::Steps(_)) => String::new(),
            Some(stop) => format!(": {stop}"),
        };
        let mut text = vec![format!(
            "{steps} steps to t = {time:.4e} in {seconds:.1} s{reason}"
        )];
        if let (Some(first), Some(energy)) = (number("first_energy"), number("energy")) {
            text.push(format!("Willmore energy {energy:.4}, before {first:.4}"));
        }
        let mesh = &outcome["mesh"];
        if let Some(moved) = mesh["displacement_rms"].as_f64() {
            let of = |name: &str| mesh[name].as_f64().unwrap_or(f64::NAN);
            text.push(format!(
                "vertices moved by {moved:.3e} (root mean square) and {:.3e} at most, {:.3} % and {:.3} % of the longest side; \
                 volume {:+.4} %, area {:+.3} %",
                of("displacement_largest"),
                of("displacement_rms_percent"),
                of("displacement_largest_percent"),
                of("volume_change_percent"),
                of("area_change_percent"),
            ));
        }
        let left_behind = mesh["left_behind_percent"].as_f64().unwrap_or(0.0) > 1.0;
        let notes = [
            (
                left_behind,
                "vertices could not follow the surface, which has gone further than 4 interface widths: use --remesh for a new mesh",
            ),
            (
                outcome["energy_reached"] == false,
                "the energy asked for was not reached, go on with more --steps or --time",
            ),
            (
                outcome["components"] == 0 && ended != Some(Stop::Vanished),
                "the shape has vanished",
            ),
            (
                outcome["same_topology"] == false,
                "parts or holes have come or gone: if they should not, use more --cells or a larger --side-length",
            ),
            (
                outcome["touches_box"] == true,
                "the shape has come to the side of the box: start with a smaller --side-length",
            ),
        ];
        let holding = notes.into_iter().filter(|(holds, _)| *holds);
        text.extend(holding.map(|(_, note)| note.to_owned()));
        let shown = folder.display();
        text.push(if outcome["finished"] == false {
            format!("interrupted, go on with: willmore resume {shown}")
        } else if self.keep.no_page {
            format!("results are in {shown}")
        } else {
            let page = folder.join(page::NAME);
            format!("results are in {shown}, to look at: {}", page.display())
        });
        if let Some(stop) = ended {
            outcome["ended"] = stop.to_string().into();
        }
        outcome["run"] = folder.to_string_lossy().into();
        outcome["seconds"] = seconds.into();
        self.say.report(&outcome, &text.join("\n"));
    }
}

/// Writes the shape at the beginning, and pictures of it in between.
struct Pictures<'a, O>(&'a Plan<O>);

impl<const D: usize, O: Outlet<D>> Observer<D> for Pictures<'_, O> {
    fn observe(&mut self, event: &mut Event<'_, D>) -> Result<(), engine::Error> {
        let (case, u) = (event.case, event.field);
        let eps = case.scales.eps;
        let (Some(step), Some(run)) = (event.step(), event.directory.as_deref_mut()) else {
            return Ok(());
        };
        // An inpainted region may have been all of the shape.
        if !has_interface(u) {
            return Ok(());
        }
        let Plan {
            outlet,
            keep,
            format,
            ..
        } = self.0;
        let mut write = || -> Result<(), Error> {
            if step == 0 {
                outlet.write_shape(u, eps, outlet::START, format.unwrap_or_default(), run)?;
            }
            if keep.frames.is_some_and(|every| step.is_multiple_of(every)) {
                let name = format!("{}/step-{step:06}.png", outlet::FRAMES);
                let picture = outlet.picture(&case.initial, u, eps)?;
                outlet::write_picture(&picture, &name, run)?;
            }
            Ok(())
        };
        write().map_err(engine::Error::observer)
    }
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
    let entries = std::fs::read_dir(folder).map_err(Error::io("read", folder))?;
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_, _>>()
        .map_err(Error::io("read", folder))?;
    paths.sort();
    let read = |path: &PathBuf| {
        let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
        Ok(Picture::from_png(&bytes)?)
    };
    paths.iter().map(read).collect()
}
