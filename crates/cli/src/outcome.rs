//! What the outcome of a run says to people: on the terminal, and at the top of the page.

use pages::five_digits;

use crate::prelude::*;

/// Measures whose change is told.
pub const SIZES: [&str; 3] = ["length", "area", "volume"];

/// The energy of a surface over that of a sphere is not below this but for errors of the grid.
const NO_SURFACE: f64 = 0.95;

/// How far a run has come.
pub fn progress(steps: usize, time: f64) -> String {
    let plural = if steps == 1 { "" } else { "s" };
    format!("{steps} step{plural} to t = {time:.4e}")
}

/// Energy, sizes, and how far the surface has moved, each in a sentence, and then what may have gone wrong.
pub fn sentences(outcome: &Value) -> Vec<String> {
    let number = |name: &str| outcome[name].as_f64();
    let mut text = Vec::new();
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
    let mesh = &outcome["mesh"];
    let sizes = SIZES.iter().filter_map(|name| {
        let change = match number(&format!("{name}_change_percent")) {
            Some(percent) if mesh.is_null() => format!(" ({percent:+.2} %)"),
            _ => String::new(),
        };
        Some(format!("{name} {}{change}", five_digits(number(name)?)))
    });
    text.extend(sizes.reduce(|all, next| format!("{all}, {next}")));
    let is_new = mesh["left_behind_percent"].is_null();
    if let Some(moved) = mesh["displacement_rms"].as_f64() {
        let of = |name: &str| mesh[name].as_f64();
        let length = |name: &str| of(name).unwrap_or_default();
        let what = if is_new { "the surface" } else { "vertices" };
        let sizes = match (of("volume_change_percent"), of("area_change_percent")) {
            (Some(volume), Some(area)) => format!("volume {volume:+.4} %, area {area:+.3} %"),
            _ => "the mesh is no longer closed, or folds over itself".to_owned(),
        };
        text.push(format!(
            "{what} moved by {moved:.3e} (root mean square) and {:.3e} at most, {:.3} % and {:.3} % of the longest side; {sizes}",
            length("displacement_largest"),
            length("displacement_rms_percent"),
            length("displacement_largest_percent"),
        ));
    }
    let left_behind = mesh["left_behind_percent"].as_f64();
    let notes = [
        (
            left_behind.is_some_and(|percent| percent > 1.0),
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
            outcome["same_topology"] == false && is_new,
            "parts or holes have come or gone: if they should not, use more --cells or a larger --side-length",
        ),
        (
            outcome["same_topology"] == false && !is_new,
            "on the grid parts or holes have come or gone: if vertices nearby followed the wrong surface, use more --cells or a larger --side-length",
        ),
        (
            outcome["touches_box"] == true,
            "the shape touches the side of the box: a smaller --side-length gives it room",
        ),
        (
            outcome["touches_box"] == false
                && outcome["energy_terms"].is_null()
                && number("energy_over_8_pi").is_some_and(|spheres| spheres < NO_SURFACE),
            "no closed surface has so little energy: the shape is near to its own periodic image, and a smaller --side-length gives it room",
        ),
    ];
    let holding = notes.into_iter().filter(|(holds, _)| *holds);
    text.extend(holding.map(|(_, note)| note.to_owned()));
    text
}
