//! Every shipped network is what the documentation says.

use std::path::Path;

use model::training::SphereData;
use model::{Error, Network, Quality, Ratios, Shipped};
use operators::ComputeDevice;

/// Bounds of the loss on the reference radii, for both phases.
fn bounds(ratios: Ratios) -> (f64, f64) {
    (if ratios.width >= 65 { 6e-8 } else { 5e-8 }, 1e-7)
}

#[test]
fn shipped_networks_reach_their_quality() {
    let networks = Shipped::Paper.all().unwrap();
    assert_eq!(networks.len(), 6);
    for (name, network) in &networks {
        assert_eq!(*name, network.ratios().file_name());
    }
    reach_their_quality(|network| network.provenance.reference_cells <= 512);
}

#[test]
#[ignore = "takes minutes: the one above on the finest grid"]
fn the_widest_shipped_network_reaches_its_quality() {
    reach_their_quality(|network| network.provenance.reference_cells > 512);
}

fn reach_their_quality(chosen: impl Fn(&Network) -> bool) {
    let device = ComputeDevice::default_compiled().unwrap();
    for (name, network) in Shipped::Paper.all().unwrap() {
        if !chosen(&network) {
            continue;
        }
        let cells = network.provenance.reference_cells;
        let data = SphereData::new(network.ratios(), cells).unwrap();
        let quality = Quality::measure(&network, &data, 8, &device).unwrap();
        let (loss, flipped) = bounds(network.ratios());
        assert!(quality.reference_loss <= loss, "{name}: {quality:?}");
        assert!(
            quality.reference_flipped_loss <= flipped,
            "{name}: {quality:?}"
        );
        assert!(
            quality.transfer_min >= -0.05 && quality.transfer_max <= 1.05,
            "{name}: {quality:?}"
        );
        assert!(quality.transfer_imaginary < 1e-12, "{name}: {quality:?}");
        assert!(quality.phase_defect <= 1e-3, "{name}: {quality:?}");
        assert!(quality.activation_roughness < 1e-2, "{name}: {quality:?}");
    }
}

#[test]
fn accurate_networks_treat_both_phases_alike() {
    let device = ComputeDevice::default_compiled().unwrap();
    let networks = Shipped::Accurate.all().unwrap();
    assert_eq!(networks.len(), 7);
    for (name, network) in networks {
        assert_eq!(name, format!("accurate_{}", network.ratios().file_name()));
        assert_eq!(Shipped::Accurate.find(network.ratios()).unwrap(), network);
        let activation = network.activation();
        for w in [-1.3, -0.6, 0.0, 0.2, 1.0] {
            assert!(
                (activation.value(w) + activation.value(-w)).abs() < 1e-12,
                "{name}"
            );
        }
        if network.provenance.reference_cells > 256 || network.ratios().dimension > 2 {
            continue; // the same code path, many times the time
        }
        let data = SphereData::new(network.ratios(), network.provenance.reference_cells).unwrap();
        let quality = Quality::measure(&network, &data, 8, &device).unwrap();
        assert!(quality.reference_loss < 7e-8, "{name}: {quality:?}");
        assert!((quality.flipped_loss / quality.held_out_loss - 1.0).abs() < 1e-6);
        assert!(quality.transfer_min > -0.002 && quality.transfer_max < 1.0 + 1e-12);
        assert!(quality.phase_defect < 1e-4, "{name}: {quality:?}");
        assert!(quality.activation_roughness < 1e-3, "{name}: {quality:?}");
    }
}

#[test]
fn losses_in_the_metadata_are_those_of_the_weights() {
    let device = ComputeDevice::default_compiled().unwrap();
    for (name, network) in Shipped::Paper.all().unwrap() {
        let provenance = &network.provenance;
        if provenance.reference_cells > 256 || network.ratios().dimension > 2 {
            continue; // the same code path, many times the time
        }
        let data = SphereData::new(network.ratios(), provenance.reference_cells).unwrap();
        let quality = Quality::measure(&network, &data, 20, &device).unwrap();
        let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-6;
        assert!(
            close(quality.held_out_loss, provenance.held_out_loss),
            "{name}"
        );
        assert!(
            close(quality.flipped_loss, provenance.flipped_loss),
            "{name}"
        );
    }
}

#[test]
fn find_names_what_is_wanted_and_available() {
    let wanted = Ratios {
        dimension: 2,
        width: 17,
        eps_over_h: 3.0,
        step_over_h2: 1.0,
    };
    let message = Shipped::Paper.find(wanted).unwrap_err().to_string();
    assert!(
        message.contains("eps/h = 3") && message.contains("eps/h = 8"),
        "{message}"
    );
    let network = Shipped::Paper
        .find(Ratios {
            eps_over_h: 2.0,
            ..wanted
        })
        .unwrap();
    let mismatch = network.check_fits(wanted).unwrap_err();
    assert!(matches!(mismatch, Error::Mismatch { .. }));
    let message = mismatch.to_string();
    assert!(
        message.contains("eps/h = 2,") && message.contains("eps/h = 3,"),
        "{message}"
    );
}

fn sample() -> Network {
    Shipped::Paper.all().unwrap().remove(0).1
}

#[test]
fn files_round_trip_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("network.safetensors");
    let network = sample();
    network.save(&path).unwrap();
    assert_eq!(Network::load(&path).unwrap(), network);
    assert_eq!(std::fs::read(&path).unwrap(), network.to_bytes().unwrap());
}

#[test]
fn damaged_files_are_refused_with_a_reason() {
    let path = Path::new("damaged.safetensors");
    let good = sample().to_bytes().unwrap();
    let refused = |data: &[u8]| match Network::from_bytes(data, path) {
        Err(Error::Weights { reason, .. }) => reason,
        other => panic!("accepted or another error: {other:?}"),
    };
    for length in [0, 7, 8, 100, good.len() / 2, good.len() - 1] {
        refused(&good[..length]);
    }
    refused(b"not a network at all");
    // A bit flipped in the header breaks its JSON, a name, a shape or the metadata, or leaves a network that says so itself.
    let header = 8 + u64::from_le_bytes(good[..8].try_into().unwrap()) as usize;
    for position in (8..header).step_by(13) {
        let mut bad = good.clone();
        bad[position] ^= 0x80;
        refused(&bad);
    }
    // A number that is not finite is named.
    let mut bad = good.clone();
    bad[header..header + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    assert!(refused(&bad).contains("not finite"));
    // A flipped exponent bit in a weight changes the function: the checksum of the data catches it.
    let mut bad = good;
    bad[header + 70] ^= 0x10;
    assert!(refused(&bad).contains("checksum"));
}
