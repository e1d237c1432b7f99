//! Ctrl-C and `kill` end a run at the next commit, not in the middle.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::Error;

/// A flag that the first SIGINT or SIGTERM sets. The second one ends the process at once.
///
/// The loop looks at it after each step, commits, and leaves with [`Interrupt::EXIT_CODE`]. SIGHUP is
/// left alone, so that `nohup` works.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Exit code of an interrupted program, after one signal as after two: 130, as shells have it for
    /// SIGINT.
    pub const EXIT_CODE: u8 = 130;

    /// Starts to catch the signals, or gives the flag for which they are caught already: those of a process set one flag. [`Error::Signals`]
    /// if the system does not let it.
    pub fn catch() -> Result<Self, Error> {
        static CAUGHT: OnceLock<Interrupt> = OnceLock::new();
        if let Some(interrupt) = CAUGHT.get() {
            return Ok(interrupt.clone());
        }
        let interrupt = Self::default();
        for signal in [SIGINT, SIGTERM] {
            // In this order: the first signal finds the flag down and then raises it.
            flag::register_conditional_shutdown(
                signal,
                i32::from(Self::EXIT_CODE),
                interrupt.0.clone(),
            )
            .and_then(|_| flag::register(signal, interrupt.0.clone()))
            .map_err(Error::Signals)?;
        }
        Ok(CAUGHT.get_or_init(|| interrupt).clone())
    }

    /// A flag that no signal sets, for callers that have none to wait for.
    pub fn never() -> Self {
        Self::default()
    }

    /// Whether the loop should commit and leave.
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Asks for it, as a signal does.
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
