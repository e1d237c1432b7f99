//! Fixed points by Anderson's acceleration.

use faer::linalg::solvers::{ColPivQr, SolveLstsq};
use faer::{Col, Mat};

use crate::Error;

/// Earlier iterates that are combined.
const DEPTH: usize = 24;
/// Limit of iterations. Explicit steps of a fiftieth of `eps^2` take some fifty.
const ITERATIONS: usize = 240;

/// The solution of `x = g(x)`, to a last residual below `tolerance` in every entry; none where the iteration does not converge.
///
/// Anderson's acceleration: of all affine combinations of the last iterates the one with the least residual, which for a linear `g` is
/// what the method of generalized minimal residuals finds (Walker and Ni, SIAM J. Numer. Anal. 49, 2011).
///
/// # Errors
/// Those of `g`.
pub(super) fn fixed_point(
    start: Col<f64>,
    tolerance: f64,
    mut g: impl FnMut(&Col<f64>) -> Result<Col<f64>, Error>,
) -> Result<Option<Col<f64>>, Error> {
    let mut x = start;
    // Differences of images and of residuals, the newest last.
    let (mut images, mut residuals) = (Vec::<Col<f64>>::new(), Vec::<Col<f64>>::new());
    let mut before: Option<(Col<f64>, Col<f64>)> = None;
    for _ in 0..ITERATIONS {
        let image = g(&x)?;
        let residual = &image - &x;
        if residual.iter().all(|r| r.abs() < tolerance) {
            return Ok(Some(image));
        }
        if !residual.iter().all(|r| r.is_finite()) {
            return Ok(None);
        }
        if let Some((last_image, last_residual)) = &before {
            images.push(&image - last_image);
            residuals.push(&residual - last_residual);
            if images.len() > DEPTH {
                images.remove(0);
                residuals.remove(0);
            }
        }
        x = image.clone();
        if !residuals.is_empty() {
            let n = residual.nrows();
            let matrix = Mat::from_fn(n, residuals.len(), |i, j| residuals[j][i]);
            let factors = ColPivQr::new(matrix.as_ref()).solve_lstsq(&residual);
            for (difference, factor) in images.iter().zip(factors.iter()) {
                x -= difference * faer::Scale(*factor);
            }
        }
        before = Some((image, residual));
    }
    Ok(None)
}
