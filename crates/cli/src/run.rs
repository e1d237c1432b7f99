//! A run from its start, or from where it was stopped, to its end.

use std::f64::consts::PI;
use std::fmt::Write;
use std::time::{Duration, Instant};

use engine::{Checkpoints, Ending, Event, Observer, Storage, Store, estimated_time_error};
use geometry::measure::touches_side;
use pages::five_digits;
use solver::StepEstimates;

use crate::cli::{KeepOptions, MessageOptions};
use crate::faired::Faired;
use crate::page;
use crate::paths::{extension, read};
use crate::prelude::*;
use crate::presentation::{self, Presentation, Topology};

/// Everything about a run but its case.
pub struct Plan<O> {
    pub command: &'static str,
    pub name: String,
    pub presentation: O,
    pub keep: KeepOptions,
    /// The extension of meshes, if it is not the usual one.
    pub format: Option<String>,
    pub messages: MessageOptions,
}

/// Measures whose change is told.
const SIZES: [&str; 3] = ["length", "area", "volume"];
const DELAY: Duration = Duration::from_millis(200);

impl<O> Plan<O> {
    /// What is kept with the run.
    pub fn notes<const D: usize>(&self, case: &Case<D>, device: &ComputeDevice) -> Value
    where
        O: Presentation<D>,
    {
        let network = case.operator.network();
        json!({
            "about": {
                "command": self.command,
                "name": self.name,
                "program": format!("willmore {}", env!("CARGO_PKG_VERSION")),
                "network": network.map(|n| json!({ "name": n.name, "checksum": n.network.fingerprint() })),
                "device": format!("{} {:?}", device.kind(), device.dtype()).to_lowercase(),
            },
            "outlet": self.presentation,
        })
    }

    pub fn checkpoints(&self) -> Checkpoints {
        Checkpoints::EverySteps(self.keep.checkpoint_every)
    }

    /// From the last checkpoint to the end.
    pub fn go_on<const D: usize>(
        &self,
        mut store: Store,
        mut run: Run<D>,
    ) -> Result<ExitCode, Error>
    where
        O: Presentation<D>,
    {
        let interrupt = Interrupt::catch()?;
        let (nodes, stored) = (run.case().grid().len(), run.stored_cells());
        let what = if stored < nodes {
            let percent = 100.0 * stored as f64 / nodes as f64;
            format!("bricks near the surface, {percent:.0} % of the grid")
        } else {
            "the whole grid".to_owned()
        };
        let gigabytes = 1e-9 * Storage::bytes(nodes, stored);
        self.messages.note(&format!(
            "storage: {what}, about {gigabytes:.1} GB of memory (--storage)"
        ));
        let folder = store.directory().path().to_owned();
        let steps = run.case().stops.iter().find_map(|stop| match stop {
            Stop::Steps(steps) => Some(*steps as u64),
            _ => None,
        });
        let progress = self.messages.progress();
        let title = format!("{} of {}", self.command, self.name);
        let mut bar = progress.bar(title, steps.unwrap_or(0));
        let clock = Instant::now();
        let mut pictures = Pictures {
            plan: self,
            topology: None,
        };
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
        O: Presentation<D>,
    {
        let (case, u) = (run.case(), run.field());
        let eps = case.scales.eps;
        let directory = store.directory();
        // What has vanished leaves no vertices behind.
        let faired = has_interface(u).then(|| self.presentation.faired(&case.initial, u, eps));
        let faired = faired.transpose()?.flatten();
        let topology = self.write_final(&case.initial, u, eps, faired.as_ref(), directory)?;
        if let Some(path) = self.keep.save.as_ref().filter(|_| has_interface(u)) {
            match &faired {
                Some(faired) => faired.write(path)?,
                None => self.presentation.save(u, eps, path)?,
            }
        }
        if self.keep.frames.is_some() {
            let frames = frames(&directory.path().join(presentation::FRAMES))?;
            let animation = render::animation(&frames, DELAY)?;
            directory.write_file(presentation::ANIMATION, |out| out.write_all(&animation))?;
            let series = series(directory.path(), run.records());
            directory.write_file(presentation::SERIES, |out| out.write_all(series.as_bytes()))?;
        }
        // Touching sheets have no topology; that is no reason not to flow.
        let of_start = || {
            self.presentation
                .topology(&case.initial, eps)
                .unwrap_or_default()
        };
        let before = self.presentation.input().unwrap_or_else(of_start);
        let mut outcome = json!({
            "command": self.command,
            "finished": true,
            "steps": run.steps(),
            "time": run.time(),
            "components": topology.components,
            "same_topology": topology == before,
            "touches_box": touches_side(u, -0.5),
            "grid": {
                "cells": case.grid().cells(),
                "spacing": case.grid().spacing(),
                "origin": case.grid().origin().to_vec(),
                "interface_width": eps,
                "stored_cells": run.stored_cells(),
            },
            "shortened_steps": run.records().iter().filter(|record| record.halvings > 0).count(),
        });
        if let Some(accuracy) = time_accuracy(run.records(), eps) {
            outcome["time_steps"] = accuracy;
        }
        if let Some(number) = topology.euler_characteristic {
            outcome["euler_characteristic"] = number.into();
        }
        let (first, last) = (run.records().first(), run.records().last());
        for (name, value) in last.map_or(run.start(), |record| &record.measures) {
            outcome[name] = (*value).into();
            let before = run.start().get(name).filter(|_| SIZES.contains(&&**name));
            if let Some(before) = before.filter(|before| **before > 0.0) {
                let change = 100.0 * (value / before - 1.0);
                outcome[&format!("{name}_change_percent")] = change.into();
            }
        }
        let energy = last.and_then(Record::willmore_energy);
        if let (Some(first), Some(energy)) = (first.and_then(|r| r.minimization), energy) {
            outcome["first_energy"] = first.energy_at_rest().into();
            outcome["energy"] = energy.into();
            if !case.energy.is_willmore() {
                outcome["energy_terms"] = json!(case.energy);
            } else if D == 3 {
                outcome["energy_over_8_pi"] = (energy / (8.0 * PI)).into();
            }
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
        directory.write_file(presentation::SUMMARY, |out| out.write_all(text.as_bytes()))?;
        store.finish(run)?;
        Ok(outcome)
    }

    /// Writes `final.npy`, `final.vti`, and, unless the shape has vanished, picture and shape, of which it returns the parts.
    fn write_final<const D: usize>(
        &self,
        start: &Field<D>,
        u: &Field<D>,
        eps: f64,
        faired: Option<&Faired>,
        run: &mut RunDirectory,
    ) -> Result<Topology, Error>
    where
        O: Presentation<D>,
    {
        let presentation = &self.presentation;
        npy::write(run.path().join("final.npy"), u)?;
        run.adopt_file("final.npy")?;
        vti::write(run.path().join("final.vti"), "phase_field", u)?;
        run.adopt_file("final.vti")?;
        if !has_interface(u) {
            return Ok(Topology::default());
        }
        presentation.write_picture(start, u, eps, presentation::PICTURE, run)?;
        let format = self.format.as_deref();
        if let Some(faired) = faired {
            let name = format!(
                "{}.{}",
                presentation::FINAL,
                format.unwrap_or(&faired.extension)
            );
            faired.write(&run.path().join(&name))?;
            run.adopt_file(&name)?;
            let text = faired.displacement.to_svg()?;
            run.write_file(presentation::DISPLACEMENT, |out| {
                out.write_all(text.as_bytes())
            })?;
        } else {
            presentation.write_shape(u, eps, presentation::FINAL, format, run)?;
        }
        presentation.topology(u, eps)
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
            "{} to t = {time:.4e} in {seconds:.1} s{reason}",
            counted(steps)
        )];
        if let (Some(first), Some(energy)) = (number("first_energy"), number("energy")) {
            let spheres = number("energy_over_8_pi");
            let spheres = spheres.map_or(String::new(), |w| format!(" = {w:.4} x 8 pi"));
            let name = match outcome["energy_terms"] {
                Value::Null => "Willmore energy",
                _ => "energy",
            };
            let [energy, first] = [energy, first].map(five_digits);
            text.push(format!("{name} {energy}{spheres}, before {first}"));
        }
        let of_steps = |name: &str| outcome["time_steps"][name].as_f64();
        if let (Some(error), Some(path)) = (of_steps("estimated_error"), of_steps("path")) {
            text.push(format!(
                "time error about {error:.1e} (estimated), after a way of {path:.3}"
            ));
        }
        let sizes = SIZES.iter().filter_map(|name| {
            let change = match number(&format!("{name}_change_percent")) {
                Some(percent) if outcome["mesh"].is_null() => format!(" ({percent:+.2} %)"),
                _ => String::new(),
            };
            Some(format!("{name} {}{change}", five_digits(number(name)?)))
        });
        text.push(sizes.collect::<Vec<_>>().join(", "));
        let mesh = &outcome["mesh"];
        if let Some(moved) = mesh["displacement_rms"].as_f64() {
            let of = |name: &str| mesh[name].as_f64().unwrap_or(f64::NAN);
            let what = if mesh["left_behind_percent"].is_null() {
                "the surface"
            } else {
                "vertices"
            };
            text.push(format!(
                "{what} moved by {moved:.3e} (root mean square) and {:.3e} at most, {:.3} % and {:.3} % of the longest side; \
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
                "the energy asked for was not reached: `willmore resume` goes on with more --steps",
            ),
            (
                outcome["shortened_steps"].as_u64().unwrap_or(0) > 0,
                "some steps were made shorter than they were to be, since the interface would have moved by more than 2 widths of it, or could not keep its sizes",
            ),
            (
                outcome["same_topology"] == false,
                if mesh["left_behind_percent"].is_null() {
                    "parts or holes have come or gone: if they should not, use more --cells or a larger --side-length"
                } else {
                    "on the grid parts or holes have come or gone: if vertices nearby followed the wrong surface, use more --cells or a \
                     larger --side-length"
                },
            ),
            (
                outcome["touches_box"] == true,
                "the shape touches the side of the box: a smaller --side-length gives it room",
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
        self.messages.report(&outcome, &text.join("\n"));
    }
}

/// Writes the shape at the beginning, and pictures of it in between, and says when its parts or holes change.
struct Pictures<'a, O> {
    plan: &'a Plan<O>,
    topology: Option<Topology>,
}

impl<const D: usize, O: Presentation<D>> Observer<D> for Pictures<'_, O> {
    fn observe(&mut self, event: &mut Event<'_, D>) -> Result<(), engine::Error> {
        let (case, u) = (event.run.case(), event.run.field());
        let eps = case.scales.eps;
        let (Some(step), Some(run)) = (event.step(), event.directory.as_deref_mut()) else {
            return Ok(());
        };
        // An inpainted region may have been all of the shape.
        if !has_interface(u) {
            return Ok(());
        }
        let Plan {
            presentation, keep, ..
        } = self.plan;
        let mut write = || -> Result<(), Error> {
            if step == 0 {
                let format = self.plan.format.as_deref();
                presentation.write_shape(u, eps, presentation::START, format, run)?;
            }
            if keep.frames.is_some_and(|every| step.is_multiple_of(every)) {
                let name = presentation::frame(step);
                presentation.write_picture(&case.initial, u, eps, &format!("{name}.png"), run)?;
                let values = format!("{name}.vti");
                vti::write(run.path().join(&values), "phase_field", u)?;
                run.adopt_file(&values)?;
                presentation.write_shape(u, eps, &name, self.plan.format.as_deref(), run)?;
            }
            Ok(())
        };
        write().map_err(engine::Error::observer)?;
        // Touching sheets have no topology.
        let topology = presentation.topology(u, eps).ok();
        if let Some((before, now)) = self.topology.zip(topology).filter(|(a, b)| a != b) {
            let time = event.run.time();
            self.plan.messages.note(&format!(
                "step {step}, t = {time:.4e}: parts or holes have come or gone, {now} where there were {before}"
            ));
        }
        self.topology = topology.or(self.topology);
        Ok(())
    }
}

/// Removes the run in a folder, if there is one that nobody works on. A folder of something else stays.
pub fn make_way(folder: &Path) -> Result<(), Error> {
    match RunDirectory::recover(folder) {
        Ok(_) => Ok(std::fs::remove_dir_all(folder).map_err(files::Error::of("remove", folder))?),
        Err(locked @ runs::Error::Locked(_)) => Err(locked.into()),
        Err(_) => Ok(()),
    }
}

/// `runs/NAME`, with the first number that is free.
pub fn free_folder(name: &str) -> PathBuf {
    let folder = Path::new("runs").join(name);
    let numbered = (2..).map(|k| Path::new("runs").join(format!("{name}-{k}")));
    std::iter::once(folder)
        .chain(numbered)
        .find(|folder| !folder.exists())
        .expect("some number is free")
}

fn counted(steps: u64) -> String {
    let plural = if steps == 1 { "" } else { "s" };
    format!("{steps} step{plural}")
}

/// What controlled steps say of themselves: their [estimated error](estimated_time_error), the way of the place that moves farthest in each,
/// and the longest displacement of a stage in interface widths.
fn time_accuracy(records: &[Record], eps: f64) -> Option<Value> {
    let made = |record: &Record| record.minimization?.estimates;
    let estimates: Vec<StepEstimates> = records.iter().filter_map(made).collect();
    if estimates.is_empty() {
        return None;
    }
    let longest = estimates.iter().map(|e| e.displacement).fold(0.0, f64::max);
    Some(json!({
        "estimated_error": estimated_time_error(records),
        "path": estimates.iter().map(|e| e.motion).sum::<f64>(),
        "longest_displacement_in_widths": longest / eps,
    }))
}

/// The fields of the frames in a folder with their times, for `ParaView`.
fn series(run: &Path, records: &[Record]) -> String {
    let mut text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n  <Collection>\n"
            .to_owned();
    let complete = records.iter().filter(|record| record.completes_step);
    let times = complete.map(|record| (record.step, record.time));
    for (step, time) in std::iter::once((0, 0.0)).chain(times) {
        let name = presentation::frame(step) + ".vti";
        if run.join(&name).exists() {
            let _ = writeln!(text, "    <DataSet timestep=\"{time}\" file=\"{name}\"/>");
        }
    }
    text + "  </Collection>\n</VTKFile>\n"
}

fn frames(folder: &Path) -> Result<Vec<Picture>, Error> {
    let entries = std::fs::read_dir(folder).map_err(files::Error::of("read", folder))?;
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_, _>>()
        .map_err(files::Error::of("read", folder))?;
    paths.retain(|path| extension(path) == "png");
    paths.sort();
    let read = |path: &PathBuf| Ok(images::colours(path, &read(path)?)?);
    paths.iter().map(read).collect()
}
