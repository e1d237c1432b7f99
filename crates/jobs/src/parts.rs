//! The parts of a segmentation, each of which keeps its own volume.

use derive_more::Display;
use surfaces::{Bound, Cells, Filling, Parts};

use crate::faired::{Faired, surface};
use crate::prelude::*;
use crate::presentation::Topology;

/// The surface of the voxels in the folder of a run.
const FILE: &str = "voxels.ply";
/// Parts smaller than balls of this radius, in interface widths, stay as they are where parts keep their volumes: a phase field does not hold them.
const SMALL: f64 = 1.5;
/// The usual radius below which details go, in voxels.
pub const DETAIL: f64 = 1.25;
/// How far vertices usually may be from the surface between the voxels, in voxels.
pub const MAX_DISTANCE: f64 = 0.5;
/// Waves that are longer than some five times so many of these radii are those of the voxels.
const LONG: f64 = 1.25;

/// Voxels as the surface that is between them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Voxels {
    /// The volume of the parts that flow.
    pub volume: f64,
    /// The side of a cube as large as a voxel.
    pub side: f64,
    /// The radius below which details go.
    pub detail: f64,
    /// The displacement, root of the mean square, that ends the flow.
    pub farthest: Option<f64>,
    /// The time that ends the flow.
    #[serde(default)]
    pub time: Option<f64>,
    /// The largest distance of vertices from the surface between the voxels.
    #[serde(default)]
    pub max_distance: Option<f64>,
    /// Whether parts and places keep their volumes.
    pub keeps_volumes: bool,
    /// The parts that do not flow, in ascending order.
    small: Vec<usize>,
    /// The topology of all parts that do not flow.
    of_small: Topology,
    #[serde(skip)]
    surface: Option<Box<ClosedMesh>>,
}

/// A part of a segmentation or a cavity in it, before and after a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartReport {
    /// Its centre of mass before, in the coordinates of the input.
    pub place: [f64; 3],
    /// Its volume before; that of a cavity is negative.
    pub volume_before: f64,
    /// Its volume after, unless it is one with others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_after: Option<f64>,
    /// What became of it.
    pub fate: PartFate,
}

/// What became of a part of a segmentation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Display)]
#[serde(rename_all = "snake_case")]
pub enum PartFate {
    /// It is smooth, and has its volume.
    #[display("smooth")]
    Smoothed,
    /// It is too small for the grid, and is as it was: the surface between its voxels.
    #[display("too small for the grid: as it was between its voxels")]
    TooSmall,
    /// It vanished in the flow, and is back as it was.
    #[display("vanished in the flow: as it was between its voxels")]
    Restored,
    /// It is one with other parts, which have the volume of all together.
    #[display("one with others")]
    Joined,
}

impl PartReport {
    /// Its volume and its place.
    pub fn found_at(&self) -> String {
        let [x, y, z] = self.place.map(pages::five_digits);
        let volume = pages::five_digits(self.volume_before);
        format!("{volume} at {x}, {y}, {z}")
    }

    /// The change of the volume in percent.
    pub fn change_percent(&self) -> Option<f64> {
        Some(100.0 * (self.volume_after? / self.volume_before - 1.0))
    }
}

/// The volume and the centre of every part of a surface.
fn reports(surface: &ClosedMesh, parts: &Parts) -> Vec<PartReport> {
    let volumes = parts.volumes(surface.mesh()).into_iter();
    let pairs = volumes.zip(parts.centroids(surface.mesh()));
    pairs
        .map(|(volume, place)| PartReport {
            place,
            volume_before: volume,
            volume_after: None,
            fate: PartFate::Smoothed,
        })
        .collect()
}

impl Voxels {
    /// Of the surface between voxels with this side.
    pub fn new(surface: ClosedMesh, side: f64) -> Self {
        Self {
            volume: surface.volume(),
            side,
            detail: DETAIL * side,
            surface: Some(Box::new(surface)),
            ..Self::default()
        }
    }

    /// Leaves out of the flow the parts that are too small for an interface width, unless all of them are, and tells which.
    pub fn leave_small_parts(&mut self, eps: f64) -> Vec<PartReport> {
        let ball = 4.0 / 3.0 * std::f64::consts::PI * (SMALL * eps).powi(3);
        let (surface, parts) = (self.surface(), self.surface().parts());
        let mut small = reports(surface, &parts);
        let is_small = |part: &PartReport| part.volume_before.abs() < ball;
        let numbers: Vec<usize> = (0..small.len()).filter(|&k| is_small(&small[k])).collect();
        if numbers.len() == small.len() {
            return Vec::new();
        }
        small.retain(is_small);
        if !small.is_empty() {
            self.small = numbers;
            let flowing = self.flowing();
            let [all, flow] = [self.surface(), &flowing].map(Topology::of);
            self.of_small = Topology {
                components: all.components - flow.components,
                euler_characteristic: (all.euler_characteristic.zip(flow.euler_characteristic))
                    .map(|(all, flow)| all - flow),
            };
            self.volume = flowing.volume();
        }
        small
    }

    /// The surface between the voxels.
    pub fn surface(&self) -> &ClosedMesh {
        (self.surface.as_deref()).expect("the surface of the voxels is loaded with its run")
    }

    /// The parts of this surface that flow.
    pub fn flowing(&self) -> ClosedMesh {
        let surface = self.surface();
        if self.small.is_empty() {
            return surface.clone();
        }
        let flowing = (surface.parts()).only(surface.mesh(), |part| {
            self.small.binary_search(&part).is_err()
        });
        closed(flowing).expect("parts of a closed surface are closed")
    }

    /// The parts of this surface that do not flow, if there are some.
    pub fn resting(&self) -> Option<ClosedMesh> {
        let surface = self.surface();
        let resting = (surface.parts()).only(surface.mesh(), |part| {
            self.small.binary_search(&part).is_ok()
        });
        // Without faces there is none.
        closed(resting)
    }

    /// The file from which a run goes on, with its name.
    pub fn input(&self) -> Result<(String, Vec<u8>)> {
        let bytes = surfaces::encode_with_up(FILE, self.surface().mesh(), UpAxis::Z)?;
        Ok((FILE.to_owned(), bytes))
    }

    /// Takes it from the folder of a run.
    pub fn load_from(&mut self, stored: &StoredRun) -> Result<()> {
        let mesh = surfaces::decode(&stored.read(FILE)?, Path::new(FILE))?;
        self.surface = Some(Box::new(ClosedMesh::new(mesh).map_err(Error::mesh)?.0));
        Ok(())
    }

    /// Parts and holes of the zero level set together with those of the parts that do not flow.
    pub fn with_small_parts(&self, flowing: Topology) -> Topology {
        let small = self.of_small.euler_characteristic.unwrap_or_default();
        Topology {
            components: flowing.components + self.of_small.components,
            euler_characteristic: flowing.euler_characteristic.map(|number| number + small),
        }
    }

    /// The surface of a phase field, whose parts and places have their volumes if they keep them.
    pub fn made(&self, u: &Stored<3>, eps: f64) -> Result<(TriangleMesh, Vec<PartReport>)> {
        if !self.keeps_volumes {
            return Ok((self.clamped(surface(u, eps)?), Vec::new()));
        }
        let made = surfaces::remeshed_surface(u, eps)?;
        match closed(made.clone()) {
            Some(made) => Ok(Matched::new(self, made).finish(self)),
            // One that folds over itself.
            None => Ok((self.clamped(made), Vec::new())),
        }
    }

    /// How far vertices may be from the surface between the voxels, if there is a bound.
    fn bound(&self) -> Option<Bound> {
        let length = self.max_distance?;
        Some(Bound::new(self.surface(), length))
    }

    fn clamped(&self, mesh: TriangleMesh) -> TriangleMesh {
        match self.bound() {
            Some(bound) => bound.clamp(&mesh),
            None => mesh,
        }
    }

    /// What became of the voxels, and how far the surface has gone.
    pub fn faired(&self, u: &Stored<3>, eps: f64, up: UpAxis) -> Result<Faired> {
        let (mesh, parts) = self.made(u, eps)?;
        let mut faired = Faired::anew(self.surface(), mesh, up);
        faired.report.parts = parts;
        if let Some(length) = self.max_distance {
            faired.report.bound(length, &faired.displacement.lengths);
        }
        Ok(faired)
    }
}

fn closed(mesh: TriangleMesh) -> Option<ClosedMesh> {
    ClosedMesh::new(mesh).ok().map(|(closed, _)| closed)
}

/// The parts of a new surface beside the parts that flowed.
struct Matched {
    before: ClosedMesh,
    parts: Parts,
    made: ClosedMesh,
    new: Parts,
    /// The part of which each new part is.
    owner: Vec<usize>,
    /// For each part the first of those with which it is one, itself if it is alone; none if it has vanished.
    group: Vec<Option<usize>>,
}

impl Matched {
    fn new(voxels: &Voxels, made: ClosedMesh) -> Self {
        let before = voxels.flowing();
        let (parts, new) = (before.parts(), made.parts());
        let owner = owners(&before, &parts, &made, &new);
        let group = (0..parts.count()).map(Some).collect();
        let mut matched = Self {
            before,
            parts,
            made,
            new,
            owner,
            group,
        };
        matched.join();
        matched
    }

    /// Finds out with which others the parts without a new part are one: those that are inside of the new surface where they were inside.
    fn join(&mut self) {
        if (0..self.parts.count()).all(|part| self.owner.contains(&part)) {
            return;
        }
        let distance = MeshDistance::new(&self.made);
        let places = self.parts.centroids(self.before.mesh());
        let volumes = self.parts.volumes(self.before.mesh());
        for part in 0..self.parts.count() {
            if self.owner.contains(&part) {
                continue;
            }
            let is_inside = distance.signed_distance(places[part]) < 0.0;
            let nearest = distance.nearest_faces(&[places[part]])[0];
            let new = self.new.of_faces()[nearest] as usize;
            let joins = is_inside == (volumes[part] > 0.0);
            self.group[part] = joins.then(|| self.owner[new]);
        }
    }

    /// The volumes that the new parts should have: those of the parts, shared in proportion if one has become several.
    fn volumes(&self) -> Vec<f64> {
        let now = self.new.volumes(self.made.mesh());
        let before = self.parts.volumes(self.before.mesh());
        let sum = |wanted: &[f64], group: usize, of: &dyn Fn(usize) -> Option<usize>| -> f64 {
            let members = (0..wanted.len()).filter(|&k| of(k) == Some(group));
            members.map(|k| wanted[k]).sum()
        };
        let target = |new: usize| {
            let group = self.owner[new];
            let all = sum(&before, group, &|part| self.group[part]);
            let found = sum(&now, group, &|new| Some(self.owner[new]));
            let share = all / found;
            if share.is_finite() && share > 0.0 {
                share * now[new]
            } else {
                now[new]
            }
        };
        (0..now.len()).map(target).collect()
    }

    /// The new surface with the volumes of the parts and of places, and with the parts that it does not have.
    fn finish(self, voxels: &Voxels) -> (TriangleMesh, Vec<PartReport>) {
        let volumes = self.volumes();
        let rest = (self.parts).only(self.before.mesh(), |part| self.group[part].is_some());
        let side = voxels.side;
        let sides = [[side, 0.0, 0.0], [0.0, side, 0.0], [0.0, 0.0, side]];
        let filling = Filling::of(&rest, Cells::new(rest.vertices[0], sides));
        let made = self.made.mesh();
        let righted = filling.map(|filling| {
            let filled = made.with_filling(&filling, LONG * voxels.detail);
            filled.with_volumes(&self.new, &volumes)
        });
        let righted = righted.filter(|mesh| closed(mesh.clone()).is_some());
        let mut mesh = righted.unwrap_or_else(|| made.with_volumes(&self.new, &volumes));
        if let Some(bound) = voxels.bound() {
            mesh = bound.hold(&mesh, |mesh, free| {
                mesh.with_volumes_by(&self.new, &volumes, |vertex| free[vertex])
            });
        }
        let parts = self.reports(voxels, &mesh);
        let whole = voxels.surface();
        let is_back =
            |part: usize| matches!(parts[part].fate, PartFate::TooSmall | PartFate::Restored);
        append(&mut mesh, whole.parts().only(whole.mesh(), is_back));
        mesh.normals = Some(mesh.vertex_normals());
        (mesh, parts)
    }

    /// What became of all parts, also of those that did not flow.
    fn reports(&self, voxels: &Voxels, mesh: &TriangleMesh) -> Vec<PartReport> {
        let surface = voxels.surface();
        let mut reports = reports(surface, &surface.parts());
        let after = self.new.volumes(mesh);
        let mut flowing = 0..;
        for (number, report) in reports.iter_mut().enumerate() {
            if voxels.small.binary_search(&number).is_ok() {
                report.fate = PartFate::TooSmall;
                report.volume_after = Some(report.volume_before);
                continue;
            }
            let part = flowing.next().expect("there are more numbers");
            let members = self
                .group
                .iter()
                .filter(|group| **group == self.group[part]);
            match self.group[part] {
                None => {
                    report.fate = PartFate::Restored;
                    report.volume_after = Some(report.volume_before);
                }
                Some(_) if members.count() > 1 => report.fate = PartFate::Joined,
                Some(group) => {
                    let own = (0..after.len()).filter(|&new| self.owner[new] == group);
                    report.volume_after = Some(own.map(|new| after[new]).sum());
                }
            }
        }
        reports
    }
}

/// The part before to which most vertices of each new part are nearest.
fn owners(before: &ClosedMesh, parts: &Parts, made: &ClosedMesh, new: &Parts) -> Vec<usize> {
    if parts.count() == 1 {
        return vec![0; new.count()];
    }
    let nearest = MeshDistance::new(before).nearest_faces(&made.mesh().vertices);
    let mut votes = vec![vec![0; parts.count()]; new.count()];
    for (face, part) in nearest.into_iter().zip(new.of_vertices()) {
        votes[*part as usize][parts.of_faces()[face] as usize] += 1;
    }
    let most = |votes: Vec<usize>| (0..votes.len()).rev().max_by_key(|&part| votes[part]);
    (votes.into_iter().map(most))
        .map(Option::unwrap_or_default)
        .collect()
}

/// Adds another surface.
fn append(mesh: &mut TriangleMesh, other: TriangleMesh) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(other.vertices);
    let faces = other.faces.into_iter();
    mesh.faces.extend(faces.map(|face| face.map(|v| v + first)));
}

#[cfg(test)]
mod tests {
    use geometry::SignedDistanceExt;
    use geometry::shapes::{Ball, Capsule};
    use surfaces::isosurface;

    use super::*;

    const LEFT: [f64; 3] = [-0.2, 0.01, 0.0];
    const RIGHT: [f64; 3] = [0.2, 0.0, 0.01];

    /// What is made of two balls and a small one by a flow that ends with this shape.
    fn made(end: &impl SignedDistance<3>) -> (Vec<PartFate>, Vec<f64>, Voxels) {
        let grid = Grid::<3>::centred(64, 1.0).unwrap();
        let eps = 2.0 * grid.spacing();
        let [left, right] = [LEFT, RIGHT].map(|centre| Ball::new(centre, 0.12).unwrap());
        let small = Ball::new([0.0, 0.3, 0.0], 0.03).unwrap();
        let all = left.union(right).union(small);
        let distance = Field::from_fn(grid, |x| all.signed_distance(x));
        let surface = closed(isosurface(&distance).unwrap()).unwrap();
        let mut voxels = Voxels::new(surface, grid.spacing());
        voxels.keeps_volumes = true;
        assert_eq!(voxels.leave_small_parts(eps).len(), 1);
        let field = stored_phase_field(grid, end, eps).unwrap();
        let (mesh, parts) = voxels.made(&field, eps).unwrap();
        let mesh = closed(mesh).unwrap();
        let volumes = mesh.parts().volumes(mesh.mesh());
        (
            parts.iter().map(|part| part.fate).collect(),
            volumes,
            voxels,
        )
    }

    /// Whether the volumes are those, in any order.
    fn assert_volumes(mut found: Vec<f64>, mut expected: Vec<f64>) {
        found.sort_by(f64::total_cmp);
        expected.sort_by(f64::total_cmp);
        assert_eq!(found.len(), expected.len());
        for (a, b) in found.iter().zip(&expected) {
            assert!((a / b - 1.0).abs() < 1e-6, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn what_vanishes_is_back_and_what_is_one_has_the_volume_of_all() {
        use PartFate::{Joined, Restored, Smoothed, TooSmall};
        let (mut fates, volumes, voxels) = made(&Ball::new(LEFT, 0.11).unwrap());
        fates.sort_by_key(ToString::to_string);
        assert_eq!(fates, [Smoothed, TooSmall, Restored]);
        let surface = voxels.surface();
        let before = surface.parts().volumes(surface.mesh());
        assert_volumes(volumes, before.clone());

        let (mut fates, volumes, _) = made(&Capsule::new(LEFT, RIGHT, 0.1).unwrap());
        fates.sort_by_key(ToString::to_string);
        assert_eq!(fates, [Joined, Joined, TooSmall]);
        let small = before.iter().copied().fold(f64::INFINITY, f64::min);
        assert_volumes(volumes, vec![small, surface.volume() - small]);
    }
}
