//! Options common to all programs.

use crate::networks::NetworkOptions;
use crate::prelude::libraries::*;

/// Options of every program.
#[derive(Args, Clone, Debug)]
pub struct RunOptions {
    /// Where tensors live: flex or ndarray (CPU, f64), wgpu (GPU, f32) or cuda (GPU, f64), if compiled in
    /// [default: the first compiled in]
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,

    /// Seed of all random numbers
    #[arg(long, default_value_t = 1)]
    pub seed: u64,

    /// Folder for the results, where an interrupted run continues [default: results/NAME, the name of the program, or
    /// results/NAME-quick]
    #[arg(long, value_name = "DIR")]
    pub output: Option<PathBuf>,

    /// A smoke test of seconds; its outputs are marked as quick
    #[arg(long)]
    pub quick: bool,

    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

impl RunOptions {
    pub fn open_device(&self) -> Result<ComputeDevice> {
        Ok(ComputeDevice::named(self.device.as_deref())?)
    }

    /// One of these, the first if this is a quick run.
    pub fn either<T>(&self, quick: T, usual: T) -> T {
        if self.quick { quick } else { usual }
    }

    /// A title, marked if this is a quick run.
    pub fn title(&self, title: &str) -> String {
        format!("{title}{}", self.either(" (quick run)", ""))
    }
}

/// Numbers from the least to the largest, each once.
pub fn distinct(numbers: &[usize]) -> Vec<usize> {
    let distinct: BTreeSet<usize> = numbers.iter().copied().collect();
    distinct.into_iter().collect()
}

/// Options of a figure at one resolution.
#[derive(Args, Clone, Debug)]
pub struct FigureOptions {
    #[command(flatten)]
    pub run: RunOptions,

    #[command(flatten)]
    pub networks: NetworkOptions,

    /// Cells per unit length; eps and tautilde follow [default: that of the paper]
    #[arg(long, value_name = "N")]
    cells: Option<usize>,
}

impl FigureOptions {
    /// Cells per unit length: those chosen, or the usual ones of a quick run or of the paper.
    pub fn cells(&self, [quick, paper]: [usize; 2]) -> usize {
        self.cells.unwrap_or(self.run.either(quick, paper))
    }
}
