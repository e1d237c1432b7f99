//! Inputs as files.

use volumes::Volume;

use crate::input::{InitialShape, Loaded, Reader, RepairCells, Source, check_phases, closed};
use crate::options::SampleOptions;
use crate::paths::{MESHES, extension};
use crate::prelude::*;
use crate::presentation::Presentation;

/// Interface width in cells of what is written.
const EPS_OVER_H: f64 = 2.0;
/// The extensions of files besides those of meshes.
const OTHERS: [&str; 6] = ["png", "svg", "npy", "vti", "nii", "gz"];

/// Writes an input as flows begin with it, possibly damaged, to the file of `save`.
///
/// # Errors
/// Refused options or input; a file that cannot be written.
pub fn sample(mut options: SampleOptions, watcher: &dyn Watcher) -> Result<()> {
    let path = options.save.clone();
    let noise = options.noise;
    let is_mesh = check(&options)?;
    let input = &options.input;
    let as_it_is = is_mesh
        && !options.resample
        && options.without.is_empty()
        // Those of a repair are no others.
        && (input.cells.is_none() || input.repair)
        && input.box_side.is_none()
        && input.side_length.is_none();
    let repairs = RepairCells::of(input);
    let mut reader = Reader::of(&mut options.input, EPS_OVER_H, watcher)?;
    if let (Source::Mesh(from), true) = (&reader.source, as_it_is) {
        let mut mesh = if repairs.is_some() {
            closed(from, repairs, watcher)?.into_mesh()
        } else {
            from.mesh()?
        };
        if noise > 0.0 {
            // Those in the file may not be outward.
            mesh.normals = None;
            mesh.roughen(noise, options.seed);
        }
        let up = options.up.map_or_else(|| from.up_axis(), Ok)?;
        return Ok(surfaces::write_with_up(&path, &mesh, up)?);
    }
    let mut loaded = reader.load()?;
    if let Loaded::Space(start) = &mut loaded
        && let Some(voxels) = &mut start.presentation.voxels
    {
        voxels.keeps_volumes = options.without.is_empty();
    }
    match loaded {
        Loaded::Plane(start) => write(start, options, &path)?,
        Loaded::Space(mut start) if noise > 0.0 => {
            start.presentation.turn(&mut options.up)?;
            let u = without(start.initial.field()?, &options.without)?;
            let mut mesh = surfaces::remeshed_surface(&u, eps(&u))?;
            mesh.roughen(noise, options.seed);
            surfaces::write_with_up(&path, &mesh, start.presentation.up)?;
        }
        Loaded::Space(start) => write(start, options, &path)?,
    }
    Ok(())
}

/// Refuses what cannot be written, and says whether it is a mesh.
fn check(options: &SampleOptions) -> Result<bool> {
    let (path, noise) = (&options.save, options.noise);
    let format = extension(path);
    let is_mesh = MESHES.contains(&&*format);
    if !is_mesh && !OTHERS.contains(&&*format) {
        return Err(Refusal::SampleFormat(path.clone()).into());
    }
    options.force.check(path)?;
    if !(noise.is_finite() && noise >= 0.0) {
        return Err(Refusal::NegativeNoise(noise).into());
    }
    if noise > 0.0 && !is_mesh {
        return Err(Refusal::NoiseInNoMesh(path.clone()).into());
    }
    Ok(is_mesh)
}

fn eps<const D: usize>(u: &Field<D>) -> f64 {
    EPS_OVER_H * u.grid().spacing()
}

fn write<const D: usize, O: Presentation<D>>(
    mut start: InitialShape<D, O>,
    mut options: SampleOptions,
    path: &Path,
) -> Result<()> {
    start.presentation.turn(&mut options.up)?;
    let u = without(start.initial.field()?, &options.without)?;
    let eps = eps(&u);
    let format = &*extension(path);
    match format {
        "npy" => npy::write(path, &u)?,
        "nii" | "gz" => volumes::write(path, &segmentation(&u, path)?)?,
        "vti" => vti::write(path, "phase_field", &u)?,
        "png" => {
            let u = u.into();
            let picture = start.presentation.picture(&u, &u, eps)?;
            picture.write_png(path)?;
        }
        _ => {
            O::check_saved(path)?;
            let bytes = start.presentation.encode(&u.into(), eps, format)?;
            files::write_atomically(path, |out| out.write_all(&bytes))?;
        }
    }
    Ok(())
}

/// The nodes inside as voxels labelled 1.
fn segmentation<const D: usize>(u: &Field<D>, path: &Path) -> Result<Volume> {
    let grid = u.grid();
    let Ok(origin) = <[f64; 3]>::try_from(&grid.origin()[..]) else {
        return Err(Refusal::NoVoxels {
            path: path.to_owned(),
            dimension: D,
        }
        .into());
    };
    let cells = grid.cells();
    // The first axis runs fastest.
    let label = |voxel: usize| {
        let digits = std::array::from_fn(|axis| voxel / cells.pow(axis as u32) % cells);
        u8::from(u.values()[grid.index(digits)] > 0.0)
    };
    let labels = (0..grid.len()).map(label).collect();
    let sides = [grid.spacing(); 3];
    Ok(Volume::of_labels([cells; 3], origin, sides, labels)?)
}

fn without<const D: usize>(mut u: Field<D>, regions: &[Region]) -> Result<Field<D>> {
    for region in regions {
        let hole = phase_field(*u.grid(), region.shape::<D>()?.as_ref(), eps(&u))?;
        u = u.zip_map(&hole, |u, hole| u.min(-hole))?;
    }
    check_phases(&u, "the shape that `without` leaves")?;
    Ok(u)
}
