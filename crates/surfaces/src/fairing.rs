//! A noisy mesh, and what becomes of its vertices while a phase field flows.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use geometry::{PhaseField, Placement, distances_from_phase_field};
use rayon::prelude::*;

use crate::edges::{Edges, KeptEdges};
use crate::level_set::project;
use crate::selection::Noisy;
use crate::smoothing::{TAUBIN, Umbrellas};
use crate::vector::Vector;
use crate::{ClosedMesh, Error, MeshDistance, PlaceHasher, TriangleMesh};

/// Most rounds of Taubin's smoothing before the flow.
const ROUNDS: usize = 30;
/// The flow takes at most the time `100 s^2 (e^2 + h^2)` for noise of standard deviation `s` on a mesh with edges of mean length `e` and a
/// grid of spacing `h`. Where there is a shape to be lost, the displacement ends it before; a noisy sphere becomes a sphere in this time.
const TIME: f64 = 100.0;
/// Where more noise is to be taken off than the mesh has, the shape has to make up for it, and only a shorter time keeps that:
const TIME_BEYOND: f64 = 8.0;
/// from so many times the noise that is found in the mesh on.
const BEYOND: f64 = 1.5;
/// The smoothing before the flow moves vertices along the normals by at most so many standard deviations, root of the mean square.
const SMOOTHED: f64 = 0.92;
/// When the displacements of the vertices along the normals, averaged over neighbours, are this many standard deviations, root of the mean
/// square, what would go further is the shape. Independent noise has 0.36: what of it is in waves of the shape stays on. Chosen on the four
/// meshes of `denoising` with two noises each, and checked there with noise of another seed.
const FARTHEST: f64 = 0.222;
/// Along the surface no vertex is moved by more than so many standard deviations: there is no noise beyond.
const SLIDING: f64 = 3.0;
/// Waves of so many interface widths are long.
const LONG: f64 = 4.0;
/// A vertex that is further from the zero level set at the beginning than so many standard deviations of the noise, or without noise than
/// so many interface widths, belongs to something that the grid does not resolve.
const RESOLVED: (f64, f64) = (3.0, 0.25);
/// How far from where they began, in interface widths, vertices are looked for: a level set that is further off was not followed.
const REACH: f64 = 4.0;

/// A closed mesh whose vertices follow the zero level set of a phase field, with its noise taken off, if there is some.
///
/// Noise that is independent from vertex to vertex has waves as short as the edges, which a grid of such a width shows as facets and
/// not as noise. So first Taubin's smoothing along the edges takes off the shortest waves, as long as the vertices move by less than most
/// of the noise. From the phase field of this [start](Self#structfield.start) Willmore flow takes off longer ones, until the
/// surface is [as far](Self::farthest) from the rough one as noise is. The zero level set takes the vertices along, but for those
/// parts of the mesh that the grid does not resolve, which keep their distance from it. Last, what the flow took off the long waves is
/// given back ([`TriangleMesh::with_long_waves_of`]), and the volume is made that of the rough mesh.
///
/// In places another smoothing is nearer to the mesh without noise. Stein's unbiased estimate of the risk tells where (C. M. Stein: Estimation of the mean of
/// a multivariate normal distribution. Ann. Statist. 9 (1981)): there vertices have fewer rounds of Taubin's smoothing, where the shape has details as
/// small as the edges, or are those of sides that meet in sharp edges ([`Edges`]).
///
/// That a smooth surface should be as far from the data as these are wrong, and no further, is the discrepancy principle: V. A.
/// Morozov: On the solution of functional equations by the method of regularization. Soviet Math. Dokl. 7 (1966).
///
/// Without noise the vertices follow the level set, and that is all.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Fairing {
    /// The mesh as it was given.
    pub rough: ClosedMesh,
    /// The mesh from which the flow starts.
    pub start: ClosedMesh,
    /// Standard deviation of the noise.
    pub noise: f64,
    /// Whether a vertex stays.
    pub kept: Vec<bool>,
    /// How many vertices at the end belong to lids, which are no part of what is faired.
    pub lids: usize,
    /// Whether sharp edges stay; see [`Self::with_edges`].
    pub edges: Edges,
    /// Whether vertices stay, in part or all, that the flow takes farther than noise explains, since they may have followed another surface.
    pub is_cautious: bool,
    /// Rounds of Taubin's smoothing from the rough mesh to the start.
    rounds: usize,
    /// Those of all meshes with these faces.
    umbrellas: Arc<Umbrellas>,
    /// The noise that is found in the mesh, once it is asked for.
    found: OnceLock<f64>,
}

/// A mesh without its noise.
#[derive(Clone, Debug)]
pub struct FairedMesh {
    /// The mesh.
    pub mesh: TriangleMesh,
    /// Its sharp edges.
    pub edges: KeptEdges,
}

/// Faces are close together in a cube of this part of the width below which parts are thin.
const CLOSE: f64 = 0.25;

/// The vertices of the start of a fairing in the box of a grid.
#[derive(Clone, Debug)]
pub struct Followed {
    placement: Placement<3>,
    vertices: Vec<[f64; 3]>,
    /// The levels that they keep: zero, or more where the grid does not resolve the mesh.
    levels: Vec<f64>,
    eps: f64,
}

impl Fairing {
    /// The longest way of a vertex that noise explains, in its standard deviations.
    pub const EXPLAINED: f64 = 3.0;
    /// The time steps after the first: this part of the time reached. Longer ones are cheaper, and leave more of the short waves.
    pub const GROWTH: f64 = 0.5;

    /// The first time step on a grid, which takes off waves of a few cells only.
    pub fn first_step(spacing: f64) -> f64 {
        spacing.powi(4) / 16.0
    }

    /// Of a mesh with noise of this standard deviation along its normals, see [`TriangleMesh::noise`]; zero for none. `kept` says of a
    /// position whether its vertex stays.
    pub fn new(rough: ClosedMesh, noise: f64, kept: impl Fn([f64; 3]) -> bool) -> Self {
        Self::with_lids(rough, noise, kept, 0)
    }

    /// The same of a surface whose last vertices belong to lids, and stay.
    pub fn with_lids(
        rough: ClosedMesh,
        noise: f64,
        kept: impl Fn([f64; 3]) -> bool,
        lids: usize,
    ) -> Self {
        let vertices = &rough.mesh().vertices;
        let surface = vertices.len() - lids;
        let kept: Vec<bool> = (vertices.iter().enumerate())
            .map(|(vertex, &x)| vertex >= surface || kept(x))
            .collect();
        let umbrellas = Arc::new(Umbrellas::of(rough.mesh()));
        let (start, rounds) = without_short_waves(&rough, &umbrellas, noise, &kept, surface);
        Self {
            start,
            noise,
            kept,
            rough,
            lids,
            edges: Edges::default(),
            is_cautious: false,
            rounds,
            umbrellas,
            found: OnceLock::new(),
        }
    }

    /// The same where these vertices stay, too.
    #[must_use]
    pub fn keeping(mut self, also: &[bool]) -> Self {
        for (kept, also) in self.kept.iter_mut().zip(also) {
            *kept |= also;
        }
        let surface = self.surface();
        (self.start, self.rounds) = without_short_waves(
            &self.rough,
            &self.umbrellas,
            self.noise,
            &self.kept,
            surface,
        );
        self
    }

    /// The same where it is known which noise [is found](TriangleMesh::noise) in the surface without its lids.
    #[must_use]
    pub fn with_found_noise(self, found: f64) -> Self {
        Self {
            found: found.into(),
            ..self
        }
    }

    /// The same with this rule for sharp edges.
    #[must_use]
    pub fn with_edges(self, edges: Edges) -> Self {
        Self { edges, ..self }
    }

    /// How many vertices belong to no lid.
    fn surface(&self) -> usize {
        self.kept.len() - self.lids
    }

    /// The longest time of Willmore flow for the noise, on a grid of this spacing, all lengths multiplied by `scale`.
    pub fn time(&self, spacing: f64, scale: f64) -> f64 {
        let edge = scale * self.rough.mesh().mean_edge();
        let find = || self.rough.mesh().deviation_of_first(self.surface());
        let found = *self.found.get_or_init(find);
        let is_beyond = self.noise > BEYOND * found;
        let most = if is_beyond { TIME_BEYOND } else { TIME };
        most * (scale * self.noise).powi(2) * (edge * edge + spacing * spacing)
    }

    /// The [displacement](Self::displacement) at which the noise is off.
    pub fn farthest(&self) -> f64 {
        FARTHEST * self.noise
    }

    /// The vertices in the box where the start was placed, whose phase field there is `start`.
    ///
    /// # Errors
    /// `eps` must be finite and positive, the values finite.
    pub fn follow(
        &self,
        placement: Placement<3>,
        start: &impl PhaseField<3>,
        eps: f64,
    ) -> Result<Followed, Error> {
        let vertices = self.start.mesh().vertices.iter();
        let vertices: Vec<_> = vertices.map(|&x| placement.apply(x)).collect();
        let own = if self.noise > 0.0 {
            RESOLVED.0 * self.noise * placement.scale()
        } else {
            RESOLVED.1 * eps
        };
        // Zero up to `own`, all of it from twice that.
        let kept = |s: f64| {
            let t = (s.abs() / own - 1.0).clamp(0.0, 1.0);
            s * t * t * (3.0 - 2.0 * t)
        };
        let distance = distances_from_phase_field(start, eps)?;
        let levels = vertices.par_iter().map(|&x| kept(distance.spline(x).0));
        Ok(Followed {
            levels: levels.collect(),
            placement,
            vertices,
            eps,
        })
    }

    /// Whether each vertex is at something that the grid does not hold: too far from the zero level set at the beginning, or [thin](Self::thin).
    pub fn unresolved(&self, followed: &Followed, width: f64) -> Vec<bool> {
        let far = RESOLVED.1 * followed.eps;
        let levels = followed.levels.iter().zip(self.thin(width));
        levels
            .map(|(level, is_thin)| is_thin || level.abs() > far)
            .collect()
    }

    /// Whether each vertex is at a face where the start, or the gap before it, is thinner than `width`. Of faces that are close together and look to the
    /// same side, one is measured.
    pub fn thin(&self, width: f64) -> Vec<bool> {
        let mesh = self.start.mesh();
        let distance = MeshDistance::new(&self.start);
        let mut lost = vec![false; mesh.vertices.len()];
        let groups = Groups::in_cubes(mesh, CLOSE * width);
        let thin = groups.first.par_iter().map(|&face| {
            let face = mesh.faces[face];
            distance.is_thin(centre(mesh, face), mesh.face_normal(face), width)
        });
        let thin: Vec<bool> = thin.collect();
        let faces = mesh.faces.iter().zip(groups.of_faces);
        for (face, _) in faces.filter(|(_, group)| thin[*group]) {
            for &vertex in face {
                lost[vertex as usize] = true;
            }
        }
        lost
    }

    /// How far the surface has gone when the phase field is `u`: the displacements of the vertices along the normals of the start, averaged
    /// over neighbours, root of the mean square.
    ///
    /// # Errors
    /// The values must be finite.
    pub fn displacement(&self, followed: &Followed, u: &impl PhaseField<3>) -> Result<f64, Error> {
        let now = self.flowed(followed, u)?;
        let start = self.start.mesh();
        let displacements = along_normals(&start.vertex_normals(), self.rough.mesh(), &now);
        let averaged = self.umbrellas.averaged(&displacements);
        Ok(root_mean_square(&averaged[..self.surface()]))
    }

    /// The mesh, when the phase field is `u`.
    ///
    /// # Errors
    /// The values must be finite.
    pub fn faired(&self, followed: &Followed, u: &impl PhaseField<3>) -> Result<FairedMesh, Error> {
        let flowed = self.flowed(followed, u)?;
        if self.noise == 0.0 {
            let edges = KeptEdges::default();
            return Ok(FairedMesh {
                mesh: flowed,
                edges,
            });
        }
        let surface = self.surface();
        let counts = self.kept.iter().enumerate();
        let counts: Vec<bool> = counts.map(|(v, kept)| v < surface && !kept).collect();
        let noisy = Noisy {
            rough: &self.rough,
            noise: self.noise,
            counts: &counts,
            rounds: self.rounds,
            umbrellas: &self.umbrellas,
        };
        let (mesh, edges) = noisy.nearest(&flowed, self.edges);
        let mesh = self.held(mesh);
        Ok(FairedMesh { mesh, edges })
    }

    /// What the flow alone makes of the mesh.
    fn flowed(&self, followed: &Followed, u: &impl PhaseField<3>) -> Result<TriangleMesh, Error> {
        let now = distances_from_phase_field(u, followed.eps)?;
        let pairs = followed.vertices.par_iter().zip(&followed.levels);
        let moved = pairs.map(|(&x, &level)| project(&now, x, level, REACH * followed.eps));
        let mut mesh = TriangleMesh {
            vertices: (moved.map(|x| followed.placement.apply_inverse(x))).collect(),
            faces: self.rough.mesh().faces.clone(),
            normals: None,
        };
        if self.is_cautious {
            let most = Self::EXPLAINED * self.noise;
            hold_back(&mut mesh, self.start.mesh(), most);
        }
        if self.noise > 0.0 {
            let wavelength = LONG * followed.eps / followed.placement.scale();
            mesh = mesh.with_long_waves_by(&self.umbrellas, self.start.mesh(), wavelength);
        }
        Ok(self.held(mesh))
    }

    /// Holds vertices of a mesh back that are farther from where they were given than noise explains, along the normals and as much along the surface;
    /// returns how many.
    pub fn hold_back(&self, mesh: &mut TriangleMesh) -> usize {
        let most = 2.0_f64.sqrt() * Self::EXPLAINED * self.noise;
        hold_back(mesh, self.rough.mesh(), most)
    }

    /// With the vertices that stay, and with the volume where noise is taken off.
    fn held(&self, mut mesh: TriangleMesh) -> TriangleMesh {
        hold(&mut mesh, self.rough.mesh(), &self.kept);
        if self.noise > 0.0 {
            mesh.with_volume(self.rough.volume(), |vertex| !self.kept[vertex])
        } else {
            mesh
        }
    }
}

impl Followed {
    /// The part of the vertices that the zero level set of `u` has left behind.
    ///
    /// # Errors
    /// The values must be finite.
    pub fn left_behind(&self, u: &impl PhaseField<3>) -> Result<f64, Error> {
        let now = distances_from_phase_field(u, self.eps)?;
        let pairs = self.vertices.par_iter().zip(&self.levels);
        let off = pairs.filter(|&(&x, &level)| {
            let moved = project(&now, x, level, REACH * self.eps);
            (now.spline(moved).0 - level).abs() > RESOLVED.1 * self.eps
        });
        Ok(off.count() as f64 / self.vertices.len().max(1) as f64)
    }
}

/// As many rounds of Taubin's smoothing as move the vertices along the normals by no more than most of the noise, and along the surface,
/// where it would make edges alike, by no more than noise does; those that are kept stay. And how many rounds these are.
fn without_short_waves(
    rough: &ClosedMesh,
    umbrellas: &Umbrellas,
    noise: f64,
    kept: &[bool],
    surface: usize,
) -> (ClosedMesh, usize) {
    let (mut smooth, mut rounds) = (rough.clone(), 0);
    for _ in 0..ROUNDS {
        let mut next = smooth.mesh().smoothed_by(umbrellas, 1, TAUBIN);
        let mut normals = next.vertex_normals();
        let longest = SLIDING * noise;
        let are_held = hold_along_surface(&mut next, &normals, rough.mesh(), longest);
        if are_held | hold(&mut next, rough.mesh(), kept) {
            normals = next.vertex_normals();
        }
        let moved = along_normals(&normals, rough.mesh(), &next);
        let moved = root_mean_square(&moved[..surface]);
        if moved.is_nan() || moved > SMOOTHED * noise {
            break;
        }
        match smooth.moved(next) {
            Ok(next) if next.mesh().faces.len() == rough.mesh().faces.len() => {
                smooth = next;
                rounds += 1;
            }
            // Where slivers lose their area.
            _ => break,
        }
    }
    (smooth, rounds)
}

fn centre(mesh: &TriangleMesh, face: [u32; 3]) -> [f64; 3] {
    (mesh.corners(face).into_iter().sum::<Vector>() / 3.0).to_array()
}

/// Groups of faces that are close together and look to the same side.
struct Groups {
    /// The group of each face.
    of_faces: Vec<usize>,
    /// The first face of each group.
    first: Vec<usize>,
}

impl Groups {
    /// Those in a cube of this side that look to the same one of its six sides.
    fn in_cubes(mesh: &TriangleMesh, side: f64) -> Self {
        let mut places = HashMap::with_hasher(PlaceHasher::default());
        let mut first = Vec::new();
        let of_face = |(number, &face): (usize, &[u32; 3])| -> usize {
            let cube = centre(mesh, face).map(|x| (x / side).floor() as i64);
            let normal = Vector::from_array(mesh.face_normal(face));
            let axis = normal.abs().max_position();
            let place = (cube, axis, normal[axis] > 0.0);
            *places.entry(place).or_insert_with(|| {
                first.push(number);
                first.len() - 1
            })
        };
        let of_faces = mesh.faces.iter().enumerate().map(of_face).collect();
        Self { of_faces, first }
    }
}

/// Puts the vertices that are kept where those of a rough mesh are, if there are some.
fn hold(mesh: &mut TriangleMesh, rough: &TriangleMesh, kept: &[bool]) -> bool {
    let vertices = mesh.vertices.iter_mut().zip(&rough.vertices).zip(kept);
    for ((x, from), _) in vertices.filter(|(_, kept)| **kept) {
        *x = *from;
    }
    kept.contains(&true)
}

/// Makes those ways of vertices shorter that are longer than most; returns how many are. Those that are twice as long, and more, become none: such a vertex
/// has followed another surface.
fn hold_back(mesh: &mut TriangleMesh, from: &TriangleMesh, most: f64) -> usize {
    let mut count = 0;
    for (x, from) in mesh.vertices.iter_mut().zip(&from.vertices) {
        let start = Vector::from_array(*from);
        let way = Vector::from_array(*x) - start;
        let far = way.length();
        if far > most {
            let part = (2.0 - far / most).max(0.0);
            *x = (start + way * (part * most / far)).to_array();
            count += 1;
        }
    }
    count
}

/// Shortens the ways of the vertices from those of a rough mesh along the surface to a length, and says whether some were longer.
fn hold_along_surface(
    mesh: &mut TriangleMesh,
    normals: &[[f64; 3]],
    rough: &TriangleMesh,
    longest: f64,
) -> bool {
    let mut any = false;
    for ((x, from), normal) in mesh.vertices.iter_mut().zip(&rough.vertices).zip(normals) {
        let here = Vector::from_array(*x);
        let way = here - Vector::from_array(*from);
        let along = way.reject_from_normalized(Vector::from_array(*normal));
        if along.length_squared() > longest * longest {
            *x = (here - along + along.clamp_length_max(longest)).to_array();
            any = true;
        }
    }
    any
}

/// The displacements from the vertices of one mesh to those of another along these normals.
fn along_normals(normals: &[[f64; 3]], from: &TriangleMesh, to: &TriangleMesh) -> Vec<f64> {
    let pairs = from.vertices.iter().zip(&to.vertices).zip(normals);
    pairs
        .map(|((a, b), n)| (0..3).map(|i| (b[i] - a[i]) * n[i]).sum())
        .collect()
}

fn root_mean_square(numbers: &[f64]) -> f64 {
    let squares: f64 = numbers.iter().map(|x| x * x).sum();
    (squares / numbers.len().max(1) as f64).sqrt()
}
