//! Takes an image through a phase field and back:
//! `cargo run -p images --example trace -- <image> <folder> [<cells>]`.

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use geometry::shapes::Ball;
use geometry::{Grid, Placement, phase_field};
use images::{
    Drawing, Frame, Inside, Interface, Outline, OutlineDistance, Side, Svg, Threshold, mask, read,
};
use render::Rgb;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("which image?")?;
    let folder = PathBuf::from(arguments.next().ok_or("which folder?")?);
    let cells = arguments.next().map_or(Ok(512), |n| n.parse())?;
    std::fs::create_dir_all(&folder)?;
    let start = Instant::now();
    let told = |what: &str| println!("{:7.3} s  {what}", start.elapsed().as_secs_f64());

    let image = read(&path)?;
    told(&format!("{} x {} pixels", image.width(), image.height()));
    let side = Side::of(&image, Inside::Auto, Threshold::Otsu)?;
    let outline = Outline::of_image(&image, side)?;
    told(&format!(
        "inside is {side}: {} curves, area {:.1} pixels",
        outline.curves().len(),
        outline.area()
    ));

    let grid = Grid::<2>::centred(cells, 1.0)?;
    let eps = 2.0 * grid.spacing();
    let placement = Placement::fit(&image.bounding_box(), &grid, 1.0)?;
    let distance = OutlineDistance::new(&outline.placed(&placement));
    let u = phase_field(grid, &distance, eps)?;
    told(&format!("phase field of {cells} x {cells} nodes"));

    let interface = Interface::new(&u, eps)?;
    let own = Frame::of_image(&image, &placement)?;
    let white = Drawing::on_white(own).filled(&interface, Rgb::BLACK);
    white.picture()?.write_png(folder.join("again.png"))?;
    let transparent = Drawing::transparent(own).filled(&interface, Rgb::VERMILLION);
    transparent
        .picture()?
        .write_png(folder.join("transparent.png"))?;
    told("drawn in its own pixels");

    // A region in the middle, over the shape.
    let region = Ball::new([0.05, 0.02], 0.2)?;
    told(&format!(
        "{} nodes in the region",
        mask(grid, &region)?
            .iter()
            .filter(|&&inside| inside)
            .count()
    ));
    let frame = Frame::of_box(&grid, 800)?;
    let drawing = Drawing::on_white(frame)
        .filled(&interface, Rgb::BLACK)
        .filled(&region, Rgb::GREEN);
    drawing.picture()?.write_png(folder.join("region.png"))?;
    let curves = Outline::of_phase_field(&u)?;
    let svg = Svg::on_white(frame).filled(&curves, Rgb::SKY);
    svg.write(folder.join("curves.svg"))?;
    told("drawn in the box");
    Ok(())
}
