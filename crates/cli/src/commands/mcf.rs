//! `willmore mcf`.

use engine::Flow;

use super::flow::{FlowCommand, Shared};
use crate::cli::{McfMethod, McfOptions, SchemeOptions};
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
        match self.method {
            McfMethod::Network => Method::Hybrid,
            McfMethod::FeImplicit => Method::FeImplicit,
            McfMethod::FeSemi => Method::FeSemi,
        }
    }

    fn check(&mut self) -> Result<(), Error> {
        let SchemeOptions {
            scheme, network, ..
        } = &self.scheme;
        let chosen = network.is_some() || *scheme != Scheme::Accurate;
        if chosen && self.method != McfMethod::Network {
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
