//! Outlines and their distances against shapes that are known.

#![allow(clippy::float_cmp, reason = "where equality is asserted, it is exact")]

use std::f64::consts::PI;

use crate::common::{Raster, disc, jpeg, near, outline, square};
use geometry::contour::Polyline;
use geometry::shapes::{Ball, Cuboid};
use geometry::{Field, Grid, Placement, SignedDistance, SignedDistanceExt, optimal_profile};
use images::{Error, Image, Outline, Side, Tones, decode, interface};
use proptest::prelude::*;

/// The largest deviation of the distance from the exact one, over the image and around it.
fn deviation(outline: &Outline, exact: &impl SignedDistance<2>, size: f64) -> f64 {
    let distance = outline.distance();
    let errors = (0..120 * 120).map(|k| {
        let x = [k % 120, k / 120].map(|i| size * (-0.1 + 0.01 * f64::from(i)));
        (distance.signed_distance(x) - exact.signed_distance(x)).abs()
    });
    errors.max_by(f64::total_cmp).unwrap()
}

const CENTRE: [f64; 2] = [50.3, 47.8];

#[test]
fn discs_are_found_below_the_size_of_a_pixel() {
    let exact = Ball::new(CENTRE, 40.0).unwrap();
    // Points per pixel and axis, tolerances in pixels and of the area.
    for (parts, tolerance, area) in [(16, 0.1, 2.0), (1, 0.5, 20.0)] {
        let raster = Raster::new([100, 96], parts, disc(CENTRE, 40.0));
        let found = outline(&raster.image());
        assert_eq!(found.curves().len(), 1);
        let error = deviation(&found, &exact, 100.0);
        println!(
            "disc, {parts} points: distance to {error:.4}, area {:.3}",
            found.area() - PI * 1600.0
        );
        assert!(error < tolerance, "{error}");
        near(found.area(), PI * 1600.0, area);
        near(found.length(), 2.0 * PI * 40.0, 0.1 * 2.0 * PI * 40.0);

        for progressive in [false, true] {
            let file = jpeg(
                raster.size,
                jpeg_encoder::ColorType::Luma,
                progressive,
                &raster.bytes(),
            );
            let found = outline(&decode(&file).unwrap());
            let error = deviation(&found, &exact, 100.0);
            println!(
                "  as JPEG: {error:.4}, area {:.3}",
                found.area() - PI * 1600.0
            );
            assert!(error < tolerance, "{error}");
        }
    }
}

#[test]
fn turned_squares_and_rings_are_found() {
    // Counter-clockwise with the second axis upwards: a turn the other way would be 0.7 off.
    let upright = Cuboid::new([30.0, 30.0]).unwrap();
    let turned_back = |[x, y]: [f64; 2]| {
        let (sin, cos) = 0.3_f64.sin_cos();
        [cos * x + sin * y, cos * y - sin * x]
    };
    let exact = (|x| upright.signed_distance(turned_back(x))).translated(CENTRE);
    let found = outline(&Raster::new([100, 96], 16, square(CENTRE, 30.0, 0.3)).image());
    let error = deviation(&found, &exact, 100.0);
    // Away from the corners, which pixels cannot resolve.
    let sides = found.curves()[0].points.iter().filter(|p| {
        let [x, y] = turned_back([p[0] - CENTRE[0], p[1] - CENTRE[1]]);
        x.abs().min(y.abs()) < 28.0
    });
    let along = sides.map(|&p| exact.signed_distance(p).abs());
    let along = along.fold(0.0, f64::max);
    println!(
        "square: {error:.4} at corners, {along:.4} along sides, area {:.3}",
        found.area() - 3600.0
    );
    assert!(error < 0.6 && along < 0.1, "{error} {along}");
    near(found.area(), 3600.0, 2.0);

    let (outer, inner) = (disc(CENTRE, 40.0), disc([55.0, 50.0], 20.0));
    let exact = Ball::new(CENTRE, 40.0)
        .unwrap()
        .difference(Ball::new([55.0, 50.0], 20.0).unwrap());
    let found = outline(&Raster::new([100, 96], 16, |x| outer(x) && !inner(x)).image());
    assert_eq!(found.curves().len(), 2);
    let areas: Vec<f64> = found.curves().iter().map(Polyline::signed_area).collect();
    assert!(areas[0] * areas[1] < 0.0, "{areas:?}");
    near(found.area(), PI * (1600.0 - 400.0), 3.0);
    let distance = found.distance();
    for k in 0..90 * 90 {
        let x = [k % 90, k / 90].map(|i| 5.0 + f64::from(i));
        let expected = exact.signed_distance(x);
        // The difference is exact inside and near the boundary.
        if expected < 2.0 {
            near(distance.signed_distance(x), expected, 0.1);
        }
    }
}

#[test]
fn rows_run_downwards_and_the_plane_upwards() {
    // A black pixel in the upper left corner of three by two.
    let mut grey = vec![u16::MAX; 6];
    grey[0] = 0;
    let found = outline(&Image::new([3, 2], grey, None).unwrap());
    let bounds = found.bounding_box();
    // Halfway to the neighbours, and along the edges of the image.
    assert_eq!((bounds.lower, bounds.upper), ([0.0, 1.0], [1.0, 2.0]));
    near(found.area(), 1.0 - 0.125, 1e-12);
    let distance = found.distance();
    assert_eq!(distance.signed_distance([0.5, 1.75]), -0.25);
    assert_eq!(distance.signed_distance([0.5, 0.5]), 0.5);
    assert_eq!(distance.signed_distance([-3.0, 6.0]), 5.0);
}

#[test]
fn shapes_end_at_the_edge_of_the_image() {
    // The lower half of the image, to the edges on three sides.
    let found = outline(&Raster::new([8, 6], 1, |[_, y]| y < 3.0).image());
    assert_eq!(found.area(), 24.0);
    assert_eq!(found.length(), 22.0);
    let bounds = found.bounding_box();
    assert_eq!((bounds.lower, bounds.upper), ([0.0; 2], [8.0, 3.0]));
    let distance = found.distance();
    let exact = Cuboid::new([4.0, 1.5]).unwrap().translated([4.0, 1.5]);
    for k in 0..400 {
        let x = [k % 20, k / 20].map(|i| 0.6137 * f64::from(i) - 1.0);
        near(distance.signed_distance(x), exact.signed_distance(x), 1e-14);
    }

    // Images of one row or column.
    let row = Image::new([4, 1], vec![0, 0, u16::MAX, 0], None).unwrap();
    let found = Outline::of_image(&row, Side::Dark(0.5)).unwrap();
    assert_eq!((found.curves().len(), found.area()), (2, 3.0 - 0.0));
    let column = Image::new([1, 3], vec![u16::MAX, 0, u16::MAX], None).unwrap();
    let found = Outline::of_image(&column, Side::Dark(0.5)).unwrap();
    assert_eq!((found.curves().len(), found.area()), (1, 1.0));
}

#[test]
fn diagonal_pixels_are_joined_by_their_mean() {
    let image = |dark: u16| {
        let mut grey = vec![u16::MAX; 16];
        (grey[5], grey[10]) = (dark, dark);
        Image::new([4, 4], grey, None).unwrap()
    };
    // The mean of the four is 0.5 and is outside for a lower threshold, inside for a higher one.
    for (threshold, curves) in [(0.4, 2), (0.6, 1)] {
        let found = Outline::of_image(&image(0), Side::Dark(threshold)).unwrap();
        assert_eq!(found.curves().len(), curves, "{threshold}");
        let middle = found.distance().signed_distance([2.0, 2.0]);
        assert_eq!(middle < 0.0, curves == 1);
    }
}

#[test]
fn the_side_is_chosen() {
    let [dark, light]: [Vec<u16>; 2] = [[0, 65535], [65535, 0]].map(|[shape, ground]| {
        let raster = Raster::new([9, 9], 1, disc([4.5, 4.5], 3.0));
        raster
            .values
            .iter()
            .map(|&v| if v < 0.5 { shape } else { ground })
            .collect()
    });
    let side = |grey: &[u16], opacity: Option<Vec<u16>>| {
        let image = Image::new([9, 9], grey.to_vec(), opacity).unwrap();
        Side::of(&image, 0.5).unwrap()
    };
    assert_eq!(side(&dark, None), Side::Dark(0.5));
    assert_eq!(side(&light, None), Side::Light(0.5));
    assert_eq!(side(&dark, Some(dark.clone())), Side::Opaque(0.5));
    // Slightly transparent pixels do not cut out a shape.
    assert_eq!(side(&dark, Some(vec![60000; 81])), Side::Dark(0.5));

    // Two grey values are separated halfway, also when one is rare.
    let separated = |grey: &[u16]| {
        let image = Image::new([9, 9], grey.to_vec(), None).unwrap();
        Tones::of(&image, Side::Dark(0.5)).threshold
    };
    let grey: Vec<u16> = dark
        .iter()
        .map(|&v| if v == 0 { 60 * 257 } else { 200 * 257 })
        .collect();
    let mut rare = vec![200 * 257; 81];
    rare[40] = 60 * 257;
    assert_eq!(
        [&grey, &rare].map(|grey| separated(grey)),
        [130.0 / 255.0; 2]
    );
    assert_eq!([separated(&dark), separated(&[700; 81])], [0.5; 2]);

    // Transparency counts as paper: grey on white for dark shapes, on black for light ones.
    let image = Image::new([3, 1], vec![0, 0, 65535], Some(vec![0, 65535, 65535])).unwrap();
    let lengths = [Side::Dark(0.5), Side::Light(0.5), Side::Opaque(0.5)].map(|side| {
        let bounds = Outline::of_image(&image, side).unwrap().bounding_box();
        [bounds.lower[0], bounds.upper[0]]
    });
    assert_eq!(lengths, [[1.0, 2.0], [2.0, 3.0], [1.0, 3.0]]);
}

#[test]
fn opacity_alone_gives_the_same_outline() {
    let raster = Raster::new([60, 50], 8, disc([30.0, 25.0], 17.0));
    let opacity: Vec<u16> = raster.shorts().into_iter().map(|v| 65535 - v).collect();
    let transparent = Image::new([60, 50], vec![12345; 3000], Some(opacity)).unwrap();
    let plain = Image::new([60, 50], raster.shorts(), None).unwrap();
    let [a, b] = [outline(&transparent), outline(&plain)];
    near(a.area(), b.area(), 1e-9);
    near(a.area(), PI * 17.0 * 17.0, 0.5);
}

#[test]
fn unusable_images_are_explained() {
    let image = |grey: Vec<u16>| Image::new([2, 2], grey, None).unwrap();
    let message = |image: &Image, side| Outline::of_image(image, side).unwrap_err().to_string();
    let grey = image(vec![0x4000, 0x8000, 0x8000, 0xc000]);
    assert_eq!(
        message(&grey, Side::Dark(0.2)),
        "nothing is inside: nothing is darker than 0.2000; the grey value ranges from 0.2500 to \
         0.7500, so choose a threshold in between, or another side"
    );
    assert_eq!(
        message(&grey, Side::Light(0.2)),
        "everything is inside: everything is lighter than 0.2000; the grey value ranges from \
         0.2500 to 0.7500, so choose a threshold in between, or another side"
    );
    assert_eq!(
        message(&grey, Side::Opaque(0.5)),
        "everything is inside: everything is more opaque than 0.5000; the opacity ranges from \
         1.0000 to 1.0000, so choose a threshold in between, or another side"
    );
    // Values at the threshold are outside, on both sides.
    for side in [Side::Dark(0.0), Side::Light(0.0)] {
        assert!(matches!(
            Outline::of_image(&image(vec![0; 4]), side),
            Err(Error::OneSided { .. })
        ));
    }
    for threshold in [-0.1, 1.1, f64::NAN, f64::INFINITY] {
        let error = Side::of(&grey, threshold).unwrap_err();
        assert_eq!(
            error.to_string(),
            format!("threshold = {threshold} is not allowed: it must be from 0 to 1")
        );
    }

    let noise = (0..2048 * 2048).map(|k| {
        if (k % 2048 + k / 2048) % 2 == 0 {
            0
        } else {
            u16::MAX
        }
    });
    let noise = Image::new([2048, 2048], noise.collect(), None).unwrap();
    assert_eq!(
        message(&noise, Side::Dark(0.5)),
        "the outline would have about 8384512 segments, more than 4194304: this is noise and no \
         shape; blur the image or make it smaller"
    );

    let message = |width, height, grey, opacity: Option<usize>| {
        Image::new([width, height], vec![0; grey], opacity.map(|n| vec![0; n]))
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        message(0, 5, 0, None),
        "an image of 0 x 5 pixels cannot be used; it needs at least one pixel and may have up to \
         67108864"
    );
    assert!(message(65536, 65536, 1, None).contains("65536 x 65536 pixels"));
    assert_eq!(
        message(2, 3, 5, None),
        "2 x 3 pixels were announced, but 5 grey values given"
    );
    assert_eq!(
        message(2, 3, 6, Some(7)),
        "2 x 3 pixels were announced, but 7 opacities given"
    );
}

#[test]
fn unusable_curves_and_fields_are_explained() {
    let grid = Grid::centred(8, 1.0).unwrap();
    let ball = geometry::phase_field(grid, &Ball::new([0.0; 2], 0.3).unwrap(), 0.2).unwrap();
    let found = Outline::of_phase_field(&ball).unwrap();
    // What is not a point has no distance.
    let distance = found.distance();
    for x in [f64::NAN, f64::INFINITY, -1e101] {
        assert!(distance.signed_distance([x, 0.0]).is_nan());
        assert!(distance.signed_distance([0.0, x]).is_nan());
    }
    assert_eq!(distance.signed_distance([0.0, -1e90]), 1e90);

    for (value, text) in [
        (-0.5, "-0.5000 to -0.5000"),
        (1.0, "1.0000 to 1.0000"),
        (0.0, "0.0000 to 0.0000"),
    ] {
        assert_eq!(
            Outline::of_phase_field(&Field::constant(grid, value))
                .unwrap_err()
                .to_string(),
            format!(
                "the phase field has no interface: its values range from {text}, and do not change sign"
            )
        );
    }
    assert!(matches!(
        Outline::of_phase_field(&Field::constant(grid, f64::NAN)),
        Err(Error::Geometry(_))
    ));
    assert!(interface(&Field::constant(grid, f64::NAN), 0.1).is_err());
    for eps in [0.0, -1.0, f64::NAN] {
        let error = interface(&Field::constant(grid, 0.5), eps).err().unwrap();
        assert_eq!(
            error.to_string(),
            format!("eps = {eps:?} is not allowed: it must be finite and positive")
        );
    }
}

#[test]
fn placement_and_its_inverse() {
    let raster = Raster::new([200, 100], 8, disc([60.0, 30.0], 20.0));
    let image = raster.image();
    let found = outline(&image);
    let grid = Grid::<2>::new(64, 2.0)
        .unwrap()
        .with_origin([3.0, -1.0])
        .unwrap();

    // The whole image: its lower left corner is that of the placed rectangle.
    let placement = Placement::fit(&image.bounding_box(), &grid, 1.6).unwrap();
    assert_eq!(placement.scale(), 1.6 / 200.0);
    let corner = placement.apply([0.0, 0.0]);
    near(corner[0], 3.2, 1e-15);
    near(corner[1], -0.4, 1e-15);
    for x in [[0.0, 0.0], [17.5, 99.0], [-4.0, 300.0]] {
        let back = placement.apply_inverse(placement.apply(x));
        near(back[0], x[0], 1e-12);
        near(back[1], x[1], 1e-12);
    }
    let placed = found.placed(&placement);
    near(placed.bounding_box().centre()[0], 3.2 + 60.0 * 0.008, 1e-4);
    near(placed.bounding_box().centre()[1], -0.4 + 30.0 * 0.008, 1e-4);
    near(placed.area(), found.area() * 0.008 * 0.008, 1e-12);
    let s = placed.distance().signed_distance([3.68, -0.16]);
    near(s, -20.0 * 0.008, 1e-3);

    // The shape alone, in the middle.
    let placement = Placement::fit(&found.bounding_box(), &grid, 1.0).unwrap();
    let bounds = found.placed(&placement).bounding_box();
    near(bounds.centre()[0], 4.0, 1e-12);
    near(bounds.centre()[1], 0.0, 1e-12);
    near(bounds.extent()[0], 1.0, 1e-3);

    let message = |length| {
        let placement = Placement::fit(&image.bounding_box(), &grid, length);
        placement.unwrap_err().to_string()
    };
    assert_eq!(
        message(2.1),
        "a side length of 2.1 does not fit the box of side 2; use at most that"
    );
    assert_eq!(
        message(0.0),
        "side length = 0.0 is not allowed: it must be finite and positive"
    );
    assert!(message(f64::NAN).contains("side length = NaN"));
    let point = geometry::measure::BoundingBox {
        lower: [1.0; 2],
        upper: [1.0; 2],
    };
    assert_eq!(
        Placement::fit(&point, &grid, 1.0).unwrap_err().to_string(),
        "longest side of the bounding box = 0.0 is not allowed: it must be finite and positive"
    );
}

#[test]
fn interfaces_between_nodes_are_those_of_the_distance() {
    let exact = Ball::new([0.03, -0.02], 0.3).unwrap();
    let error = |cells: usize| {
        let grid = Grid::<2>::centred(cells, 1.0).unwrap();
        let eps = 2.0 * grid.spacing();
        let u = Field::from_fn(grid, |x| optimal_profile(exact.signed_distance(x), eps));
        let interface = interface(&u, eps).unwrap();
        let points = (0..2000).map(|k| {
            let (angle, radius) = (0.1 * f64::from(k), 0.3 + 0.02 * f64::from(k).sin());
            [0.03 + radius * angle.cos(), -0.02 + radius * angle.sin()]
        });
        let errors =
            points.map(|x| (interface.signed_distance(x) - exact.signed_distance(x)).abs());
        errors.max_by(f64::total_cmp).unwrap()
    };
    let (coarse, fine) = (error(64), error(128));
    println!("bicubic: {coarse:.2e} at n = 64, {fine:.2e} at 128");
    assert!(coarse < 2e-5 && fine < coarse / 7.0, "{coarse} {fine}");

    // The box has an end, and outside is outside.
    let grid = Grid::<2>::new(16, 1.0).unwrap();
    let inside = interface(&Field::constant(grid, 1.0), 0.1).unwrap();
    near(inside.signed_distance([0.5, 0.9]), -0.1, 1e-15);
    assert_eq!(inside.signed_distance([-3.0, 5.0]), 5.0);
    assert!(inside.signed_distance([f64::NAN, 0.5]).is_nan());
}

#[test]
fn interfaces_are_closed_along_the_faces_of_the_box() {
    let grid = Grid::<2>::new(32, 1.0).unwrap();
    // A disc about a corner of the box, in all four corners by periodicity.
    let u = Field::from_fn(grid, |x| {
        let [a, b] = x.map(|v| v.min(1.0 - v));
        optimal_profile(a.hypot(b) - 0.3, 0.06)
    });
    let found = Outline::of_phase_field(&u).unwrap();
    assert_eq!(found.curves().len(), 4);
    near(found.area(), PI * 0.09, 2e-3);
    near(found.length(), PI * 0.6 + 8.0 * 0.3, 1e-2);
}

/// Distance to a segment.
fn to_segment([x, y]: [f64; 2], (a, b): ([f64; 2], [f64; 2])) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let along = ((x - a[0]) * d[0] + (y - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1]);
    let t = along.clamp(0.0, 1.0);
    (x - a[0] - t * d[0]).hypot(y - a[1] - t * d[1])
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Random images of few values, so that values at the threshold, saddles and edges abound.
    #[test]
    fn outlines_of_random_images_are_right_at_every_pixel(
        width in 1_u32..9,
        height in 1_u32..9,
        seed in prop::collection::vec(0_u16..5, 64),
        threshold in 0_u16..5,
    ) {
        let (width, height) = (width, height);
        let count = (width * height) as usize;
        let values = &seed[..count];
        let grey: Vec<u16> = values.iter().map(|v| 65535 / 5 * v).collect();
        let image = Image::new([width, height], grey, None).unwrap();
        let side = Side::Light(f64::from(threshold) / 5.0);
        let inside: Vec<bool> = values.iter().map(|&v| v > threshold).collect();
        match Outline::of_image(&image, side) {
            Ok(found) => {
                let distance = found.distance();
                let segments: Vec<_> = found.curves().iter().flat_map(Polyline::segments).collect();
                for (k, &inside) in inside.iter().enumerate() {
                    let [column, row] = [k as u32 % width, k as u32 / width];
                    let x = [f64::from(column) + 0.5, f64::from(height - row) - 0.5];
                    let s = distance.signed_distance(x);
                    let expected = segments.iter().map(|&s| to_segment(x, s)).fold(f64::INFINITY, f64::min);
                    prop_assert!((s.abs() - expected).abs() < 1e-12);
                    // A pixel at the threshold may be a hole without extent.
                    let decided = expected > 1e-12 && values[k] != threshold;
                    prop_assert!(!decided || (s < 0.0) == inside, "{} at {:?}", s, x);
                }
                // Insides to the left: no area is counted against the others.
                prop_assert!(found.area() > 0.0 && found.area() <= count as f64);
                let bounds = found.bounding_box();
                prop_assert!(bounds.lower.iter().all(|&v| v >= 0.0));
                prop_assert!(bounds.upper[0] <= f64::from(width) && bounds.upper[1] <= f64::from(height));
            }
            Err(Error::OneSided { inside: which, .. }) => {
                prop_assert!(!inside.contains(&(which == "nothing")));
            }
            Err(other) => prop_assert!(false, "{}", other),
        }
    }
}
