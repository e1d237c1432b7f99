//! How the triangles of a closed surface hang together, and operations that keep its topology.

use crate::{Error, TriangleMesh};

/// What is no longer there.
const NONE: u32 = u32::MAX;

/// A closed oriented surface of triangles. Half-edges `3 f`, `3 f + 1` and `3 f + 2` are the sides of the face `f`, in order.
///
/// The operations are for surfaces that run once around every vertex. They keep them manifolds, their components and their Euler characteristic,
/// as long as [`can_flip`](Self::can_flip) and [`can_collapse`](Self::can_collapse) are asked before.
pub(crate) struct HalfEdges {
    /// The vertex from which a half-edge starts.
    origin: Vec<u32>,
    /// The same edge in the other direction, in the face on its other side.
    twin: Vec<u32>,
    /// One of the half-edges that start from a vertex.
    outgoing: Vec<u32>,
}

/// The next half-edge of the same face,
pub(crate) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// and the last one.
pub(crate) fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

impl HalfEdges {
    /// Of faces that run through every edge once in each direction.
    ///
    /// # Errors
    /// [`Error::NoFaces`], [`Error::TooLarge`]; [`Error::NonManifold`], [`Error::Open`] and [`Error::MixedOrientation`] for other edges.
    pub(crate) fn new(mesh: &TriangleMesh) -> Result<Self, Error> {
        let count = mesh.faces.len();
        if count == 0 {
            return Err(Error::NoFaces);
        }
        // Sides are counted in 32 bits.
        if u32::try_from(3 * count).is_err() {
            return Err(Error::TooLarge {
                elements: "faces",
                count,
            });
        }
        let mut surface = Self {
            origin: mesh.faces.as_flattened().to_vec(),
            twin: vec![NONE; 3 * count],
            outgoing: vec![NONE; mesh.vertices.len()],
        };
        let side = |start: u32| {
            let (from, to) = (surface.from(start), surface.to(start));
            Side {
                low: from.min(to),
                high: from.max(to),
                start,
                upwards: from < to,
            }
        };
        let sides = sorted(mesh.vertices.len(), surface.len(), side);
        check_edges(mesh, &sides)?;
        for h in 0..surface.len() {
            surface.start(h, surface.from(h));
        }
        for [a, b] in sides.as_chunks().0 {
            surface.pair(a.start, b.start);
        }
        Ok(surface)
    }

    /// The number of the component of every face, in the order of first faces, and of components.
    pub(crate) fn components(&self) -> (Vec<u32>, usize) {
        numbered(self.len() / 3, |f| {
            [0, 1, 2].map(|i| self.twin(3 * f + i) / 3)
        })
    }

    /// Number of vertices, counted once for every sheet.
    pub(crate) fn sheets(&self) -> usize {
        numbered(self.len(), |h| [next(self.twin(h))]).1
    }

    /// Half-edges ever, also of faces that are gone.
    pub(crate) fn len(&self) -> u32 {
        self.origin.len() as u32
    }

    /// Whether a half-edge is still there.
    pub(crate) fn exists(&self, h: u32) -> bool {
        self.origin[h as usize] != NONE
    }

    /// Vertices that are still there, in order.
    pub(crate) fn vertices(&self) -> impl Iterator<Item = u32> {
        (0..self.outgoing.len() as u32).filter(|&v| self.outgoing[v as usize] != NONE)
    }

    /// Corners of the faces that are still there, in order.
    pub(crate) fn faces(&self) -> impl Iterator<Item = [u32; 3]> {
        let faces = self.origin.as_chunks::<3>().0;
        faces.iter().copied().filter(|face| face[0] != NONE)
    }

    /// The vertex from which a half-edge starts,
    pub(crate) fn from(&self, h: u32) -> u32 {
        self.origin[h as usize]
    }

    /// the vertex where it ends,
    pub(crate) fn to(&self, h: u32) -> u32 {
        self.from(next(h))
    }

    /// and the third vertex of its face.
    pub(crate) fn opposite(&self, h: u32) -> u32 {
        self.from(previous(h))
    }

    /// The other direction.
    pub(crate) fn twin(&self, h: u32) -> u32 {
        self.twin[h as usize]
    }

    /// Whether it is the first of its edge.
    pub(crate) fn leads(&self, h: u32) -> bool {
        self.exists(h) && h < self.twin(h)
    }

    /// Half-edges that start from a vertex, clockwise.
    pub(crate) fn around(&self, v: u32) -> impl Iterator<Item = u32> {
        let first = self.outgoing[v as usize];
        let mut at = Some(first);
        std::iter::from_fn(move || {
            let h = at?;
            let following = next(self.twin(h));
            at = (following != first).then_some(following);
            Some(h)
        })
    }

    /// Number of edges at a vertex.
    pub(crate) fn valence(&self, v: u32) -> usize {
        self.around(v).count()
    }

    fn are_joined(&self, v: u32, w: u32) -> bool {
        self.around(v).any(|h| self.to(h) == w)
    }

    fn pair(&mut self, h: u32, twin: u32) {
        self.twin[h as usize] = twin;
        self.twin[twin as usize] = h;
    }

    fn start(&mut self, h: u32, v: u32) {
        self.origin[h as usize] = v;
        self.outgoing[v as usize] = h;
    }

    /// Whether the other diagonal of the quadrilateral of an edge is not an edge yet, and three edges stay at its ends.
    pub(crate) fn can_flip(&self, h: u32) -> bool {
        let (c, d) = (self.opposite(h), self.opposite(self.twin(h)));
        let ends = [self.from(h), self.to(h)];
        c != d && ends.iter().all(|&v| self.valence(v) > 3) && !self.are_joined(c, d)
    }

    /// Replaces an edge by the other diagonal of its quadrilateral.
    pub(crate) fn flip(&mut self, h: u32) {
        let t = self.twin(h);
        let [n, p, tn, tp] = [next(h), previous(h), next(t), previous(t)];
        let [c, d] = [self.from(p), self.from(tp)];
        let [a, b] = [self.from(h), self.from(t)];
        let [bc, ca, ad, db] = [n, p, tn, tp].map(|side| self.twin(side));
        for (side, vertex, twin) in [(n, c, ca), (p, a, ad), (tn, d, db), (tp, b, bc)] {
            self.start(side, vertex);
            self.pair(side, twin);
        }
        self.start(h, d);
        self.start(t, c);
    }

    /// Puts a new vertex on an edge and returns it.
    pub(crate) fn split(&mut self, h: u32) -> u32 {
        let t = self.twin(h);
        let [n, p, tn, tp] = [next(h), previous(h), next(t), previous(t)];
        let [a, b, c, d] = [h, t, p, tp].map(|side| self.from(side));
        let [bc, ad] = [n, tn].map(|side| self.twin(side));
        let m = self.outgoing.len() as u32;
        self.outgoing.push(NONE);
        let first = self.len();
        self.origin.extend([NONE; 6]);
        self.twin.extend([NONE; 6]);
        let new: [u32; 6] = std::array::from_fn(|i| first + i as u32);
        for (side, vertex) in new.into_iter().zip([m, b, c, m, a, d]) {
            self.start(side, vertex);
        }
        self.start(n, m);
        self.start(tn, m);
        self.pair(t, new[0]);
        self.pair(new[1], bc);
        self.pair(new[2], n);
        self.pair(h, new[3]);
        self.pair(new[4], ad);
        self.pair(new[5], tn);
        m
    }

    /// The link condition: the ends of the edge have no common neighbours but the two opposite it, and enough edges stay everywhere.
    ///
    /// T. K. Dey, H. Edelsbrunner, S. Guha, D. V. Nekhayev: Topology preserving edge contraction. Publ. Inst. Math. 66 (1999).
    pub(crate) fn can_collapse(&self, h: u32) -> bool {
        let (a, b) = (self.from(h), self.to(h));
        let common = self.around(b).filter(|&g| self.are_joined(a, self.to(g)));
        let opposite = [self.opposite(h), self.opposite(self.twin(h))];
        common.count() == 2 && opposite.into_iter().all(|v| self.valence(v) > 3)
    }

    /// Joins the end of an edge to its start, which stays.
    pub(crate) fn collapse(&mut self, h: u32) {
        let t = self.twin(h);
        let [a, b] = [self.from(h), self.from(t)];
        let ring: Vec<u32> = self.around(b).collect();
        for g in ring {
            self.origin[g as usize] = a;
        }
        for side in [h, t] {
            let [out, back] = [next(side), previous(side)].map(|side| self.twin(side));
            self.pair(out, back);
            self.start(out, self.from(out));
            self.start(back, a);
            for gone in [side, next(side), previous(side)] {
                self.origin[gone as usize] = NONE;
            }
        }
        self.outgoing[b as usize] = NONE;
    }
}

/// A side of a face, `low < high`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    low: u32,
    high: u32,
    /// Number of the corner from which it starts, of all corners of all faces.
    start: u32,
    /// From `low` to `high`.
    upwards: bool,
}

impl Side {
    fn face(self) -> u32 {
        self.start / 3
    }
}

/// Sides in order, so many with vertices below this number. The few at a vertex are sorted after all have found their vertex.
fn sorted(vertices: usize, count: u32, side: impl Fn(u32) -> Side) -> Vec<Side> {
    let all = || (0..count).map(&side);
    let mut ends = vec![0; vertices];
    all().for_each(|side| ends[side.low as usize] += 1);
    let mut end = 0;
    for count in &mut ends {
        // Its sides are written from here on.
        end += std::mem::replace(count, end);
    }
    let none = Side {
        low: NONE,
        high: NONE,
        start: NONE,
        upwards: false,
    };
    let mut sides = vec![none; count as usize];
    for side in all() {
        let place = &mut ends[side.low as usize];
        sides[*place] = side;
        *place += 1;
    }
    let mut first = 0;
    for end in ends {
        sides[first..end].sort_unstable();
        first = end;
    }
    sides
}

/// Every edge must have one side in each direction.
fn check_edges(mesh: &TriangleMesh, sides: &[Side]) -> Result<(), Error> {
    let edges = || sides.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high));
    // How many edges are wrong in some way, the first of them, and its ends.
    let wrong = |is_wrong: &dyn Fn(&[Side]) -> bool| {
        let mut wrong = edges().filter(|edge| is_wrong(edge));
        let edge = wrong.next()?;
        let [a, b] = [edge[0].low, edge[0].high].map(|v| mesh.vertices[v as usize]);
        let (from, to) = if edge[0].upwards { (a, b) } else { (b, a) };
        Some((1 + wrong.count(), edge, from, to))
    };
    if let Some((edges, edge, from, to)) = wrong(&|edge| edge.len() > 2) {
        return Err(Error::NonManifold {
            edges,
            face: edge[0].face() as usize,
            others: edge.len() - 1,
            from,
            to,
        });
    }
    if let Some((edges, edge, from, to)) = wrong(&|edge| edge.len() == 1) {
        return Err(Error::Open {
            edges,
            face: edge[0].face() as usize,
            from,
            to,
        });
    }
    if let Some((edges, edge, from, to)) = wrong(&|edge| edge[0].upwards == edge[1].upwards) {
        return Err(Error::MixedOrientation {
            edges,
            first: edge[0].face() as usize,
            second: edge[1].face() as usize,
            from,
            to,
        });
    }
    Ok(())
}

/// The number of the set of every element, in the order of first elements, and of sets; an element is in one set with those beside it.
fn numbered<const N: usize>(count: u32, beside: impl Fn(u32) -> [u32; N]) -> (Vec<u32>, usize) {
    let (mut numbers, mut sets, mut open) = (vec![NONE; count as usize], 0, Vec::new());
    for first in 0..count {
        if numbers[first as usize] != NONE {
            continue;
        }
        open.push(first);
        while let Some(element) = open.pop() {
            if std::mem::replace(&mut numbers[element as usize], sets) == NONE {
                open.extend(beside(element));
            }
        }
        sets += 1;
    }
    (numbers, sets as usize)
}
