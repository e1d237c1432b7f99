//! Flows with own parts in a process that is killed, and resumed to the same bytes.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use willmore::prelude::*;

use crate::own::{FLOWS, bits, four_steps};

/// The name and the folder of the flow of the process.
const FLOW: &str = "WILLMORE_TEST_FLOW";
const FOLDER: &str = "WILLMORE_TEST_FOLDER";
/// Steps after which the process waits to be killed; the checkpoint of the last one is not written yet.
const BEFORE: usize = 2;

/// Says in a file that it waits.
struct Waits(std::path::PathBuf);

impl Observer<2> for Waits {
    fn observe(&mut self, event: &mut Event<'_, 2>) -> Result<(), FlowError> {
        if event.run.records().len() == BEFORE {
            std::fs::write(&self.0, "").unwrap();
            std::thread::sleep(Duration::from_mins(5));
        }
        Ok(())
    }
}

#[test]
#[ignore = "the process that the other test starts and kills"]
fn process() {
    let Ok(name) = std::env::var(FLOW) else {
        return; // not started by the other test
    };
    let folder = std::env::var_os(FOLDER).unwrap();
    let (_, flow) = FLOWS.into_iter().find(|(known, _)| *known == name).unwrap();
    let mut waits = Waits(Path::new(&folder).with_extension("waits"));
    four_steps(
        flow,
        Path::new(&folder),
        &mut [&mut waits],
        &Interrupt::never(),
    );
}

/// Starts the flow in a folder, and kills the process before the checkpoint of its second step.
fn kill(name: &str, folder: &Path) {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "killed::process"])
        .env(FLOW, name)
        .env(FOLDER, folder)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let begin = Instant::now();
    while !folder.with_extension("waits").exists() {
        assert!(child.try_wait().unwrap().is_none(), "{name}: it ended");
        assert!(begin.elapsed() < Duration::from_mins(5), "{name}: too slow");
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn killed_flows_with_own_parts_go_on_to_the_same_bytes() {
    let root = tempfile::tempdir().unwrap();
    for (name, flow) in FLOWS {
        let [whole, killed] =
            ["whole", "killed"].map(|part| root.path().join(format!("{name} {part}")));
        kill(name, &killed);
        let run = |folder: &Path| four_steps(flow, folder, &mut [], &Interrupt::never());
        assert!(bits(&run(&whole)) == bits(&run(&killed)), "{name}");
    }
}
