//! Area and volume that are held: from the options to targets, and a start that has them.

use engine::{Held, Target};

use crate::cli::{FlowOptions, MessageOptions};
use crate::prelude::*;
use crate::values::{Amount, SizeTarget};

/// Steps over which sizes go to their targets.
const RAMP: usize = 20;
/// Most steps in which edges become round, of `eps^4` each.
const ROUNDING: usize = 8;
/// Edges are round where the [spread](ZeroSet::spread) is below this.
const ROUND: f64 = 0.04;
/// Round edges take at most this part of the area away.
const LOST: f64 = 0.15;

impl FlowOptions {
    /// The sizes that are held, from what they are at the beginning; `of_input` is the volume of the input, if the grid does not say it.
    pub fn held<const D: usize>(
        &self,
        initial: &Stored<D>,
        eps: f64,
        of_input: Option<f64>,
    ) -> Result<Held> {
        let ramp = self.ramp.unwrap_or(RAMP);
        if let Some(target) = self.reduced_volume {
            return Ok(Held::at_reduced_volume(initial, eps, target, ramp)?);
        }
        if self.volume.is_none() && self.area.is_none() {
            return Ok(Held::default());
        }
        let now = ZeroSet::of(initial, eps)?;
        let target = |wanted: Option<SizeTarget>, from: f64, of_input: f64| {
            wanted.map(|wanted| match wanted {
                SizeTarget::Keep => Target::keep(of_input),
                SizeTarget::To(amount) => Target {
                    from,
                    to: amount.of(of_input),
                    over: ramp,
                },
            })
        };
        Ok(Held {
            perimeter: target(self.area, now.perimeter, now.perimeter),
            volume: target(self.volume, now.volume, of_input.unwrap_or(now.volume)),
        })
    }
}

/// Gives the start of a flow that holds the area round edges, if its edges are sharper than the interface is wide.
///
/// Such edges become round in the first step, which takes area away. To hold it there, the flow would have to make other edges. So they become
/// round while the volume alone is held, if that is, and the area goes back to what it was, or to its target, over the steps of the ramp: the
/// options say so then.
///
/// # Errors
/// With the volume held, where that does not help, or takes too much away, since the shape is too thin.
pub fn round_edges<const D: usize>(
    options: &mut FlowOptions,
    start: &mut Stored<D>,
    device: &ComputeDevice,
    messages: MessageOptions,
) -> Result<()> {
    if options.area.is_none() && options.reduced_volume.is_none() {
        return Ok(());
    }
    let holds_volume = options.volume.is_some() || options.reduced_volume.is_some();
    let (scales, operator) = options.run.scheme.operator(Method::Hybrid, start.grid())?;
    let eps = scales.eps;
    let sharp = ZeroSet::of(start, eps)?;
    if sharp.sizes_hold() {
        return Ok(());
    }
    let targets = options.held(start, eps, None)?.targets();
    let steps = (StepRule::Constant(eps.powi(4)), ROUNDING);
    let case = Case {
        held: Held {
            perimeter: None,
            volume: holds_volume.then(|| Target::keep(sharp.volume)),
        },
        measures: Vec::new(),
        ..Case::willmore("edges", start.clone(), operator, scales, steps)
    };
    let mut run = Run::new(case, device)?;
    while run.step()?.is_some() {
        let round = ZeroSet::of(&run.current(), eps)?;
        if round.perimeter < (1.0 - LOST) * sharp.perimeter {
            break;
        }
        if round.spread > ROUND {
            continue;
        }
        let of_surface = if D == 2 { "length" } else { "area" };
        let area = targets.perimeter.unwrap_or(sharp.perimeter);
        messages.note(&format!(
            "edges sharper than the interface became round: {of_surface} {:.4} instead of {:.4}; it goes to {area:.4} over the steps of --ramp",
            round.perimeter, sharp.perimeter
        ));
        options.area = Some(SizeTarget::To(Amount::Value(area)));
        if options.reduced_volume.take().is_some() {
            let volume = targets.volume.unwrap_or(sharp.volume);
            options.volume = Some(SizeTarget::To(Amount::Value(volume)));
        }
        start.clone_from(run.stored());
        return Ok(());
    }
    if !holds_volume {
        return Ok(());
    }
    refuse!(
        "area and volume cannot both be held: the grid does not resolve parts of the shape, and so their area; give more --cells, or hold \
         one of them",
    )
}
