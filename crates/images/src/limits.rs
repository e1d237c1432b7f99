//! How much is read.

/// Largest number of pixels of an image, `2^26 = 8192^2`.
pub const LARGEST_IMAGE: usize = 1 << 26;

/// Largest image file, in bytes: eight bytes a pixel, as many as the largest image has at 16 bits without compression.
pub(crate) const LARGEST_FILE: u64 = 8 * LARGEST_IMAGE as u64;

/// Largest number of segments of the outline of an image, `2^22`.
pub const LARGEST_OUTLINE: usize = 1 << 22;
