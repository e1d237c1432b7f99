//! Shapes in the plane, as the pixels of an image.

use images::{Frame, Image, Outline, Side, drawing, interface};
use render::Rgb;

use crate::faired::Faired;
use crate::file::{File, Input};
use crate::made::{Curve, Shape};
use crate::prelude::*;
use crate::presentation::{Presentation, Topology};

/// Files of a run with the image that is repaired, and with the pixels that are drawn anew in black.
pub const ORIGINAL: &str = "original.png";
const MASK: &str = "mask.png";
/// Pixels a side of pictures of boxes.
const PIXELS: u32 = 512;

/// A raster, and the image of which only what is in a mask is drawn anew, if there is one.
#[derive(Serialize, Deserialize)]
pub struct Plane {
    frame: Frame,
    #[serde(skip)]
    original: Option<Original>,
    /// The input, if it is an image, which a mask has to fit.
    #[serde(skip)]
    image: Option<File>,
}

struct Original {
    picture: Picture,
    /// For each pixel whether it is drawn anew.
    drawn: Vec<bool>,
}

impl Plane {
    /// The frame has the pixels of the image.
    pub fn of_image(image: &Image, file: &File) -> Result<Self> {
        let [_, height] = image.size();
        Ok(Self {
            frame: Frame::new(image.size(), [0.0, f64::from(height)], 1.0)?,
            original: None,
            image: Some(file.clone()),
        })
    }

    /// The outline as the text of an SVG file.
    fn drawing(&self, u: &Stored<2>) -> Result<String> {
        let outline = Outline::of_phase_field(&u.field()?)?;
        Ok(images::svg(&self.frame, &outline))
    }

    /// What is inside a mask that is an image: of the size of the input, or else a square, which fills the box.
    pub fn mask(&self, mask: &Input, grid: &Grid<2>) -> Result<Box<dyn SignedDistance<2>>> {
        let image = mask.file()?.image()?;
        let (size, of_input) = (image.size(), self.frame.size());
        if self.image.is_some() && size != of_input {
            return Err(Refusal::MaskSize {
                mask: mask.to_string(),
                size,
                of_input,
            }
            .into());
        }
        if self.image.is_none() && size[0] != size[1] {
            return Err(Refusal::MaskNotSquare {
                mask: mask.to_string(),
                size,
            }
            .into());
        }
        let side = Side::of(&image, 0.5)?;
        let mut outline = Outline::of_image(&image, side)?;
        if self.image.is_none() {
            let fills = Placement::fit(&image.bounding_box(), grid, grid.side())?;
            outline = outline.placed(&fills);
        }
        Ok(Box::new(outline.distance()))
    }

    /// From now on in the tones of the input, if it is an image, all of whose pixels outside of a mask stay.
    pub fn repair(&mut self, mask: &dyn SignedDistance<2>, watcher: &dyn Watcher) -> Result<()> {
        let Some(file) = &self.image else {
            return Ok(());
        };
        let (path, bytes) = (&file.path, file.read()?);
        let picture = images::colours(path, &bytes)?;
        if images::is_deep(&bytes) {
            watcher.warning(&Warning::Deep { path: path.clone() });
        }
        let width = self.frame.size()[0] as usize;
        let is_inside = |pixel: usize| {
            let [column, row] = [pixel % width, pixel / width].map(|i| i as f64 + 0.5);
            mask.signed_distance(self.frame.point([column, row])) < 0.0
        };
        let drawn: Vec<bool> = (0..picture.pixels().len()).map(is_inside).collect();
        if !drawn.contains(&true) {
            return Err(Refusal::MaskWithoutPixels(path.clone()).into());
        }
        self.original = Some(Original { picture, drawn });
        Ok(())
    }
}

impl Original {
    /// With a drawing, whose opacity is 1 inside, in the mask.
    fn with(&self, drawing: &Picture) -> Result<Picture> {
        let [ink, paper] = [(u8::MAX, 0.0), (0, 255.0)].map(|(opacity, usual)| {
            let around = self.tone(drawing, opacity);
            around.unwrap_or_else(|| weighted([usual, usual, usual, 255.0]))
        });
        let mut pixels = self.picture.pixels().to_vec();
        let drawn = pixels.iter_mut().zip(drawing.pixels()).zip(&self.drawn);
        for ((pixel, inside), _) in drawn.filter(|(_, drawn)| **drawn) {
            let part = f64::from(inside[3]) / 255.0;
            let [r, g, b, opacity] = [0, 1, 2, 3].map(|c| part * ink[c] + (1.0 - part) * paper[c]);
            let colour = [r / opacity, g / opacity, b / opacity, opacity];
            *pixel = colour.map(|value| value.round() as u8);
        }
        Ok(Picture::new(self.picture.size(), pixels)?)
    }

    /// The [weighted] mean of the pixels outside of the mask where the drawing has this opacity: those near the mask, or else all of them.
    fn tone(&self, drawing: &Picture, opacity: u8) -> Option<[f64; 4]> {
        let width = self.picture.size()[0] as usize;
        let place = |pixel: usize| [pixel % width, pixel / width].map(|i| i as f64);
        let drawn = (0..self.drawn.len()).filter(|&pixel| self.drawn[pixel]);
        let mask = BoundingBox::around(drawn.map(place))?;
        let margins = mask.extent().map(|side| 8.0 + (side / 4.0).floor());
        let around = mask.grown(margins);
        let mean = |near: bool| {
            let (mut sum, mut count) = ([0.0; 4], 0.0);
            for (pixel, own) in self.picture.pixels().iter().enumerate() {
                let fits = drawing.pixels()[pixel][3] == opacity && !self.drawn[pixel];
                if fits && (!near || around.contains(place(pixel))) {
                    count += 1.0;
                    let own = weighted(own.map(f64::from));
                    sum = std::array::from_fn(|c| sum[c] + own[c]);
                }
            }
            (count > 0.0).then(|| sum.map(|sum| sum / count))
        };
        mean(true).or_else(|| mean(false))
    }
}

/// The channels of a colour times its opacity, and its opacity: in this form colours are averaged. What is transparent weighs next to nothing, so
/// that its colour counts only where there is no other.
fn weighted([r, g, b, opacity]: [f64; 4]) -> [f64; 4] {
    let opacity = opacity.max(1e-6);
    [opacity * r, opacity * g, opacity * b, opacity]
}

impl Presentation<2> for Plane {
    const SAVED: &'static [&'static str] = &["png", "svg"];
    const USUAL: &'static str = "svg";

    fn of_box(grid: &Grid<2>) -> Result<Self> {
        Ok(Self {
            frame: Frame::of_box(grid, PIXELS)?,
            original: None,
            image: None,
        })
    }

    fn turn(&mut self, up: &mut Option<UpAxis>) -> Result<()> {
        match up {
            Some(axis) => Err(Error::foreign("up", axis, "a shape in the plane")),
            None => Ok(()),
        }
    }

    fn picture(&self, _: &Stored<2>, u: &Stored<2>, eps: f64) -> Result<Picture> {
        let interface = interface(&u.field()?, eps)?;
        match &self.original {
            None => Ok(drawing(&self.frame, &interface, Some(Rgb::WHITE))?),
            Some(original) => original.with(&drawing(&self.frame, &interface, None)?),
        }
    }

    fn topology(&self, u: &Stored<2>) -> Result<Topology> {
        let components = match Outline::of_phase_field(&u.field()?) {
            Ok(outline) => outline.curves().len(),
            Err(images::Error::NoInterface { .. }) => 0,
            Err(error) => return Err(error.into()),
        };
        Ok(Topology {
            components,
            euler_characteristic: None,
        })
    }

    fn encode(&self, u: &Stored<2>, eps: f64, format: &str) -> Result<Vec<u8>> {
        match format {
            "svg" => Ok(self.drawing(u)?.into_bytes()),
            _ => Ok(self.picture(u, u, eps)?.to_png()?),
        }
    }

    fn shape(&self, u: &Stored<2>, eps: f64, _: Option<Faired>) -> Result<Shape> {
        Ok(Shape::Curve(Curve {
            picture: self.picture(u, u, eps)?,
            svg: self.drawing(u)?,
        }))
    }

    fn inputs(&self) -> Result<Vec<(String, Vec<u8>)>> {
        let Some(original) = &self.original else {
            return Ok(Vec::new());
        };
        let tone = |&drawn: &bool| if drawn { [0, 0, 0, 255] } else { [255; 4] };
        let drawn = original.drawn.iter().map(tone).collect();
        let mask = Picture::new(original.picture.size(), drawn)?;
        Ok(vec![
            (ORIGINAL.to_owned(), original.picture.to_png()?),
            (MASK.to_owned(), mask.to_png()?),
        ])
    }

    fn restore(&mut self, stored: &StoredRun) -> Result<()> {
        if stored.files().any(|name| name == ORIGINAL) {
            let picture = |name: &str| Ok::<_, Error>(images::colours(name, &stored.read(name)?)?);
            let drawn = picture(MASK)?.pixels().iter().map(|p| p[0] == 0).collect();
            let picture = picture(ORIGINAL)?;
            self.original = Some(Original { picture, drawn });
        }
        Ok(())
    }
}
