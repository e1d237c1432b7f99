//! Where the values of a phase field are stored, and what can be done with them there.

use burn::tensor::{Device, Tensor};
use geometry::{Error, Grid, Nodes, PhaseField, parallel};
use operators::ComputeDevice;

mod differences;
mod unstored;

/// The scales of a flow that formulas need.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DomainScales {
    /// `eps`, the width of the interface.
    pub eps: f64,
    /// `tautilde`, the size of the step of mean curvature flow inside.
    pub mcf_step: f64,
    /// `g`, the motion of that step over the motion by mean curvature: 1 for an exact one ([`mean_curvature::Calibration::response`]).
    pub response: f64,
}

/// The nodes whose values are stored, all of a periodic grid or those of its active [bricks](geometry::Bricks), with the operations of
/// calculus there.
///
/// A formula that is made of these operations is the same one in all ways of storing: on the whole grid, on bricks, and on the
/// coarser grids on which steps begin. Tensors have the [shape](Self::shape) of the stored values and the precision of the device. What is not stored is constant, at
/// the [value of its phase](Self::phase_values).
///
/// ```
/// use geometry::{Field, Grid};
/// use operators::ComputeDevice;
/// use solver::{Domain, DomainScales};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let device = ComputeDevice::default_compiled()?;
/// let grid = Grid::<2>::new(64, 1.0)?;
/// let scales = DomainScales { eps: 1.0 / 32.0, mcf_step: 1.0 / 4096.0, response: 1.0 };
/// let domain = Domain::new(grid.into(), [-1.0, 1.0], scales, &device);
/// let wave = domain.sample(|[x, _]| (std::f64::consts::TAU * x).sin());
/// let [along_x, _] = domain.gradient(&wave);
/// let slope = device.values(along_x)?[0];
/// assert!((slope / std::f64::consts::TAU - 1.0).abs() < 1e-5);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Domain<const D: usize> {
    nodes: Nodes<D>,
    phase_values: [f64; 2],
    scales: DomainScales,
    /// Where numbers are computed.
    home: ComputeDevice,
    /// Where tensors are made: at home, or where a graph is traced.
    here: Device,
}

impl<const D: usize> Domain<D> {
    /// These nodes, with the values in the negative and in the positive phase where nothing is stored.
    pub fn new(
        nodes: Nodes<D>,
        phase_values: [f64; 2],
        scales: DomainScales,
        device: &ComputeDevice,
    ) -> Self {
        Self {
            nodes,
            phase_values,
            scales,
            home: device.clone(),
            here: device.device().clone(),
        }
    }

    /// The same with its tensors on a device, such as that on which a graph is traced.
    #[must_use]
    pub fn at(&self, device: &Device) -> Self {
        let here = device.clone();
        Self {
            here,
            ..self.clone()
        }
    }

    /// The same for values that are stored at other nodes.
    #[must_use]
    pub fn on(&self, nodes: &Nodes<D>) -> Self {
        let nodes = nodes.clone();
        Self {
            nodes,
            ..self.clone()
        }
    }

    /// The device where numbers are computed.
    pub fn device(&self) -> &ComputeDevice {
        &self.home
    }

    /// The stored nodes, in their order.
    pub fn nodes(&self) -> &Nodes<D> {
        &self.nodes
    }

    /// The whole grid.
    pub fn grid(&self) -> &Grid<D> {
        self.nodes.grid()
    }

    /// `h`, the distance of neighbouring nodes.
    pub fn spacing(&self) -> f64 {
        self.grid().spacing()
    }

    /// `h^D`, the area or volume of a node: integrals are sums over the nodes, times this.
    pub fn cell_volume(&self) -> f64 {
        self.grid().cell_volume()
    }

    /// `eps`, the width of the interface.
    pub fn eps(&self) -> f64 {
        self.scales.eps
    }

    /// `tautilde`, the size of the step of mean curvature flow inside.
    pub fn mcf_step(&self) -> f64 {
        self.scales.mcf_step
    }

    /// `g`, the [response](DomainScales::response) of that step to curvature.
    pub fn response(&self) -> f64 {
        self.scales.response
    }

    /// The shape of tensors: `[N, .., N]`, or that of the [bricks](geometry::Bricks::shape).
    pub fn shape(&self) -> [usize; D] {
        let whole = || self.grid().shape();
        (self.nodes.bricks()).map_or_else(whole, |bricks| bricks.shape())
    }

    /// The values in the negative and in the positive phase, where nothing is stored.
    pub fn phase_values(&self) -> [f64; 2] {
        self.phase_values
    }

    /// How many nodes of the negative and of the positive phase are not stored.
    pub fn unstored(&self) -> [usize; 2] {
        (self.nodes.bricks()).map_or([0; 2], |bricks| bricks.outside())
    }

    /// The position of every stored node along each axis.
    pub fn coordinates(&self) -> [Tensor<D>; D] {
        std::array::from_fn(|axis| self.coordinate(axis))
    }

    /// The position of every stored node along one axis.
    pub fn coordinate(&self, axis: usize) -> Tensor<D> {
        self.sample(|x| x[axis])
    }

    /// A function of the position, at the stored nodes.
    pub fn sample(&self, function: impl Fn([f64; D]) -> f64 + Sync) -> Tensor<D> {
        let grid = self.grid();
        self.of_places(|place| {
            function(std::array::from_fn(|axis| {
                grid.coordinate(axis, place[axis])
            }))
        })
    }

    /// A field at the stored nodes. It may be on this grid or on one of a multiple of its cells in the same box, of which it then is every second,
    /// third .. node: a term with a field of the grid of a flow serves the coarser grids, too, on which steps begin.
    ///
    /// # Errors
    /// [`Error::GridMismatch`] for fields on other grids.
    pub fn field(&self, field: &impl PhaseField<D>) -> Result<Tensor<D>, Error> {
        let (own, other) = (self.grid(), field.nodes().grid());
        let every = other.cells() / own.cells();
        let thinned = Grid::new(own.cells(), other.side())?.with_origin(other.origin())?;
        if every * own.cells() != other.cells() || thinned != *own {
            own.same_as(other)?;
        }
        Ok(self.of_places(|place| field.at(place.map(|at| at * every))))
    }

    /// `3/(4 eps) (1 - u^2)`, the slope of the optimal profile towards the inside: a displacement of the interface by `d` outwards is the motion
    /// `d` times this.
    pub fn slope(&self, u: &Tensor<D>) -> Tensor<D> {
        let well = (u.clone() * u.clone()).neg() + 1.0;
        well * (0.75 / self.eps())
    }

    /// `(2 + 3 u - u^3)/4`, which part of a node is inside: 1 and 0 in the phases. Its derivative is `eps` times the [slope](Self::slope), so that
    /// a density in proportion to it moves the interface, and leaves the profile and the phases as they are, unlike `(1 + u)/2`.
    pub fn inside(&self, u: &Tensor<D>) -> Tensor<D> {
        let cube = u.clone() * u.clone() * u.clone();
        ((u.clone() * 3.0 - cube) + 2.0) * 0.25
    }

    /// `eps q'(u) |grad u|`: the area of the interface (the length in the plane) per volume, with the [slope](Self::slope) `q'`. By the coarea
    /// formula its integral is a mean of the areas of the level sets, whatever the profile. So `f(x)` times it moves the interface and does not bend its profile.
    ///
    /// The root is `sqrt(|grad u|^2 + (d / eps)^2) - d / eps` with `d = 1/1000`: it has derivatives where `u` is constant.
    pub fn area(&self, u: &Tensor<D>) -> Tensor<D> {
        const OFFSET: f64 = 1e-3;
        let offset = OFFSET / self.eps();
        let squares = self
            .gradient(u)
            .into_iter()
            .map(|slope| slope.clone() * slope);
        let square = squares.reduce(|a, b| a + b).expect("there are axes");
        let length = (square + offset * offset).sqrt() - offset;
        self.slope(u) * length * self.eps()
    }

    /// The values at the places of the stored nodes.
    fn of_places(&self, value: impl Fn([usize; D]) -> f64 + Sync) -> Tensor<D> {
        let values = parallel::values(self.nodes.len(), |node| value(self.nodes.multi_index(node)));
        self.constant(&values, self.shape(), &self.here)
    }

    /// A tensor with these values, on a device.
    fn constant<const R: usize>(
        &self,
        values: &[f64],
        shape: [usize; R],
        device: &Device,
    ) -> Tensor<R> {
        self.home.tensor(values, shape).to_device(device)
    }
}
