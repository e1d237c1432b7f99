//! Inputs as phase fields.

use std::path::{Path, PathBuf};

use geometry::npy::{self, NpyError};
use geometry::vti::{self, VtiError};
use geometry::{Field, Grid, Placement, SignedDistance, optimal_profile, phase_field};
use images::{Frame, Image, Outline, OutlineDistance, Side, Threshold};
use surfaces::{ClosedMesh, MeshDistance};

use crate::cli::{Ansatz, Holds, InputOptions, Inside, SayOptions};
use crate::error::Error;
use crate::outlet::{Plane, Space};
use crate::run;
use crate::shape::{self, BuiltIn, Region};
use crate::signs;

/// What a run starts from.
pub struct Start<const D: usize, O> {
    /// Name for the folder of the run.
    pub name: String,
    /// The phase field.
    pub field: Field<D>,
    /// How it is shown.
    pub outlet: O,
    /// The nodes that move, if not all.
    pub region: Option<Vec<bool>>,
}

/// What a run starts from, in the dimension of the input.
pub enum Loaded {
    /// In the plane.
    Plane(Start<2, Plane>, ImageFrame),
    /// In space.
    Space(Start<3, Space>),
}

/// The image that a mask has to fit.
pub struct ImageFrame {
    /// Pixels of the input, if it is an image.
    size: Option<[u32; 2]>,
    /// Longest side in the box.
    side: f64,
}

enum Source<'a> {
    Mesh(PathBuf),
    Image(PathBuf),
    Field(PathBuf),
    BuiltIn(&'a str),
    Region(Region),
}

/// Least resolution.
const FEWEST_CELLS: usize = 8;
/// Most nodes of a grid: beyond, a flow needs more than 100 GiB.
const MOST_NODES: f64 = 1e9;
/// Part of the box that a shape takes: flows make shapes round, and curves grow.
const PART: f64 = 0.6;
/// Largest magnitude in a phase field: flows overshoot the phases a little.
const LARGEST_PHASE: f64 = 1.1;
/// Pixels a side of pictures of boxes.
const PIXELS: u32 = 512;

impl Source<'_> {
    fn of(input: &str) -> Result<Source<'_>, Error> {
        if let Some(name) = input.strip_prefix("builtin:") {
            return Ok(Source::BuiltIn(name));
        }
        if Region::is_meant(input) {
            return Ok(Source::Region(input.parse().map_err(Error::Options)?));
        }
        let path = std::path::absolute(input).map_err(|source| Error::Io {
            action: "find",
            path: input.into(),
            source,
        })?;
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        let source = match extension.to_ascii_lowercase().as_str() {
            "obj" | "stl" | "ply" => Source::Mesh(path),
            "png" | "jpg" | "jpeg" => Source::Image(path),
            "npy" | "vti" => Source::Field(path),
            _ => {
                return Err(Error::options(format!(
                    "{input} is no input: give a mesh (.obj, .stl, .ply), an image (.png, .jpg), a field (.npy, .vti), \
                     builtin:NAME, or a region as box:... or ball:..."
                )));
            }
        };
        Ok(source)
    }
}

/// Reads the input and fills in the options that were left to it.
///
/// # Errors
/// [`Error::Options`] for options that do not belong to the input; what reading and placing raise.
pub fn load(options: &mut InputOptions, eps_over_h: f64, say: SayOptions) -> Result<Loaded, Error> {
    let input = options.input.clone().ok_or_else(|| {
        Error::options(
            "there is no input: give a file or builtin:NAME, or `input = ...` in a --config file",
        )
    })?;
    let source = Source::of(&input)?;
    refuse_foreign(options, &source)?;
    let name = match &source {
        Source::BuiltIn(name) => (*name).to_owned(),
        Source::Region(region) => region.name().to_owned(),
        Source::Mesh(path) | Source::Image(path) | Source::Field(path) => {
            options.input = Some(path.to_string_lossy().into_owned());
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            stem.chars()
                .map(|c| {
                    if c.is_ascii_alphanumeric() || "-_".contains(c) {
                        c
                    } else {
                        '_'
                    }
                })
                .collect()
        }
    };
    let loaded = match source {
        Source::Mesh(path) => {
            let (mesh, warnings) = ClosedMesh::new(surfaces::read(&path)?)?;
            for warning in &warnings {
                warn(say, &format!("{}: {warning}", path.display()));
            }
            Loaded::Space(place(&mesh, options, eps_over_h, name, say)?)
        }
        Source::Image(path) => image(&path, options, eps_over_h, name)?,
        Source::Field(path) => field(&path, options, eps_over_h, name)?,
        Source::Region(region) if region.dimension() == 2 => {
            let grid = bare_grid::<2>(options, 128, 2.0)?;
            plane(name, grid, region.shape::<2>()?.as_ref(), eps_over_h)?
        }
        Source::Region(region) => {
            let grid = bare_grid::<3>(options, 64, 1.0)?;
            space(name, grid, region.shape::<3>()?.as_ref(), eps_over_h)?
        }
        Source::BuiltIn(known) => match shape::dimension(known)? {
            2 => {
                let (grid, side) = grid::<2>(options, 128, 2.0)?;
                match shape::built_in(known, side)? {
                    BuiltIn::Plane(shape) => plane(name, grid, shape.as_ref(), eps_over_h)?,
                    _ => return Err(Error::options("this shape is not in the plane")),
                }
            }
            _ => {
                let (grid, side) = grid::<3>(options, 64, 1.0)?;
                match shape::built_in(known, side)? {
                    BuiltIn::Mesh(mesh) => {
                        Loaded::Space(place(&mesh, options, eps_over_h, name, say)?)
                    }
                    BuiltIn::Space(shape) => space(name, grid, shape.as_ref(), eps_over_h)?,
                    BuiltIn::Plane(_) => return Err(Error::options("this shape is in the plane")),
                }
            }
        },
    };
    match &loaded {
        Loaded::Plane(start, _) => check_phases(&start.field, &input)?,
        Loaded::Space(start) => check_phases(&start.field, &input)?,
    }
    Ok(loaded)
}

/// Says what was mended.
fn warn(say: SayOptions, what: &str) {
    if !say.quiet {
        eprintln!("warning: {what}");
    }
}

/// Options that say nothing about this input.
fn refuse_foreign(options: &InputOptions, source: &Source<'_>) -> Result<(), Error> {
    let (what, is_image, is_field) = match source {
        Source::Mesh(_) => ("a mesh", false, false),
        Source::Image(_) => ("an image", true, false),
        Source::Field(_) => ("a field", false, true),
        Source::BuiltIn(_) => ("a built-in shape", false, false),
        Source::Region(_) => ("a region", false, false),
    };
    let is_region = matches!(source, Source::Region(_));
    let is_vti = matches!(source, Source::Field(path) if has_extension(path, "vti"));
    for (name, given, allowed) in [
        ("--inside", options.inside.is_some(), is_image),
        ("--threshold", options.threshold.is_some(), is_image),
        ("--holds", options.holds.is_some(), is_field),
        (
            "--side-length",
            options.side_length.is_some(),
            !is_field && !is_region,
        ),
        ("--cells", options.cells.is_some(), !is_field),
        ("--box-side", options.box_side.is_some(), !is_vti),
    ] {
        if given && !allowed {
            return Err(Error::options(format!(
                "{name} has no meaning for {what}: leave it out"
            )));
        }
    }
    Ok(())
}

/// The grid about 0, and the longest side of what is in it.
fn grid<const D: usize>(
    options: &mut InputOptions,
    cells: usize,
    box_side: f64,
) -> Result<(Grid<D>, f64), Error> {
    let grid = bare_grid(options, cells, box_side)?;
    let box_side = grid.side();
    let side = *options.side_length.get_or_insert(PART * box_side);
    if !(side > 0.0 && side <= box_side) {
        return Err(Error::options(format!(
            "--side-length {side} does not fit the box of side {box_side}: give a positive length of at most that"
        )));
    }
    Ok((grid, side))
}

/// The grid about 0.
fn bare_grid<const D: usize>(
    options: &mut InputOptions,
    cells: usize,
    box_side: f64,
) -> Result<Grid<D>, Error> {
    let cells = *options.cells.get_or_insert(cells);
    if cells < FEWEST_CELLS {
        return Err(Error::options(format!(
            "--cells {cells} resolves nothing: use at least {FEWEST_CELLS} per unit length"
        )));
    }
    let box_side = *options.box_side.get_or_insert(box_side);
    let grid = Grid::<D>::per_unit(cells, box_side)?.with_origin([-0.5 * box_side; D])?;
    let nodes = (grid.cells() as f64).powi(D as i32);
    if nodes > MOST_NODES {
        return Err(Error::options(format!(
            "--cells {cells} makes {nodes:.1e} nodes in a box of side {box_side}, more than {MOST_NODES:.1e}: use fewer"
        )));
    }
    Ok(grid)
}

fn space(
    name: String,
    grid: Grid<3>,
    shape: &(impl SignedDistance<3> + ?Sized),
    eps_over_h: f64,
) -> Result<Loaded, Error> {
    Ok(Loaded::Space(Start {
        name,
        field: phase_field(grid, shape, eps_over_h * grid.spacing())?,
        outlet: Space::identity(),
        region: None,
    }))
}

fn plane(
    name: String,
    grid: Grid<2>,
    shape: &(impl SignedDistance<2> + ?Sized),
    eps_over_h: f64,
) -> Result<Loaded, Error> {
    let start = Start {
        name,
        field: phase_field(grid, shape, eps_over_h * grid.spacing())?,
        outlet: Plane::new(&Frame::of_box(&grid, PIXELS)?),
        region: None,
    };
    let side = grid.side();
    Ok(Loaded::Plane(start, ImageFrame { size: None, side }))
}

fn image(
    path: &Path,
    options: &mut InputOptions,
    eps_over_h: f64,
    name: String,
) -> Result<Loaded, Error> {
    let (grid, side) = grid::<2>(options, 128, 2.0)?;
    let image = images::read(path)?;
    let inside = match options.inside {
        None | Some(Inside::Auto) => images::Inside::Auto,
        Some(Inside::Dark) => images::Inside::Dark,
        Some(Inside::Light) => images::Inside::Light,
    };
    let threshold = options
        .threshold
        .map_or_else(Threshold::default, Threshold::At);
    let outline = Outline::of_image(&image, Side::of(&image, inside, threshold)?)?;
    let placement = Placement::fit(&image.bounding_box(), &grid, side, 0.0)?;
    let distance = OutlineDistance::new(&outline.placed(&placement));
    let start = Start {
        name,
        field: phase_field(grid, &distance, eps_over_h * grid.spacing())?,
        outlet: Plane::new(&Frame::of_image(&image, &placement)?),
        region: None,
    };
    let size = Some([image.width(), image.height()]);
    Ok(Loaded::Plane(start, ImageFrame { size, side }))
}

fn place(
    mesh: &ClosedMesh,
    options: &mut InputOptions,
    eps_over_h: f64,
    name: String,
    say: SayOptions,
) -> Result<Start<3, Space>, Error> {
    let (grid, side) = grid::<3>(options, 64, 1.0)?;
    let placement = Placement::fit(&mesh.bounding_box(), &grid, side, 0.0)?;
    let progress = run::progress(say);
    let bar = progress.bar("signed distance", grid.cells() as u64);
    let mut distance = MeshDistance::new(&mesh.placed(&placement)).sample(grid, || bar.inc(1))?;
    bar.finish();
    progress.clear();
    let mended = signs::mend(&mut distance);
    if mended > 0 {
        let what = format!("the mesh folds over itself; the side of {mended} nodes was mended");
        warn(say, &what);
    }
    let eps = eps_over_h * grid.spacing();
    Ok(Start {
        name,
        field: distance.map(|s| optimal_profile(s, eps)),
        outlet: Space::of(&placement),
        region: None,
    })
}

fn has_extension(path: &Path, wanted: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(wanted))
}

fn field(
    path: &Path,
    options: &mut InputOptions,
    eps_over_h: f64,
    name: String,
) -> Result<Loaded, Error> {
    let holds = *options.holds.get_or_insert(Holds::PhaseField);
    if is_planar(path)? {
        let field = values::<2>(path, options, 2.0, holds, eps_over_h)?;
        let grid = *field.grid();
        let start = Start {
            name,
            field,
            outlet: Plane::new(&Frame::of_box(&grid, PIXELS)?),
            region: None,
        };
        let side = grid.side();
        return Ok(Loaded::Plane(start, ImageFrame { size: None, side }));
    }
    Ok(Loaded::Space(Start {
        name,
        field: values::<3>(path, options, 1.0, holds, eps_over_h)?,
        outlet: Space::identity(),
        region: None,
    }))
}

/// Whether a file of values is meant to be in the plane; its reader says what is wrong with it.
fn is_planar(path: &Path) -> Result<bool, Error> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io {
        action: "read",
        path: path.to_owned(),
        source,
    })?;
    Ok(if has_extension(path, "vti") {
        let layers = |nodes: [u64; 3]| nodes[2] > 1;
        !matches!(vti::decode::<2>(&bytes), Err(VtiError::NotCubical { nodes, .. }) if layers(nodes))
    } else {
        !matches!(npy::decode::<2>(&bytes), Err(NpyError::Rank { .. }))
    })
}

fn values<const D: usize>(
    path: &Path,
    options: &mut InputOptions,
    box_side: f64,
    holds: Holds,
    eps_over_h: f64,
) -> Result<Field<D>, Error> {
    let field = if has_extension(path, "vti") {
        let mut arrays = vti::read::<D>(path)?;
        arrays.swap_remove(0).1
    } else {
        let side = *options.box_side.get_or_insert(box_side);
        npy::read(path, |cells| Grid::centred(cells, side))?
    };
    let eps = eps_over_h * field.grid().spacing();
    if holds == Holds::Distance {
        return Ok(field.map(|s| optimal_profile(s, eps)));
    }
    match field.values().iter().find(|u| u.abs() > LARGEST_PHASE) {
        None => Ok(field),
        Some(value) => Err(Error::options(format!(
            "{} holds the value {value}, which no phase field has; give --holds distance if these are signed distances",
            path.display()
        ))),
    }
}

/// Refuses shapes of which there is nothing on the grid, or nothing else.
///
/// # Errors
/// [`Error::Options`].
pub fn check_phases<const D: usize>(field: &Field<D>, input: &str) -> Result<(), Error> {
    let inside = field.values().iter().filter(|u| **u > 0.0).count();
    let nodes = field.grid().len();
    if inside == 0 || inside == nodes {
        return Err(Error::options(format!(
            "{input} has {inside} of {nodes} nodes inside, so that there is nothing to move: use more --cells, or another size"
        )));
    }
    Ok(())
}

impl ImageFrame {
    /// The nodes inside the mask, as a region or an image.
    ///
    /// # Errors
    /// [`Error::Options`] for an image of another size than the input; what reading raises.
    pub fn mask(&self, mask: &str, grid: &Grid<2>) -> Result<Vec<bool>, Error> {
        if Region::is_meant(mask) {
            return nodes(mask, grid);
        }
        let image: Image = images::read(mask)?;
        let size = [image.width(), image.height()];
        let fits = self.size.map_or(size[0] == size[1], |input| input == size);
        if !fits {
            let needed = self
                .size
                .map_or("a square, which fills the box".to_owned(), |[w, h]| {
                    format!("{w} x {h} pixels, as the input")
                });
            return Err(Error::options(format!(
                "--mask {mask} has {} x {} pixels; it must be {needed}",
                size[0], size[1]
            )));
        }
        let side = Side::of(&image, images::Inside::Auto, Threshold::default())?;
        let placement = Placement::fit(&image.bounding_box(), grid, self.side, 0.0)?;
        let outline = Outline::of_image(&image, side)?.placed(&placement);
        let mask = images::Mask::new(*grid, &OutlineDistance::new(&outline))?;
        Ok(mask.nodes().to_vec())
    }
}

/// The nodes inside a region.
///
/// # Errors
/// [`Error::Options`] if it is no region, or if no node is inside.
pub fn nodes<const D: usize>(mask: &str, grid: &Grid<D>) -> Result<Vec<bool>, Error> {
    if !Region::is_meant(mask) {
        return Err(Error::options(format!(
            "--mask {mask} is no region in {D}D: give box:... or ball:..."
        )));
    }
    let region: Region = mask
        .parse()
        .map_err(|reason| Error::options(format!("--mask: {reason}")))?;
    let shape = region.shape::<D>()?;
    let nodes: Vec<bool> = (0..grid.len())
        .map(|i| shape.signed_distance(grid.node(i)) < 0.0)
        .collect();
    if !nodes.contains(&true) {
        let (low, side) = (grid.origin(), grid.side());
        return Err(Error::options(format!(
            "--mask {mask} contains no node of the box from {low:?} of side {side}: nothing could move"
        )));
    }
    Ok(nodes)
}

/// The phase field with the ansatz in the region.
///
/// # Errors
/// As [`Region::shape`].
pub fn with_ansatz<const D: usize>(
    field: Field<D>,
    region: &[bool],
    ansatz: &Ansatz,
    eps: f64,
) -> Result<Field<D>, Error> {
    let inner = match ansatz {
        Ansatz::Keep => return Ok(field),
        Ansatz::Empty => Field::constant(*field.grid(), -1.0),
        Ansatz::Full => Field::constant(*field.grid(), 1.0),
        Ansatz::Shape(shape) => phase_field(*field.grid(), shape.shape::<D>()?.as_ref(), eps)?,
    };
    let mut field = field;
    let values = field.values_mut().iter_mut().zip(inner.values());
    for ((value, inner), _) in values.zip(region).filter(|(_, inside)| **inside) {
        *value = *inner;
    }
    Ok(field)
}
