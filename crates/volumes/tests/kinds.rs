//! MGH files, arrays of `NumPy`, several volumes in a NIfTI file, voxels without a number and scaled labels.

use volumes::{Error, Inside, Values, Volume, Warning, decode, decode_frame};

use crate::common::{Header, SIZE, assert_near, assert_values, mgh, nifti, npy, packed, values};

/// The voxels in numbers of that type.
fn numbers<const N: usize>(number: impl Fn(u8) -> [u8; N]) -> Vec<u8> {
    values().into_iter().flat_map(number).collect()
}

/// As nibabel places them.
#[test]
fn mgh_of_all_kinds() {
    let plain = mgh(0, 1, &values());
    for (name, bytes) in [
        ("u8", plain.clone()),
        ("i32", mgh(1, 1, &numbers(|v| i32::from(v).to_be_bytes()))),
        ("f32", mgh(3, 1, &numbers(|v| f32::from(v).to_be_bytes()))),
        ("i16", mgh(4, 1, &numbers(|v| i16::from(v).to_be_bytes()))),
        ("u16", mgh(10, 1, &numbers(|v| u16::from(v).to_be_bytes()))),
        ("with a footer", [&plain[..], &[0; 99]].concat()),
        ("compressed", packed(&[&plain[..], &[0; 99]].concat())),
    ] {
        let volume = decode(&bytes).unwrap();
        assert_values(&volume, name);
        assert_near(volume.position([0.0; 3]), [7.0, -0.2, -2.6]);
        assert_near(volume.position([1.0, 0.0, 0.0]), [7.0, 1.0, -1.0]);
        assert_near(volume.position([0.0, 1.0, 0.0]), [4.0, -0.2, -2.6]);
        assert_near(volume.position([0.0, 0.0, 1.0]), [7.0, -3.4, -0.2]);
    }
    // Without a place it is that of coronal slices.
    let mut header = Header::new(0, true);
    header.bytes = plain.clone();
    header.put(28, 0_i16.to_le_bytes());
    let volume = decode(&header.bytes).unwrap();
    assert_near(volume.position([2.5, 2.0, 1.5]), [0.0; 3]);
    assert_near(volume.position([3.5, 4.0, 4.5]), [-1.0, 3.0, -2.0]);
    for (bytes, part) in [
        (mgh(2, 1, &values()), "type of the MGH header is 2"),
        (mgh(0, 0, &values()), "nframes of the MGH header is 0"),
        (plain[..200].to_vec(), "should have 284 bytes"),
        (
            plain[..340].to_vec(),
            "should have 344 bytes by its header, and has 340",
        ),
        (mgh(0, 2, &values()), "holds 2 volumes"),
    ] {
        let error = decode(&bytes).unwrap_err().to_string();
        assert!(error.contains(part), "{part}: {error}");
    }
    let two = mgh(0, 2, &[[9; 60].to_vec(), values()].concat());
    assert_values(&decode_frame(&two, Some(1)).unwrap(), "the second one");
}

#[test]
fn one_of_several_volumes_of_nifti_is_chosen() {
    let mut header = Header::new(0, false);
    let data = [values(), numbers(|v| [v + 50]), numbers(|v| [v + 100])].concat();
    header.bytes = nifti(2, false, &data);
    header.put(40, 4_i16.to_le_bytes());
    header.put(48, 3_i16.to_le_bytes());
    for bytes in [header.bytes.clone(), packed(&header.bytes)] {
        assert_values(&decode_frame(&bytes, Some(0)).unwrap(), "the first one");
        let last = decode_frame(&bytes, Some(2)).unwrap();
        assert_eq!(last.range().map(|v| v as i32), [100, 159]);
        let error = decode(&bytes).unwrap_err().to_string();
        assert!(
            error.contains("`frame` N of one of them, from 0 to 2"),
            "{error}"
        );
        let cut = decode_frame(&header.bytes[..500], Some(0)).unwrap_err();
        assert!(cut.to_string().contains("532 bytes"), "{cut}");
    }
    let one = nifti(2, false, &values());
    assert_values(&decode_frame(&one, Some(0)).unwrap(), "one alone");
    let error = decode_frame(&one, Some(1)).unwrap_err().to_string();
    assert!(error.contains("1 volume: leave it out"), "{error}");
}

#[test]
fn arrays_are_volumes() {
    // The first index is that along x, in both orders.
    let reordered: Vec<u8> = (0..60)
        .map(|n| (n / 12 + 5 * (n / 3 % 4) + 20 * (n % 3)) as u8)
        .collect();
    let wide = |order: &[u8]| {
        order
            .iter()
            .flat_map(|&v| i16::from(v).to_be_bytes())
            .collect::<Vec<_>>()
    };
    for (name, bytes) in [
        ("u8", npy("|u1", false, "(5, 4, 3)", &reordered)),
        (
            "first index fastest",
            npy("|u1", true, "(5, 4, 3)", &values()),
        ),
        ("i16", npy(">i2", false, "(5, 4, 3)", &wide(&reordered))),
        (
            "f64",
            npy(
                "<f8",
                true,
                "(5, 4, 3)",
                &numbers(|v| f64::from(v).to_le_bytes()),
            ),
        ),
    ] {
        let volume = decode(&bytes).unwrap();
        assert_values(&volume, name);
        assert_near(volume.position([1.0, 2.0, 0.0]), [1.0, 2.0, 0.0]);
    }
    let mask = npy("|b1", true, "(5, 4, 3)", &numbers(|v| [v % 2]));
    assert_eq!(
        decode(&mask).unwrap().labels(),
        Some(vec![(0.0, 30), (1.0, 30)])
    );
    for (bytes, part) in [
        (npy("|b1", true, "(5, 12)", &values()), "3 axes are needed"),
        (
            npy("|b1", true, "(5, 4, 4)", &values()),
            "where 152 are needed",
        ),
        (
            npy("<f2", true, "(5, 4, 3)", &[0; 120]),
            "labels in 3D as integers or bool",
        ),
        (
            npy("|u1", true, "(60, 1, 1)", &values()),
            "60 x 1 x 1 voxels",
        ),
    ] {
        let error = decode(&bytes).unwrap_err().to_string();
        assert!(error.contains(part), "{part}: {error}");
    }
    let error = decode_frame(&mask, Some(1)).unwrap_err().to_string();
    assert!(error.contains("no `frame` 1"), "{error}");
}

/// A ball in the middle of a volume in which all else is not a number.
#[test]
fn voxels_without_a_number_are_outside() {
    let values: Vec<f32> = (0..24 * 24 * 24)
        .map(|voxel: i32| {
            let offset = [voxel % 24, voxel / 24 % 24, voxel / 576].map(|i| f64::from(i) - 11.3);
            let distance = offset.iter().map(|x| x * x).sum::<f64>().sqrt();
            if distance < 8.0 { 3.5 } else { f32::NAN }
        })
        .collect();
    let inside = values.iter().filter(|v| !v.is_nan()).count();
    let rows = [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ];
    let volume = Volume::of_values([24; 3], rows, &Values::F32(values.clone())).unwrap();
    let count = values.len() - inside;
    assert_eq!(volume.warnings(), [Warning::NoNumbers { count }]);
    assert_eq!(volume.range().map(|v| (2.0 * v) as i32), [7, 7]);
    let body = volume.body(Inside::Above(1.0)).unwrap();
    let ratio = body.surface.volume() / inside as f64;
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    // Of whole numbers, and in files.
    let labels: Vec<u8> = values
        .iter()
        .flat_map(|v| (2.0 * v).to_le_bytes())
        .collect();
    let mut header = Header::new(0, false);
    header.bytes = nifti(16, false, &labels);
    for axis in 0..3 {
        header.put(42 + 2 * axis, 24_i16.to_le_bytes());
    }
    let volume = decode(&header.bytes).unwrap();
    assert_eq!(volume.warnings(), [Warning::NoNumbers { count }]);
    assert_eq!(volume.labels(), Some(vec![(7.0, inside)]));
    let one = volume.labels_as_one().unwrap();
    assert_eq!(one.labels(), Some(vec![(0.0, count), (1.0, inside)]));
    assert!(one.warnings().is_empty());
    let mut told = volume.clone();
    assert_eq!(told.take_warnings(), volume.warnings());
    assert!(told.warnings().is_empty());
    let body = volume.body(Inside::Label(7.0)).unwrap();
    let ratio = body.surface.volume() / volume.voxel_volume() / inside as f64;
    assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
    let nothing = Volume::of_values([2; 3], rows, &Values::F64(vec![f64::NAN; 8]));
    assert!(matches!(nothing, Err(Error::Volume(_))), "{nothing:?}");
}

/// Labels that a program has scaled, by a slope that has no finite number of binary digits.
#[test]
fn scaled_labels_are_whole_numbers() {
    let mut header = Header::new(0, false);
    header.bytes = nifti(
        4,
        false,
        &numbers(|v| (i16::from(v % 3) * 30 + 10).to_le_bytes()),
    );
    header.put(112, 0.1_f32.to_le_bytes());
    header.put(116, (-1_f32).to_le_bytes());
    let volume = decode(&header.bytes).unwrap();
    assert_eq!(volume.labels(), Some(vec![(0.0, 20), (3.0, 20), (6.0, 20)]));
    let body = volume.body(Inside::Label(3.0)).unwrap();
    assert!(body.surface.volume() > 0.0);
    header.put(112, 0.11_f32.to_le_bytes());
    assert_eq!(decode(&header.bytes).unwrap().labels(), None);
    assert_eq!(SIZE, volume.size());
}
