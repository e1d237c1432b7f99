//! A trained operator: kernel, activation, and the ratios it was trained for.

use files::{Sha256, hexadecimal};
use mean_curvature::Calibration;
use operators::{HermiteTable, TableRange};
use serde::{Deserialize, Serialize};

use crate::mlp::TABLE;
use crate::{Error, Mlp, Ratios};

impl Ratios {
    /// Checks that the numbers can describe an operator.
    ///
    /// # Errors
    /// [`Error::Ratios`] naming the first that cannot.
    pub fn validate(&self) -> Result<(), Error> {
        let reason = if !(2..=3).contains(&self.dimension) {
            "the dimension must be 2 or 3"
        } else if self.width.is_multiple_of(2) || self.width > 1025 {
            "the kernel width must be odd and at most 1025"
        } else if !(self.eps_over_h.is_finite() && self.eps_over_h > 0.0) {
            "eps/h must be positive"
        } else if !(self.step_over_h2.is_finite() && self.step_over_h2 > 0.0) {
            "tautilde/h^2 must be positive"
        } else if self.step_over_h2 >= 8.0 / 9.0 * self.eps_over_h * self.eps_over_h {
            "tautilde must be below 8/9 eps^2, or the step is not monotone"
        } else {
            return Ok(());
        };
        Err(Error::Ratios {
            ratios: *self,
            reason,
        })
    }
}

/// How a network was trained and how good it is; stored with the weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Training method and its settings, in words.
    pub recipe: String,
    /// Cells per unit length of the training grid.
    pub reference_cells: usize,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Version of the program that trained it.
    pub version: String,
    /// What the training reported last: the loss of the paper on its samples, and for the accurate recipe, whose
    /// last part imitates its function by a perceptron, the residual of that.
    pub training_loss: f64,
    /// Loss of the paper on held-out radii, whole grid.
    pub held_out_loss: f64,
    /// Held-out loss with both phases exchanged.
    pub flipped_loss: f64,
}

/// The learned mean-curvature operator `V[u] = F(K * u)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    ratios: Ratios,
    kernel: Vec<f64>,
    activation: Mlp,
    /// How it was trained.
    pub provenance: Provenance,
    /// The calibration stored with the weights, if there is one.
    pub calibration: Option<Calibration>,
}

impl Network {
    /// A network of a kernel and an activation.
    ///
    /// `kernel`: `n_K^D` values, row-major, centre in the middle.
    ///
    /// # Errors
    /// [`Error::Ratios`], [`Error::Shape`] or [`Error::NonFinite`].
    pub fn new(
        ratios: Ratios,
        kernel: Vec<f64>,
        activation: Mlp,
        provenance: Provenance,
    ) -> Result<Self, Error> {
        ratios.validate()?;
        Error::check_count("kernel", ratios.kernel_len(), kernel.len())?;
        Error::check_finite("kernel", &kernel)?;
        Ok(Self {
            ratios,
            kernel,
            activation,
            provenance,
            calibration: None,
        })
    }

    /// The ratios it was trained for.
    pub fn ratios(&self) -> Ratios {
        self.ratios
    }

    /// The ratios of a network that must be of this dimension.
    pub(crate) fn ratios_in(&self, dimension: usize) -> Result<Ratios, Error> {
        let own = self.ratios.dimension;
        Error::check_count("dimension of the network", dimension, own)?;
        Ok(self.ratios)
    }

    /// Kernel `K`, row-major.
    pub fn kernel(&self) -> &[f64] {
        &self.kernel
    }

    /// Activation `F`.
    pub fn activation(&self) -> &Mlp {
        &self.activation
    }

    /// What the kernel makes of a constant 1, the sum of its values; 1 if it is that up to what training leaves, `1e-5`.
    pub(crate) fn mass(&self) -> f64 {
        const ROUNDED: f64 = 1e-5;
        let mass: f64 = self.kernel.iter().sum();
        if (mass - 1.0).abs() <= ROUNDED {
            1.0
        } else {
            mass
        }
    }

    /// The table that solvers use as `F`, on the smallest whole multiple of `[-2, 2]` that holds `K*u` for all `u` within
    /// `[-1.2, 1.2]`, with cells of the same width.
    ///
    /// # Errors
    /// [`Error::KernelTooLarge`]; [`Error::Operators`] if `F` overflows on the interval.
    pub fn table(&self) -> Result<HermiteTable, Error> {
        const REACH: f64 = 1.2;
        const MOST: f64 = 64.0;
        let sum: f64 = self.kernel.iter().map(|value| value.abs()).sum();
        let times = (REACH * sum / TABLE.high).ceil().max(1.0);
        if times > MOST {
            let most = MOST * TABLE.high / REACH;
            return Err(Error::KernelTooLarge { sum, most });
        }
        self.activation.table(TableRange {
            low: times * TABLE.low,
            high: times * TABLE.high,
            cells: times as usize * TABLE.cells,
        })
    }

    /// SHA-256 of the numbers, in hexadecimal: networks with the same fingerprint are the same operator.
    pub fn fingerprint(&self) -> String {
        let mut bytes = self.ratios.to_string().into_bytes();
        for width in self.activation.layers() {
            bytes.extend(width.to_le_bytes());
        }
        let numbers = self.kernel.iter().chain(self.activation.parameters());
        bytes.extend(numbers.flat_map(|value| value.to_le_bytes()));
        hexadecimal(Sha256::of(bytes))
    }

    /// The stored calibration, or a new one.
    pub fn calibration(&self) -> Result<Calibration, Error> {
        self.calibration.map_or_else(|| self.calibrate(), Ok)
    }

    /// The part of the operator that commutes with exchanging the phases, `(V[u] - V[-u]) / 2`: a network of the same form
    /// whose activation is [`Mlp::odd_part`]. Its spontaneous curvature is zero. Losses and calibration are to be measured
    /// anew.
    #[must_use]
    pub fn odd_part(&self) -> Self {
        Self {
            activation: self.activation.odd_part(),
            calibration: None,
            ..self.clone()
        }
    }

    /// Refuses a run whose ratios are not the network's.
    ///
    /// # Errors
    /// [`Error::Mismatch`] naming both.
    pub fn check_fits(&self, run: Ratios) -> Result<(), Error> {
        if self.ratios.matches(&run) {
            return Ok(());
        }
        Err(Error::Mismatch {
            network: self.ratios,
            run,
        })
    }
}
