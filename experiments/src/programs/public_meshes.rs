use std::sync::Mutex;
use std::thread;
use std::time::Duration;

use crate::meshes::folder;
use crate::prelude::*;
use crate::session::{load, remove_folder, store};
use files::{Sha256, hexadecimal};
use jobs::{FairOptions, Made, Refusal, Shape, Warning, Watcher};
use runs::Interrupt;
use serde::Deserialize;
use surfaces::samples;

pub const EXPERIMENT: Experiment = Experiment {
    name: "public_meshes",
    summary: "What `willmore fair` makes of public test meshes as they come.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "public_meshes",
        title: "Public test meshes",
        description: "Not in the paper: what `willmore fair` at its defaults takes of the test meshes of three public collections, what it refuses, and \
             whether the command that a refusal advises works.",
        figures: &[(
            "meshes",
            "Seconds and displacement over the number of faces.",
        )],
        options: Some(""),
    }],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "Public test meshes",
    note: "",
    words: &[],
    rows: &[
        ("meshes", "how many there are"),
        ("faired", "how many are faired"),
        (
            "without_noise",
            "how many are read as surfaces and refused since no noise is found, unless it is said how much to smooth",
        ),
        ("refused", "how many are refused for another reason"),
        (
            "taken_percent",
            "those that are faired or without noise, in percent",
        ),
        (
            "advice_works, advice_fails",
            "how many of those that are not faired are faired by the command that the message advises, and how many are not",
        ),
        ("unfinished", "how many were not finished in time"),
        (
            "crossings_added",
            "faces that cross others after the flow and did not before, of all meshes",
        ),
        (
            "largest_seconds, median_seconds",
            "wall time of `fair` for a mesh that is faired",
        ),
        (
            "median_displacement_percent",
            "median over the meshes that are faired of the way of the vertices, root of the mean square, in percent of the longest side",
        ),
    ],
};

/// The meshes, with their checksums and addresses, as `scripts/fetch_meshes` has them.
const LIST: &str = include_str!("../../public_meshes.txt");
/// The folder of the results of single meshes, while others are missing.
const SINGLE: &str = "partial";
/// Pieces of advice that are followed one after the other.
const ADVICES: usize = 3;
/// Steps of a flow that is to be as long as the options say.
const STEPS: usize = 3;

/// `willmore fair` at its defaults on the meshes of experiments/public_meshes.txt: all files of three collections of test data in a format that is read,
/// with 100 to 300000 faces. Where a mesh is refused, the command that the message advises is tried.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    /// Seconds after which the flow of a mesh is given up
    #[arg(long, value_name = "SECONDS", default_value_t = 900)]
    limit: u64,

    /// Only meshes whose names contain this text
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
}

/// What became of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Fate {
    Faired,
    WithoutNoise,
    Refused,
    Unfinished,
}

impl Fate {
    const ALL: [Self; 4] = [
        Self::Faired,
        Self::WithoutNoise,
        Self::Refused,
        Self::Unfinished,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Faired => "faired",
            Self::WithoutNoise => "without noise",
            Self::Refused => "refused",
            Self::Unfinished => "not finished",
        }
    }
}

/// A mesh, and what became of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    name: String,
    vertices: Option<usize>,
    faces: Option<usize>,
    fate: Fate,
    /// Why it was not faired.
    message: Option<String>,
    warnings: Vec<String>,
    /// Wall time.
    seconds: f64,
    /// Of the mesh that is faired.
    result: Option<Outcome>,
    /// The options that the message advises, and what becomes of the mesh with them.
    advice: Option<Advice>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Advice {
    options: String,
    works: bool,
    message: Option<String>,
    seconds: f64,
    result: Option<Outcome>,
}

/// How a mesh differs from what it was.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Outcome {
    cells: usize,
    is_open: bool,
    /// Whether the surface on the grid has kept its parts and holes.
    same_topology: bool,
    /// Faces that cross others before and after, and those that do only after.
    crossing: [usize; 3],
    /// In percent of the longest side.
    displacement: f64,
    largest_displacement: f64,
}

fn program(options: &Options) -> Result<()> {
    let run = &options.run;
    let files = inputs(options)?;
    let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).collect();
    let parameters = json!({ "meshes": names, "limit_seconds": options.limit, "threads": rayon::current_num_threads() });
    let mut session = Session::open(EXPERIMENT.name, run, parameters)?;
    let single = session.output.subfolder(SINGLE)?;
    let mut rows = Vec::new();
    for file in &files {
        let stored = single.path(&format!("{}.json", file.name.replace('/', "-")))?;
        let key = file.key(options);
        if let Some(row) = load(&stored, &key) {
            rows.push(row);
            continue;
        }
        let row = session.phase(&file.name, |_| Ok(file.tried(options)))?;
        store(&stored, &key, &row)?;
        rows.push(row);
    }
    write(&rows, &mut session)?;
    remove_folder(&single)?;
    session.finish("Public test meshes, taken by `willmore fair`")
}

fn write(rows: &[Row], session: &mut Session) -> Result<()> {
    let count = |fate| rows.iter().filter(|row| row.fate == fate).count();
    let outcomes = || rows.iter().filter_map(|row| row.result.as_ref());
    let advised = || rows.iter().filter_map(|row| row.advice.as_ref());
    let followed = advised().filter_map(|advice| advice.result.as_ref());
    let added: usize = outcomes().chain(followed).map(|o| o.crossing[2]).sum();
    let works = advised().filter(|advice| advice.works).count();
    let [faired, without_noise, refused, unfinished] = Fate::ALL.map(count);
    let taken = (faired + without_noise) as f64 / rows.len().max(1) as f64;
    let of_faired = rows.iter().filter(|row| row.fate == Fate::Faired);
    let seconds: Vec<f64> = of_faired.map(|row| row.seconds).collect();
    let displacements: Vec<f64> = outcomes().map(|outcome| outcome.displacement).collect();
    for (name, value) in [
        ("meshes", rows.len()),
        ("faired", faired),
        ("without_noise", without_noise),
        ("refused", refused),
        ("unfinished", unfinished),
        ("advice_works", works),
        ("advice_fails", without_noise + refused + unfinished - works),
        ("crossings_added", added),
    ] {
        session.metric(name, value)?;
    }
    session.metric("taken_percent", 100.0 * taken)?;
    let largest = seconds.iter().copied().fold(0.0, f64::max);
    session.metric("largest_seconds", largest)?;
    session.metric("median_seconds", median(seconds))?;
    session.metric("median_displacement_percent", median(displacements))?;
    let of = |get: fn(&Outcome) -> f64| move |row: &Row| row.result.as_ref().map(get);
    let table = Sheet::of(rows)
        .text("mesh", |row| &row.name)
        .column("faces", Shortest, |row| row.faces)
        .text("outcome", |row| row.fate.name())
        .column("seconds", Fixed(1), |row| row.seconds)
        .column("cells", Shortest, of(|o| o.cells as f64))
        .column("moved, %", Fixed(4), of(|o| o.displacement))
        .column("largest, %", Fixed(3), of(|o| o.largest_displacement))
        .column("crossing before", Shortest, of(|o| o.crossing[0] as f64))
        .column("added", Shortest, of(|o| o.crossing[2] as f64))
        .text("warnings or message", Row::said)
        .text("advised", |row| match &row.advice {
            Some(advice) if advice.works => format!("{}: works", advice.options),
            Some(advice) => format!("{}: fails", advice.options),
            None => String::new(),
        });
    session.sheet(table, "meshes")?;
    session.output.write_json("meshes.json", &rows)?;
    session.figure(figure(rows), "meshes")
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

fn figure(rows: &[Row]) -> Figure {
    let faces = || Axis::log("faces");
    let panel = |axis: &str, value: &dyn Fn(&Row) -> Option<f64>| {
        let chart = LineChart::new("", faces(), Axis::log(axis));
        let series = Fate::ALL
            .into_iter()
            .enumerate()
            .filter_map(|(colour, fate)| {
                let points = rows.iter().filter(|row| row.fate == fate);
                let points = points.filter_map(|row| Some([row.faces? as f64, value(row)?]));
                let points: Vec<_> = points.filter(|[_, y]| *y > 0.0).collect();
                let series = Series::new(fate.name(), points.clone()).with_colour(colour);
                (!points.is_empty()).then(|| series.with_symbols(Marker::Circle))
            });
        // None of a few meshes may have been faired.
        let series: Vec<_> = series.collect();
        (!series.is_empty()).then(|| chart.with_curves(series))
    };
    let seconds = panel("seconds", &|row| Some(row.seconds));
    let moved = panel("moved, % of the longest side", &|row| {
        Some(row.result.as_ref()?.displacement)
    });
    let title = "Public test meshes, taken by willmore fair";
    let panels: Vec<_> = [seconds, moved].into_iter().flatten().collect();
    Figure::new(title, panels.len())
        .with_panels(panels)
        .with_shared_legend()
}

/// A mesh in a file.
struct Input {
    name: String,
    path: PathBuf,
    /// The checksum of its bytes.
    sha256: String,
    /// A folder of its own, if it was made for this run.
    _made: Option<tempfile::TempDir>,
}

/// The meshes of the list, or for a quick run a noisy one, one without noise, and one that bounds nothing.
fn inputs(options: &Options) -> Result<Vec<Input>> {
    if options.run.quick {
        return quick_inputs();
    }
    let is_chosen = |name: &&str| (options.only.as_ref()).is_none_or(|text| name.contains(text));
    let mut inputs = Vec::new();
    for line in LIST.lines() {
        let mut words = line.split(' ');
        let (Some(name), Some(expected)) = (words.next(), words.next()) else {
            return Err(format!("no name and checksum: {line}").into());
        };
        if !is_chosen(&name) {
            continue;
        }
        let path = folder().join("public").join(name);
        let help = format!(
            "{} is not as in the list: run scripts/fetch_meshes --public",
            path.display()
        );
        let bytes = std::fs::read(&path).unwrap_or_default();
        let sha256 = hexadecimal(Sha256::of(bytes));
        require(sha256 == expected, help)?;
        inputs.push(Input {
            name: name.to_owned(),
            path,
            sha256,
            _made: None,
        });
    }
    require(!inputs.is_empty(), "no mesh of the list has such a name")?;
    Ok(inputs)
}

fn quick_inputs() -> Result<Vec<Input>> {
    let mut noisy = samples::lever(48)?.into_mesh();
    let clean = noisy.clone();
    let side = noisy.bounding_box().map_or(1.0, |b| b.longest_side());
    noisy.roughen(0.01 * side, 1);
    let mut crossing = noisy.clone();
    for x in noisy.vertices.iter().map(|x| x.map(|v| v + 0.1 * side)) {
        crossing.vertices.push(x);
    }
    let first = noisy.vertices.len() as u32;
    let others = noisy.faces.iter().map(|face| face.map(|v| v + first));
    crossing.faces.extend(others);
    crossing.normals = None;
    let all = [("noisy", noisy), ("clean", clean), ("crossing", crossing)];
    let made = all.into_iter().map(|(name, mesh)| {
        let made = tempfile::tempdir().map_err(files::Error::of("create", std::env::temp_dir()))?;
        let path = made.path().join(format!("{name}.ply"));
        surfaces::write(&path, &mesh)?;
        Ok(Input {
            name: format!("{name}.ply"),
            sha256: hexadecimal(Sha256::of(files::read(&path)?)),
            path,
            _made: Some(made),
        })
    });
    made.collect()
}

/// Collects warnings, and gives up after some time.
struct Patience {
    warnings: Mutex<Vec<String>>,
    interrupt: Interrupt,
}

impl Patience {
    fn new(limit: u64) -> Self {
        let interrupt = Interrupt::never();
        let alarm = interrupt.clone();
        // The thread ends with the program at the latest.
        thread::spawn(move || {
            thread::sleep(Duration::from_secs(limit));
            alarm.request();
        });
        Self {
            warnings: Mutex::default(),
            interrupt,
        }
    }
}

impl Watcher for Patience {
    fn warning(&self, warning: &Warning) {
        if let Ok(mut warnings) = self.warnings.lock() {
            warnings.push(warning.to_string());
        }
    }

    fn interrupt(&self) -> Result<Interrupt, runs::Error> {
        Ok(self.interrupt.clone())
    }
}

impl Input {
    /// All that its row depends on.
    fn key(&self, options: &Options) -> Value {
        json!({
            "sha256": self.sha256,
            "limit_seconds": options.limit,
            "version": env!("CARGO_PKG_VERSION"),
        })
    }

    fn tried(&self, options: &Options) -> Row {
        let mesh = surfaces::read(&self.path);
        let watcher = Patience::new(options.limit);
        let clock = Instant::now();
        let made = jobs::fair(self.options(), &watcher);
        let seconds = clock.elapsed().as_secs_f64();
        let fate = match &made {
            Ok(_) => Fate::Faired,
            Err(jobs::Error::Interrupted) => Fate::Unfinished,
            Err(jobs::Error::Refused(Refusal::NoNoise | Refusal::NoiseOfShape { .. })) => {
                Fate::WithoutNoise
            }
            Err(_) => Fate::Refused,
        };
        let faces = mesh.as_ref().ok().map(|mesh| mesh.faces.len());
        let vertices = mesh.as_ref().ok().map(|mesh| mesh.vertices.len());
        let advice = made
            .as_ref()
            .err()
            .and_then(|error| self.advised(error, options));
        let warnings = watcher.warnings.into_inner().unwrap_or_default();
        let place = format!("{}", self.path.display());
        let shown = |text: String| text.replace(&place, &self.name);
        Row {
            name: self.name.clone(),
            vertices,
            faces,
            fate,
            message: made.as_ref().err().map(|error| shown(error.to_string())),
            warnings: warnings.into_iter().map(shown).collect(),
            seconds,
            result: made
                .ok()
                .zip(mesh.ok())
                .map(|(made, mesh)| Outcome::of(&made, &mesh)),
            advice,
        }
    }

    fn options(&self) -> FairOptions {
        FairOptions::of(self.path.to_string_lossy().into_owned())
    }

    /// Follows the advice of an error, and that of the next one.
    fn advised(&self, error: &jobs::Error, options: &Options) -> Option<Advice> {
        let mut with = self.options();
        let mut advices = vec![advise(error, &mut with)?];
        let clock = Instant::now();
        let fair = |with: &FairOptions| jobs::fair(with.clone(), &Patience::new(options.limit));
        let mut last = fair(&with);
        while let Err(error) = &last
            && advices.len() < ADVICES
            && let Some(advice) = advise(error, &mut with)
        {
            advices.push(advice);
            last = fair(&with);
        }
        let mesh = surfaces::read(&self.path).ok();
        Some(Advice {
            options: advices.join(" "),
            works: last.is_ok(),
            message: last.as_ref().err().map(ToString::to_string),
            seconds: clock.elapsed().as_secs_f64(),
            result: last
                .ok()
                .zip(mesh)
                .map(|(made, mesh)| Outcome::of(&made, &mesh)),
        })
    }
}

/// Sets the options that the message of an error names first, and says which.
fn advise(error: &jobs::Error, options: &mut FairOptions) -> Option<String> {
    let text = error.to_string();
    let names = |name: &str| text.contains(&format!("`{name}`"));
    if names("remesh") && names("repair") && !options.remesh {
        (options.remesh, options.input.repair) = (true, true);
        return Some("--remesh --repair".to_owned());
    }
    if names("allow_loss") && !options.allow_loss {
        options.allow_loss = true;
        return Some("--allow-loss".to_owned());
    }
    if names("steps") && options.run.steps.is_none() {
        options.run.steps = Some(STEPS);
        return Some(format!("--steps {STEPS}"));
    }
    if names("remesh") && !options.remesh {
        options.remesh = true;
        return Some("--remesh".to_owned());
    }
    None
}

impl Outcome {
    fn of(made: &Made<3>, before: &TriangleMesh) -> Self {
        let summary = &made.summary;
        let report = summary.mesh.clone().unwrap_or_default();
        let before = before.crossing_faces();
        let after = match &made.shape {
            Some(Shape::Surface(surface)) => surface.mesh.crossing_faces(),
            _ => Vec::new(),
        };
        // A new mesh has other faces.
        let same = before.len() == after.len();
        let crossed = |face: usize| same && before[face];
        let added = (0..after.len()).filter(|&face| after[face] && !crossed(face));
        let all = |crosses: &[bool]| crosses.iter().filter(|crosses| **crosses).count();
        Self {
            cells: summary.grid.cells,
            is_open: report.is_open,
            same_topology: summary.same_topology,
            crossing: [all(&before), all(&after), added.count()],
            displacement: report.displacement_rms_percent,
            largest_displacement: report.displacement_largest_percent,
        }
    }
}

impl Row {
    /// Its message, or its warnings.
    fn said(&self) -> String {
        match &self.message {
            Some(message) => message.clone(),
            None => self.warnings.join("; "),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(limit: &str) -> Options {
        Options::parse_from(["public_meshes", "--limit", limit])
    }

    fn input(sha256: &str) -> Input {
        Input {
            name: "spot.obj".to_owned(),
            path: PathBuf::from("spot.obj"),
            sha256: sha256.to_owned(),
            _made: None,
        }
    }

    #[test]
    fn a_stored_row_is_that_of_the_same_mesh_and_limit() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("spot.obj.json");
        let row = Row {
            name: "spot.obj".to_owned(),
            vertices: Some(4),
            faces: Some(4),
            fate: Fate::Unfinished,
            message: None,
            warnings: Vec::new(),
            seconds: 900.0,
            result: None,
            advice: None,
        };
        store(&file, &input("ab").key(&options("900")), &row).unwrap();
        let found = |sha256, limit| load::<Row>(&file, &input(sha256).key(&options(limit)));
        assert_eq!(found("ab", "900").map(|row| row.fate), Some(row.fate));
        assert!(found("ab", "1800").is_none() && found("cd", "900").is_none());
    }
}
