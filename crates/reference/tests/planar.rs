//! Plane curves.

use std::f64::consts::{PI, TAU};

use reference::planar::{ACCURACY, evolve};
use reference::{Accuracy, Curve, Error, Flow, Shape};

use crate::finite_differences::{self, Axis};
use crate::{largest_difference, measures};

const STEPS: [f64; 3] = [8.0, 32.0, 128.0];

/// A curve after this time of Willmore flow.
fn willmore(shape: &Shape, time: f64) -> Curve {
    evolve(shape, Flow::Willmore, &[time], &ACCURACY)
        .unwrap()
        .remove(0)
}

#[test]
fn circles_keep_to_their_solutions() {
    let circle = Shape::circle([0.3, -0.2], 0.5).unwrap();
    for (flow, radius) in [
        (Flow::Willmore, (0.0625_f64 + 0.1).powf(0.25)),
        (Flow::MeanCurvature, 0.15_f64.sqrt()),
    ] {
        let curve = &evolve(&circle, flow, &[0.01, 0.05], &ACCURACY).unwrap()[1];
        let [area, length] = [PI * radius * radius, TAU * radius];
        let error =
            largest_difference(measures(curve), [radius, radius, area, length, PI / radius]);
        assert!(error < 1e-9, "{error:e}");
        assert!(largest_difference(curve.centre(), [0.3, -0.2]) < 1e-12);
    }
}

#[test]
fn the_oval_of_angenent_shrinks_as_it_does() {
    // cosh x = e^-t cos y, until t = 0.
    let start = -1.5_f64;
    let point = |i: usize| {
        // A parameter that spreads the points over tips and sides: cosh x = 1 + (e^-t - 1) sin^2.
        let (sin, cos) = (TAU * f64::from(i as u32) / 256.0).sin_cos();
        let height = ((-start).exp() - 1.0) * sin * sin;
        let x = (height + (height * (height + 2.0)).sqrt())
            .ln_1p()
            .copysign(sin);
        let y = ((1.0 + height) * start.exp()).min(1.0).acos().copysign(cos);
        [x, y]
    };
    let points: Vec<_> = (0..256).map(point).collect();
    let shape = Shape::smooth(&points).unwrap();
    for curve in evolve(&shape, Flow::MeanCurvature, &[0.25, 0.75, 1.25], &ACCURACY).unwrap() {
        let t = start + curve.time();
        assert!(
            (curve.area() + TAU * t).abs() < 1e-8,
            "area {:e}",
            curve.area() + TAU * t
        );
        let off = |p: &[f64; 2]| {
            let gradient = p[0].sinh().hypot((-t).exp() * p[1].sin());
            ((p[0].cosh() - (-t).exp() * p[1].cos()) / gradient).abs()
        };
        let largest = curve.points().iter().map(off).fold(0.0, f64::max);
        assert!(largest < 1e-8, "{largest:e} off the oval at {t}");
    }
}

#[test]
fn curve_shortening_of_polygons_loses_their_area_at_the_same_rate() {
    let triangle = vec![[0.0, 0.0], [1.0, 0.1], [0.3, 0.8]];
    let shapes = [
        (Shape::rectangle(0.4, 0.3).unwrap(), 0.48),
        (
            Shape::cross(0.8, 0.27).unwrap(),
            4.0 * 0.27 * (2.0 * 0.8 - 0.27),
        ),
        (Shape::polygon(triangle).unwrap(), (0.8 - 0.03) / 2.0),
    ];
    for (shape, area) in shapes {
        let curves = evolve(&shape, Flow::MeanCurvature, &[0.001, 0.02], &ACCURACY).unwrap();
        for curve in curves {
            let error = curve.area() - (area - TAU * curve.time());
            assert!(error.abs() < 1e-9, "area off by {error:e}");
        }
    }
}

/// Rounding of the corners, tolerance and modes, each finer.
#[test]
fn cross_and_rectangle_converge() {
    for shape in [Shape::cross(0.8, 0.27), Shape::rectangle(0.2, 0.1)].map(Result::unwrap) {
        let times = STEPS.map(|k| k / 16384.0);
        let run = |rounding: f64, tolerance: f64| {
            let accuracy = Accuracy {
                rounding,
                tolerance,
            };
            let curves = evolve(&shape, Flow::Willmore, &times, &accuracy).unwrap();
            curves.iter().map(measures).collect::<Vec<_>>()
        };
        let default = run(ACCURACY.rounding, ACCURACY.tolerance);
        for (finer, bound) in [
            (run(ACCURACY.rounding / 4.0, ACCURACY.tolerance), 1e-8),
            (run(ACCURACY.rounding, 1e-12), 3e-8),
        ] {
            for (a, b) in default.iter().zip(finer) {
                assert!(largest_difference(*a, b) < bound, "{a:?} {b:?}");
            }
        }
    }
}

/// A corner of the same polygon given as a smooth curve, rounded by circles whose radius goes to zero.
#[test]
fn corners_are_the_limit_of_rounded_ones() {
    let (half, time) = (0.5_f64, 0.002);
    let exact = measures(&willmore(&Shape::rectangle(half, half).unwrap(), time));
    // The superellipse x^p + y^p = half^p tends to the square; its corners are cut by half (1 - 2^(-1/p)) sqrt 2.
    let errors = [16.0, 32.0].map(|power: f64| {
        let point = |i: usize| {
            let (sin, cos) = (TAU * i as f64 / 1024.0).sin_cos();
            let norm = (sin.abs().powf(power) + cos.abs().powf(power)).powf(1.0 / power);
            [half * cos / norm, half * sin / norm]
        };
        let shape = Shape::smooth(&(0..1024).map(point).collect::<Vec<_>>()).unwrap();
        largest_difference(measures(&willmore(&shape, time)), exact)
    });
    assert!(
        errors[1] < 1e-2 && errors[0] > 2.5 * errors[1],
        "{errors:?}"
    );
}

#[test]
fn an_independent_method_agrees() {
    // The second has no symmetry, so that its centre moves.
    let ellipse = |angle: f64| finite_differences::ellipse(1.2, 0.8)(angle);
    let egg = |angle: f64| 1.0 + 0.1 * angle.cos() + 0.1 * (2.0 * angle).sin();
    let radii: [&dyn Fn(f64) -> f64; 2] = [&ellipse, &egg];
    for radius in radii {
        let [right, top] = finite_differences::willmore(radius, Axis::None, 0.01);
        let shape = Shape::smooth(&finite_differences::points(radius)).unwrap();
        let error = willmore(&shape, 0.01).largest_distance_of(&[[right, 0.0], [0.0, top]]);
        assert!(error < 1e-6, "{error:e}");
    }
}

#[test]
fn distances_are_those_of_the_curve() {
    let circle = Shape::circle([0.0, 0.0], 1.0).unwrap();
    let curve = willmore(&circle, 0.0);
    let points = [0.3, 2.0, 4.4].map(|angle: f64| [1.01 * angle.cos(), 1.01 * angle.sin()]);
    assert!((curve.largest_distance_of(&points) - 0.01).abs() < 1e-12);
    assert!((curve.largest_distance_of(&[[0.5, 0.0]]) - 0.5).abs() < 1e-12);
    assert!((curve.distance_along([-1.0, 2.0]).unwrap() - 1.0).abs() < 1e-12);
    let ellipse = Shape::ellipse(0.9, 0.4).unwrap();
    let curve = willmore(&ellipse, 0.0);
    assert!((curve.area() - PI * 0.36).abs() < 1e-12);
    let error = curve.largest_distance_of(&[[0.2, 0.0]]) - (0.16 - 0.04 * 0.16 / 0.65_f64).sqrt();
    assert!(error.abs() < 1e-12, "{error:e}");
}

#[test]
fn what_cannot_be_computed_is_refused() {
    let crossing = Shape::polygon(vec![[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
    assert!(matches!(crossing, Err(Error::Turning { .. })));
    for vertices in [
        vec![[0.0, 0.0], [1.0, 0.0]],
        vec![[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
    ] {
        let polygon = Shape::polygon(vertices);
        assert!(matches!(
            polygon,
            Err(Error::InvalidParameter { .. } | Error::Turning { .. })
        ));
    }
    assert!(matches!(Shape::polygon(vec![]), Err(Error::Turning { .. })));
    for shape in [
        Shape::circle([0.0, f64::NAN], 1.0),
        Shape::cross(0.2, 0.3),
        Shape::smooth(&[[0.0, 0.0]; 7]),
    ] {
        let error = shape.err();
        assert!(
            matches!(error, Some(Error::InvalidParameter { .. })),
            "{error:?}"
        );
    }
    let square = Shape::rectangle(1.0, 1.0).unwrap();
    let early = evolve(&square, Flow::Willmore, &[0.0], &ACCURACY);
    assert!(matches!(early, Err(Error::TooEarly { .. })));
    // Its rounded corners would need more points than fit into any memory.
    let thin = Shape::rectangle(1.0, 1e-12).unwrap();
    let unresolved = evolve(&thin, Flow::Willmore, &[0.1], &ACCURACY);
    assert!(matches!(
        unresolved,
        Err(Error::Unresolved { points, .. }) if points == 1 << 20
    ));
    let back = evolve(&square, Flow::Willmore, &[0.2, 0.1], &ACCURACY);
    assert!(matches!(back, Err(Error::TimesNotIncreasing { .. })));
    for (rounding, tolerance) in [(0.1, 1e-8), (f64::NAN, 1e-8), (0.01, 0.0), (0.01, f64::NAN)] {
        let accuracy = Accuracy {
            rounding,
            tolerance,
        };
        let result = evolve(&square, Flow::Willmore, &[0.1], &accuracy);
        assert!(matches!(result, Err(Error::InvalidParameter { .. })));
    }
    // The circle vanishes at t = 1/2.
    let circle = Shape::circle([0.0, 0.0], 1.0).unwrap();
    let vanished = evolve(&circle, Flow::MeanCurvature, &[0.6], &ACCURACY);
    assert!(matches!(vanished, Err(Error::StepTooShort { .. })));
}

#[test]
fn signed_distances_are_distances_with_a_sign() {
    let shape = Shape::ellipse(0.4, 0.25).unwrap();
    let curve = willmore(&shape, 1e-4);
    let distance = curve.signed_distance();
    for k in 0..200_u32 {
        let [a, b] = [0.754_877, 0.569_840].map(|turn| f64::fract(f64::from(k) * turn));
        let x = [1.2 * a - 0.6, 1.2 * b - 0.6];
        let found = distance(x);
        let error = (found.abs() - curve.largest_distance_of(&[x])).abs();
        assert!(error < 1e-9, "{x:?}: {found}");
        let level = (x[0] / 0.4).powi(2) + (x[1] / 0.25).powi(2) - 1.0;
        assert!(
            level.abs() < 0.1 || (found > 0.0) == (level > 0.0),
            "{x:?}: {found}"
        );
    }
}
