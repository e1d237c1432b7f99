//! Progress bars on standard error, for terminals only.

use std::borrow::Cow;

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A stack of progress bars. Nothing is drawn when standard error is not a terminal or `quiet` is
/// set, so logs stay clean; everything else works alike.
#[derive(Debug, Clone)]
pub struct ProgressBars {
    bars: MultiProgress,
}

impl ProgressBars {
    /// Progress bars on standard error if it is a terminal and not `quiet`.
    pub fn new(quiet: bool) -> Self {
        // It draws nothing where standard error is not a terminal.
        let bars = MultiProgress::new();
        if quiet {
            bars.set_draw_target(ProgressDrawTarget::hidden());
        }
        Self { bars }
    }

    /// A bar below the others: message, position of `length`, time elapsed, time to go.
    pub fn bar(&self, message: impl Into<Cow<'static, str>>, length: u64) -> ProgressBar {
        let template = "{msg:28} {bar:28} {pos:>6}/{len:<6} {elapsed_precise}  eta {eta_precise}";
        let style = ProgressStyle::with_template(template)
            .expect("the template is fixed and valid")
            .progress_chars("━╸ ");
        let bar = self.bars.add(ProgressBar::new(length));
        bar.with_style(style).with_message(message)
    }

    /// Takes all bars off the screen.
    pub fn clear(&self) {
        // Failing to clear the screen leaves an old bar on it and harms nothing else.
        let _ = self.bars.clear();
    }
}
