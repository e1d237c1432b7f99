//! Surfaces of bodies in volumes.

use std::f64::consts::PI;

use volumes::{Body, Inside, Volume};

/// Labels 1 where a function is negative at the centre of a voxel, else 0.
fn labelled(size: [usize; 3], sides: [f64; 3], inside: impl Fn([f64; 3]) -> f64) -> Volume {
    let [x, y, z] = size;
    let place = |index: [usize; 3]| [0, 1, 2].map(|axis| index[axis] as f64 * sides[axis]);
    let voxels = (0..x * y * z).map(|v| [v % x, v / x % y, v / (x * y)]);
    let labels = voxels.map(|index| u8::from(inside(place(index)) < 0.0));
    Volume::of_labels(size, [0.0; 3], sides, labels.collect()).unwrap()
}

fn distance(x: [f64; 3], centre: [f64; 3]) -> f64 {
    (0..3)
        .map(|i| (x[i] - centre[i]).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// Root of the mean square and largest distance of the vertices from a sphere as large as the body.
fn off_the_sphere(body: &Body, centre: [f64; 3]) -> (f64, f64) {
    let radius = (0.75 / PI * body.surface.volume()).cbrt();
    let vertices = &body.surface.mesh().vertices;
    let off = vertices.iter().map(|&x| distance(x, centre) - radius);
    let (sum, largest) = off.fold((0.0, 0.0_f64), |(s, l), d| (s + d * d, l.max(d.abs())));
    ((sum / vertices.len() as f64).sqrt(), largest)
}

fn count(volume: &Volume) -> f64 {
    volume.labels().unwrap()[1].1 as f64
}

#[test]
fn steps_are_taken_off_and_the_volume_stays() {
    for (sides, rms, largest) in [
        // Raw, they are off by 0.28 and 0.87 of a voxel.
        ([1.0; 3], 0.1, 0.4),
        ([0.5, 0.5, 1.0], 0.1, 0.4),
    ] {
        let size = sides.map(|side: f64| (38.0 / side) as usize);
        let centre = [18.3, 18.1, 18.45];
        let volume = labelled(size, sides, |x| distance(x, centre) - 16.0);
        let body = volume.body(Inside::Label(1.0)).unwrap();
        let voxels = count(&volume) * sides.iter().product::<f64>();
        assert!(
            (body.surface.volume() / voxels - 1.0).abs() < 1e-12,
            "{body:?}"
        );
        assert_eq!(body.surface.euler_characteristic(), 2);
        let off = off_the_sphere(&body, centre);
        assert!(off.0 < rms && off.1 < largest, "{sides:?}: {off:?}");
    }
}

/// Outside of the volume is outside, half a voxel from the outermost centres.
#[test]
fn bodies_end_at_the_side_of_the_volume() {
    let volume = labelled([24, 10, 20], [1.0, 2.0, 1.0], |x| x[0] - 15.5);
    let body = volume.body(Inside::Label(1.0)).unwrap();
    assert!((body.surface.volume() - 6400.0).abs() < 1e-6);
    let bounds = body.surface.bounding_box();
    for (axis, high) in [15.5, 19.0, 19.5].into_iter().enumerate() {
        let side = if axis == 1 { 2.0 } else { 1.0 };
        let off = [bounds.lower[axis] + 0.5 * side, bounds.upper[axis] - high];
        assert!(off.iter().all(|x| x.abs() < 0.5 * side), "{bounds:?}");
    }
    // A voxel alone, and what is joined by an edge only.
    for inside in [
        |x: [f64; 3]| distance(x, [2.0, 2.0, 1.0]) - 0.5,
        |x: [f64; 3]| if (x[0] - x[1]).abs() < 0.5 { -1.0 } else { 1.0 },
    ] {
        let volume = labelled([5, 5, 3], [1.0; 3], inside);
        let body = volume.body(Inside::Label(1.0)).unwrap();
        assert!(
            (body.surface.volume() / count(&volume) - 1.0).abs() < 1e-9,
            "{body:?}"
        );
    }
}

/// Values that are not labels are interpolated.
#[test]
fn a_threshold_is_a_level_of_the_values() {
    let centre = [12.3, 11.7, 11.2];
    let values = |x| (40.0 + 8.0 * (9.0 - distance(x, centre))).clamp(0.0, 255.0);
    let mut volume = labelled([24; 3], [1.0; 3], |_| 1.0);
    for (threshold, radius) in [(40.0, 9.0), (80.0, 4.0)] {
        let labels = (0..24 * 24 * 24_usize).map(|v| [v % 24, v / 24 % 24, v / 576]);
        let labels = labels.map(|index| values(index.map(|i| i as f64)) as u8);
        volume = Volume::of_labels([24; 3], [0.0; 3], [1.0; 3], labels.collect()).unwrap();
        let body = volume.body(Inside::Above(threshold)).unwrap();
        let off = off_the_sphere(&body, centre);
        let exact = 4.0 / 3.0 * PI * radius * radius * radius;
        assert!(off.0 < 0.1, "{off:?}");
        // Values are rounded down, which makes the radius less by a sixteenth on the average.
        assert!(
            (body.surface.volume() / exact - 1.0).abs() < 0.08,
            "{} {exact}",
            body.surface.volume()
        );
    }
    let error = volume.body(Inside::Above(255.0)).unwrap_err();
    assert!(
        error.to_string().starts_with("no voxel is above 255"),
        "{error}"
    );
}

/// Specks and bubbles of wrong labels are left out with their volume.
#[test]
fn specks_are_left_out() {
    let centre = [11.4, 11.2, 11.6];
    let volume = labelled([24; 3], [1.0; 3], |x| {
        let index = x.map(|v| v as usize);
        let wrong = (index[0] * 7 + index[1] * 13 + index[2] * 29) % 11 == 0;
        let distance = distance(x, centre) - 8.0;
        if wrong && distance.abs() < 1.5 {
            -distance
        } else {
            distance
        }
    });
    let marched = volume.body(Inside::Above(0.5)).unwrap();
    assert!(marched.surface.components() > 1);
    let body = volume.body(Inside::Label(1.0)).unwrap();
    assert_eq!(body.surface.components(), 1);
    let voxels = count(&volume) + body.filled as f64;
    assert!((body.surface.volume() / voxels - 1.0).abs() < 1e-9);
    assert!(off_the_sphere(&body, centre).0 < 0.5);

    // Without holes of one voxel inside, and such voxels outside, it is the ball.
    let specks = [
        [11, 11, 11],
        [8, 12, 13],
        [1, 1, 1],
        [22, 1, 22],
        [0, 12, 0],
    ];
    let [ball, body] = [&[][..], &specks].map(|specks| {
        let volume = labelled([24; 3], [1.0; 3], |x| {
            let depth = distance(x, centre) - 8.0;
            let is_speck = specks.contains(&x.map(|v| v as usize));
            if is_speck { -depth } else { depth }
        });
        volume.body(Inside::Label(1.0)).unwrap()
    });
    assert_eq!([body.specks as isize, body.filled], [5, 2 - 3]);
    assert!((body.surface.volume() / ball.surface.volume() - 1.0).abs() < 1e-12);
}
