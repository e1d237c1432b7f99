//! Parts and holes of closed surfaces.

use geometry::PhaseField;

use crate::Error;
use crate::joined::Joined;
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
        euler_characteristic: count.vertices.len() as i64 - count.faces as i64 / 2,
    })
}

/// Numbers of faces and components, and the components as sets of vertices.
#[derive(Default)]
struct Count {
    vertices: Joined,
    faces: usize,
    components: usize,
}

impl Count {
    fn join(&mut self, a: u32, b: u32) {
        self.components -= usize::from(self.vertices.join(a as usize, b as usize));
    }
}

impl LevelSet for Count {
    fn add_vertex(&mut self, _: [Node; 2]) {
        self.vertices.push();
        self.components += 1;
    }

    fn add_face(&mut self, [a, b, c]: [u32; 3]) {
        self.faces += 1;
        self.join(a, b);
        self.join(a, c);
    }
}
