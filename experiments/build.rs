//! Lists the experiments: the modules that `src/programs.rs` declares, in its order. A macro could declare and list them in one, but
//! `cargo fmt` does not format modules that a macro declares.

use std::{env, fs};

const PROGRAMS: &str = "src/programs.rs";

fn main() {
    println!("cargo::rerun-if-changed={PROGRAMS}");
    let text = fs::read_to_string(PROGRAMS).expect("the declarations can be read");
    let module = |line: &str| {
        let name = line.strip_prefix("pub mod ")?.strip_suffix(';')?;
        Some(format!("&{name}::EXPERIMENT, "))
    };
    let list: String = text.lines().filter_map(module).collect();
    let folder = env::var("OUT_DIR").expect("Cargo names it");
    fs::write(format!("{folder}/experiments.rs"), format!("[{list}]")).expect("it can be written");
}
