//! NIfTI files out.

use std::io::{self, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::{Error, Volume};

/// Length of the header, and where voxels begin behind it.
const HEADER: usize = 348;
const START: usize = 352;
/// Most voxels along an axis.
const MOST: usize = i16::MAX as usize;

/// Writes labels as NIfTI-1, atomically, to a name that ends in `.nii`, or compressed in `.nii.gz`. Values go to the nearest whole number, of 8 bits
/// where all are from 0 to 255, and of 32 bits otherwise. There may be up to 32767 voxels along each axis.
pub fn write(path: impl AsRef<Path>, volume: &Volume) -> Result<(), Error> {
    let path = path.as_ref();
    let ends = |path: &Path, with: &str| {
        path.extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case(with))
    };
    let stem = path.file_stem().map(Path::new);
    let packed = ends(path, "gz") && stem.is_some_and(|stem| ends(stem, "nii"));
    if !packed && !ends(path, "nii") {
        return Err(Error::UnknownFormat { path: path.into() });
    }
    if volume.size().iter().any(|&n| n > MOST) {
        return Err(Error::TooManyVoxels {
            path: path.into(),
            size: volume.size(),
            most: MOST,
        });
    }
    Ok(files::write_atomically(path, |out| {
        if packed {
            let mut packed = GzEncoder::new(out, Compression::default());
            nifti(&mut packed, volume)?;
            packed.finish().map(drop)
        } else {
            nifti(out, volume)
        }
    })?)
}

fn nifti(out: &mut dyn Write, volume: &Volume) -> io::Result<()> {
    let mut header = [0; START];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &(HEADER as i32).to_le_bytes());
    let [x, y, z] = volume.size().map(|n| n as i16);
    for (axis, n) in [3, x, y, z, 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * axis, &n.to_le_bytes());
    }
    let [low, high] = volume.range();
    let is_small = low > -0.5 && high < 255.5;
    // Whole numbers of 8 bits without sign, or of 32 bits.
    let [kind, bits]: [i16; 2] = if is_small { [2, 8] } else { [8, 32] };
    put(70, &kind.to_le_bytes());
    put(72, &bits.to_le_bytes());
    put(108, &(START as f32).to_le_bytes());
    put(112, &1_f32.to_le_bytes());
    // The map of aligned coordinates.
    put(254, &2_i16.to_le_bytes());
    let columns = volume.frame.to_cols_array_2d();
    for (column, entries) in columns.iter().enumerate() {
        for (row, &entry) in entries.iter().enumerate() {
            put(280 + 16 * row + 4 * column, &(entry as f32).to_le_bytes());
        }
        if column < 3 {
            let side = glam::DVec3::from_array(*entries).length() as f32;
            put(80 + 4 * column, &side.to_le_bytes());
        }
    }
    put(344, b"n+1\0");
    out.write_all(&header)?;
    let labels = volume.values().map(f64::round);
    let bytes: Vec<u8> = if is_small {
        labels.map(|label| label as u8).collect()
    } else {
        labels
            .flat_map(|label| (label as i32).to_le_bytes())
            .collect()
    };
    out.write_all(&bytes)
}
