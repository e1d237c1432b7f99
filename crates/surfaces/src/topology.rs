//! Parts and holes of closed surfaces.

use geometry::PhaseField;

use crate::Error;
use crate::tetrahedra::{Lattice, LevelSet, Node, Scaled, march};

/// The parts and holes of a closed surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topology {
    /// Number of components.
    pub components: usize,
    /// `V - E + F`, the sum of `2 - 2 g` over the components, of which each has `g` handles.
    pub euler_characteristic: i64,
}

/// The topology of [`phase_field_surface`](crate::phase_field_surface), without the memory of its triangles: four bytes for each vertex.
///
/// # Errors
/// [`geometry::Error::NonFinite`]; [`Error::TooLarge`].
pub fn phase_field_topology(u: &impl PhaseField<3>) -> Result<Topology, Error> {
    u.check_finite()?;
    let lattice = Lattice {
        size: u.nodes().grid().shape(),
        values: &Scaled {
            field: u,
            factor: -1.0,
        },
    };
    let mut count = Count::default();
    march(&lattice, &mut count)?;
    Ok(Topology {
        components: count.components,
        // V - E + F with E = 3/2 F.
        euler_characteristic: count.parents.len() as i64 - count.faces as i64 / 2,
    })
}

/// Numbers of vertices, faces and components; components are sets of vertices, each with a tree.
#[derive(Default)]
struct Count {
    parents: Vec<u32>,
    faces: usize,
    components: usize,
}

impl Count {
    fn root(&mut self, mut vertex: u32) -> u32 {
        loop {
            let parent = self.parents[vertex as usize];
            if parent == vertex {
                return vertex;
            }
            let next = self.parents[parent as usize];
            self.parents[vertex as usize] = next;
            vertex = next;
        }
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            // Numbers grow away from the root.
            self.parents[a.max(b) as usize] = a.min(b);
            self.components -= 1;
        }
    }
}

impl LevelSet for Count {
    fn add_vertex(&mut self, _: [Node; 2]) {
        self.parents.push(self.parents.len() as u32);
        self.components += 1;
    }

    fn add_face(&mut self, [a, b, c]: [u32; 3]) {
        self.faces += 1;
        self.join(a, b);
        self.join(a, c);
    }
}
