//! Dual numbers `x + ε ẋ`, `ε² = 0`, over tensors: forward mode by overloading.
//!
//! Writing an energy with duals gives its directional derivative as an ordinary tensor expression;
//! Burn's `backward` of that is a Hessian-vector product, reverse over forward. It recomputes the
//! energy for every direction and shares no code with the linearized programs, which makes it an
//! independent check of them.
//!
//! ```
//! use burn::tensor::{DType, Device, Tensor, TensorData};
//! use burn_linearize::dual::{self, Dual};
//!
//! let device = Device::default();
//! let tensor = |data: [f64; 2]| {
//!     Tensor::<1>::from_data(TensorData::from(data), (&device, DType::F64))
//! };
//! // E(x) = Σ x³: the Hessian is diag(6x).
//! let energy = |x: Dual<1>| x.powi(3).sum();
//! let product = dual::hessian_vector_product(&tensor([1.0, 2.0]), &tensor([1.0, 10.0]), energy);
//! product.into_data().assert_eq(&TensorData::from([6.0, 120.0]), true);
//! ```

use std::ops::{Add, Mul, Sub};

use burn::tensor::Tensor;

/// A tensor and its derivative in one direction.
#[derive(Clone, Debug, derive_more::Add, derive_more::Neg, derive_more::Sub)]
pub struct Dual<const D: usize> {
    /// The value.
    pub primal: Tensor<D>,
    /// The directional derivative.
    pub tangent: Tensor<D>,
}

impl<const D: usize> Dual<D> {
    /// A value with a given derivative.
    pub fn new(primal: Tensor<D>, tangent: Tensor<D>) -> Self {
        Self { primal, tangent }
    }

    /// A value that does not vary.
    pub fn constant(primal: Tensor<D>) -> Self {
        let tangent = primal.zeros_like();
        Self { primal, tangent }
    }

    /// Image under a linear map, which may change the rank.
    #[must_use]
    pub fn linear<const E: usize>(self, map: impl Fn(Tensor<D>) -> Tensor<E>) -> Dual<E> {
        Dual {
            primal: map(self.primal),
            tangent: map(self.tangent),
        }
    }

    /// Image under a pointwise function, given its value and its derivative there.
    #[must_use]
    pub fn pointwise(self, value: Tensor<D>, slope: Tensor<D>) -> Self {
        Self {
            primal: value,
            tangent: self.tangent * slope,
        }
    }

    /// Integer power.
    #[must_use]
    pub fn powi(self, exponent: i32) -> Self {
        let slope = self.primal.clone().powi_scalar(exponent - 1) * f64::from(exponent);
        let value = self.primal.clone().powi_scalar(exponent);
        self.pointwise(value, slope)
    }

    /// Real power of positive numbers.
    #[must_use]
    pub fn powf(self, exponent: f64) -> Self {
        let slope = self.primal.clone().powf_scalar(exponent - 1.0) * exponent;
        let value = self.primal.clone().powf_scalar(exponent);
        self.pointwise(value, slope)
    }

    /// Exponential.
    #[must_use]
    pub fn exp(self) -> Self {
        let value = self.primal.clone().exp();
        self.pointwise(value.clone(), value)
    }

    /// Hyperbolic tangent.
    #[must_use]
    pub fn tanh(self) -> Self {
        let value = self.primal.clone().tanh();
        let slope = -(value.clone() * value.clone()) + 1.0;
        self.pointwise(value, slope)
    }

    /// Sum of all elements.
    #[must_use]
    pub fn sum(self) -> Dual<1> {
        self.linear(Tensor::sum)
    }

    /// Mean of all elements.
    #[must_use]
    pub fn mean(self) -> Dual<1> {
        self.linear(Tensor::mean)
    }
}

impl<const D: usize> Mul for Dual<D> {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self {
            primal: self.primal.clone() * other.primal.clone(),
            tangent: self.tangent * other.primal + self.primal * other.tangent,
        }
    }
}

/// A constant tensor is added to the value alone.
impl<const D: usize> Add<Tensor<D>> for Dual<D> {
    type Output = Self;

    fn add(self, other: Tensor<D>) -> Self {
        Self::new(self.primal + other, self.tangent)
    }
}

impl<const D: usize> Sub<Tensor<D>> for Dual<D> {
    type Output = Self;

    fn sub(self, other: Tensor<D>) -> Self {
        Self::new(self.primal - other, self.tangent)
    }
}

impl<const D: usize> Add<f64> for Dual<D> {
    type Output = Self;

    fn add(self, other: f64) -> Self {
        Self::new(self.primal + other, self.tangent)
    }
}

impl<const D: usize> Mul<f64> for Dual<D> {
    type Output = Self;

    fn mul(self, other: f64) -> Self {
        self.linear(|t| t * other)
    }
}

/// `∇²E(u) p`, reverse over forward: Burn's gradient of the directional derivative of `energy`.
///
/// Operands that `energy` creates or captures may live on the plain device of `u`.
pub fn hessian_vector_product<const D: usize>(
    u: &Tensor<D>,
    p: &Tensor<D>,
    energy: impl FnOnce(Dual<D>) -> Dual<1>,
) -> Tensor<D> {
    let leaf = u.clone().autodiff().require_grad();
    let direction = p.clone().autodiff();
    let slope = energy(Dual::new(leaf.clone(), direction)).tangent;
    let gradients = slope.backward();
    leaf.grad(&gradients).unwrap_or_else(|| u.zeros_like())
}

/// `∇E(u)` by Burn's autodiff.
///
/// Burn 0.22.1 rounds `1/c` to single precision in the gradient of `x / c` with a number `c`; traced
/// graphs do not. Write `x * (1.0 / c)` to compare the two.
pub fn gradient<const D: usize>(
    u: &Tensor<D>,
    energy: impl FnOnce(Tensor<D>) -> Tensor<1>,
) -> Tensor<D> {
    let leaf = u.clone().autodiff().require_grad();
    let gradients = energy(leaf.clone()).backward();
    leaf.grad(&gradients).unwrap_or_else(|| u.zeros_like())
}
