//! `willmore inpaint`.

use super::flow::{FlowCommand, Shared};
use crate::cli::InpaintOptions;
use crate::prelude::*;

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
        self.flow.check_tolerance(StepRule::Ramp {
            tau: f64::NAN,
            halvings: HALVINGS,
        })?;
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
            Loaded::Plane(mut start, image) => {
                let shape = image.mask(mask, start.field.grid())?;
                let region = input::nodes(mask, shape.as_ref(), start.field.grid())?;
                start.outlet = image.repaired(start.outlet, shape.as_ref())?;
                Loaded::Plane(self.restrict(start, region)?, image)
            }
            Loaded::Space(start) => {
                let shape = input::region(mask)?;
                let region = input::nodes(mask, shape.as_ref(), start.field.grid())?;
                Loaded::Space(self.restrict(start, region)?)
            }
        })
    }

    fn willmore(&mut self) -> Option<&mut FlowOptions> {
        Some(&mut self.flow)
    }

    fn rule(&mut self, scales: &Scales, unit: f64) -> StepRule {
        self.flow.tau.get_or_insert(StepRule::Ramp {
            tau: STEP * scales.mcf_step * unit.powi(2),
            halvings: HALVINGS,
        });
        self.flow.rule(scales, unit)
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
        let eps = self.flow.scheme.eps_over_h() * start.field.grid().spacing();
        Ok(Start {
            field: self.ansatz.put_into(start.field, &region, eps)?,
            region: Some(region),
            ..start
        })
    }
}
