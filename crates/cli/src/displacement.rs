//! How far a surface has gone, as a picture.

use report::{Axis, Figure, LineChart, OKABE_ITO, Raster, Rgb, Series, viridis};

use crate::prelude::*;

const PIXELS: u32 = 640;
/// Bars of the histogram, and their width in the figure.
const BARS: usize = 40;
const WIDTH: f64 = 8.0;
/// The colour of what the grid does not hold, which is none of viridis.
const LOST: Rgb = OKABE_ITO[1];

/// The surface in the colours of the lengths by which its vertices have moved, and their histogram, whose bars say which colour is which
/// length. Vertices that are `lost`, at parts or gaps that the grid does not hold, have a colour of their own.
pub fn figure(
    mesh: &TriangleMesh,
    lengths: &[f64],
    lost: &[bool],
    up: UpAxis,
) -> Result<Figure, Error> {
    let largest = lengths.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let colours = lengths.iter().zip(lost);
    let colours = colours.map(|(length, lost)| {
        if *lost {
            LOST
        } else {
            viridis(length / largest)
        }
    });
    let scene = Scene::of_mesh(mesh.clone()).view(outlet::view(up));
    let picture = scene.painted(colours.collect())?.render([PIXELS; 2])?;
    let count = lost.iter().filter(|lost| **lost).count();
    let percent = 100.0 / lengths.len().max(1) as f64;
    let caption = match count {
        0 => String::new(),
        _ => format!(
            "orange: {:.1} % of the vertices, at parts or gaps that the grid does not hold",
            percent * count as f64
        ),
    };
    let size = [picture.width(), picture.height()].map(|side| side as usize);
    let surface = Raster::new(size, picture.pixels()).with_caption(caption);
    let mut shares = [0.0; BARS];
    for length in lengths {
        let bar = (length / largest * BARS as f64) as usize;
        shares[bar.min(BARS - 1)] += percent;
    }
    let bars = shares.iter().enumerate().map(|(bar, share)| {
        let middle = (bar as f64 + 0.5) / BARS as f64;
        let bar = Series::new("", [[middle * largest, 0.0], [middle * largest, *share]]);
        bar.with_colour(viridis(middle)).with_width(WIDTH)
    });
    let chart = LineChart::new(
        "How far it has gone at its vertices",
        Axis::linear("length, in the units of the mesh").with_range(0.0, largest),
        Axis::linear("vertices, %"),
    );
    Ok(Figure::new("", 2)
        .with_panel(surface)
        .with_panel(chart.with_curves(bars)))
}
