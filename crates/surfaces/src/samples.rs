//! Closed meshes without files, for trying things out: in the spirit of scanned figures and of
//! machine parts, built as isosurfaces of implicit functions.

use geometry::shapes::Capsule;
use geometry::{Field, Grid, SignedDistance, require};

use crate::{ClosedMesh, Error, isosurface};

/// A standing figure with limbs, ears, a tail and a back full of bumps, of genus 0.
///
/// It stands along the second axis in the unit cube about the origin; `cells` is the resolution
/// of the grid on that cube. Below 48 thin parts are not resolved.
///
/// # Errors
/// [`geometry::Error::InvalidParameter`] for fewer than 48 cells.
pub fn figure(cells: usize) -> Result<ClosedMesh, Error> {
    // Centre and semi-axes.
    const BODY: [([f64; 3], [f64; 3]); 5] = [
        ([0.0, -0.02, 0.0], [0.13, 0.19, 0.11]),
        ([0.0, 0.12, 0.01], [0.15, 0.10, 0.10]),
        ([0.0, 0.27, -0.02], [0.085, 0.10, 0.09]),
        ([0.0, 0.24, -0.10], [0.045, 0.04, 0.08]),
        ([0.0, -0.05, 0.07], [0.11, 0.17, 0.09]),
    ];
    // For the right side: start, end, radius.
    const LIMBS: [([f64; 3], [f64; 3], f64); 8] = [
        ([0.12, 0.15, 0.0], [0.29, 0.17, -0.03], 0.048),
        ([0.29, 0.17, -0.03], [0.34, 0.33, -0.10], 0.040),
        ([0.34, 0.33, -0.10], [0.37, 0.41, -0.11], 0.030),
        ([0.07, -0.14, 0.0], [0.17, -0.26, -0.05], 0.062),
        ([0.17, -0.26, -0.05], [0.15, -0.42, 0.01], 0.047),
        ([0.15, -0.42, 0.01], [0.17, -0.435, -0.11], 0.036),
        ([0.06, 0.33, 0.0], [0.13, 0.43, 0.03], 0.027),
        ([0.34, 0.33, -0.10], [0.30, 0.40, -0.13], 0.026),
    ];
    const TAIL: [([f64; 3], [f64; 3], f64); 2] = [
        ([0.0, -0.14, 0.08], [0.0, -0.30, 0.22], 0.040),
        ([0.0, -0.30, 0.22], [0.03, -0.33, 0.36], 0.026),
    ];
    let capsules = |parts: &[([f64; 3], [f64; 3], f64)]| -> Result<Vec<_>, geometry::Error> {
        parts
            .iter()
            .map(|&(a, b, r)| Capsule::new(a, b, r))
            .collect()
    };
    let (limbs, tail) = (capsules(&LIMBS)?, capsules(&TAIL)?);
    build(cells, |[x, y, z]| {
        // The figure is symmetric but for its tail.
        let mirrored = [x.abs(), y, z];
        let mut s = f64::INFINITY;
        for (centre, axes) in BODY {
            s = smooth_minimum(s, ellipsoid([x, y, z], centre, axes), 0.03);
        }
        // Rows of bumps, on the back only.
        let back = ((z - 0.02) / 0.08).clamp(0.0, 1.0);
        s -= 0.006 * back * (90.0 * x).cos() * (90.0 * y).sin();
        for limb in &limbs {
            s = smooth_minimum(s, limb.signed_distance(mirrored), 0.03);
        }
        for part in &tail {
            s = smooth_minimum(s, part.signed_distance([x, y, z]), 0.03);
        }
        // Wrinkles all over.
        s - 0.0015 * (70.0 * x).sin() * (80.0 * y).sin() * (75.0 * z).cos()
    })
}

/// A bent lever with a bore through one of its two bosses, of genus 1.
///
/// Its long side is along the third axis in the unit cube about the origin, the bore along the
/// first; `cells` is the resolution of the grid on that cube.
///
/// # Errors
/// [`geometry::Error::InvalidParameter`] for fewer than 48 cells.
pub fn lever(cells: usize) -> Result<ClosedMesh, Error> {
    // Boss of the bore and solid boss: centre in the plane of y and z, radius, half width.
    let boss = |[x, y, z]: [f64; 3], centre: [f64; 2], radius: f64, half_width: f64| {
        let (across, along) = (
            (y - centre[0]).hypot(z - centre[1]) - radius,
            x.abs() - half_width,
        );
        rounded_corner(across, along, 0.02)
    };
    let arms = [
        Capsule::new([0.0, -0.10, -0.25], [0.0, 0.12, 0.05], 0.075)?,
        Capsule::new([0.0, 0.12, 0.05], [0.0, 0.04, 0.36], 0.060)?,
    ];
    let spur = Capsule::new([0.0, 0.12, 0.05], [0.06, 0.26, 0.10], 0.035)?;
    build(cells, |x| {
        let bored = boss(x, [-0.10, -0.25], 0.19, 0.14);
        let solid = boss(x, [0.04, 0.36], 0.085, 0.09);
        let arms = arms.iter().map(|arm| arm.signed_distance(x));
        let s = arms.fold(smooth_minimum(bored, solid, 0.05), |s, arm| {
            smooth_minimum(s, arm, 0.05)
        });
        let s = smooth_minimum(s, spur.signed_distance(x), 0.04);
        let bore = (x[1] + 0.10).hypot(x[2] + 0.25) - 0.095;
        -smooth_minimum(-s, bore, 0.015)
    })
}

fn build(cells: usize, s: impl Fn([f64; 3]) -> f64 + Sync) -> Result<ClosedMesh, Error> {
    let requirement = "at least 48, to resolve the thin parts";
    require("cells", cells as f64, requirement, |n| n >= 48.0)?;
    let field = Field::from_fn(Grid::centred(cells, 1.0)?, s);
    let (mesh, _) = ClosedMesh::new(isosurface(&field)?)?;
    Ok(mesh)
}

/// The minimum, blended where the two differ by less than `width`.
fn smooth_minimum(a: f64, b: f64, width: f64) -> f64 {
    let overlap = (1.0 - (a - b).abs() / width).max(0.0);
    a.min(b) - 0.25 * width * overlap * overlap
}

/// Nearly the distance to an ellipsoid, to first order at its surface.
fn ellipsoid(x: [f64; 3], centre: [f64; 3], axes: [f64; 3]) -> f64 {
    let scaled = |power: i32| {
        let terms = (0..3).map(|i| ((x[i] - centre[i]) / axes[i].powi(power)).powi(2));
        terms.sum::<f64>().sqrt()
    };
    let (value, gradient) = (scaled(1), scaled(2));
    if gradient > 0.0 {
        value * (value - 1.0) / gradient
    } else {
        -axes.into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// The intersection of two half spaces at a right angle, its edge rounded.
fn rounded_corner(a: f64, b: f64, radius: f64) -> f64 {
    let (a, b) = (a + radius, b + radius);
    a.max(0.0).hypot(b.max(0.0)) + a.max(b).min(0.0) - radius
}
