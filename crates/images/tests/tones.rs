//! What tells drawings from photographs, and the raster from the shape.

use geometry::SignedDistance;
use images::{Image, Outline, Side, Tones, colours, is_deep};

use crate::common::png_with;

const PIXELS: u32 = 160;

/// The image with these grey values, from 0 to 1, at the centres of its pixels.
fn image(grey: impl Fn(f64, f64) -> f64) -> Image {
    let values = (0..PIXELS * PIXELS).map(|k| {
        let [x, y] = [k % PIXELS, k / PIXELS].map(|i| f64::from(i) + 0.5);
        (65535.0 * grey(x, y)) as u16
    });
    Image::new([PIXELS; 2], values.collect(), None).unwrap()
}

fn radius(x: f64, y: f64) -> f64 {
    (x - 80.0).hypot(y - 80.0)
}

#[test]
fn drawings_have_two_tones_and_photographs_do_not() {
    let blended = image(|x, y| (radius(x, y) - 60.0 + 0.5).clamp(0.0, 1.0));
    let hard = image(|x, y| f64::from(u8::from(radius(x, y) > 60.0)));
    let photograph = image(|x, y| 0.5 + 0.4 * (0.05 * x).sin() * (0.07 * y).cos());
    let tones = |image: &Image| {
        let side = Side::of(image, 0.5).unwrap();
        Tones::of(image, side)
    };
    let [blended, hard, photograph] = [&blended, &hard, &photograph].map(tones);
    assert!(blended.between < 1e-9 && hard.between < 1e-9 && photograph.between > 0.2);
    assert!(
        blended.raster() < 0.3 && hard.raster() > 0.59,
        "{blended:?} {hard:?}"
    );
    let part = std::f64::consts::PI * 3600.0 / 25600.0;
    assert!((blended.inside / part - 1.0).abs() < 0.01, "{blended:?}");
}

/// A disc of radius 60 with hard edges: its outline goes along the raster, and is 5 % too long.
#[test]
fn smoothed_outlines_have_the_length_of_the_shape_and_stay_near() {
    let hard = image(|x, y| f64::from(u8::from(radius(x, y) > 60.0)));
    let rough = Outline::of_image(&hard, Side::Dark(0.5)).unwrap();
    let smooth = rough.smoothed(0.6).unwrap();
    let circumference = std::f64::consts::TAU * 60.0;
    assert!(rough.length() > 1.02 * circumference, "{}", rough.length());
    let length = smooth.length();
    assert!(
        (length / circumference - 1.0).abs() < 0.006,
        "{length}, not {circumference}"
    );
    let distance = rough.distance();
    let points = smooth.curves().iter().flat_map(|curve| &curve.points);
    let far = points.map(|&x| distance.signed_distance(x).abs());
    assert!(far.fold(0.0, f64::max) < 1.2);
    assert!((smooth.area() / rough.area() - 1.0).abs() < 1e-4);
    assert!(rough.smoothed(0.0).is_err());
    // Sides are as long as the outline, with normals of length 1.
    let sides: f64 = smooth
        .sides(usize::MAX)
        .map(|(_, n, side)| n[0].hypot(n[1]) * side)
        .sum();
    assert!((sides / length - 1.0).abs() < 1e-12);
}

/// Single pixels, which smoothing would shrink to points, and a dot of four pixels beside a disc.
#[test]
fn specks_stay_as_they_are() {
    let specks = image(|x, y| {
        let at = |x: f64, size: f64| x % 20.0 < size;
        let dot = (at(x, 1.0) && at(y, 1.0)) || (x < 42.0 && y < 3.0 && at(x, 2.0) && y > 1.0);
        f64::from(u8::from(radius(x, y) > 30.0 && !dot))
    });
    let rough = Outline::of_image(&specks, Side::Dark(0.5)).unwrap();
    assert!(rough.curves().len() > 50);
    let smooth = rough.smoothed(0.6).unwrap();
    assert_eq!(smooth.curves().len(), rough.curves().len());
    assert!((smooth.area() / rough.area() - 1.0).abs() < 1e-3);
    let (before, after) = (rough.bounding_box(), smooth.bounding_box());
    assert!((after.longest_side() - before.longest_side()).abs() < 1.2);
    let centre = smooth.distance().signed_distance([80.0, 80.0]);
    assert!((centre + 30.0).abs() < 0.6, "{centre}");
}

#[test]
fn colours_are_those_of_the_file() {
    let pixels: Vec<[u8; 4]> = (0..48).map(|k| [k, 5 * k, 255 - k, 255 - 3 * k]).collect();
    let picture = render::Picture::new([8, 6], pixels).unwrap();
    let again = colours("x", &picture.to_png().unwrap()).unwrap();
    assert_eq!(again.pixels(), picture.pixels());
    let mut jpeg = Vec::new();
    let red: Vec<u8> = [200, 30, 40].repeat(64);
    let encoder = jpeg_encoder::Encoder::new(&mut jpeg, 95);
    encoder
        .encode(&red, 8, 8, jpeg_encoder::ColorType::Rgb)
        .unwrap();
    for pixel in colours("x", &jpeg).unwrap().pixels() {
        let near = |a: u8, b: u8| a.abs_diff(b) < 8;
        assert!(
            near(pixel[0], 200) && near(pixel[1], 30) && near(pixel[2], 40),
            "{pixel:?}"
        );
    }
    let deep = |depth, data: &[u8]| {
        let bytes = png_with([1, 1], png::ColorType::Rgb, depth, data, |_| {});
        is_deep(&bytes)
    };
    assert!(deep(png::BitDepth::Sixteen, &[1, 2, 3, 4, 5, 6]));
    assert!(!deep(png::BitDepth::Eight, &[1, 2, 3]));
    assert!(!is_deep(&jpeg));
    let error = colours("x.png", b"no image").unwrap_err();
    assert!(error.to_string().starts_with("x.png"), "{error}");
}
