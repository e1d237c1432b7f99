//! All labels of a segmentation at once, with walls that match.

use std::collections::BTreeSet;
use std::path::Path;

use jobs::{FairOptions, Input, Silent, shared_labels};
use surfaces::ClosedMesh;
use volumes::{Values, Volume};

use crate::common::{outcome, run, text};

const SIZE: usize = 30;
const SIDE: f64 = 0.7;
const ORIGIN: [f64; 3] = [100.0, -50.0, 3.0];

/// Three sectors of a ball, labelled 3, 7 and 300.
fn sectors() -> Volume {
    let voxels = (0..SIZE.pow(3)).map(|v| [v % SIZE, v / SIZE % SIZE, v / SIZE.pow(2)]);
    let labels = voxels.map(|index| {
        let [x, y, z] = index.map(|i| i as f64 - 14.6);
        let sector = ((y.atan2(x) + 3.5) / 2.1) as usize % 3;
        let is_inside = x * x + y * y + z * z < 12.0 * 12.0;
        if is_inside { [3, 7, 300][sector] } else { 0 }
    });
    let affine = [0, 1, 2].map(|i| {
        let mut row = [0.0; 4];
        row[i] = SIDE;
        row[3] = ORIGIN[i];
        row
    });
    Volume::of_values([SIZE; 3], affine, &Values::I32(labels.collect())).unwrap()
}

fn closed(path: &Path) -> ClosedMesh {
    ClosedMesh::new(surfaces::read(path).unwrap()).unwrap().0
}

#[test]
fn labels_share_walls_and_keep_their_volumes() {
    let folder = tempfile::tempdir().unwrap();
    let volume = sectors();
    let mut options = FairOptions::of(Input::volume("sectors", volume.clone()));
    options.input.cells = Some(40);
    let made = shared_labels(options, &Silent).unwrap();
    let counts = volume.labels().unwrap();
    assert_eq!(made.names, [0, 3, 7, 300]);
    for (label, (name, count)) in made.report.labels.iter().zip(&counts[1..]) {
        assert_eq!(i64::from(label.label), *name as i64);
        let voxels = *count as f64 * SIDE.powi(3);
        assert!((label.volume_before / voxels - 1.0).abs() < 1e-9);
        assert!(label.change_percent().abs() < 0.05, "{label:?}");
        let off = label.voxels_after as f64 / *count as f64 - 1.0;
        assert!(off.abs() < 0.003, "{label:?} of {count}");
        let surface = ClosedMesh::new(made.surface(label.label).unwrap())
            .unwrap()
            .0;
        assert_eq!(surface.components(), 1);
        assert!((surface.volume() / label.volume_after - 1.0).abs() < 1e-9);
    }
    let (half, largest) = (0.5 * SIDE, made.report.displacement_largest);
    assert_eq!(made.report.max_distance, Some(half));
    assert!(largest <= half * (1.0 + 1e-6), "{largest}");
    // An axis and three half circles.
    assert!(made.report.junction_edges > 100);

    let at = |name: &str| folder.path().join(name);
    for name in ["walls.ply", "walls.obj", "one.stl", "smooth.nii.gz"] {
        made.save(at(name)).unwrap();
    }
    let walls = surfaces::read(at("walls.ply")).unwrap();
    assert_eq!(walls, made.walls.mesh);
    let single = |x: &[f64; 3]| x.map(|v| (v as f32).to_bits());
    let vertices = [3, 7].map(|label| {
        let mesh = closed(&at(&format!("one-label{label}.stl")));
        let vertices = mesh.mesh().vertices.iter().map(single);
        vertices.collect::<BTreeSet<_>>()
    });
    // On their wall, two meshes have the same vertices.
    assert!(vertices[0].intersection(&vertices[1]).count() > 400);
    assert!(at("one-label300.stl").exists());
    // The smooth labels come back where they were.
    let smooth = volumes::read(at("smooth.nii.gz")).unwrap();
    assert_eq!(smooth.size(), volume.size());
    let corner = [3.0, 5.0, 7.0];
    let off = (0..3).map(|i| (smooth.position(corner)[i] - volume.position(corner)[i]).abs());
    assert!(off.fold(0.0, f64::max) < 1e-4);
    let after: Vec<usize> = smooth.labels().unwrap().iter().map(|one| one.1).collect();
    let told = made.report.labels.iter().map(|label| label.voxels_after);
    assert_eq!(after[1..], told.collect::<Vec<_>>());
    let same = volume
        .values()
        .zip(smooth.values())
        .filter(|(a, b)| (a - b).abs() < 0.5);
    assert!(same.count() > SIZE.pow(3) * 98 / 100);
}

#[test]
fn the_program_writes_shared_walls() {
    let folder = tempfile::tempdir().unwrap();
    volumes::write(folder.path().join("two.nii"), &two()).unwrap();
    let shared = [
        "fair", "two.nii", "--label", "all", "--shared", "--cells", "24",
    ];
    let save = ["--steps", "2", "--save", "walls.ply"];
    let told = outcome(folder.path(), &[&shared[..], &save].concat());
    assert_eq!(told["labels"].as_array().unwrap().len(), 2, "{told}");
    let walls = surfaces::read(folder.path().join("walls.ply")).unwrap();
    assert_eq!(told["triangles"], walls.faces.len());
    // No folder of a run.
    assert_eq!(folder.path().read_dir().unwrap().count(), 2);
    let refused = |more: &[&str]| {
        let refused = run(
            folder.path(),
            &[&["fair", "two.nii", "--shared"], more].concat(),
        );
        assert_eq!(refused.status.code(), Some(2));
        text(&refused.stderr)
    };
    for (more, message) in [
        (
            &["--save", "a.ply"][..],
            "give --label all, or leave it out",
        ),
        (
            &["--label", "1", "--save", "a.ply"],
            "give --label all, or leave it out",
        ),
        (&["--label", "all"], "which is not given: give .ply or .obj"),
        (
            &["--label", "all", "--save", "a.vtk"],
            "a.vtk is of another kind",
        ),
        (&["--label", "all", "--save", "walls.ply"], "walls.ply"),
        (
            &["--label", "all", "--save", "a.ply", "--volume", "90%"],
            "--volume has no meaning with --shared, which keeps the volume of each label: leave it out",
        ),
        (
            &["--label", "all", "--save", "a.ply", "--output", "run"],
            "--output has no meaning with --shared, which writes no folder of a run: leave it out",
        ),
    ] {
        let error = refused(more);
        assert!(error.contains(message), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    }
}

/// Two halves of a box.
fn two() -> Volume {
    let voxels = (0..16 * 16 * 16_usize).map(|v| [v % 16, v / 16 % 16, v / 256]);
    let labels = voxels.map(|index| {
        let is_inside = index.iter().all(|i| (3..13).contains(i));
        u8::from(is_inside) * (1 + u8::from(index[0] > 8))
    });
    Volume::of_labels([16; 3], [0.0; 3], [1.0; 3], labels.collect()).unwrap()
}
