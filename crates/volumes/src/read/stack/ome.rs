//! Descriptions of OME-TIFF.
//!
//! <https://docs.openmicroscopy.org/ome-model/latest/ome-tiff/specification.html>.

use glam::DVec3;

use super::planes::Planes;

/// Units of length in metres. Others need not be known where all sizes have the same one.
const UNITS: [(&str, f64); 14] = [
    ("m", 1.0),
    ("dm", 1e-1),
    ("cm", 1e-2),
    ("mm", 1e-3),
    ("µm", 1e-6),
    ("nm", 1e-9),
    ("pm", 1e-12),
    ("fm", 1e-15),
    ("km", 1e3),
    ("Å", 1e-10),
    ("thou", 2.54e-5),
    ("in", 2.54e-2),
    ("ft", 0.3048),
    ("yd", 0.9144),
];
/// The unit of what has none.
const USUAL_UNIT: &str = "µm";
/// Other ways to write units.
const SPELLINGS: [(&str, &str); 6] = [
    ("&#181;", "µ"),
    ("&#xB5;", "µ"),
    ("&#xb5;", "µ"),
    ("&#956;", "µ"),
    ("\u{3bc}", "µ"),
    ("\u{212b}", "Å"),
];

/// Whether a description is XML of OME, perhaps damaged.
pub(super) fn is_meant(text: &str) -> bool {
    text.trim_start().starts_with('<') && text.contains("OME")
}

/// What the description tells.
pub(super) struct Pixels {
    pub planes: Planes,
    /// Whether the pages are where they are by the order of the axes.
    pub is_in_order: bool,
    /// The sides of voxels, in the unit of the first one.
    pub sides: Option<DVec3>,
    /// Whether the distance of pages is not told, and that of rows instead.
    pub lacks_distance: bool,
}

impl Pixels {
    /// Of the first image; or what is wrong with the description.
    pub fn of(text: &str) -> Result<Self, String> {
        let mut elements = Elements { rest: text };
        let pixels = elements.find(|element| element.name() == "Pixels");
        let pixels = pixels.ok_or("it has no element Pixels")?;
        let order = pixels.get("DimensionOrder").unwrap_or_default();
        let axes: Vec<char> = order.chars().collect();
        let ['X', 'Y', axes @ ..] = &axes[..] else {
            return Err(format!("DimensionOrder is {}", files::shortened(order, 20)));
        };
        let sizes = axes.iter().map(|&axis| pixels.size(axis));
        let sizes: Vec<(char, u64)> = sizes.collect::<Result<_, _>>()?;
        let planes = Planes::new(&sizes).ok_or("DimensionOrder is not one of X, Y, Z, C, T")?;
        // Of the other images there are other pages.
        let parts = elements.take_while(|element| element.name() != "Pixels");
        let mut pages = parts.filter(|element| element.name() == "TiffData");
        let is_in_order: Result<bool, String> =
            pages.try_fold(true, |all, page| Ok(all && page.is_in_order(&planes)?));
        let [x, y, z] = pixels.sides()?;
        Ok(Self {
            planes,
            is_in_order: is_in_order?,
            sides: x.zip(y).map(|(x, y)| DVec3::new(x, y, z.unwrap_or(y))),
            lacks_distance: x.is_some() && z.is_none(),
        })
    }
}

/// The beginnings of elements in a document.
struct Elements<'a> {
    rest: &'a str,
}

/// What stands between the brackets.
struct Element<'a>(&'a str);

impl<'a> Iterator for Elements<'a> {
    type Item = Element<'a>;

    fn next(&mut self) -> Option<Element<'a>> {
        loop {
            let (_, rest) = self.rest.split_once('<')?;
            let ends = [
                ("!--", "-->"),
                ("![CDATA[", "]]>"),
                ("?", "?>"),
                ("/", ">"),
                ("!", ">"),
            ];
            let other = ends.into_iter().find(|(start, _)| rest.starts_with(start));
            if let Some((_, end)) = other {
                (_, self.rest) = rest.split_once(end)?;
                continue;
            }
            let mut quote = None;
            let end = rest.find(|c: char| match quote {
                None if c == '>' => true,
                None => {
                    quote = Some(c).filter(|c| "\"'".contains(*c));
                    false
                }
                Some(open) => {
                    quote = Some(open).filter(|open| *open != c);
                    false
                }
            })?;
            self.rest = &rest[end + 1..];
            return Some(Element(&rest[..end]));
        }
    }
}

impl<'a> Element<'a> {
    /// Its name without that of a namespace.
    fn name(&self) -> &'a str {
        let end = |c: char| c.is_whitespace() || c == '/';
        let name = self.0.split(end).next().unwrap_or_default();
        name.rsplit(':').next().unwrap_or_default()
    }

    /// The value of an attribute.
    fn get(&self, name: &str) -> Option<&'a str> {
        let mut rest = self.0;
        loop {
            let (before, after) = rest.split_once('=')?;
            let quote = after
                .trim_start()
                .chars()
                .next()
                .filter(|c| "\"'".contains(*c))?;
            let (value, after) = after.trim_start()[1..].split_once(quote)?;
            if before.split_whitespace().next_back() == Some(name) {
                return Some(value);
            }
            rest = after;
        }
    }

    fn whole(&self, name: &str) -> Result<Option<u64>, String> {
        let parsed = self.get(name).map(str::parse).transpose();
        parsed.map_err(|_| format!("{name} is no whole number"))
    }

    fn size(&self, axis: char) -> Result<(char, u64), String> {
        let name = format!("Size{axis}");
        match self.whole(&name)? {
            Some(count @ 1..) => Ok((axis, count)),
            _ => Err(format!("{name} is no positive number")),
        }
    }

    /// Whether the pages that this notes are where they are by the order of the axes.
    fn is_in_order(&self, planes: &Planes) -> Result<bool, String> {
        let Some(page) = self.whole("IFD")? else {
            return Ok(true);
        };
        let mut index = [0; 3];
        for (index, name) in index.iter_mut().zip(["FirstZ", "FirstC", "FirstT"]) {
            *index = self.whole(name)?.unwrap_or(0);
        }
        Ok(planes.page(index) == Some(page))
    }

    /// The sizes of voxels in the unit of the first one, as far as they are noted.
    fn sides(&self) -> Result<[Option<f64>; 3], String> {
        let [x, y, z] = [self.side('X')?, self.side('Y')?, self.side('Z')?];
        let Some((side, unit)) = x.clone() else {
            return match y.or(z) {
                None => Ok([None; 3]),
                Some(_) => Err("there is no PhysicalSizeX".to_owned()),
            };
        };
        let converted = |size: Option<(f64, String)>| {
            let size = size.map(|(side, own)| ratio(&own, &unit).map(|ratio| ratio * side));
            size.transpose()
        };
        Ok([Some(side), converted(y)?.or(Some(side)), converted(z)?])
    }

    fn side(&self, axis: char) -> Result<Option<(f64, String)>, String> {
        let name = format!("PhysicalSize{axis}");
        let Some(text) = self.get(&name) else {
            return Ok(None);
        };
        let side = text.trim().parse().ok();
        let Some(side) = side.filter(|side: &f64| side.is_normal() && *side > 0.0) else {
            return Err(format!("{name} is {}", files::shortened(text, 20)));
        };
        let unit = self.get(&format!("{name}Unit")).unwrap_or(USUAL_UNIT);
        let mut unit = unit.trim().to_owned();
        for (other, usual) in SPELLINGS {
            unit = unit.replace(other, usual);
        }
        Ok(Some((side, unit)))
    }
}

/// How many of a unit another one is.
fn ratio(of: &str, unit: &str) -> Result<f64, String> {
    if of == unit {
        return Ok(1.0);
    }
    let metres = |name: &str| {
        let known = UNITS.iter().find(|(known, _)| *known == name);
        let unknown = || format!("the unit {} is unknown", files::shortened(name, 20));
        known.map(|(_, metres)| *metres).ok_or_else(unknown)
    };
    Ok(metres(of)? / metres(unit)?)
}
