//! All labels of a segmentation at once, with walls that neighbours share.

mod depths;

use std::time::Instant;

use depths::Depths;
use pages::five_digits;
use rayon::prelude::*;
use surfaces::{Bound, LabelLattice, LabelMesh};
use volumes::{Values, Volume};

use crate::file::Input;
use crate::options::FairOptions;
use crate::paths::{absolute, extension};
use crate::prelude::*;
use crate::session::{Flowed, flow_of_voxels};
use crate::values::{Label, SizeTarget};
use crate::volume::{self, named};
use crate::words::signed;

/// Cells of the lattice of the walls around all labels.
const MARGIN: f64 = 3.0;
/// Nodes of this lattice, at most.
const MOST_NODES: f64 = 1e9;
/// Rounds in which a length for each label is found that is added to its depths, so that the volumes are right.
const OFFSETS: usize = 4;
/// The same for the counts of voxels, which are whole numbers.
const COUNTS: usize = 12;
/// The rounds end when the walls move by less than this part of a voxel.
const ENOUGH: f64 = 0.002;
/// Rounds that make triangles of walls better.
const ROUNDS: usize = 8;

/// The smooth labels of a segmentation, which fill space without gaps and overlaps.
#[derive(Clone, Debug)]
pub struct SharedLabels {
    /// The walls. Their labels are counted: see `names`.
    pub walls: LabelMesh,
    /// The labels by the numbers that they have in `walls`, the background first.
    pub names: Vec<i32>,
    /// The smooth labels in the voxels of the input.
    pub voxels: Volume,
    /// What became of the labels.
    pub report: SharedReport,
}

/// What became of labels with shared walls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SharedReport {
    /// The labels but the background.
    pub labels: Vec<LabelReport>,
    /// The number of triangles.
    pub triangles: usize,
    /// The number of edges where three labels or more meet.
    pub junction_edges: usize,
    /// Distance of the vertices from the surfaces between the voxels, root of the mean square, in the units of the input.
    pub displacement_rms: f64,
    /// The largest such distance.
    pub displacement_largest: f64,
    /// The largest distance that was allowed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_distance: Option<f64>,
    /// How many vertices are at this distance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertices_at_max_distance: Option<usize>,
    /// Wall time.
    pub seconds: f64,
}

/// What became of a label.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LabelReport {
    /// The label.
    pub label: i32,
    /// The volume of its voxels without specks, which are left out.
    pub volume_before: f64,
    /// The volume within its walls.
    pub volume_after: f64,
    /// The number of its voxels in the smooth segmentation.
    pub voxels_after: usize,
}

impl LabelReport {
    /// The change of the volume in percent.
    pub fn change_percent(&self) -> f64 {
        100.0 * (self.volume_after / self.volume_before - 1.0)
    }
}

impl SharedReport {
    /// As a JSON object.
    pub fn to_json(&self) -> Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    /// What became of the labels, each in a sentence.
    pub fn sentences(&self) -> Vec<String> {
        let count = self.labels.len();
        let plural = if count == 1 { "" } else { "s" };
        let mut text = vec![format!(
            "{count} label{plural} with shared walls in {:.1} s: {} triangles, {} edges where three labels or more meet",
            self.seconds, self.triangles, self.junction_edges
        )];
        text.extend(self.labels.iter().map(|label| {
            format!(
                "label {}: volume {}, {} %",
                label.label,
                five_digits(label.volume_after),
                signed(label.change_percent(), 4)
            )
        }));
        let bound = match (self.max_distance, self.vertices_at_max_distance) {
            (Some(length), Some(count)) if count > 0 => format!(
                "; vertices at the distance {} that `max_distance` allows: {count}",
                five_digits(length)
            ),
            _ => String::new(),
        };
        text.push(format!(
            "the walls moved by {:.3e} (root mean square) and {:.3e} at most{bound}",
            self.displacement_rms, self.displacement_largest
        ));
        text
    }
}

impl SharedLabels {
    /// The closed surface of one label; its vertices on walls are those of the neighbour.
    pub fn surface(&self, label: i32) -> Option<TriangleMesh> {
        let number = self.names.iter().position(|&name| name == label)?;
        Some(self.walls.of_label(number as u32))
    }

    /// Writes the walls as `.ply` or `.obj`, a mesh of each label as `.stl`, or the smooth labels as `.nii` or `.nii.gz`.
    ///
    /// # Errors
    /// Other files, and those that cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        match &*extension(path) {
            "stl" => {
                for &label in &self.names[1..] {
                    let surface = self.surface(label).unwrap_or_default();
                    if !surface.faces.is_empty() {
                        surfaces::write(named(path, label.into()), &surface)?;
                    }
                }
                Ok(())
            }
            "nii" | "gz" => Ok(volumes::write(path, &self.voxels)?),
            _ => {
                let bytes = self.walls.encode(path, &self.names)?;
                Ok(files::write_atomically(path, |out| out.write_all(&bytes))?)
            }
        }
    }
}

impl FairOptions {
    /// Refuses what has no meaning for shared walls.
    fn check_shared(&self) -> Result<()> {
        if self.input.label != Some(Label::All) {
            return Err(Refusal::SharedOfNoLabels.into());
        }
        let willmore = &self.willmore;
        let keeps = "which keeps the volume of each label";
        let alone = "which writes no folder of a run";
        let sizes = [
            willmore
                .volume
                .is_some_and(|volume| volume != SizeTarget::Keep),
            willmore.area.is_some(),
            willmore.reduced_volume.is_some(),
        ];
        let of_folders = [
            self.run.output.is_some(),
            self.run.frames.is_some(),
            self.format.is_some(),
        ];
        let sizes = ["volume", "area", "reduced_volume"].into_iter().zip(sizes);
        let of_folders = ["output", "frames", "format"].into_iter().zip(of_folders);
        let up = (
            "up",
            self.run.up.is_some(),
            "which names no axis that points up",
        );
        let given = sizes.map(|(option, given)| (option, given, keeps));
        let given = given.chain(of_folders.map(|(option, given)| (option, given, alone)));
        let mut given = given.chain([up]);
        match given.find(|(_, given, _)| *given) {
            Some((option, _, why)) => Err(Refusal::Shared { option, why }.into()),
            None => Ok(()),
        }
    }
}

/// Smooths all labels of a segmentation together and writes them to the file of `save`.
///
/// # Errors
/// As [`shared_labels`], and a file that is not given, of another kind, or there already.
pub fn shared_labels_to_file(
    mut options: FairOptions,
    watcher: &dyn Watcher,
) -> Result<SharedLabels> {
    let Some(path) = options.run.save.take() else {
        return Err(Refusal::SharedFile { file: None }.into());
    };
    let name = path.to_string_lossy().to_lowercase();
    let known = [".ply", ".obj", ".stl", ".nii", ".nii.gz"];
    if !known.iter().any(|end| name.ends_with(end)) {
        return Err(Refusal::SharedFile { file: Some(path) }.into());
    }
    options.check_shared()?;
    let path = absolute(&path)?;
    if extension(&path) == "stl" {
        for label in volume::labels(&options.input)?.into_iter().flatten() {
            options.run.force.check(&named(&path, label))?;
        }
    } else {
        options.run.force.check(&path)?;
    }
    let made = shared_labels(options, watcher)?;
    made.save(&path)?;
    Ok(made)
}

/// Smooths all labels of a segmentation together, in memory: each by the flow that [`surfaces_of_labels`](crate::surfaces_of_labels) makes, and the
/// background too, as what is outside of all labels together. A point belongs to the label in which it is deepest: the depth is minus the signed
/// distance, plus a length for each label, so that all labels keep the volumes of their voxels.
///
/// # Errors
/// As [`run_in_memory`](crate::run_in_memory), and for a volume without labels.
pub fn shared_labels(mut options: FairOptions, watcher: &dyn Watcher) -> Result<SharedLabels> {
    options.input.label = Some(Label::All);
    options.check_shared()?;
    let clock = Instant::now();
    let Some(labels) = volume::labels(&options.input)? else {
        return Err(Refusal::SharedOfNoLabels.into());
    };
    let narrow = |&label: &i64| i32::try_from(label).map_err(|_| Refusal::LargeLabel(label));
    let names = std::iter::once(Ok(0)).chain(labels.iter().map(narrow));
    let names: Vec<i32> = names.collect::<Result<_, _>>()?;
    let input = options.input.input.clone().ok_or(Error::NoInput)?;
    let file = input.file()?;
    let mut volume = file.volume(options.input.frame)?.into_owned();
    // Once, and not by the flow of each label.
    volume::tell(&file, &volume.take_warnings(), watcher);
    options.input.frame = None;
    let mut flows = Vec::new();
    for &label in &labels {
        let voxels = input.with_volume(volume.clone());
        flows.push(flow(&options, voxels, label, watcher)?);
    }
    let all = if labels.len() > 1 {
        let voxels = input.with_volume(volume.labels_as_one()?);
        Some(flow(&options, voxels, 1, watcher)?)
    } else {
        None
    };
    let bounds = flows.iter().chain(&all).map(|flow| flow.voxels.surface());
    let max_distance = flows[0].voxels.max_distance;
    let bound = Bound::of_nearest(bounds, max_distance.unwrap_or(f64::MAX));
    let mut shared = Sharing::new(&flows, all.as_ref())?;
    let walls = shared
        .walls()?
        .relaxed(ROUNDS, &|pair, x| shared.depths.between(pair, x));
    let walls = walls.with_volumes(&shared.volumes, |_| true);
    let walls = walls.held(&bound, |walls, free| {
        walls.with_volumes(&shared.volumes, |vertex| free[vertex])
    });
    let (voxels, counts) = shared.voxels(&volume, &names, &walls)?;
    let lengths = bound.lengths(&walls.mesh);
    let mut report = shared.report(&names, &walls, &counts, &lengths);
    if let Some(length) = max_distance {
        report.bound(length, &bound.reached(&walls.mesh));
    }
    report.seconds = clock.elapsed().as_secs_f64();
    Ok(SharedLabels {
        walls,
        names,
        voxels,
        report,
    })
}

/// The number of labels that nothing is left of, and the sum of the squares of what labels lack or have too much over what they should have. So a voxel
/// of a small label, and some of a large one, count alike.
fn wrong_part(missing: &[f64], wanted: &[f64]) -> [f64; 2] {
    let labels = missing.iter().zip(wanted).skip(1);
    let gone = labels.clone().filter(|(missing, all)| missing >= all);
    let squares = labels.map(|(missing, all)| missing * missing / all);
    [gone.count() as f64, squares.sum()]
}

/// The flow of one label.
fn flow(options: &FairOptions, input: Input, label: i64, watcher: &dyn Watcher) -> Result<Flowed> {
    if watcher.interrupt()?.requested() {
        return Err(Error::Interrupted);
    }
    let mut one = options.clone();
    one.input.input = Some(input);
    one.input.label = Some(Label::One(label));
    flow_of_voxels(one, watcher)
}

/// Labels that share space.
struct Sharing {
    depths: Depths,
    /// The volumes of the labels; of the background none is asked for.
    volumes: Vec<f64>,
    /// The lattice of the walls, without labels.
    lattice: LabelLattice,
}

impl Sharing {
    fn new(flows: &[Flowed], all: Option<&Flowed>) -> Result<Self> {
        let volumes = flows.iter().map(|flow| flow.voxels.surface().volume());
        let boxes = flows
            .iter()
            .map(|flow| flow.voxels.surface().bounding_box());
        let corners = boxes.flat_map(|bounds| [bounds.lower, bounds.upper]);
        let spacing = flows[0].voxels.side;
        let bounds = BoundingBox::around(corners).expect("there are labels");
        let bounds = bounds.grown([MARGIN * spacing; 3]);
        let cells = [0, 1, 2].map(|axis| (bounds.upper[axis] - bounds.lower[axis]) / spacing);
        let size = cells.map(|cells| cells.ceil() as usize + 1);
        let nodes = size.iter().map(|&n| n as f64).product::<f64>();
        if nodes > MOST_NODES {
            return Err(Refusal::TooManySharedNodes {
                nodes,
                most: MOST_NODES,
            }
            .into());
        }
        Ok(Self {
            depths: Depths::new(flows, all)?,
            volumes: std::iter::once(0.0).chain(volumes).collect(),
            lattice: LabelLattice {
                size,
                origin: bounds.lower,
                spacing,
                labels: Vec::new(),
            },
        })
    }

    /// The walls where labels are equally deep, with lengths added to the depths that make volumes right.
    fn walls(&mut self) -> Result<LabelMesh> {
        let mut walls = self.marched()?;
        for _ in 0..OFFSETS {
            let now = walls.relaxed(0, &|pair, x| self.depths.between(pair, x));
            let volumes = now
                .volumes(self.volumes.len())
                .into_iter()
                .zip(&self.volumes);
            let missing: Vec<f64> = volumes.map(|(now, wanted)| wanted - now).collect();
            if self.grow(&now, missing) < ENOUGH * self.lattice.spacing {
                break;
            }
            walls = self.marched()?;
        }
        Ok(walls)
    }

    fn marched(&self) -> Result<LabelMesh> {
        Ok(self.depths.on(&self.lattice).walls()?)
    }

    /// Adds to the depths what gives labels so much more volume, and returns by how much walls move at most.
    fn grow(&mut self, walls: &LabelMesh, missing: Vec<f64>) -> f64 {
        let spacing = self.lattice.spacing;
        let has_walls = walls.volumes(missing.len());
        let lengths = walls.lengths(missing);
        let mut largest = 0.0_f64;
        for label in 1..lengths.len() {
            // A label that nothing is left of comes back when it is deep enough.
            let length = if has_walls[label] == 0.0 {
                0.5 * spacing
            } else {
                lengths[label].clamp(-0.5 * spacing, 0.5 * spacing)
            };
            // Between two labels, the wall moves by half of the difference of what is added.
            self.depths.offsets[label] += 2.0 * length;
            largest = largest.max(length.abs());
        }
        largest
    }

    /// The voxels with the labels in which they are deepest, as many of each label as its volume is, up to small numbers; and their counts.
    fn voxels(
        &mut self,
        volume: &Volume,
        names: &[i32],
        walls: &LabelMesh,
    ) -> Result<(Volume, Vec<usize>)> {
        let offsets = self.depths.offsets.clone();
        let (mut best, mut least) = (Vec::new(), [f64::INFINITY; 2]);
        let (mut from, mut part) = ((offsets.clone(), Vec::new()), 1.0);
        for _ in 0..COUNTS {
            let labels = self.in_voxels(volume);
            let counts = counted(&labels, names.len());
            let counts = counts.iter().zip(&self.volumes).skip(1);
            let missing =
                counts.map(|(&count, wanted)| wanted - count as f64 * volume.voxel_volume());
            let missing: Vec<f64> = std::iter::once(0.0).chain(missing).collect();
            let wrong = wrong_part(&missing, &self.volumes);
            if wrong < least {
                (best, least, part) = (labels, wrong, 1.0);
                from = (self.depths.offsets.clone(), missing);
            } else {
                // Counts go in steps, for which all that is missing may be too much.
                part *= 0.5;
            }
            let (offsets, missing) = &from;
            let missing = missing.iter().map(|missing| part * missing).collect();
            self.depths.offsets.clone_from(offsets);
            self.grow(walls, missing);
        }
        self.depths.offsets = offsets;
        let counts = counted(&best, names.len());
        let best: Vec<i32> = best
            .into_iter()
            .map(|label| names[label as usize])
            .collect();
        Ok((volume.with_values(&Values::I32(best))?, counts))
    }

    fn in_voxels(&self, volume: &Volume) -> Vec<u32> {
        let [x, y, _] = volume.size();
        let voxels = (0..volume.len()).into_par_iter();
        let labels = voxels.map(|voxel| {
            let place = [voxel % x, voxel / x % y, voxel / (x * y)];
            self.depths.label(volume.position(place.map(|i| i as f64)))
        });
        labels.collect()
    }

    fn report(
        &self,
        names: &[i32],
        walls: &LabelMesh,
        counts: &[usize],
        lengths: &[f64],
    ) -> SharedReport {
        let after = walls.volumes(names.len());
        let labels = (1..names.len()).map(|number| LabelReport {
            label: names[number],
            volume_before: self.volumes[number],
            volume_after: after[number],
            voxels_after: counts[number],
        });
        let squares: f64 = lengths.iter().map(|length| length * length).sum();
        SharedReport {
            labels: labels.collect(),
            triangles: walls.mesh.faces.len(),
            junction_edges: walls.junctions().len(),
            displacement_rms: (squares / lengths.len().max(1) as f64).sqrt(),
            displacement_largest: lengths.iter().copied().fold(0.0, f64::max),
            max_distance: None,
            vertices_at_max_distance: None,
            seconds: 0.0,
        }
    }
}

impl SharedReport {
    fn bound(&mut self, length: f64, reached: &[bool]) {
        self.max_distance = Some(length);
        self.vertices_at_max_distance = Some(reached.iter().filter(|at| **at).count());
    }
}

fn counted(labels: &[u32], count: usize) -> Vec<usize> {
    let mut counts = vec![0; count];
    for &label in labels {
        counts[label as usize] += 1;
    }
    counts
}
