//! What became of a surface, and how far it has gone.

use render::{Quality, View};
use report::{Axis, Figure, LineChart, OKABE_ITO, Raster, Rgb, Series, viridis};
use surfaces::hausdorff_distance;

use crate::made::Surface;
use crate::parts::PartReport;
use crate::prelude::*;

const PIXELS: u32 = 640;
/// Bars of the histogram, and their width in the figure.
const BARS: usize = 40;
const WIDTH: f64 = 8.0;
/// Vertices nearer to a bound than this part of it are at the bound.
const AT_BOUND: f64 = 1e-6;
/// The colour of what the grid does not hold, which is none of viridis.
const LOST: Rgb = OKABE_ITO[1];

/// What became of a surface.
pub struct Faired {
    pub surface: Surface,
    pub displacement: Displacement,
    pub report: MeshReport,
}

impl Faired {
    /// A new mesh in place of a surface.
    pub fn anew(before: &ClosedMesh, mesh: TriangleMesh, up: UpAxis) -> Self {
        let distance = MeshDistance::new(before);
        let lengths = distance.signed_distances(&mesh.vertices).into_iter();
        let lengths: Vec<f64> = lengths.map(f64::abs).collect();
        Self {
            report: MeshReport::new(before, &mesh, &lengths),
            displacement: Displacement {
                lost: vec![false; lengths.len()],
                mesh: mesh.clone(),
                lengths,
                up,
            },
            surface: Surface {
                mesh,
                up,
                file: None,
            },
        }
    }
}

/// The zero set as triangles, which would cut off what is round, with its volume where that can be measured.
pub fn surface(u: &Stored<3>, eps: f64) -> Result<TriangleMesh> {
    let mesh = surfaces::remeshed_surface(u, eps)?;
    let zero_set = ZeroSet::of(u, eps)?;
    Ok(if zero_set.sizes_hold() {
        mesh.with_volume(zero_set.volume, |_| true).untangled(&mesh)
    } else {
        mesh
    })
}

/// How a surface differs from the one that it was.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshReport {
    /// Distance of its vertices from the old surface, root of the mean square, in the units of the mesh.
    pub displacement_rms: f64,
    /// This root of the mean square in percent of the longest side.
    pub displacement_rms_percent: f64,
    /// The largest distance of a vertex from the old surface, in the units of the mesh.
    pub displacement_largest: f64,
    /// This largest distance in percent of the longest side.
    pub displacement_largest_percent: f64,
    /// The Hausdorff distance of both surfaces, in the units of the mesh. A mesh that folds over itself has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hausdorff_distance: Option<f64>,
    /// The Hausdorff distance in percent of the longest side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hausdorff_distance_percent: Option<f64>,
    /// The change of the volume, in percent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_change_percent: Option<f64>,
    /// By how much the volume differs from that which was asked for, in percent, if that is more than a thousandth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume_missed_percent: Option<f64>,
    /// The change of the area, in percent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area_change_percent: Option<f64>,
    /// Standard deviation of the noise that was taken off, in the units of the mesh; 0 where something else ended the flow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
    /// The part of the vertices that could not follow the flow, in percent; none for a new mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_behind_percent: Option<f64>,
    /// How many vertices were held back, which would have gone farther than noise explains; none is told where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_back: Option<usize>,
    /// How many edges of the mesh have stayed sharp; none is told where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kept_edges: Option<usize>,
    /// Their length, in the units of the mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kept_edges_length: Option<f64>,
    /// Whether the surface has a boundary, which does not move.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_open: bool,
    /// The largest distance from the old surface that was allowed, in the units of the mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_distance: Option<f64>,
    /// How many vertices are at this distance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertices_at_max_distance: Option<usize>,
    /// Their part of all vertices, in percent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertices_at_max_distance_percent: Option<f64>,
    /// The parts of a segmentation whose parts keep their volumes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<PartReport>,
}

impl MeshReport {
    /// Of a mesh whose vertices are that far from the surface `before`.
    pub fn new(before: &ClosedMesh, after: &TriangleMesh, lengths: &[f64]) -> Self {
        let percent = |length: f64| 100.0 * length / before.bounding_box().longest_side();
        let squares: f64 = lengths.iter().map(|length| length * length).sum();
        let largest = lengths.iter().copied().fold(0.0, f64::max);
        let rms = (squares / lengths.len().max(1) as f64).sqrt();
        let mut report = Self {
            displacement_rms: rms,
            displacement_rms_percent: percent(rms),
            displacement_largest: largest,
            displacement_largest_percent: percent(largest),
            ..Self::default()
        };
        // A mesh that folds over itself is written all the same, and has no distance.
        let after = if before.is_union() {
            before.moved(after.clone())
        } else {
            ClosedMesh::new(after.clone()).map(|(after, _)| after)
        };
        if let Ok(after) = after {
            let far = hausdorff_distance(before, &after);
            let relative = |after: f64, before: f64| Some(100.0 * (after / before - 1.0));
            report.hausdorff_distance = Some(far);
            report.hausdorff_distance_percent = Some(percent(far));
            report.volume_change_percent = relative(after.volume(), before.volume());
            report.area_change_percent = relative(after.area(), before.area());
        }
        report
    }

    /// Tells of vertices that are that far from the surface before how many are at a bound.
    pub fn bound(&mut self, length: f64, lengths: &[f64]) {
        let at = lengths
            .iter()
            .filter(|far| **far >= (1.0 - AT_BOUND) * length);
        let at = at.count();
        self.max_distance = Some(length);
        self.vertices_at_max_distance = Some(at);
        let all = lengths.len().max(1) as f64;
        self.vertices_at_max_distance_percent = Some(100.0 * at as f64 / all);
    }
}

/// How far the vertices of a surface have moved.
pub struct Displacement {
    pub mesh: TriangleMesh,
    /// For each vertex.
    pub lengths: Vec<f64>,
    /// Whether a vertex is at a part or gap that the grid does not hold.
    pub lost: Vec<bool>,
    pub up: UpAxis,
}

impl Displacement {
    /// The surface in the colours of the lengths, and their histogram, whose bars say which colour is which length. Vertices that are lost have a
    /// colour of their own.
    pub fn figure(&self) -> Result<Figure> {
        // Also where all of them are zero there is a range of lengths.
        let largest = self.lengths.iter().copied().fold(1e-100, f64::max);
        Ok(Figure::new("", 2)
            .with_panel(self.painted(largest)?)
            .with_panel(self.histogram(largest)))
    }

    fn painted(&self, largest: f64) -> Result<Raster> {
        let colours = self.lengths.iter().zip(&self.lost);
        let colours = colours.map(|(length, lost)| {
            if *lost {
                LOST
            } else {
                viridis(length / largest)
            }
        });
        // It shows numbers; `final.png` is the picture of the shape.
        let scene = Scene::of_mesh(self.mesh.clone()).quality(Quality::Draft);
        let scene = scene.view(View::from_front_left(self.up));
        let picture = scene.painted(colours.collect())?.render([PIXELS; 2])?;
        let count = self.lost.iter().filter(|lost| **lost).count();
        let caption = match count {
            0 => String::new(),
            _ => format!(
                "orange: {:.1} % of the vertices, at parts or gaps that the grid does not hold",
                self.percent() * count as f64
            ),
        };
        let size = picture.size().map(|side| side as usize);
        Ok(Raster::new(caption, size, picture.pixels()))
    }

    fn histogram(&self, largest: f64) -> LineChart {
        let mut shares = [0.0; BARS];
        for length in &self.lengths {
            let bar = (length / largest * BARS as f64) as usize;
            shares[bar.min(BARS - 1)] += self.percent();
        }
        let bars = shares.iter().enumerate().map(|(bar, share)| {
            let middle = (bar as f64 + 0.5) / BARS as f64;
            let bar = Series::new("", [[middle * largest, 0.0], [middle * largest, *share]]);
            bar.with_colour(viridis(middle)).with_width(WIDTH)
        });
        LineChart::new(
            "How far it has gone at its vertices",
            Axis::linear("length, in the units of the mesh").with_range(0.0, largest),
            Axis::linear("vertices, %"),
        )
        .with_curves(bars)
    }

    /// The share of one vertex.
    fn percent(&self) -> f64 {
        100.0 / self.lengths.len().max(1) as f64
    }
}
