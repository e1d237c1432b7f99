//! Draws a picture of every kind: `cargo run -p render --example surfaces -- <folder> [<cells>]`.

use std::error::Error;
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::time::Instant;

use geometry::shapes::{Ball, Cross, Cuboid, Torus};
use geometry::{Field, Grid, SignedDistance, SignedDistanceExt, UpAxis, phase_field};
use render::{Picture, Rgb, Scene, Tube, View};

/// A union of balls of several sizes about the middle of the box.
fn knobbly() -> impl SignedDistance<3> {
    let balls: Vec<([f64; 3], f64)> = (0..14)
        .map(|k| {
            let k = f64::from(k);
            let (z, angle) = (1.0 - (2.0 * k + 1.0) / 14.0, 2.4 * k);
            let ring = (1.0 - z * z).sqrt();
            let reach = 0.2 + 0.03 * (1.7 * k).sin();
            let centre = [ring * angle.cos(), ring * angle.sin(), z].map(|c| 0.5 + reach * c);
            (centre, 0.12 + 0.035 * (2.3 * k).cos())
        })
        .chain([([0.5; 3], 0.19)])
        .collect();
    move |x: [f64; 3]| {
        let distance = |&(centre, radius): &([f64; 3], f64)| {
            (0..3)
                .map(|i| (x[i] - centre[i]).powi(2))
                .sum::<f64>()
                .sqrt()
                - radius
        };
        balls.iter().map(distance).fold(f64::INFINITY, f64::min)
    }
}

fn circle(radius: f64, height: f64) -> Vec<[f64; 3]> {
    (0..120)
        .map(|k| TAU * f64::from(k) / 120.0)
        .map(|a| [0.5 + radius * a.cos(), 0.5 + radius * a.sin(), 0.5 + height])
        .collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "surfaces".to_owned()));
    let cells: usize = arguments.next().map_or(Ok(64), |n| n.parse())?;
    std::fs::create_dir_all(&folder)?;
    let grid = Grid::<3>::new(cells, 1.0)?;
    let eps = 2.0 * grid.spacing();
    let middle = [0.5; 3];
    let field = |shape: &dyn SignedDistance<3>| -> Result<Field<3>, geometry::Error> {
        phase_field(grid, shape, eps)
    };
    let draw = |name: &str, scene: &Scene| -> Result<Picture, Box<dyn Error>> {
        let start = Instant::now();
        let picture = scene.render([800; 2])?;
        picture.write_png(folder.join(format!("{name}.png")))?;
        println!("{name}: {:.2} s", start.elapsed().as_secs_f64());
        Ok(picture)
    };

    let ball = field(&Ball::new(middle, 0.33)?)?;
    draw("ball", &Scene::new(&ball, eps)?)?;

    let torus = field(&Torus::clifford(0.36)?.translated(middle))?;
    let scene = Scene::new(&torus, eps)?.view(View {
        elevation: 38.0,
        ..View::default()
    });
    draw("torus", &scene)?;
    let scene = scene.colour(Rgb::SKY).tubes([
        Tube::new(circle(0.36, 0.0), 0.005).closed(),
        Tube::new(circle(0.211, 0.149), 0.005)
            .closed()
            .with_colour(Rgb::VERMILLION),
    ]);
    draw("torus_circles", &scene)?;

    let core = Cuboid::new([0.2; 3])?.translated(middle);
    let cube = field(&|x: [f64; 3]| core.signed_distance(x) - 0.06)?;
    draw("cube", &Scene::new(&cube, eps)?)?;
    let near = Ball::new([0.76, 0.6, 0.7], 0.17)?;
    let mask = Field::from_fn(grid, |x| f64::from(u8::from(near.signed_distance(x) < 0.0)));
    let boxed = Scene::new(&cube, eps)?
        .colour(Rgb::SKY)
        .tubes(Tube::edges_of_box([0.0; 3], [1.0; 3], 0.004))
        .highlight_mask(&mask, Rgb::VERMILLION)?;
    draw("boxed", &boxed)?;

    let start = Instant::now();
    let union = field(&knobbly())?;
    let scene = Scene::new(&union, eps)?;
    println!("field and scene: {:.2} s", start.elapsed().as_secs_f64());
    draw("knobbly", &scene)?;
    let cross = field(&Cross::new(0.36, 0.12)?.translated(middle))?;
    let scene = Scene::new(&cross, eps)?
        .view(View {
            up: UpAxis::Y,
            ..View::default()
        })
        .transparent();
    draw("cross", &scene)?;
    Ok(())
}
