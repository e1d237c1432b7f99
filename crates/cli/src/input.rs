//! Inputs as phase fields.

use std::path::{Path, PathBuf};

use geometry::npy::{self, NpyError};
use geometry::vti::{self, VtiError};
use geometry::{Field, Grid, Placement, SignedDistance, UpAxis, optimal_profile, phase_field};
use images::{Frame, Image, Outline, OutlineDistance, Side, Threshold};
use surfaces::shapes::{self, BuiltIn, Region};
use surfaces::{ClosedMesh, MeshDistance};

use crate::cli::{Holds, InputOptions, Inside, SayOptions};
use crate::error::Error;
use crate::outlet::{Outlet, Space, Topology};
use crate::own::OwnMesh;

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
    Plane(Start<2, Frame>, ImageFrame),
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
/// Cells per unit length from which a mesh whose vertices follow the flow gets the first that hold it,
const OWN_CELLS: [usize; 3] = [128, 160, 192];
/// and the part of the box that it takes: it moves by little.
const OWN_PART: f64 = 0.9;
/// Memory of a flow, measured at 128 and 192 cells.
const BYTES_PER_NODE: f64 = 300.0;
/// Largest magnitude in a phase field: flows overshoot the phases a little.
const LARGEST_PHASE: f64 = 1.1;
/// Pixels a side of pictures of boxes.
const PIXELS: u32 = 512;

/// The path of a file from wherever the program may run later.
pub fn absolute(path: impl AsRef<Path>) -> Result<PathBuf, Error> {
    let path = path.as_ref();
    std::path::absolute(path).map_err(Error::io("find", path))
}

/// The extension of a file in lower case.
pub fn extension(path: &Path) -> String {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    extension.to_ascii_lowercase()
}

/// Reads the input and fills in the options that were left to it.
pub fn load(options: &mut InputOptions, eps_over_h: f64, say: SayOptions) -> Result<Loaded, Error> {
    let input = options.input.clone().ok_or_else(|| {
        Error::options(
            "there is no input: give a file or builtin:NAME, or `input = ...` in a --config file",
        )
    })?;
    let source = Source::of(&input)?;
    source.refuse_foreign(options)?;
    if let Source::Mesh(path) | Source::Image(path) | Source::Field(path) = &source {
        options.input = Some(path.to_string_lossy().into_owned());
    }
    let mut reader = Reader {
        name: source.name(),
        options,
        eps_over_h,
        say,
    };
    let loaded = reader.load(source)?;
    match &loaded {
        Loaded::Plane(start, _) => check_phases(&start.field, &input)?,
        Loaded::Space(start) => check_phases(&start.field, &input)?,
    }
    Ok(loaded)
}

/// The path of the input if it is the file of a mesh, from wherever the program may run later.
pub fn mesh_file(options: &mut InputOptions) -> Result<Option<PathBuf>, Error> {
    let Some(input) = &options.input else {
        return Ok(None);
    };
    Ok(match Source::of(input)? {
        Source::Mesh(path) => {
            options.input = Some(path.to_string_lossy().into_owned());
            Some(path)
        }
        _ => None,
    })
}

/// A mesh whose vertices follow the flow, on the coarsest grid that holds its parts and holes.
pub fn load_own(
    options: &mut InputOptions,
    own: OwnMesh,
    path: &Path,
    (eps_over_h, allow_loss): (f64, bool),
    say: SayOptions,
) -> Result<Loaded, Error> {
    let source = Source::Mesh(path.to_owned());
    source.refuse_foreign(options)?;
    let grids = options
        .cells
        .map_or(OWN_CELLS.to_vec(), |cells| vec![cells]);
    let up = surfaces::usual_up_axis(path)?;
    let mut reader = Reader {
        name: source.name(),
        options,
        eps_over_h,
        say,
    };
    let (mut start, mut found) = (None, Topology::default());
    for cells in grids {
        reader.options.cells = Some(cells);
        let grid = reader.grid::<3>()?;
        let side = reader.longest(OWN_PART, grid.side())?;
        let eps = eps_over_h * grid.spacing();
        let placement = Placement::fit(&own.fairing().start().bounding_box(), &grid, side, 0.0)?;
        let field = reader.mesh_field(own.fairing().start(), &placement, grid)?;
        let space = Space::of(&placement, up);
        // Touching sheets have no topology.
        found = space.topology(&field, eps).unwrap_or_default();
        start = Some((field, space, cells));
        if found == own.topology() {
            break;
        }
    }
    let Some((field, mut space, cells)) = start else {
        return Err(Error::options("there is no grid to choose from"));
    };
    if found != own.topology() {
        let thin = 2.0 * field.grid().spacing() * space.unit();
        let message = format!(
            "with --cells {cells} parts and gaps thinner than {thin:.3e} ({:.2} % of the longest side) are lost: the mesh has {}, \
             the grid {found}",
            100.0 * thin / own.longest_side(),
            own.topology(),
        );
        if !allow_loss {
            return Err(Error::options(format!(
                "{message}; use more --cells, or --allow-loss to go on without them"
            )));
        }
        say.warn(&message);
    }
    say.note(&format!(
        "grid: {cells} cells per unit length, {:.3e} wide (--cells); about {:.1} GB of memory",
        field.grid().spacing() * space.unit(),
        BYTES_PER_NODE * field.grid().len() as f64 * 1e-9,
    ));
    let region = own.nodes(&field, &space)?;
    space.own = Some(own);
    Ok(Loaded::Space(Start {
        name: reader.name,
        field,
        outlet: space,
        region,
    }))
}

impl Source<'_> {
    fn of(input: &str) -> Result<Source<'_>, Error> {
        if let Some(name) = input.strip_prefix("builtin:") {
            return Ok(Source::BuiltIn(name));
        }
        if Region::is_meant(input) {
            return Ok(Source::Region(input.parse().map_err(Error::Options)?));
        }
        let path = absolute(input)?;
        match &*extension(&path) {
            "obj" | "stl" | "ply" => Ok(Source::Mesh(path)),
            "png" | "jpg" | "jpeg" | "webp" | "gif" | "tif" | "tiff" | "bmp" => {
                Ok(Source::Image(path))
            }
            "npy" | "vti" => Ok(Source::Field(path)),
            _ => Err(Error::options(format!(
                "{input} is no input: give a mesh (.obj, .stl, .ply), an image (.png, .jpg, .webp, .gif, .tif, .bmp), \
                 a field (.npy, .vti), builtin:NAME, or a region as box:... or ball:..."
            ))),
        }
    }

    /// A name for folders.
    fn name(&self) -> String {
        let path = match self {
            Self::BuiltIn(name) => return (*name).to_owned(),
            Self::Region(region) => return region.name().to_owned(),
            Self::Mesh(path) | Self::Image(path) | Self::Field(path) => path,
        };
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let other = |c: char| !(c.is_ascii_alphanumeric() || "-_".contains(c));
        stem.replace(other, "_")
    }

    /// Options that say nothing about this input.
    fn refuse_foreign(&self, options: &InputOptions) -> Result<(), Error> {
        let what = match self {
            Self::Mesh(_) => "a mesh",
            Self::Image(_) => "an image",
            Self::Field(_) => "a field",
            Self::BuiltIn(_) => "a built-in shape",
            Self::Region(_) => "a region",
        };
        let is_image = matches!(self, Self::Image(_));
        let is_field = matches!(self, Self::Field(_));
        let is_vti = matches!(self, Self::Field(path) if extension(path) == "vti");
        let has_side = !is_field && !matches!(self, Self::Region(_));
        for (name, given, allowed) in [
            ("--inside", options.inside.is_some(), is_image),
            ("--threshold", options.threshold.is_some(), is_image),
            ("--holds", options.holds.is_some(), is_field),
            ("--side-length", options.side_length.is_some(), has_side),
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
}

/// What inputs are read with.
struct Reader<'a> {
    name: String,
    options: &'a mut InputOptions,
    eps_over_h: f64,
    say: SayOptions,
}

/// Cells per unit length and side of the box, unless they are chosen.
fn usual_box<const D: usize>() -> (usize, f64) {
    if D == 2 { (128, 2.0) } else { (64, 1.0) }
}

impl Reader<'_> {
    fn load(&mut self, source: Source<'_>) -> Result<Loaded, Error> {
        match source {
            Source::Mesh(path) => {
                let (mesh, warnings) = ClosedMesh::new(surfaces::read(&path)?)?;
                for warning in &warnings {
                    self.say.warn(&format!("{}: {warning}", path.display()));
                }
                self.mesh(&mesh, surfaces::usual_up_axis(&path)?)
            }
            Source::Image(path) => self.image(&path),
            Source::Field(path) if is_planar(&path)? => {
                let field = self.values(&path)?;
                self.plane(field)
            }
            Source::Field(path) => {
                let field = self.values(&path)?;
                Ok(self.space(field))
            }
            Source::Region(region) if region.dimension() == 2 => {
                let grid = self.grid()?;
                self.plane(self.sampled(grid, region.shape::<2>()?.as_ref())?)
            }
            Source::Region(region) => {
                let grid = self.grid()?;
                Ok(self.space(self.sampled(grid, region.shape::<3>()?.as_ref())?))
            }
            Source::BuiltIn(name) => self.built_in(name),
        }
    }

    /// The grid about 0.
    fn grid<const D: usize>(&mut self) -> Result<Grid<D>, Error> {
        let (cells, box_side) = usual_box::<D>();
        let cells = *self.options.cells.get_or_insert(cells);
        if cells < FEWEST_CELLS {
            return Err(Error::options(format!(
                "--cells {cells} resolves nothing: use at least {FEWEST_CELLS} per unit length"
            )));
        }
        let box_side = *self.options.box_side.get_or_insert(box_side);
        let grid = Grid::<D>::per_unit(cells, box_side)?.with_origin([-0.5 * box_side; D])?;
        let nodes = (grid.cells() as f64).powi(D as i32);
        if nodes > MOST_NODES {
            return Err(Error::options(format!(
                "--cells {cells} makes {nodes:.1e} nodes in a box of side {box_side}, more than {MOST_NODES:.1e}: use fewer"
            )));
        }
        Ok(grid)
    }

    /// The longest side of what is in the box.
    fn side(&mut self, box_side: f64) -> Result<f64, Error> {
        self.longest(PART, box_side)
    }

    /// The longest side, a part of the box unless it is chosen.
    fn longest(&mut self, part: f64, box_side: f64) -> Result<f64, Error> {
        let side = *self.options.side_length.get_or_insert(part * box_side);
        if !(side > 0.0 && side <= box_side) {
            return Err(Error::options(format!(
                "--side-length {side} does not fit the box of side {box_side}: give a positive length of at most that"
            )));
        }
        Ok(side)
    }

    fn sampled<const D: usize>(
        &self,
        grid: Grid<D>,
        shape: &(impl SignedDistance<D> + ?Sized),
    ) -> Result<Field<D>, Error> {
        let eps = self.eps_over_h * grid.spacing();
        Ok(phase_field(grid, shape, eps)?)
    }

    fn space(&self, field: Field<3>) -> Loaded {
        self.placed(field, Space::identity())
    }

    fn placed(&self, field: Field<3>, outlet: Space) -> Loaded {
        Loaded::Space(Start {
            name: self.name.clone(),
            field,
            outlet,
            region: None,
        })
    }

    fn plane(&self, field: Field<2>) -> Result<Loaded, Error> {
        let frame = Frame::of_box(field.grid(), PIXELS)?;
        let side = field.grid().side();
        Ok(self.framed(field, frame, ImageFrame { size: None, side }))
    }

    fn framed(&self, field: Field<2>, frame: Frame, of_image: ImageFrame) -> Loaded {
        let start = Start {
            name: self.name.clone(),
            field,
            outlet: frame,
            region: None,
        };
        Loaded::Plane(start, of_image)
    }

    fn built_in(&mut self, name: &str) -> Result<Loaded, Error> {
        if shapes::dimension(name)? == 2 {
            let grid = self.grid::<2>()?;
            let shape = shapes::built_in(name, self.side(grid.side())?)?;
            let BuiltIn::Plane(shape) = shape else {
                return Err(Error::options(format!("{name} is not in the plane")));
            };
            return self.plane(self.sampled(grid, shape.as_ref())?);
        }
        let grid = self.grid::<3>()?;
        match shapes::built_in(name, self.side(grid.side())?)? {
            BuiltIn::Mesh(mesh) => self.mesh(&mesh, UpAxis::default()),
            BuiltIn::Space(shape) => Ok(self.space(self.sampled(grid, shape.as_ref())?)),
            BuiltIn::Plane(_) => Err(Error::options(format!("{name} is in the plane"))),
        }
    }

    fn image(&mut self, path: &Path) -> Result<Loaded, Error> {
        let grid = self.grid::<2>()?;
        let side = self.side(grid.side())?;
        let image = images::read(path)?;
        let inside = match self.options.inside {
            None | Some(Inside::Auto) => images::Inside::Auto,
            Some(Inside::Dark) => images::Inside::Dark,
            Some(Inside::Light) => images::Inside::Light,
        };
        let threshold = (self.options.threshold).map_or_else(Threshold::default, Threshold::At);
        let outline = Outline::of_image(&image, Side::of(&image, inside, threshold)?)?;
        let placement = Placement::fit(&image.bounding_box(), &grid, side, 0.0)?;
        let distance = OutlineDistance::new(&outline.placed(&placement));
        let size = Some([image.width(), image.height()]);
        Ok(self.framed(
            self.sampled(grid, &distance)?,
            Frame::of_image(&image, &placement)?,
            ImageFrame { size, side },
        ))
    }

    fn mesh(&mut self, mesh: &ClosedMesh, up: UpAxis) -> Result<Loaded, Error> {
        let grid = self.grid::<3>()?;
        let side = self.side(grid.side())?;
        let placement = Placement::fit(&mesh.bounding_box(), &grid, side, 0.0)?;
        let field = self.mesh_field(mesh, &placement, grid)?;
        Ok(self.placed(field, Space::of(&placement, up)))
    }

    fn mesh_field(
        &self,
        mesh: &ClosedMesh,
        placement: &Placement<3>,
        grid: Grid<3>,
    ) -> Result<Field<3>, Error> {
        let progress = self.say.progress();
        let bar = progress.bar("signed distance", grid.cells() as u64);
        let distance = MeshDistance::new(&mesh.placed(placement));
        let mut distance = distance.sample(grid, || bar.inc(1))?;
        bar.finish();
        progress.clear();
        let mended = surfaces::mend_signs(&mut distance);
        if mended > 0 {
            self.say.warn(&format!(
                "the mesh crosses itself: {mended} nodes of the grid, which its faces put on the wrong side, were put right"
            ));
        }
        let eps = self.eps_over_h * grid.spacing();
        Ok(distance.map(|s| optimal_profile(s, eps)))
    }

    fn values<const D: usize>(&mut self, path: &Path) -> Result<Field<D>, Error> {
        let holds = *self.options.holds.get_or_insert(Holds::PhaseField);
        let field = if extension(path) == "vti" {
            let mut arrays = vti::read::<D>(path)?;
            arrays.swap_remove(0).1
        } else {
            let (_, side) = usual_box::<D>();
            let side = *self.options.box_side.get_or_insert(side);
            npy::read(path, |cells| Grid::centred(cells, side))?
        };
        if holds == Holds::Distance {
            let eps = self.eps_over_h * field.grid().spacing();
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
}

/// Whether a file of values is meant to be in the plane; its reader says what is wrong with it.
fn is_planar(path: &Path) -> Result<bool, Error> {
    let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
    Ok(if extension(path) == "vti" {
        let layers = |nodes: [u64; 3]| nodes[2] > 1;
        !matches!(vti::decode::<2>(&bytes), Err(VtiError::NotCubical { nodes, .. }) if layers(nodes))
    } else {
        !matches!(npy::decode::<2>(&bytes), Err(NpyError::Rank { .. }))
    })
}

/// Refuses shapes of which there is nothing on the grid, or nothing else.
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
    /// The nodes inside the mask, which is a region, or an image of the size of the input.
    pub fn mask(&self, mask: &str, grid: &Grid<2>) -> Result<Vec<bool>, Error> {
        if Region::is_meant(mask) {
            return nodes(mask, grid);
        }
        let image: Image = images::read(mask)?;
        let size = [image.width(), image.height()];
        let needed = match self.size {
            None if size[0] != size[1] => Some("a square, which fills the box".to_owned()),
            Some([w, h]) if size != [w, h] => Some(format!("{w} x {h} pixels, as the input")),
            _ => None,
        };
        if let Some(needed) = needed {
            return Err(Error::options(format!(
                "--mask {mask} has {} x {} pixels; it must be {needed}",
                size[0], size[1]
            )));
        }
        let side = Side::of(&image, images::Inside::Auto, Threshold::default())?;
        let placement = Placement::fit(&image.bounding_box(), grid, self.side, 0.0)?;
        let outline = Outline::of_image(&image, side)?.placed(&placement);
        Ok(images::mask(*grid, &OutlineDistance::new(&outline))?)
    }
}

/// The nodes inside a region.
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
