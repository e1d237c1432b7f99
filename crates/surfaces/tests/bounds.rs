//! Surfaces that stay within a distance of another one.

use crate::common::{closed, sphere};
use surfaces::Bound;

/// A sphere of another radius ends at the bound, where each vertex has the direction that it had.
#[test]
fn what_is_too_far_ends_at_the_bound() {
    let surface = closed(sphere([0.1, 0.0, 0.0], 1.0, 4));
    let far = sphere([0.1, 0.0, 0.0], 1.2, 3);
    let bound = Bound::new(&surface, 0.05);
    assert!(bound.reached(&far).iter().all(|at| *at));
    let clamped = bound.clamp(&far);
    assert!(bound.reached(&clamped).iter().all(|at| *at));
    let distance = surfaces::MeshDistance::new(&surface);
    for (x, from) in clamped.vertices.iter().zip(&far.vertices) {
        let s = geometry::SignedDistance::signed_distance(&distance, *x);
        assert!((s / 0.05 - 1.0).abs() < 1e-12, "{s}");
        let way = (0..3).map(|i| (x[i] - from[i]).powi(2)).sum::<f64>();
        // The faces are up to 0.003 within the sphere.
        assert!((way.sqrt() - 0.15).abs() < 0.004, "{way}");
    }
    let near = sphere([0.1, 0.0, 0.0], 1.03, 3);
    assert_eq!(bound.clamp(&near), near);
    assert!(bound.reached(&near).iter().all(|at| !at));
}

/// A sphere that lies off is cut back on both sides, and the vertices between give the volume back.
#[test]
fn free_vertices_give_back_what_the_bound_takes() {
    let surface = closed(sphere([0.0; 3], 1.0, 4));
    let off = closed(sphere([0.12, 0.0, 0.0], 1.02, 4));
    let bound = Bound::new(&surface, 0.06);
    let wanted = off.volume();
    assert!(bound.clamp(off.mesh()).volume() < wanted - 0.01);
    let held = bound.hold(off.mesh(), |mesh, free| {
        mesh.with_volume(wanted, |vertex| free[vertex])
    });
    assert!((held.volume() / wanted - 1.0).abs() < 1e-9);
    let distances = surfaces::MeshDistance::new(&surface).signed_distances(&held.vertices);
    assert!(distances.iter().all(|s| s.abs() <= 0.06 * (1.0 + 1e-8)));
    let at = bound.reached(&held).into_iter().filter(|at| *at).count();
    assert!(at > 100 && at < held.vertices.len() - 100, "{at}");
    // More than all that the bound allows cannot be had: every vertex is at the bound.
    let most = bound.hold(off.mesh(), |mesh, free| {
        mesh.with_volume(5.1, |vertex| free[vertex])
    });
    assert!(bound.reached(&most).iter().all(|at| *at));
}
