//! What the numbers of a run are, in words for people: keys of its files are for programs.

use clap::{Arg, Args, Command};
use pages::Facts;

use crate::options::{FairOptions, FlowOptions, InpaintOptions, McfOptions};
use crate::prelude::*;

/// A change with its sign, to so many digits behind the point; one that is zero to these digits has the sign +.
pub fn signed(change: f64, digits: usize) -> String {
    let text = format!("{change:+.digits$}");
    let is_zero = !text.contains(|c: char| ('1'..='9').contains(&c));
    if is_zero {
        text.replace('-', "+")
    } else {
        text
    }
}

/// The outcome of a run in `dimension` dimensions, as its summary has it.
pub fn numbers(outcome: &Value, dimension: usize) -> Facts {
    let own = match dimension {
        2 => &PLANE[..],
        _ => &SPACE[..],
    };
    let time = match outcome["command"].as_str() {
        Some("mcf") => "Time at the end, in squared units of the input",
        _ => "Time at the end, in units of the input to the fourth power",
    };
    let all = own.iter().chain(&NUMBERS).copied();
    facts(outcome, all.chain([("/time", time)]).chain(REST))
}

/// The program that made a run, its network and its device.
pub fn program(about: &Value) -> Facts {
    facts(about, PROGRAM)
}

/// The options of a run of a command, under what its help says of them.
pub fn options(values: &Value, command: &str) -> Facts {
    let of_command = match command {
        "fair" => FairOptions::augment_args,
        "inpaint" => InpaintOptions::augment_args,
        "mcf" => McfOptions::augment_args,
        _ => FlowOptions::augment_args,
    };
    let program = of_command(Command::new("options"));
    let known = || program.get_arguments();
    let words = |key: &str| match key {
        "command" => "Command".to_owned(),
        "input" => "Input".to_owned(),
        _ => match known().find(|option| option.get_long() == Some(key)) {
            Some(option) => format!("{} (--{key})", phrase(option)),
            None => format!("--{key}"),
        },
    };
    let entries = values.as_object().into_iter().flatten();
    entries.fold(Facts::default(), |facts, (key, value)| {
        facts.with_value(&words(key), &answered(value.clone()))
    })
}

/// A column of the table of steps.
pub fn column(key: &str) -> String {
    match COLUMNS.iter().find(|(name, _)| *name == key) {
        Some((_, words)) => (*words).to_owned(),
        None => key.replace('_', " "),
    }
}

/// What the units of energy and measures are.
pub fn units(dimension: usize) -> &'static str {
    match dimension {
        2 => "the energy in one over them, the area in squared ones",
        _ => "the energy has none, the area is in squared and the volume in cubed ones",
    }
}

/// What an option is, without the values that it may have.
fn phrase(option: &Arg) -> String {
    let help = option.get_help().map(ToString::to_string);
    let help = help.unwrap_or_default();
    let ends = [" [", ": ", "; ", ". "].iter();
    let end = ends.filter_map(|end| help.find(end)).min();
    help[..end.unwrap_or(help.len())].to_owned()
}

/// Values under the words for their [pointers](Value::pointer), in this order; then those for which there are no words, under their keys.
fn facts<'a>(values: &Value, words: impl IntoIterator<Item = (&'a str, &'a str)>) -> Facts {
    let mut left = values.clone();
    let mut facts = Facts::default();
    for (pointer, words) in words {
        // Null stays in its place, which is left out below.
        if let Some(value) = left.pointer_mut(pointer).map(Value::take) {
            facts = facts.with_value(words, &answered(value));
        }
    }
    let entries = left.as_object().into_iter().flatten();
    entries.fold(facts, |facts, (key, value)| {
        facts.with_value(&key.replace('_', " "), &answered(value.clone()))
    })
}

fn answered(value: Value) -> Value {
    match value {
        Value::Bool(true) => "yes".into(),
        Value::Bool(false) => "no".into(),
        other => other,
    }
}

const COLUMNS: [(&str, &str); 12] = [
    ("time", "time after the step"),
    ("tau", "time step"),
    ("energy_before", "objective before"),
    ("energy", "objective after"),
    ("willmore_energy", "Willmore energy"),
    ("displacement", "root mean square displacement"),
    ("convolutions", "convolutions"),
    ("reach", "reach of the interface"),
    ("run_distance", "distance of the two runs"),
    ("newton", "Newton steps"),
    ("hvp", "Hessian products"),
    ("halvings", "times shortened"),
];

const PLANE: [(&str, &str); 7] = [
    (
        "/first_energy",
        "Energy at the beginning, in one over units of the input",
    ),
    (
        "/energy",
        "Energy at the end, in one over units of the input",
    ),
    (
        "/length",
        "Length of the curve at the end, in units of the input",
    ),
    (
        "/length_change_percent",
        "Change of this length since the beginning, in percent",
    ),
    (
        "/area",
        "Area inside the curve at the end, in squared units of the input",
    ),
    (
        "/area_change_percent",
        "Change of this area since the beginning, in percent",
    ),
    (
        "/integrated_mean_curvature",
        "Integral of the curvature along the curve at the end, a number without unit",
    ),
];

const SPACE: [(&str, &str); 8] = [
    (
        "/first_energy",
        "Energy at the beginning, a number without unit",
    ),
    ("/energy", "Energy at the end, a number without unit"),
    (
        "/energy_over_8_pi",
        "Energy at the end over that of a sphere",
    ),
    (
        "/area",
        "Area of the surface on the grid at the end, in squared units of the input",
    ),
    (
        "/area_change_percent",
        "Change of this area since the beginning, in percent",
    ),
    (
        "/volume",
        "Volume inside the surface on the grid at the end, in cubed units of the input",
    ),
    (
        "/volume_change_percent",
        "Change of this volume since the beginning, in percent",
    ),
    (
        "/integrated_mean_curvature",
        "Integral of the mean curvature over the surface at the end, in units of the input",
    ),
];

const NUMBERS: [(&str, &str); 31] = [
    (
        "/energy_terms/spontaneous_curvature",
        "Spontaneous curvature in the energy, in one over units of the input",
    ),
    (
        "/energy_terms/tension",
        "Tension in the energy, in one over squared units of the input",
    ),
    (
        "/energy_terms/pressure",
        "Pressure in the energy, in one over cubed units of the input",
    ),
    (
        "/energy_reached",
        "Was the energy reached that was asked for?",
    ),
    (
        "/sizes_reached",
        "Have the sizes that are held reached their targets?",
    ),
    (
        "/interface_slope",
        "How steep the interface is at the end, which is 1 with the optimal profile",
    ),
    (
        "/reduced_volume",
        "Reduced volume at the end, which is 1 for a ball or a disc",
    ),
    (
        "/displacement",
        "How far the surface on the grid has gone, root mean square, in units of the input",
    ),
    (
        "/mesh/noise",
        "Noise that was taken off, standard deviation along the normals, in units of the input",
    ),
    (
        "/mesh/displacement_rms",
        "How far the vertices of the mesh have gone, root mean square, in units of the input",
    ),
    (
        "/mesh/displacement_rms_percent",
        "This root mean square, in percent of the longest side",
    ),
    (
        "/mesh/displacement_largest",
        "How far the vertices of the mesh have gone at most, in units of the input",
    ),
    (
        "/mesh/displacement_largest_percent",
        "This longest way, in percent of the longest side",
    ),
    (
        "/mesh/hausdorff_distance",
        "Hausdorff distance of the meshes before and after, in units of the input",
    ),
    (
        "/mesh/hausdorff_distance_percent",
        "This distance, in percent of the longest side",
    ),
    (
        "/mesh/is_open",
        "Does the mesh have a boundary, which did not move?",
    ),
    (
        "/mesh/kept_edges",
        "Edges of the mesh that have stayed sharp",
    ),
    (
        "/mesh/kept_edges_length",
        "Their length, in units of the input",
    ),
    (
        "/mesh/max_distance",
        "How far from the surface before vertices may be, in units of the input",
    ),
    (
        "/mesh/vertices_at_max_distance",
        "Vertices that are this far from it",
    ),
    (
        "/mesh/vertices_at_max_distance_percent",
        "These vertices, in percent of all",
    ),
    (
        "/mesh/area_change_percent",
        "Change of the area of the mesh, in percent",
    ),
    (
        "/mesh/volume_change_percent",
        "Change of the volume of the mesh, in percent",
    ),
    (
        "/mesh/volume_missed_percent",
        "Difference of this volume from that which was asked for, in percent",
    ),
    (
        "/mesh/left_behind_percent",
        "Vertices that could not follow the surface, in percent of all",
    ),
    (
        "/mesh/held_back",
        "Vertices held back, since noise does not explain how far they would have gone",
    ),
    ("/components", "Closed parts at the end"),
    ("/euler_characteristic", "Euler characteristic at the end"),
    (
        "/same_topology",
        "Are there as many parts and holes as before?",
    ),
    ("/touches_box", "Does the shape touch the side of its box?"),
    ("/steps", "Steps in time"),
];

const REST: [(&str, &str); 15] = [
    (
        "/shortened_steps",
        "Steps that were made shorter than they were to be",
    ),
    (
        "/time_steps/estimated_error",
        "Error that the time steps make, estimated, in units of the input",
    ),
    (
        "/time_steps/path",
        "Way of the place that moves farthest in each step, added up, in units of the input",
    ),
    (
        "/time_steps/longest_displacement_in_widths",
        "Longest way within a stage of a step, in widths of the interface",
    ),
    (
        "/direct_steps/convolutions",
        "Convolutions of the whole grid",
    ),
    (
        "/direct_steps/run_distance",
        "Distance of the runs of whole and of half parts at the end, more than the error of the time steps, in units of the input",
    ),
    (
        "/direct_steps/reach_in_cells",
        "Largest radius of balls that touch the shape wherever they lie on it, in cells, at the end",
    ),
    (
        "/direct_steps/energy_increases",
        "Steps after which the energy was higher than before",
    ),
    ("/grid/cells", "Cells along a side of the box"),
    ("/grid/spacing", "Side of a cell, in units of the input"),
    (
        "/grid/origin",
        "Corner at which the box begins, in coordinates of the input",
    ),
    (
        "/grid/interface_width",
        "Width of the interface, in units of the input",
    ),
    ("/grid/stored_cells", "Cells that are stored"),
    ("/finished", "Is the run finished?"),
    ("/command", "Command"),
];

const PROGRAM: [(&str, &str); 6] = [
    ("/command", "Command"),
    ("/name", "Name of the shape"),
    ("/program", "Program and its version"),
    ("/network/name", "Network"),
    ("/network/checksum", "Checksum of the network"),
    ("/device", "Device and precision of numbers"),
];
