//! What is measured of finite-element steps against what is known of them.

use fem::FiniteElementStep;
use geometry::Grid;
use mean_curvature::{MeanCurvatureStep, StepScales, measured};
use operators::ComputeDevice;

fn steps<const D: usize>(grid: &Grid<D>) -> [FiniteElementStep<D>; 2] {
    let (eps, size) = (2.0 * grid.spacing(), grid.spacing().powi(2));
    [
        FiniteElementStep::implicit(grid, eps, size).unwrap(),
        FiniteElementStep::semi_implicit(grid, eps, size).unwrap(),
    ]
}

#[test]
fn inverses_in_the_pure_phases_are_the_known_ones() {
    fn check<const D: usize>(cells: usize) {
        let device = ComputeDevice::default_compiled().unwrap();
        let grid = Grid::<D>::centred(cells, 1.0).unwrap();
        let wave = (0..grid.len()).map(|i| (0.7 * i as f64).sin() + 0.3);
        let mut x: Vec<f64> = wave.collect();
        x[grid.len() / 2] += 20.0;
        let x = device.tensor(&x, grid.shape());
        for step in steps(&grid) {
            let known = step.phase_inverses(&grid.into(), &device).unwrap();
            let found = measured::phase_inverses(&step, &grid.into(), &device).unwrap();
            for stiffness in [1.0, 100.0] {
                let inverses = [found(stiffness), known(stiffness)];
                let [found, known] = inverses.map(|inverse| device.values(inverse(&x)).unwrap());
                let norm = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
                let rest: Vec<f64> = found.iter().zip(&known).map(|(a, b)| a - b).collect();
                let error = norm(&rest) / norm(&known);
                assert!(error < 1e-8, "{D}D, {stiffness}: {error:e}");
            }
        }
    }
    check::<2>(24);
    check::<3>(12);
}

#[test]
fn calibrations_are_those_of_the_element_matrices() {
    let device = ComputeDevice::default_compiled().unwrap();
    let grid = Grid::<2>::centred(104, 104.0).unwrap();
    for step in steps(&grid) {
        let known = FiniteElementStep::calibrate(&step).unwrap();
        let scales = StepScales::on(&grid, 2.0, 1.0);
        let found = measured::calibrate(&step, &scales, &device).unwrap();
        let pairs = [
            (found.factors.energy, known.factors.energy),
            (found.factors.metric, known.factors.metric),
            (found.response(), known.response()),
            (found.displacement, known.displacement),
            (found.alignment, known.alignment),
        ];
        let errors = pairs.map(|(found, known)| found / known - 1.0);
        let name = step.identity().name;
        println!("{name}: c, m, response, displacement, alignment off by {errors:?}");
        assert!(errors.iter().all(|e| e.abs() < 1e-3), "{found:?} {known:?}");
        assert!((found.normal_spread - known.normal_spread).abs() < 1e-3);
    }
}
