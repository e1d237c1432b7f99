//! The operations of a domain, on the whole grid and on bricks.

use std::f64::consts::PI;
use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::shapes::Ball;
use geometry::{Bricks, Error, Field, Grid, Nodes, Stored, phase_field};
use solver::Domain;

use crate::common::{device, dot, noise, scales, values};

/// The same rough field on the whole grid and on the bricks near a sphere; it is constant outside of these.
pub struct Both<const D: usize> {
    pub whole: Domain<D>,
    pub few: Domain<D>,
    pub bricks: Arc<Bricks<D>>,
    pub on_grid: Tensor<D>,
    pub on_bricks: Tensor<D>,
}

const RESTS: [f64; 2] = [-0.99, 1.01];
const RADIUS: f64 = 0.3;
const SIDE: usize = 8;
/// The field moves where the sphere is nearer than this.
const NEAR: f64 = 0.04;

impl<const D: usize> Both<D> {
    /// With no more bricks than those in which the field moves.
    pub fn narrow(cells: usize) -> Self {
        Self::new(cells, 0)
    }

    /// With those of five cells around, too, so that the field is constant where the bricks end.
    pub fn wide(cells: usize) -> Self {
        Self::new(cells, 5)
    }

    fn new(cells: usize, margin: usize) -> Self {
        let grid = Grid::<D>::centred(cells, 1.0).unwrap();
        let noise = noise(grid.len(), 7);
        let field = Field::from_fn(grid, |x| {
            let beyond = norm(x) - RADIUS;
            let rest = RESTS[usize::from(beyond < 0.0)];
            let noise = noise[grid.nearest(x)];
            if beyond.abs() < NEAR {
                0.9 * noise
            } else {
                rest
            }
        });
        // A node and the centre of its brick are no further apart than half its diagonal.
        let diagonal = (SIDE / 2 + margin) as f64 * grid.spacing() * (D as f64).sqrt();
        let radius = |place: [usize; D]| {
            norm(place.map(|at| (at as f64 + 0.5) * SIDE as f64 * grid.spacing() - 0.5))
        };
        let active = |place| (radius(place) - RADIUS).abs() < NEAR + diagonal;
        let bricks = Bricks::new(cells, SIDE, active, |place| radius(place) < RADIUS).unwrap();
        assert_eq!(
            bricks.scatter(&bricks.gather(field.values()), RESTS),
            field.values()
        );
        let bricks = Arc::new(bricks);
        let nodes = Nodes::on_bricks(grid, bricks.clone());
        let (device, scales) = (device(), scales(&grid));
        Self {
            whole: Domain::new(grid.into(), RESTS, scales, &device),
            few: Domain::new(nodes, RESTS, scales, &device),
            on_grid: device.tensor(field.values(), grid.shape()),
            on_bricks: device.tensor(&bricks.gather(field.values()), bricks.shape()),
            bricks,
        }
    }

    /// The results of an operation in both ways, at the nodes of the bricks.
    fn agree(&self, operation: impl Fn(&Tensor<D>, &Domain<D>) -> Tensor<D>, bound: f64) {
        let whole = values(&operation(&self.on_grid, &self.whole));
        let (whole, few) = (
            self.bricks.gather(&whole),
            values(&operation(&self.on_bricks, &self.few)),
        );
        let largest = whole.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let apart = whole.iter().zip(&few).map(|(a, b)| (a - b).abs());
        let apart = apart.max_by(f64::total_cmp).unwrap();
        assert!(
            largest > 0.0 && apart < bound * largest,
            "{apart:e} of {largest:e}"
        );
    }
}

fn norm<const D: usize>(x: [f64; D]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Exactly but for rounding, and the Laplacian up to this.
fn agreement<const D: usize>(cells: usize, laplacian: f64) {
    let rounding = 1e-13;
    let (narrow, wide) = (Both::<D>::narrow(cells), Both::<D>::wide(cells));
    assert!(narrow.bricks.len() < wide.bricks.len());
    assert!(narrow.few.unstored().iter().all(|count| *count > 0));
    for axis in 0..D {
        narrow.agree(|u, on| on.derivative(u, axis), rounding);
        narrow.agree(|_, on| on.coordinates()[axis].clone(), rounding);
    }
    narrow.agree(|u, on| on.slope(u) + on.inside(u), rounding);
    narrow.agree(|u, on| on.area(u), rounding);
    narrow.agree(|_, on| on.sample(|x| x.iter().sum::<f64>().sin()), rounding);
    // Passes along the axes end at the edge of the bricks.
    let taps = [0.2, 0.5, 0.1, -0.3, 0.05];
    wide.agree(|u, on| on.convolve(u, &taps).unwrap(), rounding);
    wide.agree(|u, on| on.laplacian(u), laplacian);
    let sums = [(&wide.on_grid, &wide.whole), (&wide.on_bricks, &wide.few)];
    let [whole, few] = sums.map(|(u, on)| device().scalar(on.dirichlet(u)).unwrap());
    assert!((few / whole - 1.0).abs() < laplacian, "{whole} {few}");
}

#[test]
fn bricks_agree_with_the_whole_grid() {
    agreement::<2>(128, 1e-12);
    // Of noise, whose sixth derivatives are large.
    agreement::<3>(64, 1e-3);
}

/// Of waves: the gradient and the Laplacian have the eighth order.
#[test]
fn differences_have_the_eighth_order() {
    let errors = [16, 32].map(|cells| {
        let grid = Grid::<2>::centred(cells, 1.0).unwrap();
        let on = Domain::new(grid.into(), RESTS, scales(&grid), &device());
        let k = std::f64::consts::TAU;
        let wave = on.sample(|[x, y]| (k * (x + 2.0 * y)).sin());
        let slope = on.sample(|[x, y]| 2.0 * k * (k * (x + 2.0 * y)).cos());
        let [_, along] = on.gradient(&wave);
        let curved = on.laplacian(&wave) + wave.clone() * (5.0 * k * k);
        [along - slope, curved].map(|x| {
            let x = values(&x);
            dot(&x, &x).sqrt() / cells as f64
        })
    });
    for (coarse, fine) in errors[0].iter().zip(errors[1]) {
        let order = (coarse / fine).log2();
        assert!((order - 8.0).abs() < 0.4, "{order}");
    }
}

#[test]
fn fields_are_carried_to_bricks_and_coarser_grids() {
    let grid = Grid::<2>::centred(128, 1.0).unwrap();
    let function = |[x, y]: [f64; 2]| (3.0 * x).sin() * (1.0 + y);
    let field = Field::from_fn(grid, function);
    let both = Both::<2>::narrow(128);
    both.agree(|_, on| on.field(&field).unwrap(), 1e-15);
    // One that is itself on bricks.
    let stored = Stored::whole(field.clone()).on(&Nodes::on_bricks(grid, both.bricks.clone()));
    both.agree(|_, on| on.field(&stored).unwrap(), 1e-15);
    let half = grid.half().unwrap();
    let on = |grid: Grid<2>| Domain::new(grid.into(), RESTS, scales(&grid), &device());
    for coarse in [half, half.half().unwrap()] {
        let carried = values(&on(coarse).field(&field).unwrap());
        assert_eq!(carried, Field::from_fn(coarse, function).into_values());
    }
    for other in [
        Grid::centred(96, 1.0).unwrap(),
        Grid::centred(256, 1.0).unwrap(),
        Grid::centred(128, 2.0).unwrap(),
        Grid::new(64, 1.0).unwrap(),
    ] {
        let refused = on(other).field(&field).unwrap_err();
        assert!(matches!(refused, Error::GridMismatch { .. }), "{refused}");
    }
}

#[test]
fn taps_that_do_not_fit_are_refused() {
    let both = Both::<2>::narrow(128);
    let few = both.few.convolve(&both.on_bricks, &[0.1; 19]).unwrap_err();
    assert!(few.to_string().contains("next brick"), "{few}");
    let whole = both.whole.convolve(&both.on_grid, &[0.5; 2]).unwrap_err();
    assert!(whole.to_string().contains("odd"), "{whole}");
}

fn area_of_a_ball<const D: usize>(cells: usize, exact: f64) {
    let grid = Grid::<D>::centred(cells, 1.0).unwrap();
    let scales = scales(&grid);
    let on = Domain::new(grid.into(), [-1.0, 1.0], scales, &device());
    let ball = Ball::new([0.0; D], RADIUS).unwrap();
    let ball = phase_field(grid, &ball, scales.eps).unwrap();
    let u = device().tensor(ball.values(), grid.shape());
    let area = device().scalar(on.area(&u).sum()).unwrap() * on.cell_volume();
    let error = area / exact - 1.0;
    println!("{error:.1e}");
    // Level sets of a sphere are larger on average, by the second moment of the profile.
    assert!(error.abs() < 5e-3, "{area} {exact}");
}

#[test]
fn areas_are_those_of_the_zero_set() {
    area_of_a_ball::<2>(128, 2.0 * PI * RADIUS);
    area_of_a_ball::<3>(64, 4.0 * PI * RADIUS * RADIUS);
}
