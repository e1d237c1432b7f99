//! A page with one of everything: `cargo run -p pages --example showcase -- <file.html>`.

use std::error::Error;
use std::time::Duration;

use geometry::shapes::{Ball, Torus};
use geometry::{Field, Grid, SignedDistance, SignedDistanceExt, UpAxis, phase_field};
use pages::{Details, Facts, Figure, Frames, Image, Page, Section, Table, Text, View, Viewer};
use render::{Framing, Picture, Scene};
use surfaces::{TriangleMesh, phase_field_surface, samples};

/// A picture of a field and its surface.
fn drawn(u: &Field<3>, eps: f64) -> Result<(Picture, TriangleMesh), Box<dyn Error>> {
    let framing = Framing::Ball {
        centre: [0.0; 3],
        radius: 0.45,
    };
    let picture = Scene::new(u, eps)?.framing(framing).render((480, 360))?;
    Ok((picture, phase_field_surface(u, eps)?))
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1);
    let path = path.unwrap_or_else(|| "showcase.html".to_owned());
    let grid = Grid::<3>::centred(48, 1.0)?;
    let eps = 2.0 * grid.spacing();

    // A torus that becomes a ball.
    let (torus, ball) = (Torus::clifford(0.38)?, Ball::new([0.0; 3], 0.3)?);
    let mut steps = Vec::new();
    for k in 0..5 {
        let part = f64::from(k) / 4.0;
        let mixed =
            |x: [f64; 3]| (1.0 - part) * torus.signed_distance(x) + part * ball.signed_distance(x);
        steps.push((
            format!("step {k}"),
            drawn(&phase_field(grid, &mixed, eps)?, eps)?,
        ));
    }
    let frames = steps
        .iter()
        .map(|(label, (picture, _))| Ok((label.clone(), Image::from_picture(picture)?)))
        .collect::<Result<_, pages::Error>>()?;
    let surfaces = steps
        .iter()
        .map(|(label, (_, mesh))| (label.as_str(), mesh));
    let poster = Image::from_picture(&steps[0].1.0)?;
    let viewer = Viewer::new("A torus becomes a ball", poster, View::default(), surfaces)?;

    // A figure that stands along the second axis, drawn from its signed distance.
    let figure = samples::figure(64)?;
    let distance = surfaces::MeshDistance::new(&figure).sample(Grid::centred(64, 1.0)?, || ())?;
    let view = View {
        up: UpAxis::Y,
        azimuth: 205.0,
        elevation: 10.0,
    };
    let picture = Scene::from_signed_distance(&distance)?
        .up(view.up)
        .azimuth(view.azimuth)
        .elevation(view.elevation)
        .render((480, 480))?;
    let standing = Viewer::new(
        "A figure of the crate surfaces",
        Image::from_picture(&picture)?,
        view,
        [("figure", figure.mesh())],
    )?;

    let turning = Scene::new(&phase_field(grid, &torus.translated([0.0; 3]), eps)?, eps)?
        .elevation(35.0)
        .turntable(12, 160, Duration::from_millis(90))?;
    let turning = Image::from_bytes("turntable", &turning.to_apng()?)?;

    let csv = "method,n,error,order\nlearned operator,128,0.0012,\nimplicit,128,0.0028,2.0\n\
               implicit,256,7.0e-4,2.0\n<script>alert(1)</script>,1,2,3\n";
    let details = Details::new("How it was made").with(
        Facts::new()
            .with("cells", "48")
            .with("eps", "2 h")
            .with("markup", "<b>&amp;</b>"),
    );
    let page = Page::new("One of everything")
        .with_lead(
            Text::from("What the crate ")
                .code("pages")
                .then(" can show."),
        )
        .with(Section::new("Surfaces").with(viewer).with(standing))
        .with(Section::new("A sequence").with(Frames::new("The same as pictures", frames)?))
        .with(Section::new("An animation").with(Figure::new(turning, "The Clifford torus.")))
        .with(
            Section::new("Numbers")
                .with("Text is text: <i>not slanted</i>.")
                .with(Table::from_csv("Errors", csv)?)
                .with(details),
        );
    page.write(&path)?;
    println!("{path}");
    Ok(())
}
