//! Ctrl-C and `kill` end a run soon, in a state from which it can go on.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::{flag, low_level};

use crate::Error;

/// What becomes of a process whose time to end is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Last {
    /// It ends now.
    Leave,
    /// It is at its end.
    Wait,
}

/// A flag that the first SIGINT or SIGTERM sets. The second one ends the process at once.
///
/// The loop drops the step that it makes, commits, and leaves with [`Interrupt::EXIT_CODE`]. SIGHUP is
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

    /// Ends the process with [`Interrupt::EXIT_CODE`] so long after a signal, if it has not ended by then: one evaluation on a large grid, or the
    /// writing of large files, is not waited for. Commits are whole or absent, so that the run goes on from the last one. `last_words` comes first, and
    /// may say that the process is at its end anyway.
    pub fn leave_within(
        &self,
        grace: Duration,
        last_words: impl FnOnce() -> Last + Send + 'static,
    ) {
        const LOOK: Duration = Duration::from_millis(20);
        let interrupt = self.clone();
        thread::spawn(move || {
            while !interrupt.requested() {
                thread::sleep(LOOK);
            }
            thread::sleep(grace);
            match last_words() {
                Last::Leave => low_level::exit(Self::EXIT_CODE.into()),
                Last::Wait => {}
            }
        });
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
