//! Pictures looked at: outlines, light, tubes, colours, files.

use std::f64::consts::PI;
use std::time::Duration;

use geometry::shapes::{Ball, Cross, HalfSpace, RoundedBox};
use geometry::{Field, Grid, SignedDistance, SignedDistanceExt, UpAxis, phase_field};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use render::{
    Animation, Background, Bounds, Camera, Error, Framing, Lighting, Picture, Quality, Rgb, Scene,
    Tube,
};

const EPS: f64 = 2.0 / 64.0;

/// The phase field of a shape in `[-0.5, 0.5]^3` at n = 64.
fn field(shape: &dyn SignedDistance<3>) -> Field<3> {
    phase_field(Grid::centred(64, 1.0).unwrap(), shape, EPS).unwrap()
}

/// A quick scene without background.
fn scene(shape: &dyn SignedDistance<3>) -> Scene<'static> {
    Scene::new(&field(shape), EPS)
        .unwrap()
        .quality(Quality::Draft)
        .background(Background::Transparent)
        .azimuth(0.0)
        .elevation(0.0)
        .orthographic()
}

fn ball(centre: [f64; 3], radius: f64) -> Ball<3> {
    Ball::new(centre, radius).unwrap()
}

/// Area and centre of what is opaque, in pixels.
fn silhouette(picture: &Picture) -> (f64, [f64; 2]) {
    let (mut area, mut moment) = (0.0, [0.0; 2]);
    for y in 0..picture.height() {
        for x in 0..picture.width() {
            let cover = f64::from(picture.pixel(x, y)[3]) / 255.0;
            area += cover;
            moment[0] += cover * (f64::from(x) + 0.5);
            moment[1] += cover * (f64::from(y) + 0.5);
        }
    }
    (area, moment.map(|m| m / area))
}

fn brightness(picture: &Picture, x: u32, y: u32) -> i32 {
    let [r, g, b, _] = picture.pixel(x, y).map(i32::from);
    r + g + b
}

#[test]
fn the_outline_of_a_ball_is_a_disc_of_the_right_size_and_place() {
    let centre = [0.1, -0.08, 0.06];
    let view = scene(&ball(centre, 0.25))
        .framing(Framing::Domain)
        .margin(0.0);
    // From +x the picture shows y to the right and z upwards, and the unit box fills it.
    let (area, place) = silhouette(&view.render(160).unwrap());
    assert!((area / (PI * 40.0 * 40.0) - 1.0).abs() < 4e-3, "{area}");
    let expected = [160.0 * 0.42, 160.0 * 0.44];
    for k in 0..2 {
        assert!((place[k] - expected[k]).abs() < 0.1, "{place:?}");
    }
    // From +z, y pointing up: from +x to the right.
    let (_, place) = silhouette(&view.clone().up(UpAxis::Y).render(160).unwrap());
    let expected = [160.0 * 0.6, 160.0 * 0.58];
    for k in 0..2 {
        assert!((place[k] - expected[k]).abs() < 0.1, "{place:?}");
    }

    // In perspective the outline is the cone that touches the ball.
    let framing = Framing::Ball {
        centre,
        radius: 0.4,
    };
    let tangent = 15.0_f64.to_radians().tan();
    let distance = 0.4 * (1.0 + tangent.powi(-2)).sqrt();
    let radius = (0.25 / distance).asin().tan() / tangent * 80.0;
    for (azimuth, elevation) in [(0.0, 0.0), (140.0, 50.0), (-60.0, -90.0)] {
        let turned = view.clone().azimuth(azimuth).elevation(elevation);
        let picture = turned.perspective(30.0).framing(framing).render(160);
        let (area, place) = silhouette(&picture.unwrap());
        assert!((area / (PI * radius * radius) - 1.0).abs() < 4e-3, "{area}");
        assert!(place.iter().all(|c| (c - 80.0).abs() < 0.1), "{place:?}");
    }
}

#[test]
fn a_tight_frame_touches_the_margins() {
    let shape = RoundedBox::new([0.3, 0.1, 0.2], 0.05).unwrap();
    for view in [scene(&shape), scene(&shape).perspective(40.0)] {
        let picture = view
            .azimuth(25.0)
            .elevation(30.0)
            .margin(0.1)
            .render((200, 150));
        let picture = picture.unwrap();
        let seen = |x: u32, y: u32| picture.pixel(x, y)[3] > 0;
        let columns: Vec<u32> = (0..200).filter(|&x| (0..150).any(|y| seen(x, y))).collect();
        let rows: Vec<u32> = (0..150).filter(|&y| (0..200).any(|x| seen(x, y))).collect();
        let tall = rows.len() as f64 / 120.0;
        let wide = columns.len() as f64 / 160.0;
        assert!((0.97..1.03).contains(&tall.max(wide)), "{wide} x {tall}");
        let free = [columns[0], 199 - columns[columns.len() - 1]];
        assert!(free[0].abs_diff(free[1]) < 12, "{free:?}");
    }
}

#[test]
fn opacity_is_all_or_nothing_but_for_the_outline() {
    let view = scene(&ball([0.0; 3], 0.3))
        .framing(Framing::Domain)
        .margin(0.0);
    let picture = view.render(120).unwrap();
    for y in 0..120 {
        for x in 0..120 {
            let radius = (f64::from(x) - 59.5).hypot(f64::from(y) - 59.5);
            let alpha = picture.pixel(x, y)[3];
            if radius > 38.0 {
                assert_eq!(picture.pixel(x, y), [0; 4], "{x} {y}");
            } else if radius < 34.0 {
                assert_eq!(alpha, 255, "{x} {y}");
            }
        }
    }
    let partial = picture.pixels().iter().filter(|p| !matches!(p[3], 0 | 255));
    assert!((100..500).contains(&partial.count()));
    // Drawn on a colour, or put on it afterwards.
    for (background, colour) in [
        (Background::White, Rgb::WHITE),
        (Background::Colour(Rgb(20, 90, 160)), Rgb(20, 90, 160)),
    ] {
        let direct = view.clone().background(background).render(120).unwrap();
        let later = picture.over(colour);
        for (a, b) in direct.pixels().iter().zip(later.pixels()) {
            assert!((0..4).all(|c| a[c].abs_diff(b[c]) <= 2), "{a:?} {b:?}");
        }
    }
}

#[test]
fn a_ball_is_brightest_towards_the_key_light() {
    let view = scene(&ball([0.0; 3], 0.4))
        .framing(Framing::Domain)
        .margin(0.0);
    for (azimuth, elevation) in [(-40.0_f64, 30.0_f64), (25.0, -35.0)] {
        let lighting = Lighting {
            key_azimuth: azimuth,
            key_elevation: elevation,
            sky: 0.1,
            fill: 0.0,
            ..Lighting::default()
        };
        let picture = view.clone().lighting(lighting).render(120).unwrap();
        let best = (0..120 * 120)
            .map(|k| (k % 120, k / 120))
            .max_by_key(|&(x, y)| brightness(&picture, x, y))
            .unwrap();
        // The gloss draws the maximum a little towards the camera.
        let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
        let x = 60.0 + 48.0 * elevation.cos() * azimuth.sin();
        let y = 60.0 - 48.0 * elevation.sin();
        let off = (f64::from(best.0) + 0.5 - x).hypot(f64::from(best.1) + 0.5 - y);
        assert!(off < 14.0, "{best:?} instead of {x} {y}");
    }
}

#[test]
fn corners_are_darker_than_free_faces() {
    let sky = Lighting {
        key: 0.0,
        sky: 0.8,
        fill: 0.0,
        ..Lighting::default()
    };
    let view = scene(&Cross::new(0.4, 0.13).unwrap())
        .framing(Framing::Domain)
        .margin(0.0)
        .lighting(sky)
        .quality(Quality::Standard);
    let picture = view.render(200).unwrap();
    // All of these faces look towards +x; y grows to the right.
    let at = |y: f64| brightness(&picture, (200.0 * (y + 0.5)) as u32, 100);
    let (free, corner, end) = (at(0.0), at(0.17), at(0.37));
    assert!(corner + 25 < free, "{corner} {free}");
    assert!(
        corner + 15 < end && end <= free + 3,
        "{corner} {end} {free}"
    );
}

#[test]
fn shadows_fall_away_from_the_key_light() {
    // A small ball between a large one and the light.
    let shape = ball([0.0, 0.0, -0.1], 0.3).union(ball([0.25, -0.16, 0.26], 0.08));
    let towards = Lighting {
        key_azimuth: -33.0,
        key_elevation: 45.0,
        ..Lighting::default()
    };
    let picture = |shape: &dyn SignedDistance<3>| {
        let view = scene(shape).framing(Framing::Domain).margin(0.0);
        view.lighting(towards).render(120).unwrap()
    };
    let with = picture(&shape);
    let without = picture(&ball([0.0, 0.0, -0.1], 0.3));
    let darker = |x: u32, y: u32| brightness(&without, x, y) - brightness(&with, x, y);
    // The light passes the small ball's centre, (0.25, -0.16, 0.26), towards (0, 0, -0.1).
    let most = (0..120 * 120)
        .map(|k| (k % 120, k / 120))
        .filter(|&(x, y)| without.pixel(x, y)[3] == 255 && y > 45)
        .max_by_key(|&(x, y)| darker(x, y))
        .unwrap();
    assert!(darker(most.0, most.1) > 120, "{most:?}");
    assert!(
        (44..62).contains(&most.0) && (45..62).contains(&most.1),
        "{most:?}"
    );
    assert!(darker(75, 90).abs() < 30, "no shadow there");
}

#[test]
fn the_ground_receives_a_shadow_on_the_far_side_of_the_light() {
    let view = scene(&ball([0.0; 3], 0.3))
        .elevation(25.0)
        .ground_shadow(0.8);
    let picture = view.render((150, 100)).unwrap();
    // The shadow is black, the ball is not.
    let middle = |shadow: bool| {
        let pixels = picture.pixels().iter().enumerate();
        let (sum, weight) = pixels
            .filter(|(_, p)| (p[..3] == [0; 3]) == shadow)
            .map(|(at, p)| (at as f64 % 150.0, f64::from(p[3])))
            .fold((0.0, 0.0), |(s, w), (x, a)| (s + a * x, w + a));
        sum / weight
    };
    assert!(
        middle(true) > middle(false) + 15.0,
        "{} {}",
        middle(true),
        middle(false)
    );
    let strongest = picture
        .pixels()
        .iter()
        .filter(|p| p[..3] == [0; 3])
        .map(|p| p[3]);
    assert!((90..=204).contains(&strongest.max().unwrap()));
    // From below there is no ground.
    let below = view.elevation(-25.0).render((150, 100)).unwrap();
    let dark = below
        .pixels()
        .iter()
        .filter(|p| p[3] > 0 && p[..3] == [0; 3]);
    assert_eq!(dark.count(), 0);
}

#[test]
fn tubes_hide_and_are_hidden() {
    let red = Rgb(200, 30, 30);
    let tube = |x: f64| Tube::new([[x, -0.45, 0.0], [x, 0.45, 0.0]], 0.03).with_colour(red);
    let picture = |tube: Tube| {
        let view = scene(&ball([0.0; 3], 0.3)).framing(Framing::Domain);
        view.margin(0.0).tube(tube).render(100).unwrap()
    };
    let is_red = |p: &Picture, x: u32| {
        let [r, g, b, a] = p.pixel(x, 50).map(i32::from);
        a == 255 && r > 2 * g && r > 2 * b
    };
    let (behind, before) = (picture(tube(-0.4)), picture(tube(0.4)));
    assert!(!is_red(&behind, 50) && is_red(&before, 50));
    assert!(is_red(&behind, 10) && is_red(&before, 10));
    // Half in, half out: the tube through the middle shows outside the ball alone.
    let through = picture(tube(0.0));
    assert!(!is_red(&through, 50) && is_red(&through, 10));
    // It is 6 pixels wide.
    let column: u32 = (0..100).map(|y| u32::from(before.pixel(10, y)[3])).sum();
    assert!((column.abs_diff(6 * 255)) < 100, "{column}");
    // And casts a shadow on the ball, but not on its own light side.
    let sum = |p: &Picture| (60..70).map(|y| brightness(p, 50, y)).sum::<i32>();
    assert!(
        sum(&before) + 100 < sum(&behind),
        "{} {}",
        sum(&before),
        sum(&behind)
    );
}

#[test]
fn closed_tubes_and_boxes_are_complete() {
    let square = [
        [0.0, -0.3, -0.3],
        [0.0, 0.3, -0.3],
        [0.0, 0.3, 0.3],
        [0.0, -0.3, 0.3],
    ];
    let view = |tubes: Vec<Tube>| {
        let empty = Field::constant(Grid::centred(8, 1.0).unwrap(), -1.0);
        let scene = Scene::new(&empty, EPS).unwrap().tubes(tubes).orthographic();
        let scene = scene.background(Background::Transparent).margin(0.0);
        scene
            .azimuth(0.0)
            .elevation(0.0)
            .framing(Framing::Domain)
            .render(100)
            .unwrap()
    };
    let open = view(vec![Tube::new(square, 0.02)]);
    let closed = view(vec![Tube::new(square, 0.02).closed()]);
    assert_eq!((open.pixel(20, 50)[3], closed.pixel(20, 50)[3]), (0, 255));
    assert_eq!((open.pixel(80, 50)[3], closed.pixel(50, 50)[3]), (255, 0));
    let edges = Tube::edges_of_box([-0.3; 3], [0.3; 3], 0.02);
    assert_eq!(edges.len(), 12);
    let boxed = view(edges);
    for (x, y) in [(20, 50), (80, 50), (50, 20), (50, 80)] {
        assert_eq!(boxed.pixel(x, y)[3], 255, "{x} {y}");
    }
}

#[test]
fn regions_have_their_colours() {
    let shape = ball([0.0; 3], 0.3);
    let right = HalfSpace::new([0.0; 3], [0.0, -1.0, 0.0]).unwrap();
    let view = scene(&shape).framing(Framing::Domain).margin(0.0);
    let blue = Rgb(30, 60, 200);
    let is_blue = |p: [u8; 4]| p[2] > p[0].saturating_add(40);
    let mask = Field::from_fn(Grid::centred(32, 1.0).unwrap(), |[_, y, _]| {
        f64::from(u8::from(y > 0.0))
    });
    for view in [
        view.clone().highlight(right, blue),
        view.clone().highlight_mask(&mask, blue).unwrap(),
    ] {
        let picture = view.render(100).unwrap();
        assert!(is_blue(picture.pixel(60, 50)) && !is_blue(picture.pixel(40, 50)));
        // The last one wins.
        let all = view.highlight(ball([0.0; 3], 1.0), Rgb(200, 30, 30));
        assert!(!is_blue(all.render(100).unwrap().pixel(60, 50)));
    }
}

/// Mean difference of all values, in levels, where `column` says which column of `b` belongs to one of `a`.
fn mean_difference(a: &Picture, b: &Picture, column: impl Fn(u32) -> u32) -> f64 {
    let (width, height) = (a.width(), a.height());
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let total: u64 = pixels
        .flat_map(|(x, y)| {
            let (a, b) = (a.pixel(x, y), b.pixel(column(x), y));
            (0..4).map(move |c| u64::from(a[c].abs_diff(b[c])))
        })
        .sum();
    total as f64 / f64::from(4 * width * height)
}

#[test]
fn mirrored_scenes_give_mirrored_pictures() {
    let shape = |side: f64| {
        ball([0.0; 3], 0.22)
            .union(ball([0.16, 0.2 * side, 0.1], 0.12))
            .union(ball([0.2, -0.1 * side, -0.15], 0.1))
    };
    let picture = |side: f64| {
        let lighting = Lighting {
            key_azimuth: -40.0 * side,
            ..Lighting::default()
        };
        let view = scene(&shape(side))
            .quality(Quality::Standard)
            .framing(Framing::Domain);
        let view = view.azimuth(20.0 * side).elevation(15.0).perspective(30.0);
        view.lighting(lighting).render(120).unwrap()
    };
    let mean = mean_difference(&picture(1.0), &picture(-1.0), |x| 119 - x);
    assert!(mean < 0.5, "{mean} levels");
}

/// A shape turned so that its axis `up` becomes the third one.
struct Upright<'a> {
    shape: &'a dyn SignedDistance<3>,
    up: UpAxis,
}

impl SignedDistance<3> for Upright<'_> {
    fn signed_distance(&self, x: [f64; 3]) -> f64 {
        let mut turned = x;
        turned.rotate_left(2 - self.up.index());
        self.shape.signed_distance(turned)
    }
}

#[test]
fn a_shape_seen_with_any_axis_up_is_the_turned_shape_seen_with_the_third_up() {
    let shape = ball([0.0, 0.1, -0.1], 0.2)
        .union(ball([0.16, 0.2, 0.1], 0.12))
        .union(ball([0.2, -0.1, -0.15], 0.1));
    let picture = |shape: &dyn SignedDistance<3>, up| {
        let view = scene(shape).quality(Quality::Standard).perspective(30.0);
        let view = view.up(up).azimuth(25.0).elevation(35.0);
        view.ground_shadow(0.5).render(120).unwrap()
    };
    let pictures = UpAxis::ALL.map(|up| {
        let seen = picture(&shape, up);
        let turned = picture(&Upright { shape: &shape, up }, UpAxis::Z);
        // The samples of light are not turned along.
        let mean = mean_difference(&seen, &turned, |x| x);
        assert!(mean < 0.5, "{mean} levels with {up} up");
        seen
    });
    for up in [UpAxis::X, UpAxis::Y] {
        let mean = mean_difference(&pictures[up.index()], &pictures[2], |x| x);
        assert!(mean > 5.0, "{mean} levels between {up} and z up");
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let view = scene(&Cross::new(0.4, 0.13).unwrap())
        .azimuth(30.0)
        .elevation(20.0)
        .ground_shadow(0.5)
        .tube(Tube::new([[0.0; 3], [0.5; 3]], 0.02));
    let bytes = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap()
            .install(|| view.render((90, 70)).unwrap().to_png().unwrap())
    };
    assert!(bytes(1) == bytes(2));
}

#[test]
fn bounds_are_those_of_the_surface() {
    let bounds = scene(&ball([0.1, 0.0, -0.1], 0.25)).bounds().unwrap();
    let expected = Bounds {
        low: [-0.15, -0.25, -0.35],
        high: [0.35, 0.25, 0.15],
    };
    for axis in 0..3 {
        assert!(
            (bounds.low[axis] - expected.low[axis]).abs() < 2e-3,
            "{bounds:?}"
        );
        assert!(
            (bounds.high[axis] - expected.high[axis]).abs() < 2e-3,
            "{bounds:?}"
        );
    }
    assert!((bounds.radius() - 0.25 * 3.0_f64.sqrt()).abs() < 3e-3);
}

#[test]
fn signed_distances_are_drawn_like_phase_fields() {
    let shape = ball([0.0; 3], 0.3);
    let distance = Field::from_fn(Grid::centred(64, 1.0).unwrap(), |x| {
        shape.signed_distance(x)
    });
    let view = Scene::from_signed_distance(&distance)
        .unwrap()
        .quality(Quality::Draft);
    let other = Scene::new(&field(&shape), EPS)
        .unwrap()
        .quality(Quality::Draft);
    let (a, b) = (view.render(80).unwrap(), other.render(80).unwrap());
    let differ = a.pixels().iter().zip(b.pixels());
    assert!(differ.filter(|(a, b)| a[0].abs_diff(b[0]) > 6).count() < 20);
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let u = field(&ball([0.0; 3], 0.3));
    for eps in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            Scene::new(&u, eps),
            Err(Error::Parameter { name: "eps", .. })
        ));
    }
    let mut broken = u.clone();
    broken.values_mut()[77] = f64::NAN;
    let refused = |scene: Result<Scene<'_>, Error>| {
        matches!(
            scene,
            Err(Error::Geometry(geometry::Error::NonFinite {
                index: 77,
                ..
            }))
        )
    };
    assert!(refused(Scene::new(&broken, EPS)));
    assert!(refused(Scene::from_signed_distance(&broken)));
    let good = || Scene::new(&u, EPS).unwrap();
    assert!(refused(good().highlight_mask(&broken, Rgb::SKY)));

    let flat = |framing| good().framing(framing);
    let point = Bounds {
        low: [0.1; 3],
        high: [0.1; 3],
    };
    let inverted = Bounds {
        low: [0.1; 3],
        high: [0.0; 3],
    };
    let no_ball = Framing::Ball {
        centre: [0.0; 3],
        radius: 0.0,
    };
    let dark = Lighting {
        softness: 90.0,
        ..Lighting::default()
    };
    let shiny = render::Material {
        roughness: 0.0,
        ..render::Material::default()
    };
    for (what, scene) in [
        ("elevation", good().elevation(90.1)),
        ("elevation", good().elevation(f64::NAN)),
        ("azimuth", good().azimuth(f64::INFINITY)),
        ("field of view", good().perspective(0.0)),
        ("field of view", good().perspective(180.0)),
        ("margin", good().margin(0.5)),
        ("diagonal of the framed box", flat(Framing::Within(point))),
        ("side of the framed box", flat(Framing::Within(inverted))),
        ("radius of the framed ball", flat(no_ball)),
        ("softness", good().lighting(dark)),
        ("roughness", good().material(shiny)),
        ("strength of the ground shadow", good().ground_shadow(1.5)),
        (
            "radius of a tube",
            good().tube(Tube::new([[0.0; 3], [0.1; 3]], -0.1)),
        ),
    ] {
        let error = scene.render(10).unwrap_err();
        assert!(
            matches!(error, Error::Parameter { name, .. } if name == what),
            "{what}: {error}"
        );
    }
    let tube = good().tube(Tube::new([[0.2; 3], [0.2; 3]], 0.1)).render(10);
    assert!(matches!(
        tube,
        Err(Error::TubePoints {
            index: 0,
            points: 1
        })
    ));
    for size in [(0, 10), (10, 0), (10, 9000)] {
        assert!(matches!(
            good().render(size),
            Err(Error::PictureSize { .. })
        ));
    }
    let empty = Field::constant(*u.grid(), -1.0);
    let nothing = Scene::new(&empty, EPS).unwrap();
    assert!(matches!(nothing.render(10), Err(Error::NothingToFrame)));
    assert!(nothing.bounds().is_none());
    let blank = nothing
        .framing(Framing::Domain)
        .ground_shadow(1.0)
        .render(10)
        .unwrap();
    assert!(blank.pixels().iter().all(|&p| p == [255; 4]));
}

/// Frames of a PNG or APNG file with their delays in milliseconds.
fn decoded(bytes: &[u8]) -> (png::ColorType, Option<png::AnimationControl>, Vec<Vec<u8>>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
        .read_info()
        .unwrap();
    let info = reader.info();
    let (colour, control) = (info.color_type, info.animation_control);
    let count = control.map_or(1, |c| c.num_frames);
    let frames = (0..count).map(|_| {
        let mut data = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut data).unwrap();
        data
    });
    let frames = frames.collect();
    (colour, control, frames)
}

#[test]
fn files_hold_the_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let view = scene(&ball([0.1, 0.0, 0.0], 0.2));
    let picture = view.render((40, 30)).unwrap();
    let path = folder.path().join("ball.png");
    picture.write_png(&path).unwrap();
    let (colour, control, frames) = decoded(&std::fs::read(&path).unwrap());
    assert!(colour == png::ColorType::Rgba && control.is_none());
    assert_eq!(frames[0], picture.pixels().as_flattened());
    for picture in [&picture, &picture.over(Rgb::WHITE)] {
        let again = Picture::from_png(&picture.to_png().unwrap()).unwrap();
        assert_eq!(again.pixels(), picture.pixels());
    }
    assert!(Picture::from_png(b"no picture").is_err());
    let (colour, _, frames) = decoded(&picture.over(Rgb::WHITE).to_png().unwrap());
    assert_eq!(
        (colour, frames[0].len()),
        (png::ColorType::Rgb, 3 * 40 * 30)
    );

    let turn = view
        .turntable(4, (40, 30), Duration::from_millis(120))
        .unwrap();
    let path = folder.path().join("turn.png");
    turn.write_apng(&path).unwrap();
    let (_, control, frames) = decoded(&std::fs::read(&path).unwrap());
    let control = control.unwrap();
    assert_eq!((control.num_frames, control.num_plays), (4, 0));
    for (frame, picture) in frames.iter().zip(turn.frames()) {
        assert_eq!(frame, picture.pixels().as_flattened());
    }

    let second = Duration::from_secs(1);
    assert!(matches!(
        Animation::new(vec![], second),
        Err(Error::NoFrames)
    ));
    let other = Picture::new(2, 1, vec![[0; 4]; 2]).unwrap();
    let mixed = Animation::new(vec![picture.clone(), other], second);
    assert!(matches!(
        mixed,
        Err(Error::FrameSize {
            index: 1,
            width: 2,
            ..
        })
    ));
    let never = Animation::new(vec![picture], Duration::ZERO);
    assert!(matches!(never, Err(Error::Parameter { .. })));
    assert!(matches!(
        Picture::new(2, 2, vec![[0; 4]; 3]),
        Err(Error::PixelCount { actual: 3, .. })
    ));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, rng_seed: RngSeed::Fixed(5), ..ProptestConfig::default() })]

    /// Any finite values and any camera give a picture or a typed error.
    #[test]
    fn nothing_panics(
        values in prop::collection::vec(prop_oneof![-1.5..1.5, any::<f64>(), Just(0.0)], 64),
        exponent in -20..20_i32,
        angles in [-720.0..720.0_f64, -100.0..100.0],
        view in prop_oneof![Just(None), (-5.0..130.0_f64).prop_map(Some)],
        ends in prop::collection::vec(prop::array::uniform3(-2.0..2.0_f64), 0..5),
    ) {
        let grid = Grid::new(4, 10.0_f64.powi(exponent)).unwrap();
        let Ok(u) = Field::from_values(grid, values) else { return Ok(()) };
        let scene = Scene::new(&u, 0.3 * grid.side()).unwrap().quality(Quality::Draft);
        let camera = Camera { azimuth: angles[0], elevation: angles[1], ..Camera::default() };
        let mut scene = scene.camera(camera).ground_shadow(0.5);
        scene = match view { None => scene.orthographic(), Some(angle) => scene.perspective(angle) };
        if !ends.is_empty() {
            let points: Vec<[f64; 3]> = ends.iter().map(|p| p.map(|c| c * grid.side())).collect();
            scene = scene.tube(Tube::new(points, 0.1 * grid.side()).closed());
        }
        match scene.render((9, 7)) {
            Ok(picture) => prop_assert_eq!(picture.pixels().len(), 63),
            Err(error) => prop_assert!(
                matches!(
                    error,
                    Error::Parameter { .. } | Error::NothingToFrame | Error::TubePoints { .. }
                ),
                "{}", error
            ),
        }
    }
}
