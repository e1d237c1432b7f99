//! Studies in the plane at the scales of the convergence tests: methods in their schemes at several resolutions, and their colours.

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
    #[arg(long, value_name = "NAME", value_enum)]
    pub scheme: Option<Scheme>,
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

    /// The chosen methods in their schemes at all resolutions; without a choice those that are `usual` at a resolution.
    pub fn variants(&self, flow: Flow, usual: impl Fn(Method, usize) -> bool) -> Vec<Variant> {
        let chosen = |method: Method, n: usize| match &self.methods[..] {
            [] => usual(method, n),
            methods => methods.contains(&method),
        };
        let mut variants = Vec::new();
        for method in Method::ALL {
            for scheme in method.chosen_schemes(flow, self.scheme) {
                let cells = self.cells().into_iter().filter(|&n| chosen(method, n));
                variants.extend(cells.map(|n| Variant::new(flow, (method, scheme), n)));
            }
        }
        variants
    }
}

#[derive(Serialize, Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    pub flow: Flow,
    pub method: Method,
    pub scheme: Scheme,
    pub n: usize,
}

impl Variant {
    pub fn new(flow: Flow, (method, scheme): (Method, Scheme), n: usize) -> Self {
        Self {
            flow,
            method,
            scheme,
            n,
        }
    }

    /// Adds columns that say of which variant a row is.
    pub fn columns<R>(sheet: Sheet<'_, R>, of: impl Fn(&R) -> Self) -> Sheet<'_, R> {
        sheet
            .data("n", |row| of(row).n)
            .data("method", |row| of(row).method.to_string())
            .data("scheme", |row| of(row).scheme.to_string())
    }

    /// Name in metrics after the flow or shape, such as `n128.hybrid_calibrated`.
    pub fn key(&self) -> String {
        format!("n{}.{}", self.n, self.method.key_in(self.scheme))
    }

    pub fn label(&self) -> String {
        self.method.label_in(self.scheme)
    }

    /// What decides its colour in figures.
    pub fn look(&self) -> (Method, Scheme) {
        (self.method, self.scheme)
    }
}

/// What is compared with what, with all operators.
pub struct Study {
    pub cells: BTreeSet<usize>,
    pub plan: Vec<(Variant, Operator<2>)>,
    pub networks: Chosen,
}

impl Study {
    /// The operators of all variants; variants without a network are left out if the accurate recipe has one for the resolution.
    pub fn new(options: &NetworkOptions, variants: &[Variant]) -> Result<Self> {
        let learned = variants.iter().filter(|v| takes_networks(v.look()));
        let needs = learned.map(|v| convergence_network(v.n));
        let networks = options.load(&needs.collect::<Result<Vec<_>, _>>()?)?;
        let mut plan = Vec::new();
        for variant in variants {
            let other = || networks.find(Scheme::Accurate, &convergence_network(variant.n)?);
            let operator = networks.operator(variant.look(), variant.n);
            let error = operator.as_ref().err();
            let error = error.and_then(|error| error.downcast_ref::<model::Error>());
            let is_missing = matches!(error, Some(model::Error::MissingNetwork { .. }));
            if !(is_missing && other().is_ok()) {
                plan.push((*variant, operator?));
            }
        }
        Ok(Self {
            cells: variants.iter().map(|v| v.n).collect(),
            plan,
            networks,
        })
    }

    pub fn variants(&self) -> impl Iterator<Item = Variant> {
        self.plan.iter().map(|(variant, _)| *variant)
    }

    /// Checksums of the networks of the variants, for the manifest.
    pub fn checksums(&self) -> BTreeMap<String, String> {
        let of = |(variant, operator): &(Variant, Operator<2>)| {
            Some((variant.key(), operator.network()?.network.fingerprint()))
        };
        self.plan.iter().filter_map(of).collect()
    }

    /// How much finer the finest resolution is, counted in resolutions.
    fn rank(&self, n: usize) -> usize {
        self.cells.iter().filter(|&&m| m > n).count()
    }

    fn dashes(&self, n: usize) -> LineStyle {
        use LineStyle::{Dashed, Dotted, ShortDashed, Solid};
        [Solid, Dashed, ShortDashed, Dotted][self.rank(n).min(3)]
    }

    pub fn marker(&self, n: usize) -> Marker {
        use Marker::{Circle, Diamond, Square, Triangle};
        [Circle, Square, Triangle, Diamond][self.rank(n).min(3)]
    }

    /// The curve of a variant: colours stand for methods in their schemes, dashes for resolutions. Such curves often coincide, so coarser
    /// ones are wider and show on both sides of finer ones.
    pub fn series(&self, variant: Variant, points: Vec<[f64; 2]>) -> Series {
        Series::new(format!("{}, n = {}", variant.label(), variant.n), points)
            .with_colour(colour(variant.method, variant.scheme))
            .with_style(self.dashes(variant.n))
            .with_width(1.8 + 1.4 * self.rank(variant.n) as f64)
    }

    /// A chart of such curves with a legend for all variants: methods, then resolutions.
    pub fn chart(&self, chart: LineChart, curves: impl IntoIterator<Item = Series>) -> LineChart {
        let planned = |look: &_| self.variants().any(|variant| variant.look() == *look);
        let methods = methods_in_schemes()
            .filter(planned)
            .map(|(method, scheme)| {
                let (label, colour) = (method.label_in(scheme), colour(method, scheme));
                LegendEntry::line(label, colour, LineStyle::Solid)
            });
        let cells = self.cells.iter();
        let resolutions =
            cells.map(|&n| LegendEntry::line(format!("n = {n}"), Colour::Black, self.dashes(n)));
        let chart = chart.with_curves(curves).with_entries(methods);
        chart.with_entries(resolutions)
    }
}

/// The methods in their schemes, in the order of legends.
pub fn methods_in_schemes() -> impl Iterator<Item = (Method, Scheme)> {
    let schemes = |method| Scheme::ALL.map(|scheme| (method, scheme));
    Method::ALL.into_iter().flat_map(schemes)
}

/// Colour of a method in a scheme, an entry of the palette.
pub fn colour(method: Method, scheme: Scheme) -> usize {
    match (method, scheme) {
        (Method::Hybrid, Scheme::Paper) => 0,
        (Method::Hybrid, Scheme::Calibrated) => 5,
        (Method::Hybrid, Scheme::Accurate) => 2,
        (Method::FeImplicit, Scheme::Paper) => 1,
        (Method::FeImplicit, _) => 4,
        (Method::FeSemi, Scheme::Paper) => 3,
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
