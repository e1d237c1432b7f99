//! The orientation of photographs, from Exif.

/// How the stored rows lie in the upright image: the value 1 to 8 of the Exif tag 0x0112.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Orientation {
    /// Rows and columns change places, before anything is mirrored.
    transposed: bool,
    mirrored: [bool; 2],
}

impl Orientation {
    /// The orientation in a block of Exif data (a TIFF header and its first directory); upright if
    /// it is not told.
    pub fn from_exif(exif: &[u8]) -> Self {
        let value = tag(exif).unwrap_or(1);
        let (transposed, mirrored) = match value {
            2 => (false, [true, false]),
            3 => (false, [true, true]),
            4 => (false, [false, true]),
            5 => (true, [false, false]),
            6 => (true, [true, false]),
            7 => (true, [true, true]),
            8 => (true, [false, true]),
            _ => (false, [false, false]),
        };
        Self {
            transposed,
            mirrored,
        }
    }

    /// Width and height of the upright image.
    pub fn size(self, [width, height]: [u32; 2]) -> [u32; 2] {
        if self.transposed {
            [height, width]
        } else {
            [width, height]
        }
    }

    /// The values of the upright image, from those of a stored one of the given size.
    pub fn apply<T: Copy>(self, stored: [u32; 2], values: Vec<T>) -> Vec<T> {
        if !self.transposed && self.mirrored == [false; 2] {
            return values;
        }
        let [width, height] = self.size(stored).map(|n| n as usize);
        let columns = stored[0] as usize;
        let mut upright = Vec::with_capacity(values.len());
        for y in 0..height {
            for x in 0..width {
                let x = if self.mirrored[0] { width - 1 - x } else { x };
                let y = if self.mirrored[1] { height - 1 - y } else { y };
                let [x, y] = if self.transposed { [y, x] } else { [x, y] };
                upright.push(values[y * columns + x]);
            }
        }
        upright
    }
}

/// The value of the tag, if there is one.
fn tag(exif: &[u8]) -> Option<u16> {
    let little = match exif.get(..4)? {
        b"II*\0" => true,
        b"MM\0*" => false,
        _ => return None,
    };
    let short = |at: usize| {
        let bytes = exif.get(at..)?.get(..2)?.try_into().ok()?;
        Some(if little {
            u16::from_le_bytes(bytes)
        } else {
            u16::from_be_bytes(bytes)
        })
    };
    let [first, second] = [short(4)?, short(6)?].map(usize::from);
    let directory = if little {
        second << 16 | first
    } else {
        first << 16 | second
    };
    let entries = usize::from(short(directory)?);
    // Twelve bytes each: tag, type, count and, for a single short number, the number.
    (0..entries)
        .map(|k| directory.saturating_add(2 + 12 * k))
        .take_while(|&entry| entry < exif.len())
        .find(|&entry| short(entry) == Some(0x0112) && short(entry + 2) == Some(3))
        .and_then(|entry| short(entry + 8))
}
