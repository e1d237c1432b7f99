//! Volumes of all formats.

use std::borrow::Cow;
use std::io::{Cursor, Write};

use flate2::Compression;
use flate2::write::GzEncoder;
use tiff::encoder::colortype::{Gray8, Gray16, Gray32Float};
use tiff::encoder::{Rational, TiffEncoder, TiffValue};
use tiff::tags::{ResolutionUnit, Tag, Type};
use volumes::Volume;

/// Voxels of the volumes here.
pub const SIZE: [usize; 3] = [5, 4, 3];
/// The rows of the map of theirs: turned, sheared, of different sides.
pub const ROWS: [[f32; 4]; 3] = [
    [0.0, -2.0, 0.5, 10.0],
    [1.5, 0.0, 0.0, -20.0],
    [0.0, 0.0, 3.0, 7.0],
];

/// Different values, the first axis fastest.
pub fn values() -> Vec<u8> {
    (0..SIZE.iter().product::<usize>() as u8).collect()
}

pub fn assert_values(volume: &Volume, name: &str) {
    assert_eq!(volume.size(), SIZE, "{name}");
    let found: Vec<f64> = volume.values().collect();
    let expected: Vec<f64> = values().into_iter().map(f64::from).collect();
    assert!(found == expected, "{name}: {found:?}");
    assert!((volume.value([4, 3, 2]) - 59.0).abs() < 1e-12, "{name}");
}

pub fn assert_near(found: [f64; 3], expected: [f64; 3]) {
    let close = found
        .iter()
        .zip(expected)
        .all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(close, "{found:?} {expected:?}");
}

/// Where the rows put the voxels.
pub fn assert_place(volume: &Volume) {
    let index = [1.0, 2.0, 3.0];
    let place = ROWS.map(|row| {
        let terms = (0..3).map(|axis| f64::from(row[axis]) * index[axis]);
        terms.sum::<f64>() + f64::from(row[3])
    });
    assert_near(volume.position(index), place);
    assert!((volume.voxel_volume() - 9.0).abs() < 1e-6);
}

/// Bytes that are put into a header in either order.
pub struct Header {
    pub bytes: Vec<u8>,
    pub big_endian: bool,
}

impl Header {
    pub fn new(length: usize, big_endian: bool) -> Self {
        Self {
            bytes: vec![0; length],
            big_endian,
        }
    }

    /// A number in little-endian order.
    pub fn put<const N: usize>(&mut self, at: usize, mut number: [u8; N]) -> &mut Self {
        if self.big_endian {
            number.reverse();
        }
        self.bytes[at..at + N].copy_from_slice(&number);
        self
    }
}

/// With the voxels in the type of that number.
pub fn nifti(data_type: i16, big_endian: bool, voxels: &[u8]) -> Vec<u8> {
    let mut header = Header::new(352, big_endian);
    header.put(0, 348_i32.to_le_bytes());
    for (axis, n) in [3, 5, 4, 3, 1, 1, 1, 1_i16].into_iter().enumerate() {
        header.put(40 + 2 * axis, n.to_le_bytes());
    }
    header.put(70, data_type.to_le_bytes());
    header.put(108, 352_f32.to_le_bytes());
    header.put(254, 1_i16.to_le_bytes());
    for (place, entry) in ROWS.as_flattened().iter().enumerate() {
        header.put(280 + 4 * place, entry.to_le_bytes());
    }
    header.bytes[344..348].copy_from_slice(b"n+1\0");
    [&header.bytes, voxels].concat()
}

pub fn nifti_2(big_endian: bool, voxels: &[u8]) -> Vec<u8> {
    let mut header = Header::new(544, big_endian);
    header.put(0, 540_i32.to_le_bytes());
    header.bytes[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
    header.put(12, 2_i16.to_le_bytes());
    for (axis, n) in [3, 5, 4, 3, 1, 1, 1, 1_i64].into_iter().enumerate() {
        header.put(16 + 8 * axis, n.to_le_bytes());
    }
    header.put(168, 544_i64.to_le_bytes());
    header.put(348, 1_i32.to_le_bytes());
    for (place, entry) in ROWS.as_flattened().iter().enumerate() {
        header.put(400 + 8 * place, f64::from(*entry).to_le_bytes());
    }
    [&header.bytes, voxels].concat()
}

/// With these fields, a comment, a note and the voxels.
pub fn nrrd(fields: &str, voxels: &[u8]) -> Vec<u8> {
    let head = format!("NRRD0004\n# of a test\n{fields}\nan organ:=the heart: a muscle\n\n");
    [head.as_bytes(), voxels].concat()
}

/// With the voxels in the type of that number; turned, of 2 x 3 x 4, with the centre at (1, -2, 5).
pub fn mgh(data_type: i32, frames: i32, voxels: &[u8]) -> Vec<u8> {
    let mut header = Header::new(284, true);
    for (place, n) in [1, 5, 4, 3, frames, data_type].into_iter().enumerate() {
        header.put(4 * place, n.to_le_bytes());
    }
    header.put(28, 1_i16.to_le_bytes());
    let directions = [0.0, 0.6, 0.8, -1.0, 0.0, 0.0, 0.0, -0.8, 0.6];
    let numbers = [[2.0, 3.0, 4.0], [1.0, -2.0, 5.0_f32]];
    let numbers = numbers[0].iter().chain(&directions).chain(&numbers[1]);
    for (place, number) in numbers.enumerate() {
        header.put(30 + 4 * place, number.to_le_bytes());
    }
    [&header.bytes, voxels].concat()
}

/// Voxels of 2 x 3 x 0.5, whose columns are along z and sections along x.
pub fn mrc(mode: i32, big_endian: bool, voxels: &[u8]) -> Vec<u8> {
    let mut header = Header::new(1024, big_endian);
    let sizes = SIZE.map(|n| n as i32);
    for axis in 0..3 {
        header.put(4 * axis, sizes[axis].to_le_bytes());
        // Of x, y, z: half as many intervals as the cell is long, ...
        let (intervals, length) = [(10, 20.0_f32), (4, 12.0), (8, 4.0)][axis];
        header.put(28 + 4 * axis, i32::to_le_bytes(intervals));
        header.put(40 + 4 * axis, length.to_le_bytes());
        header.put(52 + 4 * axis, 90_f32.to_le_bytes());
        header.put(64 + 4 * axis, [3, 2, 1_i32][axis].to_le_bytes());
        header.put(196 + 4 * axis, [1.0, -2.0, 5.0_f32][axis].to_le_bytes());
    }
    header.put(12, mode.to_le_bytes());
    header.put(92, 8_i32.to_le_bytes());
    header.bytes[208..212].copy_from_slice(b"MAP ");
    let stamp = if big_endian { 0x11 } else { 0x44 };
    header.bytes[212..214].fill(stamp);
    [&header.bytes[..], &[9; 8], voxels].concat()
}

/// As ImageJ writes it, with pixels of 0.5 x 0.25 and pages at a distance of 2.
pub fn stack(description: &str) -> Vec<u8> {
    let all = values();
    let all: Vec<Vec<u8>> = all.chunks(SIZE[0] * SIZE[1]).map(<[u8]>::to_vec).collect();
    pages([SIZE[0] as u32, SIZE[1] as u32], description, &all)
}

/// Pages of this width and height.
pub fn pages([width, height]: [u32; 2], description: &str, all: &[Vec<u8>]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).unwrap();
    for page in all {
        let mut image = encoder.new_image::<Gray8>(width, height).unwrap();
        image.resolution_unit(ResolutionUnit::None);
        image.x_resolution(Rational { n: 2, d: 1 });
        image.y_resolution(Rational { n: 4, d: 1 });
        // The crate writes ASCII only, and OME-TIFF has UTF-8.
        let bytes = [description.as_bytes(), &[0]].concat();
        let tags = image.encoder();
        tags.write_tag(Tag::ImageDescription, Text(&bytes)).unwrap();
        image.write_data(page).unwrap();
    }
    file.into_inner()
}

/// A text that ends with zero.
struct Text<'a>(&'a [u8]);

impl TiffValue for Text<'_> {
    const BYTE_LEN: u8 = 1;
    const FIELD_TYPE: Type = Type::ASCII;

    fn count(&self) -> usize {
        self.0.len()
    }

    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Borrowed(self.0)
    }
}

/// An array of `NumPy`.
pub fn npy(data_type: &str, fortran_order: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran_order { "True" } else { "False" };
    let header =
        format!("{{'descr': '{data_type}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
}

/// A stack whose pages have another tag or value in place of a tag with one short number.
pub fn retagged(stack: &[u8], old: [u16; 2], new: [u16; 2]) -> Vec<u8> {
    let entry = |[tag, value]: [u16; 2]| {
        let [tag, kind, value] = [tag, 3, value].map(u16::to_ne_bytes);
        [&tag[..], &kind, &1_u32.to_ne_bytes(), &value].concat()
    };
    let (old, new, mut bytes) = (entry(old), entry(new), stack.to_vec());
    for at in 0..bytes.len() {
        if bytes[at..].starts_with(&old) {
            bytes[at..at + new.len()].copy_from_slice(&new);
        }
    }
    bytes
}

/// The same values in wider numbers, compressed.
pub fn wide_stacks() -> [Vec<u8>; 2] {
    let compressed = || tiff::encoder::Compression::Lzw;
    let [width, height] = [SIZE[0], SIZE[1]].map(|n| n as u32);
    let mut shorts = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut shorts).unwrap();
    encoder = encoder.with_compression(compressed());
    for page in values().chunks(SIZE[0] * SIZE[1]) {
        let page: Vec<u16> = page.iter().map(|&v| u16::from(v)).collect();
        encoder.write_image::<Gray16>(width, height, &page).unwrap();
    }
    let mut floats = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut floats).unwrap();
    for page in values().chunks(SIZE[0] * SIZE[1]) {
        let page: Vec<f32> = page.iter().map(|&v| f32::from(v)).collect();
        encoder
            .write_image::<Gray32Float>(width, height, &page)
            .unwrap();
    }
    [shorts.into_inner(), floats.into_inner()]
}

pub fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}
