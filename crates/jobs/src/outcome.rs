//! What came out of a job.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use engine::Helfrich;
use pages::five_digits;

use crate::faired::MeshReport;
use crate::options::InputOptions;
use crate::parts::{PartFate, PartReport};
use crate::prelude::*;
use crate::words::signed;

/// Measures whose change is told.
pub(crate) const SIZES: [&str; 3] = ["length", "area", "volume"];

/// The energy of a surface over that of a sphere is not below this but for errors of the grid.
const NO_SURFACE: f64 = 0.95;
/// and one that began above this part and ends below it is not resolved.
const UNRESOLVED: f64 = 0.995;
/// A change of the area, in percent, that is more than what makes a drawing smooth.
const SWOLLEN: f64 = 50.0;
/// An interface whose slope is off by more than this part is none any more.
const LOST: f64 = 0.4;
/// Below so many cells of reach, the shortest part of a direct step, `17 h^4`, is longer than `4e-3` times the fourth power of the reach, up to which such
/// steps are exact ([`engine::DirectParams`]).
const NARROW: f64 = 8.0;
/// More than this part of the vertices, in percent, that could not follow is told.
const LEFT_BEHIND: f64 = 1.0;

/// What came out of a job that makes a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The name of the job.
    pub command: &'static str,
    /// The folder of the run.
    pub folder: PathBuf,
    /// The number of steps.
    pub steps: usize,
    /// The time at the end.
    pub time: f64,
    /// The rule that ended the run; none if it was interrupted.
    pub ended: Option<Stop>,
    /// The results of a run that is over.
    pub summary: Option<Summary>,
    /// The page of the run, if there is one.
    pub page: Option<PathBuf>,
    /// The file to which the result goes besides, if one was chosen.
    pub save: Option<PathBuf>,
    /// Wall time of the steps, in seconds.
    pub seconds: f64,
}

impl Outcome {
    /// As a JSON object.
    pub fn to_json(&self) -> Value {
        let mut outcome = match &self.summary {
            Some(summary) => summary.to_json(),
            None => {
                json!({ "command": self.command, "finished": false, "steps": self.steps, "time": self.time })
            }
        };
        if let Some(stop) = &self.ended {
            outcome["ended"] = stop.to_string().into();
        }
        outcome["run"] = self.folder.to_string_lossy().into();
        outcome["seconds"] = self.seconds.into();
        outcome
    }
}

/// What is known of a run that is over: `summary.json`. Lengths are in the units of the input.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Summary {
    /// The name of the job.
    pub command: String,
    /// True.
    pub finished: bool,
    /// The number of steps.
    pub steps: usize,
    /// The time at the end.
    pub time: f64,
    /// What controlled steps say of themselves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_steps: Option<TimeAccuracy>,
    /// What direct steps say of themselves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direct_steps: Option<DirectReport>,
    /// Steps that were made shorter than their rule wanted them.
    pub shortened_steps: usize,
    /// The energy at the beginning; mean curvature flow has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_energy: Option<f64>,
    /// The energy at the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<f64>,
    /// Spontaneous curvature, tension and pressure, if the energy is not the Willmore energy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy_terms: Option<Helfrich>,
    /// The Willmore energy of a surface over that of a sphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy_over_8_pi: Option<f64>,
    /// Whether the energy is as low as was asked for; of two options that say it, the one that is reached first counts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy_reached: Option<bool>,
    /// Whether the sizes that are held have reached their targets, if they were to change.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sizes_reached: Option<bool>,
    /// How steep the interface is at the end: 1 with the optimal profile, [`ZeroSet::slope`]. A shape that has vanished has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interface_slope: Option<f64>,
    /// Closed curves or surfaces.
    pub components: usize,
    /// Of all surfaces together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub euler_characteristic: Option<i64>,
    /// Whether there are as many parts and holes as before.
    pub same_topology: bool,
    /// Whether the shape touches the side of the box.
    pub touches_box: bool,
    /// How a surface has moved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<MeshReport>,
    /// The grid.
    pub grid: GridSummary,
    /// Sizes and other measures at the end, and by how much in percent the sizes have changed.
    #[serde(flatten)]
    pub measures: BTreeMap<String, Option<f64>>,
    /// What helps if something has gone wrong; in no file.
    #[serde(skip)]
    pub(crate) remedies: Remedies,
}

/// What helps a run, as its end and its input have it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Remedies {
    /// Whether it goes on with more steps: nothing but their number ended it.
    more_steps: bool,
    /// Whether it has not come to the time that was asked for.
    is_early: bool,
    room: Room,
}

impl Remedies {
    /// Those of a run that this rule ended; `has_end_time` says whether it was to end at a time.
    pub fn of(ended: Option<&Stop>, has_end_time: bool, room: Room) -> Self {
        let more_steps = matches!(ended, Some(Stop::Steps(_)));
        Self {
            more_steps,
            is_early: more_steps && has_end_time,
            room,
        }
    }
}

/// What gives a shape room in its box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Room {
    /// A smaller `side_length`, of what is scaled to the box.
    #[default]
    SideLength,
    /// A larger `box_side`, about what has coordinates of its own.
    BoxSide,
    /// Another field.
    Field,
}

impl Room {
    /// That of an input, once its options are filled in.
    pub fn of(options: &InputOptions) -> Self {
        Self::given(options.side_length.is_some(), options.field_kind.is_some())
    }

    /// That of an input with these options: `side_length` is filled in where it means something, and `field_kind` of fields.
    pub fn given(side_length: bool, field_kind: bool) -> Self {
        match (side_length, field_kind) {
            (true, _) => Self::SideLength,
            (_, true) => Self::Field,
            _ => Self::BoxSide,
        }
    }
}

/// A doubt, and what gives the shape room in its box.
macro_rules! with_room {
    ($doubt:literal, $room:expr) => {
        match $room {
            Room::SideLength => concat!($doubt, "a smaller `side_length` gives it room"),
            Room::BoxSide => concat!($doubt, "a larger `box_side` gives it room"),
            Room::Field => concat!($doubt, "a field in a larger box gives it room"),
        }
    };
}

/// A doubt, and how a run goes on if nothing but the number of steps ended it.
macro_rules! with_more_steps {
    ($doubt:literal, $more_steps:expr) => {
        if $more_steps {
            concat!($doubt, ": `willmore resume` goes on with more `steps`")
        } else {
            $doubt
        }
    };
}

/// What controlled steps say of themselves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimeAccuracy {
    /// How far the interface is from where exact steps would have taken it, if the steps say enough.
    pub estimated_error: Option<f64>,
    /// The way of the place that moves farthest in each step.
    pub path: f64,
    /// The longest displacement in a stage of a step, in interface widths.
    pub longest_displacement_in_widths: f64,
}

/// What direct steps say of themselves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DirectReport {
    /// Convolutions of the whole grid.
    pub convolutions: usize,
    /// How far the run of half parts is from that of whole parts at the end: more than the time error of the result, which is extrapolated.
    pub run_distance: f64,
    /// The reach of the interface at the end, in cells: the largest radius of balls that touch it wherever they lie on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_in_cells: Option<f64>,
    /// Steps after which the energy was higher than before, which nothing excludes.
    pub energy_increases: usize,
}

/// The grid of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GridSummary {
    /// Cells along each side.
    pub cells: usize,
    /// The side of a cell.
    pub spacing: f64,
    /// The lower corner of the box.
    pub origin: Vec<f64>,
    /// `eps`
    pub interface_width: f64,
    /// Cells whose values are stored at the end.
    pub stored_cells: usize,
}

/// How far a run has come.
pub fn progress(steps: usize, time: f64) -> String {
    let plural = if steps == 1 { "" } else { "s" };
    format!("{steps} step{plural} to t = {time:.4e}")
}

impl Summary {
    /// As a JSON object.
    pub fn to_json(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    /// A size or another measure at the end, or by how much in percent a size has changed.
    pub fn measure(&self, name: &str) -> Option<f64> {
        self.measures.get(name).copied().flatten()
    }

    /// Energy, sizes, how far the surface has moved and what became of its parts, each in a sentence, and then what may have gone wrong.
    pub fn sentences(&self) -> Vec<String> {
        let mut text = Vec::new();
        text.extend(self.of_energy());
        text.extend(self.of_time());
        text.extend(self.of_direct());
        text.extend(self.of_sizes());
        text.extend(self.mesh.as_ref().map(of_mesh));
        text.extend(self.mesh.iter().flat_map(|mesh| of_parts(&mesh.parts)));
        text.extend(self.doubts().into_iter().map(str::to_owned));
        text
    }

    fn of_energy(&self) -> Option<String> {
        let spheres = self.energy_over_8_pi;
        let spheres = spheres.map_or(String::new(), |w| format!(" = {w:.4} x 8 pi"));
        let name = match self.energy_terms {
            None => "Willmore energy",
            Some(_) => "energy",
        };
        let [energy, first] = [self.energy?, self.first_energy?].map(five_digits);
        Some(format!("{name} {energy}{spheres}, before {first}"))
    }

    fn of_time(&self) -> Option<String> {
        let accuracy = self.time_steps?;
        let (error, path) = (accuracy.estimated_error?, accuracy.path);
        Some(format!(
            "time error about {error:.1e} (estimated), after a way of {path:.3}"
        ))
    }

    fn of_direct(&self) -> Option<String> {
        let DirectReport {
            convolutions,
            run_distance,
            energy_increases,
            ..
        } = self.direct_steps?;
        let energy = match energy_increases {
            0 => "the energy fell in each step".to_owned(),
            1 => "the energy rose in one step".to_owned(),
            some => format!("the energy rose in {some} steps"),
        };
        Some(format!(
            "{convolutions} convolutions, time error below about {run_distance:.1e}; {energy}: direct steps do not guarantee that it falls"
        ))
    }

    fn of_sizes(&self) -> Option<String> {
        let sizes = SIZES.iter().filter_map(|name| {
            let change = match self.measure(&format!("{name}_change_percent")) {
                Some(percent) if self.mesh.is_none() => format!(" ({} %)", signed(percent, 2)),
                _ => String::new(),
            };
            Some(format!(
                "{name} {}{change}",
                five_digits(self.measure(name)?)
            ))
        });
        sizes.reduce(|all, next| format!("{all}, {next}"))
    }

    /// What may have gone wrong, each in a sentence: vertices left behind, parts or holes that have come or gone, a shape that touches the box.
    pub fn doubts(&self) -> Vec<&'static str> {
        let left_behind = self.mesh.as_ref().and_then(|mesh| mesh.left_behind_percent);
        let is_new = left_behind.is_none();
        let misses_volume =
            (self.mesh.as_ref()).is_some_and(|mesh| mesh.volume_missed_percent.is_some());
        let Remedies {
            more_steps,
            is_early,
            room,
        } = self.remedies;
        let has_lost_profile =
            (self.interface_slope).is_some_and(|slope| (slope - 1.0).abs() > LOST);
        let reach = self.direct_steps.and_then(|steps| steps.reach_in_cells);
        let is_narrow = reach.is_some_and(|cells| cells < NARROW);
        let is_scaled = room == Room::SideLength;
        let has_swollen = self.measure("length").is_some()
            && self
                .measure("area_change_percent")
                .is_some_and(|percent| percent.abs() > SWOLLEN);
        let holds_sizes = self.command != "mcf";
        let notes = [
            (
                left_behind.is_some_and(|percent| percent > LEFT_BEHIND),
                "vertices could not follow the surface, which has gone further than 4 interface widths: use `remesh` for a new mesh",
            ),
            (
                misses_volume,
                "the mesh does not have the volume that it was to have, since vertices went back where faces would cross: `remesh` makes a new mesh",
            ),
            (
                self.energy_reached == Some(false),
                with_more_steps!("the energy asked for was not reached", more_steps),
            ),
            (
                is_early,
                with_more_steps!("the time asked for was not reached", more_steps),
            ),
            (
                self.sizes_reached == Some(false),
                with_more_steps!("the sizes have not reached their targets", more_steps),
            ),
            (
                has_lost_profile,
                "the interface has lost its profile, so that sizes and energy say nothing: the shape has details, or the energy has terms, that are too much for \
                 the grid, and more `cells` help",
            ),
            (
                is_narrow,
                "direct steps are not exact where the shape bends, or comes near to itself or to its periodic image, within 8 cells: use more `cells`",
            ),
            (
                self.shortened_steps > 0,
                "some steps were made shorter than they were to be, since the interface would have moved by more than 2 widths of it, or could not keep its sizes",
            ),
            (
                !self.same_topology && is_new && is_scaled,
                "parts or holes have come or gone: if they should not, use more `cells` or a larger `side_length`",
            ),
            (
                !self.same_topology && is_new && !is_scaled,
                "parts or holes have come or gone: if they should not, use more `cells`",
            ),
            (
                !self.same_topology && !is_new,
                "on the grid parts or holes have come or gone: if vertices nearby followed the wrong surface, use more `cells` or a larger `side_length`",
            ),
            (
                self.touches_box,
                with_room!("the shape touches the side of the box: ", room),
            ),
            (
                !self.touches_box
                    && self.energy_terms.is_none()
                    && self
                        .energy_over_8_pi
                        .is_some_and(|spheres| spheres < NO_SURFACE),
                with_room!(
                    "no closed surface has so little energy: the shape is near to its own periodic image, and ",
                    room
                ),
            ),
            (
                self.energy_terms.is_none()
                    && self
                        .energy_over_8_pi
                        .is_some_and(|spheres| spheres < UNRESOLVED)
                    && self
                        .first_energy
                        .is_some_and(|first| first >= UNRESOLVED * 8.0 * PI)
                    && self
                        .energy_over_8_pi
                        .is_some_and(|spheres| spheres >= NO_SURFACE),
                "the energy has fallen below that of a sphere, which has the least: the grid is too coarse for so long a flow, in which the shape grows, \
                 and more `cells` help",
            ),
            (
                has_swollen && holds_sizes,
                "the enclosed area has changed by more than half, as that of thin strokes does: a shorter `time`, or `area` keep, keeps more of the shape",
            ),
            (
                has_swollen && !holds_sizes,
                "the enclosed area has changed by more than half, as that of thin strokes does: a shorter `time` keeps more of the shape",
            ),
        ];
        let holding = notes.into_iter().filter(|(holds, _)| *holds);
        holding.map(|(_, note)| note).collect()
    }
}

fn of_mesh(mesh: &MeshReport) -> String {
    let moved = match mesh.left_behind_percent {
        None => "the surface",
        Some(_) => "vertices",
    };
    let sizes = match (mesh.volume_change_percent, mesh.area_change_percent) {
        (Some(volume), Some(area)) => {
            format!("volume {} %, area {} %", signed(volume, 4), signed(area, 3))
        }
        _ if mesh.is_open => "the boundary has not moved".to_owned(),
        _ => "the mesh is no longer closed, or folds over itself".to_owned(),
    };
    let bound = match (mesh.max_distance, mesh.vertices_at_max_distance) {
        (Some(length), Some(count)) if count > 0 => format!(
            "; vertices that are at the distance {} from where the surface was, which `max_distance` allows: {count}",
            five_digits(length)
        ),
        _ => String::new(),
    };
    let held_back = match mesh.held_back {
        Some(count) => format!(
            "; vertices that were held back, since noise does not explain how far they would have gone: {count}"
        ),
        None => String::new(),
    };
    let edges = match (mesh.kept_edges, mesh.kept_edges_length) {
        (Some(count), Some(length)) => format!(
            "; sharp edges that have stayed sharp (`edges`): {count} of the mesh, {} long together",
            five_digits(length)
        ),
        _ => String::new(),
    };
    format!(
        "{moved} moved by {:.3e} (root mean square) and {:.3e} at most, {:.3} % and {:.3} % of the longest side; {sizes}{edges}{bound}{held_back}",
        mesh.displacement_rms,
        mesh.displacement_largest,
        mesh.displacement_rms_percent,
        mesh.displacement_largest_percent,
    )
}

/// What became of the parts of a segmentation, if there are several.
fn of_parts(parts: &[PartReport]) -> Vec<String> {
    let of = |fate: PartFate| parts.iter().filter(move |part| part.fate == fate);
    let mut text = Vec::new();
    let changes = parts.iter().filter_map(PartReport::change_percent);
    let largest = changes.map(f64::abs).fold(0.0, f64::max);
    if parts.len() > 1 {
        text.push(format!(
            "{} parts and cavities, whose volumes have changed by {largest:.4} % at most",
            parts.len()
        ));
    }
    for (fate, what) in [
        (
            PartFate::Restored,
            "vanished in the flow, and is in the mesh as the surface between its voxels",
        ),
        (
            PartFate::Joined,
            "is one with others, which have the volume of all together",
        ),
    ] {
        text.extend(of(fate).map(|part| format!("a part, {}, {what}", part.found_at())));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Job;

    /// A run of which much may have gone wrong, whether its shape touches the side of the box or is near to its image.
    fn doubtful(command: &str, touches_box: bool, remedies: Remedies) -> Summary {
        let grid = json!({
            "cells": 48, "spacing": 0.04, "origin": [-1.0, -1.0], "interface_width": 0.08, "stored_cells": 2304,
        });
        let summary = json!({
            "command": command, "finished": true, "steps": 1, "time": 1.0, "shortened_steps": 0, "energy_reached": false,
            "energy_over_8_pi": 0.5, "components": 1, "same_topology": false, "touches_box": touches_box, "grid": grid,
            "length": 1.0, "area_change_percent": -60.0,
        });
        Summary {
            remedies,
            ..serde_json::from_value(summary).unwrap()
        }
    }

    #[test]
    fn advice_names_options_that_the_job_has() {
        for command in ["flow", "inpaint", "mcf"] {
            let mut names = Vec::new();
            for touches_box in [false, true] {
                let doubts = doubtful(command, touches_box, Remedies::default()).doubts();
                let doubts = doubts.into_iter();
                names.extend(doubts.flat_map(|doubt| doubt.split('`').skip(1).step_by(2)));
            }
            assert!(names.contains(&"side_length") && names.contains(&"time"));
            for name in names {
                let value = if name == "area" { "keep" } else { "3" };
                let named = [(name, Some(value.to_owned()))];
                assert!(Job::of_named(command, named).is_ok(), "{command}: {name}");
            }
        }
    }

    #[test]
    fn advice_is_that_for_the_end_and_the_input() {
        let told = |ended: Option<Stop>, room: Room| {
            let remedies = Remedies::of(ended.as_ref(), true, room);
            let both = [false, true].map(|touches| doubtful("flow", touches, remedies).doubts());
            both.concat().join("; ")
        };
        let said = told(Some(Stop::Steps(1)), Room::BoxSide);
        assert_eq!(said.matches("a larger `box_side`").count(), 2, "{said}");
        assert!(said.contains("`willmore resume`"), "{said}");
        assert!(said.contains("the time asked for"), "{said}");
        assert!(!said.contains("side_length"), "{said}");
        let said = told(Some(Stop::Time(1.0)), Room::Field);
        assert!(said.contains("asked for was not reached;"), "{said}");
        for useless in ["resume", "box_side", "side_length"] {
            assert!(!said.contains(useless), "{said}");
        }
        let said = told(None, Room::SideLength);
        assert_eq!(said.matches("a smaller `side_length`").count(), 2, "{said}");
    }
}
