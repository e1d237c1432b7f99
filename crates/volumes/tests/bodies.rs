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
    let filled: isize = body.specks.iter().map(|speck| speck.filled).sum();
    let voxels = count(&volume) + filled as f64;
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
    let mut found: Vec<_> = body
        .specks
        .iter()
        .map(|s| (s.place.map(f64::round), s.filled))
        .collect();
    found.sort_by(|a, b| a.partial_cmp(b).unwrap());
    let expected = [(0, -1), (1, -1), (8, 1), (11, 1), (22, -1)];
    for ((place, filled), (x, expected)) in found.iter().zip(expected) {
        assert_eq!((place[0], *filled), (f64::from(x), expected));
    }
    assert_eq!(found.len(), specks.len());
    assert!((body.surface.volume() / ball.surface.volume() - 1.0).abs() < 1e-12);
}

/// The signed distance of a vessel along the first axis, of this radius, with a sac of three times the radius beside it.
fn vessel_with_sac(x: [f64; 3], radius: f64) -> f64 {
    let tube = f64::hypot(x[1] - 12.3, x[2] - 16.2 - 2.0 * (x[0] / 12.0).sin()) - radius;
    let tube = tube.max(4.6 - x[0]).max(x[0] - 67.4);
    tube.min(distance(x, [36.2, 12.3 + 3.0 * radius, 16.4]) - 3.0 * radius)
}

/// Each part and each cavity encloses the volume of its voxels, also beside larger ones.
#[test]
fn each_part_has_its_own_volume() {
    let balls = [
        ([14.2, 18.1, 18.4], 12.0, true),
        ([14.2, 18.1, 18.4], 4.0, false),
        ([34.3, 18.2, 17.9], 6.5, true),
        ([46.1, 17.8, 18.1], 3.0, true),
        ([53.2, 18.1, 18.4], 1.9, true),
    ];
    let within = |x, ball: &([f64; 3], f64, bool)| distance(x, ball.0) < ball.1;
    let volume = labelled([60, 36, 36], [0.5, 0.5, 0.5], |x| {
        let x = x.map(|v| 2.0 * v);
        let found = balls.iter().rev().find(|ball| within(x, ball));
        if found.is_some_and(|ball| ball.2) {
            -1.0
        } else {
            1.0
        }
    });
    let body = volume.body(Inside::Label(1.0)).unwrap();
    let (parts, mesh) = (body.surface.parts(), body.surface.mesh());
    assert_eq!(parts.count(), balls.len());
    for (found, centre) in parts.volumes(mesh).into_iter().zip(parts.centroids(mesh)) {
        let is_it = |ball: &&([f64; 3], f64, bool)| {
            distance(ball.0, centre.map(|v| 2.0 * v)) < 0.5 && ball.2 == (found > 0.0)
        };
        let ball = balls.iter().find(is_it).unwrap();
        let voxels = (0..60 * 36 * 36_usize).map(|v| [v % 60, v / 60 % 36, v / (60 * 36)]);
        let voxels = voxels.filter(|index| within(index.map(|i| i as f64), ball));
        let expected = voxels.count() as f64 / 8.0;
        assert!(
            (found.abs() / expected - 1.0).abs() < 1e-9,
            "{found} {expected}"
        );
    }
}

/// A vessel does not lose to its sac: on one side of a plane between them there are as many voxels as before.
#[test]
fn each_place_has_its_own_volume() {
    for radius in [2.5, 4.0] {
        let volume = labelled([72, 40, 34], [1.0; 3], |x| vessel_with_sac(x, radius));
        let body = volume.body(Inside::Label(1.0)).unwrap();
        let place = (36.0 - 3.5 * radius).floor() + 0.5;
        let voxels = (0..72 * 40 * 34_usize).map(|v| [v % 72, v / 72 % 40, v / (72 * 40)]);
        let inside = voxels.filter(|&index| volume.value(index) > 0.5);
        let expected = inside.filter(|index| (index[0] as f64) < place).count() as f64;
        let found = volume_below(&body, place);
        assert!((found / expected - 1.0).abs() < 0.003, "{found} {expected}");
        // Without the volume of each place, 0.139 and 0.117.
        let vertices = &body.surface.mesh().vertices;
        let squares = vertices.iter().map(|&x| vessel_with_sac(x, radius).powi(2));
        let rms = (squares.sum::<f64>() / vertices.len() as f64).sqrt();
        assert!(rms < 0.112, "{rms}");
    }
}

/// The volume of a body on the lower side of a plane across the first axis, by the divergence theorem along the third one.
fn volume_below(body: &Body, place: f64) -> f64 {
    let mesh = body.surface.mesh();
    let under = |face: &[u32; 3]| {
        let corners = face.map(|v| mesh.vertices[v as usize]);
        let mut below = Vec::new();
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            if a[0] < place {
                below.push(a);
            }
            if (a[0] < place) != (b[0] < place) {
                let part = (place - a[0]) / (b[0] - a[0]);
                below.push([0, 1, 2].map(|k| a[k] + part * (b[k] - a[k])));
            }
        }
        let fan = (2..below.len()).map(|i| [below[0], below[i - 1], below[i]]);
        fan.map(|[a, b, c]| {
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            area * (a[2] + b[2] + c[2]) / 6.0
        })
        .sum::<f64>()
    };
    mesh.faces.iter().map(under).sum()
}
