//! Edges that are sharper than the interface is wide.

use geometry::{Stored, ZeroSet};
use operators::ComputeDevice;

use crate::{Case, Error, Held, Operator, Run, Scales, StepRule, Target};

/// Most steps in which edges become round, of `eps^4` each.
const ROUNDING: usize = 8;
/// Edges are round where the [spread](ZeroSet::spread) is below this.
const ROUND: f64 = 0.04;
/// Round edges take at most this part of the area away.
const LOST: f64 = 0.15;

/// A shape with its edges made round by Willmore flow, which may hold the volume, and its zero set; `sharp` is that of `start`.
///
/// Edges sharper than the interface become round in the first step of a flow, which takes area away. To hold it there, the flow would have to
/// make other edges: one that holds the area begins with round ones. None where some steps do not make them round, or take too much away, since
/// the shape is too thin.
pub fn round_edges<const D: usize>(
    start: &Stored<D>,
    sharp: &ZeroSet,
    holds_volume: bool,
    scales: Scales,
    operator: Operator<D>,
    device: &ComputeDevice,
) -> Result<Option<(Stored<D>, ZeroSet)>, Error> {
    let eps = scales.eps;
    let steps = StepRule::Constant(eps.powi(4));
    let case = Case {
        held: Held {
            perimeter: None,
            volume: holds_volume.then(|| Target::keep(sharp.volume)),
        },
        measures: Vec::new(),
        ..Case::willmore("edges", start.clone(), operator, scales, steps, ROUNDING)
    };
    let mut run = Run::new(case, device)?;
    while run.step()?.is_some() {
        let round = ZeroSet::of(&run.current(), eps)?;
        if round.perimeter < (1.0 - LOST) * sharp.perimeter {
            break;
        }
        if round.spread <= ROUND {
            return Ok(Some((run.stored().clone(), round)));
        }
    }
    Ok(None)
}
