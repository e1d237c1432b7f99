//! Fields as VTK image data (`.vti`), for `ParaView`.
//!
//! Axis 0 of the grid is VTK's x, axis 1 its y, axis 2 its z. VTK runs through x fastest, so the values are reordered. The repeated
//! last layer of the periodic grid is not written. The values are `Float64`, little-endian, raw, appended after the XML.
//!
//! Nothing here reads such files: what is to be read again is written as [`npy`](crate::npy).
//!
//! ```
//! use geometry::{Field, Grid, vti};
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("u.vti");
//! let u = Field::from_fn(Grid::<3>::centred(8, 2.0)?, |[x, y, z]| x * y + z);
//! vti::write(&path, "u", &u)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::path::Path;

use files::write_atomically;

use crate::{Error, Grid, PhaseField};

/// Writes a phase field on its whole grid as a point array of that name, atomically (see [`write_atomically`]).
///
/// # Errors
/// [`Error::Io`].
pub fn write<const D: usize>(
    path: impl AsRef<Path>,
    name: &str,
    field: &impl PhaseField<D>,
) -> Result<(), Error> {
    const { assert!(D <= 3, "VTK image data have at most three axes") };
    let grid = field.nodes().grid();
    Ok(write_atomically(path, |out| {
        out.write_all(header(grid, name).as_bytes())?;
        let size = (grid.len() * size_of::<f64>()) as u64;
        out.write_all(&size.to_le_bytes())?;
        for position in 0..grid.len() {
            // VTK's fastest axis is our slowest: reverse the axes.
            let mut multi_index = grid.multi_index(position);
            multi_index.reverse();
            out.write_all(&field.at(multi_index).to_le_bytes())?;
        }
        out.write_all(b"\n  </AppendedData>\n</VTKFile>\n")
    })?)
}

/// The XML up to the underscore after which the data begin.
fn header<const D: usize>(grid: &Grid<D>, name: &str) -> String {
    let last = grid.cells() - 1;
    let axes = |f: &dyn Fn(usize) -> String, beyond: &str| {
        let entry = |axis| if axis < D { f(axis) } else { beyond.to_owned() };
        [0, 1, 2].map(entry).join(" ")
    };
    let extent = axes(&|_| format!("0 {last}"), "0 0");
    let origin = axes(&|axis| grid.origin()[axis].to_string(), "0");
    let spacing = axes(&|_| grid.spacing().to_string(), "1");
    let name = name
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;");
    format!(
        r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
  <ImageData WholeExtent="{extent}" Origin="{origin}" Spacing="{spacing}">
    <Piece Extent="{extent}">
      <PointData Scalars="{name}">
        <DataArray type="Float64" Name="{name}" format="appended" offset="0"/>
      </PointData>
      <CellData/>
    </Piece>
  </ImageData>
  <AppendedData encoding="raw">
_"#
    )
}
