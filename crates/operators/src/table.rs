//! A scalar function as a piecewise polynomial: quintic Hermite interpolation of its jets.
//!
//! Newton's method needs `F`, `F'` and `F''` of the *same* function, and a table gives all of them for the price
//! of one look-up. On each of `cells` equal cells of `[low, high]` the interpolant matches `F`, `F'`, `F''` at both
//! ends, so it is twice continuously differentiable, with an error of `width^6 / 46080 max |F^(6)|`. Beyond the ends it
//! continues as the second-order Taylor polynomial there.

use crate::Error;
use crate::fft::Real;
use crate::fresh::filled;

/// Coefficients per cell.
pub const COEFFICIENTS: usize = 6;
const CHUNK: usize = 1 << 13;

/// Interval and resolution of a table; the coefficients travel beside it as a `[cells, 6]` tensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableRange {
    /// Left end.
    pub low: f64,
    /// Right end.
    pub high: f64,
    /// Number of equal cells.
    pub cells: usize,
}

impl TableRange {
    pub(crate) fn width(&self) -> f64 {
        (self.high - self.low) / self.cells as f64
    }
}

/// A tabulated function on the host: coefficient `j` of cell `i` at `6 i + j`, in powers of `t = (w - w_i) / width`.
#[derive(Clone, Debug, PartialEq)]
pub struct HermiteTable {
    range: TableRange,
    coefficients: Vec<f64>,
}

impl HermiteTable {
    /// Tabulates a function given by its jet `w -> [F, F', F'']`.
    ///
    /// # Errors
    /// [`Error::TableRange`] if the interval is empty or not finite, or there are no cells;
    /// [`Error::NonFiniteTable`] at the first node where the jet is not finite.
    pub fn new(range: TableRange, jet: impl Fn(f64) -> [f64; 3]) -> Result<Self, Error> {
        let TableRange { low, high, cells } = range;
        if !(low.is_finite() && high.is_finite() && low < high && cells > 0) {
            return Err(Error::TableRange { low, high, cells });
        }
        let width = range.width();
        let mut nodes = Vec::with_capacity(cells + 1);
        for i in 0..=cells {
            let at = low + i as f64 * width;
            let value = jet(at);
            if value.iter().any(|v| !v.is_finite()) {
                return Err(Error::NonFiniteTable { at });
            }
            nodes.push(value);
        }
        let coefficients = nodes
            .windows(2)
            .flat_map(|ends| hermite(ends[0], ends[1], width))
            .collect();
        Ok(Self {
            range,
            coefficients,
        })
    }

    /// Interval and number of cells.
    pub fn range(&self) -> TableRange {
        self.range
    }

    /// All coefficients, `[cells, 6]` row-major.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// The `order`-th derivative of the interpolant at each entry of `w`.
    pub fn derivatives(&self, w: &[f64], order: usize) -> Vec<f64> {
        evaluate(w, self.range, &self.coefficients, order)
    }

    /// The `order`-th derivative of the interpolant at `w`. For many values [`Self::derivatives`] is far cheaper.
    pub fn derivative(&self, w: f64, order: usize) -> f64 {
        self.derivatives(&[w], order)[0]
    }
}

fn hermite(a: [f64; 3], b: [f64; 3], width: f64) -> [f64; COEFFICIENTS] {
    let [f0, d0, s0] = [a[0], a[1] * width, 0.5 * a[2] * width * width];
    let [f1, d1, s1] = [b[0], b[1] * width, 0.5 * b[2] * width * width];
    // What the quadratic from the left end misses at the right end, in value and derivatives.
    let value = f1 - f0 - d0 - s0;
    let slope = d1 - d0 - 2.0 * s0;
    let bend = s1 - s0;
    [
        f0,
        d0,
        s0,
        10.0 * value - 4.0 * slope + bend,
        -15.0 * value + 7.0 * slope - 2.0 * bend,
        6.0 * value - 3.0 * slope + bend,
    ]
}

/// The `ORDER`-th derivative of a table: coefficients of the derived polynomials, ready for Horner's rule.
struct Evaluator<T, const ORDER: usize> {
    low: T,
    inverse_width: T,
    cells: usize,
    end: T,
    /// Per cell, lowest power first; those beyond the degree `5 - ORDER` are not read.
    polynomials: Vec<[T; COEFFICIENTS]>,
    /// Taylor polynomials in `s - end` at both ends of the table.
    beyond: [[T; 3]; 2],
}

/// `j! / (j - order)! / width^order`: what the `order`-th derivative multiplies coefficient `j` by.
pub(crate) fn factor(width: f64, j: usize, order: usize) -> f64 {
    let falling: f64 = (0..order).map(|i| j as f64 - i as f64).product();
    falling / width.powi(order as i32)
}

impl<T: Real, const ORDER: usize> Evaluator<T, ORDER> {
    fn new(range: TableRange, coefficients: &[T]) -> Self {
        let width = range.width();
        let derived = |order: usize| {
            let factors: [T; COEFFICIENTS] =
                std::array::from_fn(|j| T::of(factor(width, j, order)));
            move |cell: &[T]| -> [T; COEFFICIENTS] {
                std::array::from_fn(|i| match cell.get(i + order) {
                    Some(&c) => c * factors[i + order],
                    None => T::zero(),
                })
            }
        };
        let (cells, _) = coefficients.as_chunks::<COEFFICIENTS>();
        // The second-order Taylor polynomial of the function itself, derived `ORDER` times, in units of cells.
        let taylor = |cell: &[T; COEFFICIENTS], t: T| -> [T; 3] {
            std::array::from_fn(|power| {
                if ORDER + power > 2 {
                    return T::zero();
                }
                let slope = horner(&derived(ORDER + power)(cell), t);
                let unit = width.powi(power as i32) / if power == 2 { 2.0 } else { 1.0 };
                slope * T::of(unit)
            })
        };
        let beyond = match (cells.first(), cells.last()) {
            (Some(first), Some(last)) => [taylor(first, T::zero()), taylor(last, T::one())],
            _ => [[T::zero(); 3]; 2],
        };
        let derive = derived(ORDER);
        Self {
            low: T::of(range.low),
            inverse_width: T::of(1.0 / width),
            cells: cells.len(),
            end: T::of(cells.len() as f64),
            polynomials: cells.iter().map(|cell| derive(cell)).collect(),
            beyond,
        }
    }

    fn at(&self, w: T) -> T {
        let s = (w - self.low) * self.inverse_width;
        if s < T::zero() || s > self.end {
            return self.beyond(s);
        }
        // NaN lands in cell 0 and stays NaN through t.
        let cell = s.truncated().min(self.cells - 1);
        let t = s - T::of(cell as f64);
        let polynomial = &self.polynomials[cell];
        let mut sum = T::zero();
        for j in (0..COEFFICIENTS - ORDER).rev() {
            sum = sum * t + polynomial[j];
        }
        sum
    }

    /// The second-order Taylor polynomial at the end of the table nearest to `s`.
    #[cold]
    fn beyond(&self, s: T) -> T {
        let (polynomial, distance) = if s < T::zero() {
            (&self.beyond[0], s)
        } else {
            (&self.beyond[1], s - self.end)
        };
        polynomial[0] + distance * (polynomial[1] + distance * polynomial[2])
    }

    fn fill(&self, w: &[T], out: &mut [T]) {
        for (out, &w) in out.iter_mut().zip(w) {
            *out = self.at(w);
        }
    }
}

fn horner<T: Real>(polynomial: &[T; COEFFICIENTS], t: T) -> T {
    (polynomial.iter().rev()).fold(T::zero(), |sum, &c| sum * t + c)
}

/// The `order`-th derivative at every entry of `w`.
pub(crate) fn evaluate<T: Real>(
    w: &[T],
    range: TableRange,
    coefficients: &[T],
    order: usize,
) -> Vec<T> {
    // The order as a constant: the polynomial is then unrolled.
    match order {
        0 => evaluate_order::<T, 0>(w, range, coefficients),
        1 => evaluate_order::<T, 1>(w, range, coefficients),
        2 => evaluate_order::<T, 2>(w, range, coefficients),
        3 => evaluate_order::<T, 3>(w, range, coefficients),
        4 => evaluate_order::<T, 4>(w, range, coefficients),
        5 => evaluate_order::<T, 5>(w, range, coefficients),
        // Derivatives of NaN stay NaN.
        _ => w.iter().map(|&w| w * T::zero()).collect(),
    }
}

fn evaluate_order<T: Real, const ORDER: usize>(
    w: &[T],
    range: TableRange,
    coefficients: &[T],
) -> Vec<T> {
    let table = Evaluator::<T, ORDER>::new(range, coefficients);
    filled(w.len(), CHUNK, |number, out| {
        table.fill(&w[number * CHUNK..], out);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(w: f64) -> [f64; 3] {
        [w.sin(), w.cos(), -w.sin()]
    }

    fn table(cells: usize) -> HermiteTable {
        HermiteTable::new(
            TableRange {
                low: -2.0,
                high: 2.0,
                cells,
            },
            sine,
        )
        .unwrap()
    }

    #[test]
    fn converges_with_the_orders_of_quintic_interpolation() {
        let error = |cells: usize, order: usize| {
            let points: Vec<f64> = (0..4001).map(|i| -2.0 + f64::from(i) * 1e-3).collect();
            let exact = |w: f64| (w + order as f64 * std::f64::consts::FRAC_PI_2).sin();
            (table(cells).derivatives(&points, order).iter())
                .zip(&points)
                .map(|(value, &w)| (value - exact(w)).abs())
                .fold(0.0, f64::max)
        };
        for (order, expected) in [(0, 6.0), (1, 5.0), (2, 4.0), (3, 3.0)] {
            let rate = (error(8, order) / error(16, order)).log2();
            assert!((rate - expected).abs() < 0.2, "order {order}: rate {rate}");
        }
        assert!(error(1024, 0) < 1e-14);
    }

    #[test]
    fn continues_twice_differentiably_beyond_the_ends() {
        let table = table(64);
        for end in [-2.0, 2.0] {
            for order in 0..3 {
                let inside = table.derivative(end * (1.0 - 1e-9), order);
                let outside = table.derivative(end * (1.0 + 1e-9), order);
                assert!((inside - outside).abs() < 1e-7, "order {order} at {end}");
            }
            let d = 0.7;
            let [f, f1, f2] = sine(end);
            let taylor = f + f1 * d * end.signum() + 0.5 * f2 * d * d;
            assert!((table.derivative(end + d * end.signum(), 0) - taylor).abs() < 1e-12);
            assert!(table.derivative(3.0 * end, 3).abs() < f64::EPSILON);
        }
        assert!(table.derivative(f64::NAN, 0).is_nan());
    }

    #[test]
    fn refuses_bad_input_with_its_numbers() {
        let mut range = TableRange {
            low: 1.0,
            high: 1.0,
            cells: 4,
        };
        let empty = HermiteTable::new(range, sine);
        assert!(matches!(empty, Err(Error::TableRange { .. })));
        range.low = -1.0;
        let error = HermiteTable::new(range, |w| [1.0 / w, 0.0, 0.0]).unwrap_err();
        assert_eq!(error, Error::NonFiniteTable { at: 0.0 });
    }
}
