//! Files of walls, with the labels on their sides.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use super::LabelMesh;
use crate::Error;
use crate::format::Format;
use crate::write::{ply_header, ply_vertices};

impl LabelMesh {
    /// The bytes of a file of that name with all walls once; `names` are the labels by their numbers.
    ///
    /// - PLY: faces have the properties `label_behind` and `label_ahead`. The normal of a face points from the first to the second.
    /// - OBJ: the group `labels_A_B` has the faces behind which is the label `A`, and ahead of which is `B`.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`]; [`Error::NoLabels`] for OFF and STL; [`Error::NoFaces`]; [`Error::NonFiniteVertex`].
    pub fn encode(&self, path: impl AsRef<Path>, names: &[i32]) -> Result<Vec<u8>, Error> {
        let path = path.as_ref();
        let format = Format::of(path)?;
        self.mesh.check(f64::MAX)?;
        if self.mesh.faces.is_empty() {
            return Err(Error::NoFaces);
        }
        match format {
            Format::Ply => Ok(self.ply(names)),
            Format::Obj => Ok(self.obj(names).into_bytes()),
            Format::Off | Format::Stl => Err(Error::NoLabels { path: path.into() }),
        }
    }

    fn ply(&self, names: &[i32]) -> Vec<u8> {
        let properties = "property int label_behind\nproperty int label_ahead\n";
        let mut out = ply_header(&self.mesh, "", properties);
        ply_vertices(&self.mesh, &mut out);
        for (face, sides) in self.mesh.faces.iter().zip(&self.sides) {
            out.push(3);
            out.extend(face.iter().flat_map(|vertex| vertex.to_le_bytes()));
            out.extend(
                sides
                    .iter()
                    .flat_map(|&side| names[side as usize].to_le_bytes()),
            );
        }
        out
    }

    fn obj(&self, names: &[i32]) -> String {
        let mut out = String::new();
        // Writing to a string does not fail.
        for [x, y, z] in &self.mesh.vertices {
            let _ = writeln!(out, "v {x} {y} {z}");
        }
        let mut groups: BTreeMap<[u32; 2], Vec<[u32; 3]>> = BTreeMap::new();
        for (face, sides) in self.mesh.faces.iter().zip(&self.sides) {
            groups.entry(*sides).or_default().push(*face);
        }
        for (sides, faces) in groups {
            let [behind, ahead] = sides.map(|side| names[side as usize]);
            let _ = writeln!(out, "g labels_{behind}_{ahead}");
            for face in faces {
                // Counted from one.
                let [a, b, c] = face.map(|v| u64::from(v) + 1);
                let _ = writeln!(out, "f {a} {b} {c}");
            }
        }
        out
    }
}
