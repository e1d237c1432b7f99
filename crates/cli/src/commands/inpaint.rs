//! `willmore inpaint`.

use engine::StepRule;
use surfaces::shapes::Region;

use super::flow::{FlowCommand, Shared};
use crate::cli::InpaintOptions;
use crate::error::Error;
use crate::input::{self, Loaded, Start};

/// The usual step in units of the inner one.
const STEP: f64 = 16.0;
/// The first step is divided into a ramp that starts this many times halved: at the border of the region there is a jump.
const HALVINGS: u32 = 12;

impl FlowCommand for InpaintOptions {
    const NAME: &'static str = "inpaint";

    fn shared(&mut self) -> Shared<'_> {
        self.flow.shared()
    }

    fn check(&mut self) -> Result<(), Error> {
        let mask = self.mask()?;
        if !Region::is_meant(mask) {
            let absolute = input::absolute(mask)?;
            self.mask = Some(absolute.to_string_lossy().into_owned());
        }
        Ok(())
    }

    fn prepare(&self, input: Loaded) -> Result<Loaded, Error> {
        let mask = self.mask()?;
        Ok(match input {
            Loaded::Plane(start, frame) => {
                let region = frame.mask(mask, start.field.grid())?;
                Loaded::Plane(self.restrict(start, region)?, frame)
            }
            Loaded::Space(start) => {
                let region = input::nodes(mask, start.field.grid())?;
                Loaded::Space(self.restrict(start, region)?)
            }
        })
    }

    fn rule(&mut self, mcf_step: f64) -> StepRule {
        self.flow.tau.get_or_insert(StepRule::Ramp {
            tau: STEP * mcf_step,
            halvings: HALVINGS,
        });
        self.flow.rule(mcf_step)
    }
}

impl InpaintOptions {
    fn mask(&self) -> Result<&str, Error> {
        self.mask.as_deref().ok_or_else(|| {
            Error::options("say which region to fill: --mask IMAGE, box:x0,y0,x1,y1 or ball:x,y,r")
        })
    }

    fn restrict<const D: usize, O>(
        &self,
        start: Start<D, O>,
        region: Vec<bool>,
    ) -> Result<Start<D, O>, Error> {
        let eps = self.flow.scheme.eps_over_h * start.field.grid().spacing();
        Ok(Start {
            field: self.ansatz.put_into(start.field, &region, eps)?,
            region: Some(region),
            ..start
        })
    }
}
