//! Measures of the zero set against exact values, their derivatives, and where they do not hold.

use std::f64::consts::PI;

use geometry::shapes::{Ball, Cuboid, Ellipse, Torus};
use geometry::zero_set::{Sizes, ball_perimeter, reduced_volume};
use geometry::{
    Error, Field, Grid, SignedDistance, SignedDistanceExt, ZeroSet, exact, phase_field,
};
use rayon::ThreadPoolBuilder;

/// At 64 cells per unit length and `eps = 2h`.
fn measured<const D: usize>(side: f64, shape: &impl SignedDistance<D>) -> ZeroSet {
    let grid = Grid::<D>::per_unit(64, side).unwrap();
    let eps = 2.0 * grid.spacing();
    ZeroSet::of(&phase_field(grid, shape, eps).unwrap(), eps).unwrap()
}

/// More threads than cores, so that some take up the work of others while they wait. If they wait for each other, this test does not end.
#[test]
fn many_threads_measure_the_same() {
    let pool = ThreadPoolBuilder::new().num_threads(8).build().unwrap();
    let ball = Ball::new([0.0; 3], 0.3).unwrap();
    let alone = measured(1.0, &ball);
    for _ in 0..10 {
        assert_eq!(pool.install(|| measured(1.0, &ball)), alone);
    }
}

/// Perimeter, volume and integrals of k and k^2/2 of the spheroid by the midpoint rule on its profile (spectral in the angle).
fn spheroid(a: f64, c: f64) -> [f64; 4] {
    let n = 20_000;
    let mut sums = [0.0; 4];
    for i in 0..n {
        let t = PI * (f64::from(i) + 0.5) / f64::from(n);
        let (s, co) = t.sin_cos();
        let speed = (a * a * co * co + c * c * s * s).sqrt();
        let area = 2.0 * PI * a * s * speed * PI / f64::from(n);
        let k = a * c / speed.powi(3) + c / (a * speed);
        sums[0] += area;
        sums[2] += k * area;
        sums[3] += 0.5 * k * k * area;
    }
    sums[1] = 4.0 / 3.0 * PI * a * a * c;
    sums
}

fn ellipse(a: f64, b: f64) -> [f64; 4] {
    let n = 2000;
    let mut sums = [0.0, PI * a * b, 2.0 * PI, 0.0];
    for i in 0..n {
        let (s, c) = (2.0 * PI * f64::from(i) / f64::from(n)).sin_cos();
        let speed = (a * a * s * s + b * b * c * c).sqrt();
        let length = speed * 2.0 * PI / f64::from(n);
        sums[0] += length;
        sums[3] += 0.5 * (a * b / speed.powi(3)).powi(2) * length;
    }
    sums
}

fn close(found: &ZeroSet, exact: [f64; 4]) {
    let values = [
        found.perimeter,
        found.volume,
        found.mean_curvature,
        found.willmore_energy,
    ];
    for ((value, exact), bound) in values.iter().zip(exact).zip([1e-6, 1e-8, 1e-5, 5e-4]) {
        assert!(
            (value / exact - 1.0).abs() < bound,
            "{value} {exact}: {found:?}"
        );
    }
    assert!(found.sizes_hold(), "{found:?}");
}

#[test]
fn spheres_and_discs() {
    for radius in [0.17, 0.25, 0.3] {
        let sphere = Ball::new([0.003, 0.005, 0.002], radius).unwrap();
        let exact = [
            4.0 * PI * radius * radius,
            4.0 / 3.0 * PI * radius.powi(3),
            8.0 * PI * radius,
            exact::WILLMORE_ENERGY_SPHERE,
        ];
        close(&measured(1.0, &sphere), exact);
        let disc = Ball::new([0.003, 0.005], radius).unwrap();
        let exact = [
            2.0 * PI * radius,
            PI * radius * radius,
            2.0 * PI,
            PI / radius,
        ];
        close(&measured(1.0, &disc), exact);
    }
}

#[test]
fn spheroids_ellipses_and_a_torus() {
    for [a, c] in [[0.3, 0.2], [0.2, 0.3]] {
        let profile = Ellipse::new([a, c]).unwrap();
        // The distance of an ellipsoid of revolution is that of the ellipse which is its profile.
        let about_z = |[x, y, z]: [f64; 3]| profile.signed_distance([x.hypot(y), z]);
        close(&measured::<3>(1.0, &about_z), spheroid(a, c));
        close(&measured(1.0, &profile), ellipse(a, c));
    }
    let (major, minor) = (0.32, 0.17);
    let torus = measured(1.25, &Torus::new(major, minor).unwrap());
    let area = 4.0 * PI * PI * major * minor;
    let squared = (major / minor).powi(2);
    let energy = 2.0 * PI * PI * squared / (squared - 1.0).sqrt();
    close(&torus, [area, 0.5 * area * minor, area / minor, energy]);
}

#[test]
fn what_bends_too_sharply_is_said_to() {
    let disc = measured(1.0, &Ball::new([0.003, 0.005], 0.25).unwrap());
    assert!(disc.curvatures_hold(), "{disc:?}");
    assert!((disc.smallest_radius - 16.0).abs() < 0.6, "{disc:?}");
    assert!((disc.slope - 1.0).abs() < 0.01, "{disc:?}");
    // Sizes hold for longer than curvatures.
    let small = measured(1.0, &Ball::new([0.003, 0.005], 0.1).unwrap());
    assert!(small.sizes_hold() && !small.curvatures_hold(), "{small:?}");
    assert!((small.perimeter / (0.2 * PI) - 1.0).abs() < 1e-5);
    let corners = measured(1.0, &Cuboid::new([0.3, 0.2]).unwrap());
    let edges = measured(1.0, &Cuboid::new([0.3, 0.2, 0.25]).unwrap());
    let sheet = measured(1.0, &Ellipse::new([0.3, 0.06]).unwrap());
    let near = |x: f64| Ball::new([x, 0.0], 0.15).unwrap();
    let contact = measured(1.0, &near(-0.17).union(near(0.17)));
    for shape in [corners, edges, sheet, contact] {
        assert!((shape.slope - 1.0).abs() < 0.2, "{shape:?}");
        assert!(!shape.sizes_hold() && !shape.curvatures_hold(), "{shape:?}");
    }
}

#[test]
fn no_zero_set_has_no_size() {
    let grid = Grid::<2>::new(16, 2.0).unwrap();
    for (value, volume) in [(-1.0, 0.0), (1.0, 4.0)] {
        let found = ZeroSet::of(&Field::constant(grid, value), 0.25).unwrap();
        let sums = [
            found.perimeter,
            found.mean_curvature,
            found.willmore_energy,
            found.spread,
        ];
        assert!(sums.iter().all(|sum| sum.to_bits() == 0), "{found:?}");
        assert!((found.volume - volume).abs() < 1e-14);
        assert!(found.smallest_radius.is_infinite());
    }
    let u = Field::constant(grid, 0.0);
    for eps in [0.0, f64::NAN] {
        let found = ZeroSet::of(&u, eps);
        assert!(matches!(found, Err(Error::InvalidParameter { .. })));
    }
    let broken = ZeroSet::of(&u.map(|_| f64::NAN), 0.25);
    assert!(matches!(broken, Err(Error::NonFinite { .. })));
}

#[test]
fn reduced_volumes_are_one_for_balls() {
    assert!((reduced_volume(2, 2.0 * PI * 0.3, PI * 0.09) - 1.0).abs() < 1e-14);
    assert!((reduced_volume(3, 4.0 * PI * 0.09, 4.0 / 3.0 * PI * 0.027) - 1.0).abs() < 1e-14);
    // A cube: 6 sqrt(pi) / 6^(3/2).
    let cube = (PI / 6.0).sqrt();
    assert!((reduced_volume(3, 6.0, 1.0) - cube).abs() < 1e-14);
    assert!((ball_perimeter(3, 1.0) - 6.0 * cube.powf(2.0 / 3.0)).abs() < 1e-13);
}

/// A phase field that is no exact profile, and a direction in which noise moves its interface and bends its profile.
fn perturbed<const D: usize>() -> Probe<D> {
    let grid = Grid::<D>::centred(32, 1.0).unwrap();
    let eps = 2.0 * grid.spacing();
    let wave = |x: [f64; D], k: f64| {
        x.iter()
            .enumerate()
            .map(|(i, x)| (k * x + i as f64).sin())
            .sum::<f64>()
    };
    let ball = Ball::new([0.01; D], 0.27).unwrap();
    let u = phase_field(grid, &ball, eps).unwrap();
    let bend = Field::from_fn(grid, |x| 0.05 * wave(x, 14.0));
    let u = u.zip_map(&bend, |u, b| u + b * (1.0 - u * u)).unwrap();
    let noise = Field::from_fn(grid, |x| (1e4 * wave(x, 97.0)).sin() + wave(x, 7.0));
    let p = u.zip_map(&noise, |u, b| b * (1.0 - u * u)).unwrap();
    Probe {
        u,
        p: p.into_values(),
        eps,
        step: 0.01,
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A phase field and a direction in which its derivatives are tested.
struct Probe<const D: usize> {
    u: Field<D>,
    p: Vec<f64>,
    eps: f64,
    /// The longest motion, as a multiple of `p`.
    step: f64,
}

/// Remainders of first and second order fall by four and by eight when the step is halved, and products are differences of gradients.
fn taylor<const D: usize>(Probe { u, p, eps, step }: Probe<D>) {
    let moved = |t: f64| {
        let values = u.values().iter().zip(&p).map(|(u, p)| u + t * p).collect();
        Sizes::of(&Field::from_values(*u.grid(), values).unwrap(), eps).unwrap()
    };
    for weights in [[1.0, 0.0], [0.0, 1.0], [0.7, -2.0]] {
        let value = |s: &Sizes<D>| weights[0] * s.perimeter() + weights[1] * s.volume();
        let at = moved(0.0);
        let combined: Vec<f64> = (at.perimeter_gradient().iter())
            .zip(at.volume_gradient())
            .map(|(perimeter, volume)| weights[0] * perimeter + weights[1] * volume)
            .collect();
        let (start, slope) = (value(&at), dot(&combined, &p));
        let hessian = at.second_derivative(weights);
        let product = |p: &[f64]| {
            let mut product = vec![0.0; p.len()];
            hessian.multiply(|node| p[node], |node, value| product[node] = value);
            product
        };
        let curvature = dot(&p, &product(&p));
        let remainders = [step, 0.5 * step, 0.25 * step].map(|t| {
            let first = value(&moved(t)) - start - t * slope;
            [first, first - 0.5 * t * t * curvature]
        });
        for pair in remainders.windows(2) {
            for (order, least) in [1.9, 2.8].into_iter().enumerate() {
                let rate = (pair[0][order] / pair[1][order]).abs().log2();
                assert!(
                    rate > least,
                    "{D}D {weights:?} order {order}: {rate} of {remainders:?}"
                );
            }
        }
        // Second derivatives leave out what is far from the zero set.
        let [ahead, behind] = [1e-4, -1e-4].map(|t| {
            let at = moved(t);
            let pairs = at
                .perimeter_gradient()
                .into_iter()
                .zip(at.volume_gradient());
            let sum =
                |(perimeter, volume): (f64, f64)| weights[0] * perimeter + weights[1] * volume;
            pairs.map(sum).collect::<Vec<f64>>()
        });
        let (mut error, mut whole) = (0.0, 0.0);
        // By displacements of the interface, which are the motions over 1 - u^2.
        let products = product(&p).into_iter().zip(u.values());
        for ((ahead, behind), (product, u)) in ahead.iter().zip(&behind).zip(products) {
            let well = 1.0 - u * u;
            let difference = (ahead - behind) / 2e-4;
            error += (well * (difference - product)).powi(2);
            whole += (well * difference).powi(2);
        }
        assert!(
            error < 4e-8 * whole,
            "{D}D {weights:?}: products differ by {}",
            (error / whole).sqrt()
        );
        let q: Vec<f64> = p
            .iter()
            .enumerate()
            .map(|(i, p)| p * (i as f64).cos())
            .collect();
        let (one, other) = (dot(&q, &product(&p)), dot(&p, &product(&q)));
        assert!(
            (one - other).abs() < 1e-12 * one.abs().max(curvature.abs()),
            "{one} {other}"
        );
    }
}

#[test]
fn derivatives_of_the_sizes_pass_taylor_tests() {
    taylor(perturbed::<2>());
    taylor(perturbed::<3>());
}

/// A plate with holes no wider than the kernel and a gap, in the middle of which the distance variable has a maximum or a minimum: one hole has its middle on
/// a node. The direction widens and narrows them.
fn narrow<const D: usize>() -> Probe<D> {
    let grid = Grid::<D>::centred(32, 1.0).unwrap();
    let h = grid.spacing();
    let eps = 2.0 * h;
    let middle = grid.node(grid.index([16; D]));
    let shape = |x: [f64; D]| {
        // Smooth, so that the distance variable is flat in the middle.
        let depth = |square: f64, radius: f64| radius + 2.0 * h - (square + 4.0 * h * h).sqrt();
        let hole = |shift: f64, radius: f64| {
            let from = |axis: usize| x[axis] - middle[axis] - if axis == 0 { shift } else { 0.0 };
            depth((0..D).map(|axis| from(axis).powi(2)).sum(), radius)
        };
        let gap = depth((x[D - 1] - 0.2).powi(2), h);
        let plate = x.iter().map(|x| x * x).sum::<f64>().sqrt() - 0.4;
        let holes = [hole(0.0, 1.2 * h), hole(0.2, 1.8 * h), hole(-0.21, 0.4 * h)];
        holes.into_iter().chain([gap]).fold(plate, f64::max)
    };
    let u = phase_field(grid, &shape, eps).unwrap();
    let bend = Field::from_fn(grid, |x| {
        let waves = x
            .iter()
            .zip(0..)
            .map(|(x, i)| (31.0 * x + f64::from(i)).sin());
        0.3 + 0.2 * waves.sum::<f64>()
    });
    let p = u.zip_map(&bend, |u, b| b * (1.0 - u * u)).unwrap();
    Probe {
        u,
        p: p.into_values(),
        eps,
        step: 0.01,
    }
}

/// The norm of the gradient has no derivative where it is zero; the perimeter has two.
#[test]
fn derivatives_of_the_sizes_pass_taylor_tests_in_narrow_holes() {
    fn flat<const D: usize>(Probe { u, eps, .. }: &Probe<D>) -> usize {
        let (grid, values) = (u.grid(), u.values());
        let distance = |node: usize| geometry::distance_from_phase_field(values[node], *eps);
        (0..grid.len())
            .filter(|node| {
                let steepness = (0..D).map(|axis| {
                    let beside = |steps: usize| {
                        let mut place = grid.multi_index(*node);
                        place[axis] = (place[axis] + steps) % grid.cells();
                        distance(grid.index(place))
                    };
                    ((beside(1) - beside(grid.cells() - 1)) / (2.0 * grid.spacing())).powi(2)
                });
                distance(*node).abs() < 2.0 * grid.spacing() && steepness.sum::<f64>() < 0.16
            })
            .count()
    }
    // Nodes within the kernel where the norm is below .4.
    assert!(flat(&narrow::<2>()) > 3 && flat(&narrow::<3>()) > 3);
    taylor(narrow::<2>());
    taylor(narrow::<3>());
}

#[test]
fn gradients_of_the_sizes_are_those_of_a_moving_interface() {
    // d(perimeter) = int k v, d(volume) = int v for the normal velocity v = 1: motion 3 q / (4 eps).
    let grid = Grid::<3>::per_unit(64, 1.0).unwrap();
    let (eps, radius) = (2.0 * grid.spacing(), 0.25);
    let u = phase_field(
        grid,
        &Ball::new([0.003, 0.005, 0.002], radius).unwrap(),
        eps,
    )
    .unwrap();
    let sizes = Sizes::of(&u, eps).unwrap();
    let outwards: Vec<f64> = (u.values().iter())
        .map(|u| 0.75 / eps * (1.0 - u * u))
        .collect();
    let area = 4.0 * PI * radius * radius;
    let volume = dot(&sizes.volume_gradient(), &outwards);
    let perimeter = dot(&sizes.perimeter_gradient(), &outwards);
    assert!((volume / area - 1.0).abs() < 1e-6, "{volume} {area}");
    assert!(
        (perimeter / (area * 2.0 / radius) - 1.0).abs() < 1e-5,
        "{perimeter}"
    );
    let curvature = sizes.mean_curvature();
    let mut near = 0;
    for (node, k) in curvature.iter().enumerate().filter(|(_, k)| **k != 0.0) {
        let distance = -4.0 / 3.0 * eps * u.values()[node].atanh();
        if distance.abs() < 3.0 * grid.spacing() {
            near += 1;
            assert!(
                (k * (radius + distance) / 2.0 - 1.0).abs() < 1e-3,
                "{k} at {distance}"
            );
        }
    }
    // A shell of six cells, in cells.
    let shell = area / grid.spacing().powi(2) * 6.0;
    assert!(
        (f64::from(near) / shell - 1.0).abs() < 0.05,
        "{near} {shell}"
    );
}
