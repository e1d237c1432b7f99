//! Zero level sets and crossings.

#![allow(clippy::float_cmp, reason = "where equality is asserted, it is exact")]

use std::f64::consts::PI;

use geometry::contour::{Polyline, ray_crossing, zero_level};
use geometry::shapes::{Ball, Cross};
use geometry::{Error, Field, Grid, SignedDistance, SignedDistanceExt, phase_field};

const CENTRE: [f64; 2] = [0.013, -0.021];

fn field(cells: usize, shape: &dyn SignedDistance<2>) -> Field<2> {
    let grid = Grid::centred(cells, 2.0).unwrap();
    phase_field(grid, shape, 2.0 * grid.spacing()).unwrap()
}

fn disc(radius: f64) -> Ball<2> {
    Ball::new(CENTRE, radius).unwrap()
}

fn deviation(curve: &Polyline, shape: &dyn SignedDistance<2>) -> f64 {
    let points = curve.points.iter();
    let distances = points.map(|&p| shape.signed_distance(p).abs());
    distances.max_by(f64::total_cmp).unwrap()
}

#[test]
fn contour_of_a_disc_is_the_circle() {
    let errors = [64, 128, 256].map(|cells| {
        let curves = zero_level(&field(cells, &disc(0.5)));
        assert_eq!(curves.len(), 1);
        let curve = &curves[0];
        assert!(curve.closed);
        // Counter-clockwise, and no point twice.
        assert!(curve.signed_area() > 0.0);
        assert!(curve.segments().all(|(a, b)| a != b));
        [
            deviation(curve, &disc(0.5)),
            (curve.length() - PI).abs(),
            (curve.signed_area() - 0.25 * PI).abs(),
        ]
    });
    for pair in errors.windows(2) {
        for (coarse, fine) in pair[0].iter().zip(pair[1]) {
            let order = (coarse / fine).log2();
            assert!((1.5..2.6).contains(&order), "{errors:?}");
        }
    }
    // The chord of one edge of the grid: h^2 / (8 r).
    assert!(errors[2][0] < (2.0_f64 / 256.0).powi(2) / 4.0, "{errors:?}");
}

/// Behind a line through a point.
fn half_plane(point: [f64; 2], normal: [f64; 2]) -> impl SignedDistance<2> {
    let length = normal[0].hypot(normal[1]);
    move |x: [f64; 2]| ((x[0] - point[0]) * normal[0] + (x[1] - point[1]) * normal[1]) / length
}

#[test]
fn interpolation_in_the_profile_variable_is_exact_for_lines() {
    let grid = Grid::<2>::centred(64, 2.0).unwrap();
    let line = half_plane(CENTRE, [1.0, 0.4]);
    let u = phase_field(grid, &line, grid.spacing()).unwrap();
    let deviation = deviation(&zero_level(&u)[0], &line);
    assert!(deviation < 1e-12, "{deviation}");
}

#[test]
fn holes_run_clockwise_and_parts_are_separate() {
    let ring = disc(0.6).difference(disc(0.3));
    let curves = zero_level(&field(128, &ring));
    assert_eq!(curves.len(), 2);
    let mut areas: Vec<f64> = curves.iter().map(Polyline::signed_area).collect();
    areas.sort_by(f64::total_cmp);
    assert!((areas[0] + PI * 0.09).abs() < 1e-3, "{areas:?}");
    assert!((areas[1] - PI * 0.36).abs() < 1e-3, "{areas:?}");
}

#[test]
fn curves_end_at_the_border_of_the_picture() {
    let half_plane = half_plane([0.1, 0.0], [1.0, 0.5]);
    let curves = zero_level(&field(32, &half_plane));
    assert_eq!(curves.len(), 1);
    let curve = &curves[0];
    assert!(!curve.closed);
    assert!(deviation(curve, &half_plane) < 1e-9);
    // Inside on the left: with the inside at smaller x the curve runs upwards.
    let (first, last) = (curve.points[0], curve.points[curve.points.len() - 1]);
    assert!((first[1] + 1.0).abs() < 1e-14 && (last[1] - (1.0 - 2.0 / 32.0)).abs() < 1e-14);
}

#[test]
fn saddles_follow_the_mean_of_the_corners() {
    let corners = |opposite: f64| {
        // Inside at (1,1) and (2,2) of a 4 x 4 grid.
        let mut values = vec![-0.1; 16];
        values[5] = opposite;
        values[10] = opposite;
        let grid = Grid::<2>::new(4, 4.0).unwrap();
        zero_level(&Field::from_values(grid, values).unwrap())
    };
    assert_eq!(corners(0.05).len(), 2);
    let joined = corners(0.2);
    assert_eq!(joined.len(), 1);
    assert!(joined[0].closed && joined[0].signed_area() > 0.0);
}

#[test]
fn nodes_on_the_interface_give_no_double_points() {
    // A diamond through nodes: u = 0 exactly there.
    let grid = Grid::<2>::new(9, 9.0).unwrap();
    let u = Field::from_fn(grid, |[x, y]| 2.0 - (x - 4.0).abs() - (y - 4.0).abs());
    let curves = zero_level(&u);
    assert_eq!(curves.len(), 1);
    assert!((curves[0].signed_area() - 8.0).abs() < 1e-14);
    assert!((curves[0].length() - 8.0 * 2.0_f64.sqrt()).abs() < 1e-13);
    assert!(curves[0].segments().all(|(a, b)| a != b));
    // Nothing to find.
    assert_eq!(zero_level(&Field::constant(grid, 0.0)), []);
}

#[test]
fn rays_find_the_interface() {
    // Along a grid line through the end of a flat arm the distance is linear: exact.
    let cross = Cross::new(0.8, 0.27).unwrap();
    let u = field(128, &cross);
    let tip = ray_crossing(&u, [0.0, 0.0], [3.0, 0.0]).unwrap().unwrap();
    assert!((tip - 0.8).abs() < 1e-9, "{tip}");
    let side = ray_crossing(&u, [-0.5, 0.0], [0.0, -1.0]).unwrap().unwrap();
    assert!((side - 0.27).abs() < 1e-9, "{side}");
    // From next to a node, close to the interface.
    for shift in [-1e-15, 1e-15] {
        let from = [100.0 / 128.0 + shift, 0.0];
        let tip = ray_crossing(&u, from, [1.0, 0.0]).unwrap().unwrap();
        assert!((from[0] + tip - 0.8).abs() < 1e-9, "{tip}");
    }
    // From outside inwards.
    let back = ray_crossing(&u, [-0.95, 0.0], [1.0, 0.0]).unwrap().unwrap();
    assert!((back - 0.15).abs() < 1e-9, "{back}");
    // A corner on the ray, wherever it lies between the nodes.
    for cells in [64, 100, 128, 256] {
        let u = field(cells, &cross);
        let corner = ray_crossing(&u, [0.0, 0.0], [1.0, 1.0]).unwrap().unwrap();
        assert!((corner - 0.27 * 2.0_f64.sqrt()).abs() < 1e-9, "{corner}");
    }
    // Oblique, second order.
    let angle = 0.7_f64;
    let error = |cells| {
        let u = field(cells, &disc(0.5));
        let found = ray_crossing(&u, CENTRE, [angle.cos(), angle.sin()])
            .unwrap()
            .unwrap();
        (found - 0.5).abs()
    };
    for cells in [64, 128, 256] {
        let h = 2.0 / cells as f64;
        assert!(error(cells) < h * h, "{cells}");
    }
    // Along a diagonal through nodes of any profile, third order.
    let error = |cells| {
        let grid = Grid::<2>::centred(cells, 2.0).unwrap();
        let u = Field::from_fn(grid, |[x, y]| ((0.5 - (x * x + 1.5 * y * y)) * 4.0).tanh());
        let found = ray_crossing(&u, [0.0, 0.0], [1.0, 1.0]).unwrap().unwrap();
        (found - 0.4_f64.sqrt()).abs()
    };
    for cells in [50, 100, 200, 400] {
        let h = 2.0 / cells as f64;
        assert!(error(cells) < 6.0 * h.powi(3), "{cells}: {}", error(cells));
    }
    // In space.
    let grid = Grid::<3>::centred(48, 2.0).unwrap();
    let ball = phase_field(
        grid,
        &Ball::new([0.0; 3], 0.6).unwrap(),
        2.0 * grid.spacing(),
    )
    .unwrap();
    let found = ray_crossing(&ball, [0.0; 3], [1.0, 1.0, 1.0])
        .unwrap()
        .unwrap();
    assert!((found - 0.6).abs() < 2e-3, "{found}");
}

#[test]
fn rays_report_what_they_do_not_find() {
    let u = field(32, &disc(0.5));
    assert_eq!(ray_crossing(&u, [-0.9, -0.9], [1.0, 0.0]).unwrap(), None);
    // A start in the last corner, with nowhere to go.
    assert_eq!(ray_crossing(&u, [-1.0, -1.0], [-1.0, -1.0]).unwrap(), None);
    let outside = ray_crossing(&u, [1.5, 0.0], [1.0, 0.0]);
    assert!(matches!(outside, Err(Error::PointOutside { .. })));
    for (start, direction) in [
        ([0.0, 0.0], [0.0, 0.0]),
        ([0.0, f64::NAN], [1.0, 0.0]),
        ([0.0, 0.0], [f64::NAN, 1.0]),
    ] {
        let result = ray_crossing(&u, start, direction);
        assert!(
            matches!(result, Err(Error::InvalidParameter { .. })),
            "{result:?}"
        );
    }
}

#[test]
fn lattices_need_be_neither_square_nor_even() {
    // A disc on a lattice whose second axis gets coarser upwards.
    let coordinates: [Vec<f64>; 2] = [
        (0..=40)
            .map(|i| -1.0 + 0.05 * f64::from(i))
            .collect::<Vec<f64>>(),
        (0..=25)
            .map(|j| -1.0 + 0.0032 * f64::from(j * j))
            .collect::<Vec<f64>>(),
    ];
    let at = |node: [usize; 2]| [0, 1].map(|axis| coordinates[axis][node[axis]]);
    let curves = geometry::contour::zero_level_of(
        [41, 26],
        |node| {
            let [x, y] = at(node);
            0.6 - x.hypot(y)
        },
        |node, axis, [a, b]| {
            let mut point = at(node);
            let step = coordinates[axis][node[axis] + 1] - point[axis];
            point[axis] += step * a / (a - b);
            point
        },
    );
    assert_eq!(curves.len(), 1);
    assert!(curves[0].closed);
    for point in &curves[0].points {
        assert!((point[0].hypot(point[1]) - 0.6).abs() < 0.01, "{point:?}");
    }
    let area = curves[0].signed_area();
    assert!((area - 0.36 * std::f64::consts::PI).abs() < 0.01, "{area}");
}
