//! How the triangles of a closed surface hang together, and operations that keep its topology.

use std::collections::HashMap;

/// What is no longer there.
const NONE: u32 = u32::MAX;

/// A closed oriented surface of triangles. Half-edges `3 f`, `3 f + 1` and `3 f + 2` are the sides of the face `f`, in order.
///
/// The operations keep the surface a manifold, its components and its Euler characteristic, as long as
/// [`can_flip`](Self::can_flip) and [`can_collapse`](Self::can_collapse) are asked before.
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
    /// Of faces that run through every edge once in each direction, and once around every vertex; `None` if they do not pair.
    pub(crate) fn new(vertices: usize, faces: &[[u32; 3]]) -> Option<Self> {
        let origin = faces.as_flattened().to_vec();
        let mut twin = vec![NONE; origin.len()];
        let mut outgoing = vec![NONE; vertices];
        let mut open = HashMap::with_capacity(origin.len() / 2);
        for h in 0..u32::try_from(origin.len()).ok()? {
            let (from, to) = (origin[h as usize], origin[next(h) as usize]);
            outgoing[from as usize] = h;
            if let Some(other) = open.remove(&(to, from)) {
                twin[h as usize] = other;
                twin[other as usize] = h;
            } else if open.insert((from, to), h).is_some() {
                return None;
            }
        }
        open.is_empty().then_some(Self {
            origin,
            twin,
            outgoing,
        })
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
