//! Inverses in the pure phases, from the response to an impulse.

use std::sync::{Arc, Mutex, PoisonError};

use burn::tensor::{DType, Tensor};
use geometry::{Bricks, Grid, Nodes};
use linearize::Linearization;
use operators::{ComputeDevice, SpectralFilter, Transform, combined, scaled, spectral_filter};

use super::derivative::{Derivative, trace};
use crate::{Error, MeanCurvatureStep, PhaseInverse, PhaseInverses};

/// Bricks along a side of the periodic box on which a step on bricks is measured: what it reaches is no more than a brick.
const BRICKS: usize = 4;
/// Largest imaginary part of a symmetric `J`, with the same factor for the rounding of a device.
const SYMMETRIC: f64 = 1e-6;

/// The inverses of the energy's Hessian in the pure phases, [measured](super).
///
/// # Errors
/// [`Error::NoResponse`], or what the step raises.
pub fn phase_inverses<const D: usize>(
    step: &dyn MeanCurvatureStep<D>,
    nodes: &Nodes<D>,
    device: &ComputeDevice,
) -> Result<PhaseInverses<D>, Error> {
    match nodes.bricks() {
        None => on_grid(step, nodes.grid().cells(), device),
        Some(bricks) => on_bricks(step, nodes, bricks, device),
    }
}

/// What is known of a step in the pure phases: symbols on the frequencies of a box, in the order of the transform's spectra.
struct Symbols {
    /// `m`.
    mass: Vec<f64>,
    /// `|1 - J|^2`, with the mean `J` of both phases.
    defect: Vec<f64>,
    /// The real part of `J` in the phase `u = 1`, and the largest imaginary part.
    positive: Vec<f64>,
    asymmetry: f64,
}

impl Symbols {
    /// Measures a step on a periodic box of so many cells. `stored` and `in_rows` turn values in row-major order into those that the
    /// step takes, of this shape, and back.
    fn measure<const D: usize>(
        step: &dyn MeanCurvatureStep<D>,
        (cells, shape): (usize, [usize; D]),
        stored: &dyn Fn(&[f64]) -> Vec<f64>,
        in_rows: &dyn Fn(&[f64]) -> Vec<f64>,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let transform = Transform::<f64>::of_shape(&[cells; D]);
        let mut impulse = vec![0.0; cells.pow(D as u32)];
        impulse[0] = 1.0;
        let impulse = stored(&impulse);
        let [negative, positive] = step.phase_values();
        let mut derivative = Derivative::new(step, shape, positive, device)?;
        let positive = transform.forward(&in_rows(&derivative.product(&impulse)?));
        derivative.at(&vec![negative; impulse.len()])?;
        let negative = transform.forward(&in_rows(&derivative.product(&impulse)?));
        let mass = transform.forward(&in_rows(&derivative.mass(&impulse)?));
        let symbols = Self {
            mass: mass.iter().map(|m| m.re).collect(),
            defect: (negative.iter().zip(&positive))
                .map(|(a, b)| (1.0 - 0.5 * (a.re + b.re)).powi(2) + (0.5 * (a.im + b.im)).powi(2))
                .collect(),
            positive: positive.iter().map(|j| j.re).collect(),
            asymmetry: positive.iter().fold(0.0, |most, j| most.max(j.im.abs())),
        };
        let finite = symbols
            .defect
            .iter()
            .chain(&symbols.positive)
            .all(|s| s.is_finite());
        if finite && symbols.mass.iter().all(|m| m.is_finite() && *m > 0.0) {
            return Ok(symbols);
        }
        let step = step.identity().name;
        Err(Error::NoResponse { step })
    }

    /// `m (1 + c |1 - J|^2)`.
    fn hessian(&self, stiffness: f64) -> impl Iterator<Item = f64> + '_ {
        let pairs = self.mass.iter().zip(&self.defect);
        pairs.map(move |(mass, defect)| mass * (1.0 + stiffness * defect))
    }

    /// The geometric mean of the largest and the smallest value of the inverse: the number that is off by the least factor.
    fn constant(&self, stiffness: f64) -> f64 {
        let (least, most) = self
            .hessian(stiffness)
            .fold((f64::INFINITY, 0.0_f64), |(least, most), h| {
                (least.min(h), most.max(h))
            });
        1.0 / (least * most).sqrt()
    }

    /// `[x, y]` of `x + y J` with the least squares of relative errors, over all values of `J` alike, however many frequencies have them.
    /// None if that is not positive somewhere.
    fn polynomial(&self, stiffness: f64) -> Option<[f64; 2]> {
        struct Sample {
            j: f64,
            hessian: f64,
        }
        let pairs = self.positive.iter().zip(self.hessian(stiffness));
        let mut samples: Vec<Sample> = pairs.map(|(&j, hessian)| Sample { j, hessian }).collect();
        samples.sort_by(|a, b| a.j.total_cmp(&b.j));
        let [mut a, mut b, mut c, mut p, mut q] = [0.0; 5];
        for pair in samples.windows(2) {
            let width = pair[1].j - pair[0].j;
            for Sample { j, hessian } in pair {
                a += width * hessian * hessian;
                b += width * hessian * hessian * j;
                c += width * hessian * hessian * j * j;
                p += width * hessian;
                q += width * hessian * j;
            }
        }
        let determinant = a * c - b * b;
        let [x, y] = [(p * c - q * b) / determinant, (q * a - p * b) / determinant];
        let ends = [samples.first()?.j, samples.last()?.j];
        // Written so that NaN is refused.
        ends.iter().all(|j| x + y * j > 0.0).then_some([x, y])
    }
}

fn on_grid<const D: usize>(
    step: &dyn MeanCurvatureStep<D>,
    cells: usize,
    device: &ComputeDevice,
) -> Result<PhaseInverses<D>, Error> {
    let same = |x: &[f64]| x.to_vec();
    let symbols = Symbols::measure(step, (cells, [cells; D]), &same, &same, device)?;
    Ok(Arc::new(move |stiffness| {
        let spectrum = symbols.hessian(stiffness).map(|h| 1.0 / h);
        let inverse = SpectralFilter::from_spectrum(&[cells; D], spectrum);
        Arc::new(move |r: &Tensor<D>| spectral_filter(r.clone(), &inverse)) as PhaseInverse<D>
    }))
}

fn on_bricks<const D: usize>(
    step: &dyn MeanCurvatureStep<D>,
    nodes: &Nodes<D>,
    bricks: &Bricks<D>,
    device: &ComputeDevice,
) -> Result<PhaseInverses<D>, Error> {
    let symbols = Arc::new(of_brick_box(step, nodes, bricks.side(), device)?);
    let symmetric = symbols.asymmetry <= SYMMETRIC.max(device.epsilon() * 1e2);
    if D == 2 || !symmetric {
        return Ok(Arc::new(move |stiffness| {
            let x = symbols.constant(stiffness);
            Arc::new(move |r: &Tensor<D>| scaled(r, x)) as PhaseInverse<D>
        }));
    }
    let derivative = Arc::new(AtRest::new(step, nodes, bricks, device)?);
    Ok(Arc::new(move |stiffness| {
        let Some([x, y]) = symbols.polynomial(stiffness) else {
            let x = symbols.constant(stiffness);
            return Arc::new(move |r: &Tensor<D>| scaled(r, x)) as PhaseInverse<D>;
        };
        let derivative = derivative.clone();
        Arc::new(move |r: &Tensor<D>| {
            let image = derivative.product(r);
            combined(image, y, r, x)
        })
    }))
}

/// The symbols of a step on a small periodic box of bricks, all of them active.
fn of_brick_box<const D: usize>(
    step: &dyn MeanCurvatureStep<D>,
    nodes: &Nodes<D>,
    side: usize,
    device: &ComputeDevice,
) -> Result<Symbols, Error> {
    let cells = BRICKS * side;
    let grid = Grid::<D>::new(cells, cells as f64 * nodes.grid().spacing())?;
    let bricks = Arc::new(Bricks::new(cells, side, |_| true, |_| true)?);
    let measured = put_on(step, &Nodes::on_bricks(grid, bricks.clone()))?;
    let stored = |x: &[f64]| bricks.gather(x);
    let in_rows = |x: &[f64]| bricks.scatter(x, [0.0; 2]);
    Symbols::measure(
        &*measured,
        (cells, bricks.shape()),
        &stored,
        &in_rows,
        device,
    )
}

fn put_on<const D: usize>(
    step: &dyn MeanCurvatureStep<D>,
    nodes: &Nodes<D>,
) -> Result<Arc<dyn MeanCurvatureStep<D>>, Error> {
    step.on(nodes).map_err(|failure| Error::Step {
        step: step.identity().name,
        failure,
    })
}

/// The derivative of a step on bricks in the phase `u = 1`, which is made to go on where nothing is stored.
struct AtRest {
    linearization: Mutex<Linearization>,
    dtype: DType,
}

impl AtRest {
    fn new<const D: usize>(
        step: &dyn MeanCurvatureStep<D>,
        nodes: &Nodes<D>,
        bricks: &Bricks<D>,
        device: &ComputeDevice,
    ) -> Result<Self, Error> {
        let stored = |place| bricks.number(place).is_some();
        let pure = Bricks::new(bricks.cells(), bricks.side(), stored, |_| true)?;
        let step = put_on(step, &Nodes::on_bricks(*nodes.grid(), Arc::new(pure)))?;
        let options = (device.device(), device.dtype());
        let point = Tensor::<D>::full(bricks.shape(), step.phase_values()[1], options);
        let mut linearization = trace(&*step, &point, device)?;
        linearization.at(&[(&point).into()], &[])?;
        Ok(Self {
            linearization: Mutex::new(linearization),
            dtype: device.dtype(),
        })
    }

    /// `J r`, in the precision of `r`.
    fn product<const D: usize>(&self, r: &Tensor<D>) -> Tensor<D> {
        let direction = r.clone().cast(self.dtype);
        let mut linearization = (self.linearization.lock()).unwrap_or_else(PoisonError::into_inner);
        let product = (linearization.apply(&[direction.into()]))
            .and_then(|product| product[0].tensor::<D>())
            .expect("a program that was run once takes directions of its shape and type");
        product.cast(r.dtype())
    }
}
