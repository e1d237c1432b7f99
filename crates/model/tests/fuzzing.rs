//! Damaged and malicious files of networks.

use std::path::Path;

use fuzzing::{Fuzz, Limit, assert_short_line, peak_of};
use model::{Error, Mlp, Network, PAPER_LAYERS, Provenance, Ratios, parameter_count};

/// As documented at [`Network::from_bytes`].
const LIMIT: Limit = Limit {
    times: 6,
    plus: 8 << 20,
};

fn read(bytes: &[u8]) -> Result<Network, Error> {
    Network::from_bytes(bytes, Path::new("some/file"))
}

fn network(dimension: usize, width: usize, layers: &[usize]) -> Network {
    let ratios = Ratios::of_run(dimension, width, 1.0, 2.0, 1.0);
    let kernel = (0..ratios.kernel_len()).map(|k| 0.1 * k as f64).collect();
    let parameters = (0..parameter_count(layers))
        .map(|k| -0.1 * k as f64)
        .collect();
    let activation = Mlp::new(layers.to_vec(), parameters).unwrap();
    let provenance = Provenance {
        recipe: "a recipe with \"quotes\"".into(),
        reference_cells: 128,
        seed: 1,
        version: "0".into(),
        training_loss: 1e-8,
        held_out_loss: 2e-8,
        flipped_loss: 3e-8,
    };
    Network::new(ratios, kernel, activation, provenance).unwrap()
}

/// The length of the header becomes that of the JSON that is there.
fn with_right_length(mut bytes: Vec<u8>) -> Vec<u8> {
    let (mut depth, mut quoted, mut escaped) = (0_usize, false, false);
    for at in 8..bytes.len() {
        match bytes[at] {
            _ if escaped => escaped = false,
            b'\\' => escaped = quoted,
            b'"' => quoted = !quoted,
            b'{' if !quoted => depth += 1,
            b'}' if !quoted => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    bytes[..8].copy_from_slice(&(at as u64 - 7).to_le_bytes());
                    return bytes;
                }
            }
            _ => {}
        }
    }
    bytes
}

#[test]
fn fuzzing_networks() {
    let shipped = &include_bytes!("../networks/accurate_d2_k9_eps1_step0.25.safetensors")[..];
    Fuzz::new("networks", LIMIT)
        .valid([
            shipped.to_vec(),
            network(2, 3, &[1, 2, 1]).to_bytes().unwrap(),
            network(3, 3, &PAPER_LAYERS).to_bytes().unwrap(),
        ])
        .starts([
            "\x08\0\0\0\0\0\0\0{",
            "\x40\0\0\0\0\0\0\0{\"__metadata__\":{\"network\":\"",
        ])
        .words([
            "\"kernel\":",
            "\"activation.0.weight\":",
            "\"activation.9.bias\":",
            "\"shape\":[1,1]",
            "\"dtype\":\"F32\"",
            "\"F64\"",
            "\"data_offsets\":[0,8]",
            "\\\"format\\\":",
            "\\\"width\\\":",
            "\\\"dimension\\\":",
            "\\\"calibration\\\":{",
            "null",
            "{}",
            "[]",
            ",",
            ":",
            "\"",
            "\\",
            "}",
            "[1,",
            "[",
            "{\"a\":",
            "\"a\":{\"dtype\":\"F64\",\"shape\":[0],\"data_offsets\":[0,0]},",
        ])
        .repair(with_right_length)
        .run(read, |_, network| {
            assert_eq!(read(&network.to_bytes().unwrap()).unwrap(), network);
        });
}

/// Files that make the most of every byte, or announce more than they have.
#[test]
fn the_worst_files_stay_within_the_limit() {
    let file = |header: &str, data: usize| {
        let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
        bytes.extend(header.as_bytes());
        bytes.resize(bytes.len() + data, 0);
        bytes
    };
    let long = |start: &str, block: &str, end: &str| {
        let times = (60_000 - start.len() - end.len()) / block.len();
        format!("{start}{}{end}", block.repeat(times))
    };
    let tensor = "\"dtype\":\"F64\",\"data_offsets\":[0,0]";
    let many = (0..1000)
        .map(|k| format!("\"{k}\":{{{tensor},\"shape\":[0]}},"))
        .collect::<Vec<_>>()
        .concat();
    let mut huge = file("{}", 1 << 16);
    huge[..8].copy_from_slice(&(1_u64 << 60).to_le_bytes());
    let wide = network(2, 301, &[1, 500, 200, 1]).to_bytes().unwrap();
    let mut wrong = wide.clone();
    *wrong.last_mut().unwrap() ^= 1;
    for bytes in [
        file(
            &long(&format!("{{\"a\":{{{tensor},\"shape\":[0"), ",1", "]}}"),
            0,
        ),
        file(&long("{\"a\":{\"shape\":", "[", ""), 0),
        file(&long("{\"a\":", "{\"b\":", ""), 0),
        file(
            &long("{\"__metadata__\":{\"network\":\"[", "1,", "1]\"}}"),
            0,
        ),
        file(&long("{\"__metadata__\":{\"network\":\"", "[", "\"}}"), 0),
        file(&format!("{{{many}\"x\":{{{tensor},\"shape\":[0]}}}}"), 0),
        huge,
        wide,
        wrong,
    ] {
        let (result, peak) = peak_of(|| read(&bytes));
        println!("{} bytes: {peak}", bytes.len());
        if let Err(error) = &result {
            assert_short_line(error);
        }
        assert!(peak <= LIMIT.times * bytes.len() + LIMIT.plus, "{peak}");
    }
}

#[test]
fn headers_have_a_limit() {
    let network = network(2, 3, &[1, 1]);
    let with = |length: usize| {
        let mut long = network.clone();
        long.provenance.recipe = "x".repeat(length);
        long.to_bytes()
    };
    let long = with(64_000).unwrap();
    assert_eq!(read(&long).unwrap().provenance.recipe.len(), 64_000);
    let error = with(65_536).unwrap_err().to_string();
    assert!(error.contains("and may have 65536"), "{error}");
    let mut announced = long;
    announced[..8].copy_from_slice(&(1_u64 << 40).to_le_bytes());
    let (result, peak) = peak_of(|| read(&announced));
    let error = result.unwrap_err().to_string();
    assert!(error.contains("1099511627776 bytes"), "{error}");
    assert!(peak < 4096, "{peak}");
}
