//! `willmore inpaint`.

use geometry::Field;

use super::flow::Willmore;
use crate::cli::{FlowOptions, InpaintOptions};
use crate::error::Error;
use crate::input::{self, Loaded, Start};
use crate::shape::Region;
use crate::tau::Tau;

/// The usual step in units of the inner one.
const STEP: f64 = 16.0;
/// The first step is divided into a ramp that starts this many times halved: at the border of the region there is a jump.
const HALVINGS: u32 = 12;

impl Willmore for InpaintOptions {
    const COMMAND: &'static str = "inpaint";

    fn flow(&mut self) -> &mut FlowOptions {
        &mut self.flow
    }

    fn check(&mut self) -> Result<(), Error> {
        let mask = self.mask()?;
        if !Region::is_meant(mask) {
            let absolute = std::path::absolute(mask).map_err(|source| Error::Io {
                action: "find",
                path: mask.into(),
                source,
            })?;
            self.mask = Some(absolute.to_string_lossy().into_owned());
        }
        Ok(())
    }

    fn tau(&self, mcf_step: f64) -> Tau {
        Tau::Ramp {
            tau: STEP * mcf_step,
            halvings: HALVINGS,
        }
    }

    fn prepare(&self, input: Loaded, eps: f64) -> Result<Loaded, Error> {
        let mask = self.mask()?;
        Ok(match input {
            Loaded::Plane(start, frame) => {
                let region = frame.mask(mask, start.field.grid())?;
                Loaded::Plane(self.restrict(start, region, eps)?, frame)
            }
            Loaded::Space(start) => {
                let region = input::nodes(mask, start.field.grid())?;
                Loaded::Space(self.restrict(start, region, eps)?)
            }
        })
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
        eps: f64,
    ) -> Result<Start<D, O>, Error> {
        let field: Field<D> = input::with_ansatz(start.field, &region, &self.ansatz, eps)?;
        Ok(Start {
            field,
            region: Some(region),
            ..start
        })
    }
}
