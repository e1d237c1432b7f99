//! The mesh that a person gave: its vertices follow the flow.

use std::collections::{HashMap, HashSet};
use std::sync::OnceLock;

use engine::DISPLACEMENT;
use surfaces::{
    Bound, Covered, Edges, FairedMesh, Followed, KeptEdges, Mended, NoiseEstimate, PlaceHasher,
};

use crate::faired::{Displacement, Faired, MeshReport, surface};
use crate::keep;
use crate::made::{MeshFile, Surface};
use crate::paths::extension;
use crate::prelude::*;
use crate::presentation::Known;

/// The name of the copy of the input, without its extension.
pub const INPUT: &str = "input";
/// Rings of vertices beside a boundary that go on smoothly from it.
const RINGS: usize = 4;
/// Of a mesh with thin parts at least this part of the vertices moves.
const FEWEST_MOVING: f64 = 0.1;
/// A volume that is off by more than this, in percent, is told.
const MISSED: f64 = 0.1;

/// A mesh of which everything but the positions of its vertices stays: see [`Fairing`].
#[derive(Default, Serialize, Deserialize)]
pub struct OwnMesh {
    /// The file in the folder of the run, a copy of the input.
    file: String,
    /// Standard deviation of the noise, in the units of the mesh.
    noise: f64,
    /// What stays where it is, in the coordinates of the mesh.
    keep: Option<String>,
    /// Whether it keeps its volume, also where vertices simply follow.
    #[serde(default)]
    pub keeps_volume: bool,
    /// Whether its volume goes to a target, as that of the zero set does.
    #[serde(default)]
    pub drives_volume: bool,
    /// The largest distance of vertices from the mesh as it was given.
    #[serde(default)]
    pub max_distance: Option<f64>,
    /// Whether sharp edges stay.
    #[serde(default)]
    edges: Edges,
    /// The width of parts and gaps at whose faces vertices stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    thin_below: Option<f64>,
    /// Whether the zero level set takes its place in the end.
    #[serde(default)]
    pub is_new: bool,
    #[serde(skip)]
    loaded: Option<Box<Loaded>>,
}

struct Loaded {
    bytes: Vec<u8>,
    mesh: TriangleMesh,
    /// Where the mended mesh has its vertices.
    places: Vec<[f64; 3]>,
    /// What is the surface and what are its lids, if it is open.
    open: Option<OpenSurface>,
    /// The file of the mask, if that is a mesh.
    mask: Option<Vec<u8>>,
    /// The distance of what stays.
    keep: Option<Box<dyn SignedDistance<3>>>,
    /// What was found where the noise was not given.
    estimate: Option<NoiseEstimate>,
    fairing: Fairing,
    /// The vertices in the box, once the start of the flow is known.
    followed: OnceLock<Followed>,
}

/// A surface with a boundary, which stays.
struct OpenSurface {
    /// How many vertices are its own,
    vertices: usize,
    /// and how many faces.
    faces: usize,
    /// The places of the vertices at its boundary.
    rim: HashSet<[u64; 3]>,
    /// Those of them from where it does not go on smoothly.
    creases: HashSet<[u64; 3]>,
    /// The places of those where it is not known what is inside.
    unsure: HashSet<[u64; 3]>,
    /// Whether there are such places at all.
    is_unsure: bool,
    /// Parts that have no lids, and stay as they are.
    left: TriangleMesh,
}

impl OpenSurface {
    fn of(covered: &Covered) -> Self {
        Self {
            vertices: covered.vertices,
            faces: covered.faces,
            rim: covered.rim.iter().map(|x| key(*x)).collect(),
            creases: covered.creases.iter().map(|x| key(*x)).collect(),
            unsure: covered.unsure.iter().map(|x| key(*x)).collect(),
            is_unsure: covered.is_unsure,
            left: covered.left.clone(),
        }
    }

    /// Whether each vertex is within so many edges of the boundary, but not at it and not at a lid.
    fn rings(&self, mesh: &TriangleMesh, count: usize) -> Vec<bool> {
        let mut near: Vec<bool> = (mesh.vertices.iter().enumerate())
            .map(|(vertex, x)| vertex < self.vertices && self.rim.contains(&key(*x)))
            .collect();
        let rim = near.clone();
        for _ in 0..count {
            let before = near.clone();
            for face in &mesh.faces[..self.faces] {
                if face.iter().any(|&v| before[v as usize]) {
                    for &vertex in face {
                        near[vertex as usize] = true;
                    }
                }
            }
        }
        near.iter()
            .zip(rim)
            .map(|(near, rim)| *near && !rim)
            .collect()
    }

    /// Whether a vertex stays.
    fn stays(&self, x: [f64; 3]) -> bool {
        let place = key(x);
        self.rim.contains(&place) || self.unsure.contains(&place)
    }

    /// Whether each vertex is at a crease.
    fn creases(&self, mesh: &TriangleMesh) -> Vec<bool> {
        let places = mesh.vertices.iter();
        places.map(|x| self.creases.contains(&key(*x))).collect()
    }

    /// As [`TriangleMesh::untangled`], together with the parts that stay.
    fn untangled(&self, moved: &TriangleMesh, before: &TriangleMesh) -> TriangleMesh {
        let [vertices, faces] = [moved.vertices.len(), moved.faces.len()];
        let [moved, before] = [moved, before].map(|mesh| mesh.beside(&self.left));
        let mut all = moved.untangled(&before);
        all.vertices.truncate(vertices);
        all.faces.truncate(faces);
        all
    }

    /// The noise of the surface without its lids. Creases at its boundary are none.
    fn noise(&self, mesh: &TriangleMesh) -> NoiseEstimate {
        if self.creases.is_empty() {
            return mesh.noise_of_first(self.vertices);
        }
        self.without_lids(mesh).noise()
    }

    /// The surface alone.
    fn without_lids(&self, mesh: &TriangleMesh) -> TriangleMesh {
        TriangleMesh {
            vertices: mesh.vertices[..self.vertices].to_vec(),
            faces: mesh.faces[..self.faces].to_vec(),
            normals: None,
        }
    }
}

impl OwnMesh {
    /// Takes a mesh, and what noise is to be taken off, estimated unless it is given; without any vertices simply follow.
    pub fn new(
        path: &Path,
        bytes: Vec<u8>,
        noise: Option<f64>,
        keep: Option<String>,
        is_new: bool,
    ) -> Result<(Self, Vec<surfaces::Warning>)> {
        let mut own = Self {
            is_new,
            file: format!("{INPUT}.{}", extension(path)),
            noise: noise.unwrap_or(f64::NAN),
            keep,
            ..Self::default()
        };
        let mask = own.mask().map(|(path, _)| files::read(path)).transpose()?;
        let warnings = own.load(bytes, path, mask)?;
        Ok((own, warnings))
    }

    /// Takes the copy in the folder of a run.
    pub fn load_from(&mut self, stored: &StoredRun) -> Result<()> {
        let mask = self.mask().map(|(_, copy)| stored.read(&copy));
        let mask = mask.transpose()?;
        let bytes = stored.read(&self.file)?;
        self.load(bytes, &stored.path().join(&self.file), mask)?;
        Ok(())
    }

    /// The path of the mask, if that is a mesh, and the name of its copy.
    fn mask(&self) -> Option<(PathBuf, String)> {
        let path = keep::mask(self.keep.as_deref()?)?;
        let copy = format!("keep.{}", extension(&path));
        Some((path, copy))
    }

    /// Takes the bytes of a file; noise that is not a number is estimated.
    fn load(
        &mut self,
        bytes: Vec<u8>,
        path: &Path,
        mask: Option<Vec<u8>>,
    ) -> Result<Vec<surfaces::Warning>> {
        let mesh = surfaces::decode(&bytes, path)?;
        let (mended, open) = self.closed(&mesh)?;
        let Mended {
            mesh: closed,
            changes,
            places,
        } = mended;
        let find = || match &open {
            None => closed.mesh().noise(),
            Some(open) => open.noise(closed.mesh()),
        };
        let estimate = self.noise.is_nan().then(find);
        if let Some(estimate) = estimate {
            self.noise = estimate.deviation;
        }
        let keep = self.keep.as_deref();
        let keep = keep.map(|text| keep::parse(text, mask.as_deref(), &mesh, &bytes, &self.file));
        let keep = keep.transpose()?;
        let chosen = |x| matches!(&keep, Some(keep) if keep.signed_distance(x) <= 0.0);
        let stays = |x| chosen(x) || open.as_ref().is_some_and(|open| open.stays(x));
        let lids = open
            .as_ref()
            .map_or(0, |open| closed.mesh().vertices.len() - open.vertices);
        let mut fairing =
            Fairing::with_lids(closed, self.noise, stays, lids).with_edges(self.edges);
        if let Some(estimate) = estimate {
            fairing = fairing.with_found_noise(estimate.deviation);
        }
        // Where it is not known what the surface bounds, vertices may follow another one than theirs.
        let is_unsure = open.as_ref().is_some_and(|open| open.is_unsure);
        fairing.is_cautious = self.noise > 0.0 && (is_unsure || self.thin_below.is_some());
        if let Some(width) = self.thin_below {
            let thin = fairing.thin(width);
            fairing = fairing.keeping(&thin);
        }
        let kept = fairing.kept.iter().filter(|&&kept| kept).count();
        if kept == fairing.kept.len() {
            return Err(match (&keep, &open) {
                (None, Some(_)) => Refusal::NothingInside.into(),
                _ => Refusal::KeepsAll.into(),
            });
        }
        if keep.is_some() && !mesh.vertices.iter().any(|x| chosen(*x)) {
            let bounds = fairing.rough.bounding_box();
            return Err(Refusal::KeepsNothing {
                lower: bounds.lower,
                upper: bounds.upper,
            }
            .into());
        }
        self.loaded = Some(Box::new(Loaded {
            bytes,
            mesh,
            places,
            open,
            mask,
            keep,
            estimate,
            fairing,
            followed: OnceLock::new(),
        }));
        Ok(changes)
    }

    /// Lets the vertices stay at faces where the body or the gap before it is thinner than this width, unless next to none would be left to move;
    /// returns whether they do.
    pub fn keep_thin(&mut self, width: f64) -> bool {
        let fairing = self.fairing();
        let thin = fairing.thin(width);
        if !self.moves_enough(&thin) {
            return false;
        }
        let mut kept = fairing.clone().keeping(&thin);
        kept.is_cautious = self.noise > 0.0;
        if let Some(loaded) = &mut self.loaded {
            loaded.fairing = kept;
            loaded.followed = OnceLock::new();
        }
        self.thin_below = Some(width);
        true
    }

    /// Gives the rings beside a boundary back what the flow has made of them where bending them takes some of their vertices farther than noise explains.
    fn unbend_far(&self, moved: &mut TriangleMesh, faired: &[[f64; 3]], rings: &[bool]) {
        let most = Fairing::EXPLAINED * self.noise;
        let mut goes_back: Vec<bool> = (0..rings.len())
            .map(|v| rings[v] && distance(moved.vertices[v], faired[v]) > most)
            .collect();
        loop {
            let before = goes_back.iter().filter(|back| **back).count();
            for face in &moved.faces {
                if face.iter().any(|&v| goes_back[v as usize]) {
                    for &v in face {
                        goes_back[v as usize] |= rings[v as usize];
                    }
                }
            }
            if goes_back.iter().filter(|back| **back).count() == before {
                break;
            }
        }
        for (vertex, _) in goes_back.iter().enumerate().filter(|(_, back)| **back) {
            moved.vertices[vertex] = faired[vertex];
        }
    }

    /// Whether enough vertices of the surface move if these stay, too.
    pub fn moves_enough(&self, without: &[bool]) -> bool {
        let fairing = self.fairing();
        let surface = fairing.kept.len() - fairing.lids;
        let moves = |v: &usize| !fairing.kept[*v] && !without[*v];
        let moving = (0..surface).filter(moves).count();
        moving as f64 >= FEWEST_MOVING * surface as f64
    }

    /// How many vertices of the surface stay.
    pub fn kept(&self) -> usize {
        let fairing = self.fairing();
        let surface = fairing.kept.len() - fairing.lids;
        fairing.kept[..surface].iter().filter(|kept| **kept).count()
    }

    /// Says whether sharp edges stay.
    pub fn set_edges(&mut self, edges: Edges) {
        self.edges = edges;
        if let Some(loaded) = &mut self.loaded {
            loaded.fairing.edges = edges;
        }
    }

    /// A closed mesh of one that may be open, if its vertices follow the flow.
    fn closed(&self, mesh: &TriangleMesh) -> Result<(Mended, Option<OpenSurface>)> {
        use surfaces::Error::{MixedOrientation, Nesting, NoArea, NonManifold, Open, Overlap};
        let error = match ClosedMesh::mended(mesh.clone()) {
            Ok(mended) => match mended.mesh.overlap().filter(|_| !self.is_new) {
                None => return Ok((mended, None)),
                Some(overlap) => Overlap(overlap),
            },
            Err(error) => error,
        };
        let may_have_lids = matches!(
            error,
            Open { .. }
                | NonManifold { .. }
                | MixedOrientation { .. }
                | NoArea { .. }
                | Nesting { .. }
                | Overlap(_)
        );
        if self.is_new || !may_have_lids {
            return Err(Error::own_mesh(error));
        }
        match ClosedMesh::covered(mesh.clone()) {
            Ok(covered) => {
                let open = OpenSurface::of(&covered);
                Ok((covered.mended, Some(open)))
            }
            // What is wrong with the mesh itself says more, unless that are its holes.
            Err(lids) if matches!(error, Open { .. }) => Err(Error::own_mesh(lids)),
            Err(_) => Err(Error::own_mesh(error)),
        }
    }

    fn loaded(&self) -> &Loaded {
        (self.loaded.as_deref()).expect("a mesh is loaded with its run")
    }

    /// The copies of the input and of the mask for the folder of a run, with their names.
    pub fn inputs(&self) -> Vec<(String, Vec<u8>)> {
        let Loaded { bytes, mask, .. } = self.loaded();
        let mut inputs = vec![(self.file.clone(), bytes.clone())];
        inputs.extend(self.mask().map(|(_, copy)| copy).zip(mask.clone()));
        inputs
    }

    /// The extension of the file.
    pub fn extension(&self) -> &str {
        self.file.rsplit('.').next().unwrap_or_default()
    }

    /// Refuses a file whose vertices cannot be moved, by a rewrite that moves none, unless a new mesh takes their place; `path` is where it was.
    pub fn check_movable(&self, path: &Path) -> Result<()> {
        let Loaded { bytes, mesh, .. } = self.loaded();
        if self.is_new {
            return Ok(());
        }
        match surfaces::rewrite(bytes, path, mesh) {
            Err(surfaces::Error::Format { problem, .. }) => Err(Refusal::NotMovable {
                path: path.to_owned(),
                problem,
            }
            .into()),
            Err(other) => Err(Error::own_mesh(other)),
            Ok(_) => Ok(()),
        }
    }

    /// The part of the vertices at what the grid of the start does not hold.
    pub fn unresolved_part(&self, start: &Stored<3>, eps: f64) -> Result<f64> {
        let in_place = Placement::about([0.0; 3], 1.0)?;
        let followed = self.fairing().follow(in_place, start, eps)?;
        let lost = self.fairing().unresolved(&followed, thinnest(start.grid()));
        let count = lost.iter().filter(|lost| **lost).count();
        Ok(count as f64 / lost.len().max(1) as f64)
    }

    /// Whether the surface bounds something only with lids, which are no part of it.
    pub fn has_lids(&self) -> bool {
        self.loaded().open.is_some()
    }

    /// The noise of the surface where it was not given.
    pub fn noise_estimate(&self) -> Option<NoiseEstimate> {
        self.loaded().estimate
    }

    /// What becomes of the vertices.
    pub fn fairing(&self) -> &Fairing {
        &self.loaded().fairing
    }

    /// The mesh as it was given.
    pub fn rough(&self) -> &ClosedMesh {
        &self.fairing().rough
    }

    /// The nodes that may move, if not all.
    pub fn nodes(&self, grid: &Grid<3>) -> Option<NodeSet> {
        let keep = self.loaded().keep.as_ref()?;
        Some(NodeSet::inside(grid, &|x| -keep.signed_distance(x)))
    }

    /// The grid has the coordinates of the mesh. A run has one start.
    fn followed(&self, start: &Stored<3>, eps: f64) -> Result<&Followed> {
        let followed = &self.loaded().followed;
        if let Some(followed) = followed.get() {
            return Ok(followed);
        }
        let in_place = Placement::about([0.0; 3], 1.0)?;
        let found = self.fairing().follow(in_place, start, eps)?;
        Ok(followed.get_or_init(|| found))
    }

    /// How far the vertices have gone along the normals, root of the mean square, is measured, and the flow ends when the noise is off.
    pub fn known(&self, start: &Stored<3>, eps: f64) -> Result<Known<3>> {
        let (fairing, followed) = (self.fairing().clone(), self.followed(start, eps)?.clone());
        let mut stops = Vec::new();
        if self.noise != 0.0 {
            stops.push(Stop::Time(fairing.time(start.grid().spacing(), 1.0)));
            stops.push(Stop::Displacement(fairing.farthest()));
        }
        let gone = Measure::new(DISPLACEMENT, move |u, _| {
            // A field that is not finite stops the run elsewhere.
            Ok(fairing.displacement(&followed, u).ok())
        });
        Ok(Known {
            volume: self.keeps_volume.then(|| self.rough().volume()),
            max_distance: self.max_distance,
            measures: vec![gone],
            stops,
        })
    }

    /// The mesh with this volume, if one is given, by the vertices that are free, and with all vertices within the largest distance.
    fn bounded(&self, mesh: TriangleMesh, volume: Option<f64>, free: &[bool]) -> TriangleMesh {
        let whole = match volume {
            Some(volume) => mesh.with_volume(volume, |vertex| free[vertex]),
            None => mesh,
        };
        let Some(length) = self.max_distance else {
            return whole;
        };
        // Where noise is taken off, it has the volume of the rough mesh already.
        let volume = volume.or_else(|| (self.noise > 0.0).then(|| self.rough().volume()));
        let bound = Bound::new(self.rough(), length);
        match volume {
            Some(volume) => bound.hold(&whole, |mesh, within| {
                mesh.with_volume(volume, |vertex| free[vertex] && within[vertex])
            }),
            None => bound.clamp(&whole),
        }
    }

    /// The mesh of the file, with its vertices where those of `moved` are.
    fn written(&self, moved: &TriangleMesh) -> TriangleMesh {
        let Loaded { mesh, places, .. } = self.loaded();
        let ways = self.rough().mesh().vertices.iter().zip(&moved.vertices);
        let goes: HashMap<_, _, PlaceHasher> = ways.map(|(from, to)| (key(*from), *to)).collect();
        let vertices = mesh.vertices.iter().zip(places);
        TriangleMesh {
            vertices: vertices
                .map(|(x, place)| match goes.get(&key(*place)) {
                    Some(to) if key(*x) == key(*place) => *to,
                    // It was joined to another one, from which it is as far as before.
                    Some(to) => [0, 1, 2].map(|i| x[i] + (to[i] - place[i])),
                    // Vertices of no face stay.
                    None => *x,
                })
                .collect(),
            faces: mesh.faces.clone(),
            normals: None,
        }
    }

    /// The moved mesh with vertices at their old places where faces of the file would cross others that did not before. Lids, and faces that are cut
    /// apart for the flow, hide some of these from [`TriangleMesh::untangled`].
    fn uncrossed(&self, mut moved: TriangleMesh) -> TriangleMesh {
        let Loaded { mesh, places, .. } = self.loaded();
        let crossed = mesh.crossing_faces();
        loop {
            let crosses = self.written(&moved).newly_crossing(&crossed);
            let tangled = mesh.faces.iter().zip(&crosses).filter(|(_, new)| **new);
            let corners = tangled.flat_map(|(face, _)| face);
            let back: HashSet<_> = corners.map(|&v| key(places[v as usize])).collect();
            let rough = &self.rough().mesh().vertices;
            let mut changes = false;
            for (x, from) in moved.vertices.iter_mut().zip(rough) {
                if key(*x) != key(*from) && back.contains(&key(*from)) {
                    (*x, changes) = (*from, true);
                }
            }
            // Each round moves some back, until nothing is tangled.
            if !changes {
                return moved;
            }
        }
    }

    /// The mesh with the vertices where the phase field `u` has taken them, or the new one in its place.
    pub fn faired(&self, start: &Stored<3>, u: &Stored<3>, eps: f64, up: UpAxis) -> Result<Faired> {
        let rough = self.rough();
        if self.is_new {
            let made = surface(u, eps)?;
            // That of the zero level set, but for what noise does not change.
            let volume = (self.noise > 0.0 || self.keeps_volume).then(|| rough.volume());
            let (grid, moving) = (u.grid(), self.nodes(u.grid()));
            let moves = |x: [f64; 3]| {
                (moving.as_ref()).is_none_or(|moving| moving.contains(grid.nearest(x)))
            };
            let free: Vec<bool> = made.vertices.iter().map(|&x| moves(x)).collect();
            let mesh = self.bounded(made.clone(), volume, &free).untangled(&made);
            let mut faired = Faired::anew(rough, mesh, up);
            faired.report.noise = Some(self.noise);
            if let Some(length) = self.max_distance {
                faired.report.bound(length, &faired.displacement.lengths);
            }
            return Ok(faired);
        }
        let fairing = self.fairing();
        let followed = self.followed(start, eps)?;
        let FairedMesh {
            mesh: mut moved,
            mut edges,
        } = fairing.faired(followed, u)?;
        let open = self.loaded().open.as_ref();
        if let Some(open) = open {
            // The boundary has its noise, which the surface beside it follows.
            let mut rings = open.rings(rough.mesh(), RINGS);
            for (free, kept) in rings.iter_mut().zip(&fairing.kept) {
                *free &= !kept;
            }
            let normals = moved.vertex_normals();
            let faired = moved.vertices.clone();
            moved.bend_least_beside(&rings, &open.creases(rough.mesh()));
            if fairing.is_cautious {
                self.unbend_far(&mut moved, &faired, &rings);
            }
            // Along the surface vertices stay where they were.
            for ((x, from), normal) in moved.vertices.iter_mut().zip(&faired).zip(&normals) {
                let along: f64 = (0..3).map(|i| (x[i] - from[i]) * normal[i]).sum();
                *x = [0, 1, 2].map(|i| from[i] + along * normal[i]);
            }
        }
        let held_back = (fairing.is_cautious).then(|| fairing.hold_back(&mut moved));
        let volume = match (self.keeps_volume, self.drives_volume) {
            (true, _) => Some(rough.volume()),
            (_, true) => Some(ZeroSet::of(u, eps)?.volume),
            _ => None,
        };
        let free: Vec<bool> = fairing.kept.iter().map(|kept| !kept).collect();
        moved = self.bounded(moved, volume, &free);
        moved = match open {
            Some(open) => self.uncrossed(open.untangled(&moved, rough.mesh())),
            None => moved.untangled(rough.mesh()),
        };
        if moved.vertices == rough.mesh().vertices {
            edges = KeptEdges::default();
        }
        let ways = rough.mesh().vertices.iter().zip(&moved.vertices);
        let lengths: Vec<f64> = ways.map(|(a, b)| distance(*a, *b)).collect();
        let all = self.written(&moved);
        let mut lost = fairing.unresolved(followed, thinnest(start.grid()));
        let mut lengths = lengths;
        let mut shown = moved.clone();
        if let Some(open) = open {
            lengths.truncate(open.vertices);
            lost.truncate(open.vertices);
            shown = open.without_lids(&moved);
        }
        let mut report = MeshReport {
            noise: Some(self.noise),
            left_behind_percent: Some(100.0 * followed.left_behind(u)?),
            held_back: held_back.filter(|count| *count > 0),
            kept_edges: (edges.count > 0).then_some(edges.count),
            kept_edges_length: (edges.count > 0).then_some(edges.length),
            ..MeshReport::new(rough, &moved, &lengths)
        };
        let after =
            (report.volume_change_percent).map(|percent| (1.0 + 0.01 * percent) * rough.volume());
        report.volume_missed_percent = (volume.zip(after))
            .map(|(wanted, found)| 100.0 * (found / wanted - 1.0))
            .filter(|percent| percent.abs() > MISSED);
        if open.is_some_and(|open| !open.rim.is_empty()) {
            // What lids enclose is no size of the surface.
            (report.volume_change_percent, report.area_change_percent) = (None, None);
            report.volume_missed_percent = None;
            report.is_open = true;
        }
        if let Some(length) = self.max_distance {
            let distances = MeshDistance::new(rough).signed_distances(&shown.vertices);
            let distances: Vec<f64> = distances.into_iter().map(f64::abs).collect();
            report.bound(length, &distances);
        }
        Ok(Faired {
            displacement: Displacement {
                mesh: shown,
                lengths,
                lost,
                up,
            },
            surface: Surface {
                file: Some(MeshFile {
                    format: self.extension().to_owned(),
                    bytes: surfaces::rewrite(&self.loaded().bytes, &self.file, &all)?,
                }),
                mesh: all,
                up,
            },
            report,
        })
    }
}

/// Parts and gaps that are thinner than two cells come and go with the place of the grid.
pub fn thinnest(grid: &Grid<3>) -> f64 {
    2.0 * grid.spacing()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let squares = (0..3).map(|i| (a[i] - b[i]).powi(2));
    squares.sum::<f64>().sqrt()
}

/// The coordinates as bits, by which equal positions are found; -0 is 0.
fn key(x: [f64; 3]) -> [u64; 3] {
    x.map(|v| (v + 0.0).to_bits())
}
