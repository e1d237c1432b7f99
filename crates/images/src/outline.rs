//! Closed curves around a shape.

use geometry::contour::{Polyline, zero_level_of};
use geometry::measure::BoundingBox;
use geometry::{Field, Placement, positive, profile_variable};
use rayon::prelude::*;

use crate::{Error, Image, LARGEST_OUTLINE, Side};

/// The outline of a shape: closed polygons, counter-clockwise around insides and clockwise around
/// holes.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    curves: Vec<Polyline>,
}

impl Outline {
    /// The outline of the pixels of an image that are on the given side, resolved below the size
    /// of a pixel.
    ///
    /// Values belong to the centres of the pixels. Between them
    /// marching squares interpolate linearly; where two opposite corners of a cell are inside, the
    /// mean of all four decides whether they are joined. Up to the edge of the image, half a pixel
    /// further, values stay as they are.
    ///
    /// At smooth edges the outline is right to a tenth of a pixel if they are blended, and to half a
    /// pixel if they are hard. Corners are cut off by half a pixel.
    ///
    /// An image all on one side is refused, and one of more than [`LARGEST_OUTLINE`] segments, which is noise.
    pub fn of_image(image: &Image, side: Side) -> Result<Self, Error> {
        let [width, height] = image.size().map(|n| n as usize);
        let depth = |pixel: usize| side.depth(image.pixel(pixel));
        let pixels = width * height;

        let inside = (0..pixels).into_par_iter().filter(|&p| depth(p) > 0.0);
        let inside = inside.count();
        let one_sided = |inside| {
            let (low, high) = range((0..pixels).map(|p| side.value(image.pixel(p))));
            Error::OneSided {
                inside,
                side: side.to_string(),
                quantity: side.quantity(),
                low,
                high,
            }
        };
        if inside == pixels {
            return Err(one_sided("everything"));
        }
        let changes = |row: usize| {
            let sides =
                |row: usize| (row * width..(row + 1) * width).map(|pixel| depth(pixel) > 0.0);
            let right = sides(row).zip(sides(row).skip(1)).filter(|(a, b)| a != b);
            let below = sides(row).zip(sides((row + 1).min(height - 1)));
            right.count() + below.filter(|(a, b)| a != b).count()
        };
        let segments = (0..height).into_par_iter().map(changes).sum();
        if segments > LARGEST_OUTLINE {
            return Err(Error::Noise { segments });
        }

        // Nodes are the centres of the pixels, and the edges of the image before and after them. The
        // first axis points down and the second to the right: the plane, turned by a right angle.
        let size = [height, width];
        let coordinate = |axis: usize, node: usize| match node {
            0 => 0.0,
            _ if node > size[axis] => size[axis] as f64,
            _ => node as f64 - 0.5,
        };
        let value = |node: [usize; 2]| {
            let [row, column] = [0, 1].map(|axis| node[axis].clamp(1, size[axis]) - 1);
            depth(row * width + column)
        };
        let nodes = size.map(|n| n + 2);
        let mut curves = closed_curves(nodes, value, coordinate);
        for point in curves.iter_mut().flat_map(|curve| &mut curve.points) {
            *point = [point[1], height as f64 - point[0]];
        }
        Self::of(curves).ok_or_else(|| one_sided("nothing"))
    }

    /// The same curves without the raster of an image, whose bending energy would outweigh that of the shape.
    ///
    /// Points every half unit move towards the middle of their neighbours again and again, but none goes further than `tolerance` from
    /// where it was; then each curve gets back the area that it has lost by this. Outlines of more than a hundred thousand units have fewer rounds of
    /// this, which take off shorter waves. Of an image, [`Tones::raster`](crate::Tones::raster) says how far the points of its outline may be off.
    /// The tolerance must be finite and positive.
    pub fn smoothed(&self, tolerance: f64) -> Result<Self, Error> {
        positive("tolerance", tolerance)?;
        let curves: Vec<_> = self.curves.par_iter().map(every_half_unit).collect();
        let points: usize = curves.iter().map(Vec::len).sum();
        let rounds = (MOST_MOVES / points.max(1)).clamp(FEWEST_ROUNDS, ROUNDS);
        let curves = curves.into_par_iter();
        Ok(Self {
            curves: (curves.map(|points| smoothed(points, tolerance, rounds))).collect(),
        })
    }

    /// The interface of a phase field: marching squares on `atanh u`, as
    /// [`contour::zero_level`](geometry::contour::zero_level), in the whole box of the grid with
    /// its repeated last layer. Where `u > 0` at a face of the box the curve runs along
    /// that face, so that all curves are closed. `u` must change its sign.
    pub fn of_phase_field(u: &Field<2>) -> Result<Self, Error> {
        u.check_finite()?;
        let (low, high) = range(u.values().iter().copied());
        let (grid, values) = (u.grid(), u.values());
        if low > 0.0 || high <= 0.0 {
            return Err(Error::NoInterface { low, high });
        }
        let curves = closed_curves(
            grid.shape().map(|n| n + 1),
            |node| profile_variable(values[grid.index(node)]),
            |axis, i| grid.coordinate(axis, i),
        );
        Self::of(curves).ok_or(Error::NoInterface { low, high })
    }

    /// Unless there are no curves, as around values so small that they have no extent.
    fn of(curves: Vec<Polyline>) -> Option<Self> {
        (!curves.is_empty()).then_some(Self { curves })
    }

    /// The curves.
    pub fn curves(&self) -> &[Polyline] {
        &self.curves
    }

    /// The middle of each segment with its outward normal and its length; of long outlines those of every k-th segment, at most `most` of them.
    pub fn sides(&self, most: usize) -> impl Iterator<Item = ([f64; 2], [f64; 2], f64)> + Clone {
        let segments = self.curves.iter().flat_map(Polyline::segments);
        let count: usize = self.curves.iter().map(|curve| curve.points.len()).sum();
        let segments = segments.step_by(count.div_ceil(most).max(1));
        let sides = segments.map(|(a, b)| {
            let along = [b[0] - a[0], b[1] - a[1]];
            let length = along[0].hypot(along[1]);
            let normal = [along[1], -along[0]].map(|x| x / length);
            ([0, 1].map(|i| 0.5 * (a[i] + b[i])), normal, length)
        });
        sides.filter(|(_, _, length)| *length > 0.0)
    }

    /// The enclosed area, less that of the holes.
    pub fn area(&self) -> f64 {
        self.curves.iter().map(Polyline::signed_area).sum()
    }

    /// The length of all curves together.
    pub fn length(&self) -> f64 {
        self.curves.iter().map(Polyline::length).sum()
    }

    /// The smallest rectangle around all curves.
    pub fn bounding_box(&self) -> BoundingBox<2> {
        let points = self.curves.iter().flat_map(|curve| &curve.points).copied();
        BoundingBox::around(points).expect("an outline has curves")
    }

    /// The outline in the box of a grid.
    #[must_use]
    pub fn placed(&self, placement: &Placement<2>) -> Self {
        let placed = |curve: &Polyline| Polyline {
            points: curve.points.iter().map(|&x| placement.apply(x)).collect(),
            closed: curve.closed,
        };
        Self {
            curves: self.curves.iter().map(placed).collect(),
        }
    }
}

/// Points of a closed curve at equal distances, at least eight of them.
fn every_half_unit(curve: &Polyline) -> Vec<[f64; 2]> {
    let length = curve.length();
    let count = ((2.0 * length).ceil() as usize).max(8);
    let at = |k: usize| length * k as f64 / count as f64;
    let (mut points, mut passed) = (Vec::with_capacity(count), 0.0);
    for (a, b) in curve.segments() {
        let part = (b[0] - a[0]).hypot(b[1] - a[1]);
        while points.len() < count && at(points.len()) <= passed + part {
            let t = (at(points.len()) - passed) / part.max(f64::MIN_POSITIVE);
            points.push([0, 1].map(|i| a[i] + t * (b[i] - a[i])));
        }
        passed += part;
    }
    points
}

/// Rounds of smoothing, which take off waves of up to some 60 units.
const ROUNDS: usize = 1500;
/// Outlines that are so long that these rounds would move points more often than this have fewer,
const MOST_MOVES: usize = 300_000_000;
/// but not fewer than these, which take off the steps between pixels.
const FEWEST_ROUNDS: usize = 60;

/// A closed curve that is as short as it can be, none of whose points goes further than that, moved along its normals to the area that it
/// had.
fn smoothed(original: Vec<[f64; 2]>, farthest: f64, rounds: usize) -> Polyline {
    let count = original.len();
    let mut points = original.clone();
    let mut next = points.clone();
    let most = (1.0 - 1e-9) * farthest * farthest;
    for _ in 0..rounds {
        for (k, point) in next.iter_mut().enumerate() {
            let [before, after] = [points[(k + count - 1) % count], points[(k + 1) % count]];
            let wanted =
                [0, 1].map(|i| 0.25 * (before[i] + after[i]) + 0.5 * points[k][i] - original[k][i]);
            // Next to none goes so far that its way has to be measured to the last bit.
            let is_far = wanted[0] * wanted[0] + wanted[1] * wanted[1] > most;
            let shorter = if is_far {
                (farthest / wanted[0].hypot(wanted[1])).min(1.0)
            } else {
                1.0
            };
            *point = [0, 1].map(|i| original[k][i] + shorter * wanted[i]);
        }
        std::mem::swap(&mut points, &mut next);
    }
    let curve = |points| Polyline {
        points,
        closed: true,
    };
    let (smooth, original) = (curve(points.clone()), curve(original));
    let area = original.signed_area();
    let lost = area - smooth.signed_area();
    // A speck of a few pixels has shrunk to a point or nearly, and stays as it is.
    if lost.abs() >= 0.5 * area.abs() {
        return original;
    }
    let outwards = lost / smooth.length();
    let moved = (0..count).map(|k| {
        let [before, after] = [points[(k + count - 1) % count], points[(k + 1) % count]];
        let along = [after[0] - before[0], after[1] - before[1]];
        let length = along[0].hypot(along[1]).max(f64::MIN_POSITIVE);
        // The inside is on the left.
        let normal = [along[1] / length, -along[0] / length];
        [0, 1].map(|i| points[k][i] + outwards * normal[i])
    });
    curve(moved.collect())
}

/// The zero level set of a lattice, closed along its edges: beyond them is outside.
fn closed_curves(
    shape: [usize; 2],
    value: impl Fn([usize; 2]) -> f64,
    coordinate: impl Fn(usize, usize) -> f64,
) -> Vec<Polyline> {
    // One more layer of nodes all around, in the same places as the outermost ones.
    let inner = |axis: usize, node: usize| node.clamp(1, shape[axis]) - 1;
    let surrounded = |node: [usize; 2]| {
        let nearest = [0, 1].map(|axis| inner(axis, node[axis]));
        let added = [0, 1]
            .iter()
            .any(|&axis| node[axis] == 0 || node[axis] > shape[axis]);
        let v = value(nearest);
        if added { -v.abs() } else { v }
    };
    let mut curves = zero_level_of(shape.map(|n| n + 2), surrounded, |node, axis, [a, b]| {
        let mut point = [0, 1].map(|axis| coordinate(axis, inner(axis, node[axis])));
        let end = coordinate(axis, inner(axis, node[axis] + 1));
        point[axis] += (end - point[axis]) * (a / (a - b));
        point
    });
    curves.retain(|curve| curve.closed && curve.points.len() > 2);
    curves
}

/// Least and largest value.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        (low.min(v), high.max(v))
    })
}
