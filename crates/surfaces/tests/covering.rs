//! Surfaces that bound nothing, closed for a flow.

#![allow(clippy::float_cmp, reason = "copies are equal")]

use crate::common::{cube, sphere, together, translated};
use surfaces::{ClosedMesh, Covered, Error, TriangleMesh, Warning};

fn covered(mesh: TriangleMesh) -> Covered {
    let given = mesh.clone();
    let covered = ClosedMesh::covered(mesh).unwrap();
    let closed = covered.mended.mesh.mesh();
    // What was given comes first, at its places, and nothing crosses it.
    assert!(!closed.crossing_faces().contains(&true));
    assert!(covered.vertices <= closed.vertices.len());
    let faces = covered.faces + covered.left.faces.len();
    assert!(faces <= given.faces.len());
    assert_eq!(covered.mended.places, given.vertices);
    covered
}

/// Vertices at the same place as one.
fn joined(mut mesh: TriangleMesh) -> TriangleMesh {
    let first = |v: u32| {
        let x = mesh.vertices[v as usize];
        mesh.vertices.iter().position(|y| *y == x).unwrap() as u32
    };
    mesh.faces = mesh.faces.iter().map(|face| face.map(first)).collect();
    mesh
}

/// A sheet of squares, each cut in two, as high as the function says.
fn sheet(count: u32, height: impl Fn(f64, f64) -> f64) -> TriangleMesh {
    let place = |i: u32| f64::from(i) / f64::from(count);
    let vertices = (0..=count).flat_map(|i| (0..=count).map(move |j| (i, j)));
    let vertices = vertices.map(|(i, j)| {
        let [x, y] = [i, j].map(place);
        [x, y, height(x, y)]
    });
    let faces = (0..count * count).flat_map(|square| {
        let (i, j) = (square / count, square % count);
        let at = |i: u32, j: u32| i * (count + 1) + j;
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    TriangleMesh {
        vertices: vertices.collect(),
        faces: faces.collect(),
        normals: None,
    }
}

/// A lid that is bent least lies on what is flat, and crosses what is rough.
#[test]
fn sheets_become_plates() {
    let flat = covered(sheet(12, |_, _| 0.0));
    assert_eq!(flat.mended.changes, [Warning::Plates(1)]);
    assert!((flat.mended.mesh.volume() - 0.1).abs() < 1e-12);
    assert_eq!((flat.rim.len(), flat.creases.len()), (48, 48));
    assert!(sheet(12, |_, _| 0.0).noise().deviation < 1e-15);
    let rough = covered(sheet(12, |x, y| 0.02 * (40.0 * x).sin() * (30.0 * y).cos()));
    assert_eq!(rough.rim.len(), 48);
    // Where it is round, the lid goes on smoothly.
    let bowl = covered(sheet(12, |x, y| (x - 0.5).powi(2) + (y - 0.5).powi(2)));
    assert_eq!(bowl.rim.len(), 48);
    // With a hole it is a ring.
    let mut ring = sheet(12, |_, _| 0.0);
    ring.faces.retain(|face| {
        let middle = |i: usize| {
            face.iter()
                .map(|&v| ring.vertices[v as usize][i])
                .sum::<f64>()
                / 3.0
                - 0.5
        };
        middle(0).hypot(middle(1)) > 0.2
    });
    let ring = covered(ring);
    assert_eq!(ring.mended.mesh.euler_characteristic(), 0);
    assert_eq!(ring.creases.len(), ring.rim.len());
}

#[test]
fn edges_of_more_faces_are_cut() {
    // Two cubes that share an edge are two bodies.
    let mut cubes = joined(together(cube(0.5), &translated(cube(0.5), [1.0, 1.0, 0.0])));
    assert!(matches!(
        ClosedMesh::new(cubes.clone()),
        Err(Error::NonManifold { .. })
    ));
    let two = covered(cubes.clone());
    assert_eq!(two.mended.changes, [Warning::Merged(2), Warning::Cut(1)]);
    assert_eq!(two.mended.mesh.components(), 2);
    assert_eq!(two.rim.len(), 2);
    assert!((two.mended.mesh.volume() - 2.0).abs() < 1e-12);
    // The same inside out.
    for face in &mut cubes.faces {
        face.swap(1, 2);
    }
    assert_eq!(covered(cubes).mended.mesh.components(), 2);
    // A fin on a sphere is a part of its own, with a dome that the sphere is free of.
    let mut fin = sphere([0.0; 3], 1.0, 2);
    let [a, b, _] = fin.faces[5];
    let tip = [a, b].map(|v| fin.vertices[v as usize]);
    let tip = [0, 1, 2].map(|i| 1.3 * (tip[0][i] + tip[1][i]));
    fin.vertices.push(tip);
    fin.faces.push([b, a, fin.vertices.len() as u32 - 1]);
    let fin = ClosedMesh::covered(fin).unwrap();
    assert!(fin.mended.changes.contains(&Warning::Cut(1)));
    assert!(fin.mended.mesh.euler_characteristic() >= 2);
}

/// Two sheets through each other: whatever closes one of them crosses the other one.
#[test]
fn parts_that_nothing_closes_stay() {
    let open = sheet(10, |x, y| 0.01 * (40.0 * x).sin() * (30.0 * y).cos());
    let turned = TriangleMesh {
        vertices: (open.vertices.iter())
            .map(|[x, y, z]| [*x, *z + 0.5, *y - 0.5])
            .collect(),
        ..open.clone()
    };
    let sheets = together(open, &turned);
    // By themselves they become two plates.
    let alone = ClosedMesh::covered(sheets.clone()).unwrap();
    assert!(alone.mended.mesh.is_union() && alone.left.faces.is_empty());
    assert!(alone.mended.changes.contains(&Warning::United(2)));
    // A ball with most of the area is faired without them.
    let ball = sphere([4.0, 0.0, 0.0], 1.0, 3);
    let without = covered(together(sheets.clone(), &ball));
    assert_eq!(without.left.faces.len(), sheets.faces.len());
    let left = Warning::Left { parts: 2, all: 3 };
    assert_eq!(without.mended.changes.last(), Some(&left));
    assert_eq!(without.faces, ball.faces.len());
    assert_eq!(without.vertices, ball.vertices.len());
    assert!(without.rim.is_empty());
}

/// Of bodies that reach into each other it is known what is inside; what is within another one, or near it, stays.
#[test]
fn bodies_that_overlap_are_a_union() {
    let ball = |x: f64| sphere([x, 0.0, 0.0], 1.0, 3);
    let balls = together(together(ball(0.0), &ball(1.2)), &ball(-1.2));
    let covered = ClosedMesh::covered(balls.clone()).unwrap();
    let mesh = &covered.mended.mesh;
    let crossing = |mesh: &TriangleMesh| mesh.crossing_faces().iter().filter(|c| **c).count();
    assert_eq!(crossing(mesh.mesh()), crossing(&balls));
    assert_eq!(covered.mended.changes[0], Warning::United(3));
    // Those that do not touch each other are one.
    let bodies = mesh.bodies();
    assert_eq!(bodies.len(), 2);
    let components: usize = bodies.iter().map(ClosedMesh::components).sum();
    assert_eq!((components, mesh.components()), (3, 3));
    assert!(bodies.iter().all(|body| body.volume() > 0.0));
    let near = 0.02 * mesh.bounding_box().longest_side();
    for x in &balls.vertices {
        let from = |centre: f64| (x[0] - centre).hypot(x[1]).hypot(x[2]) - 1.0;
        let mut distances = [0.0, 1.2, -1.2].map(from);
        distances.sort_by(f64::total_cmp);
        // The nearest is its own, or one that it is within.
        let [first, second, _] = distances;
        let is_inside = first < -0.02;
        let is_unsure = covered.unsure.contains(x);
        if is_inside || second < 0.8 * near {
            assert!(is_unsure, "{x:?} {distances:?}");
        }
        if first > -0.02 && second > 1.2 * near {
            assert!(!is_unsure, "{x:?} {distances:?}");
        }
    }
}

/// A bowl with a needle from its bottom through its opening and another one out of its side: lids and domes cross the first, plates one or the other.
#[test]
fn lids_may_cross_where_nothing_else_closes_a_part() {
    let mut bowl = sphere([0.0; 3], 1.0, 4);
    bowl.faces.retain(|face| {
        let heights = face.iter().map(|&v| bowl.vertices[v as usize][2]);
        heights.sum::<f64>() < 2.7
    });
    for (from, tip) in [
        ([0.0, 0.0, -1.0], [0.0, 0.0, 3.0]),
        ([1.0, 0.0, 0.0], [3.0, 0.0, 0.0]),
    ] {
        let away = |x: &[f64; 3]| (0..3).map(|i| (x[i] - from[i]).powi(2)).sum::<f64>();
        let nearest = bowl.vertices.iter_mut();
        *nearest.min_by(|a, b| away(a).total_cmp(&away(b))).unwrap() = tip;
    }
    let covered = ClosedMesh::covered(bowl.clone()).unwrap();
    let changes = &covered.mended.changes;
    assert!(changes.contains(&Warning::CrossingLids(1)), "{changes:?}");
    assert_eq!(covered.faces, bowl.faces.len());
    let crosses = covered.mended.mesh.mesh().crossing_faces();
    assert!(crosses[covered.faces..].contains(&true));
    // The needle has no vertices near the lid.
    assert!(covered.is_unsure);
    assert!(covered.unsure.len() < bowl.vertices.len() / 4);
}

/// What would take hours is refused before it starts.
#[test]
fn thousands_of_loose_faces_are_refused() {
    let mut loose = TriangleMesh::default();
    for face in 0..2500 {
        let x = f64::from(face);
        let first = loose.vertices.len() as u32;
        loose
            .vertices
            .extend([[x, 0.0, 0.0], [x + 0.9, 0.0, 0.1], [x, 0.9, 0.2]]);
        loose.faces.push([first, first + 1, first + 2]);
    }
    let error = ClosedMesh::covered(loose).unwrap_err();
    let Error::Loose { parts, holes, most } = error else {
        panic!("{error}");
    };
    assert_eq!((parts, holes), (2500, 2500));
    assert!(most < parts);
}

/// Both sides of a sheet are one surface, and a face without area in an open surface gives its longest side away.
#[test]
fn trifles_of_open_surfaces_are_mended() {
    let mut sides = sheet(6, |x, y| x * y);
    let backs: Vec<[u32; 3]> = sides.faces.iter().map(|&[a, b, c]| [a, c, b]).collect();
    sides.faces.extend(backs);
    let one = covered(sides);
    assert_eq!(
        (one.faces, one.mended.changes[0]),
        (72, Warning::Doubled(72))
    );
    let mut flat = sheet(6, |x, y| x * y);
    let last = flat.vertices.len() as u32;
    // A vertex in the middle of a diagonal belongs to one of the faces there.
    let [a, b, c] = flat.faces[30];
    let [p, q] = [a, c].map(|v| flat.vertices[v as usize]);
    flat.vertices.push([0, 1, 2].map(|i| 0.5 * (p[i] + q[i])));
    flat.faces[30] = [a, b, last];
    flat.faces.push([b, c, last]);
    flat.faces.push([a, last, c]);
    let mended = covered(flat);
    assert!(mended.mended.changes.contains(&Warning::Flat(1)));
}
