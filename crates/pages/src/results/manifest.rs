//! The facts of a `manifest.json` that say how a run was made.

use serde::Deserialize;
use serde_json::{Map, Value};

use crate::error::{Error, Result};
use crate::facts::{Facts, five_digits};

/// What is read of a manifest; all but the name and the parameters may be absent.
#[derive(Deserialize)]
struct Manifest {
    experiment: String,
    parameters: Map<String, Value>,
    version: Option<String>,
    commit: Option<String>,
    rustc: Option<String>,
    target: Option<String>,
    cpus: Option<u64>,
    device: Option<String>,
    dtype: Option<String>,
    backend: Option<String>,
    seed: Option<u64>,
    started: Option<String>,
    wall_seconds: Option<f64>,
    #[serde(default)]
    phases: Vec<Phase>,
}

#[derive(Deserialize)]
struct Phase {
    name: String,
    seconds: f64,
}

/// More phases than these are too many to read.
const MOST_PHASES: usize = 40;

/// The important facts: program, machine, seed, times, parameters.
///
/// # Errors
/// [`Error::Json`] if the text is no manifest.
pub(crate) fn facts(name: &str, json: &str) -> Result<Facts> {
    let manifest: Manifest = serde_json::from_str(json).map_err(|error| Error::Json {
        name: name.to_owned(),
        expected: "the manifest of a run",
        problem: error.to_string(),
    })?;
    let device = [&manifest.device, &manifest.backend, &manifest.dtype]
        .into_iter()
        .flatten()
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    let entries = [
        ("experiment", Some(manifest.experiment)),
        ("version", manifest.version),
        ("commit", manifest.commit),
        ("device", Some(device).filter(|device| !device.is_empty())),
        ("seed", manifest.seed.map(|seed| seed.to_string())),
        ("started", manifest.started),
        (
            "wall time",
            manifest
                .wall_seconds
                .map(|s| format!("{} s", five_digits(s))),
        ),
        ("processors", manifest.cpus.map(|n| n.to_string())),
        ("compiler", manifest.rustc),
        ("target", manifest.target),
    ];
    let mut facts = Facts::new();
    for (name, value) in entries {
        if let Some(value) = value {
            facts = facts.with(name, value);
        }
    }
    for (name, value) in &manifest.parameters {
        facts = facts.with_value(name, value);
    }
    let left_out = manifest.phases.len().saturating_sub(MOST_PHASES);
    for phase in manifest.phases.iter().take(MOST_PHASES) {
        facts = facts.with(&phase.name, format!("{} s", five_digits(phase.seconds)));
    }
    if left_out > 0 {
        facts = facts.with("further parts of the run", left_out.to_string());
    }
    Ok(facts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_flat_and_absent_facts_left_out() {
        let json = r#"{"experiment": "x", "parameters": {"n": [64, 128], "a": {"b": true, "c": null},
            "l": [{"d": "e"}]}, "device": "cpu", "dtype": "f64", "seed": null, "wall_seconds": 1.5}"#;
        let facts = facts("x/manifest.json", json).unwrap();
        let entries: Vec<(&str, &str)> = facts
            .entries()
            .iter()
            .map(|(name, value)| (name.as_str(), value.as_str()))
            .collect();
        assert_eq!(
            entries,
            [
                ("experiment", "x"),
                ("device", "cpu, f64"),
                ("wall time", "1.5000 s"),
                ("a.b", "true"),
                ("l[0].d", "e"),
                ("n", "64, 128"),
            ]
        );
    }

    #[test]
    fn what_is_no_manifest_is_named() {
        for json in ["", "{}", "[]", "{\"experiment\": 3, \"parameters\": {}}"] {
            let message = facts("x/manifest.json", json).unwrap_err().to_string();
            assert!(
                message.contains("x/manifest.json") && !message.contains('\n'),
                "{message}"
            );
        }
    }
}
