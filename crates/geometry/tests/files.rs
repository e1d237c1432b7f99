//! NPY and VTI files.

use std::fs;
use std::path::Path;

use crate::common::{self, doubles, foreign};
use geometry::npy::{self, NpyError};
use geometry::{Error, Field, Grid, vti};

fn sample<const D: usize>(cells: usize) -> Field<D> {
    let grid = Grid::centred(cells, 2.0).unwrap();
    let mut k = 0.1;
    let values = (0..grid.len()).map(|_| {
        k = 3.9 * k * (1.0 - k);
        k
    });
    Field::from_values(grid, values.collect()).unwrap()
}

/// The bytes that are written to a file.
fn written(write: impl FnOnce(&Path) -> Result<(), Error>) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("u");
    write(&path).unwrap();
    fs::read(path).unwrap()
}

fn read_back<const D: usize>(path: &Path) -> Result<Field<D>, Error> {
    npy::read(path, |cells| Grid::centred(cells, 2.0))
}

#[test]
fn npy_round_trips_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("u.npy");
    round_trip::<2>(&path, 17);
    round_trip::<3>(&path, 5);
    round_trip::<1>(&path, 6);
}

fn round_trip<const D: usize>(path: &Path, cells: usize) {
    let u = sample::<D>(cells);
    npy::write(path, &u).unwrap();
    assert_eq!(read_back::<D>(path).unwrap(), u);
}

#[test]
fn npy_header_is_the_documented_one() {
    let u = sample::<2>(3);
    let bytes = written(|path| npy::write(path, &u));
    assert_eq!(&bytes[..10], b"\x93NUMPY\x01\x00\x76\x00");
    let text = "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 3), }";
    assert!(bytes[10..].starts_with(text.as_bytes()));
    assert!(bytes[10 + text.len()..127].iter().all(|&b| b == b' '));
    assert_eq!(bytes[127], b'\n');
    assert_eq!(bytes.len(), 128 + 9 * 8);
    assert_eq!(
        &bytes[128 + 5 * 8..128 + 6 * 8],
        &u.values()[5].to_le_bytes()
    );
}

/// `numpy.save` of `numpy.array([[1.5, -2.0], [0.1, 3.0]])`, NumPy 2.4.
const BY_NUMPY: &str = "934e554d5059010076007b276465736372273a20273c6638272c2027666f727472616e5f6f72646572273a2046616c73652c20277368617065273a2028322c2032292c207d202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020200a000000000000f83f00000000000000c09a9999999999b93f0000000000000840";

#[test]
fn npy_files_are_those_of_numpy() {
    let numpy: Vec<u8> = (0..BY_NUMPY.len() / 2)
        .map(|i| u8::from_str_radix(&BY_NUMPY[2 * i..2 * i + 2], 16).unwrap())
        .collect();
    let values = vec![1.5, -2.0, 0.1, 3.0];
    assert_eq!(npy::decode::<2>(&numpy), Ok((2, values.clone())));
    let grid = Grid::<2>::centred(2, 2.0).unwrap();
    let u = Field::from_values(grid, values).unwrap();
    assert_eq!(written(|path| npy::write(path, &u)), numpy);
}

#[test]
fn npy_reads_what_others_write() {
    let values: Vec<f64> = (0..8_u8).map(|v| f64::from(v) + 0.5).collect();
    let c_order = doubles("(2, 2, 2)", &values);
    assert_eq!(npy::decode::<3>(&c_order), Ok((2, values.clone())));
    let data: Vec<u8> = (values.iter())
        .flat_map(|v| (*v as f32).to_le_bytes())
        .collect();
    let single = foreign("<f4", false, "(2, 2, 2)", &data);
    assert_eq!(npy::decode::<3>(&single), Ok((2, values.clone())));
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let fortran = foreign("<f8", true, "(2, 2, 2)", &data);
    let reordered = [0.5, 4.5, 2.5, 6.5, 1.5, 5.5, 3.5, 7.5].to_vec();
    assert_eq!(npy::decode::<3>(&fortran), Ok((2, reordered)));
    // Big-endian, format 2.0, keys in another order, double quotes.
    let text = "{\"shape\":(2,),\"descr\":\">f8\",\"fortran_order\":True}";
    let bytes = common::npy(2, text, &[1.5, -2.0].map(f64::to_be_bytes).concat());
    assert_eq!(npy::decode::<1>(&bytes), Ok((2, vec![1.5, -2.0])));
}

#[test]
fn npy_refuses_what_is_not_a_field() {
    let decode = |bytes: &[u8]| npy::decode::<2>(bytes).unwrap_err();
    assert_eq!(
        decode(&doubles("(2, 2, 2)", &[0.0; 8])),
        NpyError::Rank {
            expected: 2,
            shape: vec![2, 2, 2]
        }
    );
    assert_eq!(
        decode(&doubles("(2, 3)", &[0.0; 6])),
        NpyError::NotCubical { shape: vec![2, 3] }
    );
    assert_eq!(
        decode(&foreign("<i8", false, "(2, 2)", &[0; 32])),
        NpyError::DataType {
            found: "<i8".into()
        }
    );
    assert_eq!(
        decode(&doubles("(2, 2)", &[0.0, 1.0, f64::NEG_INFINITY, 0.0])),
        NpyError::NonFinite {
            index: 2,
            value: f64::NEG_INFINITY
        }
    );
    assert_eq!(decode(b"P5 3 3 255 not an array"), NpyError::NotNpy);
    assert_eq!(
        decode(b"\x93NUMPY\x04\x00"),
        NpyError::Version { major: 4, minor: 0 }
    );
    let good = doubles("(3, 3)", &[0.0; 9]);
    let whole = good.len();
    let mut longer = good.clone();
    longer.push(0);
    assert!(matches!(decode(&longer), NpyError::Length { found, .. } if found == 1 + whole as u64));
    for length in 0..whole {
        let error = decode(&good[..length]);
        if length < 6 {
            assert_eq!(error, NpyError::NotNpy);
        } else {
            let NpyError::Length { expected, found } = error else {
                panic!("{length}: {error}")
            };
            assert!(found == length as u64 && found < expected, "{length}");
        }
    }
}

/// Headers that lie about sizes, or are nonsense, give errors and take no memory.
#[test]
fn npy_survives_hostile_headers() {
    let with = |text: &str| npy::decode::<2>(&common::npy(1, text, &[])).unwrap_err();
    let shape = |shape: &str| {
        with(&format!(
            "{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"
        ))
    };
    let huge = shape("(4294967296, 4294967296)");
    assert!(
        matches!(
            huge,
            NpyError::Length {
                expected: u64::MAX,
                ..
            }
        ),
        "{huge:?}"
    );
    assert!(matches!(shape("(100000, 100000)"), NpyError::Length { .. }));
    for bad in [
        "(18446744073709551616, 2)",
        "(-2, 2)",
        "(2 2)",
        "(2, 2",
        "2",
        "((2, 2))",
        "()x",
    ] {
        assert!(matches!(shape(bad), NpyError::Header { .. }), "{bad}");
    }
    for bad in [
        "",
        "{",
        "{}",
        "{'descr'}",
        "{'descr': '<f8'}",
        "{'descr': '<f8', 'fortran_order': Maybe}",
        "{'colour': 3}",
        "{'descr': '<f8",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 2)} and more",
    ] {
        assert!(matches!(with(bad), NpyError::Header { .. }), "{bad}");
    }
    let record = with("{'descr': [('x', '<f8')], 'fortran_order': False, 'shape': (2, 2)}");
    assert!(matches!(record, NpyError::DataType { .. }), "{record:?}");
    let unicode = with("{'descr': '\u{e9}8', 'fortran_order': False, 'shape': (2, 2)}");
    assert!(matches!(unicode, NpyError::DataType { .. }), "{unicode:?}");
    // A header longer than the file.
    let cut = npy::decode::<2>(b"\x93NUMPY\x02\x00\xff\xff\xff\xff{");
    assert!(matches!(cut, Err(NpyError::Length { .. })), "{cut:?}");
}

#[test]
fn errors_name_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("absent.npy");
    let error = read_back::<2>(&path).unwrap_err();
    assert!(matches!(&error, Error::Io(error) if error.action == "read"));
    assert!(error.to_string().contains("absent.npy"));
    fs::write(&path, b"nonsense").unwrap();
    let error = read_back::<2>(&path).unwrap_err();
    assert!(matches!(
        error,
        Error::Npy {
            source: NpyError::NotNpy,
            ..
        }
    ));
    npy::write(&path, &sample::<2>(4)).unwrap();
    let other = npy::read(&path, |_| Grid::<2>::new(5, 1.0));
    assert!(matches!(
        other,
        Err(Error::ValueCount {
            expected: 25,
            actual: 16
        })
    ));
    let nowhere = folder.path().join("no/such/folder/u.npy");
    let written = npy::write(nowhere, &sample::<2>(4));
    assert!(matches!(written, Err(Error::Io(_))));
}

/// The value of an attribute after `from` in the XML.
fn attribute<'a>(xml: &'a str, element: &str, name: &str) -> &'a str {
    let rest = &xml[xml.find(element).unwrap_or_else(|| panic!("no {element}"))..];
    let rest = &rest[rest.find(&format!(" {name}=\"")).unwrap() + name.len() + 3..];
    &rest[..rest.find('"').unwrap()]
}

/// The header, and the block of appended data of the array.
fn parse_vti(bytes: &[u8], array: &str) -> (String, Vec<f64>) {
    let marker = b"<AppendedData encoding=\"raw\">\n_";
    let start = bytes
        .windows(marker.len())
        .position(|w| w == marker)
        .unwrap()
        + marker.len();
    let xml = String::from_utf8(bytes[..start].to_vec()).unwrap();
    let element = format!("<DataArray type=\"Float64\" Name=\"{array}\"");
    let offset: usize = attribute(&xml, &element, "offset").parse().unwrap();
    let block = &bytes[start + offset..];
    let size = u64::from_le_bytes(block[..8].try_into().unwrap()) as usize;
    let values = block[8..8 + size].chunks_exact(8);
    let values = values
        .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
        .collect();
    (xml, values)
}

#[test]
fn vti_holds_the_values_with_x_fastest() {
    let grid = Grid::<3>::centred(4, 2.0).unwrap();
    let u = Field::from_fn(grid, |[x, y, z]| x + 10.0 * y + 100.0 * z);
    let bytes = written(|path| vti::write(path, "a<b & \"c\"", &u));
    let (xml, values) = parse_vti(&bytes, "a&lt;b &amp; &quot;c&quot;");
    assert_eq!(attribute(&xml, "<ImageData", "WholeExtent"), "0 3 0 3 0 3");
    assert_eq!(attribute(&xml, "<ImageData", "Origin"), "-1 -1 -1");
    assert_eq!(attribute(&xml, "<ImageData", "Spacing"), "0.5 0.5 0.5");
    assert_eq!(attribute(&xml, "<VTKFile", "byte_order"), "LittleEndian");
    assert_eq!(attribute(&xml, "<VTKFile", "header_type"), "UInt64");
    assert_eq!(values.len(), 64);
    for (position, value) in values.iter().enumerate() {
        let [i, j, k] = [position % 4, position / 4 % 4, position / 16];
        assert_eq!(value.to_bits(), u.values()[grid.index([i, j, k])].to_bits());
    }
    assert!(bytes.ends_with(b"\n  </AppendedData>\n</VTKFile>\n"));
}

#[test]
fn vti_of_a_plane_is_one_layer() {
    let u = sample::<2>(5);
    let (xml, values) = parse_vti(&written(|path| vti::write(path, "u", &u)), "u");
    assert_eq!(attribute(&xml, "<Piece", "Extent"), "0 4 0 4 0 0");
    assert_eq!(attribute(&xml, "<ImageData", "Origin"), "-1 -1 0");
    assert_eq!(values[1].to_bits(), u.values()[5].to_bits());
}

/// The same field by VTK 9.7, as `tests/vtk/raw_f64_u64.vti` has it: equal bytes of data, at the same place, behind equal attributes.
#[test]
fn vti_has_the_bytes_that_vtk_writes() {
    let by_vtk = include_bytes!("vtk/raw_f64_u64.vti");
    // VTK's extent begins at node 1, and its origin belongs to node 0.
    let grid = Grid::<3>::new(2, 1.0).unwrap();
    let grid = grid.with_origin([-0.5, 0.5, 1.5]).unwrap();
    let index = |x: [f64; 3]| [0, 1, 2].map(|axis| (x[axis] - grid.origin()[axis]) / 0.5);
    let u = Field::from_fn(grid, |x| {
        let [i, j, k] = index(x);
        0.5 + i + 2.0 * j + 4.0 * k
    });
    let ours = written(|path| vti::write(path, "u", &u));
    let block = |bytes: &[u8]| {
        let marker = b"encoding=\"raw\">";
        let end = bytes.windows(marker.len()).position(|w| w == marker);
        let rest = &bytes[end.unwrap()..];
        let start = rest.iter().position(|&byte| byte == b'_').unwrap() + 1;
        rest[start..start + 8 + 8 * 8].to_vec()
    };
    assert_eq!(block(&ours), block(by_vtk));
    let [ours, theirs] = [&ours[..], by_vtk].map(String::from_utf8_lossy);
    for (element, names) in [
        (
            "<VTKFile",
            &["type", "version", "byte_order", "header_type"][..],
        ),
        ("<ImageData", &["Spacing"]),
        ("<PointData", &["Scalars"]),
        ("<DataArray", &["type", "Name", "format", "offset"]),
        ("<AppendedData", &["encoding"]),
    ] {
        for name in names {
            assert_eq!(
                attribute(&ours, element, name),
                attribute(&theirs, element, name)
            );
        }
    }
}
