//! Stacks of TIFF images, by the crate `tiff`.

mod description;
mod ome;
mod planes;

use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::Path;

use files::Number;
use glam::DAffine3;
use tiff::decoder::{BufferLayoutPreference, Decoder, DecodingSampleType, Limits};
use tiff::tags::{PhotometricInterpretation, Tag};
use tiff::{ColorType, TiffResult};

use super::{Contents, Frames, length};
use crate::volume::Voxels;
use crate::{FormatError, Volume};
use description::Description;
use planes::Planes;

/// Most bytes of a page, and of what it is unpacked from.
const LARGEST_PAGE: usize = 1 << 29;

/// Whether the first bytes are those of a TIFF file, also of a large one.
pub(super) fn is_tiff(bytes: &[u8]) -> bool {
    let starts: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];
    starts.iter().any(|start| bytes.starts_with(start))
}

/// Whether a file is TIFF with several images of the same size: it is a volume, and not an image.
pub fn is_stack(path: impl AsRef<Path>) -> bool {
    File::open(path).is_ok_and(|file| has_several(BufReader::new(file)))
}

/// Whether these are the bytes of such a file.
pub fn holds_stack(bytes: &[u8]) -> bool {
    has_several(Cursor::new(bytes))
}

fn has_several(from: impl Read + Seek) -> bool {
    let same = || -> TiffResult<bool> {
        let mut reader = Decoder::new(from)?;
        let first = reader.dimensions()?;
        if !reader.more_images() {
            return Ok(false);
        }
        reader.next_image()?;
        Ok(reader.dimensions()? == first)
    };
    same().unwrap_or(false)
}

impl From<tiff::TiffError> for FormatError {
    fn from(error: tiff::TiffError) -> Self {
        Self::damaged("TIFF", &error)
    }
}

fn bad<T>(
    entry: &'static str,
    value: &impl ToString,
    requirement: &'static str,
) -> Result<T, FormatError> {
    FormatError::entry("TIFF", entry, value, requirement)
}

pub(super) fn decode(contents: Contents<'_>) -> Result<Volume, FormatError> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = LARGEST_PAGE;
    limits.intermediate_buffer_size = LARGEST_PAGE;
    let mut reader = Decoder::new(Cursor::new(contents.bytes))?.with_limits(limits);
    let first = Page::of(&mut reader)?;
    let description = Description::of(&mut reader, first.element)?;
    let planes = description.planes.as_ref();
    let frame = chosen(planes, contents.frame)?;
    let (mut bytes, mut sections) = (Vec::new(), 0_u64);
    let pages = each(&mut reader, &first, |reader, page, number| {
        if planes.is_some_and(|planes| planes.frame(number) != frame) {
            return Ok(());
        }
        sections += 1;
        // One alone is no reason yet: others may follow.
        let size = [first.size[0], first.size[1], sections.max(2)];
        length(size, first.element, contents.limit())?;
        page.append(reader, &mut bytes)
    })?;
    if planes.is_some_and(|planes| planes.count() != pages) {
        return bad("number of pages", &pages, "what the description notes");
    }
    let size = [first.size[0], first.size[1], sections].map(|n| n as usize);
    let voxels = Voxels {
        bytes,
        element: first.element,
        big_endian: cfg!(target_endian = "big"),
        scale: description.scale,
    };
    let mut volume = Volume::new(size, DAffine3::from_scale(description.sides), voxels)?;
    volume.warnings.extend(description.warnings);
    Ok(volume)
}

/// The volume that is wanted, by the order of the pages.
fn chosen(planes: Option<&Planes>, wanted: Option<u64>) -> Result<u64, FormatError> {
    if let Some(sections @ ..2) = planes.map(Planes::sections) {
        let requirement = "2 at least: save the pages as sections along z";
        return bad("number of sections", &sections, requirement);
    }
    let count = planes.map_or(1, Planes::volumes);
    Frames::in_turn(count, [1; 3]).chosen(wanted)
}

/// Does something with every page and its number; all must be like the first one, at which the reader is. Returns their number.
fn each<R: Read + Seek>(
    reader: &mut Decoder<R>,
    first: &Page,
    mut visit: impl FnMut(&mut Decoder<R>, &Page, u64) -> Result<(), FormatError>,
) -> Result<u64, FormatError> {
    let mut pages = 0;
    loop {
        let page = Page::of(reader)?;
        if (page.size, page.element) != (first.size, first.element) {
            let [width, height] = page.size;
            let shown = format!("{width} x {height} as {:?}", page.element);
            return bad("page", &shown, "like the first one");
        }
        visit(reader, &page, pages)?;
        pages += 1;
        if !reader.more_images() {
            return Ok(pages);
        }
        reader.next_image()?;
    }
}

/// What a page holds.
struct Page {
    /// Columns and rows.
    size: [u64; 2],
    element: Number,
    white_is_zero: bool,
}

impl Page {
    /// The page at which the reader is.
    fn of(reader: &mut Decoder<impl Read + Seek>) -> Result<Self, FormatError> {
        let colours = reader.colortype()?;
        let ColorType::Gray(8 | 16 | 32 | 64) = colours else {
            let shown = format!("{colours:?}");
            return bad("kind of pixels", &shown, "one number of 8 to 64 bits each");
        };
        let BufferLayoutPreference { sample_type, .. } = reader.image_buffer_layout()?;
        let element = match sample_type {
            Some(DecodingSampleType::U8) => Number::U8,
            Some(DecodingSampleType::U16) => Number::U16,
            Some(DecodingSampleType::U32) => Number::U32,
            Some(DecodingSampleType::U64) => Number::U64,
            Some(DecodingSampleType::I8) => Number::I8,
            Some(DecodingSampleType::I16) => Number::I16,
            Some(DecodingSampleType::I32) => Number::I32,
            Some(DecodingSampleType::I64) => Number::I64,
            Some(DecodingSampleType::F32) => Number::F32,
            Some(DecodingSampleType::F64) => Number::F64,
            _ => return bad("kind of numbers", &"unusual", "whole, or of 32 or 64 bits"),
        };
        let (width, height) = reader.dimensions()?;
        let size = [width, height].map(u64::from);
        length([size[0], size[1], 2], element, 2 * LARGEST_PAGE as u64)?;
        let meaning = reader.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation)?;
        let white_is_zero = meaning == Some(PhotometricInterpretation::WhiteIsZero.to_u16());
        let unsigned = [Number::U8, Number::U16, Number::U32, Number::U64].contains(&element);
        if white_is_zero && !unsigned {
            let shown = format!("{element:?} with white as zero");
            return bad("kind of numbers", &shown, "whole and without sign");
        }
        Ok(Self {
            size,
            element,
            white_is_zero,
        })
    }

    /// Puts its numbers behind those of others.
    fn append(
        &self,
        reader: &mut Decoder<impl Read + Seek>,
        data: &mut Vec<u8>,
    ) -> Result<(), FormatError> {
        let layout = reader.image_buffer_layout()?;
        if layout.len != (self.size[0] * self.size[1]) as usize * self.element.size() {
            return bad("page", &format!("{} bytes long", layout.len), "one plane");
        }
        let start = data.len();
        data.resize(start + layout.len, 0);
        reader.read_image_bytes(&mut data[start..])?;
        if self.white_is_zero {
            // The crate takes numbers from the largest one; these are those in the file.
            data[start..].iter_mut().for_each(|byte| *byte = !*byte);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use tiff::encoder::colortype::Gray8;
    use tiff::encoder::{Compression, TiffEncoder};

    use super::*;

    const SIDE: u32 = 64;
    const PAGES: u8 = 4;
    const VOXELS: u64 = 64 * 64 * 4;

    /// Pages of one value each.
    fn stack(compression: Compression) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let encoder = TiffEncoder::new(&mut file).unwrap();
        let mut encoder = encoder.with_compression(compression);
        for page in 0..PAGES {
            let pixels = vec![page; (SIDE * SIDE) as usize];
            encoder.write_image::<Gray8>(SIDE, SIDE, &pixels).unwrap();
        }
        file.into_inner()
    }

    fn read(bytes: &[u8], room: u64) -> Result<Volume, FormatError> {
        decode(Contents {
            bytes,
            beside: None,
            frame: None,
            room,
        })
    }

    #[test]
    fn a_stack_may_have_as_many_voxels_as_there_is_room_for() {
        let packed = stack(Compression::Lzw);
        assert!((packed.len() as u64) < VOXELS / 2);
        let whole = read(&packed, VOXELS).unwrap();
        assert_eq!(whole.size(), [64, 64, 4]);
        assert_eq!(whole.value([63, 63, 3]) as u8, 3);
        let refused = read(&packed, VOXELS - 1);
        assert!(
            matches!(refused, Err(FormatError::Size { limit, .. }) if limit == VOXELS - 1),
            "{refused:?}"
        );
        // The bytes of the file itself are room enough.
        let plain = stack(Compression::Uncompressed);
        assert!((plain.len() as u64) < VOXELS + u64::from(SIDE * SIDE));
        assert_eq!(read(&plain, 0).unwrap().len() as u64, VOXELS);
    }
}
