//! Closed oriented surfaces, their topology and measures.

use derive_more::Display;
use geometry::measure::BoundingBox;
use geometry::{Placement, require};

use crate::half_edges::HalfEdges;
use crate::mesh::has_three_corners;
use crate::nesting::windings;
use crate::vector::{Vector, scaled_normal};
use crate::{Error, TriangleMesh};

/// A triangle mesh that bounds a solid: every edge is run through exactly once in each direction.
///
/// There may be several components. Those that lie inside others and are oriented inwards bound
/// cavities. A [union](ClosedMesh::bodies) has several bodies that overlap. Other intersections of
/// faces are not looked for: where a surface crosses itself, inside and outside are not defined, and
/// no error tells so.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedMesh {
    mesh: TriangleMesh,
    euler_characteristic: i64,
    components: usize,
    /// The body of each face, where there are several that overlap.
    bodies: Vec<u32>,
}

/// The sum of the volumes behind faces is exact to this part of the product of their area and the longest side.
const ROUNDING: f64 = 1e-14;

/// What [`ClosedMesh::new`] changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Display)]
#[non_exhaustive]
pub enum Warning {
    /// The total volume was negative: all faces were reversed.
    #[display("the surface was oriented inwards: all faces reversed")]
    Reversed,
    /// The surface is closed only if vertices with exactly equal coordinates are one: so many less than before.
    #[display("{_0} vertices were merged with others at exactly the same place")]
    Merged(usize),
    /// So many faces with a repeated vertex were left out.
    #[display("{_0} faces with a repeated vertex were left out")]
    Collapsed(usize),
    /// So many vertices of no face were left out.
    #[display("{_0} vertices of no face were left out")]
    Unreferenced(usize),
    /// So many vertices became others that are at the same place up to rounding.
    #[display("{_0} vertices were joined to others at the same place up to rounding")]
    Joined(usize),
    /// So many faces were there before, or are the back of another one.
    #[display("{_0} faces that are there twice were left out")]
    Doubled(usize),
    /// So many faces were turned round, as their neighbours are.
    #[display("{_0} faces were turned round to agree with their neighbours")]
    Turned(usize),
    /// So many faces had their corners on a line.
    #[display("{_0} faces without area gave their longest sides to their neighbours")]
    Flat(usize),
    /// So many edges of more than two faces, or of two that do not agree, were cut.
    #[display(
        "{_0} edges of more than two faces, or of two that do not agree, were cut, and their vertices fixed,"
    )]
    Cut(usize),
    /// So many parts became plates.
    #[display("{_0} open parts, which no lids close, were made plates")]
    Plates(usize),
    /// So many parts of how many have no part in the flow.
    #[display(
        "{parts} of {all} open parts, which nothing closes without crossing the surface, were left out"
    )]
    Left {
        /// Parts that stay.
        parts: usize,
        /// All parts.
        all: usize,
    },
    /// So many parts overlap, or cross themselves.
    #[display("{_0} parts that overlap are seen as one body")]
    United(usize),
    /// So many holes have lids that cross the surface.
    #[display("{_0} of the lids cross the surface")]
    CrossingLids(usize),
    /// So many vertices of how many are at places where it is not known what is inside.
    #[display(
        "{vertices} of {all} vertices, which are within other parts, near crossings of parts and lids, or on parts left out, stay where they are"
    )]
    Stay {
        /// Vertices that stay.
        vertices: usize,
        /// All vertices.
        all: usize,
    },
    /// So many holes have lids.
    #[display("{_0} holes were closed by smooth lids")]
    Lids(usize),
    /// So many parts are oriented outwards within others.
    #[display(
        "{_0} parts lie within others without being turned inwards: the flow sees these bodies as cavities"
    )]
    Bodies(usize),
    /// So many parts are oriented inwards, and lie in no other.
    #[display(
        "{_0} parts were oriented inwards where there is nothing around them: their faces were reversed"
    )]
    InsideOut(usize),
}

impl ClosedMesh {
    /// Checks a mesh, and mends what can be mended without moving a vertex; the warnings tell what.
    ///
    /// If the surface is not closed as it is, vertices with exactly equal coordinates are merged
    /// and faces with a repeated vertex left out. The orientation is decided by the total volume:
    /// if it is negative, all faces are reversed. Then components must lie outside all others if
    /// they are oriented outwards, and inside one more than they are outside of if inwards.
    ///
    /// # Errors
    /// [`Error::NoFaces`]; [`Error::NonFiniteVertex`]; [`Error::Normals`];
    /// [`Error::IndexOutOfRange`]; [`geometry::Error::InvalidParameter`] for meshes so small or large that
    /// products of lengths leave the range of numbers; [`Error::Open`], [`Error::NonManifold`] and
    /// [`Error::MixedOrientation`] for edges that are not used once in each direction;
    /// [`Error::NoArea`] for faces whose corners are on a line; [`Error::NoVolume`];
    /// [`Error::Nesting`].
    pub fn new(mut mesh: TriangleMesh) -> Result<(Self, Vec<Warning>), Error> {
        mesh.check(f64::MAX)?;
        let side = mesh.bounding_box().ok_or(Error::NoFaces)?.longest_side();
        let requirement = "between 1e-70 and 1e70; choose another unit of length";
        require(
            "longest side of the bounding box",
            side,
            requirement,
            |side| side == 0.0 || (1e-70..1e70).contains(&side),
        )?;
        let mut warnings = Vec::new();
        let mut seams = Seams::find(&mesh);
        let collapsed = !mesh.faces.iter().all(has_three_corners);
        if seams.is_err() || collapsed || has_no_area(&mesh).is_err() {
            let before = [mesh.vertices.len(), mesh.faces.len()];
            mesh = mesh.merged();
            let vertices = before[0] - mesh.vertices.len();
            let faces = before[1] - mesh.faces.len();
            warnings.extend((vertices > 0).then_some(Warning::Merged(vertices)));
            warnings.extend((faces > 0).then_some(Warning::Collapsed(faces)));
            seams = Seams::find(&mesh);
        }
        let seams = seams?;
        has_no_area(&mesh)?;
        let vertices = drop_unreferenced(&mut mesh);
        warnings.extend((vertices > 0).then_some(Warning::Unreferenced(vertices)));

        let bounds = mesh.bounding_box().ok_or(Error::NoFaces)?;
        let (area, volume) = (area(&mesh), mesh.volume());
        let rounding = ROUNDING * area * bounds.longest_side();
        if volume.abs() <= rounding {
            return Err(Error::NoVolume { volume, area });
        }
        if volume < 0.0 {
            reverse(&mut mesh);
            warnings.push(Warning::Reversed);
        }
        check_nesting(&mesh, &seams)?;
        let closed = Self {
            // V - E + F with E = 3/2 F.
            euler_characteristic: seams.vertices as i64 - mesh.faces.len() as i64 / 2,
            components: seams.components,
            mesh,
            bodies: Vec::new(),
        };
        Ok((closed, warnings))
    }

    /// The union of the bodies that these faces bound, each by itself oriented outwards.
    ///
    /// # Errors
    /// As [`Self::new`], but for parts that lie in others.
    pub(crate) fn union(mesh: TriangleMesh, bodies: Vec<u32>) -> Result<Self, Error> {
        let seams = Seams::find(&mesh)?;
        let union = Self {
            euler_characteristic: seams.vertices as i64 - mesh.faces.len() as i64 / 2,
            components: seams.components,
            mesh: TriangleMesh::default(),
            bodies,
        };
        union.moved(mesh)
    }

    /// The bodies that overlap, each a closed surface, if the mesh bounds their union; otherwise one, the mesh itself.
    #[must_use]
    pub fn bodies(&self) -> Vec<Self> {
        let count = self.bodies.iter().max().map_or(1, |last| last + 1);
        if count == 1 {
            return vec![self.clone()];
        }
        let body = |number: u32| {
            let faces = self.mesh.faces.iter().zip(&self.bodies);
            let faces = faces.filter(|(_, body)| **body == number);
            let mut mesh = TriangleMesh {
                faces: faces.map(|(face, _)| *face).collect(),
                ..self.mesh.clone()
            };
            drop_unreferenced(&mut mesh);
            let seams = Seams::find(&mesh).expect("all is closed");
            Self {
                euler_characteristic: seams.vertices as i64 - mesh.faces.len() as i64 / 2,
                components: seams.components,
                mesh,
                bodies: Vec::new(),
            }
        };
        (0..count).map(body).collect()
    }

    /// The body of each vertex, of [`Self::bodies`].
    pub(crate) fn body_of_vertices(&self) -> Vec<u32> {
        let mut of_vertices = vec![0; self.mesh.vertices.len()];
        for (face, body) in self.mesh.faces.iter().zip(&self.bodies) {
            for &vertex in face {
                of_vertices[vertex as usize] = *body;
            }
        }
        of_vertices
    }

    /// Whether it bounds the union of bodies that overlap.
    pub fn is_union(&self) -> bool {
        !self.bodies.is_empty()
    }

    /// The surface with these positions of its vertices in place of its own. What depends on its faces alone is not looked at again.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn moved(&self, mesh: TriangleMesh) -> Result<Self, Error> {
        // Vertices of seams may come apart, and parts into each other.
        let no_seams = self.euler_characteristic + mesh.faces.len() as i64 / 2;
        let is_one = self.components == 1 && mesh.vertices.len() as i64 == no_seams;
        let is_good = || {
            let side = mesh
                .bounding_box()
                .map_or(0.0, |bounds| bounds.longest_side());
            mesh.check(f64::MAX).is_ok()
                && has_no_area(&mesh).is_ok()
                && mesh.volume() > ROUNDING * area(&mesh) * side
        };
        if (is_one || self.is_union()) && is_good() {
            return Ok(Self {
                mesh,
                bodies: self.bodies.clone(),
                ..*self
            });
        }
        if self.is_union() {
            mesh.check(f64::MAX)?;
            has_no_area(&mesh)?;
            let (volume, area) = (mesh.volume(), area(&mesh));
            return Err(Error::NoVolume { volume, area });
        }
        Self::new(mesh).map(|(moved, _)| moved)
    }

    /// The triangles.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// Gives up what is known about the triangles.
    pub fn into_mesh(self) -> TriangleMesh {
        self.mesh
    }

    /// Area of the surface.
    pub fn area(&self) -> f64 {
        area(&self.mesh)
    }

    /// Enclosed volume, cavities subtracted: `1/6 sum of a . (b x c)` over the faces (divergence
    /// theorem).
    pub fn volume(&self) -> f64 {
        self.mesh.volume()
    }

    /// Euler characteristic `V - E + F`, the sum of `2 - 2 g` over the components.
    ///
    /// A vertex in which sheets only touch counts once for every sheet.
    pub fn euler_characteristic(&self) -> i64 {
        self.euler_characteristic
    }

    /// Number of components, connected over edges.
    pub fn components(&self) -> usize {
        self.components
    }

    /// Number of handles, summed over the components.
    pub fn genus(&self) -> i64 {
        self.components as i64 - self.euler_characteristic / 2
    }

    /// The smallest box around the surface.
    pub fn bounding_box(&self) -> BoundingBox<3> {
        let bounds = self.mesh.bounding_box();
        bounds.expect("a closed mesh has vertices")
    }

    /// The surface without the components, cavities too, that enclose less than `least`: specks and bubbles. All of it if nothing would be
    /// left.
    ///
    /// # Errors
    /// As [`ClosedMesh::new`].
    pub fn without_small_parts(&self, least: f64) -> Result<Self, Error> {
        let mut parts = Seams::find(&self.mesh)?.parts(&self.mesh);
        parts.retain(|faces| self.mesh.volume_behind(faces).abs() >= least);
        if parts.is_empty() {
            return Ok(self.clone());
        }
        let mesh = TriangleMesh {
            faces: parts.concat(),
            ..self.mesh.clone()
        };
        Ok(Self::new(mesh)?.0)
    }

    /// The surface scaled and moved.
    #[must_use]
    pub fn placed(&self, placement: &Placement<3>) -> Self {
        let mut placed = self.clone();
        for x in &mut placed.mesh.vertices {
            *x = placement.apply(*x);
        }
        placed
    }
}

/// Refuses faces whose corners are on a line up to rounding.
pub(crate) fn has_no_area(mesh: &TriangleMesh) -> Result<(), Error> {
    let flat = |&face: &[u32; 3]| is_flat(mesh, face);
    let Some(face) = mesh.faces.iter().position(flat) else {
        return Ok(());
    };
    Err(Error::NoArea {
        faces: mesh.faces.iter().filter(|f| flat(f)).count(),
        face,
        corners: mesh.faces[face].map(|v| mesh.vertices[v as usize]),
    })
}

/// Whether the corners of a face are on a line up to rounding.
pub(crate) fn is_flat(mesh: &TriangleMesh, face: [u32; 3]) -> bool {
    let [a, b, c] = mesh.corners(face);
    let squares = [b - a, c - b, a - c].map(Vector::length_squared);
    let longest = squares.into_iter().fold(0.0, f64::max);
    // The height over the longest edge, against the rounding of the cross product.
    scaled_normal([a, b, c]).length() <= 4.0 * f64::EPSILON * longest
}

/// Leaves out vertices without faces and returns how many there were.
pub(crate) fn drop_unreferenced(mesh: &mut TriangleMesh) -> usize {
    let mut used = vec![false; mesh.vertices.len()];
    for &v in mesh.faces.as_flattened() {
        used[v as usize] = true;
    }
    let kept: Vec<usize> = (0..used.len()).filter(|&v| used[v]).collect();
    let unreferenced = used.len() - kept.len();
    if unreferenced > 0 {
        *mesh = mesh.keeping(&kept);
    }
    unreferenced
}

fn reverse(mesh: &mut TriangleMesh) {
    for face in &mut mesh.faces {
        face.swap(1, 2);
    }
    for normal in mesh.normals.iter_mut().flatten() {
        *normal = normal.map(|v| -v);
    }
}

fn area(mesh: &TriangleMesh) -> f64 {
    let twice = mesh
        .faces
        .iter()
        .map(|&f| scaled_normal(mesh.corners(f)).length());
    0.5 * twice.sum::<f64>()
}

/// Components must be enclosed by as many others as their orientation says.
fn check_nesting(mesh: &TriangleMesh, seams: &Seams) -> Result<(), Error> {
    if seams.components < 2 {
        return Ok(());
    }
    let parts = seams.parts(mesh);
    let windings = windings(mesh, &parts);
    let checked = (0..parts.len()).map(|this| {
        let winding: f64 = windings[this].iter().map(|part| part.number).sum();
        let outwards = mesh.volume_behind(&parts[this]) > 0.0;
        let expected = i64::from(!outwards);
        // Where components touch, the winding number is not whole and tells nothing.
        if (winding - winding.round()).abs() > 0.01 || winding.round() as i64 == expected {
            return Ok(());
        }
        let first = seams.component.iter().position(|&k| k as usize == this);
        Err(Error::Nesting {
            face: first.unwrap_or_default(),
            orientation: if outwards { "outwards" } else { "inwards" },
            enclosing: winding.round() as i64,
            expected,
        })
    });
    checked.into_iter().collect()
}

/// How faces hang together.
pub(crate) struct Seams {
    /// Number of the component of every face, in the order of first faces.
    pub(crate) component: Vec<u32>,
    pub(crate) components: usize,
    /// Vertices, counted once for every sheet.
    vertices: usize,
}

impl Seams {
    pub(crate) fn find(mesh: &TriangleMesh) -> Result<Self, Error> {
        let surface = HalfEdges::new(mesh)?;
        let (component, components) = surface.components();
        Ok(Self {
            component,
            components,
            vertices: surface.sheets(),
        })
    }

    /// The faces of every component.
    pub(crate) fn parts(&self, mesh: &TriangleMesh) -> Vec<Vec<[u32; 3]>> {
        let mut parts = vec![Vec::new(); self.components];
        for (face, &part) in mesh.faces.iter().zip(&self.component) {
            parts[part as usize].push(*face);
        }
        parts
    }
}
