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
    assert!(flat.noise().abs() < 1e-15);
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
    assert!(matches!(
        ClosedMesh::covered(sheets.clone()),
        Err(Error::LidCrosses { .. })
    ));
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
