//! Signed distances: against brute force, unit gradients, signs, motions, combinations.

#![allow(clippy::float_cmp, reason = "where equality is asserted, it is exact")]

use geometry::shapes::{Ball, Capsule, Cross, Cuboid, Cylinder, Ellipse, Torus};
use geometry::{Error, Grid, SignedDistance, SignedDistanceExt, phase_field};
use proptest::prelude::*;

type Shape<const D: usize> = Box<dyn SignedDistance<D>>;
type Membership<const D: usize> = Box<dyn Fn([f64; D]) -> bool>;

/// A shape beside an independent definition of its points.
struct Case<const D: usize> {
    name: &'static str,
    shape: Shape<D>,
    contains: Membership<D>,
}

fn case<const D: usize>(
    name: &'static str,
    shape: Result<impl SignedDistance<D> + 'static, Error>,
    contains: impl Fn([f64; D]) -> bool + 'static,
) -> Case<D> {
    let shape = shape.unwrap_or_else(|e| panic!("{name}: {e}"));
    Case {
        name,
        shape: Box::new(shape),
        contains: Box::new(contains),
    }
}

fn squared_distance<const D: usize>(a: [f64; D], b: [f64; D]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// The exact shapes that exist in every dimension. All lie well within the unit ball.
fn generic_cases<const D: usize>() -> Vec<Case<D>> {
    let half: [f64; D] = std::array::from_fn(|axis| 0.5 - 0.12 * axis as f64);
    let centre: [f64; D] = std::array::from_fn(|axis| 0.1 - 0.05 * axis as f64);
    let (start, end) = (half.map(|v| -0.7 * v), centre.map(|v| v + 0.25));
    vec![
        case("ball", Ball::new(centre, 0.4), move |x| {
            squared_distance(x, centre) < 0.16
        }),
        case("cuboid", Cuboid::new(half), move |x| {
            (0..D).all(|i| x[i].abs() < half[i])
        }),
        case("cross", Cross::new(0.6, 0.2), |x| {
            let arm = |k| (0..D).all(|i: usize| x[i].abs() < if i == k { 0.6 } else { 0.2 });
            (0..D).any(arm)
        }),
        case("capsule", Capsule::new(start, end, 0.2), move |x| {
            // The union of balls along the segment.
            (0..=400).any(|k| {
                let t = f64::from(k) / 400.0;
                let centre = std::array::from_fn(|i| start[i] + t * (end[i] - start[i]));
                squared_distance(x, centre) < 0.04
            })
        }),
    ]
}

fn torus() -> Case<3> {
    case("torus", Torus::new(0.5, 0.2), |[x, y, z]| {
        // The quartic x^2 + y^2 + z^2 + R^2 - r^2 < 2 R sqrt(x^2 + y^2), squared.
        let sum = x * x + y * y + z * z + 0.25 - 0.04;
        sum * sum < 4.0 * 0.25 * (x * x + y * y)
    })
}

fn cylinder() -> Case<3> {
    case("cylinder", Cylinder::new(0.5, 0.25), |[x, y, z]| {
        x * x + y * y < 0.25 && z.abs() < 0.25
    })
}

/// Deterministic points in `(-0.8, 0.8)^D`.
fn scattered<const D: usize>(count: usize) -> impl Iterator<Item = [f64; D]> {
    // Multiples of powers of the generalised golden ratio: low discrepancy.
    let ratio: f64 = if D == 2 {
        1.324_717_957_244_746
    } else {
        1.220_744_084_605_759_6
    };
    let mut power = 1.0;
    let steps: [f64; D] = std::array::from_fn(|_| {
        power /= ratio;
        power
    });
    (1..=count).map(move |k| steps.map(|step| 1.6 * ((k as f64 * step).fract() - 0.5)))
}

/// Distance to the nearest lattice point on the other side, for points of both sides.
fn check_against_lattice<const D: usize>(cases: Vec<Case<D>>, cells: usize) {
    const POINTS: usize = 150;
    let lattice = Grid::<D>::centred(cells, 2.0).unwrap();
    let resolution = 2.0 * (D as f64).sqrt() * lattice.spacing();
    for Case {
        name,
        shape,
        contains,
    } in cases
    {
        let nodes: Vec<([f64; D], bool)> = (0..lattice.len())
            .map(|index| {
                let x = lattice.node(index);
                (x, contains(x))
            })
            .collect();
        let mut inside_points = 0;
        for x in scattered::<D>(POINTS) {
            let inside = contains(x);
            inside_points += usize::from(inside);
            let nearest = nodes
                .iter()
                .filter(|(_, other)| *other != inside)
                .map(|&(node, _)| squared_distance(x, node))
                .fold(f64::INFINITY, f64::min)
                .sqrt();
            let distance = shape.signed_distance(x);
            assert_eq!(distance < 0.0, inside, "{name}: sign at {x:?}");
            let gap = nearest - distance.abs();
            // The capsule is tested by balls 0.002 apart, hence the small slack.
            assert!(
                (-1e-4..resolution).contains(&gap),
                "{name}: {distance} {nearest} at {x:?}"
            );
        }
        assert!(inside_points * 40 > POINTS, "{name}: too few points inside");
    }
}

#[test]
fn distances_agree_with_brute_force_in_2d() {
    let mut cases = generic_cases::<2>();
    cases.extend([[0.6, 0.3], [0.2, 0.5], [0.4, 0.4]].map(|[a, b]| {
        case("ellipse", Ellipse::new([a, b]), move |[x, y]| {
            (x / a).hypot(y / b) <= 1.0
        })
    }));
    check_against_lattice(cases, 300);
}

#[test]
fn distances_agree_with_brute_force_in_3d() {
    let mut cases = generic_cases::<3>();
    cases.extend([torus(), cylinder()]);
    check_against_lattice(cases, 64);
}

/// Distance to the segment from `a` to `b`.
fn segment_distance(x: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let t = ((x[0] - a[0]) * dx + (x[1] - a[1]) * dy) / (dx * dx + dy * dy);
    let t = t.clamp(0.0, 1.0);
    squared_distance(x, [a[0] + t * dx, a[1] + t * dy]).sqrt()
}

fn polygon_distance(x: [f64; 2], vertices: &[[f64; 2]]) -> f64 {
    let edges = vertices.iter().zip(vertices.iter().cycle().skip(1));
    edges
        .map(|(&a, &b)| segment_distance(x, a, b))
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn cross_is_the_exact_distance_to_its_polygon() {
    let (a, b) = (0.8, 0.27);
    let quarter = [[a, -b], [a, b], [b, b]];
    let vertices: Vec<[f64; 2]> = (0..4)
        .flat_map(|k| quarter.map(|[x, y]| [[x, y], [-y, x], [-x, -y], [y, -x]][k]))
        .collect();
    let cross = Cross::<2>::new(a, b).unwrap();
    for x in scattered::<2>(4000) {
        let distance = cross.signed_distance(x);
        let expected = polygon_distance(x, &vertices);
        assert!(
            (distance.abs() - expected).abs() < 1e-14,
            "{distance} {expected} at {x:?}"
        );
    }
    // Near the re-entrant corner the minimum over the two boxes is not the distance.
    let x = [0.2, 0.2];
    let corner = (2.0_f64).sqrt() * (b - 0.2);
    assert!((cross.signed_distance(x) + corner).abs() < 1e-15);
    let arm = |half| Cuboid::<2>::new(half).unwrap();
    let union = arm([a, b]).union(arm([b, a]));
    assert!((union.signed_distance(x) + (b - 0.2)).abs() < 1e-15);
}

fn gradient_norm<const D: usize>(shape: &dyn SignedDistance<D>, x: [f64; D]) -> f64 {
    let step = 1e-8;
    let derivative = |axis: usize| {
        let shifted = |by: f64| {
            let mut y = x;
            y[axis] += by;
            shape.signed_distance(y)
        };
        (shifted(step) - shifted(-step)) / (2.0 * step)
    };
    (0..D)
        .map(|axis| derivative(axis).powi(2))
        .sum::<f64>()
        .sqrt()
}

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 200,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn exact_distances_have_unit_gradient(
        x in prop::array::uniform2(-1.0..1.0_f64),
        y in prop::array::uniform3(-1.0..1.0_f64),
    ) {
        for Case { name, shape, .. } in generic_cases::<2>() {
            let norm = gradient_norm(&*shape, x);
            prop_assert!((norm - 1.0).abs() < 1e-6, "{name}: {norm} at {x:?}");
        }
        let mut cases = generic_cases::<3>();
        cases.extend([torus(), cylinder()]);
        for Case { name, shape, .. } in cases {
            let norm = gradient_norm(&*shape, y);
            prop_assert!((norm - 1.0).abs() < 1e-6, "{name}: {norm} at {y:?}");
        }
    }

    /// Bounds never exceed the distance: they are 1-Lipschitz, with the right sign.
    #[test]
    fn combinations_are_lipschitz_with_the_right_sign(
        x in prop::array::uniform2(-1.0..1.0_f64),
        y in prop::array::uniform2(-1.0..1.0_f64),
    ) {
        let a = || Cross::<2>::new(0.6, 0.2).unwrap();
        let b = || Ball::new([0.3, 0.2], 0.35).unwrap();
        let inside = |s: &dyn SignedDistance<2>| s.signed_distance(x) < 0.0;
        let (in_a, in_b) = (inside(&a()), inside(&b()));
        let combinations: [(Shape<2>, bool); 2] = [
            (Box::new(a().union(b())), in_a || in_b),
            (Box::new(a().difference(b())), in_a && !in_b),
        ];
        for (shape, expected) in combinations {
            prop_assert_eq!(inside(&*shape), expected);
            let change = (shape.signed_distance(x) - shape.signed_distance(y)).abs();
            prop_assert!(change <= squared_distance(x, y).sqrt() + 1e-14);
        }
    }

    #[test]
    fn translations_move_the_distance(y in prop::array::uniform3(-1.0..1.0_f64)) {
        let shift = [0.1, -0.2, 0.3];
        let shape = Cuboid::new([0.5, 0.3, 0.2]).unwrap();
        let moved = shape.translated(shift);
        let image = std::array::from_fn(|i| y[i] + shift[i]);
        let (distance, expected) = (moved.signed_distance(image), shape.signed_distance(y));
        prop_assert!((distance - expected).abs() < 1e-14);
    }
}

#[test]
fn closures_are_distances() {
    let grid = Grid::<2>::centred(8, 2.0).unwrap();
    let closure = |x: [f64; 2]| x[0].hypot(x[1]) - 0.5;
    let ball = Ball::new([0.0, 0.0], 0.5).unwrap();
    let a = phase_field(grid, &closure, 0.1).unwrap();
    let b = phase_field(grid, &ball, 0.1).unwrap();
    let mut pairs = a.values().iter().zip(b.values());
    assert!(pairs.all(|(a, b)| (a - b).abs() < 1e-14));
    let dynamic: &dyn SignedDistance<2> = &ball;
    assert_eq!(phase_field(grid, dynamic, 0.1).unwrap(), b);
}

#[test]
fn impossible_shapes_are_refused() {
    let refused = |result: Result<(), Error>| {
        assert!(
            matches!(result, Err(Error::InvalidParameter { .. })),
            "{result:?}"
        );
    };
    refused(Ball::new([0.0, f64::NAN], 1.0).map(drop));
    refused(Ball::new([0.0, 0.0], 0.0).map(drop));
    refused(Cuboid::new([1.0, -1.0]).map(drop));
    refused(Cross::<2>::new(0.2, 0.8).map(drop));
    refused(Ellipse::new([0.2, 0.0]).map(drop));
    refused(Torus::new(0.2, 0.2).map(drop));
    refused(Torus::clifford(f64::INFINITY).map(drop));
    refused(Cylinder::new(0.1, 0.0).map(drop));
}

#[test]
fn undefined_distances_do_not_become_phase_fields() {
    let grid = Grid::<2>::centred(4, 2.0).unwrap();
    let shapes: [Shape<2>; 4] = [
        Box::new(Cuboid::new([0.5, 0.5]).unwrap().translated([f64::NAN, 0.0])),
        Box::new(Cross::new(0.5, 0.2).unwrap().translated([0.0, f64::NAN])),
        Box::new(
            Ball::new([0.0; 2], 0.5)
                .unwrap()
                .union(|_: [f64; 2]| f64::NAN),
        ),
        Box::new((|_: [f64; 2]| f64::NAN).difference(Ball::new([0.0; 2], 0.5).unwrap())),
    ];
    for shape in &shapes {
        let field = phase_field(grid, shape, 0.1);
        assert!(
            matches!(field, Err(Error::NonFinite { index: 0, .. })),
            "{field:?}"
        );
    }
    let ball = Ball::new([0.0; 2], 0.5).unwrap();
    for eps in [0.0, -1.0, f64::NAN] {
        let field = phase_field(grid, &ball, eps);
        assert!(matches!(field, Err(Error::InvalidParameter { .. })));
    }
}
