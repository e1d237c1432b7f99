//! Lids on holes.

use crate::common::{closed, sphere, torus};
use surfaces::{ClosedMesh, Error, TriangleMesh};

/// Without the faces whose middle is so high, and without vertices of no face.
fn cut(mesh: &TriangleMesh, height: f64) -> TriangleMesh {
    let middle = |face: &[u32; 3]| {
        face.iter()
            .map(|&v| mesh.vertices[v as usize][2])
            .sum::<f64>()
            / 3.0
    };
    TriangleMesh {
        faces: mesh
            .faces
            .iter()
            .copied()
            .filter(|face| middle(face) < height)
            .collect(),
        ..mesh.clone()
    }
}

/// How far the vertices of a lid are from the sphere of radius 1, the farthest in and out.
fn off_sphere(mesh: &TriangleMesh, first: usize) -> [f64; 2] {
    let off = mesh.vertices[first..]
        .iter()
        .map(|x| x.iter().map(|x| x * x).sum::<f64>().sqrt() - 1.0);
    off.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

#[test]
fn a_hole_of_one_triangle_is_closed_by_it() {
    let whole = sphere([0.0; 3], 1.0, 3);
    let mut open = whole.clone();
    open.faces.remove(17);
    let lids = open.with_lids().unwrap();
    assert_eq!(
        (lids.holes, lids.rim.iter().filter(|at| **at).count()),
        (1, 3)
    );
    assert_eq!(lids.mesh.vertices, whole.vertices);
    let (whole, again) = (closed(whole), closed(lids.mesh));
    assert!((again.volume() / whole.volume() - 1.0).abs() < 1e-12);
}

/// A flat lid on these holes would be as far below the sphere as the cap is high.
#[test]
fn lids_are_round() {
    for (levels, height, off) in [(4, 0.9, 0.01), (4, 0.6, 0.06), (3, 0.8, 0.02)] {
        let open = cut(&sphere([0.0; 3], 1.0, levels), height);
        let lids = open.with_lids().unwrap();
        let [low, high] = off_sphere(&lids.mesh, open.vertices.len());
        println!("{height}: {low} {high}");
        assert!(
            low > -off && high < off,
            "{height}: {low} {high}, flat {}",
            height - 1.0
        );
        assert_eq!(lids.mesh.vertices[..open.vertices.len()], open.vertices);
        let (closed, _) = ClosedMesh::new(lids.mesh).unwrap();
        assert_eq!((closed.euler_characteristic(), closed.components()), (2, 1));
        assert!(
            closed
                .mesh()
                .crossing_faces()
                .iter()
                .all(|crosses| !crosses)
        );
    }
}

#[test]
fn several_holes_each_have_a_lid() {
    let ring = torus(1.0, 0.4, 60, 30);
    let mut open = cut(&ring, 0.35);
    // Others below.
    for _ in 0..2 {
        let around = (0..open.faces.len()).filter(|face| open.faces[*face].contains(&20));
        let around: Vec<usize> = around.collect();
        open.faces.remove(around[around.len() / 2]);
    }
    let lids = open.with_lids().unwrap();
    assert!((3..5).contains(&lids.holes), "{}", lids.holes);
    let (whole, _) = ClosedMesh::new(lids.mesh).unwrap();
    assert_eq!(whole.components(), 1);
    let mut mixed = ring;
    mixed.faces[3].swap(0, 1);
    assert!(matches!(
        mixed.with_lids(),
        Err(Error::MixedOrientation { .. })
    ));
}
