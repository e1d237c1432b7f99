use crate::file::Input;
use crate::input::{InitialShape, Loaded};
use crate::options::InpaintOptions;
use crate::prelude::*;
use crate::values::Ansatz;

impl InpaintOptions {
    pub(crate) fn check(&mut self) -> Result<()> {
        let Some(mask) = &mut self.mask else {
            return Err(Refusal::NoMask.into());
        };
        if !mask.is_region() {
            let file = mask.file()?;
            mask.rename(&file.path);
        }
        Ok(())
    }

    pub(crate) fn load(&mut self, device: DeviceKind, watcher: &dyn Watcher) -> Result<Loaded> {
        let mut reader = self.input.reader(&self.operator, device, watcher)?;
        // The mask may open the shape far from its surface.
        reader.takes_bricks = false;
        let loaded = reader.load()?;
        let mask = self.mask.as_ref().ok_or(Refusal::NoMask)?;
        Ok(match loaded {
            Loaded::Plane(mut start) => {
                let shape = match region(mask)? {
                    Some(region) => region,
                    None => start.presentation.mask(mask, start.initial.grid())?,
                };
                start.presentation.repair(shape.as_ref(), watcher)?;
                Loaded::Plane(self.restricted(start, shape.as_ref())?)
            }
            Loaded::Space(start) => {
                let shape = region(mask)?.ok_or_else(|| Refusal::MaskOfImage {
                    mask: mask.to_string(),
                    dimension: 3,
                })?;
                Loaded::Space(self.restricted(start, shape.as_ref())?)
            }
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
                mask: self
                    .mask
                    .as_ref()
                    .map_or_else(String::new, Input::to_string),
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

/// The region of a mask that is no image: a shape by its name, or the nodes of a field where it is negative.
fn region<const D: usize>(mask: &Input) -> Result<Option<Box<dyn SignedDistance<D>>>> {
    if let Some(field) = mask.in_memory_field::<D>() {
        let nearest = move |x: [f64; D]| field.values()[field.grid().nearest(x)];
        return Ok(Some(Box::new(nearest)));
    }
    if !mask.is_region() {
        return Ok(None);
    }
    let region: Region = mask.name().parse().map_err(|reason| Refusal::Value {
        option: "mask",
        value: None,
        reason,
    })?;
    Ok(Some(region.shape::<D>()?))
}
