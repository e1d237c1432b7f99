//! What is not stored of a domain on bricks.

use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::{Bricks, Nodes};

use super::Domain;
use crate::Error;

/// Nodes that are evaluated at once.
const MOST: usize = 1 << 20;

impl<const D: usize> Domain<D> {
    /// The integral of a density over the nodes that are not stored, `h^D` times its sum there, where the phase field is constant: a few bricks at a time,
    /// so that the memory is bounded. The density may depend on the position; it sees constants everywhere. None counts as zero.
    ///
    /// # Errors
    /// As the density, [`Error::Operators`] if the device fails.
    pub fn integral_of_unstored(
        &self,
        density: impl Fn(&Tensor<D>, &Self) -> Result<Option<Tensor<D>>, Error>,
    ) -> Result<f64, Error> {
        let Some(bricks) = self.nodes.bricks() else {
            return Ok(0.0);
        };
        let mut total = 0.0;
        for (phase, rest) in [false, true].into_iter().zip(self.phase_values) {
            let places: Vec<usize> = (0..bricks.per_axis().pow(D as u32))
                .filter(|flat| {
                    let place = bricks.place(*flat);
                    bricks.number(place).is_none() && bricks.is_positive(place) == phase
                })
                .collect();
            for part in places.chunks((MOST / bricks.volume()).max(1)) {
                let domain = self.constant_on(bricks, part, phase)?;
                let device = (domain.home.device(), domain.home.dtype());
                let u = Tensor::<D>::full(domain.shape(), rest, device);
                let Some(density) = density(&u, &domain)? else {
                    return Ok(total);
                };
                total += self.home.scalar(density.sum())? * self.cell_volume();
            }
        }
        Ok(total)
    }

    /// Some bricks of the grid, by their row-major indices in order, with one phase all around.
    fn constant_on(
        &self,
        bricks: &Bricks<D>,
        part: &[usize],
        positive: bool,
    ) -> Result<Self, geometry::Error> {
        let is_part = |place| part.binary_search(&bricks.flat(place)).is_ok();
        let (cells, side) = (bricks.cells(), bricks.side());
        let bricks = Bricks::new(cells, side, is_part, |_| positive)?;
        let nodes = Nodes::on_bricks(*self.grid(), Arc::new(bricks));
        Ok(Self::new(nodes, self.phase_values, self.scales, &self.home))
    }
}
