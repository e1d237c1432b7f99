//! What is drawn, and whether it comes back.

#![allow(clippy::float_cmp, reason = "where equality is asserted, it is exact")]

use std::f64::consts::PI;

use crate::common::{Raster, disc, near, outline, square};
use geometry::shapes::{Ball, Cuboid};
use geometry::{Field, Grid, Placement, SignedDistance, phase_field};
use images::{Frame, decode, drawing, interface, svg};
use render::{Picture, Rgb};

fn on_white(frame: &Frame, shape: &dyn SignedDistance<2>) -> Picture {
    drawing(frame, shape, Some(Rgb::WHITE)).unwrap()
}

/// The area that is not white, in pixels.
fn darkness(picture: &Picture) -> f64 {
    let dark = picture
        .pixels()
        .iter()
        .map(|p| 1.0 - f64::from(p[1]) / 255.0);
    dark.sum()
}

#[test]
fn coverage_is_the_area() {
    let grid = Grid::<2>::centred(8, 2.0).unwrap();
    let frame = Frame::of_box(&grid, 100).unwrap();
    let pixel = frame.pixel();
    assert_eq!(pixel, 0.02);
    let ball = Ball::new([0.113, -0.071], 0.6).unwrap();
    let drawn = on_white(&frame, &ball);
    near(darkness(&drawn), PI * 0.36 / (pixel * pixel), 1.0);
    // Every pixel against a fine raster.
    let raster = Raster::new([100, 100], 32, |[x, y]| {
        (x * pixel - 1.0 - 0.113).hypot(y * pixel - 1.0 + 0.071) < 0.6
    });
    let mut worst = 0.0_f64;
    for (p, v) in drawn.pixels().iter().zip(&raster.values) {
        assert_eq!((p[0], p[1], p[3]), (p[2], p[0], 255));
        worst = worst.max((f64::from(p[0]) / 255.0 - v).abs());
    }
    println!("coverage of a disc to {worst:.4}");
    assert!(worst < 0.01, "{worst}");

    // Sides of a square along the pixels, and corners.
    let cuboid = Cuboid::new([0.305, 0.2]).unwrap();
    let drawn = on_white(&frame, &cuboid);
    near(darkness(&drawn), 0.61 * 0.4 / (pixel * pixel), 0.5);
    assert_eq!(drawn.pixel(65, 50), [191, 191, 191, 255]);
    assert_eq!(drawn.pixel(50, 59), [0, 0, 0, 255]);
    assert_eq!(drawn.pixel(50, 60), [255, 255, 255, 255]);

    // What is thinner than a pixel is as grey as it is thin.
    let thread = Cuboid::new([0.5, 0.002]).unwrap();
    let (sin, cos) = 0.4_f64.sin_cos();
    let thread = |[x, y]: [f64; 2]| thread.signed_distance([cos * x + sin * y, cos * y - sin * x]);
    let drawn = on_white(&frame, &thread);
    near(darkness(&drawn), 0.004 / (pixel * pixel), 1.0);
}

#[test]
fn edges_without_paper_are_black_and_half_transparent() {
    let grid = Grid::<2>::centred(8, 2.0).unwrap();
    let frame = Frame::of_box(&grid, 200).unwrap();
    let ball = Ball::new([0.0, 0.0], 0.5).unwrap();
    let drawn = drawing(&frame, &ball, None).unwrap();
    assert_eq!(drawn.pixel(145, 100), [0, 0, 0, 255]);
    assert_eq!(drawn.pixel(155, 100), [0; 4]);
    assert!(drawn.pixels().iter().all(|p| p[..3] == [0; 3]));
    let edge = drawn.pixels().iter().filter(|p| (1..255).contains(&p[3]));
    assert!(edge.count() > 100);
}

#[test]
fn images_survive_the_way_through_a_phase_field() {
    let (big, small) = (disc([70.3, 60.8], 45.0), disc([81.0, 52.0], 18.0));
    let bar = square([150.0, 70.0], 22.0, 0.4);
    let raster = Raster::new([200, 120], 16, |x| (big(x) && !small(x)) || bar(x));
    let image = raster.image();
    let found = outline(&image);

    let grid = Grid::<2>::centred(256, 1.0).unwrap();
    let eps = 2.0 * grid.spacing();
    let placement = Placement::fit(&image.bounding_box(), &grid, 1.0).unwrap();
    let u = phase_field(grid, &found.placed(&placement).distance(), eps).unwrap();
    let interface = interface(&u, eps).unwrap();
    let corner = placement.apply([0.0, 120.0]);
    let frame = Frame::new([200, 120], corner, placement.scale()).unwrap();

    for paper in [Some(Rgb::WHITE), None] {
        let drawn = drawing(&frame, &interface, paper).unwrap();
        let again = decode(&drawn.to_png().unwrap()).unwrap();
        assert_eq!(again.opacity().is_some(), paper.is_none());
        let value = |k: usize| {
            let opacity = again.opacity().map_or(1.0, |o| f64::from(o[k]) / 65535.0);
            1.0 - opacity * (1.0 - f64::from(again.grey()[k]) / 65535.0)
        };
        let differences: Vec<f64> = raster
            .values
            .iter()
            .enumerate()
            .map(|(k, v)| (value(k) - v).abs())
            .collect();
        let worst = differences.iter().copied().fold(0.0, f64::max);
        let mean = differences.iter().sum::<f64>() / differences.len() as f64;
        let area = outline(&again).area() - found.area();
        println!("round trip: pixels to {worst:.3}, mean {mean:.5}, area {area:.3}");
        assert!(worst < 0.3 && mean < 2e-3, "{worst} {mean}");
        near(area, 0.0, 3.0);
        // The same outline, to less than a pixel even at the corners.
        let (a, b) = (found.distance(), outline(&again));
        let apart = b
            .curves()
            .iter()
            .flat_map(|c| &c.points)
            .map(|&p| a.signed_distance(p).abs());
        let apart = apart.max_by(f64::total_cmp).unwrap();
        println!("  outlines {apart:.3} pixels apart");
        assert_eq!(b.curves().len(), 3);
        assert!(apart < 0.5, "{apart}");
    }
}

#[test]
fn edges_of_steep_fields_are_smooth_too() {
    // No profile at all: the distance jumps by 49 eps from node to node.
    let grid = Grid::<2>::centred(50, 1.0).unwrap();
    let u = Field::from_fn(grid, |[x, y]| {
        let within = x.abs().max(y.abs()) < 0.301;
        if within { 1.0 } else { -1.0 }
    });
    let interface = interface(&u, 0.04).unwrap();
    // Nodes at 0.3 and 0.32: the interface is between them, three quarters up a pixel.
    let frame = Frame::new([100, 100], [-0.5025, 0.5025], 0.01).unwrap();
    let drawn = on_white(&frame, &interface);
    assert_eq!(drawn.pixel(50, 50), [0, 0, 0, 255]);
    for x in [40, 50, 60] {
        let edge = drawn.pixel(x, 19)[0];
        assert!((60..=68).contains(&edge), "{edge}");
    }
}

#[test]
fn frames_are_the_right_way_up() {
    let grid = Grid::<2>::new(8, 2.0)
        .unwrap()
        .with_origin([1.0, 5.0])
        .unwrap();
    let frame = Frame::of_box(&grid, 50).unwrap();
    let below = |v: [f64; 2], w: [f64; 2]| near((v[0] - w[0]).hypot(v[1] - w[1]), 0.0, 1e-12);
    below(frame.point([0.0, 0.0]), [1.0, 7.0]);
    below(frame.point([50.0, 50.0]), [3.0, 5.0]);
    below(frame.position([2.0, 6.5]), [25.0, 12.5]);
    let upper_left = Ball::new([1.2, 6.8], 0.1).unwrap();
    let drawn = on_white(&frame, &upper_left);
    assert_eq!(drawn.pixel(5, 5), [0, 0, 0, 255]);
    assert_eq!(drawn.pixel(5, 44), [255; 4]);

    let message = |width, height, corner, pixel| {
        Frame::new([width, height], [corner, 0.0], pixel)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        message(8193, 5, 0.0, 1.0),
        "a picture of 8193 x 5 pixels cannot be drawn; use 1 to 8192 a side"
    );
    assert_eq!(
        message(5, 5, 0.0, 0.0),
        "side of a pixel = 0.0 is not allowed: it must be finite and positive"
    );
    assert_eq!(
        message(5, 5, f64::INFINITY, 1.0),
        "coordinate of the corner = inf is not allowed: it must be finite"
    );
    assert!(Frame::of_box(&grid, 0).is_err());
}

#[test]
fn vector_graphics_hold_the_curves() {
    let ring = Raster::new([40, 30], 8, |[x, y]| {
        (5.0..12.0).contains(&(x - 17.0).hypot(y - 15.0))
    });
    let found = outline(&ring.image());
    let frame = Frame::new([40, 30], [0.0, 30.0], 1.0).unwrap();
    let text = svg(&frame, &found);
    assert!(text.starts_with(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"40\" height=\"30\" viewBox=\"0 0 40 30\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n\
         <path fill=\"#000000\" fill-rule=\"evenodd\" d=\"M"
    ));
    assert!(text.ends_with("Z\"/>\n</svg>\n"));

    // The path is the curve with its second axis downwards.
    let data = text
        .split("evenodd\" d=\"")
        .nth(1)
        .unwrap()
        .split('"')
        .next()
        .unwrap();
    let curves: Vec<Vec<f64>> = data
        .split_terminator('Z')
        .map(|curve| curve[1..].split(' ').map(|v| v.parse().unwrap()).collect())
        .collect();
    assert_eq!(curves.len(), 2);
    for (curve, expected) in curves.iter().zip(found.curves()) {
        assert_eq!(curve.len(), 2 * expected.points.len());
        for (k, point) in expected.points.iter().enumerate() {
            near(curve[2 * k], point[0], 5.001e-4);
            near(curve[2 * k + 1], 30.0 - point[1], 5.001e-4);
        }
    }
}
