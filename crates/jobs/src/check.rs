//! Checks of the derivatives and the device on an input: by Taylor expansions, by symmetry, and against the processor.

use std::fmt;
use std::sync::Arc;

use chacha20::ChaCha8Rng;
use linearize::taylor::{halvings, remainder};
use model::{MeanCurvatureOperator, Network};
use operators::{add_scaled, inner_product};
use rand::{RngExt, SeedableRng};
use solver::{FlowParams, MinimizingMovement, Objective};

use crate::input::{Opened, open};
use crate::options::CheckOptions;
use crate::prelude::*;

/// Steps of the Taylor expansion: from a quarter of the largest change of a value, where the next order shows, down to where the remainder is
/// rounding error in double precision, by halves.
const FIRST_STEP: f64 = 0.25;
const STEPS: usize = 14;
/// By how much an observed rate may be short of the expected one. A wrong derivative is short by 1.
const SHORT: f64 = 0.3;
/// Largest asymmetry of the Hessian and largest difference between devices, in units of the rounding error per node.
const ROUNDING: f64 = 1e4;
/// How far from the input derivatives are taken, in random changes of values of up to 1: at the input itself part of the gradient vanishes.
const AWAY: f64 = 0.1;

/// What was checked, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// The device.
    pub device: DeviceKind,
    /// What was found there.
    pub findings: Vec<Finding>,
}

/// What a check has found.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The check.
    pub check: Check,
    /// The rate of a remainder, unless that is rounding error; otherwise a relative difference.
    pub found: Option<f64>,
    /// The rate that is expected, or the largest difference that is rounding error.
    pub expected: f64,
    /// Whether all is well.
    pub passed: bool,
}

/// A check of the energy of a time step at an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// The first derivative, against values.
    Gradient,
    /// The second derivative, against values.
    Hessian,
    /// The second derivative is symmetric.
    Symmetry,
    /// The gradient, against that on this other device.
    Device(DeviceKind),
}

impl Check {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gradient => "gradient",
            Self::Hessian => "Hessian",
            Self::Symmetry => "symmetry",
            Self::Device(_) => "device",
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let expected = self.expected;
        let found = self.found.unwrap_or(f64::NAN);
        match (self.check, self.found) {
            (Check::Gradient | Check::Hessian, Some(rate)) => write!(
                f,
                "the remainder of the Taylor expansion decays like t^{rate:.2}, expected t^{expected}"
            ),
            (Check::Gradient | Check::Hessian, None) => {
                write!(f, "the remainder of the Taylor expansion is rounding error")
            }
            (Check::Symmetry, _) => write!(
                f,
                "<p, H q> and <q, H p> differ by {found:.1e}, at most {expected:.1e} is rounding"
            ),
            (Check::Device(other), _) => write!(
                f,
                "gradients differ from those on {other} by {found:.1e}, at most {expected:.1e} is rounding"
            ),
        }
    }
}

/// Checks the derivatives of the energy at an input, and the device.
///
/// # Errors
/// Refused options or input; a device that does not work.
pub fn check(mut options: CheckOptions, watcher: &dyn Watcher) -> Result<Checked> {
    options.operator.fill_in()?;
    let device = options.common.open_device()?;
    let eps_over_h = options.operator.eps_over_h();
    let findings = match open(&mut options.input, eps_over_h, watcher)? {
        Opened::Plane(start) => findings(&start.field()?, &options, &device)?,
        Opened::Space(start) => findings(&start.field()?, &options, &device)?,
    };
    Ok(Checked {
        device: device.kind(),
        findings,
    })
}

fn findings<const D: usize>(
    field: &Field<D>,
    options: &CheckOptions,
    device: &ComputeDevice,
) -> Result<Vec<Finding>> {
    let (scales, operator) = options.operator.on_grid(Method::Hybrid, field.grid())?;
    let network = operator.network();
    let network = &network.expect("a learned operator has one").network;
    let params = FlowParams::paper(scales.eps, scales.mcf_step);
    let at = |device: &_| Derivatives::of(field, network, &params, options.common.seed, device);
    let here = at(device)?;
    let mut findings = vec![
        here.taylor(Check::Gradient, 1, device),
        here.taylor(Check::Hessian, 2, device),
    ];
    let differ = |check, difference| {
        let limit = ROUNDING * device.epsilon();
        Finding {
            check,
            found: Some(difference),
            expected: limit,
            passed: difference <= limit,
        }
    };
    findings.push(differ(Check::Symmetry, here.asymmetry));
    let other = DeviceKind::compiled().find(|&kind| kind != device.kind() && kind.is_cpu());
    if let Some(kind) = other {
        let there = at(&ComputeDevice::open(kind)?)?;
        findings.push(differ(Check::Device(kind), here.difference(&there)));
    }
    Ok(findings)
}

struct Derivatives {
    /// At the beginning, and after every step in one direction.
    values: Vec<f64>,
    /// First and second derivative in that direction.
    along: [f64; 2],
    /// Relative to the products.
    asymmetry: f64,
    gradient: Vec<f64>,
}

impl Derivatives {
    /// Of the energy of one time step of the size of the inner one, near the input.
    fn of<const D: usize>(
        field: &Field<D>,
        network: &Network,
        params: &FlowParams,
        seed: u64,
        device: &ComputeDevice,
    ) -> Result<Self> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut direction = || {
            // Along the interface, where the flow moves values too.
            let values: Vec<f64> = (field.values().iter())
                .map(|u| (1.0 - u * u) * rng.random_range(-1.0..1.0))
                .collect();
            device.tensor::<D>(&values, field.grid().shape())
        };
        let (p, q, moved) = (direction(), direction(), direction());
        let previous = device.tensor::<D>(field.values(), field.grid().shape());
        let step = MeanCurvatureOperator::<D>::new(network, device)?;
        step.check_grid(field.grid().cells())?;
        let mut energy = MinimizingMovement::new(Arc::new(step), field.grid().cells(), device)?;
        energy.set(&previous, params.stiffness(params.mcf_step))?;
        let u = add_scaled(previous, &moved, AWAY);
        let (_, gradient) = energy.evaluate(&u)?;
        let hp = energy.hessian_vector_product(&p)?;
        let hq = energy.hessian_vector_product(&q)?;
        let dot = |a: &_, b: &_| device.scalar(inner_product::<D>(a, b));
        let (pq, qp) = (dot(&p, &hq)?, dot(&q, &hp)?);
        let scale = (dot(&p, &hp)?.abs() * dot(&q, &hq)?.abs()).sqrt();
        let along = [dot(&gradient, &p)?, dot(&p, &hp)?];
        let mut values = Vec::new();
        for t in [0.0].into_iter().chain(halvings(FIRST_STEP, STEPS)) {
            values.push(energy.value(&add_scaled(u.clone(), &p, t))?);
        }
        Ok(Self {
            values,
            along,
            asymmetry: (pq - qp).abs() / scale.max(f64::MIN_POSITIVE),
            gradient: device.values(gradient)?,
        })
    }

    /// The remainder of the Taylor expansion with so many derivatives.
    fn taylor(&self, check: Check, derivatives: usize, device: &ComputeDevice) -> Finding {
        // It asks for them in this order.
        let mut values = self.values.iter().copied();
        let value = |_: f64| values.next().unwrap_or(f64::NAN);
        let steps = halvings(FIRST_STEP, STEPS);
        let rest = remainder(value, &self.along[..derivatives], &steps, device.epsilon());
        Finding {
            check,
            found: rest.rate(),
            expected: (derivatives + 1) as f64,
            passed: rest.is_consistent(SHORT),
        }
    }

    /// How far its gradient is from another one, relative to the largest value of that.
    fn difference(&self, other: &Self) -> f64 {
        let pairs = self.gradient.iter().zip(&other.gradient);
        let difference = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let largest = other.gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        difference / largest.max(f64::MIN_POSITIVE)
    }
}
