use std::f64::consts::PI;

use crate::file::File;
use crate::input::{Loaded, RepairCells, Source, closed};
use crate::keep;
use crate::options::{FairOptions, WillmoreOptions};
use crate::own::OwnMesh;
use crate::parts::{DETAIL, MAX_DISTANCE};
use crate::paths::{absolute, to_text};
use crate::prelude::*;
use crate::values::SizeTarget;
use surfaces::Edges;

/// Energies below this have only balls, which have `8 pi`.
const BALL: f64 = 1.2 * 8.0 * PI;

/// The flow of a segmentation ends at the fourth power of so many times the radius below which details go. Of a bump with a Gaussian profile, whose
/// height is halved at this radius, the flow leaves 0.37 of the height, of one with half the radius 0.12, and of one with twice the radius 0.79.
const TIME_OF_DETAIL: f64 = 0.8;
/// The surface goes no further than so many voxels, root of the mean square, unless the radius is given.
const FARTHEST: f64 = 0.35;

/// Where more than this part of the vertices is flat, edges may have been taken for noise.
const FLAT: f64 = 0.05;
/// Less noise than this part of the longest side is taken off also where it may be the shape, which hardly moves.
const LITTLE: f64 = 1e-4;

impl FairOptions {
    /// Whether it ends as soon as something is reached, which must not be jumped over.
    pub(crate) fn takes_small_steps(&self) -> bool {
        let ratio = self.energy_ratio.or(self.willmore.energy);
        let details = self.noise.or(self.detail);
        details.is_some() || ratio.is_some() || !self.says_when_to_end()
    }

    /// Whether an option other than the noise and the details says when it ends.
    pub(crate) fn says_when_to_end(&self) -> bool {
        self.energy_ratio.is_some()
            || self.willmore.energy.is_some()
            || self.run.time.is_some()
            || self.run.steps.is_some()
    }

    /// An option that is given and says something of the vertices of a mesh in a file.
    fn option_of_meshes(&self) -> Option<&'static str> {
        let given = [
            ("noise", self.noise.is_some()),
            ("keep", self.keep.is_some()),
            ("edges", self.edges.is_some()),
        ];
        let mut given = given.into_iter().filter(|(_, is_given)| *is_given);
        given.next().map(|(name, _)| name)
    }

    pub(crate) fn check(&self) -> Result<()> {
        if let Some(ratio) = self.energy_ratio.filter(|ratio| *ratio >= 1.0) {
            return Err(Refusal::EnergyRatio(ratio).into());
        }
        if let Some(energy) = self.willmore.energy.filter(|energy| *energy < BALL) {
            return Err(Refusal::EnergyOfBall(energy).into());
        }
        Ok(())
    }

    pub(crate) fn load(&mut self, device: DeviceKind, watcher: &dyn Watcher) -> Result<Loaded> {
        let ends = self.says_when_to_end();
        let of_meshes = self.option_of_meshes();
        let mut reader = self.input.reader(&self.operator, device, watcher)?;
        reader.allows_loss = Some(self.allow_loss);
        if self.detail.is_some() && !matches!(reader.source, Source::Volume(_)) {
            let what = "an input that is no segmentation";
            return Err(Error::foreign("detail", "", what));
        }
        let is_bounded = matches!(reader.source, Source::Volume(_) | Source::Mesh(_));
        if self.max_distance.is_some() && !is_bounded {
            let what = "an input that is neither a mesh nor a segmentation";
            return Err(Error::foreign("max_distance", "", what));
        }
        if reader.is_planar()? {
            return Err(Refusal::FairInPlane.into());
        }
        let loaded = match reader.source.clone() {
            Source::Mesh(file) => return self.load_mesh(&file, device, watcher),
            Source::Volume(_) if of_meshes.is_some() => {
                let given = of_meshes.unwrap_or_default();
                let what = "a volume, of which a new mesh is made";
                return Err(Error::foreign(given, "", what));
            }
            Source::Volume(_) => {
                let willmore = &mut self.willmore;
                // That of the voxels is kept.
                if willmore.reduced_volume.is_none() {
                    willmore.volume.get_or_insert(SizeTarget::Keep);
                }
                reader.keeps_volumes = willmore.volume == Some(SizeTarget::Keep);
                reader.hardly_moves = self.detail.is_some() || !ends;
                let mut loaded = reader.load()?;
                if let Loaded::Space(start) = &mut loaded
                    && let Some(voxels) = &mut start.presentation.voxels
                {
                    let usual = DETAIL * voxels.side;
                    let detail = self.detail.or((!ends).then_some(usual));
                    voxels.time = detail.map(|detail| (TIME_OF_DETAIL * detail).powi(4));
                    voxels.detail = detail.unwrap_or(usual);
                    let usual = detail.map(|_| MAX_DISTANCE * voxels.side);
                    voxels.max_distance = self.max_distance.or(usual);
                    if !ends && self.detail.is_none() {
                        voxels.farthest = Some(FARTHEST * voxels.side);
                    }
                }
                loaded
            }
            _ if of_meshes.is_some() || !ends => {
                return Err(Refusal::NoiseOfNoMesh.into());
            }
            _ => reader.load()?,
        };
        if let Loaded::Plane(_) = loaded {
            return Err(Refusal::FairInPlane.into());
        }
        Ok(loaded)
    }

    fn load_mesh(
        &mut self,
        file: &File,
        device: DeviceKind,
        watcher: &dyn Watcher,
    ) -> Result<Loaded> {
        let (path, repairs) = (&file.path, self.input.repair);
        if repairs && !self.remesh {
            return Err(Refusal::RepairWithoutRemesh.into());
        }
        if let Some(mask) = self.keep.as_deref().and_then(keep::mask) {
            self.keep = Some(to_text(absolute(mask)?.as_os_str()));
        }
        let bytes = if repairs {
            let repaired = closed(file, RepairCells::of(&self.input), watcher)?;
            surfaces::encode_with_up(path, repaired.mesh(), file.up_axis()?)?
        } else {
            file.read()?.into_owned()
        };
        let noise = self.noise.or(self.says_when_to_end().then_some(0.0));
        let edges = self.edges.unwrap_or_default();
        if self.edges.is_some_and(|edges| edges != Edges::Round) {
            let what = match (self.remesh, noise) {
                (true, _) => Some("`remesh`, which makes new edges"),
                (_, Some(0.0)) => Some("a flow that takes no noise off"),
                _ => None,
            };
            if let Some(what) = what {
                return Err(Error::foreign("edges", "", what));
            }
        }
        let WillmoreOptions {
            volume,
            reduced_volume,
            ..
        } = self.willmore;
        let (mut own, changes) = OwnMesh::new(path, bytes, noise, self.keep.clone(), self.remesh)?;
        own.max_distance = self.max_distance;
        own.set_edges(edges);
        own.check_movable(path)?;
        own.keeps_volume = volume == Some(SizeTarget::Keep);
        own.drives_volume = matches!(volume, Some(SizeTarget::To(_))) || reduced_volume.is_some();
        for change in changes {
            // Vertices that stay do so in the file, too.
            let stays = matches!(change, surfaces::Warning::Stay { .. });
            watcher.warning(&Warning::Mended {
                path: path.clone(),
                change,
                only_for_flow: !self.remesh && !stays,
            });
        }
        if own.fairing().noise > 0.0 && own.drives_volume {
            return Err(Refusal::NoiseAndVolume.into());
        }
        if let Some(estimate) = own.noise_estimate() {
            let noise = estimate.deviation;
            if noise == 0.0 {
                return Err(Refusal::NoNoise.into());
            }
            let longest_side = own.rough().bounding_box().longest_side();
            // What is left of noise by a repair is in longer waves, as a shape is.
            if !repairs && noise > LITTLE * longest_side && estimate.is_shape {
                return Err(Refusal::NoiseOfShape {
                    percent: 100.0 * noise / longest_side,
                }
                .into());
            }
            watcher.note(&Note::Noise {
                noise,
                longest_side,
            });
            if estimate.flat_part > FLAT {
                let part = estimate.flat_part;
                watcher.warning(&Warning::Flat { part });
            }
            self.noise = Some(noise);
        }
        let mut reader = self.input.reader(&self.operator, device, watcher)?;
        reader.allows_loss = Some(self.allow_loss);
        reader.own(own, file)
    }
}
