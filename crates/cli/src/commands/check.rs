use std::sync::Arc;

use chacha20::ChaCha8Rng;
use linearize::taylor::{halvings, remainder};
use model::{MeanCurvatureOperator, Network};
use operators::{ComputeDevice, DeviceKind, add_scaled, inner_product};
use rand::{RngExt, SeedableRng};
use solver::{FlowParams, MinimizingMovement, Objective};

use engine::Method;
use geometry::Field;
use jobs::Opened;
use serde::Serialize;
use serde_json::json;

use crate::cli::CheckOptions;
use crate::console::Console;
use crate::error::{Result, refuse};

/// Steps of the Taylor expansion, the first one and how often it is halved.
const FIRST_STEP: f64 = 0.25;
const STEPS: usize = 14;
/// By how much an observed rate may be short of the expected one.
const SHORT: f64 = 0.3;
/// Largest asymmetry of the Hessian and largest difference between devices, in units of the rounding error per node.
const ROUNDING: f64 = 1e4;

#[derive(Serialize)]
struct Finding {
    name: &'static str,
    found: Option<f64>,
    #[serde(skip)]
    words: String,
    passed: bool,
}

/// Checks the derivatives of the energy at the input.
pub fn run(mut options: CheckOptions, console: &Console) -> Result<()> {
    options.operator.fill_in()?;
    let device = options.common.open_device()?;
    let eps_over_h = options.operator.eps_over_h();
    let findings = match jobs::open(&mut options.input, eps_over_h, console)? {
        Opened::Plane(start) => findings(&start.field()?, &options, &device)?,
        Opened::Space(start) => findings(&start.field()?, &options, &device)?,
    };
    let line = |finding: &Finding| {
        let verdict = if finding.passed { "ok" } else { "WRONG" };
        format!("{verdict:6}{}: {}", finding.name, finding.words)
    };
    let text: Vec<String> = findings.iter().map(line).collect();
    let outcome =
        json!({ "command": "check", "device": options.common.device, "checks": findings });
    console.report(&outcome, &text.join("\n"))?;
    let failed = findings.iter().filter(|finding| !finding.passed);
    let failed: Vec<&str> = failed.map(|finding| finding.name).collect();
    if !failed.is_empty() {
        let (kind, failed) = (device.kind(), failed.join(", "));
        refuse!("these checks failed on the device {kind}: {failed}; do not trust its results");
    }
    Ok(())
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
    let at = |device: &_| derivatives(field, network, &params, options.common.seed, device);
    let here = at(device)?;
    let mut findings = Vec::new();
    let mut add = |name, found, words, passed| {
        findings.push(Finding {
            name,
            found,
            words,
            passed,
        });
    };
    for (name, derivatives, expected) in [("gradient", 1, 2.0), ("Hessian", 2, 3.0)] {
        // It asks for them in this order.
        let mut values = here.values.iter().copied();
        let value = |_: f64| values.next().unwrap_or(f64::NAN);
        let steps = halvings(FIRST_STEP, STEPS);
        let rest = remainder(value, &here.along[..derivatives], &steps, device.epsilon());
        let words = match rest.rate() {
            Some(rate) => format!("decays like t^{rate:.2}, expected t^{expected}"),
            None => "is rounding error".to_owned(),
        };
        let words = format!("the remainder of the Taylor expansion {words}");
        add(name, rest.rate(), words, rest.is_consistent(SHORT));
    }
    let limit = ROUNDING * device.epsilon();
    let found = here.asymmetry;
    let words =
        format!("<p, H q> and <q, H p> differ by {found:.1e}, at most {limit:.1e} is rounding");
    add("symmetry", Some(found), words, found <= limit);
    let other = DeviceKind::compiled().find(|&kind| kind != device.kind() && kind.is_cpu());
    if let Some(kind) = other {
        let cpu = ComputeDevice::open(kind)?;
        let there = at(&cpu)?;
        let difference = (here.gradient.iter().zip(&there.gradient))
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        let largest = there.gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        let found = difference / largest.max(f64::MIN_POSITIVE);
        let words = format!(
            "gradients differ from those on {kind} by {found:.1e}, at most {limit:.1e} is rounding"
        );
        add("device", Some(found), words, found <= limit);
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

/// The energy of one time step of the size of the inner one, near the input: at the input itself part of the gradient vanishes.
fn derivatives<const D: usize>(
    field: &Field<D>,
    network: &Network,
    params: &FlowParams,
    seed: u64,
    device: &ComputeDevice,
) -> Result<Derivatives> {
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
    let u = add_scaled(previous, &moved, 0.1);
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
    Ok(Derivatives {
        values,
        along,
        asymmetry: (pq - qp).abs() / scale.max(f64::MIN_POSITIVE),
        gradient: device.values(gradient)?,
    })
}
