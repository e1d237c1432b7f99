//! Walls between labels.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use chacha20::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use surfaces::{BACKGROUND, Bound, ClosedMesh, Error, LabelLattice, LabelMesh, decode};

use crate::common::{closed, dot, length, minus};

/// Random labels, which meet in every possible way.
fn random(seed: u64) -> LabelLattice {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    LabelLattice {
        size: [5, 6, 7],
        origin: [0.3, -2.0, 7.0],
        spacing: 0.5,
        labels: (0..5 * 6 * 7).map(|_| rng.random_range(0..5)).collect(),
    }
}

const RADIUS: f64 = 0.8;

fn axis(label: u32) -> [f64; 3] {
    let angle = 0.1 + TAU / 3.0 * f64::from(label);
    [angle.cos(), angle.sin(), 0.0]
}

/// By how much a point is deeper in one of the three sectors of a ball, or outside of it, than in another one.
fn between([a, b]: [u32; 2], x: [f64; 3]) -> (f64, [f64; 3]) {
    let outer = |sign: f64| {
        let away = length(x).max(1e-9);
        (
            2.0 * sign * (RADIUS - away),
            x.map(|v| -2.0 * sign * v / away),
        )
    };
    match [a, b] {
        [BACKGROUND, _] => outer(-1.0),
        [_, BACKGROUND] => outer(1.0),
        _ => {
            let slope = minus(axis(a), axis(b));
            (dot(slope, x), slope)
        }
    }
}

/// The three sectors of a ball.
fn sectors() -> LabelMesh {
    let mut lattice = LabelLattice {
        size: [20; 3],
        origin: [-0.95; 3],
        spacing: 0.1,
        labels: Vec::new(),
    };
    let nodes = (0..8000).map(|node| lattice.position([node / 400, node / 20 % 20, node % 20]));
    let label = |x: [f64; 3]| {
        let deepest = (1..=3).max_by(|&a, &b| between([a, b], x).0.total_cmp(&0.0));
        let is_inside = length(x) < RADIUS;
        deepest.filter(|_| is_inside).unwrap_or(BACKGROUND)
    };
    lattice.labels = nodes.map(label).collect();
    lattice.walls().unwrap()
}

/// How often the edges of a surface are run through in one direction more than in the other, and at most in one.
fn assert_closed(surface: &surfaces::TriangleMesh) {
    let mut edges = BTreeMap::new();
    for &[a, b, c] in &surface.faces {
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry(edge).or_insert(0) += 1;
        }
    }
    for ([a, b], count) in &edges {
        assert_eq!((count, edges.get(&[*b, *a])), (&1, Some(&1)));
    }
}

#[test]
fn every_label_is_closed_and_every_wall_is_there_once() {
    for seed in 0..20 {
        let lattice = random(seed);
        let walls = lattice.walls().unwrap();
        let volumes = walls.volumes(5);
        assert!(volumes.iter().sum::<f64>().abs() < 1e-12, "{volumes:?}");
        let mut faces = 0;
        for label in 0..5 {
            let surface = walls.of_label(label);
            assert_closed(&surface);
            faces += surface.faces.len();
            let volume = surface.volume();
            assert!((volume - volumes[label as usize]).abs() < 1e-12);
            if label != BACKGROUND {
                // A manifold around every vertex, too, outwards.
                let (surface, warnings) = ClosedMesh::new(surface).unwrap();
                assert!(warnings.is_empty() && surface.volume() > 0.0);
            }
        }
        // A wall has two sides, in opposite directions.
        assert_eq!(faces, 2 * walls.mesh.faces.len());
        assert!(
            walls
                .sides
                .iter()
                .all(|&[behind, before]| before == 0 || 0 < behind && behind < before)
        );
    }
}

#[test]
fn junctions_are_curves_of_three_labels() {
    let walls = sectors();
    let junctions = walls.junctions();
    let mut degree = BTreeMap::new();
    for vertex in junctions.as_flattened() {
        *degree.entry(*vertex).or_insert(0) += 1;
    }
    // An axis and three half circles end in the two poles.
    let mut ends: Vec<usize> = degree.into_values().filter(|n| *n != 2).collect();
    ends.sort_unstable();
    assert_eq!(ends, [4, 4]);
}

#[test]
fn relaxed_walls_are_where_labels_are_equally_deep_and_have_good_triangles() {
    let walls = sectors().relaxed(8, &between);
    let exact = 4.0 / 9.0 * PI * RADIUS.powi(3);
    for volume in &walls.volumes(4)[1..] {
        assert!((volume / exact - 1.0).abs() < 6e-3, "{volume} {exact}");
    }
    for (face, &sides) in walls.mesh.faces.iter().zip(&walls.sides) {
        for vertex in face.map(|v| walls.mesh.vertices[v as usize]) {
            let (off, _) = between(sides, vertex);
            assert!(off.abs() < 1e-3, "{vertex:?} is off by {off}");
        }
    }
    let angles = walls.mesh.faces.iter().map(|face| {
        let [a, b, c] = face.map(|v| walls.mesh.vertices[v as usize]);
        let angle = |a, b, c| {
            let (u, v) = (minus(b, a), minus(c, a));
            (dot(u, v) / (length(u) * length(v)))
                .clamp(-1.0, 1.0)
                .acos()
        };
        angle(a, b, c).min(angle(b, c, a)).min(angle(c, a, b))
    });
    let bad = angles.filter(|angle| *angle < FRAC_PI_2 / 6.0).count();
    let part = bad as f64 / walls.mesh.faces.len() as f64;
    assert!(part < 0.02, "{part}");
    (0..4).for_each(|label| assert_closed(&walls.of_label(label)));
}

#[test]
fn labels_get_their_volumes_also_within_a_bound() {
    let walls = sectors().relaxed(8, &between);
    let third = 4.0 / 9.0 * PI * RADIUS.powi(3);
    let wanted = [0.0, third, 1.03 * third, 0.98 * third];
    let moved = walls.with_volumes(&wanted, |_| true);
    let assert_volumes = |walls: &LabelMesh, error: f64| {
        for (found, wanted) in walls.volumes(4).iter().zip(wanted).skip(1) {
            assert!((found / wanted - 1.0).abs() < error, "{found} {wanted}");
        }
    };
    assert_volumes(&moved, 1e-9);
    let parts: Vec<ClosedMesh> = (1..4).map(|label| closed(walls.of_label(label))).collect();
    let bound = Bound::of_nearest(&parts, 0.004);
    let held = moved.held(&bound, |walls, free| {
        walls.with_volumes(&wanted, |vertex| free[vertex])
    });
    let lengths = bound.lengths(&held.mesh);
    assert!(lengths.iter().all(|length| *length <= 0.004 * (1.0 + 1e-8)));
    // The bound wins over the volumes.
    assert!(bound.reached(&held.mesh).contains(&true));
    let roomy = Bound::of_nearest(&parts, 0.1);
    assert_volumes(&moved.held(&roomy, |walls, _| walls.clone()), 1e-9);
}

#[test]
fn files_have_the_labels_on_both_sides() {
    let walls = random(3).walls().unwrap();
    let names = [0, 4, -7, 100_000, 9];
    let ply = walls.encode("walls.ply", &names).unwrap();
    let read = decode(&ply, "walls.ply").unwrap();
    assert_eq!(read, walls.mesh);
    let last = walls.sides.last().unwrap().map(|side| names[side as usize]);
    let last: Vec<u8> = last.iter().flat_map(|name| name.to_le_bytes()).collect();
    assert_eq!(ply[ply.len() - 8..], last);
    let header = String::from_utf8_lossy(&ply[..600]);
    assert!(header.contains("property int label_behind\nproperty int label_ahead\n"));
    let obj = walls.encode("walls.obj", &names).unwrap();
    let read = decode(&obj, "walls.obj").unwrap();
    assert_eq!(read.vertices, walls.mesh.vertices);
    assert_eq!(read.faces.len(), walls.mesh.faces.len());
    let text = String::from_utf8(obj).unwrap();
    let group = |line: &str| line.starts_with("g labels_");
    assert_eq!(text.lines().filter(|line| group(line)).count(), 10);
    assert!(text.contains("\ng labels_-7_0\n") && text.contains("\ng labels_4_-7\n"));
    let refused = walls.encode("walls.stl", &names).unwrap_err();
    assert!(matches!(refused, Error::NoLabels { .. }), "{refused}");
}

#[test]
fn a_lattice_of_one_label_has_the_walls_around_it() {
    let mut lattice = random(0);
    lattice.labels.fill(2);
    let walls = lattice.walls().unwrap();
    assert!(walls.sides.iter().all(|sides| *sides == [2, 0]));
    assert_eq!(closed(walls.of_label(2)).euler_characteristic(), 2);
    assert!(walls.of_label(1).faces.is_empty());
    // Nothing can give a label without walls a volume.
    let moved = walls.with_volumes(&[0.0, 5.0, 20.0], |_| true);
    let volumes = moved.volumes(3);
    assert!((volumes[2] - 20.0).abs() < 1e-9 && volumes[1].abs() < 1e-12);
    lattice.labels.fill(0);
    let nothing = lattice.walls().unwrap();
    assert!(nothing.mesh.faces.is_empty() && nothing.encode("a.ply", &[0]).is_err());
}
