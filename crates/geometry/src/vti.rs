//! Fields as VTK image data (`.vti`), for `ParaView`.
//!
//! One file holds any number of named point arrays on one grid. Axis 0 of the grid is VTK's x, axis
//! 1 its y, axis 2 its z. VTK runs through x fastest, so the values are reordered. The repeated
//! last layer of the periodic grid is not written.
//!
//! Written are `Float64` arrays, little-endian, raw, appended after the XML; [`read`] understands
//! what other programs write, too.
//!
//! ```
//! use geometry::{Field, Grid, vti};
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("u.vti");
//! let u = Field::from_fn(Grid::<3>::centred(8, 2.0)?, |[x, y, z]| x * y + z);
//! vti::write(&path, &[("u", &u)])?;
//! let arrays = vti::read::<3>(&path)?;
//! assert_eq!(arrays, [("u".to_owned(), u)]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub(crate) mod error;
mod read;
mod stream;

pub use error::VtiError;
pub use read::{Image, decode, read};

use std::collections::HashSet;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::Path;

use crate::file::write_atomically;
use crate::{Error, Field, Grid};

/// Writes named fields on a common grid, atomically (see [`write_atomically`]).
///
/// # Errors
/// No arrays, an empty name or one used twice, control characters in a name, fields on
/// different grids, or [`Error::Io`].
pub fn write<const D: usize>(
    path: impl AsRef<Path>,
    arrays: &[(&str, &Field<D>)],
) -> Result<(), Error> {
    const { assert!(D <= 3, "VTK image data have at most three axes") };
    let path = path.as_ref();
    let Some((_, first)) = arrays.first() else {
        return Err(Error::NoArrays { path: path.into() });
    };
    let grid = first.grid();
    let mut names = HashSet::new();
    for (name, field) in arrays {
        grid.same_as(field.grid())?;
        let bad = |reason| {
            Err(Error::ArrayName {
                name: (*name).into(),
                reason,
            })
        };
        if name.is_empty() {
            return bad("it is empty");
        }
        if name.chars().any(char::is_control) {
            return bad("it contains a control character");
        }
        if !names.insert(name) {
            return bad("it is used twice");
        }
    }
    write_atomically(path, |out| write_to(out, grid, arrays))
}

fn write_to<const D: usize>(
    out: &mut dyn Write,
    grid: &Grid<D>,
    arrays: &[(&str, &Field<D>)],
) -> io::Result<()> {
    let header = header(grid, arrays);
    out.write_all(header.as_bytes())?;
    let size = (grid.len() * size_of::<f64>()) as u64;
    for (_, field) in arrays {
        out.write_all(&size.to_le_bytes())?;
        for position in 0..grid.len() {
            // VTK's fastest axis is our slowest: reverse the axes.
            let mut multi_index = grid.multi_index(position);
            multi_index.reverse();
            out.write_all(&field.values()[grid.index(multi_index)].to_le_bytes())?;
        }
    }
    out.write_all(b"\n  </AppendedData>\n</VTKFile>\n")
}

/// The XML up to the underscore after which the data begin.
fn header<const D: usize>(grid: &Grid<D>, arrays: &[(&str, &Field<D>)]) -> String {
    let last = grid.cells() - 1;
    let axes = |f: &dyn Fn(usize) -> String, beyond: &str| {
        let entry = |axis| if axis < D { f(axis) } else { beyond.to_owned() };
        [0, 1, 2].map(entry).join(" ")
    };
    let extent = axes(&|_| format!("0 {last}"), "0 0");
    let origin = axes(&|axis| grid.origin()[axis].to_string(), "0");
    let spacing = axes(&|_| grid.spacing().to_string(), "1");
    let block = size_of::<u64>() + grid.len() * size_of::<f64>();
    let mut points = String::new();
    for (k, (name, _)) in arrays.iter().enumerate() {
        let (name, offset) = (escape(name), k * block);
        let _ = writeln!(
            points,
            "        <DataArray type=\"Float64\" Name=\"{name}\" \
             format=\"appended\" offset=\"{offset}\"/>"
        );
    }
    format!(
        r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
  <ImageData WholeExtent="{extent}" Origin="{origin}" Spacing="{spacing}">
    <Piece Extent="{extent}">
      <PointData Scalars="{scalars}">
{points}      </PointData>
      <CellData/>
    </Piece>
  </ImageData>
  <AppendedData encoding="raw">
_"#,
        scalars = escape(arrays.first().map_or("", |(name, _)| name)),
    )
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
