//! The networks of the experiments: their training data, and their quality.

use model::training::SphereData;
use model::{Network, Quality, Ratios};

use crate::prelude::*;

/// What is said about networks.
pub const METRICS: MetricTable = MetricTable {
    title: "Networks",
    note: "Losses are the paper's: mean squares over the nodes of the unit cube and over the radii. `.adam`: trained by \
         the paper's Adam instead of Levenberg-Marquardt.",
    words: &[(
        "NETWORK",
        "`n128`, `n256`, `n512`, `n1024`, for the plane; `surfaces`; `inpainting`",
    )],
    rows: &[
        (
            "[train.]NETWORK[.adam].held_out_loss, [train.]NETWORK[.adam].flipped_loss",
            "loss on radii that were held out, evenly spread from 0.05 to 0.4; the same with both phases exchanged",
        ),
        (
            "[train.]NETWORK[.adam].identity_loss",
            "loss of the identity map on those radii, for scale",
        ),
        (
            "[train.]NETWORK[.adam].reference_loss, [train.]NETWORK[.adam].reference_flipped_loss",
            "losses on a fixed draw of forty radii",
        ),
        (
            "[train.]NETWORK[.adam].transfer_min, [train.]NETWORK[.adam].transfer_max, \
             [train.]NETWORK[.adam].transfer_imaginary",
            "extremes of the kernel's transfer function; its largest imaginary part, 0 for a symmetric kernel",
        ),
        (
            "[train.]NETWORK[.adam].phase_defect",
            "by how much the activation misses the pure phases, the larger of abs(F(1) - 1) and abs(F(-1) + 1)",
        ),
        (
            "[train.]NETWORK[.adam].activation_roughness",
            "largest change of `F''` over a short distance, relative to its largest value: spikes would show",
        ),
        (
            "[train.]NETWORK[.adam].radial_asymmetry",
            "spread of the kernel at equal distances from its centre, relative to its largest value",
        ),
        (
            "train.NETWORK[.adam].seconds, train.NETWORK[.adam].iterations",
            "wall time and iterations of the training",
        ),
    ],
};

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NetworkSpec {
    pub name: &'static str,
    pub ratios: Ratios,
    /// Cells per unit length of the training grid.
    pub cells: usize,
}

impl NetworkSpec {
    const fn new(name: &'static str, ratios: Ratios, cells: usize) -> Self {
        Self {
            name,
            ratios,
            cells,
        }
    }

    /// The networks of the accurate recipe: those of the paper's, and one for `eps = h`. `n64` to `n1024` have the scales of the
    /// convergence tests, `eps = 2^-6` and `tautilde = 2^-14`. Inpainting at `n = 1024` has `eps = 2^-8` and `tautilde = 2^-18`,
    /// which are the same ratios as those of the training at `n = 256`. The network of the surfaces serves `n = 64` with `eps = 2^-5` and
    /// `tautilde = 2^-12`; it is trained at `n = 128`, where the smallest sphere measures six cells.
    pub const ACCURATE: &'static [Self] = &[
        Self::new("n64", Ratios::of_run(2, 9, 1.0, 1.0, 0.25), 64),
        Self::new("n128", Ratios::of_run(2, 17, 1.0, 2.0, 1.0), 128),
        Self::new("n256", Ratios::of_run(2, 33, 1.0, 4.0, 4.0), 256),
        Self::new("n512", Ratios::of_run(2, 65, 1.0, 8.0, 16.0), 512),
        Self::new("n1024", Ratios::of_run(2, 129, 1.0, 16.0, 64.0), 1024),
        Self::new("inpainting", Ratios::of_run(2, 17, 1.0, 4.0, 4.0), 256),
        Self::new("surfaces", Ratios::of_run(3, 17, 1.0, 2.0, 1.0), 128),
    ];
    pub const PAPER: &'static [Self] = Self::ACCURATE.split_at(1).1;
    /// The networks that the paper shows, each with twice the resolution of the one before.
    pub const CONVERGENCE: &'static [Self] = Self::PAPER.split_at(3).0;
    pub const SURFACES: Self = Self::PAPER[5];

    pub fn data(&self, quick: bool) -> Result<SphereData> {
        let data = SphereData::new(self.ratios, self.cells)?;
        Ok(if quick { data.quick() } else { data })
    }

    /// The quality of a network on spheres that it was not trained on; adds the metrics.
    pub fn measure(&self, session: &mut Session, network: &Network) -> Result<Quality> {
        let (data, radii) = (self.data(false)?, held_out_radii(session.options.quick));
        let quality = session.phase(format!("quality of {}", self.name), |stage| {
            Ok(Quality::measure(network, &data, radii, stage.device)?)
        })?;
        session.summary.insert_record(self.name, &quality)?;
        Ok(quality)
    }
}

/// Networks are trained on a CPU: the same options, with one if their device is none.
pub fn in_double_precision(options: &RunOptions) -> Result<RunOptions> {
    let mut options = options.clone();
    if !options.open_device()?.kind().is_cpu() {
        let none = "training needs double precision: build with the feature `flex` or `ndarray`";
        let kind = DeviceKind::compiled().find(|kind| kind.is_cpu());
        options.device = Some(kind.ok_or(none)?.name().to_owned());
    }
    Ok(options)
}

pub fn held_out_radii(quick: bool) -> usize {
    if quick { 4 } else { 20 }
}

const LOSS: Format = Format::Scientific(2);
const TRANSFER: Format = Format::Fixed(5);

const QUALITY: [(&str, Format, fn(&Quality) -> f64); 10] = [
    ("held-out loss", LOSS, |q| q.held_out_loss),
    ("loss of -u", LOSS, |q| q.flipped_loss),
    ("identity", LOSS, |q| q.identity_loss),
    ("reference loss", LOSS, |q| q.reference_loss),
    ("reference, -u", LOSS, |q| q.reference_flipped_loss),
    ("transfer min", TRANSFER, |q| q.transfer_min),
    ("transfer max", TRANSFER, |q| q.transfer_max),
    ("|F(±1) ∓ 1|", LOSS, |q| q.phase_defect),
    ("roughness of F''", LOSS, |q| q.activation_roughness),
    ("radial asymmetry", LOSS, |q| q.radial_asymmetry),
];

/// Adds columns with the quality of networks; as metrics they are all fields of [`Quality`].
pub fn quality<'a, R>(mut sheet: Sheet<'a, R>, of: impl Fn(&'a R) -> &'a Quality) -> Sheet<'a, R> {
    for (head, format, value) in QUALITY {
        sheet = sheet.column(head, format, |row| value(of(row)));
    }
    sheet
}
