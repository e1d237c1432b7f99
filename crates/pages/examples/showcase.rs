//! A page with one of everything: `cargo run -p pages --example showcase -- <file.html>`.

use std::error::Error;
use std::time::Duration;

use geometry::measure::BoundingBox;
use geometry::shapes::{Ball, Torus};
use geometry::{Field, Grid, SignedDistance, UpAxis, phase_field};
use pages::{Details, Facts, Figure, Frames, Image, Page, Section, Table, Text, View, Viewer};
use render::{Picture, Scene, animation};
use surfaces::{TriangleMesh, phase_field_surface, samples};

/// A picture of a field and its surface.
fn drawn(u: &Field<3>, eps: f64) -> Result<(Picture, TriangleMesh), Box<dyn Error>> {
    let bounds = BoundingBox {
        lower: [-0.38, -0.38, -0.3],
        upper: [0.38, 0.38, 0.3],
    };
    let picture = Scene::new(u, eps)?.within(bounds).render([480, 360])?;
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

    // A figure that stands along the second axis.
    let figure = samples::figure(64)?;
    let view = View {
        up: UpAxis::Y,
        azimuth: 205.0,
        elevation: 10.0,
    };
    let scene = Scene::of_mesh(figure.mesh().clone()).view(view);
    let picture = scene.render([480; 2])?;
    let standing = Viewer::new(
        "A figure of the crate surfaces",
        Image::from_picture(&picture)?,
        view,
        [("figure", figure.mesh())],
    )?;

    let pictures: Vec<Picture> = steps
        .iter()
        .map(|(_, (picture, _))| picture.clone())
        .collect();
    let film = animation(&pictures, Duration::from_millis(200))?;
    let film = Image::from_bytes("film", &film)?;

    let csv = "method,n,error,order\nlearned operator,128,0.0012,\nimplicit,128,0.0028,2.0\n\
               implicit,256,7.0e-4,2.0\n<script>alert(1)</script>,1,2,3\n";
    let details = Details::new("How it was made").with(
        Facts::new()
            .with("cells", "48")
            .with("eps", "2 h")
            .with("markup", "<b>&amp;</b>"),
    );
    let page = Page::new("One of everything")
        .with_lead(Text::markdown("What the crate `pages` can show."))
        .with(Section::new("Surfaces").with(viewer).with(standing))
        .with(Section::new("A sequence").with(Frames::new("The same as pictures", frames)?))
        .with(Section::new("An animation").with(Figure::new(film, "The same.")))
        .with(
            Section::new("Numbers")
                .with(Text::from("Text is text: <i>not slanted</i>."))
                .with(Table::from_csv("Errors", csv)?)
                .with(details),
        );
    page.write(&path)?;
    println!("{path}");
    Ok(())
}
