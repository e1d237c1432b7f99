use jobs::SampleOptions;
use serde_json::json;

use super::labels;
use crate::console::Console;
use crate::error::Result;

/// Writes an input as the flows begin with it, possibly damaged.
pub fn run(options: SampleOptions, console: &Console) -> Result<()> {
    let of_label = |label| {
        let mut one = options.clone();
        labels::choose(&mut one.input, label);
        labels::named(&mut one.save, label);
        run(one, console)
    };
    if labels::with_each(&options.input, console, of_label)? {
        return Ok(());
    }
    let path = options.save.clone();
    jobs::sample(options, console)?;
    let outcome = json!({ "command": "sample", "file": path.to_string_lossy() });
    console.report(&outcome, &format!("wrote {}", path.display()))
}
