//! Dense linear equations and Newton's method.

/// Gaussian elimination with partial pivoting, kept for several right-hand sides.
pub(crate) struct Factors {
    /// Rows of `L` below and of `U` on and above the diagonal.
    rows: Vec<Vec<f64>>,
    /// The row that came to each place.
    order: Vec<usize>,
}

impl Factors {
    pub(crate) fn new(mut rows: Vec<Vec<f64>>) -> Self {
        let mut order: Vec<usize> = (0..rows.len()).collect();
        for column in 0..rows.len() {
            let size = |&row: &usize| rows[row][column].abs();
            let largest = (column..rows.len())
                .max_by(|a, b| size(a).total_cmp(&size(b)))
                .expect("there are rows left");
            rows.swap(column, largest);
            order.swap(column, largest);
            let (done, left) = rows.split_at_mut(column + 1);
            let pivot = &done[column];
            for row in left {
                let factor = row[column] / pivot[column];
                row[column] = factor;
                for (a, p) in row[column + 1..].iter_mut().zip(&pivot[column + 1..]) {
                    *a -= factor * p;
                }
            }
        }
        Self { rows, order }
    }

    pub(crate) fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x: Vec<f64> = self.order.iter().map(|&row| right[row]).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for (i, row) in self.rows.iter().enumerate() {
            x[i] -= dot(&row[..i], &x[..i]);
        }
        for (i, row) in self.rows.iter().enumerate().rev() {
            x[i] = (x[i] - dot(&row[i + 1..], &x[i + 1..])) / row[i];
        }
        x
    }
}

/// Rows of the Jacobian matrix of `f` at `x`, by differences.
pub(crate) fn jacobian(f: &impl Fn(&[f64]) -> Vec<f64>, x: &[f64], value: &[f64]) -> Vec<Vec<f64>> {
    const DIFFERENCE: f64 = 1e-7;
    let mut moved = x.to_vec();
    let mut rows = vec![vec![0.0; x.len()]; value.len()];
    for column in 0..x.len() {
        moved[column] = x[column] + DIFFERENCE;
        for ((row, new), old) in rows.iter_mut().zip(f(&moved)).zip(value) {
            row[column] = (new - old) / DIFFERENCE;
        }
        moved[column] = x[column];
    }
    rows
}

/// What Newton's method ends with.
pub(crate) struct Newton {
    pub(crate) solution: Vec<f64>,
    /// Largest entry of the last step.
    pub(crate) step: f64,
    pub(crate) iterations: usize,
}

impl Newton {
    /// Newton's method until a step has no entry larger than `tolerance`, or for 30 iterations.
    pub(crate) fn solve(f: &impl Fn(&[f64]) -> Vec<f64>, start: Vec<f64>, tolerance: f64) -> Self {
        const MOST_ITERATIONS: usize = 30;
        let mut result = Self {
            solution: start,
            step: f64::INFINITY,
            iterations: 0,
        };
        while result.step > tolerance && result.iterations < MOST_ITERATIONS {
            let value = f(&result.solution);
            let step = Factors::new(jacobian(f, &result.solution, &value)).solve(&value);
            for (x, s) in result.solution.iter_mut().zip(&step) {
                *x -= s;
            }
            // What is not a number is larger than all others.
            let sizes = step.iter().map(|s| s.abs());
            result.step = sizes.max_by(f64::total_cmp).unwrap_or(0.0);
            result.iterations += 1;
        }
        result
    }
}
