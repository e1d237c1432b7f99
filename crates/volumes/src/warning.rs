//! What a person should know of a volume that was read.

use derive_more::Display;

/// What was not as it should be, and what was made of it.
#[derive(Clone, Debug, PartialEq, Display)]
#[non_exhaustive]
pub enum Warning {
    /// Voxels that are not a number.
    #[display("{count} voxels are not a number (NaN): they are outside")]
    NoNumbers {
        /// How many.
        count: usize,
    },
    /// The description of a stack of images cannot be used.
    #[display(
        "the description of the pages is damaged ({problem}): voxels have the sizes of the resolution of TIFF, or 1"
    )]
    Description {
        /// What is wrong with it.
        problem: String,
    },
    /// The description of a stack of images has sizes of pixels, but no distance of pages.
    #[display("there is no PhysicalSizeZ: pages have the distance of rows")]
    NoDistance,
}
