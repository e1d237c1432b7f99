//! The page of a run: one HTML file that shows it in a browser, without a network.
//!
//! It is made of the files of the run alone, and the same files give the same bytes. It is not one of them: the checkpoint
//! does not know it, so that it may be removed, and is written again by `willmore resume`.

use engine::METRICS;
use pages::{
    ImageElement, Markup, Page, Section, TableElement, View, figure, five_digits, frames, markdown,
    thinned, viewer,
};
use rayon::prelude::*;
use render::Quality;
use report::{Axis, LineChart, Marker, Series};

use crate::notes::RunNotes;
use crate::outcome::{self, Remedies, Room, Summary};
use crate::parts::PartReport;
use crate::paths::MESHES;
use crate::prelude::*;
use crate::space::Space;
use crate::{own, plane, presentation, settings, words};

/// Of longer sequences every second, third, ... picture is shown: a page should stay small enough to be mailed.
const MOST_FRAMES: usize = 60;
/// The same for surfaces, some 25 bytes for a vertex.
const MOST_VERTICES: usize = 300_000;
/// The same for rows of the table of steps.
const MOST_ROWS: usize = 60;
/// Pixels a side of the pictures of a surface before and after.
const PIXELS: u32 = 480;
/// Curves through fewer steps have a mark at each.
const FEW_STEPS: usize = 40;

/// Writes the page of a run, `index.html`, into its folder.
///
/// # Errors
/// Files of the run that are missing or damaged.
pub fn write(run: &StoredRun) -> Result<()> {
    let records = engine::records(run)?;
    let page = Files { run, records }.page()?;
    Ok(page.write(run.path().join(presentation::PAGE))?)
}

struct Files<'a> {
    run: &'a StoredRun,
    records: Vec<Record>,
}

impl Files<'_> {
    fn page(&self) -> Result<Page> {
        let about = RunNotes::of(self.run)?.about;
        let options: Value =
            toml::from_str(&self.run.read_text(settings::FILE)?).map_err(Error::StoredOptions)?;
        let outcome = self.outcome(&options)?;
        let mut page = Page::new(format!("willmore {} {}", about.command, about.name))
            .with_lead(self.lead(outcome.as_ref()));
        if let Some(shape) = self.shape()? {
            page = page.with(shape);
        }
        let parts = (outcome.iter().flat_map(|outcome| &outcome.mesh)).flat_map(|mesh| &mesh.parts);
        if let Some(parts) = table_of_parts(&parts.collect::<Vec<_>>())? {
            page = page.with(parts);
        }
        if !self.records.is_empty() {
            page = page.with(self.steps()?);
        }
        let mut numbers = Section::new("Numbers");
        if let Some(outcome) = &outcome {
            let dimension = engine::dimension(self.run)?;
            let mut outcome = outcome.clone();
            // These are in a table of their own.
            outcome.mesh.iter_mut().for_each(|mesh| mesh.parts.clear());
            numbers.push(words::numbers(&outcome.to_json(), dimension));
        }
        let options = words::options(&options, &about.command);
        let options = Section::new("Options").with(options);
        let program =
            Section::new("Program, network and device").with(words::program(&json!(about)));
        Ok(page.with(numbers.with(options).with(program)))
    }

    /// What came out of a run with these options, if it is over.
    fn outcome(&self, options: &Value) -> Result<Option<Summary>> {
        let Some(bytes) = self.read(presentation::SUMMARY)? else {
            return Ok(None);
        };
        let mut outcome: Summary = serde_json::from_slice(&bytes).map_err(Error::StoredOutcome)?;
        let given = |name: &str| options.get(name).is_some();
        let room = Room::given(given("side-length"), given("field-kind"));
        outcome.remedies = Remedies::of(engine::ended(self.run)?.as_ref(), given("time"), room);
        Ok(Some(outcome))
    }

    /// The shape before, in the frames and after, in one view: drawings in the plane, surfaces to turn in space.
    fn shape(&self) -> Result<Option<Section>> {
        let shape = match engine::dimension(self.run)? {
            2 => self.drawings()?,
            _ => self.surfaces()?,
        };
        let Some(shape) = shape else {
            return Ok(None);
        };
        let mut section = Section::new("Shape").with(shape);
        if let Some(bytes) = self.read(presentation::DISPLACEMENT)? {
            let image = ImageElement::from_bytes(presentation::DISPLACEMENT, &bytes)?;
            let caption =
                "How far the surface has gone at its vertices, as colours and as a histogram.";
            section.push(figure(&image, caption));
        }
        Ok(Some(section))
    }

    fn drawings(&self) -> Result<Option<Markup>> {
        // Images are repaired in their own tones.
        let is_repaired = self.has(plane::ORIGINAL);
        let stages = self.stages(&[if is_repaired { "png" } else { "svg" }]);
        let mut drawings = Vec::new();
        for (label, name) in thinned(&stages, MOST_FRAMES) {
            let image = ImageElement::from_bytes(name, &self.run.read(name)?)?;
            drawings.push((label.clone(), image));
        }
        Ok((!drawings.is_empty()).then(|| frames("The shape over the steps", &drawings)))
    }

    fn surfaces(&self) -> Result<Option<Markup>> {
        let stages = self.stages(&MESHES);
        let Some((_, first)) = stages.first() else {
            return Ok(None);
        };
        let read = |name: &str| surfaces::read(self.run.path().join(name));
        let vertices = read(first)?.vertices.len();
        let most = (MOST_VERTICES / vertices.max(1)).clamp(2, MOST_FRAMES);
        let meshes: Vec<(&str, TriangleMesh)> = thinned(&stages, most)
            .map(|(label, name)| Ok((label.as_str(), read(name)?)))
            .collect::<Result<_>>()?;
        let space: Space = RunNotes::of(self.run)?.presentation(self.run)?;
        let view = View::from_front_left(space.up);
        Ok(Some(viewer(
            "The surface over the steps",
            &before_and_after(&meshes, view)?,
            view,
            meshes.iter().map(|(label, mesh)| (*label, mesh)),
        )?))
    }

    /// Labels and files of the shape before, in the frames between, and after, each in the first of these formats that it has.
    fn stages(&self, formats: &[&str]) -> Vec<(String, String)> {
        let named = |label: &str, stem: &str| {
            let mut names = formats.iter().map(|format| format!("{stem}.{format}"));
            let name = names.find(|name| self.has(name));
            name.map(|name| (label.to_owned(), name))
        };
        let after = named("after", presentation::FINAL);
        let mut steps: Vec<usize> = self.records.iter().map(|record| record.step).collect();
        steps.dedup();
        // The frame of the last step shows the same.
        if after.is_some() {
            steps.pop();
        }
        let frame = |step| named(&format!("step {step}"), &presentation::frame(step));
        let frames = steps.into_iter().filter_map(frame);
        // An image that is repaired and a mesh whose vertices follow the flow are themselves the shape at the beginning.
        let original = plane::ORIGINAL.trim_end_matches(".png");
        let mut before = [original, own::INPUT, presentation::START].into_iter();
        let before = before.find_map(|stem| named("before", stem));
        before.into_iter().chain(frames).chain(after).collect()
    }

    /// Energy and measures over the steps, drawn and as a table.
    fn steps(&self) -> Result<Section> {
        let columns = match engine::dimension(self.run)? {
            2 => [("length", "Length"), ("area", "Area")],
            _ => [("area", "Area"), ("volume", "Volume")],
        };
        let start = self.records.first().and_then(Record::energy_at_rest);
        let mut curves = vec![("Energy", self.points(start, Record::willmore_energy))];
        for (name, title) in columns {
            let start = self.run.state().notes["start"][name].as_f64();
            curves.push((title, self.points(start, |record| record.measure(name))));
        }
        // Mean curvature flow has no energy.
        curves.retain(|(_, points)| !points.is_empty());
        let mut plot = report::Figure::new("", 3);
        for (title, points) in curves {
            let mut series = Series::new("", points);
            if series.points.len() < FEW_STEPS {
                series = series.with_marker(Marker::Circle);
            }
            plot = plot.with_panel(
                LineChart::new(title, Axis::linear("step"), Axis::linear("")).with_curves([series]),
            );
        }
        let image = ImageElement::from_bytes("the plot of the steps", plot.to_svg()?.as_bytes())?;
        let units = words::units(engine::dimension(self.run)?);
        let caption = format!(
            "Energy and measures of the shape at the beginning and after every step, in the units of the input: {units}."
        );
        let mut section = Section::new("Steps").with(figure(&image, &caption));
        // Earlier versions took it out of a run that went on, until the next commit.
        if self.has(METRICS) {
            section.push(self.table_of_steps()?);
        }
        Ok(section)
    }

    fn table_of_steps(&self) -> Result<Section> {
        let table = TableElement::from_csv("Steps", &self.run.read_text(METRICS)?)?;
        let rows = || thinned(table.rows(), MOST_ROWS);
        let (shown, all) = (rows().count(), table.rows().len());
        let note = format!(
            "{shown} of {all} steps in five digits, in the units of the input; all digits of all steps are in `{METRICS}`."
        );
        let head = table.head().iter().map(|key| words::column(key));
        let shortened = |cell: &String| cell.parse().map_or_else(|_| cell.clone(), five_digits);
        let rows = rows().map(|row| row.iter().map(shortened));
        Ok(Section::new("Steps as a table")
            .with(markdown(&note))
            .with(TableElement::new("Steps", head, rows)?))
    }

    /// The values at the beginning and over the steps.
    fn points(&self, start: Option<f64>, of: impl Fn(&Record) -> Option<f64>) -> Vec<[f64; 2]> {
        let point = |record: &Record| Some([record.step as f64, of(record)?]);
        let start = start.map(|start| [0.0, start]).into_iter();
        start.chain(self.records.iter().filter_map(point)).collect()
    }

    /// What came out, in words.
    fn lead(&self, outcome: Option<&Summary>) -> String {
        let last = self.records.last();
        let (step, time) = last.map_or((0, 0.0), |last| (last.step, last.time));
        let progress = outcome::progress(step, time);
        let Some(outcome) = outcome else {
            return format!("Not finished: {progress} so far.");
        };
        let vanished = (outcome.components == 0).then(|| "the shape has vanished".to_owned());
        let sentences = outcome.sentences().into_iter().chain(vanished);
        sentences.fold(progress, |lead, sentence| lead + "; " + &sentence) + "."
    }

    fn has(&self, name: &str) -> bool {
        self.run.files().any(|file| file == name)
    }

    /// A file, if it belongs to the run.
    fn read(&self, name: &str) -> Result<Option<Vec<u8>>> {
        let bytes = self.has(name).then(|| self.run.read(name));
        Ok(bytes.transpose()?)
    }
}

/// The largest parts of a segmentation with their volumes before and after, if there are some.
fn table_of_parts(parts: &[&PartReport]) -> Result<Option<Section>> {
    if parts.is_empty() {
        return Ok(None);
    }
    let mut largest = parts.to_vec();
    largest.sort_by(|a, b| b.volume_before.abs().total_cmp(&a.volume_before.abs()));
    largest.truncate(MOST_ROWS);
    let head = [
        "place",
        "volume before",
        "volume after",
        "change, %",
        "what became of it",
    ];
    let rows = largest.iter().map(|part| {
        let volume = |volume: Option<f64>| volume.map_or(String::new(), five_digits);
        let change = part.change_percent();
        [
            part.place.map(five_digits).join(", "),
            volume(Some(part.volume_before)),
            volume(part.volume_after),
            change.map_or(String::new(), |change| words::signed(change, 4)),
            part.fate.to_string(),
        ]
    });
    let note = format!(
        "The largest {} of {} parts and cavities of the segmentation, in the units of the input. The place is the centre of mass. The volume of a \
         cavity is negative.",
        largest.len(),
        parts.len()
    );
    let table = TableElement::new("Parts", head, rows)?;
    Ok(Some(
        Section::new("Parts").with(markdown(&note)).with(table),
    ))
}

/// Pictures of the first and of the last surface, which together fill them.
fn before_and_after(
    meshes: &[(&str, TriangleMesh)],
    view: View,
) -> Result<Vec<(String, ImageElement)>> {
    let ends = match meshes {
        [only] => vec![only],
        [first, .., last] => vec![first, last],
        [] => vec![],
    };
    let pictures = ends.par_iter().map(|(label, mesh)| {
        let others = ends.iter().flat_map(|(_, other)| other.corner_places());
        // The view to turn is what people look at.
        let scene = Scene::of_mesh(mesh.clone()).quality(Quality::Draft);
        let scene = scene.view(view).beside(others);
        let picture = scene.render([PIXELS; 2])?.to_png()?;
        let image = ImageElement::from_bytes(label, &picture)?;
        Ok(((*label).to_owned(), image))
    });
    pictures.collect()
}
