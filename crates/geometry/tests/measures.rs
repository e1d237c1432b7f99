//! Norms, perimeter, volumes and exact solutions.

use std::f64::consts::PI;

use geometry::shapes::{Ball, Cuboid, Torus};
use geometry::{
    Error, Field, Grid, PhaseField, SignedDistanceExt, Stored, distance_from_phase_field, exact,
    measure, npy, optimal_profile, phase_field,
};

const ORIGIN: [f64; 2] = [0.0, 0.0];

fn ball<const D: usize>(cells: usize, radius: f64, eps: f64) -> Field<D> {
    let grid = Grid::centred(cells, 2.0).unwrap();
    // Off the nodes, so that symmetry does not flatter.
    let centre = std::array::from_fn(|axis| 0.011 + 0.007 * axis as f64);
    phase_field(grid, &Ball::new(centre, radius).unwrap(), eps).unwrap()
}

fn relative(value: f64, expected: f64) -> f64 {
    (value / expected - 1.0).abs()
}

fn order(coarse: f64, fine: f64) -> f64 {
    (coarse.abs() / fine.abs()).log2()
}

#[test]
fn l2_distance_is_exact_for_trigonometric_functions() {
    // sin on a side of length 3: the square has mean 1/2, the box volume 3^D.
    let grid = Grid::<2>::new(12, 3.0).unwrap();
    let k = 2.0 * PI / 3.0;
    let u = Field::from_fn(grid, |[x, y]| (k * x).sin() * (2.0 * k * y).cos());
    let v = u.map(|value| 0.5 * value);
    assert!(relative(measure::l2_distance(&u, &v).unwrap(), 0.75) < 1e-14);
    let [a, b] = [1.0, 4.0].map(|v| Field::<3>::constant(Grid::new(5, 2.0).unwrap(), v));
    let distance = measure::l2_distance(&a, &b).unwrap();
    assert!(relative(distance, 3.0 * 8.0_f64.sqrt()) < 1e-14);
}

/// On more nodes than are read at a time, the last time not all of them.
#[test]
fn fields_in_parts_are_those_in_memory() {
    let whole = [0.2, 0.3].map(|radius| ball::<2>(96, radius, 1.0 / 64.0));
    let stored = whole.clone().map(Stored::<2>::from);
    let (grid, folder) = (*whole[0].grid(), tempfile::tempdir().unwrap());
    let path = folder.path().join("u.npy");
    for (u, whole) in stored.iter().zip(&whole) {
        assert!(u.values().len() < grid.len());
        let read = Field::read_from(grid, &|start, part| u.read(start, part));
        assert_eq!(read.unwrap(), *whole);
        npy::write(&path, u).unwrap();
        assert_eq!(npy::read(&path, |_| Ok(grid)).unwrap(), *whole);
    }
    let pairs = whole[0].values().iter().zip(whole[1].values());
    let squares: Vec<f64> = pairs.map(|(a, b)| (a - b) * (a - b)).collect();
    let sums = squares.chunks(4096).map(|part| part.iter().sum::<f64>());
    let expected = (grid.cell_volume() * sums.sum::<f64>()).sqrt();
    let distance = measure::l2_distance(&whole[0], &whole[1]).unwrap();
    assert_eq!(distance.to_bits(), expected.to_bits());
    let of_parts = measure::l2_distance(&stored[0], &stored[1]).unwrap();
    assert_eq!(of_parts.to_bits(), distance.to_bits());
    let broken = Field::read_from(grid, &|_, part: &mut [f64]| part.fill(f64::NAN));
    assert!(matches!(broken, Err(Error::NonFinite { index: 0, .. })));
}

#[test]
fn fields_on_different_grids_are_not_compared() {
    let field = |grid| Field::<2>::constant(grid, 0.0);
    let a = field(Grid::new(4, 1.0).unwrap());
    for grid in [Grid::new(5, 1.0), Grid::new(4, 2.0), Grid::centred(4, 1.0)] {
        let distance = measure::l2_distance(&a, &field(grid.unwrap()));
        assert!(matches!(distance, Err(Error::GridMismatch { .. })));
    }
}

#[test]
fn perimeter_of_a_disc_converges_with_fourth_order() {
    // The profile across a circle has perimeter 2 pi r up to exp(-3 r / eps): the error is h's.
    let (radius, eps) = (0.5, 1.0 / 16.0);
    let error = |cells| {
        let perimeter = measure::perimeter(&ball::<2>(cells, radius, eps), eps).unwrap();
        perimeter - 2.0 * PI * radius
    };
    let errors = [64, 128, 256].map(error);
    for pair in errors.windows(2) {
        let observed = order(pair[0], pair[1]);
        assert!((3.5..4.5).contains(&observed), "{observed} from {errors:?}");
    }
    // eps = 2h, the resolution of the experiments.
    assert!(errors[0].abs() / PI < 3e-4, "{errors:?}");
}

#[test]
fn perimeter_of_a_sphere_has_the_known_excess() {
    // 4 pi (r^2 + m eps^2), m = integral s^2 (9/16) sech^4(3s/4) ds = 4/27 (pi^2 - 6).
    let (radius, eps) = (0.5, 1.0 / 16.0);
    let second_moment = 4.0 / 27.0 * (PI * PI - 6.0);
    let expected = 4.0 * PI * (radius * radius + second_moment * eps * eps);
    let error = |cells| measure::perimeter(&ball::<3>(cells, radius, eps), eps).unwrap() - expected;
    let (coarse, fine) = (error(48), error(96));
    assert!((3.5..4.5).contains(&order(coarse, fine)), "{coarse} {fine}");
    assert!(
        relative(expected, PI) < 0.01,
        "the excess is of order eps^2"
    );
}

#[test]
fn perimeter_tends_to_length_and_area_as_eps_vanishes() {
    // Rectangle: the corners cost O(eps).
    let error = |cells: usize| {
        let grid = Grid::<2>::centred(cells, 2.0).unwrap();
        let eps = 2.0 * grid.spacing();
        let u = phase_field(grid, &Cuboid::new([0.5, 0.25]).unwrap(), eps).unwrap();
        measure::perimeter(&u, eps).unwrap() - 3.0
    };
    let (coarse, fine) = (error(128), error(256));
    assert!((0.8..1.2).contains(&order(coarse, fine)), "{coarse} {fine}");
    assert!(fine.abs() < 0.05, "{fine}");
    // Clifford torus: area 4 pi^2 R r, excess O(eps^2).
    let torus = Torus::clifford(0.8).unwrap();
    let grid = Grid::<3>::centred(96, 2.0).unwrap();
    let eps = 2.0 * grid.spacing();
    let u = phase_field(grid, &torus, eps).unwrap();
    let area = 4.0 * PI * PI * torus.major() * torus.minor();
    let measured = measure::perimeter(&u, eps).unwrap();
    assert!(relative(measured, area) < 0.005, "{measured} {area}");
    let volume = 2.0 * PI * PI * torus.major() * torus.minor().powi(2);
    let measured = measure::zero_set_volume(&u);
    assert!(relative(measured, volume) < 0.005, "{measured} {volume}");
}

#[test]
fn zero_set_volume_converges_with_second_order() {
    let disc = |cells: usize| {
        // eps shrinks with h and leaves no trace.
        measure::zero_set_volume(&ball::<2>(cells, 0.5, 4.0 / cells as f64)) - PI / 4.0
    };
    let sphere = |cells: usize| {
        measure::zero_set_volume(&ball::<3>(cells, 0.5, 4.0 / cells as f64)) - PI / 6.0
    };
    for (coarse, fine) in [
        (disc(64), disc(128)),
        (disc(128), disc(256)),
        (sphere(32), sphere(64)),
    ] {
        assert!((1.7..2.3).contains(&order(coarse, fine)), "{coarse} {fine}");
    }
    assert!(disc(256).abs() < 1e-4, "{}", disc(256));
}

#[test]
fn zero_set_volume_is_exact_for_piecewise_linear_distances() {
    // An octahedron about a node: linear in every cell. Its tanh is what is stored.
    let grid = Grid::<3>::centred(16, 2.0).unwrap();
    let a = 0.613;
    let u = Field::from_fn(grid, |[x, y, z]| (a - x.abs() - y.abs() - z.abs()).tanh());
    let volume = 4.0 / 3.0 * a * a * a;
    assert!(relative(measure::zero_set_volume(&u), volume) < 1e-13);
    // The complement is the rest of the box, across the periodic faces as well.
    let rest = measure::zero_set_volume(&u.map(|v| -v));
    assert!(relative(rest, 8.0 - volume) < 1e-13);
    assert!(relative(measure::zero_set_volume(&Field::constant(grid, 0.3)), 8.0) < 1e-15);
}

#[test]
fn bounding_box_is_accurate_below_the_spacing() {
    let extent = |cells: usize| {
        let grid = Grid::<2>::centred(cells, 2.0).unwrap();
        let disc = Ball::new([0.1, -0.2], 0.4).unwrap();
        let u = phase_field(grid, &disc, 2.0 * grid.spacing()).unwrap();
        measure::bounding_box(&u).unwrap()
    };
    let found = extent(100);
    for axis in 0..2 {
        // The nearest grid line may pass h/2 beside the extreme point: sagitta h^2 / (8 r).
        assert!((found.centre()[axis] - [0.1, -0.2][axis]).abs() < 4e-4);
        assert!((found.extent()[axis] - 0.8).abs() < 8e-4, "{found:?}");
    }
    let empty = Field::<2>::constant(Grid::new(4, 1.0).unwrap(), -1.0);
    assert_eq!(measure::bounding_box(&empty), None);
}

#[test]
fn profile_and_distance_are_inverse() {
    let eps = 0.03;
    for k in -110..=110 {
        let s = eps * f64::from(k) / 10.0;
        let u = optimal_profile(s, eps);
        assert_eq!(u > 0.0, s < 0.0);
        assert!(
            (distance_from_phase_field(u, eps) - s).abs() < 1e-9 * eps,
            "{s}"
        );
    }
    for u in [1.0, 1.5, f64::INFINITY] {
        let depth = distance_from_phase_field(u, eps);
        assert!((-24.6..-24.4).contains(&(depth / eps)), "{depth}");
        assert!((distance_from_phase_field(-u, eps) + depth).abs() < 1e-12 * eps);
    }
    // eps^2 u'^2 = Psi(u): the profile is optimal.
    let step = 1e-6 * eps;
    for s in [-0.05, -0.01, 0.02] {
        let slope =
            (optimal_profile(s + step, eps) - optimal_profile(s - step, eps)) / (2.0 * step);
        let well = 0.5625 * (1.0 - optimal_profile(s, eps).powi(2)).powi(2);
        assert!(relative((eps * slope).powi(2), well) < 1e-7);
    }
}

#[test]
fn exact_radii_solve_their_flows() {
    // dR/dt = -(d-1)/R, and dR/dt = -(d-1)^2 (d-3) / (2 R^3).
    for dimension in [2, 3] {
        let d = dimension as f64;
        let (r, t, dt) = (0.5, 0.01, 1e-6);
        let slope = |radius: fn(f64, f64, usize) -> f64| {
            (radius(r, t + dt, dimension) - radius(r, t - dt, dimension)) / (2.0 * dt)
        };
        let radius = exact::mean_curvature_radius(r, t, dimension);
        let expected = -(d - 1.0) / radius;
        assert!(relative(slope(exact::mean_curvature_radius), expected) < 1e-7);
        let radius = exact::willmore_radius(r, t, dimension);
        let expected = -(d - 1.0).powi(2) * (d - 3.0) / (2.0 * radius.powi(3));
        assert!((slope(exact::willmore_radius) - expected).abs() < 1e-7);
    }
    assert!(exact::mean_curvature_radius(0.2, 0.02, 2).abs() < 1e-8);
    assert_eq!(exact::mean_curvature_radius(0.2, 0.03, 2).to_bits(), 0);
    assert!(relative(exact::willmore_radius(0.5, 0.25, 2), 0.5625_f64.powf(0.25)) < 1e-15);
}

/// The distance a circle travels in 64 steps, against which errors of the schemes are read.
#[test]
fn mean_distance_travelled_by_the_reference_circles() {
    let grid = Grid::<2>::per_unit(128, 2.0).unwrap();
    let eps = 2.0_f64.powi(-6);
    let time = 64.0 * 2.0_f64.powi(-14);
    let disc = |r| phase_field(grid, &Ball::new(ORIGIN, r).unwrap(), eps).unwrap();
    let mean = |radius: fn(f64, f64, usize) -> f64| {
        let distances = (0..30).map(|i| {
            let r = PI * (0.05 + 0.15 * f64::from(i) / 30.0);
            measure::l2_distance(&disc(radius(r, time, 2)), &disc(r)).unwrap()
        });
        distances.sum::<f64>() / 30.0
    };
    let mean_curvature = mean(exact::mean_curvature_radius);
    assert!(
        (0.1325..0.1335).contains(&mean_curvature),
        "{mean_curvature}"
    );
    let willmore = mean(exact::willmore_radius);
    assert!((0.4155..0.4165).contains(&willmore), "{willmore}");
}

#[test]
fn measures_refuse_nonsense() {
    let u = ball::<2>(8, 0.5, 0.2);
    for eps in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let perimeter = measure::perimeter(&u, eps);
        assert!(matches!(perimeter, Err(Error::InvalidParameter { .. })));
    }
    let mut broken = u.clone();
    broken.values_mut()[3] = f64::NAN;
    let checked = broken.check_finite();
    assert!(matches!(checked, Err(Error::NonFinite { index: 3, .. })));
    // A wider check of a combination on a field: the ring between two discs.
    let ring = Ball::new(ORIGIN, 0.6)
        .unwrap()
        .difference(Ball::new(ORIGIN, 0.3).unwrap());
    let ring = phase_field(Grid::centred(128, 2.0).unwrap(), &ring, 1.0 / 32.0).unwrap();
    assert!(relative(measure::zero_set_volume(&ring), PI * 0.27) < 1e-3);
}
