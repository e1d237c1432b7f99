//! Files of volumes: what they hold, and what is refused.

use volumes::{Error, FormatError, Inside, Volume, decode, is_stack, read, write};

use crate::common::{
    Header, SIZE, assert_near, assert_place, assert_values, mrc, nifti, nifti_2, packed, retagged,
    stack, values, wide_stacks,
};

fn with_white_as_zero(stack: &[u8]) -> Vec<u8> {
    retagged(stack, [262, 1], [262, 0])
}

/// The bytes of the values in numbers of that type.
fn numbers<const N: usize>(number: impl Fn(u8) -> [u8; N]) -> Vec<u8> {
    values().into_iter().flat_map(number).collect()
}

#[test]
fn nifti_of_all_kinds() {
    let files = [
        ("u8", nifti(2, false, &values())),
        (
            "i16",
            nifti(4, false, &numbers(|v| i16::from(v).to_le_bytes())),
        ),
        (
            "i32",
            nifti(8, true, &numbers(|v| i32::from(v).to_be_bytes())),
        ),
        (
            "f32",
            nifti(16, true, &numbers(|v| f32::from(v).to_be_bytes())),
        ),
        (
            "f64",
            nifti(64, false, &numbers(|v| f64::from(v).to_le_bytes())),
        ),
        ("i8", nifti(256, false, &values())),
        (
            "u16",
            nifti(512, true, &numbers(|v| u16::from(v).to_be_bytes())),
        ),
        (
            "u32",
            nifti(768, false, &numbers(|v| u32::from(v).to_le_bytes())),
        ),
        (
            "i64",
            nifti(1024, false, &numbers(|v| i64::from(v).to_le_bytes())),
        ),
        (
            "u64",
            nifti(1280, true, &numbers(|v| u64::from(v).to_be_bytes())),
        ),
        ("version 2", nifti_2(false, &values())),
        ("version 2, big-endian", nifti_2(true, &values())),
        ("compressed", packed(&nifti(2, false, &values()))),
    ];
    for (name, bytes) in files {
        let volume = decode(&bytes).unwrap();
        assert_values(&volume, name);
        assert_place(&volume);
    }
}

#[test]
fn nifti_without_rows_is_placed_by_quaternion_and_sides() {
    let with = |edit: &dyn Fn(&mut Header)| {
        let mut header = Header::new(0, false);
        header.bytes = nifti(2, false, &values());
        header.put(254, 0_i16.to_le_bytes());
        for (axis, side) in [2.0, 3.0, 4.0_f32].into_iter().enumerate() {
            header.put(80 + 4 * axis, side.to_le_bytes());
        }
        edit(&mut header);
        decode(&header.bytes).unwrap()
    };
    let sides = with(&|_| {});
    assert_near(sides.position([1.0, 1.0, 1.0]), [2.0, 3.0, 4.0]);
    // A quarter turn about the third axis, which is reversed.
    let turned = with(&|header| {
        header.put(252, 1_i16.to_le_bytes());
        header.put(76, (-1_f32).to_le_bytes());
        header.put(264, (0.5_f32.sqrt()).to_le_bytes());
        header.put(268, 10_f32.to_le_bytes());
    });
    assert_near(turned.position([0.0; 3]), [10.0, 0.0, 0.0]);
    assert_near(turned.position([1.0, 0.0, 0.0]), [10.0, 2.0, 0.0]);
    assert_near(turned.position([0.0, 1.0, 1.0]), [7.0, 0.0, -4.0]);
    // Values are scaled.
    let scaled = with(&|header| {
        header.put(112, 0.5_f32.to_le_bytes());
        header.put(116, (-3_f32).to_le_bytes());
    });
    assert!((scaled.value([1, 1, 0]) - 0.0).abs() < 1e-12);
    let unscaled = with(&|header| {
        header.put(112, f32::NAN.to_le_bytes());
        header.put(116, f32::NAN.to_le_bytes());
    });
    assert_values(&unscaled, "a slope that is not a number");
}

#[test]
fn mrc_of_all_kinds() {
    let files = [
        ("i8", mrc(0, false, &values())),
        (
            "i16",
            mrc(1, true, &numbers(|v| i16::from(v).to_be_bytes())),
        ),
        (
            "f32",
            mrc(2, false, &numbers(|v| f32::from(v).to_le_bytes())),
        ),
        (
            "u16",
            mrc(6, true, &numbers(|v| u16::from(v).to_be_bytes())),
        ),
        ("compressed", packed(&mrc(0, false, &values()))),
    ];
    for (name, bytes) in files {
        let volume = decode(&bytes).unwrap();
        assert_values(&volume, name);
        assert_near(volume.position([0.0; 3]), [1.0, -2.0, 5.0]);
        // Columns are along z, sections along x.
        assert_near(volume.position([1.0, 1.0, 1.0]), [3.0, 1.0, 5.5]);
    }
    // As many columns as a NIfTI header has bytes.
    let mut header = Header::new(0, false);
    header.bytes = mrc(0, false, &[7; 348 * 4 * 3]);
    header.put(0, 348_i32.to_le_bytes());
    assert_eq!(decode(&header.bytes).unwrap().size(), [348, 4, 3]);
    // Without an origin, the numbers of the first voxels count.
    let mut header = Header::new(0, false);
    header.bytes = mrc(0, false, &values());
    for axis in 0..3 {
        header.put(196 + 4 * axis, 0_f32.to_le_bytes());
        header.put(16 + 4 * axis, (axis as i32 + 1).to_le_bytes());
    }
    let volume = decode(&header.bytes).unwrap();
    assert_near(volume.position([0.0; 3]), [6.0, 6.0, 0.5]);
}

#[test]
fn stacks_of_all_kinds() {
    let imagej = "ImageJ=1.54f\nimages=3\nslices=3\nunit=micron\nspacing=2.0\n";
    let without_distance = "ImageJ=1.54f\nimages=3\nslices=3\nunit=micron\n";
    for (description, z) in [
        (imagej, 2.0),
        (without_distance, 1.0),
        ("a photograph", 0.25),
    ] {
        let volume = decode(&stack(description)).unwrap();
        assert_values(&volume, description);
        assert_near(volume.position([1.0, 1.0, 1.0]), [0.5, 0.25, z]);
    }
    // Without a unit, for which there is a number of the page.
    for (description, sides) in [
        (imagej, [0.5, 0.25, 2.0]),
        ("a photograph", [12.7, 6.35, 6.35]),
    ] {
        let volume = decode(&retagged(&stack(description), [296, 1], [297, 1])).unwrap();
        assert_near(volume.position([1.0, 1.0, 1.0]), sides);
    }
    for bytes in wide_stacks() {
        let volume = decode(&bytes).unwrap();
        assert_values(&volume, "wide");
        assert_near(volume.position([1.0, 1.0, 1.0]), [1.0; 3]);
    }
    let [shorts, floats] = wide_stacks().map(|bytes| decode(&with_white_as_zero(&bytes)));
    assert_values(&shorts.unwrap(), "wide, white is zero");
    // Of these the numbers in the file are lost.
    let refused = floats.err().unwrap().to_string();
    assert!(refused.contains("F32 with white as zero"), "{refused}");
    let volume = decode(&with_white_as_zero(&stack(imagej))).unwrap();
    assert_values(&volume, "white is zero");
    // Numbers with a sign, as ImageJ notes them.
    let signed = stack("ImageJ=1.54f\nimages=3\ncf=0\nc0=-40.0\nc1=2.0\nvunit=Gray Value\n");
    for bytes in [with_white_as_zero(&signed), signed] {
        let volume = decode(&bytes).unwrap();
        let ends = [volume.value([0; 3]) + 40.0, volume.value([4, 3, 2]) - 78.0];
        assert!(ends.iter().all(|x| x.abs() < 1e-12), "{ends:?}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    std::fs::write(&path, stack(imagej)).unwrap();
    assert!(is_stack(&path));
    std::fs::write(&path, b"no image").unwrap();
    assert!(!is_stack(&path) && !is_stack(folder.path().join("b.tif")));
}

#[test]
fn labels_are_written_and_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let volume = Volume::of_labels(SIZE, [1.0, -2.0, 3.0], [0.5, 1.0, 2.0], values()).unwrap();
    for name in ["a.nii", "a.nii.gz", "B.NII.GZ"] {
        let path = folder.path().join(name);
        write(&path, &volume).unwrap();
        let back = read(&path).unwrap();
        assert_values(&back, name);
        assert_near(back.position([1.0, 1.0, 1.0]), [1.5, -1.0, 5.0]);
    }
    let lengths = ["a.nii", "a.nii.gz"].map(|name| std::fs::metadata(folder.path().join(name)));
    let [plain, packed] = lengths.map(|file| file.unwrap().len());
    assert!(plain == 352 + 60 && packed < plain);
    let error = write(folder.path().join("a.mrc"), &volume).unwrap_err();
    assert!(matches!(error, Error::UnknownFormat { .. }), "{error}");
    let long = Volume::of_labels([2, 32768, 2], [0.0; 3], [1.0; 3], vec![1; 1 << 17]).unwrap();
    let error = write(folder.path().join("long.nii"), &long).unwrap_err();
    let part = "2 x 32768 x 2 voxels, and NIfTI-1 has up to 32767";
    assert!(error.to_string().contains(part), "{error}");
    let error = read(folder.path().join("none.nii")).unwrap_err();
    assert!(matches!(error, Error::Io(_)), "{error}");
}

#[test]
fn bad_files_are_refused_with_numbers() {
    let nifti = nifti(2, false, &values());
    let mrc = mrc(0, false, &values());
    let edited = |file: &[u8], at: usize, bytes: &[u8]| {
        let mut file = file.to_vec();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    let infinite = |v: u8| f32::to_le_bytes(if v == 27 { -f32::INFINITY } else { 1.0 });
    let cut = |file: &[u8], by: usize| file[..file.len() - by].to_vec();
    for (bytes, part) in [
        (b"nothing here".to_vec(), "none of NIfTI"),
        (Vec::new(), "none of NIfTI"),
        (
            cut(&nifti, 1),
            "should have 412 bytes by its header, and has 411",
        ),
        (
            [&nifti[..], &[0]].concat(),
            "should have 412 bytes by its header, and has 413",
        ),
        (nifti[..200].to_vec(), "should have 348 bytes"),
        (
            edited(&edited(&nifti, 40, &[4, 0]), 48, &[2, 0]),
            "holds 2 volumes, such as those of several times: give `frame` N of one of them, from 0 to 1",
        ),
        (
            edited(&nifti, 42, &(-1_i16).to_le_bytes()),
            "voxels of the NIfTI header is -1",
        ),
        (edited(&nifti, 42, &[1, 0]), "2 at least along each axis"),
        (
            edited(&nifti, 42, &[0xff, 0x7f, 0xff, 0x7f, 0xff, 0x7f]),
            "32767 x 32767 x 32767",
        ),
        (
            edited(&nifti, 70, &[128, 0]),
            "datatype of the NIfTI header is 128",
        ),
        (edited(&nifti, 108, &f32::NAN.to_le_bytes()), "vox_offset"),
        (edited(&nifti, 108, &300_f32.to_le_bytes()), "vox_offset"),
        (
            edited(&nifti, 112, &f32::INFINITY.to_le_bytes()),
            "scl_slope",
        ),
        (
            edited(&nifti, 280, &f32::NAN.to_le_bytes()),
            "place in space",
        ),
        (edited(&nifti, 280, &[0; 48]), "place in space"),
        (
            edited(&nifti, 344, b"ni1\0"),
            "header and voxels in one file",
        ),
        (
            cut(&mrc, 2),
            "should have 1092 bytes by its header, and has 1090",
        ),
        (mrc[..800].to_vec(), "should have 1024 bytes"),
        (edited(&mrc, 12, &[4]), "mode of the MRC header is 4"),
        (edited(&mrc, 52, &70_f32.to_le_bytes()), "right angles"),
        (
            edited(&mrc, 64, &[2]),
            "MAPC of the MRC header is [2, 2, 1]",
        ),
        (
            edited(&mrc, 92, &[0xff; 4]),
            "NSYMBT of the MRC header is -1",
        ),
        (cut(&packed(&nifti), 9), "gzip"),
        (packed(&cut(&nifti, 5)), "and has 407"),
        (
            packed(&[&nifti[..], &[0; 5000]].concat()),
            "and has 413 or more",
        ),
        (cut(&stack(""), 20), "TIFF"),
        (stack("ImageJ=1\nimages=7\n"), "what the description notes"),
        (
            stack("ImageJ=1\nimages=3\nchannels=3\n"),
            "save the pages as sections along z",
        ),
        (
            stack("ImageJ=1\nimages=3\ncf=3\nc0=1\nc1=2\n"),
            "calibration function of the TIFF header is 3",
        ),
        (
            crate::common::nifti(16, false, &numbers(infinite)),
            "voxel [2, 1, 1] has the value -inf",
        ),
        (
            crate::common::nifti(16, false, &numbers(|_| f32::to_le_bytes(f32::NAN))),
            "no voxel has a value: all are NaN",
        ),
    ] {
        let error = decode(&bytes).unwrap_err().to_string();
        assert!(error.contains(part), "{part}: {error}");
    }
    for (size, sides) in [
        ([2, 2, 2], [1.0; 3]),
        (SIZE, [0.0, 1.0, 1.0]),
        (SIZE, [f64::NAN; 3]),
    ] {
        let error = Volume::of_labels(size, [0.0; 3], sides, values()).unwrap_err();
        assert!(matches!(error, Error::Volume(_)), "{error}");
    }
}

/// A thousand times as long unpacked, and not more than announced.
#[test]
fn bombs_are_cut_off() {
    let mut header = Header::new(0, false);
    header.bytes = nifti(2, false, &values());
    let bomb = packed(&[&header.bytes[..], &vec![0; 1 << 26]].concat());
    let (result, peak) = fuzzing::peak_of(|| decode(&bomb));
    assert!(
        matches!(result, Err(FormatError::Length { longer: true, .. })),
        "{result:?}"
    );
    assert!(peak < 1 << 20, "{peak}");
    for axis in 0..3 {
        header.put(42 + 2 * axis, 2000_i16.to_le_bytes());
    }
    let (result, peak) = fuzzing::peak_of(|| decode(&packed(&header.bytes)));
    assert!(
        matches!(result, Err(FormatError::Size { .. })),
        "{result:?}"
    );
    assert!(peak < 1 << 20, "{peak}");
}

#[test]
fn labels_are_counted() {
    let volume = decode(&nifti(2, false, &numbers(|v| [v % 3]))).unwrap();
    assert_eq!(volume.labels(), Some(vec![(0.0, 20), (1.0, 20), (2.0, 20)]));
    let halves = numbers(|v| (0.5 * f32::from(v)).to_le_bytes());
    let volume = decode(&nifti(16, false, &halves)).unwrap();
    assert_eq!(volume.labels(), None);
    // Neither fractions nor neighbours of large labels belong to a label.
    let quarters = numbers(|v| (0.25 * f32::from(v)).to_le_bytes());
    let large = numbers(|v| (600_000_000 + u32::from(v)).to_le_bytes());
    for (data_type, voxels, label) in [(16, quarters, 1.0), (768, large, 600_000_004.0)] {
        let one = decode(&nifti(data_type, false, &voxels)).unwrap();
        let body = one.body(Inside::Label(label)).unwrap();
        assert!((body.surface.volume() / 9.0 - 1.0).abs() < 1e-6, "{body:?}");
    }
    let error = volume.body(Inside::Label(99.0)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "no voxel is labelled 99: the values range from 0 to 29.5"
    );
}
