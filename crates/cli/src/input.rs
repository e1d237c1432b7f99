//! Inputs as phase fields.

use geometry::npy::{self, NpyError};
use geometry::{PURE_BEYOND, distance_from_phase_field, thin_part};
use images::{Frame, Image, Outline, OutlineDistance, Side, Threshold, Tones};
use surfaces::hausdorff_distance;
use surfaces::shapes::{self, BuiltIn};

use crate::cli::{Holds, Inside};
use crate::prelude::*;
use crate::volume::{self, Voxels};

/// What a run starts from.
pub struct Start<const D: usize, O> {
    pub name: String,
    pub field: Field<D>,
    pub outlet: O,
    /// The nodes that move, if not all.
    pub region: Option<Vec<bool>>,
}

/// What a run starts from, in the dimension of the input.
pub enum Loaded {
    Plane(Start<2, Plane>, ImageFrame),
    Space(Start<3, Space>),
}

/// The image that a mask has to fit, and that is repaired: the input, if it is one.
pub struct ImageFrame(Option<(PathBuf, [u32; 2])>);

enum Source<'a> {
    Mesh(PathBuf),
    Image(PathBuf),
    Field(PathBuf),
    Volume(PathBuf),
    BuiltIn(&'a str),
    Region(Region),
}

const FEWEST_CELLS: usize = 8;
/// Most nodes of a grid: beyond, each field takes more than 8 GB.
const MOST_NODES: f64 = 1e9;
/// Part of the box that a shape takes: flows make shapes round, and curves grow.
const PART: f64 = 0.6;
/// Cells per unit length from which a mesh whose vertices follow the flow gets the first that hold it,
const OWN_CELLS: [usize; 3] = [128, 160, 192];
/// and the part of the box that it takes where noise is taken off it, by which it moves by little, and otherwise.
const OWN_PART: [f64; 2] = [0.9, 0.8];
/// Cells per unit length among which the coarsest that holds all thin parts is taken,
const IMAGE_CELLS: [usize; 5] = [128, 192, 256, 384, 512];
/// those for meshes,
const MESH_CELLS: [usize; 3] = [64, 96, 128];
/// and those for meshes whose components or holes these do not have.
const FINER_CELLS: [usize; 2] = [160, 192];
/// Interface widths between a shape and the sides of the box, beyond which its periodic images are.
const ROOM: f64 = 1.0;
/// Parts and gaps of less than so many interface widths are thin.
const THIN: f64 = 1.5;
/// Where more than this part of the boundary is at thin parts a finer grid is taken, or it is told,
const THIN_PART: f64 = 0.02;
/// and more than this is refused.
const MOST_LOST: f64 = 0.25;
/// Rays by which the thickness of a mesh is measured.
const MOST_RAYS: usize = 4096;
/// Cells along a mesh that is repaired.
const REPAIR_CELLS: usize = 112;
/// Images with more than this part of their pixels between two tones are no drawings.
const PHOTOGRAPH: f64 = 0.05;
/// What becomes of thin parts of a surface.
const WILL_NOT_LAST: &str = "which will not last";
/// Largest magnitude in a phase field: flows overshoot the phases a little.
const LARGEST_PHASE: f64 = 1.1;
/// Pixels a side of pictures of boxes.
const PIXELS: u32 = 512;

/// The path of a file from wherever the program may run later.
pub fn absolute(path: impl AsRef<Path>) -> Result<PathBuf, Error> {
    let path = path.as_ref();
    std::path::absolute(path).map_err(Error::io("find", path))
}

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
    if let Source::Mesh(path) | Source::Image(path) | Source::Field(path) | Source::Volume(path) =
        &source
    {
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

pub fn is_volume(options: &InputOptions) -> Result<bool, Error> {
    let source = options.input.as_deref().map(Source::of).transpose()?;
    Ok(matches!(source, Some(Source::Volume(_))))
}

/// The usual format of what becomes of an input: that of a mesh, otherwise PLY in space and PNG in the plane.
pub fn usual_format(input: &str) -> Result<String, Error> {
    let in_plane = match Source::of(input)? {
        Source::Mesh(path) => return Ok(extension(&path)),
        Source::Image(_) => true,
        Source::Field(path) => is_planar(&path)?,
        Source::Volume(_) => false,
        Source::BuiltIn(name) => shapes::dimension(name)? == 2,
        Source::Region(region) => region.dimension() == 2,
    };
    Ok(if in_plane { "png" } else { "ply" }.to_owned())
}

/// The closed mesh in a file, possibly after a repair.
pub fn closed(path: &Path, repairs: bool, say: SayOptions) -> Result<ClosedMesh, Error> {
    let mesh = surfaces::read(path)?;
    let warn = |what: &dyn std::fmt::Display| say.warn(&format!("{}: {what}", path.display()));
    if repairs {
        let repaired = surfaces::repair(&mesh, REPAIR_CELLS)?;
        warn(&repaired);
        return Ok(repaired.mesh);
    }
    let (mesh, warnings) = ClosedMesh::new(mesh).map_err(Error::mesh)?;
    for warning in &warnings {
        warn(warning);
    }
    Ok(mesh)
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
    let (rough, start) = (own.fairing().rough(), own.fairing().start());
    let mut grids = options
        .cells
        .map_or(OWN_CELLS.to_vec(), |cells| vec![cells])
        .into_iter()
        .peekable();
    let mut reader = Reader {
        name: source.name(),
        options,
        eps_over_h,
        say,
    };
    let field = loop {
        reader.options.cells = grids.next();
        let part = OWN_PART[usize::from(own.fairing().noise() == 0.0)];
        let grid = reader.grid_around(&start.bounding_box(), part)?;
        let field = reader.mesh_field(start, grid)?;
        let made = reader.made_of(start, &field)?;
        if !made.is_like_mesh() {
            if grids.peek().is_some() {
                continue;
            }
            let advice = "use more --cells, or --allow-loss to go on without them";
            reader.tell_lost(&made, (!allow_loss).then_some(advice))?;
        }
        let width = THIN * eps_over_h * grid.spacing();
        let sides = rough.mesh().sides(MOST_RAYS);
        let part = thin_part(&MeshDistance::new(rough), sides, width);
        if part >= THIN_PART {
            let what = if own.is_new {
                WILL_NOT_LAST
            } else {
                "where vertices follow less well"
            };
            reader.tell_thin(part, (width, made.cells), what, false)?;
        }
        say.note(&format!(
            "grid: {} cells per unit length, {:.3e} wide (--cells); its surface is {}",
            made.cells,
            grid.spacing(),
            made.far()
        ));
        break field;
    };
    let mut space = Space::new(surfaces::usual_up_axis(path)?);
    space.input = Some(Topology::of(rough));
    let region = own.nodes(&field)?;
    space.own = Some(own);
    let start = reader.start(field, space);
    Ok(Loaded::Space(Start { region, ..start }))
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
            "tif" | "tiff" if volumes::is_stack(&path) => Ok(Source::Volume(path)),
            "png" | "jpg" | "jpeg" | "webp" | "gif" | "tif" | "tiff" | "bmp" => {
                Ok(Source::Image(path))
            }
            "npy" => Ok(Source::Field(path)),
            "vti" => Err(Error::options(format!(
                "{input} is for ParaView and is not read: give the same values as .npy, such as the final.npy beside a final.vti"
            ))),
            "nii" | "gz" | "mrc" | "map" => Ok(Source::Volume(path)),
            _ => Err(Error::options(format!(
                "{input} is no input: give a mesh (.obj, .stl, .ply), an image (.png, .jpg, .webp, .gif, .tif, .bmp), \
                 a volume (.nii, .nii.gz, .mrc, .map, .tif of several pages), a field (.npy), builtin:NAME, or a region as box:... or ball:..."
            ))),
        }
    }

    fn name(&self) -> String {
        let path = match self {
            Self::BuiltIn(name) => return (*name).to_owned(),
            Self::Region(region) => return region.name().to_owned(),
            Self::Mesh(path) | Self::Image(path) | Self::Field(path) | Self::Volume(path) => path,
        };
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        // Of .nii.gz.
        let stem = stem.strip_suffix(".nii").unwrap_or(&stem);
        let other = |c: char| !(c.is_ascii_alphanumeric() || "-_".contains(c));
        stem.replace(other, "_")
    }

    fn refuse_foreign(&self, options: &InputOptions) -> Result<(), Error> {
        let what = match self {
            Self::Mesh(_) => "a mesh",
            Self::Image(_) => "an image",
            Self::Field(_) => "a field",
            Self::Volume(_) => "a volume",
            Self::BuiltIn(_) => "a built-in shape",
            Self::Region(_) => "a region",
        };
        let is_image = matches!(self, Self::Image(_));
        let is_volume = matches!(self, Self::Volume(_));
        let is_field = matches!(self, Self::Field(_));
        let has_side = !is_field && !matches!(self, Self::Region(_));
        for (name, given, allowed) in [
            ("--inside", options.inside.is_some(), is_image),
            (
                "--threshold",
                options.threshold.is_some(),
                is_image || is_volume,
            ),
            ("--label", options.label.is_some(), is_volume),
            ("--holds", options.holds.is_some(), is_field),
            ("--repair", options.repair, matches!(self, Self::Mesh(_))),
            ("--side-length", options.side_length.is_some(), has_side),
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

/// What a grid makes of a mesh.
struct Made<'a> {
    mesh: &'a ClosedMesh,
    /// The zero level set, unless it touches itself.
    surface: Option<ClosedMesh>,
    cells: usize,
    grid: Grid<3>,
}

impl Made<'_> {
    /// Whether it has the components and the holes of the mesh.
    fn is_like_mesh(&self) -> bool {
        self.surface.as_ref().map(Topology::of) == Some(Topology::of(self.mesh))
    }

    fn percent(&self, length: f64) -> f64 {
        100.0 * length / self.mesh.bounding_box().longest_side()
    }

    fn far(&self) -> String {
        let Some(surface) = &self.surface else {
            return "one that touches itself".to_owned();
        };
        let far = hausdorff_distance(surface, self.mesh);
        format!(
            "at most {far:.3e} ({:.3} % of the longest side) from that of the mesh",
            self.percent(far)
        )
    }
}

struct Reader<'a> {
    name: String,
    options: &'a mut InputOptions,
    eps_over_h: f64,
    say: SayOptions,
}

/// Cells per unit length and side of the box, unless they are chosen.
pub fn usual_box<const D: usize>() -> (usize, f64) {
    if D == 2 { (128, 2.0) } else { (64, 1.0) }
}

impl Reader<'_> {
    fn load(&mut self, source: Source<'_>) -> Result<Loaded, Error> {
        match source {
            Source::Mesh(path) => {
                let mesh = closed(&path, self.options.repair, self.say)?;
                self.mesh(&mesh, surfaces::usual_up_axis(&path)?)
            }
            Source::Image(path) => self.image(&path),
            Source::Volume(path) => self.volume(&path),
            Source::Field(path) if is_planar(&path)? => {
                let field = self.values(&path)?;
                self.plane(field)
            }
            Source::Field(path) => {
                let field = self.values(&path)?;
                Ok(self.space(field, UpAxis::default()))
            }
            Source::Region(region) if region.dimension() == 2 => {
                let grid = self.grid()?;
                self.plane(self.sampled(grid, region.shape::<2>()?.as_ref())?)
            }
            Source::Region(region) => {
                let grid = self.grid()?;
                let field = self.sampled(grid, region.shape::<3>()?.as_ref())?;
                Ok(self.space(field, UpAxis::default()))
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

    /// The grid about what has these bounds, in their own units, where their longest side is that part of the box unless it is chosen.
    fn grid_around<const D: usize>(
        &mut self,
        bounds: &BoundingBox<D>,
        part: f64,
    ) -> Result<Grid<D>, Error> {
        let grid = self.grid::<D>()?;
        // An image is all of its box: what is drawn may go on at its border.
        let room = if D == 2 { 0.0 } else { ROOM };
        let side = self.side(part, &grid, room)?;
        let own = bounds.longest_side() / side * grid.side();
        let corner = bounds.centre().map(|x| x - 0.5 * own);
        Ok(Grid::new(grid.cells(), own)?.with_origin(corner)?)
    }

    /// The coarsest of some grids about a shape that holds its thin parts and gaps.
    fn grid_holding<const D: usize>(
        &mut self,
        bounds: &BoundingBox<D>,
        grids: &[usize],
        shape: &(impl SignedDistance<D> + ?Sized),
        sides: &(impl Iterator<Item = ([f64; D], [f64; D], f64)> + Clone),
    ) -> Result<Grid<D>, Error> {
        let chosen = self.options.cells;
        let last = chosen.unwrap_or(grids[grids.len() - 1]);
        let mut grids = chosen
            .map_or(grids.to_vec(), |cells| vec![cells])
            .into_iter();
        loop {
            let cells = grids.next().unwrap_or(last);
            self.options.cells = Some(cells);
            let grid = self.grid_around(bounds, PART)?;
            let width = THIN * self.eps_over_h * grid.spacing();
            let thin = thin_part(shape, sides.clone(), width);
            if thin >= THIN_PART && cells < last {
                continue;
            }
            if thin >= THIN_PART {
                self.tell_thin(thin, (width, cells), WILL_NOT_LAST, chosen.is_none())?;
            }
            return Ok(grid);
        }
    }

    /// The start of the flow of a mesh, on the coarsest grid that holds its thin parts, its components and its holes.
    fn mesh(&mut self, mesh: &ClosedMesh, up: UpAxis) -> Result<Loaded, Error> {
        let bounds = mesh.bounding_box();
        let sides = mesh.mesh().sides(MOST_RAYS);
        let chosen = self.options.cells.is_some();
        let mut grid = self.grid_holding(&bounds, &MESH_CELLS, &MeshDistance::new(mesh), &sides)?;
        let cells = self.options.cells.unwrap_or_default();
        let finer = MESH_CELLS.into_iter().chain(FINER_CELLS);
        let mut finer = finer.filter(|&finer| !chosen && finer > cells);
        let field = loop {
            let field = self.mesh_field(mesh, grid)?;
            let made = self.made_of(mesh, &field)?;
            if made.is_like_mesh() {
                break field;
            }
            let Some(cells) = finer.next() else {
                let advice = "give a larger --side-length or more --cells, or these --cells to go on without them";
                self.tell_lost(&made, (!chosen).then_some(advice))?;
                break field;
            };
            self.options.cells = Some(cells);
            grid = self.grid_around(&bounds, PART)?;
        };
        let mut space = Space::new(up);
        space.input = Some(Topology::of(mesh));
        Ok(Loaded::Space(self.start(field, space)))
    }

    fn made_of<'m>(&self, mesh: &'m ClosedMesh, field: &Field<3>) -> Result<Made<'m>, Error> {
        let eps = self.eps_over_h * field.grid().spacing();
        let surface = ClosedMesh::new(surfaces::phase_field_surface(field, eps)?);
        Ok(Made {
            mesh,
            surface: surface.ok().map(|(surface, _)| surface),
            cells: self.options.cells.unwrap_or_default(),
            grid: *field.grid(),
        })
    }

    /// Says that parts or holes of a mesh are lost, or refuses it with some advice.
    fn tell_lost(&self, made: &Made<'_>, refused: Option<&str>) -> Result<(), Error> {
        let thin = OwnMesh::thinnest(&made.grid);
        let message = format!(
            "with --cells {} parts and gaps thinner than {thin:.3e} ({:.2} % of the longest side) are lost: the mesh has {}, the grid {}; \
             its surface is {}",
            made.cells,
            made.percent(thin),
            Topology::of(made.mesh),
            made.surface.as_ref().map(Topology::of).unwrap_or_default(),
            made.far(),
        );
        if let Some(advice) = refused {
            return Err(Error::options(format!("{message}; {advice}")));
        }
        self.say.warn(&message);
        Ok(())
    }

    /// Says that thin parts are lost, or refuses to lose many unless the grid was chosen.
    fn tell_thin(
        &self,
        part: f64,
        (width, cells): (f64, usize),
        what: &str,
        refuses: bool,
    ) -> Result<(), Error> {
        let message = format!(
            "{:.1} % of the boundary is at parts or gaps thinner than {width:.3e}, {THIN} interface widths with --cells {cells}, \
             {what}",
            100.0 * part
        );
        if refuses && part >= MOST_LOST {
            return Err(Error::options(format!(
                "{message}: give a larger --side-length, or --cells to go on all the same"
            )));
        }
        self.say.warn(&message);
        Ok(())
    }

    /// The longest side of what is in the box, a part of that unless it is chosen, so many interface widths from its sides.
    fn side<const D: usize>(&mut self, part: f64, grid: &Grid<D>, room: f64) -> Result<f64, Error> {
        let box_side = grid.side();
        let most = box_side - 2.0 * room * self.eps_over_h * grid.spacing();
        let usual = (part * box_side).min(most);
        let side = *self.options.side_length.get_or_insert(usual);
        if !(side > 0.0 && side <= most) {
            return Err(Error::options(format!(
                "--side-length {side} does not fit the box of side {box_side}, whose sides are to be an interface width away: give a \
                 positive length of at most {most:.4}"
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

    fn start<const D: usize, O>(&self, field: Field<D>, outlet: O) -> Start<D, O> {
        Start {
            name: self.name.clone(),
            field,
            outlet,
            region: None,
        }
    }

    fn space(&self, field: Field<3>, up: UpAxis) -> Loaded {
        Loaded::Space(self.start(field, Space::new(up)))
    }

    fn plane(&self, field: Field<2>) -> Result<Loaded, Error> {
        let frame = Frame::of_box(field.grid(), PIXELS)?;
        Ok(Loaded::Plane(
            self.start(field, Plane::new(frame)),
            ImageFrame(None),
        ))
    }

    fn built_in(&mut self, name: &str) -> Result<Loaded, Error> {
        if shapes::dimension(name)? == 2 {
            let grid = self.grid::<2>()?;
            let shape = shapes::built_in(name, self.side(PART, &grid, ROOM)?)?;
            let BuiltIn::Plane(shape) = shape else {
                return Err(Error::options(format!("{name} is not in the plane")));
            };
            return self.plane(self.sampled(grid, shape.as_ref())?);
        }
        let chosen = self.options.cells;
        let grid = self.grid::<3>()?;
        let side = self.side(PART, &grid, ROOM)?;
        let field = match shapes::built_in(name, side)? {
            BuiltIn::Mesh(mesh) => {
                let placement = Placement::fit(&mesh.bounding_box(), &grid, side, 0.0)?;
                self.options.cells = chosen;
                return self.mesh(&mesh.placed(&placement), UpAxis::default());
            }
            BuiltIn::Space(shape) => self.sampled(grid, shape.as_ref())?,
            BuiltIn::Plane(_) => return Err(Error::options(format!("{name} is in the plane"))),
        };
        Ok(self.space(field, UpAxis::default()))
    }

    fn image(&mut self, path: &Path) -> Result<Loaded, Error> {
        let image = images::read(path)?;
        let inside = match self.options.inside {
            None | Some(Inside::Auto) => images::Inside::Auto,
            Some(Inside::Dark) => images::Inside::Dark,
            Some(Inside::Light) => images::Inside::Light,
        };
        let threshold = (self.options.threshold).map_or_else(Threshold::default, Threshold::At);
        let side = Side::of(&image, inside, threshold)?;
        let tones = Tones::of(&image, side);
        if self.options.inside.is_none() && self.options.threshold.is_none() {
            refuse_photographs(&tones, side, path)?;
        }
        let outline = Outline::of_image(&image, side)?.smoothed(tones.raster())?;
        let distance = OutlineDistance::new(&outline);
        let sides = outline.sides();
        let grid = self.grid_holding(&image.bounding_box(), &IMAGE_CELLS, &distance, &sides)?;
        let [width, height] = [image.width(), image.height()];
        let frame = Frame::new(width, height, [0.0, f64::from(height)], 1.0)?;
        let start = self.start(self.sampled(grid, &distance)?, Plane::new(frame));
        let image = ImageFrame(Some((path.to_owned(), [width, height])));
        Ok(Loaded::Plane(start, image))
    }

    fn volume(&mut self, path: &Path) -> Result<Loaded, Error> {
        let body = volume::body(path, self.options)?;
        if let Some(label) = self.options.label {
            self.name = format!("{}-label{label}", self.name);
        }
        let bounds = body.surface.bounding_box();
        let distance = MeshDistance::new(&body.surface);
        let sides = body.surface.mesh().sides(MOST_RAYS);
        // As fine as the voxels, where that is possible.
        let fine = bounds.longest_side() / (PART * body.voxel);
        let last = MESH_CELLS.len() - 1;
        let first = MESH_CELLS.iter().position(|&cells| cells as f64 >= fine);
        let grids = &MESH_CELLS[first.unwrap_or(last)..];
        let grid = self.grid_holding(&bounds, grids, &distance, &sides)?;
        let wide = grid.spacing() / body.voxel;
        if wide > 1.5 {
            self.say.note(&format!(
                "a cell is {wide:.1} voxels wide: with more --cells than {} smaller details last",
                self.options.cells.unwrap_or_default()
            ));
        }
        let field = self.mesh_field(&body.surface, grid)?;
        let mut outlet = Space::new(UpAxis::default());
        outlet.voxels = Some(Voxels {
            volume: body.volume,
            side: body.voxel,
            farthest: None,
        });
        Ok(Loaded::Space(self.start(field, outlet)))
    }

    fn mesh_field(&self, mesh: &ClosedMesh, grid: Grid<3>) -> Result<Field<3>, Error> {
        let progress = self.say.progress();
        let bar = progress.bar("signed distance", grid.cells() as u64);
        let distance = MeshDistance::new(mesh);
        let eps = self.eps_over_h * grid.spacing();
        let mut distance = distance.sample_within(PURE_BEYOND * eps, grid, || bar.inc(1))?;
        bar.finish();
        progress.clear();
        let mended = surfaces::mend_signs(&mut distance);
        if mended > 0 {
            self.say.warn(&format!(
                "the mesh crosses itself: {mended} nodes of the grid, which its faces put on the wrong side, were put right"
            ));
        }
        Ok(distance.map(|s| optimal_profile(s, eps)))
    }

    fn values<const D: usize>(&mut self, path: &Path) -> Result<Field<D>, Error> {
        let holds = *self.options.holds.get_or_insert(Holds::PhaseField);
        let (_, side) = usual_box::<D>();
        let side = *self.options.box_side.get_or_insert(side);
        let field = npy::read(path, |cells| Grid::centred(cells, side))?;
        let outside = |u: &&f64| u.abs() > LARGEST_PHASE;
        if let Some(value) = field
            .values()
            .iter()
            .find(outside)
            .filter(|_| holds == Holds::PhaseField)
        {
            return Err(Error::options(format!(
                "{} holds the value {value}, which no phase field has; give --holds distance if these are signed distances",
                path.display()
            )));
        }
        let eps = self.eps_over_h * field.grid().spacing();
        let distance = match (holds, self.options.cells) {
            (Holds::PhaseField, None) => return Ok(field),
            (Holds::PhaseField, Some(_)) => field.map(|u| distance_from_phase_field(u, eps)),
            (Holds::Distance, _) => field,
        };
        let distance = self.resampled(distance)?;
        let eps = self.eps_over_h * distance.grid().spacing();
        Ok(distance.map(|s| optimal_profile(s, eps)))
    }

    /// Distances in the same box with the number of cells that was chosen, interpolated linearly.
    fn resampled<const D: usize>(&mut self, distance: Field<D>) -> Result<Field<D>, Error> {
        if self.options.cells.is_none() {
            return Ok(distance);
        }
        Ok(Field::from_fn(self.grid()?, |x| distance.interpolate(x)))
    }
}

/// Refuses images that are no drawings, unless it is said what is to be inside.
fn refuse_photographs(tones: &Tones, side: Side, path: &Path) -> Result<(), Error> {
    if tones.between < PHOTOGRAPH {
        return Ok(());
    }
    Err(Error::options(format!(
        "{} has continuous tones, as a photograph: {:.0} % of its pixels have none of two. A shape has two: with --threshold {:.2}, which \
         separates them best, the pixels {}, {:.0} % of all, would be inside, and all other tones of them would be lost; say so by \
         --threshold or --inside",
        path.display(),
        100.0 * tones.between,
        tones.threshold,
        side.at(tones.threshold),
        100.0 * tones.inside,
    )))
}

/// Whether a file of values is meant to be in the plane; its reader says what is wrong with it.
fn is_planar(path: &Path) -> Result<bool, Error> {
    let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
    Ok(!matches!(
        npy::decode::<2>(&bytes),
        Err(NpyError::Rank { .. })
    ))
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
    /// The mask, which is a region, or an image of the size of the input.
    pub fn mask(&self, mask: &str, grid: &Grid<2>) -> Result<Box<dyn SignedDistance<2>>, Error> {
        if Region::is_meant(mask) {
            return region(mask);
        }
        let image: Image = images::read(mask)?;
        let size = [image.width(), image.height()];
        let needed = match &self.0 {
            None if size[0] != size[1] => Some("a square, which fills the box".to_owned()),
            Some((_, [w, h])) if size != [*w, *h] => {
                Some(format!("{w} x {h} pixels, as the input"))
            }
            _ => None,
        };
        if let Some(needed) = needed {
            return Err(Error::options(format!(
                "--mask {mask} has {} x {} pixels; it must be {needed}",
                size[0], size[1]
            )));
        }
        let side = Side::of(&image, images::Inside::Auto, Threshold::default())?;
        let mut outline = Outline::of_image(&image, side)?;
        if self.0.is_none() {
            let fills = Placement::fit(&image.bounding_box(), grid, grid.side(), 0.0)?;
            outline = outline.placed(&fills);
        }
        Ok(Box::new(OutlineDistance::new(&outline)))
    }

    /// The plane with the image that is repaired in a mask, if it is one.
    pub fn repaired(&self, plane: Plane, mask: &dyn SignedDistance<2>) -> Result<Plane, Error> {
        let Some((path, _)) = &self.0 else {
            return Ok(plane);
        };
        let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
        let picture = images::colours(&bytes).map_err(|problem| images::Error::Format {
            path: path.clone(),
            problem,
        })?;
        Ok(plane.repairing(picture, mask))
    }
}

/// A region that is a mask.
pub fn region<const D: usize>(mask: &str) -> Result<Box<dyn SignedDistance<D>>, Error> {
    if !Region::is_meant(mask) {
        return Err(Error::options(format!(
            "--mask {mask} is no region in {D}D: give box:... or ball:..."
        )));
    }
    let region: Region = mask
        .parse()
        .map_err(|reason| Error::options(format!("--mask: {reason}")))?;
    Ok(region.shape::<D>()?)
}

/// The nodes inside a mask, of which there must be some.
pub fn nodes<const D: usize>(
    mask: &str,
    shape: &dyn SignedDistance<D>,
    grid: &Grid<D>,
) -> Result<Vec<bool>, Error> {
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
