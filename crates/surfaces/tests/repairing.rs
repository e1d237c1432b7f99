//! Meshes that bound nothing properly.

use surfaces::{ClosedMesh, TriangleMesh, repair, samples};

use crate::common::{length, minus, reversed, together, translated};
use crate::remeshing::{shortest_edge, smallest_angles};

/// The mesh without the faces whose centres are near a point.
fn with_hole(mesh: &TriangleMesh, at: [f64; 3], radius: f64) -> TriangleMesh {
    let mut open = mesh.clone();
    open.normals = None;
    open.faces.retain(|face| {
        let centre: [f64; 3] = std::array::from_fn(|i| {
            face.iter()
                .map(|&v| mesh.vertices[v as usize][i])
                .sum::<f64>()
                / 3.0
        });
        length(minus(centre, at)) > radius
    });
    assert!(open.faces.len() < mesh.faces.len());
    open
}

/// A sphere of radius 0.4.
fn sphere() -> TriangleMesh {
    let grid = geometry::Grid::<3>::centred(32, 1.0).unwrap();
    surfaces::isosurface(&geometry::Field::from_fn(grid, |x| length(x) - 0.4)).unwrap()
}

fn radii(mesh: &ClosedMesh) -> (f64, f64) {
    let radii = mesh.mesh().vertices.iter().map(|x| length(*x));
    radii.fold((f64::MAX, 0.0), |(low, high), r| (low.min(r), high.max(r)))
}

#[test]
fn holes_are_closed_and_all_else_stays() {
    let open = with_hole(&sphere(), [0.4, 0.0, 0.0], 0.12);
    assert!(ClosedMesh::new(open.clone()).is_err());
    let repaired = repair(&open, 64).unwrap();
    let mesh = &repaired.mesh;
    assert_eq!((mesh.components(), mesh.genus()), (1, 0));
    let (low, high) = radii(mesh);
    assert!(low > 0.36 && high < 0.41, "{low} {high}");
    // A cap of this size has 2 % of the area.
    assert!(
        repaired.changes.added < 0.03 && repaired.changes.dropped < 0.01,
        "{}",
        repaired.changes
    );
    assert_eq!(repaired.changes.turned, 0);
}

#[test]
fn vertices_of_no_face_do_not_make_the_cells_larger() {
    let mut mesh = sphere();
    mesh.normals = None;
    let spacing = |mesh: &TriangleMesh| repair(mesh, 32).unwrap().changes.spacing.to_bits();
    let expected = spacing(&mesh);
    mesh.vertices.push([1000.0, 0.0, 0.0]);
    assert_eq!(spacing(&mesh), expected);
}

#[test]
fn faces_of_mixed_orientation_agree() {
    let mut mixed = sphere();
    mixed.normals = None;
    for face in mixed.faces.iter_mut().step_by(3) {
        face.swap(0, 1);
    }
    assert!(ClosedMesh::new(mixed.clone()).is_err());
    let repaired = repair(&mixed, 48).unwrap();
    assert!((repaired.changes.turned as f64 / mixed.faces.len() as f64 - 1.0 / 3.0).abs() < 0.01);
    let (low, high) = radii(&repaired.mesh);
    assert!(low > 0.39 && high < 0.41, "{low} {high}");
    // Inside out as a whole, too.
    assert!(repair(&reversed(mixed), 48).unwrap().mesh.volume() > 0.2);
}

#[test]
fn what_crosses_itself_becomes_one() {
    let two = together(sphere(), &translated(sphere(), [0.3, 0.0, 0.0]));
    let repaired = repair(&two, 64).unwrap();
    assert_eq!((repaired.mesh.components(), repaired.mesh.genus()), (1, 0));
    // Two balls of radius r at a distance d have 4/3 pi r^3 + pi r^2 d - pi d^3 / 12 together.
    let pi = std::f64::consts::PI;
    let expected = 4.0 / 3.0 * pi * 0.064 + pi * 0.16 * 0.3 - pi * 0.027 / 12.0;
    let found = repaired.mesh.volume();
    assert!(
        (found / expected - 1.0).abs() < 0.02,
        "{found}, not {expected}"
    );
    assert!(repaired.changes.dropped > 0.2, "{}", repaired.changes);
}

/// Two levers that cross each other, some of their sides at small angles, others less than a cell apart.
#[test]
fn creases_have_neither_slivers_nor_short_edges() {
    let lever = samples::lever(96).unwrap();
    for (cells, shift) in [(112, [0.05, 0.02, 0.03]), (64, [0.048, -0.015, 0.019])] {
        let lever = lever.mesh();
        let two = together(lever.clone(), &translated(lever.clone(), shift));
        let repaired = repair(&two, cells).unwrap();
        let mesh = repaired.mesh.mesh();
        let smallest = smallest_angles(mesh)[0];
        let shortest = shortest_edge(mesh) / repaired.changes.spacing;
        println!("{cells} cells: {smallest:.1} degrees, edges from {shortest:.2} cells");
        assert!(smallest > 25.0, "{smallest} degrees");
        assert!(shortest > 0.3, "{shortest} cells");
    }
}

#[test]
fn a_closed_mesh_stays_as_it_is() {
    let lever = samples::lever(64).unwrap();
    let repaired = repair(lever.mesh(), 64).unwrap();
    assert_eq!(
        repaired.mesh.euler_characteristic(),
        lever.euler_characteristic()
    );
    assert!((repaired.mesh.volume() / lever.volume() - 1.0).abs() < 0.01);
    assert!(
        repaired.changes.added < 1e-3 && repaired.changes.dropped < 1e-3,
        "{}",
        repaired.changes
    );
    assert!(repair(&TriangleMesh::default(), 32).is_err());
    let sheet = TriangleMesh {
        vertices: [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
            .map(|[x, y]| [x, y, 0.0])
            .into(),
        faces: vec![[0, 1, 2], [0, 2, 3]],
        normals: None,
    };
    let refused = repair(&sheet, 32).unwrap_err().to_string();
    assert!(refused.contains("encloses nothing"), "{refused}");
}

/// A joint that is far narrower than a cell, and a hole of one triangle: nothing but this hole changes.
#[test]
fn bodies_that_are_apart_stay_apart() {
    let ball = |x: f64| translated(crate::common::sphere([0.0; 3], 5.0, 3), [x, 0.0, 0.0]);
    let mut bones = together(ball(0.0), &ball(10.02));
    let whole = bones.clone();
    bones.faces.remove(100);
    let repaired = repair(&bones, 64).unwrap();
    assert_eq!(repaired.mesh.components(), 2);
    let changes = repaired.changes;
    assert!(changes.spacing > 5.0 * 0.02);
    assert_eq!((changes.holes, changes.anew, changes.united), (1, 0, 0));
    assert_eq!(repaired.mesh.mesh().vertices.len(), whole.vertices.len());
    let exact = ClosedMesh::new(whole).unwrap().0.volume();
    assert!((repaired.mesh.volume() / exact - 1.0).abs() < 1e-12);
    assert!(
        changes
            .to_string()
            .contains("1 holes were closed by smooth lids"),
        "{changes}"
    );
    // Those that reach into each other are one, beside which a third one stays as it is.
    let three = together(together(ball(0.0), &ball(8.0)), &ball(18.1));
    let repaired = repair(&three, 64).unwrap();
    let changes = repaired.changes;
    assert_eq!((changes.holes, changes.anew, changes.united), (0, 1, 1));
    assert_eq!(repaired.mesh.components(), 2);
    // A body in a body is no cavity, which is told.
    let inner = together(ball(0.0), &crate::common::sphere([0.0; 3], 2.0, 2));
    let repaired = repair(&inner, 64).unwrap();
    assert_eq!(
        (repaired.mesh.components(), repaired.changes.left_out),
        (1, 1)
    );
    let cavity = together(
        ball(0.0),
        &reversed(crate::common::sphere([0.0; 3], 2.0, 2)),
    );
    assert_eq!(repair(&cavity, 64).unwrap().mesh.components(), 2);
    assert_eq!(repair(&reversed(cavity), 64).unwrap().mesh.components(), 2);
}

/// What is left out encloses nothing, however deep it lies.
#[test]
fn bodies_in_bodies_are_left_out_and_cavities_stay() {
    let ball = |radius: f64| crate::common::sphere([0.0; 3], radius, 2);
    let volume = |radius: f64| ball(radius).volume();
    let nested = |inner: [TriangleMesh; 2]| together(together(ball(5.0), &inner[0]), &inner[1]);
    for (mesh, components, left_out, expected) in [
        (nested([ball(3.0), ball(1.0)]), 1, 2, volume(5.0)),
        (
            nested([reversed(ball(3.0)), ball(1.0)]),
            3,
            0,
            volume(5.0) - volume(3.0) + volume(1.0),
        ),
        // A cavity in what is solid without the body between them.
        (
            nested([ball(3.0), reversed(ball(1.0))]),
            2,
            1,
            volume(5.0) - volume(1.0),
        ),
    ] {
        let repaired = repair(&mesh, 64).unwrap();
        let found = (repaired.mesh.components(), repaired.changes.left_out);
        assert_eq!(found, (components, left_out));
        let ratio = repaired.mesh.volume() / expected;
        assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
    }
}

#[test]
fn holes_are_filled_round() {
    let open = with_hole(
        &crate::common::sphere([0.0; 3], 1.0, 4),
        [1.0, 0.0, 0.0],
        0.5,
    );
    let repaired = repair(&open, 64).unwrap();
    let (low, high) = radii(&repaired.mesh);
    // A flat lid would be at 0.88.
    assert!(low > 0.995 && high < 1.02, "{low} {high}");
}
