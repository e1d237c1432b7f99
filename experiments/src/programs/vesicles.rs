//! Lipid vesicles: area and volume held.

use crate::equilibria::{self, AtRest, Equilibrium, Exact};
use crate::prelude::*;
use crate::surfaces::{Setting, View, raster, willmore_flow};
use reference::equilibria::{Branch, Vesicle, vesicles};
use render::{Quality, Scene};

const TITLE: &str = "Vesicles: least bending energy with given area and volume";
const VIEW: View = View {
    up: UpAxis::Z,
    azimuth: 30.0,
    elevation: 25.0,
};

/// Shapes of a branch, each flowing from the relaxed one before it.
struct Family {
    branch: Branch,
    name: &'static str,
    reduced_volumes: &'static [f64],
    /// Of the sphere with the same area.
    radius: f64,
    /// Cells per unit length of a quick run and of the whole one.
    cells: [usize; 2],
}

/// The two sides of oblate shapes must be several interface widths apart in the middle: with half as many cells they break through below .62. Longer
/// prolate shapes come to the side of the box.
const FAMILIES: [Family; 2] = [
    Family {
        branch: Branch::Prolate,
        name: "prolate",
        reduced_volumes: &[0.95, 0.9, 0.8, 0.7, 0.65],
        radius: 0.4,
        cells: [32, 64],
    },
    Family {
        branch: Branch::Oblate,
        name: "oblate",
        reduced_volumes: &[0.7, 0.65, 0.6],
        radius: 0.6,
        cells: [32, 128],
    },
];
/// Side of the box.
const SIDE: f64 = 2.0;

/// Willmore flow of spheroids with area and volume held until rest, by the accurate operator, eps = 2h: energies, profiles and pictures
/// along the reduced volume, against exact axisymmetric equilibria; the phase diagram.
#[derive(Parser, Debug)]
#[command(name = "vesicles", version)]
pub struct Options {
    #[command(flatten)]
    figure: FigureOptions,
}

struct Pair {
    branch: &'static str,
    at_rest: AtRest<3>,
    exact: Vesicle,
}

pub fn program(options: &Options) -> Result<(), Error> {
    let run = &options.figure.run;
    let (count, steps) = if run.quick {
        (1, Some(2))
    } else {
        (usize::MAX, None)
    };
    let device = run.open_device()?;
    let settings = (FAMILIES.iter().take(count))
        .map(|family| Setting::new(&options.figure, family.cells, SIDE))
        .collect::<Result<Vec<_>, Error>>()?;
    let families = FAMILIES.iter().zip(&settings).map(|(family, setting)| {
        json!({ "branch": family.name, "reduced_volumes": family.reduced_volumes, "radius": family.radius, "n": setting.n })
    });
    let families: Vec<Value> = families.collect();
    let parameters = settings[0].parameters(json!({ "families": families }))?;
    let mut session = Session::open("vesicles", run, device, parameters)?;
    let (mut all, mut pairs) = (Vec::new(), Vec::new());
    for (family, setting) in FAMILIES.iter().zip(&settings) {
        let name = family.name;
        let volumes = &family.reduced_volumes[..family.reduced_volumes.len().min(count)];
        let title = format!("exact vesicles: {name}");
        let exact = session.phase(title, |_| Ok(vesicles(family.branch, 0.0, volumes)?))?;
        let mut relaxed = None;
        for (&ratio, exact) in volumes.iter().zip(exact) {
            let equilibrium = family.equilibrium(ratio, &exact);
            let operator = setting.operator((Method::Hybrid, Scheme::Accurate))?;
            let initial = match relaxed {
                Some(shape) => shape,
                None => equilibrium.start(setting.grid, setting.scales.eps, 0.5)?,
            };
            let rule = (StepRule::ByEnergy(None), 1);
            let case = willmore_flow(name, initial, operator, setting.scales, rule);
            let at_rest = equilibrium.relax(&mut session, case, steps)?;
            relaxed = Some(at_rest.field.clone());
            all.push(at_rest);
            pairs.push((name, exact));
        }
    }
    session.sheet(equilibria::sheet(&all), "energies")?;
    let pairs: Vec<Pair> = (all.into_iter().zip(pairs))
        .map(|(at_rest, (branch, exact))| Pair {
            branch,
            at_rest,
            exact,
        })
        .collect();
    let own = crossing(&pairs, Pair::energy);
    let exact = crossing(&pairs, |pair| pair.exact.energy() / (8.0 * PI));
    session.metrics(
        "vesicles.crossing",
        [("prolate_oblate", own.into()), ("exact", exact.into())],
    )?;
    let diagram = diagram(&mut session, &pairs)?;
    session.figure(diagram, "diagram")?;
    session.figure(shapes(&pairs, run.quick)?, "shapes")?;
    session.finish(TITLE)
}

impl Family {
    fn equilibrium(&self, ratio: f64, exact: &Vesicle) -> Equilibrium {
        let (name, radius) = (self.name, self.radius);
        Equilibrium {
            key: format!("vesicles.{name}.v{ratio:.2}"),
            title: format!("{name}, v = {ratio:.2}"),
            radius,
            ratio,
            prolate: self.branch == Branch::Prolate,
            exact: Exact {
                energy: exact.energy(),
                tension: exact.tension / radius.powi(2),
                pressure: -exact.pressure / radius.powi(3),
            },
        }
    }
}

impl Pair {
    /// In units of the sphere's.
    fn energy(&self) -> f64 {
        self.at_rest.zero_set.willmore_energy / (8.0 * PI)
    }

    fn ratio(&self) -> f64 {
        self.at_rest.equilibrium.ratio
    }
}

/// The reduced volume at which the energies of prolate and oblate shapes are the same, by straight lines between the reduced volumes that both
/// have, which are off by less than .001.
fn crossing(pairs: &[Pair], energy: impl Fn(&Pair) -> f64) -> Option<f64> {
    let of = |branch| pairs.iter().filter(move |pair| pair.branch == branch);
    let both: Vec<[f64; 2]> = of("prolate")
        .filter_map(|prolate| {
            let oblate = of("oblate")
                .find(|oblate| oblate.ratio().to_bits() == prolate.ratio().to_bits())?;
            Some([prolate.ratio(), energy(prolate) - energy(oblate)])
        })
        .collect();
    let crossing = both
        .windows(2)
        .find(|pair| pair[0][1] * pair[1][1] <= 0.0)?;
    let [[v, a], [w, b]] = [crossing[0], crossing[1]];
    Some(v + (w - v) * a / (a - b))
}

/// Exact branches as lines, the flow's shapes as marks.
fn diagram(session: &mut Session<'_>, pairs: &[Pair]) -> Result<Figure, Error> {
    let branches = [
        (Branch::Prolate, "prolate", (0.99, 0.5), Marker::Circle),
        (Branch::Oblate, "oblate", (0.99, 0.51), Marker::Square),
        (
            Branch::Stomatocyte,
            "stomatocyte",
            (0.65, 0.4),
            Marker::Diamond,
        ),
    ];
    let mut curves = Vec::new();
    for (colour, (branch, name, (from, to), marker)) in branches.into_iter().enumerate() {
        let volumes: Vec<f64> = (0..=60)
            .map(|k| from + (to - from) * f64::from(k) / 60.0)
            .collect();
        let exact = session.phase(format!("branch: {name}"), |_| {
            Ok(vesicles(branch, 0.0, &volumes)?)
        })?;
        let points = volumes
            .iter()
            .zip(&exact)
            .map(|(v, one)| [*v, one.energy() / (8.0 * PI)]);
        let exact = Series::new(format!("{name}, exact"), points.collect::<Vec<_>>());
        curves.push(exact.with_colour(colour));
        let own = pairs.iter().filter(|pair| pair.branch == name);
        let points: Vec<[f64; 2]> = own.map(|pair| [pair.ratio(), pair.energy()]).collect();
        if !points.is_empty() {
            let own = Series::new(format!("{name}, phase field"), points);
            curves.push(own.with_colour(colour).with_symbols(marker));
        }
    }
    let axes = (
        Axis::linear("reduced volume v"),
        Axis::linear("energy w / 8π"),
    );
    let chart = LineChart::new("", axes.0, axes.1).with_curves(curves);
    Ok(Figure::new(TITLE, 1).with_panel(chart).with_note(
        "w = ½ ∫ h² dA; v: volume over that of the sphere with the same area. The least energy is that of the lowest branch.",
    ))
}

/// A picture of every shape, and below it its section through the axis over the exact profile.
fn shapes(pairs: &[Pair], quick: bool) -> Result<Figure, Error> {
    let quality = if quick {
        Quality::Draft
    } else {
        Quality::Standard
    };
    let picture = |pair: &Pair| {
        let eps = pair.at_rest.trajectory.case.scales.eps;
        let scene = Scene::new(&pair.at_rest.field, eps)?
            .view(VIEW)
            .quality(quality);
        let (branch, v, energy) = (pair.branch, pair.ratio(), pair.energy());
        let exact = pair.exact.energy() / (8.0 * PI);
        let caption = format!("{branch}\nv = {v:.2}\n{energy:.4}\nexact {exact:.4}");
        raster(&scene, 320, caption)
    };
    let section = |pair: &Pair| {
        let radius = pair.at_rest.equilibrium.radius;
        let half = 2.2 * radius;
        let exact = pair.exact.surface.profile().points().into_iter();
        let exact: Vec<[f64; 2]> = exact.map(|p| p.map(|x| radius * x)).collect();
        let own = look::outline(&section(&pair.at_rest.field)?);
        Ok(Shapes::new("")
            .with_window([-half, half], [-half, half])
            .with_curve(own.filled(Colour::LightGrey))
            .with_curve(Curve::new([exact]).with_colour(0).with_width(1.0)))
    };
    let pictures = pairs
        .iter()
        .map(picture)
        .collect::<Result<Vec<_>, Error>>()?;
    let sections = pairs
        .iter()
        .map(section)
        .collect::<Result<Vec<_>, Error>>()?;
    Ok(Figure::new(TITLE, pairs.len())
        .with_panels(pictures)
        .with_panels(sections)
        .with_note(
            "Numbers: w / 8π. Grey: at rest, ε = 2h. Blue: the exact equilibrium. v: volume over that of the sphere with the same area.",
        ))
}

/// The plane through the axis, moved to the origin.
fn section(field: &Field<3>) -> Result<Field<2>, Error> {
    let grid = field.grid();
    let (cells, plane) = (grid.cells(), Grid::<2>::centred(grid.cells(), grid.side())?);
    let value = |node: usize| {
        let [i, k] = plane.multi_index(node);
        field.values()[grid.index([i, cells / 2, k])]
    };
    Ok(Field::from_values(
        plane,
        (0..plane.len()).map(value).collect(),
    )?)
}
