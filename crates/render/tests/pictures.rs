//! Pictures looked at: outlines, light, tubes, colours, files.

use std::f64::consts::PI;

use geometry::measure::BoundingBox;
use geometry::shapes::{Ball, Cross, Cuboid};
use geometry::{Field, Grid, SignedDistance, SignedDistanceExt, UpAxis, phase_field};
use proptest::prelude::*;
use render::{Error, Picture, Quality, Rgb, Scene, Tube, View, animation};
use surfaces::TriangleMesh;

const EPS: f64 = 2.0 / 64.0;
/// The box of the grid.
const BOX: BoundingBox<3> = BoundingBox {
    lower: [-0.5; 3],
    upper: [0.5; 3],
};

/// The phase field of a shape in `[-0.5, 0.5]^3` at n = 64.
fn field(shape: &dyn SignedDistance<3>) -> Field<3> {
    phase_field(Grid::centred(64, 1.0).unwrap(), shape, EPS).unwrap()
}

fn view(azimuth: f64, elevation: f64) -> View {
    View {
        up: UpAxis::Z,
        azimuth,
        elevation,
    }
}

/// A quick scene from +x: y grows to the right and z upwards.
fn scene(shape: &dyn SignedDistance<3>) -> Scene {
    let scene = Scene::new(&field(shape), EPS).unwrap();
    scene.quality(Quality::Draft).view(view(0.0, 0.0))
}

fn ball(centre: [f64; 3], radius: f64) -> Ball<3> {
    Ball::new(centre, radius).unwrap()
}

/// Whether something other than the white background is seen in a pixel.
fn is_drawn(picture: &Picture, x: u32, y: u32) -> bool {
    picture.pixel(x, y) != [255; 4]
}

/// Area and centre of what is drawn, in pixels.
fn silhouette(picture: &Picture) -> (f64, [f64; 2]) {
    let (mut area, mut moment) = (0.0, [0.0; 2]);
    let [width, height] = picture.size();
    for y in 0..height {
        for x in 0..width {
            let cover = f64::from(u8::from(is_drawn(picture, x, y)));
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

/// Distance of the camera from the middle of [`BOX`], and pixels for each unit of slope, in a
/// picture of 640 pixels that shows it from +x: the nearest face fills 96 per cent.
fn camera() -> (f64, f64) {
    let tangent = 11.0_f64.to_radians().tan();
    (0.5 + 0.5 / (0.96 * tangent), 320.0 / tangent)
}

#[test]
fn the_outline_of_a_ball_is_the_cone_that_touches_it() {
    let (distance, focal) = camera();
    for (centre, up, expected) in [
        ([0.0, 0.0, 0.0], UpAxis::Z, [0.0, 0.0]),
        ([0.0, -0.08, 0.06], UpAxis::Z, [-0.08, -0.06]),
        // From +z, y pointing up: from +x to the right.
        ([0.1, 0.08, 0.0], UpAxis::Y, [0.1, -0.08]),
    ] {
        let scene = scene(&ball(centre, 0.25)).within(BOX);
        let scene = scene.view(View {
            up,
            ..view(0.0, 0.0)
        });
        let (area, place) = silhouette(&scene.render([640; 2]).unwrap());
        let radius = focal * (0.25 / distance).asin().tan();
        assert!((area / (PI * radius * radius) - 1.0).abs() < 0.02, "{area}");
        for k in 0..2 {
            let expected = 320.0 + focal / distance * expected[k];
            assert!((place[k] - expected).abs() < 1.2, "{place:?} {expected}");
        }
    }
}

#[test]
fn a_shape_fills_its_picture() {
    let core = Cuboid::new([0.25, 0.05, 0.15]).unwrap();
    let shape = |x: [f64; 3]| core.signed_distance(x) - 0.05;
    for size in [[200, 150], [90, 140]] {
        let picture = scene(&shape).view(view(25.0, 30.0)).render(size).unwrap();
        let seen = |x: u32, y: u32| is_drawn(&picture, x, y);
        let [width, height] = size;
        let columns: Vec<u32> = (0..width)
            .filter(|&x| (0..height).any(|y| seen(x, y)))
            .collect();
        let rows = (0..height).filter(|&y| (0..width).any(|x| seen(x, y)));
        let tall = rows.count() as f64 / f64::from(height);
        let wide = columns.len() as f64 / f64::from(width);
        assert!((0.94..0.99).contains(&tall.max(wide)), "{wide} x {tall}");
        let free = [columns[0], width - 1 - columns[columns.len() - 1]];
        assert!(free[0].abs_diff(free[1]) < 3, "{free:?}");
    }
}

#[test]
fn surfaces_beside_each_other_have_one_frame() {
    let balls = [0.15, 0.3].map(|radius| ball([0.0; 3], radius));
    let vertices = balls.map(|ball| {
        let mesh = surfaces::phase_field_surface(&field(&ball), EPS);
        mesh.unwrap().vertices
    });
    let areas = balls.each_ref().map(|ball| {
        let scene = scene(ball).beside(vertices.concat());
        silhouette(&scene.render([200; 2]).unwrap()).0
    });
    // The larger one fills it, and the smaller one stays half as wide.
    let largest = PI / 4.0 * (0.96 * 200.0_f64).powi(2);
    assert!((areas[1] / largest - 1.0).abs() < 0.02, "{areas:?}");
    assert!((areas[0] / areas[1] - 0.25).abs() < 0.02, "{areas:?}");
}

#[test]
fn vertices_of_no_triangle_take_no_room() {
    let mut mesh = surfaces::phase_field_surface(&field(&ball([0.0; 3], 0.3)), EPS).unwrap();
    mesh.normals = None;
    let picture = |mesh: &TriangleMesh| {
        let scene = Scene::of_mesh(mesh.clone()).quality(Quality::Draft);
        scene.render([60; 2]).unwrap()
    };
    let before = picture(&mesh);
    mesh.vertices.push([9.0; 3]);
    assert_eq!(picture(&mesh), before);
}

#[test]
fn the_outline_is_smooth() {
    let picture = scene(&ball([0.0; 3], 0.3)).render([120; 2]).unwrap();
    for (at, pixel) in picture.pixels().iter().enumerate() {
        let [x, y] = [at % 120, at / 120].map(|c| c as f64 - 59.5);
        let radius = x.hypot(y);
        assert_eq!(pixel[3], 255);
        assert!(radius < 59.0 || *pixel == [255; 4], "{x} {y}");
        assert!(radius > 56.0 || pixel[2] < 250, "{x} {y}");
    }
}

#[test]
fn a_ball_is_brightest_towards_the_key_light() {
    let picture = scene(&ball([0.0; 3], 0.4)).render([120; 2]).unwrap();
    let best = (0..120 * 120)
        .map(|k| (k % 120, k / 120))
        .filter(|&(x, y)| (f64::from(x) - 59.5).hypot(f64::from(y) - 59.5) < 54.0)
        .max_by_key(|&(x, y)| brightness(&picture, x, y))
        .unwrap();
    // From the upper left; sky and gloss draw the maximum up and towards the camera.
    assert!(
        (25..50).contains(&best.0) && (8..45).contains(&best.1),
        "{best:?}"
    );
}

#[test]
fn corners_are_darker_than_free_faces() {
    let picture = scene(&Cross::new(0.4, 0.13).unwrap())
        .within(BOX)
        .quality(Quality::Standard)
        .render([200; 2])
        .unwrap();
    // All of these faces look towards +x; y grows to the right, and the key light is on the left.
    let at = |y: f64| brightness(&picture, (200.0 * (y + 0.5)) as u32, 100);
    let (corner, end) = (at(0.16), at(0.33));
    assert!(corner + 30 < end, "{corner} {end}");
}

#[test]
fn shadows_fall_away_from_the_key_light() {
    // A small ball between a large one and the light.
    let large = ball([0.0, 0.0, -0.1], 0.3);
    let picture = |shape: &dyn SignedDistance<3>| {
        let scene = scene(shape).within(BOX);
        scene.render([120; 2]).unwrap()
    };
    let with = picture(&large.union(ball([0.25, -0.16, 0.26], 0.08)));
    let without = picture(&large);
    let darker = |x: u32, y: u32| brightness(&without, x, y) - brightness(&with, x, y);
    let most = (0..120 * 120)
        .map(|k| (k % 120, k / 120))
        .filter(|&(_, y)| y > 48)
        .max_by_key(|&(x, y)| darker(x, y))
        .unwrap();
    assert!(darker(most.0, most.1) > 90, "{most:?}");
    assert!(
        (38..66).contains(&most.0) && (48..66).contains(&most.1),
        "{most:?}"
    );
    assert!(darker(75, 90).abs() < 30, "no shadow there");
}

#[test]
fn tubes_hide_and_are_hidden() {
    let red = Rgb(200, 30, 30);
    let tube = |x: f64| Tube {
        colour: red,
        ..Tube::new([[x, -0.45, 0.0], [x, 0.45, 0.0]], 0.03)
    };
    let picture = |tube: Tube| {
        let scene = scene(&ball([0.0; 3], 0.3)).within(BOX);
        scene.tubes([tube]).render([100; 2]).unwrap()
    };
    let is_red = |p: &Picture, x: u32| {
        let [r, g, b, _] = p.pixel(x, 50).map(i32::from);
        r > 2 * g && r > 2 * b
    };
    let (behind, before) = (picture(tube(-0.4)), picture(tube(0.4)));
    assert!(!is_red(&behind, 50) && is_red(&before, 50));
    assert!(is_red(&behind, 18) && is_red(&before, 10));
    // Half in, half out: the tube through the middle shows outside the ball alone.
    let through = picture(tube(0.0));
    assert!(!is_red(&through, 50) && is_red(&through, 14));
    // And one in front casts a shadow on the ball.
    let sum = |p: &Picture| (60..70).map(|y| brightness(p, 50, y)).sum::<i32>();
    assert!(
        sum(&before) + 50 < sum(&behind),
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
    let picture = |tubes: Vec<Tube>| {
        let scene = Scene::of_mesh(TriangleMesh::default()).tubes(tubes);
        scene.view(view(0.0, 0.0)).render([100; 2]).unwrap()
    };
    let open = picture(vec![Tube::new(square, 0.02)]);
    let closed = picture(vec![Tube {
        closed: true,
        ..Tube::new(square, 0.02)
    }]);
    assert!(!is_drawn(&open, 5, 50) && is_drawn(&closed, 5, 50));
    assert!(is_drawn(&open, 94, 50) && !is_drawn(&closed, 50, 50));
    let edges = Tube::edges_of_box([-0.3; 3], [0.3; 3], 0.02);
    assert_eq!(edges.len(), 12);
    let boxed = picture(edges);
    for (x, y) in [(5, 50), (94, 50), (50, 5), (50, 94)] {
        assert!(is_drawn(&boxed, x, y), "{x} {y}");
    }
}

#[test]
fn a_mask_has_its_colour() {
    let mask = Field::from_fn(Grid::centred(32, 1.0).unwrap(), |[_, y, _]| {
        f64::from(u8::from(y > 0.0))
    });
    let scene = scene(&ball([0.0; 3], 0.3)).highlight_mask(&mask, Rgb(30, 60, 200));
    let picture = scene.unwrap().render([100; 2]).unwrap();
    let is_blue = |x| picture.pixel(x, 50)[2] > picture.pixel(x, 50)[0].saturating_add(40);
    assert!(is_blue(56) && !is_blue(44));
}

#[test]
fn vertices_have_the_colours_that_they_are_painted_with() {
    let mesh = surfaces::phase_field_surface(&field(&ball([0.0; 3], 0.3)), EPS).unwrap();
    let colour = |x: &[f64; 3]| {
        if x[1] > 0.0 {
            Rgb(30, 60, 200)
        } else {
            Rgb::CLAY
        }
    };
    let colours: Vec<Rgb> = mesh.vertices.iter().map(colour).collect();
    let scene = || Scene::of_mesh(mesh.clone()).view(view(0.0, 0.0));
    let picture = scene().painted(colours).unwrap().render([100; 2]).unwrap();
    let is_blue = |x| picture.pixel(x, 50)[2] > picture.pixel(x, 50)[0].saturating_add(40);
    assert!(is_blue(56) != is_blue(44));
    assert!(scene().painted(vec![Rgb::CLAY]).is_err());
}

/// Mean difference of all values, in levels.
fn mean_difference(a: &Picture, b: &Picture) -> f64 {
    let [a, b] = [a, b].map(|picture| picture.pixels().as_flattened());
    let total: u64 = a
        .iter()
        .zip(b)
        .map(|(a, b)| u64::from(a.abs_diff(*b)))
        .sum();
    total as f64 / a.len() as f64
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
        let scene = scene(shape).view(View {
            up,
            ..view(25.0, 35.0)
        });
        scene.render([120; 2]).unwrap()
    };
    let pictures = UpAxis::ALL.map(|up| {
        let seen = picture(&shape, up);
        let turned = picture(&Upright { shape: &shape, up }, UpAxis::Z);
        // The directions of light are not turned along.
        let mean = mean_difference(&seen, &turned);
        assert!(mean < 0.7, "{mean} levels with {up} up");
        seen
    });
    for up in [UpAxis::X, UpAxis::Y] {
        let mean = mean_difference(&pictures[up.index()], &pictures[2]);
        assert!(mean > 5.0, "{mean} levels between {up} and z up");
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let scene = scene(&Cross::new(0.4, 0.13).unwrap())
        .view(view(30.0, 20.0))
        .tubes([Tube::new([[0.0; 3], [0.5; 3]], 0.02)]);
    let bytes = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap()
            .install(|| scene.render([90, 70]).unwrap().to_png().unwrap())
    };
    assert!(bytes(1) == bytes(2));
}

#[test]
fn fields_and_meshes_are_drawn_alike() {
    let shape = ball([0.1, 0.0, -0.1], 0.25);
    let mesh = surfaces::phase_field_surface(&field(&shape), EPS).unwrap();
    let picture = |scene: Scene| {
        let bounds = scene.bounds().unwrap();
        for axis in 0..3 {
            let [low, high] = [bounds.lower, bounds.upper].map(|x| x[axis]);
            let middle = [0.1, 0.0, -0.1][axis];
            assert!((low - middle + 0.25).abs() < 2e-3 && (high - middle - 0.25).abs() < 2e-3);
        }
        scene.quality(Quality::Draft).render([80; 2]).unwrap()
    };
    let reference = picture(Scene::new(&field(&shape), EPS).unwrap());
    let mean = mean_difference(&picture(Scene::of_mesh(mesh)), &reference);
    assert!(mean < 0.5, "{mean} levels");
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let u = field(&ball([0.0; 3], 0.3));
    for eps in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            Scene::new(&u, eps),
            Err(Error::Geometry(geometry::Error::InvalidParameter {
                name: "eps",
                ..
            }))
        ));
    }
    let mut broken = u.clone();
    broken.values_mut()[77] = f64::NAN;
    let refused = |scene: Result<Scene, Error>| {
        let error = scene.map(|_| ()).unwrap_err();
        matches!(
            error,
            Error::Geometry(geometry::Error::NonFinite { index: 77, .. })
        )
    };
    assert!(refused(Scene::new(&broken, EPS)));
    let good = || Scene::new(&u, EPS).unwrap();
    assert!(refused(good().highlight_mask(&broken, Rgb::SKY)));

    let within = |lower, upper| {
        let [lower, upper] = [[lower; 3], [upper; 3]];
        good().within(BoundingBox { lower, upper })
    };
    for (what, scene) in [
        ("elevation", good().view(view(0.0, 90.1))),
        ("elevation", good().view(view(0.0, f64::NAN))),
        ("azimuth", good().view(view(f64::INFINITY, 0.0))),
        ("extent of what is framed", within(0.1, 0.1)),
        ("side of the framed box", within(0.1, 0.0)),
        (
            "lower end of the framed box",
            within(f64::NEG_INFINITY, 0.0),
        ),
        (
            "radius of a tube",
            good().tubes([Tube::new([[0.0; 3], [0.1; 3]], -0.1)]),
        ),
    ] {
        let error = scene.render([10; 2]).unwrap_err();
        assert!(
            matches!(error, Error::Geometry(geometry::Error::InvalidParameter { name, .. }) if name == what),
            "{what}: {error}"
        );
    }
    let tube = good().tubes([Tube::new([[0.2; 3], [0.2; 3]], 0.1)]);
    assert!(matches!(
        tube.render([10; 2]),
        Err(Error::TubePoints {
            index: 0,
            points: 1
        })
    ));
    for size in [[0, 10], [10, 0], [10, 9000]] {
        assert!(matches!(
            good().render(size),
            Err(Error::PictureSize { .. })
        ));
    }
    let empty = Field::constant(*u.grid(), -1.0);
    let nothing = Scene::new(&empty, EPS).unwrap();
    assert!(matches!(
        nothing.render([10; 2]),
        Err(Error::NothingToFrame)
    ));
    assert!(nothing.bounds().is_none());
    let blank = nothing.within(BOX).render([10; 2]).unwrap();
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
    let pixels = (0..1200).map(|k| [k, k / 2, 9, k / 5].map(|v| v as u8));
    let picture = Picture::new([40, 30], pixels.collect()).unwrap();
    let path = folder.path().join("ball.png");
    picture.write_png(&path).unwrap();
    let (colour, control, frames) = decoded(&std::fs::read(&path).unwrap());
    assert!(colour == png::ColorType::Rgba && control.is_none());
    assert_eq!(frames[0], picture.pixels().as_flattened());
    let opaque = Picture::new([2, 1], vec![[1, 2, 3, 255]; 2]).unwrap();
    let (colour, _, frames) = decoded(&opaque.to_png().unwrap());
    assert!(colour == png::ColorType::Rgb && frames[0] == [1, 2, 3, 1, 2, 3]);

    let pictures = [
        picture.clone(),
        Picture::new([40, 30], vec![[7; 4]; 1200]).unwrap(),
    ];
    let animated = |pictures: &[Picture]| -> Result<Vec<u8>, Error> {
        animation(pictures.len(), |index| Ok(pictures[index].clone()))
    };
    let bytes = animated(&pictures).unwrap();
    let (_, control, frames) = decoded(&bytes);
    let control = control.unwrap();
    assert_eq!((control.num_frames, control.num_plays), (2, 0));
    for (frame, picture) in frames.iter().zip(&pictures) {
        assert_eq!(frame, picture.pixels().as_flattened());
    }

    assert!(matches!(animated(&[]), Err(Error::NoFrames)));
    let mixed = animated(&[picture, opaque]);
    assert!(matches!(mixed, Err(Error::FrameSize { index: 1, .. })));
    assert!(matches!(
        Picture::new([2, 2], vec![[0; 4]; 3]),
        Err(Error::PixelCount { actual: 3, .. })
    ));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Any finite values and any view give a picture or a typed error.
    #[test]
    fn nothing_panics(
        values in prop::collection::vec(prop_oneof![-1.5..1.5, any::<f64>(), Just(0.0)], 64),
        exponent in -20..20_i32,
        angles in [-720.0..720.0_f64, -100.0..100.0],
        ends in prop::collection::vec(prop::array::uniform3(-2.0..2.0_f64), 0..5),
    ) {
        let grid = Grid::new(4, 10.0_f64.powi(exponent)).unwrap();
        let Ok(u) = Field::from_values(grid, values) else { return Ok(()) };
        let scene = Scene::new(&u, 0.3 * grid.side()).unwrap().quality(Quality::Draft);
        let mut scene = scene.view(view(angles[0], angles[1]));
        if !ends.is_empty() {
            let points: Vec<[f64; 3]> = ends.iter().map(|p| p.map(|c| c * grid.side())).collect();
            scene = scene.tubes([Tube { closed: true, ..Tube::new(points, 0.1 * grid.side()) }]);
        }
        match scene.render([9, 7]) {
            Ok(picture) => prop_assert_eq!(picture.pixels().len(), 63),
            Err(error) => prop_assert!(
                matches!(
                    error,
                    Error::Geometry(_) | Error::NothingToFrame | Error::TubePoints { .. }
                ),
                "{}", error
            ),
        }
    }
}
