use crate::derived;
use crate::prelude::*;

pub const EXPERIMENT: Experiment = Experiment {
    name: "paper_numbers",
    summary: "Every result that the paper prints as a number, beside ours.",
    program: |own| own.run(program),
    quick: Some(&[]),
    results: &[ResultFolder {
        name: "paper_numbers",
        title: "The paper's numbers",
        description: "Every result that the paper prints as a number, beside ours, with their ratio, and the reason where \
                 they differ by more than a tenth.",
        figures: &[(
            "ratios",
            "Our numbers over the paper's. Between the lines they differ by less than a tenth.",
        )],
        options: Some(""),
    }],
    metrics: &[&METRICS],
    words: &[],
};

const METRICS: MetricTable = MetricTable {
    title: "The paper's numbers",
    note: "",
    words: &[("ROW", "a number: the row of `paper_numbers/numbers.md`")],
    rows: &[
        ("rowROW.paper", "a number that the paper prints"),
        ("rowROW.here", "ours, the metric that stands in the row"),
        ("rowROW.ratio", "ours over the paper's"),
    ],
};

/// The numbers of the paper; its head says what stands in a line.
const NUMBERS: &str = include_str!("../../paper_numbers.txt");
/// Numbers whose ratio is at most this, or at least its inverse, need no reason.
const CLOSE: f64 = 1.1;

/// Reads our metrics from the summaries of all results, and writes them beside the numbers that the paper prints: their ratios, and the
/// reasons where they differ by more than a tenth. It runs nothing.
#[derive(Parser, Debug)]
#[command(version)]
struct Options {
    #[command(flatten)]
    run: RunOptions,

    /// Folder of the results [default: that of the repository]
    #[arg(long, value_name = "DIR")]
    results: Option<PathBuf>,
}

/// What a number of the paper tells, and its name in the legend.
const KINDS: [(&str, &str); 3] = [
    ("error", "lengths and L² distances"),
    ("energy", "energies"),
    ("work", "seconds, memory, steps"),
];

/// A number of the paper.
struct Printed<'a> {
    row: usize,
    place: &'a str,
    what: &'a str,
    kind: usize,
    paper: f64,
    /// Folder of our result, and its metric.
    folder: &'a str,
    metric: &'a str,
    /// Why ours differs by more than a tenth.
    reason: &'a str,
}

struct Compared<'a> {
    printed: Printed<'a>,
    /// Ours; none if the result has no such metric yet.
    here: Option<f64>,
}

fn program(options: &Options) -> Result<()> {
    let results = options.results.clone();
    let results = results.unwrap_or_else(|| derived::root().join("results"));
    let rows = compared(NUMBERS, &results)?;
    let parameters = json!({ "numbers": rows.len(), "close": CLOSE });
    let mut session = Session::open(EXPERIMENT.name, &options.run, parameters)?;
    session.figure(figure(&rows), "ratios")?;
    session.sheet(sheet(&rows), "numbers")?;
    session.finish("Our results beside the numbers that the paper prints")
}

/// The numbers of a list with ours from the summaries in a folder.
fn compared<'a>(list: &'a str, results: &Path) -> Result<Vec<Compared<'a>>> {
    let lines = list.lines().filter(|line| !line.starts_with('#'));
    let mut summaries: BTreeMap<&str, Value> = BTreeMap::new();
    let mut rows = Vec::new();
    for (index, line) in lines.enumerate() {
        let printed = Printed::read(line, index + 1)?;
        if !summaries.contains_key(printed.folder) {
            let path = results.join(printed.folder).join("summary.json");
            let text = std::fs::read_to_string(&path).map_err(files::Error::of("read", &path))?;
            let summary = serde_json::from_str(&text);
            let summary = summary.map_err(|error| format!("{}: {error}", path.display()))?;
            summaries.insert(printed.folder, summary);
        }
        let here = summaries[printed.folder][printed.metric].as_f64();
        let row = Compared { printed, here };
        row.require_reason()?;
        rows.push(row);
    }
    Ok(rows)
}

impl<'a> Printed<'a> {
    fn read(line: &'a str, row: usize) -> Result<Self> {
        let wrong = || format!("row {row} is no number of the paper: {line}");
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [place, what, kind, paper, ours, reason] = cells[..] else {
            return Err(wrong().into());
        };
        let (folder, metric) = ours.split_once(' ').ok_or_else(wrong)?;
        let kind = KINDS.iter().position(|(name, _)| *name == kind);
        Ok(Self {
            row,
            place,
            what,
            kind: kind.ok_or_else(wrong)?,
            paper: paper.parse().map_err(|_| wrong())?,
            folder,
            metric,
            reason,
        })
    }
}

impl Compared<'_> {
    fn ratio(&self) -> Option<f64> {
        Some(self.here? / self.printed.paper)
    }

    fn is_close(&self) -> bool {
        self.ratio()
            .is_none_or(|ratio| (1.0 / CLOSE..=CLOSE).contains(&ratio))
    }

    fn require_reason(&self) -> Result<()> {
        let Printed { row, what, .. } = self.printed;
        let message = format!(
            "row {row}, {what}: ours is {:.3} times the paper's, and the list gives no reason",
            self.ratio().unwrap_or(f64::NAN)
        );
        require(self.is_close() || !self.printed.reason.is_empty(), message)
    }

    /// Why it differs; nothing where it is close.
    fn reason(&self) -> &str {
        match (self.here, self.is_close()) {
            (None, _) => "Not computed yet.",
            (_, true) => "",
            (_, false) => self.printed.reason,
        }
    }
}

fn sheet<'a>(rows: &'a [Compared<'_>]) -> Sheet<'a, Compared<'a>> {
    Sheet::of(rows)
        .keyed(|row, name| format!("row{}.{name}", row.printed.row))
        .column("row", Shortest, |row| row.printed.row)
        .text("where", |row| row.printed.place)
        .text("result", |row| row.printed.what)
        .measure("paper", "paper", Shortest, |row| row.printed.paper)
        .metric("here", |row| row.here)
        .metric("ratio", Compared::ratio)
        .column("here", Shortest, |row| row.here.map(four_digits))
        .column("here / paper", Shortest, |row| row.ratio().map(four_digits))
        .text("our result", |row| row.printed.folder)
        .text("metric", |row| row.printed.metric)
        .text("why they differ by more than a tenth", Compared::reason)
}

/// A number with four significant digits.
fn four_digits(number: f64) -> f64 {
    format!("{number:.3e}").parse().unwrap_or(number)
}

/// Ratios by the rows of the table, and lines where they differ by a tenth.
fn figure(rows: &[Compared<'_>]) -> Figure {
    let last = rows.len() as f64;
    let tenth = [1.0 / CLOSE, CLOSE].map(|ratio| {
        Series::new("", [[1.0, ratio], [last, ratio]])
            .with_colour(Colour::Grey)
            .with_width(1.0)
    });
    let markers = [Marker::Circle, Marker::Square, Marker::Triangle];
    let groups = KINDS.into_iter().zip(markers).enumerate();
    let groups = groups.map(|(kind, ((_, label), marker))| {
        let own = rows.iter().filter(|row| row.printed.kind == kind);
        let points = own.filter_map(|row| Some([row.printed.row as f64, row.ratio()?]));
        let points: Vec<[f64; 2]> = points.collect();
        Series::new(label, points)
            .with_colour(kind)
            .with_symbols(marker)
    });
    let x = Axis::linear("row of the table");
    let chart = LineChart::new("", x, Axis::log("ours over the paper's"));
    let chart = chart.with_curves(tenth).with_curves(groups);
    Figure::new("Our results over the numbers that the paper prints", 1)
        .with_panel(chart)
        .with_shared_legend()
        .with_note("Lines: a tenth more, a tenth less. The table names the rows.")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(paper: f64, here: Option<f64>, reason: &str) -> Compared<'_> {
        let printed = Printed {
            row: 1,
            place: "",
            what: "a number",
            kind: 0,
            paper,
            folder: "",
            metric: "",
            reason,
        };
        Compared { printed, here }
    }

    #[test]
    fn numbers_that_differ_need_a_reason() {
        assert!(row(2.0, Some(2.19), "").require_reason().is_ok());
        assert!(
            row(2.0, Some(1.5), "other machines")
                .require_reason()
                .is_ok()
        );
        assert!(row(2.0, None, "").require_reason().is_ok());
        for here in [2.21, 1.81] {
            assert!(row(2.0, Some(here), "").require_reason().is_err(), "{here}");
        }
    }

    #[test]
    fn lines_that_are_no_numbers_are_refused() {
        let good = "Table 1 | seconds | work | 1e2 | timing a.b |";
        let printed = Printed::read(good, 3).unwrap();
        assert_eq!(
            (printed.paper, printed.metric, printed.reason),
            (100.0, "a.b", "")
        );
        for bad in [
            "",
            "a | b | work | x | c d |",
            "a | b | joy | 1 | c d |",
            "a | b | work | 1 | c |",
            "a | work | 1 | c d |",
        ] {
            assert!(Printed::read(bad, 1).is_err(), "{bad}");
        }
    }
}
