//! From options to cases: which device and operator, which time steps, which sizes are held, and when it ends.

use engine::{
    DirectParams, Discretization, ErrorControl, Flow, Held, Helfrich, Operator, Own, Storage,
    Target, TimeSteps,
};
use model::{Network, Networks};
use solver::NewtonParams;

use crate::input::{InitialShape, usual_box};
use crate::job::Job;
use crate::options::{CommonOptions, FlowOptions, OperatorOptions, Stepper, WillmoreOptions};
use crate::paths::absolute;
use crate::prelude::*;
use crate::presentation::Presentation;
use crate::values::{Amount, SizeTarget};

/// In a step the interface moves by at most so many widths of it.
const LONGEST_MOVE: f64 = 2.0;
/// The usual time step of inpainting, in units of the inner step.
const INPAINT_STEP: f64 = 16.0;
/// The ramp to this step starts with it halved so many times, since there is a jump at the border of the region.
const INPAINT_HALVINGS: u32 = 12;
/// Steps over which sizes go to their targets.
const RAMP: usize = 20;
/// The largest spontaneous curvature in one over interface widths: that of a cylinder whose radius is two of them.
const SHARPEST: f64 = 0.5;

/// Refuses widths of the interface, in cells, that no grid resolves.
///
/// # Errors
/// [`Error::InterfaceWidth`]
pub fn check_eps_over_h(eps_over_h: f64) -> Result<()> {
    if (0.5..=64.0).contains(&eps_over_h) {
        Ok(())
    } else {
        Err(Error::InterfaceWidth(eps_over_h))
    }
}

impl CommonOptions {
    /// Opens the device and notes its name.
    ///
    /// # Errors
    /// A device that is not compiled in, or that does not work.
    pub fn open_device(&mut self) -> Result<ComputeDevice> {
        let device = ComputeDevice::named(self.device.as_deref())?;
        self.device = Some(device.kind().name().to_owned());
        Ok(device)
    }
}

impl OperatorOptions {
    /// Interface width in cells.
    pub fn eps_over_h(&self) -> f64 {
        self.eps_over_h.unwrap_or(2.0)
    }

    /// Takes the width of the interface from the network, unless it is given.
    ///
    /// # Errors
    /// A network that cannot be read; [`Error::InterfaceWidth`].
    pub fn fill_in(&mut self) -> Result<()> {
        if let Some(network) = &mut self.network {
            *network = absolute(&*network)?;
        }
        if let (None, Some(path)) = (self.eps_over_h, &self.network) {
            self.eps_over_h = Some(Network::load(path)?.ratios().eps_over_h);
        }
        self.eps_over_h = Some(self.eps_over_h());
        check_eps_over_h(self.eps_over_h())
    }

    /// The scales and the step of mean curvature flow on a grid.
    ///
    /// # Errors
    /// Where no network fits.
    pub fn on_grid<const D: usize>(
        &self,
        method: Method,
        grid: &Grid<D>,
    ) -> Result<(Scales, Operator<D>)> {
        let scales = Scales::of_grid(grid.spacing(), self.eps_over_h());
        let needed = scales.needs(D, grid.spacing());
        let networks = Networks::load(self.network.as_slice(), &[needed])?;
        let formulation = if method.is_learned() {
            self.formulation
        } else {
            Formulation::Paper
        };
        let discretization = Discretization::new(method, formulation);
        let mut operator = Operator::new(discretization, &networks, &needed, grid, &scales)?;
        operator.storage = self.storage.unwrap_or(Storage::Auto);
        Ok((scales, operator))
    }
}

impl Job {
    /// The rule for the time steps of Willmore flow unless one is chosen, for this inner step and spacing of the grid.
    pub(crate) fn usual_rule(&mut self, inner: f64, spacing: f64) -> StepRule {
        if self.is_direct() {
            return StepRule::ByEnergy(None);
        }
        match self {
            Self::Fair(fair) if fair.takes_small_steps() => StepRule::Graded {
                first: Fairing::first_step(spacing),
                part: Fairing::GROWTH,
            },
            Self::Inpaint(_) => StepRule::Ramp {
                tau: INPAINT_STEP * inner,
                halvings: INPAINT_HALVINGS,
            },
            _ => StepRule::Controlled,
        }
    }

    /// Whether steps are direct.
    pub(crate) fn is_direct(&mut self) -> bool {
        self.willmore()
            .is_some_and(|options| options.stepper == Some(Stepper::Direct))
    }

    /// How many steps are made unless it is said: few after sizes have reached their targets, or many where something else ends the run; those of mean
    /// curvature flow are short.
    pub(crate) fn usual_steps(&mut self) -> usize {
        let fairs = matches!(self, Self::Fair(fair) if fair.takes_small_steps());
        let energy = self.willmore().and_then(|options| options.energy);
        let has_an_end = fairs || energy.is_some() || self.run().time.is_some();
        match self {
            _ if !has_an_end => {
                20 + self
                    .willmore()
                    .map_or(0, |options| options.steps_of_sizes())
            }
            Self::Mcf(_) => 100_000,
            _ => 1000,
        }
    }

    fn stops(&mut self, steps: usize, rule: StepRule) -> Vec<Stop> {
        // What has gone wrong is said before what was asked for.
        let mut stops = vec![Stop::Vanished, Stop::NoSurface, Stop::AtTheSide];
        stops.push(Stop::Steps(steps));
        stops.extend(self.run().time.map(Stop::Time));
        let energy = self.willmore().and_then(|options| options.energy);
        stops.extend(energy.map(Stop::Energy));
        // Steps of these rules become long where the energy hardly falls.
        if matches!(
            rule,
            StepRule::ByEnergy(_) | StepRule::Controlled | StepRule::Graded { .. }
        ) {
            stops.push(Stop::EnergyAtRest);
        }
        if let Self::Fair(fair) = self {
            stops.extend(fair.energy_ratio.map(Stop::EnergyRatio));
        }
        stops
    }

    /// The flow from a start for at most so many steps, and how that is shown; the rule for the time steps is filled in.
    pub(crate) fn case<const D: usize, O: Presentation<D>>(
        &mut self,
        start: InitialShape<D, O>,
        most_steps: usize,
    ) -> Result<(Case<D>, O)> {
        let (flow, method) = match self {
            Self::Mcf(mcf) => (Flow::MeanCurvature, mcf.method),
            _ => (Flow::Willmore, Method::Hybrid),
        };
        let grid = *start.initial.grid();
        let (mut scales, operator) = self.operator().on_grid(method, &grid)?;
        // Time steps that follow from the inner step, a length squared, do so in a box of this side, which gives them their unit.
        let in_box = |side: f64| scales.mcf_step * (grid.side() / side).powi(2);
        let (_, usual_side) = usual_box::<D>();
        let inner = in_box(self.input().box_side.unwrap_or(usual_side));
        let usual_inner = in_box(usual_side);
        let usual = self.usual_rule(inner, grid.spacing());
        let direct = self.is_direct();
        let rule = match self.willmore() {
            Some(options) => {
                let rule = options.tau.unwrap_or(usual);
                *options.tau.insert(rule.resolved(inner))
            }
            None => StepRule::Constant(scales.mcf_step),
        };
        let stops = self.stops(most_steps, rule);
        let options = self.willmore().map(|options| &*options);
        let steps = match rule {
            StepRule::Controlled => {
                scales.newton = NewtonParams::second_order();
                let mut control = ErrorControl::default();
                match options.and_then(|options| options.tolerance) {
                    Some(Amount::Value(length)) => control.length = Some(length),
                    Some(Amount::Percent(percent)) => control.relative = percent / 100.0,
                    None => (),
                }
                // On coarse grids the usual first step is long against the shape. In another unit of length it is the same.
                control.first = Some((usual_inner / 16.0).min(16.0 * scales.eps.powi(4)));
                TimeSteps::controlled(control)
            }
            rule if direct => TimeSteps::direct(rule, DirectParams::default()),
            rule => TimeSteps {
                longest_move: (flow == Flow::Willmore).then_some(LONGEST_MOVE),
                ..rule.into()
            },
        };
        let eps = scales.eps;
        let known = start.presentation.known(&start.initial, eps)?;
        let (mut energy, mut held) = (Helfrich::default(), Held::default());
        if let Some(options) = options {
            energy = options.energy::<D>(eps)?;
            held = options.held(&start.initial, eps, known.volume)?;
        }
        let mut measures = vec![Measure::zero_set(eps, &held)];
        measures.extend(known.measures);
        let case = Case {
            shape: start.name,
            initial: start.initial,
            region: start.region,
            max_distance: known.max_distance,
            energy,
            held,
            flow,
            operator,
            scales,
            steps,
            stops: [stops, known.stops].concat(),
            measures,
            own: Own::default(),
        };
        Ok((case, start.presentation))
    }
}

/// The targets of the sizes of the zero set: length and area in the plane, area and volume in space.
pub(crate) struct SizeTargets {
    perimeter: Option<SizeTarget>,
    volume: Option<SizeTarget>,
}

impl WillmoreOptions {
    /// The sizes that options name, in this dimension. In the plane `volume` is another word for the area.
    pub(crate) fn size_targets<const D: usize>(&self) -> SizeTargets {
        let (perimeter, volume) = if D == 2 {
            (self.length, self.area.or(self.volume))
        } else {
            (self.area, self.volume)
        };
        SizeTargets { perimeter, volume }
    }

    /// Refuses sizes that a shape in this dimension does not have, and says which one the area is in the plane.
    pub(crate) fn check_sizes<const D: usize>(&self, watcher: &dyn Watcher) -> Result<()> {
        if D == 3 && self.length.is_some() {
            return Err(Error::foreign("length", "", "a surface in space"));
        }
        if D == 2 && self.area.is_some() && self.volume.is_some() {
            return Err(Refusal::AreaAndVolume.into());
        }
        if D == 2 && self.area.is_some() {
            watcher.note(&Note::AreaInThePlane);
        }
        Ok(())
    }

    /// The steps in which sizes go to their targets. Where edges become round, a size that is kept does so, too.
    fn steps_of_sizes(&self) -> usize {
        let goes = self.length.is_some()
            || self.area.is_some()
            || self.reduced_volume.is_some()
            || matches!(self.volume, Some(SizeTarget::To(_)));
        if goes { self.ramp.unwrap_or(RAMP) } else { 0 }
    }

    /// The energy besides bending. A term of a size that is held would change nothing but errors of the grid.
    ///
    /// # Errors
    /// [`Refusal::NoEffect`] for such a term, [`Refusal::SharpCurvature`] for a spontaneous curvature that no interface of width `eps` can have.
    fn energy<const D: usize>(&self, eps: f64) -> Result<Helfrich> {
        let SizeTargets { perimeter, volume } = self.size_targets::<D>();
        let is_kept = self.reduced_volume.is_some();
        let [boundary, inside] = match D {
            2 => ["length", "area"],
            _ => ["area", "volume"],
        };
        for (option, value, is_held, size) in [
            (
                "tension",
                self.tension,
                perimeter.is_some() || is_kept,
                boundary,
            ),
            (
                "pressure",
                self.pressure,
                volume.is_some() || is_kept,
                inside,
            ),
        ] {
            if is_held && value.is_some_and(|value| value != 0.0) {
                return Err(Refusal::NoEffect { option, size }.into());
            }
        }
        let energy = Helfrich {
            spontaneous_curvature: self.spontaneous_curvature.unwrap_or(0.0),
            tension: self.tension.unwrap_or(0.0),
            pressure: self.pressure.unwrap_or(0.0),
        };
        let curvature = energy.spontaneous_curvature;
        if curvature.abs() * eps > SHARPEST {
            return Err(Refusal::SharpCurvature { curvature, eps }.into());
        }
        Ok(energy)
    }

    /// The sizes that are held, from what they are at the beginning; `of_input` is the volume of the input, if the grid does not say it.
    pub(crate) fn held<const D: usize>(
        &self,
        initial: &Stored<D>,
        eps: f64,
        of_input: Option<f64>,
    ) -> Result<Held> {
        let ramp = self.ramp.unwrap_or(RAMP);
        if let Some(target) = self.reduced_volume {
            return Ok(Held::at_reduced_volume(initial, eps, target, ramp)?);
        }
        let SizeTargets { perimeter, volume } = self.size_targets::<D>();
        if perimeter.is_none() && volume.is_none() {
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
            perimeter: target(perimeter, now.perimeter, now.perimeter),
            volume: target(volume, now.volume, of_input.unwrap_or(now.volume)),
        })
    }
}

/// Gives the start of a flow that holds the perimeter [round edges](engine::round_edges), if its edges are sharper than the interface is wide. The
/// area goes back to what it was, or to its target, over the steps of the ramp: the options say so then.
///
/// # Errors
/// With the volume held, where edges cannot be made round.
pub fn with_round_edges<const D: usize>(
    options: &mut FlowOptions,
    start: &mut Stored<D>,
    device: &ComputeDevice,
    watcher: &dyn Watcher,
) -> Result<()> {
    let (options, operator) = (&mut options.willmore, &options.operator);
    let wanted = options.size_targets::<D>();
    if wanted.perimeter.is_none() && options.reduced_volume.is_none() {
        return Ok(());
    }
    let holds_volume = wanted.volume.is_some() || options.reduced_volume.is_some();
    let (scales, operator) = operator.on_grid(Method::Hybrid, start.grid())?;
    let eps = scales.eps;
    let sharp = ZeroSet::of(start, eps)?;
    if sharp.sizes_hold() {
        return Ok(());
    }
    let targets = options.held(start, eps, None)?.targets();
    match engine::round_edges(start, &sharp, holds_volume, scales, operator, device)? {
        Some((rounded, round)) => {
            let target = targets.perimeter.unwrap_or(sharp.perimeter);
            watcher.note(&Note::RoundEdges {
                is_curve: D == 2,
                round: round.perimeter,
                sharp: sharp.perimeter,
                target,
            });
            let to = |value| Some(SizeTarget::To(Amount::Value(value)));
            let (perimeter, volume) = if D == 2 {
                (&mut options.length, &mut options.area)
            } else {
                (&mut options.area, &mut options.volume)
            };
            *perimeter = to(target);
            if options.reduced_volume.take().is_some() {
                *volume = to(targets.volume.unwrap_or(sharp.volume));
            }
            *start = rounded;
        }
        None if holds_volume => {
            let [boundary, inside] = match D {
                2 => ["length", "area"],
                _ => ["area", "volume"],
            };
            return Err(Refusal::BothSizes { boundary, inside }.into());
        }
        None => (),
    }
    Ok(())
}
