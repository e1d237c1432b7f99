//! Inputs as phase fields.

use std::cell::Cell;

use engine::{Flow, Storage};
use geometry::{PURE_BEYOND, distance_from_phase_field, thin_part};
use images::{Outline, Side, Tones};
use surfaces::shapes::{self, BuiltIn};
use surfaces::{Mended, Repaired, hausdorff_distance};

use crate::events::{DISTANCES, GridDistance, Loss, ThinParts, timed};
use crate::file::{File, Input};
use crate::options::{FieldKind, InputOptions, Inside};
use crate::own::{OwnMesh, thinnest};
use crate::parts::Voxels;
use crate::plane::Plane;
use crate::prelude::*;
use crate::presentation::{Presentation, Topology};
use crate::space::Space;
use crate::volume;

/// What a run starts from.
pub struct InitialShape<const D: usize, O> {
    pub name: String,
    pub initial: Stored<D>,
    pub presentation: O,
    /// The nodes that move, if not all.
    pub region: Option<NodeSet>,
}

/// What a run starts from, in the dimension of the input.
pub enum Loaded {
    Plane(InitialShape<2, Plane>),
    Space(InitialShape<3, Space>),
}

/// A shape on a grid, in the dimension of the input.
#[derive(Clone, Debug)]
pub enum Opened {
    /// A curve.
    Plane(Stored<2>),
    /// A surface.
    Space(Stored<3>),
}

impl From<Stored<2>> for Opened {
    fn from(field: Stored<2>) -> Self {
        Self::Plane(field)
    }
}

impl From<Stored<3>> for Opened {
    fn from(field: Stored<3>) -> Self {
        Self::Space(field)
    }
}

/// The phase field of an input, with interfaces so many cells wide; the grid is chosen unless the options say it, and noted there.
///
/// # Errors
/// Refused options or input.
pub fn open(options: &mut InputOptions, eps_over_h: f64, watcher: &dyn Watcher) -> Result<Opened> {
    Ok(match Reader::of(options, eps_over_h, watcher)?.load()? {
        Loaded::Plane(start) => Opened::Plane(start.initial),
        Loaded::Space(start) => Opened::Space(start.initial),
    })
}

/// The grids about a shape of which one is taken.
struct Grids<'a> {
    /// The part of the box that the shape takes.
    part: f64,
    /// Cells per unit length, in ascending order.
    cells: &'a [usize],
    /// The largest spacing, and the number of cells per unit length from which on a larger one will do.
    spacing: Option<(f64, usize)>,
}

impl<'a> Grids<'a> {
    fn usual(cells: &'a [usize]) -> Self {
        Self {
            part: PART,
            cells,
            spacing: None,
        }
    }
}

/// What an input is; the paths of files are absolute.
#[derive(Clone)]
pub enum Source {
    Mesh(File),
    Image(File),
    Field(File),
    Volume(File),
    BuiltIn(String),
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
/// The same for segmentations of which only the staircase is taken off, all with fast Fourier transforms,
const STAIRCASE_CELLS: [usize; 8] = [48, 56, 64, 72, 80, 96, 112, 128];
/// of which the last two are for thin parts alone: staircases go on grids that are coarser than the voxels, too.
const FINEST_FOR_VOXELS: usize = 96;
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
/// Segments of an outline by which its thickness is measured.
const MOST_SEGMENTS: usize = 1 << 12;
/// Cells along a mesh that is repaired, unless `cells` says how many.
const REPAIR_CELLS: usize = 112;
/// Images with more than this part of their pixels between two tones are no drawings.
const PHOTOGRAPH: f64 = 0.05;
/// Phase fields have values below this one: they are -1 outside.
const OUTSIDE: f64 = -0.5;
/// Largest magnitude in a phase field: flows overshoot the phases a little.
const LARGEST_PHASE: f64 = 1.1;

/// The usual format of the result of an input: that of a mesh, otherwise PLY in space and PNG in the plane.
///
/// # Errors
/// A text that is no input.
pub fn usual_format(input: &Input) -> Result<String> {
    Ok(match Source::of(input)? {
        Source::Mesh(file) => file.extension(),
        source if source.is_planar()? => "png".to_owned(),
        _ => "ply".to_owned(),
    })
}

/// The cells along a mesh that is repaired.
#[derive(Clone, Copy)]
pub struct RepairCells(usize);

impl RepairCells {
    /// Those of the options, if it is to be repaired.
    pub fn of(options: &InputOptions) -> Option<Self> {
        let cells = options.cells.unwrap_or(REPAIR_CELLS);
        (options.repair).then_some(Self(cells.max(FEWEST_CELLS)))
    }
}

/// The closed mesh in a file, possibly after a repair.
pub fn closed(
    file: &File,
    repairs: Option<RepairCells>,
    watcher: &dyn Watcher,
) -> Result<ClosedMesh> {
    let (mesh, path) = (file.mesh()?, &file.path);
    if let Some(RepairCells(cells)) = repairs {
        let repaired = surfaces::repair(&mesh, cells)?;
        watcher.warning(&Warning::Repaired {
            path: path.clone(),
            changes: repaired.changes,
        });
        return Ok(repaired.mesh);
    }
    let Mended { mesh, changes, .. } = ClosedMesh::mended(mesh).map_err(Error::mesh)?;
    for change in changes {
        watcher.warning(&Warning::Mended {
            path: path.clone(),
            change,
            only_for_flow: false,
        });
    }
    Ok(mesh)
}

/// A closed mesh of one that may bound nothing.
pub fn repaired(input: &Input) -> Result<Repaired> {
    match Source::of(input)? {
        Source::Mesh(file) => Ok(surfaces::repair(&file.mesh()?, REPAIR_CELLS)?),
        _ => Err(Refusal::NotRepaired(input.to_string()).into()),
    }
}

impl Source {
    fn of(input: &Input) -> Result<Self> {
        let name = input.name();
        if let (Some(built_in), false) = (name.strip_prefix("builtin:"), input.is_in_memory()) {
            return Ok(Self::BuiltIn(built_in.to_owned()));
        }
        if !input.is_in_memory() && Region::is_meant(name) {
            return Ok(Self::Region(name.parse().map_err(Refusal::Region)?));
        }
        let file = input.file()?;
        Ok(match &*file.extension() {
            "obj" | "off" | "stl" | "ply" => Self::Mesh(file),
            "tif" | "tiff" if file.is_stack() => Self::Volume(file),
            "png" | "jpg" | "jpeg" | "webp" | "gif" | "tif" | "tiff" | "bmp" => Self::Image(file),
            "npy" => match file.axes_of_labels()? {
                None => Self::Field(file),
                Some(2) => return Err(Refusal::LabelsInThePlane(file.path).into()),
                Some(_) => Self::Volume(file),
            },
            "vti" => return Err(Error::ParaView(input.to_string())),
            "nii" | "gz" | "nrrd" | "nhdr" | "mgh" | "mgz" | "mrc" | "map" => Self::Volume(file),
            _ => return Err(Error::UnknownInput(input.to_string())),
        })
    }

    /// An array of values in space is a volume if the options say so, or if it is a mask of 0 and 1.
    fn meant(self, options: &InputOptions, watcher: &dyn Watcher) -> Result<Self> {
        let Self::Field(file) = &self else {
            return Ok(self);
        };
        if options.field_kind.is_some() || !file.has_values_in_space()? {
            return Ok(self);
        }
        if options.threshold.is_some() || options.label.is_some() {
            return Ok(Self::Volume(file.clone()));
        }
        if !file.is_mask()? {
            return Ok(self);
        }
        let path = file.path.clone();
        watcher.note(&Note::Mask { path });
        Ok(Self::Volume(file.clone()))
    }

    fn file(&self) -> Option<&File> {
        match self {
            Self::Mesh(file) | Self::Image(file) | Self::Field(file) | Self::Volume(file) => {
                Some(file)
            }
            Self::BuiltIn(_) | Self::Region(_) => None,
        }
    }

    fn is_planar(&self) -> Result<bool> {
        Ok(match self {
            Self::Mesh(_) | Self::Volume(_) => false,
            Self::Image(_) => true,
            Self::Field(file) => file.is_planar_field()?,
            Self::BuiltIn(name) => shapes::dimension(name)? == 2,
            Self::Region(region) => region.dimension() == 2,
        })
    }

    fn name(&self) -> String {
        let stem = match self {
            Self::BuiltIn(name) => name.into(),
            Self::Region(region) => region.name().into(),
            other => {
                let stem = other.file().and_then(|file| file.path.file_stem());
                stem.unwrap_or_default().to_string_lossy()
            }
        };
        // Of .nii.gz and .ome.tif.
        let first = [".nii", ".ome"]
            .iter()
            .find_map(|end| stem.strip_suffix(end));
        let stem = first.unwrap_or(&stem);
        let other = |c: char| !(c.is_ascii_alphanumeric() || "-_".contains(c));
        stem.replace(other, "_")
    }

    /// Refuses options that say nothing about such an input.
    fn refuse_foreign(&self, options: &InputOptions) -> Result<()> {
        let (what, allowed): (_, &[&str]) = match self {
            Self::Mesh(_) => ("a mesh", &["repair", "side_length"]),
            Self::Image(_) => ("an image", &["inside", "threshold", "side_length"]),
            Self::Field(_) => ("a field", &["field_kind"]),
            Self::Volume(_) => ("a volume", &["threshold", "label", "frame", "side_length"]),
            Self::BuiltIn(_) => ("a built-in shape", &["side_length"]),
            Self::Region(_) => ("a region", &[]),
        };
        for (name, given) in [
            ("inside", options.inside.is_some()),
            ("threshold", options.threshold.is_some()),
            ("label", options.label.is_some()),
            ("frame", options.frame.is_some()),
            ("field_kind", options.field_kind.is_some()),
            ("repair", options.repair),
            ("side_length", options.side_length.is_some()),
        ] {
            if given && !allowed.contains(&name) {
                return Err(Error::foreign(name, "", what));
            }
        }
        Ok(())
    }
}

/// Reads an input and fills in the options that were left to it.
pub struct Reader<'a> {
    pub source: Source,
    /// Whether thin parts may be lost on the grid, if there is an option that says so.
    pub allows_loss: Option<bool>,
    /// Whether the parts of a segmentation keep their volumes, and small ones do not flow.
    pub keeps_volumes: bool,
    /// Whether only the staircase of a segmentation is taken off, so that there is no growth to leave room for.
    pub hardly_moves: bool,
    /// The flow that will store the whole grid, if one will, and where: its memory is looked at before anything takes long.
    pub whole: Option<(DeviceKind, Flow)>,
    /// Whether the flow takes bricks near the surface where they are less than half of the grid, and what is elsewhere does not count.
    pub takes_bricks: bool,
    options: &'a mut InputOptions,
    /// The cells per unit length that were chosen, if any; the options may hold others that are tried.
    chosen: Option<usize>,
    eps_over_h: f64,
    watcher: &'a dyn Watcher,
}

/// Cells per unit length and side of the box, unless they are chosen.
pub fn usual_box<const D: usize>() -> (usize, f64) {
    if D == 2 { (128, 2.0) } else { (64, 1.0) }
}

impl<'a> Reader<'a> {
    /// Says what the input is.
    pub fn of(
        options: &'a mut InputOptions,
        eps_over_h: f64,
        watcher: &'a dyn Watcher,
    ) -> Result<Self> {
        let Some(input) = &options.input else {
            return Err(Error::NoInput);
        };
        let source = Source::of(input)?.meant(options, watcher)?;
        source.refuse_foreign(options)?;
        if let (Some(file), Some(input)) = (source.file(), &mut options.input) {
            input.rename(&file.path);
        }
        Ok(Self {
            source,
            allows_loss: None,
            keeps_volumes: false,
            hardly_moves: false,
            whole: None,
            takes_bricks: false,
            chosen: options.cells,
            options,
            eps_over_h,
            watcher,
        })
    }

    /// Whether it is a shape in the plane.
    pub fn is_planar(&self) -> Result<bool> {
        self.source.is_planar()
    }

    pub fn load(&mut self) -> Result<Loaded> {
        let is_planar = self.source.is_planar()?;
        Ok(match self.source.clone() {
            Source::Mesh(file) => {
                let mesh = closed(&file, RepairCells::of(self.options), self.watcher)?;
                self.mesh(&mesh, file.up_axis()?)?
            }
            Source::Image(file) => self.image(&file)?,
            Source::Volume(file) => self.volume(&file)?,
            Source::Field(file) if is_planar => Loaded::Plane(self.values(&file)?),
            Source::Field(file) => Loaded::Space(self.values(&file)?),
            Source::Region(region) if is_planar => Loaded::Plane(self.shape(&*region.shape()?)?),
            Source::Region(region) => Loaded::Space(self.shape(&*region.shape()?)?),
            Source::BuiltIn(name) => self.built_in(&name)?,
        })
    }

    /// The grid about 0.
    fn grid<const D: usize>(&mut self) -> Result<Grid<D>> {
        let (cells, box_side) = usual_box::<D>();
        let cells = *self.options.cells.get_or_insert(cells);
        if cells < FEWEST_CELLS {
            let fewest = FEWEST_CELLS;
            return Err(Error::TooFewCells { cells, fewest });
        }
        let box_side = *self.options.box_side.get_or_insert(box_side);
        let grid = Grid::<D>::per_unit(cells, box_side)?.with_origin([-0.5 * box_side; D])?;
        let nodes = (grid.cells() as f64).powi(D as i32);
        if nodes > MOST_NODES {
            return Err(Error::TooManyNodes {
                cells,
                nodes,
                box_side,
                most: MOST_NODES,
            });
        }
        if let Some((device, flow)) = self.whole {
            let nodes = grid.len();
            let needed = Storage::bytes(flow, nodes, nodes);
            Storage::check(device, &grid, nodes, needed, flow == Flow::Willmore)?;
        }
        Ok(grid)
    }

    /// The grid about what has these bounds, in their own units, where their longest side is that part of the box unless it is chosen.
    fn grid_around<const D: usize>(
        &mut self,
        bounds: &BoundingBox<D>,
        part: f64,
    ) -> Result<Grid<D>> {
        let grid = self.grid::<D>()?;
        // An image is all of its box: what is drawn may go on at its border.
        let room = if D == 2 { 0.0 } else { ROOM };
        let side = self.side::<D>(part, room)?;
        let own = bounds.longest_side() / side * grid.side();
        let corner = bounds.centre().map(|x| x - 0.5 * own);
        Ok(Grid::new(grid.cells(), own)?.with_origin(corner)?)
    }

    /// What comes of the number of cells that was chosen, or of the first of these with which all is well, as the attempt says, or of the last.
    /// The room at the sides of the box is that for each number of cells.
    fn first_good<T>(
        &mut self,
        grids: &[usize],
        attempt: impl Fn(&mut Self) -> Result<(T, bool)>,
    ) -> Result<T> {
        let (chosen, side_length) = (self.chosen, self.options.side_length);
        let grids = chosen.as_ref().map_or(grids, std::slice::from_ref);
        let (last, others) = grids.split_last().expect("there is a grid to try");
        for &cells in others {
            self.options.cells = Some(cells);
            if let (made, true) = attempt(self)? {
                return Ok(made);
            }
            self.options.side_length = side_length;
        }
        self.options.cells = Some(*last);
        Ok(attempt(self)?.0)
    }

    /// Whether most of a shape is too thin even for the finest of some grids, by a part of its sides: then the others need not be tried. Of a grid
    /// that is refused, such as one that takes more memory than there is, nothing is known: a coarser one may do.
    fn is_hopeless<const D: usize>(
        &mut self,
        bounds: &BoundingBox<D>,
        grids: &Grids,
        shape: &(impl SignedDistance<D> + ?Sized),
        sides: &(impl Iterator<Item = ([f64; D], [f64; D], f64)> + Clone),
    ) -> bool {
        /// At most so many sides.
        const TRIED: usize = 1024;
        let (cells, side_length) = (self.options.cells, self.options.side_length);
        if self.chosen.is_some() {
            return false;
        }
        self.options.cells = grids.cells.last().copied();
        let finest = self.grid_around(bounds, grids.part);
        (self.options.cells, self.options.side_length) = (cells, side_length);
        let Ok(grid) = finest else {
            return false;
        };
        let step = sides.clone().count().div_ceil(TRIED).max(1);
        let tried = sides.clone().step_by(step);
        thin_part(shape, tried, self.thin_below(&grid)) > 2.0 * MOST_LOST
    }

    /// The coarsest of some grids about a shape that is fine enough and holds its thin parts and gaps, or the one that was chosen.
    fn grid_holding<const D: usize>(
        &mut self,
        bounds: &BoundingBox<D>,
        grids: &Grids,
        shape: &(impl SignedDistance<D> + ?Sized),
        sides: &(impl Iterator<Item = ([f64; D], [f64; D], f64)> + Clone),
    ) -> Result<Grid<D>> {
        let finest = grids.cells.len() - 1;
        let cells = if self.is_hopeless(bounds, grids, shape, sides) {
            &grids.cells[finest..]
        } else {
            grids.cells
        };
        let (grid, thin) = self.first_good(cells, |reader| {
            let grid = reader.grid_around(bounds, grids.part)?;
            let is_coarse = (grids.spacing)
                .is_some_and(|(most, cells)| grid.spacing() > most && reader.cells() < cells);
            if is_coarse && reader.chosen.is_none() {
                return Ok(((grid, 1.0), false));
            }
            let thin = thin_part(shape, sides.clone(), reader.thin_below(&grid));
            Ok(((grid, thin), thin < THIN_PART))
        })?;
        self.tell_thin(thin, &grid, false, self.chosen.is_none())?;
        Ok(grid)
    }

    /// The phase field of a mesh on the coarsest of some grids about it that has its components and holes, and the surface there, unless it touches
    /// itself. Where even the last one does not have them this is told, or refused, as its field says.
    fn like_mesh(
        &mut self,
        mesh: &ClosedMesh,
        part: f64,
        grids: &[usize],
        refuses: &dyn Fn(&Stored<3>) -> Result<bool>,
        vertices_follow: bool,
    ) -> Result<(Stored<3>, Option<ClosedMesh>)> {
        let wanted = Topology::of(mesh);
        // The topology of a union is that of none of its parts.
        let grids = if mesh.is_union() {
            &grids[grids.len() - 1..]
        } else {
            grids
        };
        let (field, found) = self.first_good(grids, |reader| {
            let grid = reader.grid_around(&mesh.bounding_box(), part)?;
            let field = reader.mesh_field(mesh, grid)?;
            let found = surfaces::phase_field_topology(&field)?.into();
            Ok(((field, found), found == wanted))
        })?;
        let surface = self.marched(&field)?;
        if found != wanted && !mesh.is_union() {
            let loss = self.loss(mesh, &field, surface.as_ref(), found);
            if refuses(&field)? {
                return Err(Error::Lost {
                    loss: Box::new(loss),
                    may_allow: self.allows_loss.is_some(),
                    vertices_follow,
                });
            }
            self.watcher.warning(&Warning::Lost(loss));
        }
        Ok((field, surface))
    }

    /// Says that bodies overlap, which no grid tells apart, or refuses them before it is tried.
    fn tell_overlap(&self, mesh: &ClosedMesh, refuses: bool, vertices_follow: bool) -> Result<()> {
        let Some(overlap) = mesh.overlap() else {
            return Ok(());
        };
        if refuses {
            let error = surfaces::Error::Overlap(overlap);
            return Err(Error::repairable(error, vertices_follow));
        }
        self.watcher.warning(&Warning::Overlap(overlap));
        Ok(())
    }

    /// The surface of a phase field, unless it touches itself.
    fn marched(&self, field: &Stored<3>) -> Result<Option<ClosedMesh>> {
        let surface = surfaces::phase_field_surface(field, self.eps(field.grid()))?;
        Ok(ClosedMesh::new(surface).ok().map(|(surface, _)| surface))
    }

    /// What a mesh loses on a grid where its surface has another topology.
    fn loss(
        &self,
        mesh: &ClosedMesh,
        field: &Stored<3>,
        surface: Option<&ClosedMesh>,
        on_grid: Topology,
    ) -> Loss {
        Loss {
            cells: self.cells(),
            thinnest: thinnest(field.grid()),
            longest_side: mesh.bounding_box().longest_side(),
            of_mesh: Topology::of(mesh),
            on_grid,
            distance: far_from(mesh, surface, field),
        }
    }

    fn cells(&self) -> usize {
        self.options.cells.unwrap_or_default()
    }

    /// Parts and gaps of less width are thin.
    fn thin_below<const D: usize>(&self, grid: &Grid<D>) -> f64 {
        THIN * self.eps_over_h * grid.spacing()
    }

    /// Says that so much of the boundary is thin, if it is much, or refuses to lose even more unless the grid was chosen or losses are allowed.
    fn tell_thin<const D: usize>(
        &self,
        part: f64,
        grid: &Grid<D>,
        vertices_follow: bool,
        refuses: bool,
    ) -> Result<()> {
        if part < THIN_PART {
            return Ok(());
        }
        let thin = ThinParts {
            part,
            below: self.thin_below(grid),
            widths: THIN,
            cells: self.cells(),
            vertices_follow,
        };
        if refuses && self.allows_loss != Some(true) && part >= MOST_LOST {
            return Err(Error::Thin {
                thin: Box::new(thin),
                may_allow: self.allows_loss.is_some(),
            });
        }
        self.watcher.warning(&Warning::Thin(thin));
        Ok(())
    }

    /// The start of the flow of a mesh, on the coarsest grid that holds its thin parts, its components and its holes.
    fn mesh(&mut self, mesh: &ClosedMesh, up: UpAxis) -> Result<Loaded> {
        let sides = mesh.mesh().sides(MOST_RAYS);
        let distance = MeshDistance::new(mesh);
        let usual = Grids::usual(&MESH_CELLS);
        self.grid_holding(&mesh.bounding_box(), &usual, &distance, &sides)?;
        let coarsest = self.cells();
        let grids = MESH_CELLS.into_iter().chain(FINER_CELLS);
        let grids: Vec<usize> = grids.filter(|&cells| cells >= coarsest).collect();
        let refuses = self.chosen.is_none() && self.allows_loss != Some(true);
        self.tell_overlap(mesh, refuses, false)?;
        let (field, _) = self.like_mesh(mesh, PART, &grids, &|_| Ok(refuses), false)?;
        let space = Space {
            up,
            input: Some(Topology::of(mesh)),
            ..Space::default()
        };
        Ok(Loaded::Space(self.start(field, space)?))
    }

    /// A mesh whose vertices follow the flow, on the coarsest grid that holds its parts and holes.
    pub fn own(&mut self, mut own: OwnMesh, file: &File) -> Result<Loaded> {
        let part = OWN_PART[usize::from(own.fairing().noise == 0.0)];
        let refuses = self.allows_loss != Some(true);
        let start = &own.fairing().start;
        if !start.is_union() {
            self.tell_overlap(start, refuses, true)?;
        }
        let eps_over_h = self.eps_over_h;
        // Vertices keep their distance from what the grid does not hold; and lids may touch each other where the surface does not.
        let loses_much = |field: &Stored<3>| -> Result<bool> {
            let much = || own.unresolved_part(field, eps_over_h * field.grid().spacing());
            Ok(refuses && !own.has_lids() && much()? >= MOST_LOST)
        };
        // Where the vertices are not those of a new mesh, they stay at what is lost, if enough of them are left to move.
        let stays = !own.is_new;
        let is_lost = Cell::new(false);
        let loses = |field: &Stored<3>| {
            let width = THIN * eps_over_h * field.grid().spacing();
            is_lost.set(loses_much(field)?);
            Ok(is_lost.get() && !(stays && own.moves_enough(&own.fairing().thin(width))))
        };
        let (mut field, mut surface) = self.like_mesh(start, part, &OWN_CELLS, &loses, true)?;
        let grid = *field.grid();
        if self.keep_thin(&mut own, &grid, is_lost.get())? {
            field = self.mesh_field(&own.fairing().start, grid)?;
            surface = self.marched(&field)?;
        }
        let (rough, start, grid) = (own.rough(), &own.fairing().start, &grid);
        self.watcher.note(&Note::Grid {
            cells: self.cells(),
            spacing: grid.spacing(),
            distance: far_from(start, surface.as_ref(), &field),
        });
        let region = own.nodes(grid);
        let presentation = Space {
            up: file.up_axis()?,
            input: Some(Topology::of(rough)),
            own: Some(own),
            ..Space::default()
        };
        Ok(Loaded::Space(InitialShape {
            name: self.source.name(),
            initial: field,
            presentation,
            region,
        }))
    }

    /// Says how much of a mesh is thin. If that is too much, or much is lost on the grid, its vertices there stay; returns whether they do.
    fn keep_thin(&self, own: &mut OwnMesh, grid: &Grid<3>, is_lost: bool) -> Result<bool> {
        let rough = own.rough();
        let sides = rough.mesh().sides(MOST_RAYS);
        let thin = thin_part(&MeshDistance::new(rough), sides, self.thin_below(grid));
        let refuses = self.allows_loss != Some(true) && self.chosen.is_none();
        let is_too_much = is_lost || (refuses && thin >= MOST_LOST);
        if own.is_new || !is_too_much || !own.keep_thin(self.thin_below(grid)) {
            self.tell_thin(thin, grid, !own.is_new, self.chosen.is_none())?;
            return Ok(false);
        }
        self.tell_thin(thin, grid, true, false)?;
        self.watcher.warning(&Warning::ThinStays {
            vertices: own.kept(),
            all: own.rough().mesh().vertices.len(),
        });
        Ok(true)
    }

    /// The longest side of what is in the box: at least so many interface widths from its sides, and unless it is chosen a part of the box and
    /// three times as far.
    fn side<const D: usize>(&mut self, part: f64, room: f64) -> Result<f64> {
        let grid = self.grid::<D>()?;
        let box_side = grid.side();
        let within = |room: f64| box_side - 2.0 * room * self.eps_over_h * grid.spacing();
        let (most, roomy) = (within(room), within(3.0 * room));
        if most <= 0.0 {
            let cells = self.cells();
            return Err(Error::NoRoom { box_side, cells });
        }
        // On the coarsest grids there is no such room.
        let usual = if roomy > 0.0 {
            (part * box_side).min(roomy)
        } else {
            most
        };
        let side = *self.options.side_length.get_or_insert(usual);
        if !(side > 0.0 && side <= most) {
            return Err(Error::SideLength {
                side,
                box_side,
                most,
            });
        }
        Ok(side)
    }

    fn eps<const D: usize>(&self, grid: &Grid<D>) -> f64 {
        self.eps_over_h * grid.spacing()
    }

    fn start<const D: usize, O>(
        &self,
        initial: impl Into<Stored<D>>,
        presentation: O,
    ) -> Result<InitialShape<D, O>> {
        let initial: Stored<D> = initial.into();
        let input = self.options.input.as_ref();
        check_phases(&initial, input.map_or("", Input::name))?;
        let label = self.options.label;
        let label = label.map_or(String::new(), |label| format!("-label{label}"));
        Ok(InitialShape {
            name: self.source.name() + &label,
            initial,
            presentation,
            region: None,
        })
    }

    fn shape<const D: usize, O: Presentation<D>>(
        &mut self,
        shape: &dyn SignedDistance<D>,
    ) -> Result<InitialShape<D, O>> {
        let grid = self.grid()?;
        let field = stored_phase_field(grid, shape, self.eps(&grid))?;
        self.start(field, O::of_box(&grid)?)
    }

    fn built_in(&mut self, name: &str) -> Result<Loaded> {
        let side = if self.source.is_planar()? {
            self.side::<2>(PART, ROOM)?
        } else {
            self.side::<3>(PART, ROOM)?
        };
        match shapes::built_in(name, side)? {
            BuiltIn::Plane(shape) => Ok(Loaded::Plane(self.shape(&*shape)?)),
            BuiltIn::Space(shape) => Ok(Loaded::Space(self.shape(&*shape)?)),
            BuiltIn::Mesh(mesh, up) => {
                let grid = self.grid()?;
                let placement = Placement::fit(&mesh.bounding_box(), &grid, side)?;
                self.mesh(&mesh.placed(&placement), up)
            }
        }
    }

    fn image(&mut self, file: &File) -> Result<Loaded> {
        let image = file.image()?;
        let threshold = self.options.threshold.unwrap_or(0.5);
        let usual = Side::of(&image, threshold)?;
        let side = match self.options.inside {
            None | Some(Inside::Auto) => usual,
            Some(Inside::Dark) => Side::Dark(threshold),
            Some(Inside::Light) => Side::Light(threshold),
        };
        let plane = Plane::of_image(&image, file)?;
        let tones = Tones::of(&image, side);
        let is_said = self.options.inside.is_some() || self.options.threshold.is_some();
        if tones.between >= PHOTOGRAPH && !is_said {
            return Err(Error::Photograph {
                path: file.path.clone(),
                between: tones.between,
                threshold: tones.threshold,
                side: side.at(tones.threshold).to_string(),
                inside: tones.inside,
            });
        }
        let outline = Outline::of_image(&image, side)?.smoothed(tones.raster())?;
        let distance = outline.distance();
        let grids = Grids::usual(&IMAGE_CELLS);
        let sides = outline.sides(MOST_SEGMENTS);
        let grid = self.grid_holding(&image.bounding_box(), &grids, &distance, &sides)?;
        let field = stored_phase_field(grid, &distance, self.eps(&grid))?;
        Ok(Loaded::Plane(self.start(field, plane)?))
    }

    fn volume(&mut self, file: &File) -> Result<Loaded> {
        let body = volume::body(file, self.options, self.watcher)?;
        let bounds = body.surface.bounding_box();
        let distance = MeshDistance::new(&body.surface);
        let sides = body.surface.mesh().sides(MOST_RAYS);
        let grids = self.grids_for(body.voxel);
        let grid = self.grid_holding(&bounds, &grids, &distance, &sides)?;
        let wide = grid.spacing() / body.voxel;
        if wide > 1.5 {
            self.watcher.note(&Note::CoarserThanVoxels {
                voxels: wide,
                cells: self.cells(),
            });
        }
        if !body.specks.is_empty() {
            self.watcher.warning(&Warning::Specks(body.specks));
        }
        let mut voxels = Voxels::new(body.surface.clone(), body.voxel);
        if self.keeps_volumes {
            voxels.keeps_volumes = true;
            let small = voxels.leave_small_parts(self.eps(&grid));
            if !small.is_empty() {
                self.watcher.warning(&Warning::SmallParts(small));
            }
        }
        let flowing = voxels.flowing();
        let field = self.mesh_field(&flowing, grid)?;
        let found = surfaces::phase_field_topology(&field)?.into();
        if found != Topology::of(&flowing) {
            let marched = self.marched(&field)?;
            let loss = self.loss(&flowing, &field, marched.as_ref(), found);
            self.watcher.warning(&Warning::Lost(loss));
        }
        let space = Space {
            voxels: Some(voxels),
            ..Space::default()
        };
        Ok(Loaded::Space(self.start(field, space)?))
    }

    /// As fine as the voxels, where that is possible.
    fn grids_for(&self, voxel: f64) -> Grids<'static> {
        if self.hardly_moves {
            Grids {
                part: OWN_PART[0],
                cells: &STAIRCASE_CELLS,
                spacing: Some((voxel, FINEST_FOR_VOXELS)),
            }
        } else {
            let finest = MESH_CELLS[MESH_CELLS.len() - 1];
            Grids {
                spacing: Some((voxel, finest)),
                ..Grids::usual(&MESH_CELLS)
            }
        }
    }

    fn mesh_field(&self, mesh: &ClosedMesh, grid: Grid<3>) -> Result<Stored<3>> {
        let eps = self.eps(&grid);
        let progress = self.watcher.begins("signed distance", grid.cells() as u64);
        let layer_done = || progress.advance();
        let reach = PURE_BEYOND * eps;
        let sample = |body: &ClosedMesh| {
            let distance = MeshDistance::new(body);
            if self.takes_bricks {
                // Bricks are stored if a cell in them is so near to one beside the surface.
                let near = solver::BRICK_REACH * eps + 2.0 * grid.spacing();
                distance.sample_near(near, reach, grid, &layer_done)
            } else {
                distance.sample_within(reach, grid, &layer_done)
            }
        };
        let (mut union, mut mended): (Option<Stored<3>>, usize) = (None, 0);
        for body in mesh.bodies() {
            let distance = timed(self.watcher, DISTANCES, || sample(&body))?;
            let (distance, nodes) = surfaces::mend_signs(distance);
            mended += nodes;
            union = Some(match union {
                Some(union) => surfaces::united(&union, &distance),
                None => distance,
            });
        }
        drop(progress);
        if mended > 0 {
            self.watcher
                .warning(&Warning::SignsMended { nodes: mended });
        }
        let distance = union.expect("there is a body");
        Ok(distance.map(|s| optimal_profile(s, eps)))
    }

    fn values<const D: usize, O: Presentation<D>>(
        &mut self,
        file: &File,
    ) -> Result<InitialShape<D, O>> {
        let is_said = self.options.field_kind.is_some();
        let kind = *self.options.field_kind.get_or_insert(FieldKind::PhaseField);
        let is_phase = kind == FieldKind::PhaseField;
        let side = *self.options.box_side.get_or_insert(usual_box::<D>().1);
        let mut field = file.field::<D>(side)?;
        let origin = field.grid().origin();
        self.options.box_side = Some(field.grid().side());
        let outside = field.values().iter().find(|u| u.abs() > LARGEST_PHASE);
        if let (true, Some(value)) = (is_phase, outside) {
            return Err(Error::NoPhase {
                path: file.path.clone(),
                value: *value,
            });
        }
        if is_phase && !is_said {
            check_range(field.values(), D, &file.path)?;
        }
        if self.options.cells.is_some() {
            // Distances are linear across the interface, as what lies between the nodes is taken to be.
            if is_phase {
                let eps = self.eps(field.grid());
                field = field.map(|u| distance_from_phase_field(u, eps));
            }
            let grid = self.grid()?.with_origin(origin)?;
            field = Field::from_fn(grid, |x| field.interpolate(x));
        }
        if !is_phase || self.options.cells.is_some() {
            let eps = self.eps(field.grid());
            field = field.map(|s| optimal_profile(s, eps));
        }
        let presentation = O::of_box(field.grid())?;
        self.start(field, presentation)
    }
}

/// Refuses values none of which is outside, such as those of a mask or of an image.
fn check_range(values: &[f64], dimension: usize, path: &Path) -> Result<()> {
    let all = [f64::INFINITY, f64::NEG_INFINITY];
    let range = values.iter();
    let [low, high] = range.fold(all, |[low, high], &u| [low.min(u), high.max(u)]);
    if low <= OUTSIDE || low >= high {
        return Ok(());
    }
    Err(Error::NoneOutside {
        path: path.to_owned(),
        low,
        high,
        dimension,
    })
}

/// How far the surface of a phase field is from a mesh.
fn far_from(mesh: &ClosedMesh, surface: Option<&ClosedMesh>, field: &Stored<3>) -> GridDistance {
    match surface {
        Some(surface) => GridDistance::AtMost {
            length: hausdorff_distance(surface, mesh),
            longest_side: mesh.bounding_box().longest_side(),
        },
        None if has_interface(field) => GridDistance::TouchesItself,
        None => GridDistance::Nothing,
    }
}

/// Refuses shapes of which there is nothing on the grid, or nothing else.
pub fn check_phases<const D: usize>(u: &impl PhaseField<D>, input: &str) -> Result<()> {
    if has_interface(u) {
        return Ok(());
    }
    let nodes = u.nodes().grid().len();
    Err(Error::NothingMoves {
        input: input.to_owned(),
        inside: if u.at([0; D]) > 0.0 { nodes } else { 0 },
        nodes,
    })
}

#[cfg(test)]
mod tests {
    use geometry::shapes::Ball;

    use super::*;
    use crate::events::Silent;

    /// A coarser grid may do where the finest one has too many nodes, or takes more memory than most machines have.
    #[test]
    fn a_grid_that_is_too_large_makes_no_shape_hopeless() {
        let ball = Ball::new([0.0; 3], 1.0).unwrap();
        let bounds = BoundingBox::around([[-1.0; 3], [1.0; 3]]).unwrap();
        let sides = [([1.0, 0.0, 0.0], [1.0, 0.0, 0.0], 1.0)];
        for box_side in [10.0, 7.5] {
            let mut options = InputOptions::of("builtin:sphere");
            options.box_side = Some(box_side);
            let mut reader = Reader::of(&mut options, 2.0, &Silent).unwrap();
            reader.whole = Some((DeviceKind::Flex, Flow::MeanCurvature));
            let grids = Grids::usual(&MESH_CELLS);
            assert!(!reader.is_hopeless(&bounds, &grids, &ball, &sides.into_iter()));
            assert_eq!((options.cells, options.side_length), (None, None));
        }
    }
}
