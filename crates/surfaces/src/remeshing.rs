//! Zero level sets as meshes of well-shaped triangles.

use geometry::{PhaseField, Stored, distances_from_phase_field};

use crate::half_edges::{HalfEdges, next, previous};
use crate::level_set::project;
use crate::vector::{Vector, scaled_normal};
use crate::{ClosedMesh, Error, TriangleMesh, isosurface};

/// Length of edges that is aimed at, in cells: areas and volumes are as accurate as those of marching tetrahedra,
const LENGTH: f64 = 2.0 / 3.0;
/// and the lengths at which edges are split and collapsed, in parts of it: either brings the edges closer to it.
const LONG: f64 = 4.0 / 3.0;
const SHORT: f64 = 4.0 / 5.0;
/// Rounds of the remeshing,
const ROUNDS: usize = 3;
/// and at most so many that mend the triangles that are still bad,
const MENDING: usize = 8;
/// and the part of all triangles that they look at, at most: where most are bad, there is no smooth surface, and no end.
const MENDED: f64 = 0.25;
/// Degrees from which on an angle is good.
const GOOD: f64 = 30.0;
/// Angles of fewer degrees may only become larger.
const FAIR: f64 = 20.0;
/// The same for cosines of the angles between a face and the normals of the level set at its corners,
const AGREEING: f64 = 0.5;
/// and in creases, where normals turn within a triangle and only slivers agree with all of them, for angles that are not fair.
const IN_CREASES: f64 = 0.0;
/// How far points are projected, in cells,
const REACH: f64 = 0.5;
/// Rounds in which faces that cross others are drawn apart.
const UNTANGLING: usize = 8;
/// and how close to the level set they are then.
const ON: f64 = 1e-4;

/// The surface `{u = 0}` of a phase field, around `{u > 0}`, as well-shaped triangles, with edges of about two thirds of a cell: for
/// other programs, which refuse or misuse slivers. Of the triangles of [`phase_field_surface`](crate::phase_field_surface) one in five
/// has an angle below 15 degrees; but it comes ten times as fast and has the symmetries of the field, which this one has not.
///
/// **Method.** Isotropic remeshing of the surface by marching tetrahedra: edges that are too long are split, those that are too short
/// collapse, diagonals are flipped where that makes the smallest angle larger, and vertices move to the centres of the triangles around
/// them (M. Botsch, L. Kobbelt: A remeshing approach to multiresolution modeling. SGP 2004). Every new place of a vertex is projected
/// on the level set of the distances `-(4 eps/3) atanh u`, interpolated by Catmull-Rom splines; the normals are its gradients. In the
/// end, triangles that are still bad get the best of all flips, collapses and small moves nearby. Faces that cross others, as where a gap is narrower than an
/// edge, are drawn apart by moves to the middle of the vertices around.
///
/// **Guarantees.** The surface is closed and oriented, and has the components and the Euler characteristic of
/// [`phase_field_surface`](crate::phase_field_surface): every operation keeps them. If the result is no [`ClosedMesh`] all the same,
/// or faces that cross others cannot be drawn apart, it is the surface by marching tetrahedra, of which none do. No operation but that turns
/// a face against the gradients at its corners, or makes an angle that is bad worse. Same input, same bytes: the operations run one
/// after the other.
///
/// **Quality**, where the shape is smooth at the scale of cells, measured and not proved: angles of 30 degrees and more, areas and
/// volumes as accurate as those of marching tetrahedra, vertices on the level set to `1e-4` of a cell. Caps, where the inside reaches
/// the first or last nodes, keep the triangles that they have.
///
/// # Errors
/// As [`phase_field_surface`](crate::phase_field_surface).
pub fn remeshed_surface(u: &impl PhaseField<3>, eps: f64) -> Result<TriangleMesh, Error> {
    let distance = distances_from_phase_field(u, eps)?;
    let marched = isosurface(&distance)?;
    let Some(mut remeshing) = Remeshing::new(&distance, &marched) else {
        return Ok(marched);
    };
    for _ in 0..ROUNDS {
        remeshing.split_long_edges();
        remeshing.collapse_short_edges();
        remeshing.flip_edges();
        remeshing.relax();
    }
    remeshing.mend(GOOD, AGREEING);
    remeshing.mend(FAIR, IN_CREASES);
    let remeshed = apart(remeshing.finish()).map(ClosedMesh::new);
    Ok(match remeshed {
        Some(Ok((closed, warnings))) if warnings.is_empty() => closed.into_mesh(),
        _ => marched,
    })
}

/// The mesh without crossings of its faces: the vertices of those that cross others, and more and more of their neighbours, go to the middle of those around
/// them. None if that does not help.
fn apart(mut mesh: TriangleMesh) -> Option<TriangleMesh> {
    for round in 0..=UNTANGLING {
        let crosses = mesh.crossing_faces();
        if !crosses.contains(&true) {
            return Some(mesh);
        }
        let mut moves = vec![false; mesh.vertices.len()];
        let mut near = crosses;
        for _ in 0..=round / 2 {
            for (face, _) in mesh.faces.iter().zip(&near).filter(|(_, near)| **near) {
                for &vertex in face {
                    moves[vertex as usize] = true;
                }
            }
            let is_near = |face: &[u32; 3]| face.iter().any(|&v| moves[v as usize]);
            near = mesh.faces.iter().map(is_near).collect();
        }
        let mut middles = vec![(Vector::ZERO, 0.0); mesh.vertices.len()];
        for face in &mesh.faces {
            for i in 0..3 {
                let next = mesh.vertices[face[(i + 1) % 3] as usize];
                let middle = &mut middles[face[i] as usize];
                *middle = (middle.0 + Vector::from_array(next), middle.1 + 1.0);
            }
        }
        for (vertex, (sum, count)) in middles.into_iter().enumerate() {
            if moves[vertex] {
                mesh.vertices[vertex] = (sum / count).to_array();
            }
        }
    }
    None
}

/// A vertex.
#[derive(Clone, Copy)]
struct Point {
    x: Vector,
    /// The unit gradient of the level set.
    normal: Vector,
}

type Corners = [Point; 3];

/// How good triangles are: the worst of them counts.
#[derive(Clone, Copy)]
struct Verdict {
    /// The smallest cosine between the normals of a face and of its corners.
    agreement: f64,
    /// The smallest angle, in degrees.
    angle: f64,
}

impl Verdict {
    fn on(triangles: impl IntoIterator<Item = Corners>) -> Self {
        let mut verdict = Self {
            agreement: 1.0,
            angle: 60.0,
        };
        for triangle in triangles {
            let normal = scaled_normal(triangle.map(|p| p.x)).normalize_or_zero();
            for corner in triangle {
                verdict.agreement = verdict.agreement.min(normal.dot(corner.normal));
            }
            verdict.angle = verdict.angle.min(smallest_angle(triangle));
        }
        verdict
    }

    /// Whether it is as good as it has to be, or no worse than before.
    fn is_acceptable_after(self, before: Self) -> bool {
        self.agreement >= before.agreement.min(AGREEING) && self.angle >= before.angle.min(FAIR)
    }

    fn is_better_than(self, before: Self, agreeing: f64) -> bool {
        self.agreement >= before.agreement.min(agreeing) && self.angle > before.angle + 1e-3
    }
}

/// The smallest angle of a triangle, which is opposite the shortest side, in degrees.
fn smallest_angle(triangle: Corners) -> f64 {
    let [a, b, c] = triangle.map(|p| p.x);
    let sides = [b - a, c - b, a - c];
    let [u, v, w] = sides.map(Vector::length_squared);
    let sum = u + v + w;
    // Twice the product of the lengths of the other two and the cosine.
    let cosine = sum - 2.0 * u.min(v).min(w);
    (2.0 * sides[0].cross(sides[1]).length())
        .atan2(cosine)
        .to_degrees()
}

/// A change of the mesh that can be judged before it is made.
#[derive(Clone, Copy)]
enum Change {
    /// Of an edge.
    Flip(u32),
    /// Of an edge, to a point.
    Collapse(u32, Point),
    /// Of a vertex, to a point.
    Move(u32, Point),
}

/// The mesh on its way.
struct Remeshing<'a> {
    distance: &'a Stored<3>,
    spacing: f64,
    surface: HalfEdges,
    points: Vec<Point>,
}

impl<'a> Remeshing<'a> {
    fn new(distance: &'a Stored<3>, mesh: &TriangleMesh) -> Option<Self> {
        let normals = mesh.normals.as_ref()?.iter();
        let points = mesh.points().into_iter().zip(normals);
        let points = points.map(|(x, &normal)| Point {
            x,
            normal: normal.into(),
        });
        Some(Self {
            distance,
            spacing: distance.grid().spacing(),
            surface: HalfEdges::new(mesh).ok()?,
            points: points.collect(),
        })
    }

    fn point(&self, v: u32) -> Point {
        self.points[v as usize]
    }

    fn corners(&self, h: u32) -> Corners {
        [h, next(h), previous(h)].map(|h| self.point(self.surface.from(h)))
    }

    fn length(&self, h: u32) -> f64 {
        let [from, to] = [self.surface.from(h), self.surface.to(h)];
        self.point(from).x.distance(self.point(to).x)
    }

    /// Whether a place is between the nodes: what lies further out is a cap, which stays as it is.
    fn is_free(&self, x: Vector) -> bool {
        let grid = self.distance.grid();
        let between = |axis: usize| {
            let place = (x[axis] - grid.origin()[axis]) / self.spacing;
            (0.0..=grid.cells() as f64 - 1.0).contains(&place)
        };
        (0..3).all(between)
    }

    fn has_free_ends(&self, h: u32) -> bool {
        let ends = [self.surface.from(h), self.surface.to(h)];
        ends.into_iter().all(|v| self.is_free(self.point(v).x))
    }

    /// The point of the level set next to a place; `None` where there is none close by.
    fn on_level_set(&self, x: Vector) -> Option<Point> {
        let reach = REACH * self.spacing;
        let x = Vector::from_array(project(self.distance, x.to_array(), 0.0, reach));
        let (value, gradient) = self.distance.spline(x.to_array());
        let gradient = Vector::from_array(gradient);
        let normal = gradient.try_normalize()?;
        let on = value.abs() <= ON * self.spacing * gradient.length() && self.is_free(x);
        on.then_some(Point { x, normal })
    }

    fn middle(&self, h: u32) -> Option<Point> {
        let [from, to] = [self.surface.from(h), self.surface.to(h)];
        self.on_level_set(self.point(from).x.midpoint(self.point(to).x))
    }

    /// How good the triangles are that a change replaces, and those in their place; `None` if the topology or a cap forbids it.
    fn verdicts(&self, change: Change) -> Option<[Verdict; 2]> {
        let surface = &self.surface;
        let moved = |h: u32, point: Point| {
            let [_, b, c] = self.corners(h);
            [point, b, c]
        };
        match change {
            Change::Flip(h) => {
                if !self.has_free_ends(h) || !surface.can_flip(h) {
                    return None;
                }
                let ([a, b, c], [_, _, d]) = (self.corners(h), self.corners(surface.twin(h)));
                let before = Verdict::on([[a, b, c], [b, a, d]]);
                Some([before, Verdict::on([[d, c, a], [c, d, b]])])
            }
            Change::Move(v, point) => {
                if !self.is_free(self.point(v).x) {
                    return None;
                }
                let before = Verdict::on(surface.around(v).map(|h| self.corners(h)));
                let after = Verdict::on(surface.around(v).map(|h| moved(h, point)));
                Some([before, after])
            }
            Change::Collapse(h, point) => {
                if !self.has_free_ends(h) || !surface.can_collapse(h) {
                    return None;
                }
                let (from, to) = (surface.from(h), surface.to(h));
                let around = || surface.around(from).chain(surface.around(to));
                let stays = |&g: &u32| {
                    let rest = [surface.to(g), surface.opposite(g)];
                    !rest.contains(&from) && !rest.contains(&to)
                };
                let before = Verdict::on(around().map(|g| self.corners(g)));
                let after = Verdict::on(around().filter(stays).map(|g| moved(g, point)));
                Some([before, after])
            }
        }
    }

    fn make(&mut self, change: Change) {
        match change {
            Change::Flip(h) => self.surface.flip(h),
            Change::Move(v, point) => self.points[v as usize] = point,
            Change::Collapse(h, point) => {
                let v = self.surface.from(h);
                self.surface.collapse(h);
                self.points[v as usize] = point;
            }
        }
    }

    /// Whether a change may be made.
    fn is_acceptable(&self, change: Change) -> bool {
        let verdicts = self.verdicts(change);
        verdicts.is_some_and(|[before, after]| after.is_acceptable_after(before))
    }

    fn split_long_edges(&mut self) {
        for h in 0..self.surface.len() {
            if self.surface.leads(h)
                && self.has_free_ends(h)
                && self.length(h) > LONG * LENGTH * self.spacing
                && let Some(point) = self.middle(h)
            {
                let (here, there) = (self.corners(h), self.corners(self.surface.twin(h)));
                let halves = [here, there].map(|[a, b, c]| [[a, point, c], [point, b, c]]);
                let after = Verdict::on(halves.into_iter().flatten());
                if after.is_acceptable_after(Verdict::on([here, there])) {
                    self.surface.split(h);
                    self.points.push(point);
                }
            }
        }
    }

    /// Whether all edges stay short, or hardly become longer, if an edge collapses to a point.
    fn stay_short(&self, h: u32, point: Point) -> bool {
        let ends = [self.surface.from(h), self.surface.to(h)];
        let mut around = ends.iter().flat_map(|&v| self.surface.around(v));
        around.all(|g| {
            let x = self.point(self.surface.to(g)).x;
            let longest = (LONG * LENGTH * self.spacing).max(1.1 * self.length(g));
            x.distance(point.x) <= longest
        })
    }

    /// The ways in which an edge may collapse: to its middle or to one of its ends.
    fn collapses(&self, h: u32) -> impl Iterator<Item = Change> {
        let ends = [self.surface.from(h), self.surface.to(h)].map(|v| self.point(v));
        let places = self.middle(h).into_iter().chain(ends);
        let places = places.filter(move |&place| self.stay_short(h, place));
        places.map(move |place| Change::Collapse(h, place))
    }

    fn collapse_short_edges(&mut self) {
        for h in 0..self.surface.len() {
            if self.surface.leads(h) && self.length(h) < SHORT * LENGTH * self.spacing {
                let mut changes = self.collapses(h);
                if let Some(change) = changes.find(|&change| self.is_acceptable(change)) {
                    drop(changes);
                    self.make(change);
                }
            }
        }
    }

    /// Whether one of the angles opposite an edge is obtuse; in the plane, no other edge can be flipped with profit.
    fn faces_obtuse_angle(&self, h: u32) -> bool {
        [h, self.surface.twin(h)].into_iter().any(|h| {
            let [a, b, c] = self.corners(h).map(|p| p.x);
            (a - c).dot(b - c) < 0.0
        })
    }

    fn flip_edges(&mut self) {
        for h in 0..self.surface.len() {
            if self.surface.leads(h)
                && self.faces_obtuse_angle(h)
                && let Some([before, after]) = self.verdicts(Change::Flip(h))
                && after.is_better_than(before, AGREEING)
            {
                self.make(Change::Flip(h));
            }
        }
    }

    /// Moves every vertex to the centre of the triangles around it, along the surface, or at least to the level set.
    fn relax(&mut self) {
        for v in self.surface.vertices().collect::<Vec<_>>() {
            let places = [self.centre(v), self.point(v).x].into_iter();
            let mut changes = places.filter_map(|x| Some(Change::Move(v, self.on_level_set(x)?)));
            if let Some(change) = changes.find(|&change| self.is_acceptable(change)) {
                self.make(change);
            }
        }
    }

    /// The mean of the triangles around a vertex, in its tangent plane.
    fn centre(&self, v: u32) -> Vector {
        let Point { x, normal } = self.point(v);
        let (mut sum, mut area) = (Vector::ZERO, 0.0);
        for h in self.surface.around(v) {
            let corners = self.corners(h).map(|p| p.x);
            let weight = scaled_normal(corners).length();
            sum += weight / 3.0 * corners.into_iter().sum::<Vector>();
            area += weight;
        }
        let step = if area > 0.0 {
            sum / area - x
        } else {
            Vector::ZERO
        };
        x + step.reject_from_normalized(normal)
    }

    /// Makes the best of all changes at every triangle that is still bad, until none is better than what is there.
    fn mend(&mut self, good: f64, agreeing: f64) {
        let mut left = (MENDED * f64::from(self.surface.len() / 3)) as usize;
        for _ in 0..MENDING {
            let mut mended = false;
            for h in (0..self.surface.len()).step_by(3) {
                let bad = self.surface.exists(h) && smallest_angle(self.corners(h)) < good;
                if bad && self.has_free_ends(h) && left > 0 {
                    left -= 1;
                    mended |= self.mend_triangle(h, agreeing);
                }
            }
            if !mended {
                break;
            }
        }
    }

    fn mend_triangle(&mut self, h: u32, agreeing: f64) -> bool {
        let mut best: Option<(f64, Change)> = None;
        for change in self.changes(h) {
            if let Some([before, after]) = self.verdicts(change)
                && after.is_better_than(before, agreeing)
                && best.is_none_or(|(angle, _)| after.angle > angle)
            {
                best = Some((after.angle, change));
            }
        }
        if let Some((_, change)) = best {
            self.make(change);
        }
        best.is_some()
    }

    /// What may be done about a triangle.
    fn changes(&self, h: u32) -> Vec<Change> {
        let mut changes = Vec::new();
        for side in [h, next(h), previous(h)] {
            changes.push(Change::Flip(side));
            changes.extend(self.collapses(side));
            let v = self.surface.from(side);
            let moved = self.steps(v).filter_map(|x| self.on_level_set(x));
            changes.extend(moved.map(|point| Change::Move(v, point)));
        }
        changes
    }

    /// Places around a vertex in its tangent plane.
    fn steps(&self, v: u32) -> impl Iterator<Item = Vector> {
        let Point { x, normal } = self.point(v);
        let (a, b) = normal.any_orthonormal_pair();
        let steps = [0.2, 0.1, 0.05].map(|part| part * LENGTH * self.spacing);
        let directions = [a, b, -a, -b, a + b, a - b, b - a, -a - b];
        let around = steps
            .into_iter()
            .flat_map(move |step| directions.map(|direction| x + step * direction));
        around.chain([self.centre(v)])
    }

    fn finish(self) -> TriangleMesh {
        let mesh = TriangleMesh {
            vertices: self.points.iter().map(|p| p.x.to_array()).collect(),
            faces: self.surface.faces().collect(),
            normals: Some(self.points.iter().map(|p| p.normal.to_array()).collect()),
        };
        let kept: Vec<usize> = self.surface.vertices().map(|v| v as usize).collect();
        mesh.keeping(&kept)
    }
}
