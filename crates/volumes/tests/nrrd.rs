//! NRRD files: types, encodings, places, several volumes, and what is refused.

use std::fmt::Write;

use volumes::{Error, decode, decode_frame, read, read_frame};

use crate::common::{assert_near, assert_place, assert_values, nrrd, packed, values};

/// The fields of the volume of all formats here, but for type and encoding. Its axes are left, posterior and superior.
pub const PLACED: &str = "dimension: 3\nsizes: 5 4 3\nspace: left-posterior-superior\n\
    space directions: (0,-1.5,0) (2,0,0) (-0.5, 0, 3)\nspace origin: (-10,20,7)\nkinds: domain domain domain";

/// The voxels in numbers of that type.
fn numbers<const N: usize>(number: impl Fn(u8) -> [u8; N]) -> Vec<u8> {
    values().into_iter().flat_map(number).collect()
}

fn text(values: &[u8]) -> Vec<u8> {
    let mut text = String::new();
    for (place, value) in values.iter().enumerate() {
        let end = if place % 5 == 4 { ",\r\n" } else { " " };
        write!(text, "{value}{end}").unwrap();
    }
    text.into_bytes()
}

#[test]
fn nrrd_of_all_kinds() {
    let raw = |kind: &str, endian: &str, data: Vec<u8>| {
        let fields = format!("type: {kind}\nencoding: raw\nendian: {endian}\n{PLACED}");
        nrrd(&fields, &data)
    };
    let little = |kind: &str, data: Vec<u8>| raw(kind, "little", data);
    let files = [
        little("uchar", values()),
        little("unsigned char", values()),
        little("int8_t", values()),
        little("short", numbers(|v| i16::from(v).to_le_bytes())),
        raw(
            "signed short int",
            "big",
            numbers(|v| i16::from(v).to_be_bytes()),
        ),
        little("unsigned short", numbers(|v| u16::from(v).to_le_bytes())),
        little("int", numbers(|v| i32::from(v).to_le_bytes())),
        raw("uint32_t", "big", numbers(|v| u32::from(v).to_be_bytes())),
        little("long long int", numbers(|v| i64::from(v).to_le_bytes())),
        little(
            "unsigned long long",
            numbers(|v| u64::from(v).to_le_bytes()),
        ),
        raw("float", "big", numbers(|v| f32::from(v).to_be_bytes())),
        little("double", numbers(|v| f64::from(v).to_le_bytes())),
    ];
    for (number, bytes) in files.into_iter().enumerate() {
        let volume = decode(&bytes).unwrap();
        assert_values(&volume, &format!("{number}"));
        assert_place(&volume);
    }
    let plain = format!("type: uint8\n{PLACED}\nencoding: ");
    for (encoding, data) in [
        ("gzip", packed(&values())),
        (
            "gz\nbyte skip: 2",
            packed(&[&[7, 7], &values()[..]].concat()),
        ),
        ("ascii", text(&values())),
        ("text", text(&values())),
        ("raw\nbyte skip: 3", [&[1, 2, 3], &values()[..]].concat()),
        ("raw\nbyte skip: -1", [&[1, 2, 3], &values()[..]].concat()),
        ("raw\nline skip: 2", [b"one\ntwo\n", &values()[..]].concat()),
    ] {
        let volume = decode(&nrrd(&format!("{plain}{encoding}"), &data)).unwrap();
        assert_values(&volume, encoding);
        assert_place(&volume);
    }
}

#[test]
fn voxels_are_in_a_file_beside_the_header() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nhdr");
    let fields = format!("type: uint8\n{PLACED}\nencoding: raw\ndata file: a.raw");
    std::fs::write(folder.path().join("a.raw"), values()).unwrap();
    // Such a header may end with the file.
    let whole = nrrd(&fields, &[]);
    for header in [&whole[..], whole.trim_ascii_end()] {
        std::fs::write(&path, header).unwrap();
        let volume = read(&path).unwrap();
        assert_values(&volume, "beside");
        assert_place(&volume);
    }
    let error = decode(&whole).unwrap_err().to_string();
    assert!(
        error.contains("data file of the NRRD header is a.raw"),
        "{error}"
    );
    std::fs::remove_file(folder.path().join("a.raw")).unwrap();
    let error = read(&path).unwrap_err();
    assert!(matches!(error, Error::Io(_)), "{error}");
}

#[test]
fn spaces_are_turned_to_right_anterior_superior() {
    let fields = "type: uint8\nencoding: raw\ndimension: 3\nsizes: 5 4 3\n";
    let at = |more: &str| {
        let volume = decode(&nrrd(&format!("{fields}{more}"), &values())).unwrap();
        [volume.position([0.0; 3]), volume.position([1.0; 3])]
    };
    let placed = "space directions: (1,0,0) (0,2,0) (0,0,3)\nspace origin: (10,20,30)";
    for (space, first) in [
        ("right-anterior-superior", [10.0, 20.0, 30.0]),
        ("RAS", [10.0, 20.0, 30.0]),
        ("LPS", [-10.0, -20.0, 30.0]),
        ("left-anterior-superior", [-10.0, 20.0, 30.0]),
        ("scanner-xyz", [10.0, 20.0, 30.0]),
    ] {
        assert_near(at(&format!("space: {space}\n{placed}"))[0], first);
    }
    assert_near(
        at("space dimension: 3\nspace directions: (1,0,0) (0,2,0) (0,0,3)")[1],
        [1.0, 2.0, 3.0],
    );
    assert_near(
        at("spacings: 0.5 2 3\nkinds: space space space")[1],
        [0.5, 2.0, 3.0],
    );
    assert_near(at("content: nothing of a place")[1], [1.0; 3]);
}

#[test]
fn one_of_several_volumes_is_chosen() {
    let frames: Vec<u8> = [values(), numbers(|v| [v + 100])].concat();
    // The pairs of values of each voxel.
    let lists: Vec<u8> = numbers(|v| [v, v + 100]);
    let common = "type: uint8\nencoding: raw\ndimension: 4\n";
    let placed = "(0,1.5,0) (-2,0,0) (0.5,0,3)";
    let origin = "space: RAS\nspace origin: (10,-20,7)\n";
    let last = format!("{common}{origin}sizes: 5 4 3 2\nspace directions: {placed} none");
    let first = format!("{common}{origin}sizes: 2 5 4 3\nspace directions: none {placed}");
    let by_kind = format!("{common}sizes: 2 5 4 3\nkinds: vector domain domain domain");
    let by_side = format!("{common}sizes: 2 5 4 3\nspacings: nan 1 1 1");
    let untold = format!("{common}sizes: 5 4 3 2");
    for (fields, data, is_placed) in [
        (&last, &frames, true),
        (&first, &lists, true),
        (&by_kind, &lists, false),
        (&by_side, &lists, false),
        (&untold, &frames, false),
    ] {
        let bytes = nrrd(fields, data);
        let volume = decode_frame(&bytes, Some(0)).unwrap();
        assert_values(&volume, fields);
        if is_placed {
            assert_place(&volume);
        }
        let volume = decode_frame(&bytes, Some(1)).unwrap();
        assert!((volume.value([4, 3, 2]) - 159.0).abs() < 1e-12, "{fields}");
        for (frame, part) in [
            (None, "holds 2 volumes"),
            (Some(2), "no `frame` 2: it holds 2"),
        ] {
            let error = decode_frame(&bytes, frame).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
    }
    let as_text = nrrd(&by_kind.replace("raw", "text"), &text(&lists));
    assert_values(&decode_frame(&as_text, Some(0)).unwrap(), "text");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.seg.nrrd");
    std::fs::write(&path, nrrd(&last, &frames)).unwrap();
    assert_values(&read_frame(&path, Some(0)).unwrap(), "a file");
}

#[test]
fn bad_nrrd_files_are_refused() {
    let good = format!("type: short\nencoding: raw\nendian: little\n{PLACED}");
    let data = numbers(|v| i16::from(v).to_le_bytes());
    let with = |old: &str, new: &str| {
        assert!(good.contains(old), "{old}");
        nrrd(&good.replace(old, new), &data)
    };
    let as_text = |data: &str| {
        let fields = good.replace("raw", "text");
        nrrd(&fields, data.as_bytes())
    };
    for (bytes, part) in [
        (
            with("type: short\n", ""),
            "type of the NRRD header is missing",
        ),
        (with("short", "block"), "type of the NRRD header is block"),
        (with("endian: little\n", ""), "little or big"),
        (with("raw", "bzip2"), "raw, gzip or text"),
        (with("raw", "hex"), "raw, gzip or text"),
        (
            with("dimension: 3", "dimension: 5"),
            "3, or 4 for several volumes",
        ),
        (
            with("sizes: 5 4 3", "sizes: 5 4"),
            "as many positive whole numbers as axes",
        ),
        (
            with("sizes: 5 4 3", "sizes: 5 4 x"),
            "as many positive whole numbers as axes",
        ),
        (
            with("sizes: 5 4 3", "sizes: 5 4 1"),
            "2 at least along each axis",
        ),
        (
            with("sizes: 5 4 3", "sizes: 5 4 4"),
            "should have 160 bytes by its header, and has 120",
        ),
        (
            with("sizes: 5 4 3", "sizes: 5 4 2"),
            "should have 80 bytes by its header, and has 81 or more",
        ),
        (
            with("sizes: 5 4 3", "sizes: 99999 99999 99999"),
            "may have up to",
        ),
        (with("(2,0,0)", "none"), "three axes in space"),
        (with("(2,0,0)", "(2,0)"), "three numbers in brackets"),
        (with("(2,0,0)", "(2,0,nan)"), "place in space"),
        (with("(2,0,0)", "(0,-3,0)"), "place in space"),
        (
            with("(-10,20,7)", "(-10,20)"),
            "space origin of the NRRD header is (-10,20)",
        ),
        (with("superior", "superior-time"), "one of three axes"),
        (with("kinds", "line skip: many\nkinds"), "line skip"),
        (with("kinds", "byte skip: -2\nkinds"), "byte skip"),
        (
            with("kinds", "data file: LIST\nkinds"),
            "the name of one file",
        ),
        (
            with("kinds", "data file: a%03d.raw 1 3 1\nkinds"),
            "the name of one file",
        ),
        (with("raw", "gzip"), "gzip"),
        (
            b"NRRD0004\ntype: short\n".to_vec(),
            "no empty line ends the header",
        ),
        (
            as_text("1 2 3"),
            "there should be 60 numbers, and there are 3",
        ),
        (
            as_text(&"1 ".repeat(99)),
            "there should be 60 numbers, and there are 61 or more",
        ),
        (as_text("1 2 x"), "x is no number of the type"),
        (as_text("1 2 0.5"), "0.5 is no number of the type"),
    ] {
        let error = decode(&bytes).unwrap_err().to_string();
        assert!(error.contains(part), "{part}: {error}");
        fuzzing::assert_short_line(&error);
    }
}
