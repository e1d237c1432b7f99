//! The calibrations of the shipped networks.

use mean_curvature::Calibration;
use model::{Error, Mlp, Network, PAPER_LAYERS, Ratios, Shipped, parameter_count};

#[test]
fn networks_without_an_interface_at_rest_are_refused() {
    // A network that was never trained.
    let ratios = Ratios::of_run(2, 17, 1.0, 2.0, 1.0);
    let count = parameter_count(&PAPER_LAYERS);
    let activation = Mlp::new(PAPER_LAYERS.to_vec(), vec![0.1; count]).unwrap();
    let trained = Shipped::Paper.find(ratios).unwrap();
    let provenance = trained.provenance.clone();
    let untrained = Network::new(ratios, trained.kernel().to_vec(), activation, provenance);
    let error = untrained.unwrap().calibration().unwrap_err();
    assert!(
        matches!(
            error,
            Error::MeanCurvature(mean_curvature::Error::Calibration { .. })
        ),
        "{error}"
    );
    assert!(
        error.to_string().contains("train the network longer"),
        "{error}"
    );
}

fn close(a: &Calibration, b: &Calibration, tolerance: f64) -> bool {
    let numbers = |c: &Calibration| {
        [
            c.factors.energy,
            c.factors.metric,
            c.spontaneous_curvature,
            c.displacement,
            c.alignment,
            c.eigenvalue,
            c.position_spread,
            c.normal_spread,
        ]
    };
    (numbers(a).iter().zip(numbers(b))).all(|(a, b)| (a - b).abs() < tolerance)
}

#[test]
fn shipped_networks_carry_their_calibration() {
    for (name, network) in Shipped::Paper.all().unwrap() {
        let stored = network.calibration.expect(name);
        assert_eq!(network.calibration().unwrap(), stored);
        let found = if network.ratios().width > 65 {
            stored // the same code path, many times the time
        } else {
            network.calibrate().unwrap()
        };
        assert!(close(&stored, &found, 1e-8), "{name}: {stored:?} {found:?}");
        let Calibration { factors, .. } = found;
        // All shipped operators see too little curvature.
        assert!((0.9..0.98).contains(&factors.energy), "{name}: {found:?}");
        assert!((factors.metric - 1.0).abs() < 0.01, "{name}: {found:?}");
        assert!((found.eigenvalue - 1.0).abs() < 1e-5, "{name}: {found:?}");
        assert!((found.alignment - 0.98).abs() < 0.005, "{name}: {found:?}");
        assert!(found.position_spread < 2e-4, "{name}: {found:?}");
        assert!(found.normal_spread < 0.04, "{name}: {found:?}");
        assert!(
            found.spontaneous_curvature.abs() < 2e-3,
            "{name}: {found:?}"
        );
    }
}

#[test]
fn networks_of_the_accurate_recipe_carry_theirs_and_are_nearly_exact() {
    for (name, network) in Shipped::Accurate.all().unwrap() {
        let ratios = network.ratios();
        let stored = network.calibration.expect(name);
        if ratios.width < 65 {
            // The widest takes seconds on the same code path.
            let found = network.calibrate().unwrap();
            assert!(close(&stored, &found, 1e-8), "{name}: {stored:?} {found:?}");
        }
        assert!(
            stored.spontaneous_curvature.abs() < 1e-10,
            "{name}: {stored:?}"
        );
        assert!(
            (stored.factors.metric - 1.0).abs() < 1e-3,
            "{name}: {stored:?}"
        );
        // With K of the variance 2 tautilde the step is exact for nearly flat interfaces; what is left is the angle between the null
        // vectors, c = cos^2. Kernels of few entries, and those cut off, come near it.
        let narrow = ratios.width == 9 || (ratios.width == 17 && ratios.eps_over_h > 2.0);
        let [exact, isotropic] = if narrow { [5e-3, 2e-2] } else { [1e-4, 1e-6] };
        assert!(
            (stored.displacement - 1.0).abs() < exact,
            "{name}: {stored:?}"
        );
        assert!(
            (stored.alignment - 0.981).abs() < 2e-3,
            "{name}: {stored:?}"
        );
        assert!(stored.normal_spread < isotropic, "{name}: {stored:?}");
    }
}

#[test]
fn the_factor_is_the_square_of_the_displacement_but_for_the_angle_between_the_null_vectors() {
    // A is nearly parallel to w', so c = displacement^2 m cos^2 up to the rest of A.
    for (name, network) in Shipped::Paper.all().unwrap() {
        let c = network.calibration().unwrap();
        let product = c.displacement.powi(2) * c.factors.metric * c.alignment;
        assert!(
            (product / c.factors.energy - 1.0).abs() < 0.01,
            "{name}: {c:?}"
        );
    }
}

#[test]
fn odd_parts_have_the_same_factors_and_no_spontaneous_curvature() {
    for (name, network) in Shipped::Paper.all().unwrap() {
        if network.ratios().width > 17 {
            continue; // the same code path, many times the time
        }
        let (whole, odd) = (network.calibration().unwrap(), network.odd_part());
        let f = |network: &Network, w: f64| network.activation().value(w);
        for w in [-1.2, -0.4, 0.0, 0.7, 1.0] {
            let expected = 0.5 * (f(&network, w) - f(&network, -w));
            assert!((f(&odd, w) - expected).abs() < 1e-13, "{name} {w}");
        }
        let odd = odd.calibrate().unwrap();
        assert!(odd.spontaneous_curvature.abs() < 1e-10, "{name}: {odd:?}");
        let ratio = odd.factors.energy / whole.factors.energy;
        assert!((ratio - 1.0).abs() < 1e-4, "{name}: {odd:?} {whole:?}");
    }
}

#[test]
fn spectra_do_not_depend_on_the_number_of_threads() {
    let mut networks = Shipped::Paper.all().unwrap().into_iter();
    let (_, wide) = networks.find(|(_, n)| n.ratios().width == 65).unwrap();
    let spectrum = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| wide.flat_spectrum().unwrap())
    };
    assert_eq!(spectrum(1), spectrum(4));
}

#[test]
fn files_with_and_without_a_calibration_are_read() {
    let (_, network) = Shipped::Paper.all().unwrap().remove(0);
    let path = std::path::Path::new("network.safetensors");
    let mut without = network.clone();
    without.calibration = None;
    for network in [without, network] {
        let data = network.to_bytes().unwrap();
        let read = Network::from_bytes(&data, path).unwrap();
        assert_eq!(read.calibration, network.calibration);
        assert_eq!(read, network);
    }
}

#[test]
fn calibrations_that_are_not_finite_are_not_written() {
    let (_, mut network) = Shipped::Paper.all().unwrap().remove(0);
    network.calibration.as_mut().unwrap().alignment = f64::NAN;
    let error = network.to_bytes().unwrap_err();
    assert!(matches!(error, Error::Weights { .. }), "{error}");
}
