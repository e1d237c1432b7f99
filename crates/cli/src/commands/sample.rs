//! `willmore sample`.

use std::path::Path;

use geometry::{Field, npy, phase_field, vti};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::json;
use surfaces::TriangleMesh;

use crate::cli::SampleOptions;
use crate::error::Error;
use crate::input::{self, Loaded};
use crate::outlet::Outlet;
use crate::run::{self, Ending};
use crate::shape::Region;

/// Interface width in cells of what is written.
const EPS_OVER_H: f64 = 2.0;

/// What can be written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Picture,
    Mesh,
    Npy,
    Vti,
}

impl Kind {
    fn of(path: &Path) -> Result<Self, Error> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        match extension.to_ascii_lowercase().as_str() {
            "png" => Ok(Self::Picture),
            "ply" | "obj" | "stl" => Ok(Self::Mesh),
            "npy" => Ok(Self::Npy),
            "vti" => Ok(Self::Vti),
            _ => Err(Error::options(format!(
                "--save {} must end in .png, .ply, .obj, .stl, .npy or .vti",
                path.display()
            ))),
        }
    }
}

/// Writes an input as the flows begin with it, possibly damaged.
///
/// # Errors
/// [`Error::Options`]; what reading, drawing and writing raise.
pub fn run(options: &SampleOptions) -> Result<Ending, Error> {
    let path = options.save.as_deref().ok_or_else(|| {
        Error::options("sample needs --save FILE, with .png, .ply, .obj, .stl, .npy or .vti")
    })?;
    let kind = Kind::of(path)?;
    if path.exists() {
        return Err(Error::options(format!(
            "{} is there already: remove it, or give another file",
            path.display()
        )));
    }
    let noise = options.noise.unwrap_or(0.0);
    if !(noise.is_finite() && noise >= 0.0) {
        return Err(Error::options(format!(
            "--noise {noise} must not be negative"
        )));
    }
    if noise > 0.0 && kind != Kind::Mesh {
        return Err(Error::options(format!(
            "--noise moves the vertices of meshes: leave it out, or save a mesh in place of {}",
            path.display()
        )));
    }
    let mut input = options.input.clone();
    match input::load(&mut input, EPS_OVER_H, options.say)? {
        Loaded::Plane(start, _) => {
            let u = without(start.field, &options.without)?;
            match kind {
                Kind::Mesh => start.outlet.save(&u, eps(&u), path)?,
                _ => write(&start.outlet, &u, kind, path)?,
            }
        }
        Loaded::Space(start) => {
            let u = without(start.field, &options.without)?;
            match kind {
                Kind::Mesh => {
                    let mut mesh = surfaces::phase_field_surface(&u, eps(&u))?;
                    roughen(&mut mesh, noise, options.seed);
                    surfaces::write(path, &start.outlet.in_own_coordinates(mesh))?;
                }
                _ => write(&start.outlet, &u, kind, path)?,
            }
        }
    }
    run::report(
        options.say,
        &json!({ "command": "sample", "file": path }),
        &format!("wrote {}", path.display()),
    );
    Ok(Ending::Done)
}

fn eps<const D: usize>(u: &Field<D>) -> f64 {
    EPS_OVER_H * u.grid().spacing()
}

/// Writes what needs no mesh.
fn write<const D: usize>(
    outlet: &impl Outlet<D>,
    u: &Field<D>,
    kind: Kind,
    path: &Path,
) -> Result<(), Error> {
    match kind {
        Kind::Npy => npy::write(path, u)?,
        Kind::Vti => vti::write(path, &[("phase_field", u)])?,
        _ => outlet.picture(u, eps(u))?.write_png(path)?,
    }
    Ok(())
}

/// The shape without regions.
fn without<const D: usize>(mut u: Field<D>, regions: &[Region]) -> Result<Field<D>, Error> {
    for region in regions {
        let hole = phase_field(*u.grid(), region.shape::<D>()?.as_ref(), eps(&u))?;
        for (value, hole) in u.values_mut().iter_mut().zip(hole.values()) {
            *value = value.min(-hole);
        }
    }
    input::check_phases(&u, "what --without leaves")?;
    Ok(u)
}

/// Moves every vertex along its normal by up to `noise`, as a scanner errs.
fn roughen(mesh: &mut TriangleMesh, noise: f64, seed: u64) {
    if noise == 0.0 {
        return;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // They are no longer those of the surface.
    let normals = mesh.normals.take().unwrap_or_default();
    for (x, normal) in mesh.vertices.iter_mut().zip(&normals) {
        let length = noise * rng.random_range(-1.0..=1.0);
        *x = std::array::from_fn(|i| length.mul_add(normal[i], x[i]));
    }
}
