//! Every example runs: they check their own results.

#[path = "../examples/own_controller.rs"]
mod own_controller;
#[path = "../examples/own_energy.rs"]
pub mod own_energy;
#[path = "../examples/own_measure.rs"]
mod own_measure;
#[path = "../examples/own_network.rs"]
pub mod own_network;
#[path = "../examples/own_operator.rs"]
pub mod own_operator;
#[path = "../examples/own_scheme.rs"]
pub mod own_scheme;
#[path = "../examples/own_shape.rs"]
mod own_shape;
#[path = "../examples/own_stop.rs"]
mod own_stop;

#[test]
fn own_controller_runs() {
    own_controller::main().unwrap();
}

#[test]
fn own_energy_runs() {
    own_energy::main().unwrap();
}

#[test]
fn own_measure_runs() {
    own_measure::main().unwrap();
}

#[test]
fn own_network_runs() {
    own_network::main().unwrap();
}

#[test]
fn own_operator_runs() {
    own_operator::main().unwrap();
}

#[test]
fn own_scheme_runs() {
    own_scheme::main().unwrap();
}

#[test]
fn own_shape_runs() {
    own_shape::main().unwrap();
}

#[test]
fn own_stop_runs() {
    own_stop::main().unwrap();
}
