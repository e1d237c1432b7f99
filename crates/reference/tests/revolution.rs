//! Surfaces of revolution.

use std::f64::consts::{PI, SQRT_2};

use reference::revolution::{ACCURACY, Surface, evolve};
use reference::{Accuracy, Error, Flow, Shape};

use crate::finite_differences::{self, Axis};
use crate::largest_difference;

fn measures(surface: &Surface) -> [f64; 5] {
    let pole = surface.poles().map_or(0.0, |poles| poles[1]);
    [
        surface.equator(),
        pole,
        surface.area(),
        surface.volume(),
        surface.energy(),
    ]
}

fn sphere(radius: f64) -> [f64; 5] {
    [
        radius,
        radius,
        4.0 * PI * radius * radius,
        4.0 / 3.0 * PI * radius.powi(3),
        8.0 * PI,
    ]
}

#[test]
fn spheres_keep_to_their_solutions() {
    let shape = Shape::circle([0.0, 0.0], 0.5).unwrap();
    for (flow, radius) in [
        (Flow::Willmore, 0.5),
        (Flow::MeanCurvature, 0.05_f64.sqrt()),
    ] {
        let surface = &evolve(&shape, flow, &[0.01, 0.05], &ACCURACY).unwrap()[1];
        assert!(largest_difference(measures(surface), sphere(radius)) < 1e-6);
        assert!((surface.mean_curvature() - 8.0 * PI * radius).abs() < 1e-6);
        assert!((surface.reduced_volume() - 1.0).abs() < 1e-10);
    }
}

#[test]
fn the_clifford_torus_stands_still() {
    let shape = Shape::circle([SQRT_2 * 0.3, 0.1], 0.3).unwrap();
    let surface = &evolve(&shape, Flow::Willmore, &[0.01], &ACCURACY).unwrap()[0];
    let exact = [
        0.3 * (SQRT_2 + 1.0),
        0.0,
        4.0 * PI * PI * 0.09 * SQRT_2,
        2.0 * PI * PI * 0.027 * SQRT_2,
        4.0 * PI * PI,
    ];
    assert!(largest_difference(measures(surface), exact) < 1e-8);
    assert_eq!(surface.poles(), None);
}

#[test]
fn an_independent_method_agrees() {
    let ellipse = |angle: f64| finite_differences::ellipse(0.8, 1.2)(angle);
    let egg = |angle: f64| 1.0 + 0.1 * angle.sin() + 0.1 * (2.0 * angle).cos();
    let circle = |_: f64| 1.0;
    // The last is a torus.
    let cases: [(&dyn Fn(f64) -> f64, f64); 3] = [(&ellipse, 0.0), (&egg, 0.0), (&circle, 2.0)];
    for (radius, shift) in cases {
        let [right, top] = finite_differences::willmore(radius, Axis::At(-shift), 0.006);
        let points = finite_differences::points(radius).map(|[x, y]| [x + shift, y]);
        let shape = Shape::smooth(&points).unwrap();
        let surface = &evolve(&shape, Flow::Willmore, &[0.006], &ACCURACY).unwrap()[0];
        let error = surface
            .profile()
            .largest_distance_of(&[[shift + right, 0.0], [shift, top]]);
        assert!(error < 1e-5, "{error:e}");
    }
}

/// Times of 2^-18, as in the experiment with this disk.
#[test]
fn the_thick_disk_converges() {
    let disk = Shape::rectangle(0.29, 0.1).unwrap();
    let times = [1.0, 5.0, 100.0].map(|k| k / 262144.0);
    let run = |rounding: f64| {
        let accuracy = Accuracy {
            rounding,
            tolerance: 10.0 * ACCURACY.tolerance,
        };
        let surfaces = evolve(&disk, Flow::Willmore, &times, &accuracy).unwrap();
        surfaces.iter().map(measures).collect::<Vec<_>>()
    };
    let default = run(ACCURACY.rounding);
    assert!((default[2][4] - 25.17588).abs() < 1e-4, "{}", default[2][4]);
    for (a, b) in default.iter().zip(run(ACCURACY.rounding / 1.6)) {
        assert!(largest_difference(*a, b) < 2e-5, "{a:?} {b:?}");
    }
}

#[test]
fn smaller_tolerances_give_smaller_errors() {
    let torus = Shape::circle([0.5, 0.0], 0.2).unwrap();
    let ellipsoid = Shape::ellipse(0.3, 0.2).unwrap();
    for shape in [torus, ellipsoid] {
        let run = |tolerance: f64| {
            let accuracy = Accuracy {
                tolerance,
                ..ACCURACY
            };
            measures(&evolve(&shape, Flow::Willmore, &[0.001], &accuracy).unwrap()[0])
        };
        let exact = run(1e-11);
        let errors = [1e-7, 1e-9].map(|tolerance| largest_difference(run(tolerance), exact));
        assert!(
            errors[0] < 1e-5 && errors[1] < errors[0] / 10.0,
            "{errors:?}"
        );
    }
}

#[test]
fn profiles_across_the_axis_are_refused() {
    let shape = Shape::circle([0.1, 0.0], 0.5).unwrap();
    assert_eq!(
        evolve(&shape, Flow::Willmore, &[0.1], &ACCURACY).err(),
        Some(Error::NoProfile)
    );
}
