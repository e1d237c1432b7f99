//! Every result that the paper prints as a number, beside ours.

// Written by `cargo run -p experiments -- --write`.
fn main() -> std::process::ExitCode {
    experiments::programs::paper_numbers::EXPERIMENT.main()
}
