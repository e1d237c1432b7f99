use jobs::{CheckOptions, Checked, Finding};
use serde_json::{Value, json};

use crate::console::Console;
use crate::error::{Result, refuse};

/// Checks the derivatives of the energy at the input.
pub fn run(options: CheckOptions, console: &Console) -> Result<()> {
    let Checked { device, findings } = jobs::check(options, console)?;
    let line = |finding: &Finding| {
        let verdict = if finding.passed { "ok" } else { "WRONG" };
        format!("{verdict:6}{}: {finding}", finding.check.name())
    };
    let text: Vec<String> = findings.iter().map(line).collect();
    let checks: Vec<Value> = findings.iter().map(to_json).collect();
    let outcome = json!({ "command": "check", "device": device.name(), "checks": checks });
    console.report(&outcome, &text.join("\n"))?;
    let failed = findings.iter().filter(|finding| !finding.passed);
    let failed: Vec<&str> = failed.map(|finding| finding.check.name()).collect();
    if !failed.is_empty() {
        let failed = failed.join(", ");
        refuse!("these checks failed on the device {device}: {failed}; do not trust its results");
    }
    Ok(())
}

fn to_json(finding: &Finding) -> Value {
    json!({
        "name": finding.check.name(),
        "found": finding.found,
        "passed": finding.passed,
    })
}
