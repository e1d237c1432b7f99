//! `willmore mcf`.

use crate::cli::{McfOptions, SchemeOptions};
use crate::prelude::*;

impl McfOptions {
    pub fn check(&self) -> Result<(), Error> {
        let SchemeOptions {
            scheme, network, ..
        } = &self.run.scheme;
        let chosen = network.is_some() || *scheme != Scheme::Accurate;
        if chosen && !self.method.is_learned() {
            refuse!(
                "--network and --scheme have no meaning for finite elements: leave them out, or choose --method network",
            );
        }
        Ok(())
    }
}
