//! Checks, measures and placement of closed meshes.

#![allow(clippy::float_cmp, reason = "where equality is asserted, it is exact")]

use std::f64::consts::PI;
use std::time::{Duration, Instant};

use crate::common::{closed, cube, reversed, sphere, together, topology, torus, translated};
use geometry::{Grid, Placement};
use surfaces::{ClosedMesh, Error, TriangleMesh, Warning};

fn error(mesh: TriangleMesh) -> Error {
    ClosedMesh::new(mesh).unwrap_err()
}

/// The error of a cube with one thing wrong.
fn spoiled(spoil: fn(&mut TriangleMesh)) -> Error {
    let mut mesh = cube(0.5);
    spoil(&mut mesh);
    error(mesh)
}

#[track_caller]
fn near(value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value - expected).abs() <= tolerance,
        "{value} for {expected}"
    );
}

#[test]
fn measures_are_those_of_the_solid() {
    let mesh = closed(translated(cube(0.5), [100.0, 200.0, -300.0]));
    near(mesh.area(), 6.0, 1e-12);
    near(mesh.volume(), 1.0, 1e-12);
    assert_eq!(topology(&mesh), (2, 1, 0));
    assert_eq!(mesh.bounding_box().extent(), [1.0; 3]);
    assert_eq!(mesh.bounding_box().centre(), [100.0, 200.0, -300.0]);

    let mesh = closed(torus(0.5, 0.2, 400, 200));
    near(mesh.area(), 4.0 * PI * PI * 0.5 * 0.2, 2e-3);
    near(mesh.volume(), 2.0 * PI * PI * 0.5 * 0.04, 2e-4);
    assert_eq!(topology(&mesh), (0, 1, 1));

    let both = together(torus(0.5, 0.2, 20, 20), &sphere([2.0, 0.0, 0.0], 0.3, 2));
    let mesh = closed(both);
    assert_eq!(topology(&mesh), (2, 2, 1));
}

#[test]
fn cavities_stay() {
    let outer = sphere([0.0; 3], 0.5, 3);
    let inner = reversed(sphere([0.1, 0.0, 0.0], 0.3, 3));
    let solid = closed(outer.clone()).volume();
    let hole = closed(reversed(inner.clone())).volume();
    let mesh = closed(together(outer.clone(), &inner));
    near(mesh.volume(), solid - hole, 1e-12);
    assert_eq!((mesh.euler_characteristic(), mesh.components()), (4, 2));

    // The same the other way round is reversed as a whole.
    let inverted = together(reversed(outer.clone()), &reversed(inner.clone()));
    let (again, warnings) = ClosedMesh::new(inverted).unwrap();
    assert_eq!(warnings, [Warning::Reversed]);
    near(again.volume(), mesh.volume(), 1e-15);

    // Both outwards, or the inner one outside.
    let doubled = together(outer.clone(), &reversed(inner.clone()));
    let text = error(doubled).to_string();
    assert!(
        text.contains("outwards, but 1 other components enclose it where 0"),
        "{text}"
    );
    let beside = together(outer, &translated(inner, [2.0, 0.0, 0.0]));
    let text = error(beside).to_string();
    assert!(
        text.contains("inwards, but 0 other components enclose it where 1"),
        "{text}"
    );
}

/// The time of the quickest of three checks.
fn time_to_check(mesh: &TriangleMesh) -> Duration {
    let once = || {
        let mesh = mesh.clone();
        let clock = Instant::now();
        let checked = ClosedMesh::new(mesh);
        let time = clock.elapsed();
        assert!(checked.is_ok());
        time
    };
    [once(), once(), once()].into_iter().min().unwrap()
}

/// Some thousand parts in a part of many faces take no more than a few times as long as that alone.
#[test]
fn pinholes_are_cheap() {
    let whole = torus(2.0, 1.0, 400, 160);
    let pinhole = |n: i32| {
        let place = [n % 13, n / 13 % 13, n / 169].map(|i| f64::from(i) / 24.0 - 0.25);
        let [x, y, z] = place;
        translated(reversed(cube(0.002)), [2.0 + x, y, z])
    };
    let pinholes = (0..13 * 13 * 13).map(pinhole);
    let mut porous = pinholes.fold(whole.clone(), |all, one| together(all, &one));
    let checked = closed(porous.clone());
    assert_eq!(checked.components(), 2198);
    let solid = closed(whole.clone()).volume();
    near(checked.volume(), solid - 2197.0 * 0.004_f64.powi(3), 1e-9);
    let times = [&whole, &porous].map(time_to_check);
    assert!(times[1] < 20 * times[0], "{times:?}");
    // One of them the other way round is still found.
    let last = porous.faces.len() - 12;
    for face in &mut porous.faces[last..] {
        face.swap(0, 1);
    }
    let found = error(porous);
    assert!(
        matches!(found, Error::Nesting { face, enclosing: 1, expected: 0, .. } if face == last),
        "{found}"
    );
}

#[test]
fn inverted_meshes_are_reversed() {
    let mut mesh = reversed(cube(0.5));
    mesh.normals = Some(vec![[0.0, 0.6, 0.8]; 8]);
    let (mesh, warnings) = ClosedMesh::new(mesh).unwrap();
    assert_eq!(warnings, [Warning::Reversed]);
    near(mesh.volume(), 1.0, 1e-15);
    assert_eq!(mesh.mesh().normals.as_ref().unwrap()[3], [0.0, -0.6, -0.8]);
}

#[test]
fn seams_are_merged_and_only_if_needed() {
    // Every face with its own corners.
    let whole = cube(0.5);
    let split = TriangleMesh {
        vertices: whole
            .faces
            .as_flattened()
            .iter()
            .map(|&v| whole.vertices[v as usize])
            .collect(),
        faces: (0..12).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect(),
        normals: Some(vec![[1.0, 0.0, 0.0]; 36]),
    };
    let (mesh, warnings) = ClosedMesh::new(split.clone()).unwrap();
    assert_eq!(warnings, [Warning::Merged(28)]);
    assert_eq!(
        (mesh.mesh().vertices.len(), mesh.euler_characteristic()),
        (8, 2)
    );
    assert_eq!(mesh.mesh().normals.as_ref().unwrap().len(), 8);

    // Minus zero is zero.
    let mut signed = translated(split, [-0.5; 3]);
    for x in signed.vertices.iter_mut().step_by(2).flatten() {
        *x = if *x == 0.0 { -0.0 } else { *x };
    }
    assert!(ClosedMesh::new(signed).is_ok());

    // Components that touch in a vertex are closed as they are.
    let touching = together(cube(0.5), &translated(cube(0.5), [1.0; 3]));
    let mesh = closed(touching);
    assert_eq!((mesh.components(), mesh.mesh().vertices.len()), (2, 16));
}

#[test]
fn sheets_that_share_a_vertex_count_it_twice() {
    let mut mesh = together(cube(0.5), &translated(cube(0.5), [1.0; 3]));
    for corner in mesh.faces.as_flattened_mut() {
        *corner = if *corner == 8 { 7 } else { *corner };
    }
    let (mesh, warnings) = ClosedMesh::new(mesh).unwrap();
    assert_eq!(warnings, [Warning::Unreferenced(1)]);
    assert_eq!(
        (mesh.mesh().vertices.len(), mesh.euler_characteristic()),
        (15, 4)
    );
    assert_eq!((mesh.components(), mesh.genus()), (2, 0));
}

#[test]
fn collapsed_faces_are_left_out() {
    let mut mesh = cube(0.5);
    mesh.faces.push([3, 3, 5]);
    mesh.vertices.push([9.0; 3]);
    let (mesh, warnings) = ClosedMesh::new(mesh).unwrap();
    assert_eq!(warnings, [Warning::Collapsed(1), Warning::Unreferenced(1)]);
    assert_eq!(
        (mesh.mesh().faces.len(), mesh.mesh().vertices.len()),
        (12, 8)
    );
    assert_eq!(mesh.bounding_box().longest_side(), 1.0);
}

#[test]
fn open_meshes_are_refused() {
    let error = spoiled(|mesh| _ = mesh.faces.remove(4));
    assert!(matches!(error, Error::Open { edges: 3, .. }), "{error}");
    assert!(
        error
            .to_string()
            .starts_with("the surface is open: 3 edges"),
        "{error}"
    );
}

#[test]
fn crowded_and_mixed_edges_are_refused() {
    let mut mesh = cube(0.5);
    mesh.vertices.push([2.0, 0.0, 0.0]);
    mesh.faces.push([0, 1, 8]);
    assert!(matches!(
        error(mesh),
        Error::NonManifold {
            edges: 1,
            others: 2,
            ..
        }
    ));

    let error = spoiled(|mesh| mesh.faces[5].swap(0, 1));
    assert!(
        matches!(error, Error::MixedOrientation { edges: 3, .. }),
        "{error}"
    );
    assert!(
        error.to_string().contains("orient all faces alike"),
        "{error}"
    );
}

#[test]
fn meshes_without_sense_are_refused() {
    assert!(matches!(error(TriangleMesh::default()), Error::NoFaces));
    let wrong = spoiled(|mesh| mesh.faces[3][1] = 8);
    assert!(matches!(
        wrong,
        Error::IndexOutOfRange {
            face: 3,
            vertex: 8,
            vertices: 8
        }
    ));
    for wrong in [
        spoiled(|mesh| mesh.vertices[6][2] = f64::NAN),
        spoiled(|mesh| mesh.vertices[6][2] = f64::INFINITY),
    ] {
        assert!(matches!(wrong, Error::NonFiniteVertex { vertex: 6, .. }));
    }
    let wrong = spoiled(|mesh| mesh.normals = Some(vec![[1.0, 0.0, 0.0]; 7]));
    assert!(matches!(
        wrong,
        Error::Normals {
            normals: 7,
            vertices: 8,
            ..
        }
    ));
    for (size, word) in [(1e-71, "between"), (1e71, "between"), (0.0, "no faces")] {
        let text = error(cube(size)).to_string();
        assert!(text.contains(word), "{text}");
    }
    // Both sides of a triangle.
    let sheet = TriangleMesh {
        vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        faces: vec![[0, 1, 2], [0, 2, 1]],
        normals: None,
    };
    assert!(matches!(error(sheet), Error::NoVolume { .. }));
    // A corner of the tetrahedron in the middle of an edge.
    let mut sliver = cube(0.5);
    sliver.vertices.push([-0.5, -0.5, 0.0]);
    sliver
        .faces
        .retain(|f| *f != [0, 1, 3] && !(f.contains(&0) && f.contains(&1)));
    let whole = cube(0.5);
    for face in whole
        .faces
        .iter()
        .filter(|f| f.contains(&0) && f.contains(&1))
    {
        sliver.faces.push(*face);
    }
    let side = sliver
        .faces
        .iter()
        .position(|f| {
            [[0, 1], [1, 2], [2, 0]]
                .iter()
                .any(|&[a, b]| (f[a], f[b]) == (0, 1))
        })
        .unwrap();
    let third = *sliver.faces[side].iter().find(|&&v| v > 1).unwrap();
    sliver.faces[side] = [0, 8, third];
    sliver.faces.extend([[8, 1, third], [0, 1, 8]]);
    let error = error(sliver);
    assert!(matches!(error, Error::NoArea { faces: 1, .. }), "{error}");
}

#[test]
fn placement_centres_and_scales() {
    let mut mesh = cube(1.0);
    for x in &mut mesh.vertices {
        *x = [3.0 * x[0] + 7.0, x[1] - 2.0, 2.0 * x[2]];
    }
    let mesh = closed(mesh);
    let grid = Grid::<3>::new(16, 1.0).unwrap();
    let bounds = mesh.bounding_box();
    let placement = Placement::fit(&bounds, &grid, 0.6).unwrap();
    near(placement.scale(), 0.1, 1e-16);
    let placed = mesh.placed(&placement).bounding_box();
    for (axis, half) in [0.3, 0.1, 0.2].into_iter().enumerate() {
        near(placed.lower[axis], 0.5 - half, 1e-15);
        near(placed.upper[axis], 0.5 + half, 1e-15);
    }
    for x in &mesh.mesh().vertices {
        let back = placement.apply_inverse(placement.apply(*x));
        (0..3).for_each(|i| near(back[i], x[i], 1e-14));
    }
    near(
        mesh.placed(&placement).volume(),
        1e-3 * mesh.volume(),
        1e-15,
    );

    for side_length in [f64::NAN, 0.0, -0.5, 1.01] {
        assert!(Placement::fit(&bounds, &grid, side_length).is_err());
    }
}

fn mended(mesh: TriangleMesh) -> surfaces::Mended {
    assert!(
        ClosedMesh::new(mesh.clone()).is_err(),
        "nothing is to be mended"
    );
    ClosedMesh::mended(mesh).unwrap()
}

#[test]
fn a_sound_mesh_is_mended_by_nothing() {
    let mesh = torus(0.5, 0.2, 30, 20);
    let mended = ClosedMesh::mended(mesh.clone()).unwrap();
    assert_eq!((mended.mesh.mesh(), mended.changes), (&mesh, vec![]));
    assert_eq!(mended.places, mesh.vertices);
}

/// As exporters leave them: a vertex on an edge, with a face that has nothing but this edge.
#[test]
fn faces_without_area_give_their_longest_sides_away() {
    let mut mesh = sphere([0.0; 3], 10.0, 3);
    let whole = closed(mesh.clone());
    let (count, [a, b, c]) = (mesh.vertices.len() as u32, mesh.faces[0]);
    let [x, y] = [a, b].map(|v| mesh.vertices[v as usize]);
    mesh.vertices.push([0, 1, 2].map(|i| 0.5 * (x[i] + y[i])));
    mesh.faces[0] = [a, count, c];
    mesh.faces.extend([[count, b, c], [a, b, count]]);
    let mended = mended(mesh.clone());
    assert_eq!(mended.changes, [Warning::Flat(1)]);
    assert_eq!(mended.mesh.mesh().vertices, mesh.vertices);
    assert_eq!(mended.mesh.mesh().faces.len(), mesh.faces.len());
    assert_eq!(topology(&mended.mesh), topology(&whole));
    near(mended.mesh.volume(), whole.volume(), 1e-9);
}

#[test]
fn doubled_faces_count_once() {
    let whole = sphere([0.0; 3], 10.0, 3);
    let mut twice = whole.clone();
    twice.faces.extend([whole.faces[7], whole.faces[0]]);
    let once = mended(twice.clone());
    assert_eq!(once.changes, [Warning::Doubled(2)]);
    assert_eq!(once.mesh.mesh().faces, whole.faces);
    // A wall inside that is there from both sides encloses nothing.
    let [a, b, c] = whole.faces[0];
    twice.faces.truncate(whole.faces.len());
    let far = whole
        .faces
        .iter()
        .find(|face| !face.iter().any(|v| [a, b, c].contains(v)));
    let d = far.unwrap()[0];
    twice.faces.extend([[a, b, d], [b, a, d]]);
    let without = mended(twice);
    assert_eq!(without.changes, [Warning::Doubled(2)]);
    assert_eq!(without.mesh.mesh().faces, whole.faces);
}

/// Facets that were written one by one, each with its own rounding.
#[test]
fn vertices_that_agree_up_to_rounding_are_one() {
    let whole = sphere([0.0; 3], 10.0, 3);
    let mut soup = TriangleMesh::default();
    for (face, corners) in whole.faces.iter().enumerate() {
        for &v in corners {
            let off = |axis: usize| 1e-6 * ((7 * face + 3 * axis) % 5) as f64;
            let x = whole.vertices[v as usize];
            soup.vertices.push([0, 1, 2].map(|i| x[i] + off(i)));
        }
        soup.faces.push([0, 1, 2].map(|i| (3 * face + i) as u32));
    }
    let mended = mended(soup.clone());
    let count = whole.vertices.len();
    assert_eq!(mended.mesh.mesh().vertices.len(), count);
    assert_eq!(mended.mesh.euler_characteristic(), 2);
    let joined = mended.changes.iter().find_map(|change| match change {
        Warning::Joined(joined) => Some(*joined),
        _ => None,
    });
    assert!(
        joined.is_some_and(|joined| joined > 3 * count),
        "{:?}",
        mended.changes
    );
    // Every corner knows where it is now.
    for (x, place) in soup.vertices.iter().zip(&mended.places) {
        assert!((0..3).all(|i| (x[i] - place[i]).abs() < 1e-5));
        assert!(mended.mesh.mesh().vertices.contains(place));
    }
    // Gaps that are no rounding stay gaps.
    for x in soup
        .vertices
        .as_flattened_mut()
        .iter_mut()
        .skip(1)
        .step_by(7)
    {
        *x += 0.01;
    }
    assert!(matches!(ClosedMesh::mended(soup), Err(Error::Open { .. })));
}

#[test]
fn mixed_orientation_becomes_that_of_the_neighbours() {
    let mut mesh = torus(0.5, 0.2, 30, 20);
    for face in mesh.faces.iter_mut().step_by(9) {
        face.swap(0, 1);
    }
    let count = mesh.faces.len().div_ceil(9);
    let mended = mended(mesh);
    assert_eq!(mended.changes, [Warning::Turned(count)]);
    near(
        mended.mesh.volume(),
        closed(torus(0.5, 0.2, 30, 20)).volume(),
        1e-12,
    );
}

#[test]
fn parts_are_oriented_by_how_deep_they_lie() {
    let ball = |radius| sphere([0.0; 3], radius, 3);
    let volume = |radius| closed(ball(radius)).volume();
    // A body in a body, and one in that.
    let nested = together(together(ball(3.0), &ball(2.0)), &ball(1.0));
    let mended_bodies = mended(nested);
    assert_eq!(mended_bodies.changes, [Warning::Bodies(1)]);
    near(
        mended_bodies.mesh.volume(),
        volume(3.0) - volume(2.0) + volume(1.0),
        1e-9,
    );
    // A cavity stays one; what is inside out beside it is turned.
    let beside = translated(reversed(ball(1.0)), [9.0, 0.0, 0.0]);
    let both = together(together(ball(3.0), &reversed(ball(2.0))), &beside);
    let mended_beside = mended(both);
    assert_eq!(mended_beside.changes, [Warning::InsideOut(1)]);
    near(
        mended_beside.mesh.volume(),
        volume(3.0) - volume(2.0) + volume(1.0),
        1e-9,
    );
}

#[test]
fn several_trifles_are_mended_at_once_and_others_are_refused_as_they_are() {
    let mut mesh = sphere([0.0; 3], 10.0, 3);
    mesh.faces.push(mesh.faces[5]);
    mesh.faces[9].swap(0, 2);
    mesh.faces.push([4, 4, 6]);
    let mended = mended(mesh);
    let expected = [
        Warning::Collapsed(1),
        Warning::Doubled(1),
        Warning::Turned(1),
    ];
    assert_eq!(mended.changes, expected);
    let mut open = sphere([0.0; 3], 10.0, 3);
    open.faces.remove(3);
    assert!(matches!(
        ClosedMesh::mended(open),
        Err(Error::Open { edges: 3, .. })
    ));
}

#[test]
fn faces_that_cross_others_are_found() {
    let ball = sphere([0.0; 3], 10.0, 3);
    assert!(ball.crossing_faces().iter().all(|crosses| !crosses));
    assert!(cube(0.5).crossing_faces().iter().all(|crosses| !crosses));
    assert_eq!(closed(ball.clone()).overlap(), None);
    let both = together(ball.clone(), &translated(ball.clone(), [12.0, 0.0, 0.0]));
    // A vertex of one is in the other.
    let Err(Error::Overlap(overlap)) = ClosedMesh::mended(both.clone()) else {
        panic!(
            "they overlap: {:?}",
            ClosedMesh::mended(both.clone()).map(|m| m.changes)
        );
    };
    assert_eq!(overlap.parts, 2);
    let crossing = both
        .crossing_faces()
        .iter()
        .filter(|crosses| **crosses)
        .count();
    assert_eq!(crossing, overlap.faces);
    assert!((20..200).contains(&crossing), "{crossing}");
    // Balls that do not touch, and cubes that touch in an edge or a corner, do not overlap; cubes with a common side do.
    let apart = together(ball.clone(), &translated(ball, [20.1, 0.0, 0.0]));
    assert_eq!(closed(apart).overlap(), None);
    for (shift, overlaps) in [
        ([1.0; 3], false),
        ([1.0, 1.0, 0.0], false),
        ([1.0, 0.0, 0.0], true),
        ([1.0, 0.3, 0.2], true),
    ] {
        let cubes = together(cube(0.5), &translated(cube(0.5), shift));
        // A corner of one may be on a side of the other.
        let found = match ClosedMesh::mended(cubes) {
            Ok(mended) => mended.mesh.overlap().is_some(),
            Err(error) => matches!(error, Error::Overlap(_)),
        };
        assert_eq!(found, overlaps, "{shift:?}");
    }
    // One vertex pulled through the other side.
    let mut folded = torus(0.5, 0.2, 30, 20);
    folded.vertices[10] = [0.9, 0.0, 0.0];
    assert!(
        folded
            .crossing_faces()
            .iter()
            .filter(|crosses| **crosses)
            .count()
            >= 6
    );
}

/// A sheet that is moved through itself, and a vertex through the other side.
#[test]
fn what_crosses_only_now_goes_back() {
    let ring = torus(0.5, 0.2, 30, 20);
    let mut moved = ring.clone();
    for x in &mut moved.vertices {
        x[2] += 0.01;
    }
    assert_eq!(moved.clone().untangled(&ring), moved);
    let free = moved.vertices[321];
    moved.vertices[10] = [0.9, 0.0, 0.0];
    moved.vertices[400] = [0.0; 3];
    assert!(moved.crossing_faces().contains(&true));
    let back = moved.untangled(&ring);
    assert!(!back.crossing_faces().contains(&true));
    assert_eq!(back.vertices[321], free);
    // Faces that crossed before may go on to.
    let mut folded = ring.clone();
    folded.vertices[10] = [0.9, 0.0, 0.0];
    assert_eq!(folded.clone().untangled(&folded), folded);
}
