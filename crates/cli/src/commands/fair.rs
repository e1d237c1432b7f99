//! `willmore fair`.

use std::f64::consts::PI;

use super::flow::{FlowCommand, Shared};
use crate::cli::FairOptions;
use crate::keep::Keep;
use crate::prelude::*;

/// Energies below this have only balls, which have `8 pi`.
const BALL: f64 = 1.2 * 8.0 * PI;

/// Of a segmentation, details of so many voxels are taken for its steps,
const STEPS: f64 = 1.6;
/// as long as the surface goes no further than so many, root of the mean square.
const FARTHEST: f64 = 0.35;

/// The usual steps on a grid of this spacing.
fn graded(spacing: f64) -> StepRule {
    StepRule::Graded {
        first: Fairing::first_step(spacing),
        part: Fairing::GROWTH,
    }
}

impl FairOptions {
    /// Whether it ends as soon as something is reached, which must not be jumped over.
    fn takes_small_steps(&self) -> bool {
        let ratio = self.energy_ratio.or(self.flow.energy);
        self.noise.is_some() || ratio.is_some() || !self.ends
    }

    /// A segmentation, whose volume is kept.
    fn load_volume(&mut self, say: SayOptions) -> Result<Loaded, Error> {
        for (name, given) in [
            ("--noise", self.noise.is_some()),
            ("--keep", self.keep.is_some()),
        ] {
            if given {
                return Err(Error::options(format!(
                    "{name} has no meaning for a volume, of which a new mesh is made: leave it out"
                )));
            }
        }
        let flow = &mut self.flow;
        if flow.reduced_volume.is_none() {
            flow.volume.get_or_insert(SizeTarget::Keep);
        }
        let mut loaded = input::load(&mut flow.input, flow.scheme.eps_over_h(), say)?;
        if let Loaded::Space(Start { field, outlet, .. }) = &mut loaded
            && let Some(voxels) = outlet.voxels.as_mut().filter(|_| !self.ends)
        {
            voxels.farthest = Some(FARTHEST * voxels.side);
            flow.time = Some((STEPS * voxels.side).powi(4));
            flow.tau.get_or_insert(graded(field.grid().spacing()));
        }
        Ok(loaded)
    }
}

impl FlowCommand for FairOptions {
    const NAME: &'static str = "fair";

    fn shared(&mut self) -> Shared<'_> {
        self.flow.shared()
    }

    fn check(&mut self) -> Result<(), Error> {
        let flow = &self.flow;
        self.ends = self.energy_ratio.is_some()
            || flow.time.is_some()
            || flow.energy.is_some()
            || flow.steps.is_some();
        for (name, value) in [
            ("--noise", self.noise),
            ("--energy-ratio", self.energy_ratio),
        ] {
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                return Err(Error::options(format!("{name} {value} must be positive")));
            }
        }
        let usual = if self.takes_small_steps() {
            graded(f64::NAN)
        } else {
            StepRule::Controlled
        };
        self.flow.check_tolerance(usual)?;
        if let Some(ratio) = self.energy_ratio.filter(|ratio| *ratio >= 1.0) {
            return Err(Error::options(format!(
                "--energy-ratio {ratio} is reached before the first step: give a part below 1"
            )));
        }
        if let Some(energy) = self.flow.energy.filter(|energy| *energy < BALL) {
            return Err(Error::options(format!(
                "--energy {energy} has only a ball, which has 8 pi = 25.13, and nothing of the shape would be left: leave it out to take \
                 off the noise, or give --energy-ratio 0.5 for half the energy that there is"
            )));
        }
        Ok(())
    }

    fn load(&mut self, say: SayOptions) -> Result<Loaded, Error> {
        if input::is_volume(&self.flow.input)? {
            return self.load_volume(say);
        }
        let ends = self.ends;
        let eps_over_h = self.flow.scheme.eps_over_h();
        let input = &mut self.flow.input;
        let Some(path) = input::mesh_file(input)? else {
            if input.input.is_some() && (self.noise.is_some() || self.keep.is_some() || !ends) {
                return Err(Error::options(
                    "only a mesh in a file has noise to take off: say how smooth the surface is to become, by --energy-ratio, --time, \
                     --energy or --steps, without --noise and --keep",
                ));
            }
            return input::load(input, eps_over_h, say);
        };
        if input.repair && !self.remesh {
            return Err(Error::options(
                "--repair makes a new mesh: write it by `willmore sample --repair --save`, which can then be faired, or give --remesh",
            ));
        }
        if let Some(mask) = self.keep.as_deref().and_then(Keep::mask) {
            self.keep = Some(input::absolute(mask)?.to_string_lossy().into_owned());
        }
        let bytes = if input.repair {
            surfaces::encode(&path, input::closed(&path, true, say)?.mesh())?
        } else {
            std::fs::read(&path).map_err(Error::io("read", &path))?
        };
        let noise = self.noise.or(ends.then_some(0.0));
        let (mut own, warnings) = OwnMesh::new(&path, bytes, noise, self.keep.clone())?;
        own.is_new = self.remesh;
        own.keeps_volume = self.flow.volume == Some(SizeTarget::Keep);
        for warning in warnings {
            say.warn(&format!("{}: {warning}", path.display()));
        }
        if noise.is_none() {
            say.note(&format!(
                "noise: {:.3e}, {:.3} % of the longest side, estimated (--noise)",
                own.fairing().noise(),
                100.0 * own.fairing().noise() / own.longest_side()
            ));
            self.noise = Some(own.fairing().noise());
        }
        let input = &mut self.flow.input;
        input::load_own(input, own, &path, (eps_over_h, self.allow_loss), say)
    }

    fn ends(&self) -> bool {
        self.noise.is_some() || self.energy_ratio.is_some() || !self.ends
    }

    fn willmore(&mut self) -> Option<&mut FlowOptions> {
        Some(&mut self.flow)
    }

    fn energy_ratio(&self) -> Option<f64> {
        self.energy_ratio
    }

    fn prepare(&self, input: Loaded) -> Result<Loaded, Error> {
        match input {
            Loaded::Space(..) => Ok(input),
            Loaded::Plane(..) => Err(Error::options(
                "`fair` is for surfaces in space; for images and shapes in the plane there is `willmore flow`",
            )),
        }
    }

    fn rule(&mut self, scales: &Scales, unit: f64) -> StepRule {
        if self.takes_small_steps() {
            let spacing = scales.eps / self.flow.scheme.eps_over_h();
            self.flow.tau.get_or_insert(graded(spacing));
        }
        self.flow.rule(scales, unit)
    }

    fn format(&self) -> Option<String> {
        self.format.clone()
    }
}
