//! Shapes in the plane, as the pixels of an image.

use std::sync::Arc;

use images::{Drawing, Frame, Interface, Outline, Svg};
use render::Rgb;

use crate::prelude::*;

/// Files of a run with the image that is repaired, and with the pixels that are drawn anew in black.
pub const ORIGINAL: &str = "original.png";
const MASK: &str = "mask.png";

/// A raster, and the image of which only what is in a mask is drawn anew, if there is one.
#[derive(Serialize, Deserialize, Clone, Debug)]
pub struct Plane {
    frame: Frame,
    is_repaired: bool,
    #[serde(skip)]
    original: Option<Arc<Original>>,
}

#[derive(Debug)]
struct Original {
    picture: Picture,
    /// For each pixel whether it is drawn anew.
    drawn: Vec<bool>,
}

impl Plane {
    pub fn new(frame: Frame) -> Self {
        Self {
            frame,
            is_repaired: false,
            original: None,
        }
    }

    /// In the tones of a picture of the same size, all of whose pixels outside of a mask stay.
    #[must_use]
    pub fn repairing(self, picture: Picture, mask: &dyn SignedDistance<2>) -> Self {
        let width = self.frame.width() as usize;
        let is_inside = |pixel: usize| {
            let [column, row] = [pixel % width, pixel / width].map(|i| i as f64 + 0.5);
            mask.signed_distance(self.frame.point([column, row])) < 0.0
        };
        let drawn = (0..picture.pixels().len()).map(is_inside).collect();
        Self {
            is_repaired: true,
            original: Some(Arc::new(Original { picture, drawn })),
            ..self
        }
    }

    fn svg(&self, u: &Field<2>) -> Result<Svg, Error> {
        let outline = Outline::of_phase_field(u)?;
        Ok(Svg::on_white(self.frame).filled(&outline, Rgb::BLACK))
    }
}

impl Original {
    /// With a drawing, whose opacity is 1 inside, in the mask.
    fn with(&self, drawing: &Picture) -> Result<Picture, Error> {
        let [ink, paper] = [(u8::MAX, 0.0), (0, 255.0)].map(|(opacity, usual)| {
            let around = self.tone(drawing, opacity);
            around.unwrap_or([usual, usual, usual, 255.0])
        });
        let mixed = |(k, own): (usize, &[u8; 4])| {
            if !self.drawn[k] {
                return *own;
            }
            let part = f64::from(drawing.pixels()[k][3]) / 255.0;
            std::array::from_fn(|c| (part * ink[c] + (1.0 - part) * paper[c]).round() as u8)
        };
        let pixels = self.picture.pixels().iter().enumerate().map(mixed);
        let (width, height) = (self.picture.width(), self.picture.height());
        Ok(Picture::new(width, height, pixels.collect())?)
    }

    /// The mean of the pixels outside of the mask where the drawing has this opacity: those near the mask, or else all of them.
    fn tone(&self, drawing: &Picture, opacity: u8) -> Option<[f64; 4]> {
        let width = self.picture.width() as usize;
        let place = |pixel: usize| [pixel % width, pixel / width];
        let drawn = (0..self.drawn.len()).filter(|&pixel| self.drawn[pixel]);
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for pixel in drawn {
            for (axis, at) in place(pixel).into_iter().enumerate() {
                low[axis] = low[axis].min(at);
                high[axis] = high[axis].max(at);
            }
        }
        let is_near = |pixel: usize| {
            (place(pixel).into_iter().enumerate()).all(|(axis, at)| {
                let margin = 8 + (high[axis].saturating_sub(low[axis])) / 4;
                (low[axis].saturating_sub(margin)..=high[axis] + margin).contains(&at)
            })
        };
        let mean = |near: bool| {
            let (mut sum, mut count) = ([0.0; 4], 0.0);
            for (pixel, own) in self.picture.pixels().iter().enumerate() {
                let fits = drawing.pixels()[pixel][3] == opacity && !self.drawn[pixel];
                if fits && (!near || is_near(pixel)) {
                    count += 1.0;
                    sum = std::array::from_fn(|c| sum[c] + f64::from(own[c]));
                }
            }
            (count > 0.0).then(|| sum.map(|sum| sum / count))
        };
        mean(true).or_else(|| mean(false))
    }
}

impl Outlet<2> for Plane {
    const SAVED: &'static [&'static str] = &["png", "svg"];
    const USUAL: &'static str = "svg";

    fn turn(&mut self, up: &mut Option<UpAxis>) -> Result<(), Error> {
        match up {
            None => Ok(()),
            Some(axis) => Err(Error::options(format!(
                "--up {axis} has no meaning in the plane: leave it out"
            ))),
        }
    }

    fn picture(&self, _: &Field<2>, u: &Field<2>, eps: f64) -> Result<Picture, Error> {
        let interface = Interface::new(u, eps)?;
        match &self.original {
            None => Ok(Drawing::on_white(self.frame)
                .filled(&interface, Rgb::BLACK)
                .picture()?),
            Some(original) => {
                let drawing = Drawing::transparent(self.frame).filled(&interface, Rgb::BLACK);
                original.with(&drawing.picture()?)
            }
        }
    }

    fn topology(&self, u: &Field<2>, _: f64) -> Result<Topology, Error> {
        Ok(Topology {
            components: Outline::of_phase_field(u)?.curves().len(),
            euler_characteristic: None,
        })
    }

    fn save(&self, u: &Field<2>, eps: f64, path: &Path) -> Result<(), Error> {
        match &*extension(path) {
            "svg" => self.svg(u)?.write(path)?,
            _ => self.picture(u, u, eps)?.write_png(path)?,
        }
        Ok(())
    }

    fn inputs(&self) -> Result<Vec<(&str, Vec<u8>)>, Error> {
        let Some(original) = &self.original else {
            return Ok(Vec::new());
        };
        let tone = |&drawn: &bool| if drawn { [0, 0, 0, 255] } else { [255; 4] };
        let (width, height) = (original.picture.width(), original.picture.height());
        let mask = Picture::new(width, height, original.drawn.iter().map(tone).collect())?;
        Ok(vec![
            (ORIGINAL, original.picture.to_png()?),
            (MASK, mask.to_png()?),
        ])
    }

    fn restore(&mut self, stored: &StoredRun) -> Result<(), Error> {
        if self.is_repaired {
            let picture = |name: &str| {
                let path = stored.path().join(name);
                let bytes = std::fs::read(&path).map_err(Error::io("read", &path))?;
                Ok::<_, Error>(Picture::from_png(&bytes)?)
            };
            let drawn = picture(MASK)?.pixels().iter().map(|p| p[0] == 0).collect();
            let picture = picture(ORIGINAL)?;
            self.original = Some(Arc::new(Original { picture, drawn }));
        }
        Ok(())
    }
}
