//! Isosurfaces: topology, accuracy, symmetry.

#![allow(clippy::float_cmp, reason = "where equality is asserted, it is exact")]

use std::f64::consts::PI;

use crate::common::{Numbers, closed, dot, length, minus, rounded, topology, unit, waves};
use geometry::shapes::{Ball, Cuboid, Torus};
use geometry::{Field, Grid, PhaseField, SignedDistance, SignedDistanceExt, Stored, phase_field};
use proptest::prelude::*;
use surfaces::{
    ClosedMesh, Error, MeshDistance, Topology, isosurface, lattice_surface, phase_field_surface,
    phase_field_topology, remeshed_surface, samples,
};

fn surface(grid: Grid<3>, shape: &impl SignedDistance<3>) -> ClosedMesh {
    let eps = 2.0 * grid.spacing();
    closed(phase_field_surface(&phase_field(grid, shape, eps).unwrap(), eps).unwrap())
}

#[test]
fn spheres_are_accurate_to_second_order() {
    let ball = Ball::new([0.011, -0.007, 0.003], 0.3).unwrap();
    let (area, volume) = (4.0 * PI * 0.09, 4.0 / 3.0 * PI * 0.027);
    let mut previous: Option<[f64; 2]> = None;
    for n in [32, 64, 128] {
        let mesh = surface(Grid::centred(n, 1.0).unwrap(), &ball);
        assert_eq!((mesh.euler_characteristic(), mesh.genus()), (2, 0));
        let errors = [mesh.area() / area - 1.0, mesh.volume() / volume - 1.0].map(f64::abs);
        println!(
            "n = {n}: relative errors of area {:.1e} and volume {:.1e}",
            errors[0], errors[1]
        );
        if n == 64 {
            assert!(errors[0] < 5e-4 && errors[1] < 1e-3, "{errors:?}");
        }
        if let Some([a, v]) = previous {
            assert!(
                errors[0] < 0.3 * a && errors[1] < 0.3 * v,
                "{errors:?} after {a}, {v}"
            );
        }
        previous = Some(errors);
    }
}

#[test]
fn vertices_and_normals_lie_on_the_sphere() {
    let centre = [0.011, -0.007, 0.003];
    let ball = Ball::new(centre, 0.3).unwrap();
    let grid = Grid::<3>::centred(64, 1.0).unwrap();
    let h = grid.spacing();
    let mesh = surface(grid, &ball).into_mesh();
    for (x, normal) in mesh.vertices.iter().zip(mesh.normals.unwrap()) {
        // But for the clearance at nodes, third order: (h/r)^3 r/16 = 2.6e-6.
        let error = ball.signed_distance(*x).abs();
        assert!(error < 3e-6 + 1.8 * h / 1024.0, "{error} at {x:?}");
        let cosine = dot(unit(minus(*x, centre)), normal);
        assert!((cosine - 1.0).abs() < 1e-4, "{cosine} at {x:?}");
    }
}

#[test]
fn euler_characteristics_are_right() {
    let grid = Grid::<3>::centred(48, 1.0).unwrap();
    let torus = Torus::new(0.3, 0.1).unwrap();
    let mesh = surface(grid, &torus);
    assert_eq!(topology(&mesh), (0, 1, 1));
    let balls = Ball::new([-0.2, 0.0, 0.0], 0.15).unwrap();
    let balls = balls.union(Ball::new([0.2, 0.05, 0.0], 0.17).unwrap());
    let mesh = surface(grid, &balls);
    assert_eq!(topology(&mesh), (4, 2, 0));
    let shell = Ball::new([0.0; 3], 0.4).unwrap();
    let shell = shell.difference(Ball::new([0.0; 3], 0.2).unwrap());
    let mesh = surface(grid, &shell);
    assert_eq!((mesh.euler_characteristic(), mesh.components()), (4, 2));
    let volume = 4.0 / 3.0 * PI * (0.064 - 0.008);
    assert!(
        (mesh.volume() / volume - 1.0).abs() < 2e-3,
        "{}",
        mesh.volume()
    );
}

#[test]
fn faces_of_a_cube_may_lie_on_nodes() {
    // All nodes of the surface are exactly zero.
    let grid = Grid::<3>::centred(32, 1.0).unwrap();
    let cuboid = Cuboid::new([0.25; 3]).unwrap();
    let exact = Field::from_fn(grid, |x| cuboid.signed_distance(x));
    assert!(exact.values().iter().filter(|&&s| s == 0.0).count() > 1000);
    for s in [exact.clone(), exact.map(|s| -s)] {
        let mesh = closed(isosurface(&s).unwrap());
        let reach = |x: &[f64; 3]| x.iter().fold(0.0_f64, |reach, v| reach.max(v.abs()));
        // But for the cap around the complement.
        let reaches = mesh.mesh().vertices.iter().map(reach).filter(|r| *r < 0.4);
        let reach = reaches.fold(0.0, f64::max);
        assert!((reach - 0.25).abs() <= 1.01 / 1024.0 / 32.0, "{reach}");
    }
    let mesh = closed(isosurface(&exact).unwrap());
    assert!((mesh.volume() - 0.125).abs() < 3e-4, "{}", mesh.volume());
}

#[test]
fn shapes_that_leave_the_grid_get_a_cap() {
    let grid = Grid::<3>::centred(32, 1.0).unwrap();
    let everything = Field::constant(grid, -1.0);
    let mesh = closed(isosurface(&everything).unwrap());
    let reach = 31.0 / 32.0 + 2.0 / 32.0 / 1024.0;
    assert!(
        (mesh.volume() - reach * reach * reach).abs() < 1e-6,
        "{}",
        mesh.volume()
    );
    assert_eq!(mesh.euler_characteristic(), 2);

    let half = closed(isosurface(&Field::from_fn(grid, |[x, y, _]| x.hypot(y) - 0.3)).unwrap());
    assert!(
        (half.volume() / (PI * 0.09 * 31.0 / 32.0) - 1.0).abs() < 2e-3,
        "{}",
        half.volume()
    );
}

#[test]
fn nothing_inside_gives_no_faces() {
    let grid = Grid::<3>::centred(8, 1.0).unwrap();
    let mesh = isosurface(&Field::constant(grid, 1.0)).unwrap();
    assert!(mesh.faces.is_empty() && mesh.vertices.is_empty());
    assert!(
        isosurface(&Field::constant(grid, 0.0))
            .unwrap()
            .faces
            .is_empty()
    );
    let mut broken = Field::constant(grid, 1.0);
    broken.values_mut()[17] = f64::NAN;
    assert!(
        isosurface(&broken)
            .unwrap_err()
            .to_string()
            .contains("node 17 is NaN")
    );
    assert!(phase_field_surface(&broken, 0.1).is_err());
    let u = Field::constant(grid, 1.0);
    for eps in [0.0, -1.0, f64::NAN] {
        assert!(matches!(
            phase_field_surface(&u, eps),
            Err(Error::Geometry(_))
        ));
    }
}

#[test]
fn saturated_fields_are_surfaces_too() {
    // Only -1 and 1, and thin parts of one node.
    let grid = Grid::<3>::centred(24, 1.0).unwrap();
    let mut numbers = Numbers(5);
    let values = (0..grid.len()).map(|_| if numbers.next() < 0.3 { 1.0 } else { -1.0 });
    let u = Field::from_values(grid, values.collect()).unwrap();
    let mesh = closed(phase_field_surface(&u, 0.05).unwrap());
    assert!(
        mesh.mesh()
            .normals
            .as_ref()
            .unwrap()
            .iter()
            .flatten()
            .all(|v| v.is_finite())
    );

    // A plate two spacings thick: its distance has a kink in the middle.
    let h = grid.spacing();
    let plate = Cuboid::new([0.3, 0.3, h]).unwrap();
    let mesh = surface(grid, &plate.translated([0.0, 0.0, 0.3 * h]));
    let volume = 0.36 * 2.0 * h;
    assert!(
        (mesh.volume() / volume - 1.0).abs() < 0.03,
        "{} for {volume}",
        mesh.volume()
    );
}

#[test]
fn symmetric_fields_have_symmetric_surfaces() {
    let grid = Grid::<3>::centred(32, 1.0).unwrap();
    let cuboid = Cuboid::new([0.3, 0.2, 0.1]).unwrap();
    let turned = |[x, y, z]: [f64; 3]| {
        let (sin, cos) = 0.7_f64.sin_cos();
        let (x, y) = (cos * x + sin * y, cos * y - sin * x);
        cuboid.signed_distance([cos * x - sin * z, y, cos * z + sin * x])
    };
    let shape = turned.union(Ball::new([0.2, 0.1, -0.2], 0.15).unwrap());
    let area = |map: &(dyn Fn([f64; 3]) -> [f64; 3] + Sync)| {
        surface(grid, &|x| shape.signed_distance(map(x))).area()
    };
    let reference = area(&|x| x);
    for (name, same) in [
        ("reflected", area(&|[x, y, z]| [-x, y, z])),
        ("reflected in all axes", area(&|x| x.map(|v| -v))),
        ("axes exchanged", area(&|[x, y, z]| [z, x, y])),
        ("turned", area(&|[x, y, z]| [y, -x, z])),
        ("moved by two cells", area(&|[x, y, z]| [x, y + 0.0625, z])),
    ] {
        assert!(
            (same / reference - 1.0).abs() < 1e-11,
            "{name}: {same} for {reference}"
        );
    }
    let moved = area(&|[x, y, z]| [x, y + 0.03125, z]);
    assert!(
        (moved / reference - 1.0).abs() < 1e-3,
        "{moved} for {reference}"
    );
}

#[test]
fn sample_meshes_have_their_genus() {
    for cells in [48, 61, 96] {
        let figure = samples::figure(cells).unwrap();
        assert_eq!(
            (figure.components(), figure.genus()),
            (1, 0),
            "figure {cells}"
        );
        let lever = samples::lever(cells).unwrap();
        assert_eq!((lever.components(), lever.genus()), (1, 1), "lever {cells}");
        for mesh in [figure, lever] {
            assert!((0.03..0.04).contains(&mesh.volume()), "{}", mesh.volume());
            assert!((0.85..1.0).contains(&mesh.bounding_box().longest_side()));
        }
    }
    assert!(matches!(samples::figure(47), Err(Error::Geometry(_))));
    assert!(matches!(samples::lever(0), Err(Error::Geometry(_))));
}

#[test]
fn a_mesh_survives_the_way_through_a_phase_field() {
    let lever = samples::lever(96).unwrap();
    let grid = Grid::<3>::centred(64, 1.0).unwrap();
    let eps = 2.0 * grid.spacing();
    let distance = MeshDistance::new(&lever);
    let u = distance.sample(grid, &|| ()).unwrap();
    let u = u.map(|s| geometry::optimal_profile(s, eps));
    let mesh = closed(phase_field_surface(&u, eps).unwrap());
    assert_eq!((mesh.components(), mesh.genus()), (1, 1));
    assert!(
        (mesh.volume() / lever.volume() - 1.0).abs() < 5e-3,
        "{}",
        mesh.volume()
    );
    assert!(
        (mesh.area() / lever.area() - 1.0).abs() < 1e-2,
        "{}",
        mesh.area()
    );
    for x in &mesh.mesh().vertices {
        let off = distance.signed_distance(*x).abs();
        assert!(off < 0.5 * grid.spacing(), "{off}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 60,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// Random smooth fields, with values rounded so that zeros and ties are frequent.
    #[test]
    fn surfaces_are_always_closed(
        seed in any::<u64>(),
        cells in 3..14_usize,
        levels in prop::sample::select(vec![0.0, 0.5, 2.0, 1e3]),
    ) {
        let grid = Grid::<3>::new(cells, 1.0).unwrap();
        let waves = waves(seed);
        let s = Field::from_fn(grid, |x| rounded(waves(x), levels));
        let mesh = isosurface(&s).unwrap();
        let topology = phase_field_topology(&s.map(|s| -s)).unwrap();
        if mesh.faces.is_empty() {
            prop_assert_eq!(topology, Topology { components: 0, euler_characteristic: 0 });
        } else {
            let mesh = closed(mesh);
            prop_assert_eq!(topology.components, mesh.components());
            prop_assert_eq!(topology.euler_characteristic, mesh.euler_characteristic());
            prop_assert!(mesh.volume() > 0.0);
            prop_assert!(mesh.euler_characteristic() % 2 == 0);
            // Nodes are inside if they were: the surface separates them.
            let distance = MeshDistance::new(&mesh);
            for index in (0..grid.len()).step_by(7) {
                let inside = distance.signed_distance(grid.node(index)) < 0.0;
                prop_assert_eq!(inside, s.values()[index] < 0.0, "node {}", index);
            }
        }
    }
}

/// The voxels of an ellipsoid in a box that is no cube, in units of the lattice.
#[test]
fn a_lattice_need_not_be_a_cube() {
    let size = [14, 22, 30];
    let centre = [6.6, 10.4, 14.7];
    let node = |v: usize| [v / (22 * 30), v / 30 % 22, v % 30].map(|i| i as f64);
    let value = |x: [f64; 3]| {
        let scaled = (0..3).map(|i| (x[i] - centre[i]) / (0.8 * (centre[i] - 0.5)));
        scaled.map(|v| v * v).sum::<f64>().sqrt() - 1.0
    };
    let values: Vec<f64> = (0..14 * 22 * 30).map(|v| value(node(v))).collect();
    let mesh = closed(lattice_surface(size, &values).unwrap());
    assert_eq!(mesh.genus(), 0);
    for &x in &mesh.mesh().vertices {
        assert!(value(x).abs() < 5e-3, "{x:?}");
    }
    // As of a field, but for the place and the size.
    let field = samples::figure(48).unwrap();
    let grid = Grid::centred(24, 1.0).unwrap();
    let s = MeshDistance::new(&field).sample(grid, &|| ()).unwrap();
    let (one, other) = (
        isosurface(&s).unwrap(),
        lattice_surface([24; 3], s.values()),
    );
    assert_eq!(one.faces, other.unwrap().faces);
    let error = lattice_surface([2, 3, 4], &[0.0; 20]).unwrap_err();
    assert!(matches!(
        error,
        Error::Geometry(geometry::Error::ValueCount { .. })
    ));
    let error = lattice_surface([2; 3], &[f64::NAN; 8]).unwrap_err();
    assert!(matches!(
        error,
        Error::Geometry(geometry::Error::NonFinite { .. })
    ));
}

#[test]
fn relaxed_surfaces_keep_their_volume_and_their_place() {
    let grid = Grid::centred(32, 1.0).unwrap();
    let steps = Field::from_fn(grid, |x| {
        let inside = x.iter().map(|v| v * v).sum::<f64>() < 0.09;
        if inside { -1.0 } else { 1.0 }
    });
    let rough = isosurface(&steps).unwrap();
    let (reach, volume) = (0.5 / 32.0, 0.11);
    let parts = closed(rough.clone()).parts();
    let smooth = rough.relaxed(20, &parts, &[volume], |_, way| {
        (reach / length(way)).min(1.0)
    });
    let [before, after] = [rough.clone(), smooth.clone()].map(closed);
    assert!((after.volume() / volume - 1.0).abs() < 1e-12);
    assert!(after.area() < 0.9 * before.area());
    let pairs = rough.vertices.iter().zip(&smooth.vertices);
    let gone = pairs
        .map(|(a, b)| length(minus(*a, *b)))
        .fold(0.0, f64::max);
    // The last move to the volume comes on top.
    assert!(gone < 1.2 * reach, "{gone} {reach}");
}

/// Stored on bricks, of a shape in the middle, of one that is cut off by the sides of the box, and of what is around both.
#[test]
fn surfaces_of_what_is_stored_are_the_same() {
    let grid = Grid::<3>::centred(64, 4.0).unwrap();
    let eps = 0.5 * grid.spacing();
    for (x, sign) in [(0.1, 1.0), (0.1, -1.0), (1.8, 1.0), (1.8, -1.0)] {
        let ball = Ball::new([x, 0.0, 0.3], 0.9).unwrap();
        let u = phase_field(grid, &ball, eps).unwrap().map(|u| sign * u);
        let stored = Stored::from(u.clone());
        assert!(4 * stored.values().len() < 3 * grid.len());
        let marched = [
            phase_field_surface(&stored, eps),
            phase_field_surface(&u, eps),
        ];
        let [few, all] = marched.map(Result::unwrap);
        let topology = phase_field_topology(&stored).unwrap();
        assert_eq!(topology, phase_field_topology(&u).unwrap());
        assert_eq!(topology.components, closed(few.clone()).components());
        assert_eq!(
            (few.vertices, few.normals, few.faces),
            (all.vertices, all.normals, all.faces)
        );
        let [few, all] =
            [remeshed_surface(&stored, eps), remeshed_surface(&u, eps)].map(Result::unwrap);
        assert_eq!((few.vertices, few.faces), (all.vertices, all.faces));
    }
}
