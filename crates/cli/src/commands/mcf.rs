//! `willmore mcf`.

use engine::Flow;

use super::flow::{FlowCommand, Shared};
use crate::cli::{McfOptions, SchemeOptions};
use crate::prelude::*;

impl FlowCommand for McfOptions {
    const NAME: &'static str = "mcf";
    const FLOW: Flow = Flow::MeanCurvature;
    const MANY_STEPS: usize = 100_000;

    fn shared(&mut self) -> Shared<'_> {
        Shared {
            input: &mut self.input,
            scheme: &mut self.scheme,
            steps: &mut self.steps,
            time: self.time,
            energy: None,
            keep: &mut self.keep,
            common: &mut self.common,
        }
    }

    fn method(&self) -> Method {
        self.method
    }

    fn check(&mut self) -> Result<(), Error> {
        let SchemeOptions {
            scheme, network, ..
        } = &self.scheme;
        let chosen = network.is_some() || *scheme != Scheme::Accurate;
        if chosen && !self.method.is_learned() {
            return Err(Error::options(
                "--network and --scheme have no meaning for finite elements: leave them out, or choose --method network",
            ));
        }
        Ok(())
    }

    fn rule(&mut self, scales: &Scales, _: f64) -> StepRule {
        StepRule::Constant(scales.mcf_step)
    }
}
