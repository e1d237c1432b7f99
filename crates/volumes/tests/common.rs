//! Volumes of all formats.

use std::io::{Cursor, Write};

use flate2::Compression;
use flate2::write::GzEncoder;
use tiff::encoder::colortype::{Gray8, Gray16, Gray32Float};
use tiff::encoder::{Rational, TiffEncoder};
use tiff::tags::{ResolutionUnit, Tag};

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
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).unwrap();
    for page in values().chunks(SIZE[0] * SIZE[1]) {
        let [width, height] = [SIZE[0], SIZE[1]].map(|n| n as u32);
        let mut image = encoder.new_image::<Gray8>(width, height).unwrap();
        image.resolution_unit(ResolutionUnit::None);
        image.x_resolution(Rational { n: 2, d: 1 });
        image.y_resolution(Rational { n: 4, d: 1 });
        let tags = image.encoder();
        tags.write_tag(Tag::ImageDescription, description).unwrap();
        image.write_data(page).unwrap();
    }
    file.into_inner()
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
