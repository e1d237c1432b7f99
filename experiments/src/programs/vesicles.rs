use crate::equilibria::{self, AtRest, Equilibrium};
use crate::prelude::*;
use crate::surfaces::{Setting, VIEW, raster};
use reference::equilibria::{Branch, Vesicle, vesicles};
use render::{Quality, Scene};

pub const EXPERIMENT: Experiment = Experiment {
    name: "vesicles",
    summary: "Lipid vesicles: area and volume held.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[
        ResultFolder {
            name: "vesicles",
            title: "Vesicles",
            description: "Not in the paper: surfaces of least bending energy with given area and volume, against exact \
                 equilibria.",
            figures: FIGURES,
            options: Some(""),
        },
        ResultFolder {
            name: "stomatocytes",
            title: "Stomatocytes",
            description: "Not in the paper: vesicles that start from exact stomatocytes and stay there.",
            figures: FIGURES,
            options: Some("--branches stomatocyte"),
        },
    ],
    metrics: &[&equilibria::METRICS],
    words: &[],
};

const FIGURES: Figures = &[
    ("shapes", "Pictures and sections; blue: the exact profile."),
    (
        "diagram",
        "Energies of the branches along the reduced volume: exact as lines, ours as marks.",
    ),
];

const TITLE: &str = "Vesicles: least bending energy with given area and volume";
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

/// A red blood cell is oblate, with the reduced volume .64. The two sides of oblate shapes must be several interface widths apart in the middle: with
/// half as many cells they break through below .62. Longer prolate shapes come to the side of the box. The neck of stomatocytes must be some interface
/// widths wide, too.
const FAMILIES: [Family; 3] = [
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
        reduced_volumes: &[0.7, 0.65, 0.64, 0.6],
        radius: 0.6,
        cells: [32, 128],
    },
    Family {
        branch: Branch::Stomatocyte,
        name: "stomatocyte",
        reduced_volumes: &[0.62, 0.6],
        radius: 0.6,
        cells: [32, 128],
    },
];
/// Side of the box.
const SIDE: f64 = 2.0;

/// Willmore flow of spheroids, and of exact stomatocytes, with area and volume held until rest, by the accurate operator, eps = 2h: energies,
/// profiles and pictures along the reduced volume, against exact axisymmetric equilibria; the phase diagram.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    figure: FigureOptions,

    /// Branches, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = FAMILIES.map(|family| family.name))]
    #[arg(default_values = ["prolate", "oblate"])]
    branches: Vec<String>,
}

fn program(options: &Options) -> Result<()> {
    let run = &options.figure.run;
    let (count, steps) = run.either((1, Some(2)), (usize::MAX, None));
    let wanted = |family: &&Family| options.branches.iter().any(|name| name == family.name);
    let (mut families, mut about) = (Vec::new(), Vec::new());
    for family in FAMILIES.iter().filter(wanted).take(count) {
        let setting = Setting::new(&options.figure, &[ACCURATE], family.cells, SIDE)?;
        about.push(json!({ "branch": family.name, "reduced_volumes": family.reduced_volumes, "radius": family.radius, "n": setting.n }));
        families.push((family, setting));
    }
    let parameters = (families[0].1).parameters(json!({ "families": about }))?;
    let mut session = Session::open(EXPERIMENT.name, run, parameters)?;
    let mut all: Vec<AtRest<3>> = Vec::new();
    for (family, setting) in &families {
        let (branch, name, radius) = (family.branch, family.name, family.radius);
        let volumes = family.reduced_volumes.iter().copied().take(count);
        let volumes: Vec<f64> = volumes.collect();
        let title = format!("exact vesicles: {name}");
        let exact = session.phase(title, |_| Ok(vesicles(branch, 0.0, &volumes)?))?;
        for (k, (ratio, exact)) in volumes.into_iter().zip(exact).enumerate() {
            let equilibrium = Equilibrium {
                key: format!("vesicles.{name}.v{ratio:.2}"),
                title: format!("{name}, v = {ratio:.2}"),
                radius,
                ratio,
                branch: Some(branch),
                energy: exact.energy(),
                tension: exact.tension / radius.powi(2),
                pressure: exact.pressure / radius.powi(3),
                curve: exact.surface.profile().clone(),
            };
            let initial = match all.last() {
                Some(relaxed) if k > 0 => relaxed.field.clone(),
                _ => equilibrium.start(setting.grid, setting.scales.eps, 0.5)?,
            };
            let (operator, scales) = (setting.operator(ACCURATE)?, setting.scales);
            all.push(equilibrium.relax(&mut session, name, initial, operator, scales, steps)?);
        }
    }
    session.sheet(equilibria::sheet(&all), "energies")?;
    let crossings = [
        ("prolate_oblate", crossing(&all, AtRest::energy).into()),
        ("exact", crossing(&all, AtRest::exact_energy).into()),
    ];
    session.metrics("vesicles.crossing", crossings)?;
    let diagram = diagram(&mut session, &all)?;
    session.figure(diagram, "diagram")?;
    session.figure(shapes(&all, run)?, "shapes")?;
    session.finish(TITLE)
}

/// The shapes of a branch.
fn of(branch: Branch, all: &[AtRest<3>]) -> impl Iterator<Item = &AtRest<3>> {
    (all.iter()).filter(move |one| one.equilibrium.branch == Some(branch))
}

/// The reduced volume at which the energies of prolate and oblate shapes are the same, by straight lines between the reduced volumes that both
/// have, which are off by less than .001.
fn crossing(all: &[AtRest<3>], energy: impl Fn(&AtRest<3>) -> f64) -> Option<f64> {
    let difference = |prolate: &AtRest<3>| {
        let ratio = prolate.equilibrium.ratio;
        let same = |one: &&AtRest<3>| one.equilibrium.ratio.to_bits() == ratio.to_bits();
        let oblate = of(Branch::Oblate, all).find(same)?;
        Some([ratio, energy(prolate) - energy(oblate)])
    };
    let both: Vec<[f64; 2]> = of(Branch::Prolate, all).filter_map(difference).collect();
    let crosses = |pair: &&[[f64; 2]]| pair[0][1] * pair[1][1] <= 0.0;
    let crossing = both.windows(2).find(crosses)?;
    let [[v, a], [w, b]] = [crossing[0], crossing[1]];
    Some(v + (w - v) * a / (a - b))
}

/// Exact branches as lines, the flow's shapes as marks.
fn diagram(session: &mut Session, all: &[AtRest<3>]) -> Result<Figure> {
    use Branch::{Oblate, Prolate, Stomatocyte};
    let branches = [
        (Prolate, "prolate", 0.99, 0.5, Marker::Circle),
        (Oblate, "oblate", 0.99, 0.51, Marker::Square),
        (Stomatocyte, "stomatocyte", 0.65, 0.4, Marker::Diamond),
    ];
    let mut curves = Vec::new();
    for (colour, (branch, name, from, to, marker)) in branches.into_iter().enumerate() {
        let volumes = (0..=60).map(|k| from + (to - from) * f64::from(k) / 60.0);
        let volumes: Vec<f64> = volumes.collect();
        let title = format!("branch: {name}");
        let exact = session.phase(title, |_| Ok(vesicles(branch, 0.0, &volumes)?))?;
        let points = volumes.iter().zip(&exact);
        let point = |(v, one): (&f64, &Vesicle)| [*v, one.energy() / (8.0 * PI)];
        let exact = Series::of(format!("{name}, exact"), points, point);
        curves.push(exact.with_colour(colour));
        let own = Series::of(format!("{name}, phase field"), of(branch, all), |one| {
            [one.equilibrium.ratio, one.energy()]
        });
        if !own.points.is_empty() {
            curves.push(own.with_colour(colour).with_symbols(marker));
        }
    }
    let (volume, energy) = ("reduced volume v", "energy w / 8π");
    let chart = LineChart::new("", Axis::linear(volume), Axis::linear(energy));
    Ok(Figure::new(TITLE, 1).with_panel(chart.with_curves(curves)).with_note(
        "w = ½ ∫ h² dA; v: volume over that of the sphere with the same area. The least energy is that of the lowest branch.",
    ))
}

/// A picture of every shape, and below it its section through the axis over the exact profile.
fn shapes(all: &[AtRest<3>], options: &RunOptions) -> Result<Figure> {
    let (mut pictures, mut sections) = (Vec::new(), Vec::new());
    for one in all {
        let scene = Scene::new(&one.field, one.trajectory.case.scales.eps)?.view(VIEW);
        let scene = scene.quality(options.either(Quality::Draft, Quality::Standard));
        let name = one.equilibrium.title.replace(", ", "\n");
        let (energy, exact) = (one.energy(), one.exact_energy());
        let caption = format!("{name}\n{energy:.4}\nexact {exact:.4}");
        pictures.push(raster(&scene.render([320; 2])?, caption));
        sections.push(one.panel(String::new(), &section(&one.field)?, 2.2));
    }
    Ok(Figure::new(TITLE, all.len())
        .with_panels(pictures)
        .with_panels(sections)
        .with_note(
            "Numbers: w / 8π. Grey: at rest, ε = 2h. Blue: the exact equilibrium. v: volume over that of the sphere with the same area.",
        ))
}

/// The plane through the axis, moved to the origin.
fn section(field: &Field<3>) -> Result<Field<2>> {
    let grid = field.grid();
    let (cells, plane) = (grid.cells(), Grid::<2>::centred(grid.cells(), grid.side())?);
    let values = (0..plane.len()).map(|node| {
        let [i, k] = plane.multi_index(node);
        field.values()[grid.index([i, cells / 2, k])]
    });
    Ok(Field::from_values(plane, values.collect())?)
}
