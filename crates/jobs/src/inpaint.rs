use crate::input::{InitialShape, Loaded};
use crate::options::InpaintOptions;
use crate::paths::absolute;
use crate::prelude::*;
use crate::values::Ansatz;

impl InpaintOptions {
    pub(crate) fn check(&mut self) -> Result<()> {
        let Some(mask) = &self.mask else {
            return Err(Refusal::NoMask.into());
        };
        if !Region::is_meant(mask) {
            let absolute = absolute(mask)?;
            self.mask = Some(absolute.to_string_lossy().into_owned());
        }
        Ok(())
    }

    pub(crate) fn load(&mut self, device: DeviceKind, watcher: &dyn Watcher) -> Result<Loaded> {
        let mut reader = self.input.reader(&self.operator, device, watcher)?;
        let loaded = reader.load()?;
        let mask = self.mask.as_deref().unwrap_or_default();
        Ok(match loaded {
            Loaded::Plane(mut start) => {
                let shape = if Region::is_meant(mask) {
                    region(mask)?
                } else {
                    start.presentation.mask(mask, start.initial.grid())?
                };
                start.presentation.repair(shape.as_ref(), watcher)?;
                Loaded::Plane(self.restricted(start, shape.as_ref())?)
            }
            Loaded::Space(start) => Loaded::Space(self.restricted(start, region(mask)?.as_ref())?),
        })
    }

    /// Lets only the nodes inside a mask move, where the shape is what the ansatz says.
    fn restricted<const D: usize, O>(
        &self,
        mut start: InitialShape<D, O>,
        mask: &dyn SignedDistance<D>,
    ) -> Result<InitialShape<D, O>> {
        let mut field = start.initial.field()?;
        let grid = *field.grid();
        let inside = |node: usize| mask.signed_distance(grid.node(node)) < 0.0;
        let region: NodeSet = (0..grid.len()).map(inside).collect();
        if region.is_empty() {
            return Err(Refusal::MaskWithoutNodes {
                mask: self.mask.clone().unwrap_or_default(),
                origin: grid.origin().to_vec(),
                side: grid.side(),
            }
            .into());
        }
        let eps = self.operator.eps_over_h() * grid.spacing();
        let inner = match &self.ansatz {
            Ansatz::Keep => field.clone(),
            Ansatz::Empty => Field::constant(grid, -1.0),
            Ansatz::Full => Field::constant(grid, 1.0),
            Ansatz::Shape(shape) => phase_field(grid, shape.shape::<D>()?.as_ref(), eps)?,
        };
        let values = field.values_mut().iter_mut().zip(inner.values());
        for ((value, inner), _) in values.zip(region.iter()).filter(|(_, inside)| *inside) {
            *value = *inner;
        }
        (start.initial, start.region) = (field.into(), Some(region));
        Ok(start)
    }
}

/// A region that is a mask.
fn region<const D: usize>(mask: &str) -> Result<Box<dyn SignedDistance<D>>> {
    if !Region::is_meant(mask) {
        return Err(Refusal::MaskOfImage {
            mask: mask.to_owned(),
            dimension: D,
        }
        .into());
    }
    let region: Region = mask.parse().map_err(|reason| Refusal::Value {
        option: "mask",
        value: None,
        reason,
    })?;
    Ok(region.shape::<D>()?)
}
