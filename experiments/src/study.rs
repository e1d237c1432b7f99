//! Studies in the plane at the scales of the convergence tests: discretizations at several resolutions, and their colours.

use geometry::contour::zero_level;

use crate::networks::{Chosen, NetworkOptions, convergence_network, takes_networks};
use crate::options::{RunOptions, distinct};
use crate::prelude::libraries::*;

/// Options of the studies.
#[derive(Args, Clone, Debug)]
pub struct StudyOptions {
    #[command(flatten)]
    pub run: RunOptions,

    #[command(flatten)]
    pub networks: NetworkOptions,

    /// Cells per unit length, separated by commas [default: 128,256; with --full 128,256,512]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub cells: Vec<usize>,

    /// Add n = 512
    #[arg(long, conflicts_with = "cells")]
    pub full: bool,

    /// Methods, separated by commas [default: all for mean curvature flow; for Willmore flow see above]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum)]
    pub methods: Vec<Method>,

    /// One scheme alone, where it makes a difference: paper, calibrated, or accurate, which is calibrated with the network of
    /// the accurate recipe [default: all]
    #[arg(long = "scheme", value_name = "NAME", value_enum)]
    pub formulation: Option<Formulation>,

    /// Leave out what has a name FLOW.nN.METHOD that begins like one of these, such as willmore.n1024 or mcf.n1024.fe, with the
    /// methods of results/METRICS.md; separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub without: Vec<String>,
}

impl StudyOptions {
    pub fn cells(&self) -> Vec<usize> {
        distinct(match (&self.cells[..], self.run.quick, self.full) {
            ([], true, _) => &[128],
            ([], false, false) => &[128, 256],
            ([], false, true) => &[128, 256, 512],
            (chosen, ..) => chosen,
        })
    }

    /// The chosen methods in their formulations at all resolutions; without a choice those that are `usual` at a resolution.
    pub fn variants(&self, flow: Flow, usual: impl Fn(Method, usize) -> bool) -> Vec<Variant> {
        let chosen = |method: Method, n: usize| match &self.methods[..] {
            [] => usual(method, n),
            methods => methods.contains(&method),
        };
        let mut variants = Vec::new();
        for method in Method::ALL {
            for formulation in method.chosen_formulations(flow, self.formulation) {
                let discretization = Discretization::new(method, formulation);
                let cells = self.cells().into_iter().filter(|&n| chosen(method, n));
                variants.extend(cells.map(|n| Variant::new(flow, discretization, n)));
            }
        }
        variants
    }

    /// All variants of a study but for those of `--without`.
    ///
    /// # Errors
    /// A name that leaves nothing out.
    pub fn left(&self, mut variants: Vec<Variant>) -> Result<Vec<Variant>> {
        for name in &self.without {
            let all = variants.len();
            variants.retain(|v| !format!("{}.{}", v.flow, v.key()).starts_with(name));
            require(
                variants.len() < all,
                format!("--without {name} leaves nothing out"),
            )?;
        }
        Ok(variants)
    }
}

#[derive(Serialize, Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    pub flow: Flow,
    #[serde(flatten)]
    pub discretization: Discretization,
    pub n: usize,
}

impl Variant {
    pub fn new(flow: Flow, discretization: Discretization, n: usize) -> Self {
        Self {
            flow,
            discretization,
            n,
        }
    }

    /// Adds columns that say of which variant a row is.
    pub fn columns<R>(sheet: Sheet<'_, R>, of: impl Fn(&R) -> Self) -> Sheet<'_, R> {
        sheet
            .data("n", |row| of(row).n)
            .data("method", |row| of(row).discretization.method.to_string())
            .data("scheme", |row| {
                of(row).discretization.formulation.to_string()
            })
    }

    /// Name in metrics after the flow or shape, such as `n128.hybrid_calibrated`.
    pub fn key(&self) -> String {
        format!("n{}.{}", self.n, self.discretization.key())
    }

    pub fn label(&self) -> String {
        self.discretization.label()
    }
}

/// A variant, and the operator by which it is run.
pub struct Planned {
    pub variant: Variant,
    pub operator: Operator<2>,
}

/// What is compared with what, with all operators.
pub struct Study {
    pub cells: BTreeSet<usize>,
    pub plan: Vec<Planned>,
    pub networks: Chosen,
}

impl Study {
    /// The operators of all variants; variants without a network are left out if the accurate recipe has one for the resolution.
    pub fn new(options: &NetworkOptions, variants: &[Variant]) -> Result<Self> {
        let learned = variants.iter().filter(|v| takes_networks(v.discretization));
        let needs = learned.map(|v| convergence_network(v.n));
        let networks = options.load(&needs.collect::<Result<Vec<_>, _>>()?)?;
        let mut plan = Vec::new();
        for &variant in variants {
            let other = || networks.find(Formulation::Accurate, &convergence_network(variant.n)?);
            let operator = networks.operator(variant.discretization, variant.n);
            let error = operator.as_ref().err();
            let error = error.and_then(|error| error.downcast_ref::<model::Error>());
            let is_missing = matches!(error, Some(model::Error::MissingNetwork { .. }));
            if !(is_missing && other().is_ok()) {
                let operator = operator?;
                plan.push(Planned { variant, operator });
            }
        }
        Ok(Self {
            cells: variants.iter().map(|v| v.n).collect(),
            plan,
            networks,
        })
    }

    pub fn variants(&self) -> impl Iterator<Item = Variant> {
        self.plan.iter().map(|planned| planned.variant)
    }

    /// Checksums of the networks of the variants, for the manifest.
    pub fn checksums(&self) -> BTreeMap<String, String> {
        let of = |Planned { variant, operator }: &Planned| {
            Some((variant.key(), operator.network()?.network.fingerprint()))
        };
        self.plan.iter().filter_map(of).collect()
    }

    /// How much finer the finest resolution is, counted in resolutions.
    fn rank(&self, n: usize) -> usize {
        self.cells.iter().filter(|&&m| m > n).count()
    }

    fn dashes(&self, n: usize) -> LineStyle {
        use LineStyle::{DashDotDot, Dashed, Dotted, ShortDashed, Solid};
        [Solid, Dashed, ShortDashed, Dotted, DashDotDot][self.rank(n).min(4)]
    }

    /// The curve of a variant: colours stand for discretizations, dashes for resolutions. Such curves often coincide, so coarser
    /// ones are wider and show on both sides of finer ones.
    pub fn series(&self, variant: Variant, points: Vec<[f64; 2]>) -> Series {
        Series::new(format!("{}, n = {}", variant.label(), variant.n), points)
            .with_colour(colour(variant.discretization))
            .with_style(self.dashes(variant.n))
            .with_width(1.8 + 1.4 * self.rank(variant.n) as f64)
    }

    /// A chart of such curves with a legend for all variants: methods, then resolutions.
    pub fn chart(&self, chart: LineChart, curves: impl IntoIterator<Item = Series>) -> LineChart {
        let is_planned = |discretization: &Discretization| {
            let mut variants = self.variants();
            variants.any(|variant| variant.discretization == *discretization)
        };
        let methods = discretizations().filter(is_planned).map(|discretization| {
            let (label, colour) = (discretization.label(), colour(discretization));
            LegendEntry::line(label, colour, LineStyle::Solid)
        });
        let cells = self.cells.iter();
        let resolutions =
            cells.map(|&n| LegendEntry::line(format!("n = {n}"), Colour::Black, self.dashes(n)));
        let chart = chart.with_curves(curves).with_entries(methods);
        chart.with_entries(resolutions)
    }
}

/// All methods in all formulations, in the order of legends.
pub fn discretizations() -> impl Iterator<Item = Discretization> {
    let formulations =
        |method| Formulation::ALL.map(|formulation| Discretization::new(method, formulation));
    Method::ALL.into_iter().flat_map(formulations)
}

/// Colour of a discretization, an entry of the palette.
pub fn colour(discretization: Discretization) -> usize {
    match (discretization.method, discretization.formulation) {
        (Method::Hybrid, Formulation::Paper) => 0,
        (Method::Hybrid, Formulation::Calibrated) => 5,
        (Method::Hybrid, Formulation::Accurate) => 2,
        (Method::FeImplicit, Formulation::Paper) => 1,
        (Method::FeImplicit, _) => 4,
        (Method::FeSemi, Formulation::Paper) => 3,
        (Method::FeSemi, _) => 6,
        (Method::Own, _) => 7,
    }
}

/// A power of two as figures write it, such as `2⁻¹⁴`.
pub fn power_of_two(value: f64) -> String {
    format!("2{}", report::superscript(value.log2().round() as i32))
}

/// The zero level of a phase field.
pub fn zero_level_curve(field: &Field<2>) -> Curve {
    let curves = zero_level(field).into_iter();
    Curve::new(curves.map(|curve| curve.points).collect::<Vec<_>>())
}

/// Mean over minimizations; nothing without any.
pub fn mean<'a>(
    minimizations: impl Iterator<Item = &'a StepRecord>,
    of: impl Fn(&StepRecord) -> f64,
) -> Option<f64> {
    let values: Vec<f64> = minimizations.map(of).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}
