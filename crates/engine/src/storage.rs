//! What of a phase field is stored, and how much memory that takes.

use derive_more::Display;
use geometry::Grid;
use operators::{DeviceKind, memory};
use serde::{Deserialize, Serialize};

use crate::{Error, Flow};

/// What of a phase field is stored and worked on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Display, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[display(rename_all = "snake_case")]
#[serde(rename_all = "snake_case")]
pub enum Storage {
    /// Bricks near the surface where the flow can have them and they are less than half of the grid
    Auto,
    /// The whole grid
    #[default]
    Dense,
    /// Bricks near the surface ([`solver::Problem::start_on_bricks`])
    Bricks,
}

/// Bytes for each node of Willmore flow on the whole grid, measured at 128 and 192 cells,
const PER_NODE: f64 = 300.0;
/// and of mean curvature flow, measured at 96 and 144 (157).
const PER_NODE_OF_MCF: f64 = 160.0;
/// Bytes for each node that implicit finite elements take more than other steps of mean curvature flow, measured at 96 and 144 cells,
pub(crate) const PER_NODE_OF_ELEMENTS: f64 = 300.0;
/// and for each size that is held, on the whole grid (64 and 96 cells) and for each cell on bricks (128).
pub(crate) const PER_HELD: [f64; 2] = [185.0, 100.0];
/// Bytes for each stored cell of a flow on bricks, measured with the armadillo at 256 and 512 cells (329 and 317).
const PER_CELL: f64 = 330.0;

impl Storage {
    /// About how many bytes a flow that holds no sizes takes on a grid of so many nodes of which so many are stored.
    pub fn bytes(flow: Flow, nodes: usize, stored: usize) -> f64 {
        let each = match flow {
            _ if stored < nodes => PER_CELL,
            Flow::Willmore => PER_NODE,
            Flow::MeanCurvature => PER_NODE_OF_MCF,
        };
        each * stored as f64
    }

    /// Refuses a flow of which so many cells of a grid are stored, which needs so many bytes, and which may take bricks or not, if the memory of
    /// the CPU is too small for it ([`Error::Memory`]). Limits of containers are not looked at.
    pub fn check<const D: usize>(
        device: DeviceKind,
        grid: &Grid<D>,
        stored: usize,
        needed: f64,
        takes_bricks: bool,
    ) -> Result<(), Error> {
        if !device.is_cpu() {
            return Ok(());
        }
        let short = |available: &f64| needed > *available;
        if memory::available().is_some_and(|available| short(&available)) {
            memory::release_kept();
        }
        match memory::available().filter(short) {
            Some(available) => {
                // Most of the memory on bricks is in proportion to the surface.
                let on_bricks = stored < grid.len();
                let power = if on_bricks { D - 1 } else { D };
                let cells = grid.cells();
                let fitting = cells as f64 * (available / needed).powf((power as f64).recip());
                Err(Error::Memory {
                    cells,
                    needed: needed * 1e-9,
                    available: available * 1e-9,
                    fitting: fitting as usize,
                    alternative: if takes_bricks && !on_bricks {
                        ", or bricks near the surface instead of the whole grid"
                    } else {
                        ""
                    },
                })
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_into_memory_is_refused_with_what_does() {
        let small = Grid::<3>::centred(64, 1.0).unwrap();
        let check = |grid: &Grid<3>| {
            let nodes = grid.len();
            let needed = Storage::bytes(Flow::Willmore, nodes, nodes);
            Storage::check(DeviceKind::Flex, grid, nodes, needed, true)
        };
        assert!(check(&small).is_ok());
        // Ten thousand cells a side take 300 TB, which no machine has.
        let large = Grid::<3>::centred(10_000, 1.0).unwrap();
        let Err(error) = check(&large) else {
            assert!(memory::available().is_none());
            return;
        };
        assert!(
            error
                .to_string()
                .ends_with("or bricks near the surface instead of the whole grid")
        );
        let Error::Memory {
            needed,
            available,
            fitting,
            ..
        } = error
        else {
            panic!("{error}");
        };
        assert!((needed - 300e3).abs() < 1.0);
        let nodes = fitting.pow(3);
        assert!(fitting > 64 && Storage::bytes(Flow::Willmore, nodes, nodes) <= available * 1e9);
        // Where a sixteenth is stored, little more is needed.
        let part = Storage::bytes(Flow::Willmore, 1 << 27, 1 << 23)
            / Storage::bytes(Flow::Willmore, 1 << 27, 1 << 27);
        assert!(part > 0.0625 && part < 0.08, "{part}");
    }
}
