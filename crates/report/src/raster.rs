//! Pictures made elsewhere as panels, such as rendered surfaces.

use plotters_backend::text_anchor::HPos;
use resize::Pixel;
use resize::Type::Catrom;
use resize::px::RGB;
use srgb::Rgb;

use crate::axes::{Margins, draw_lines, title_height};
use crate::colour::{FRAME, INK};
use crate::error::{Error, Result};
use crate::geom::Rect;
use crate::legend::LegendEntry;
use crate::panel::{Context, Drawable, Spot};
use crate::surface::{PNG_SCALE, Scaling, Surface, outline};

/// A panel that shows a picture, with a title above and a caption below.
///
/// It is resampled, in linear light by the cubic filter of Catmull and Rom, to two pixels per
/// layout unit. Transparent pixels show the white page.
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    /// Title above the picture; may be empty.
    pub title: String,
    /// Caption below the picture; may be empty.
    pub caption: String,
    /// Columns and rows.
    pub size: [usize; 2],
    /// Red, green, blue and opacity (not multiplied into the colour), sRGB, row by row from the
    /// top.
    pub pixels: Vec<[u8; 4]>,
    /// Whether a thin frame is drawn around the picture.
    pub frame: bool,
}

impl Raster {
    /// A picture of `size` columns and rows without title, caption and frame.
    pub fn new(size: [usize; 2], pixels: impl Into<Vec<[u8; 4]>>) -> Self {
        Self {
            title: String::new(),
            caption: String::new(),
            size,
            pixels: pixels.into(),
            frame: false,
        }
    }

    /// Sets the title above the picture.
    #[must_use]
    pub fn with_title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Sets the caption below the picture.
    #[must_use]
    pub fn with_caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Draws a thin frame around the picture.
    #[must_use]
    pub fn with_frame(mut self) -> Self {
        self.frame = true;
        self
    }

    /// Name of the panel in errors.
    fn name(&self) -> String {
        if self.title.is_empty() {
            self.caption.clone()
        } else {
            self.title.clone()
        }
    }

    fn check(&self) -> Result<()> {
        let [columns, rows] = self.size;
        let expected = columns.saturating_mul(rows);
        if self.pixels.len() != expected {
            return Err(Error::ArrayShape {
                chart: self.name(),
                shape: self.size,
                expected,
                found: self.pixels.len(),
            });
        }
        if expected == 0 {
            return Err(Error::NoPixels { chart: self.name() });
        }
        Ok(())
    }

    /// The picture on white, in linear light, in another size.
    fn resampled(&self, columns: usize, rows: usize) -> Result<Vec<Rgb>> {
        let source: Vec<RGB<f32>> = self
            .pixels
            .iter()
            .map(|&[r, g, b, a]| {
                let opacity = f32::from(a) / 255.0;
                let on_white = |v| opacity * srgb::decode(v) + (1.0 - opacity);
                RGB::new(on_white(r), on_white(g), on_white(b))
            })
            .collect();
        let mut target = vec![RGB::new(0.0, 0.0, 0.0); columns * rows];
        let failed = |error: resize::Error| Error::Draw {
            cause: error.to_string(),
        };
        resize::new(
            self.size[0],
            self.size[1],
            columns,
            rows,
            Pixel::RGBF32,
            Catrom,
        )
        .map_err(failed)?
        .resize(&source, &mut target)
        .map_err(failed)?;
        let encode = |p: RGB<f32>| Rgb(srgb::encode(p.r), srgb::encode(p.g), srgb::encode(p.b));
        Ok(target.into_iter().map(encode).collect())
    }
}

/// Space between picture and caption.
const GAP: f64 = 4.0;

impl Drawable for Raster {
    fn legend(&self) -> Vec<Vec<LegendEntry>> {
        Vec::new()
    }

    fn aspect(&self, _: &Context) -> Result<Option<f64>> {
        self.check()?;
        Ok(Some(self.size[1] as f64 / self.size[0] as f64))
    }

    fn margins(&self, context: &Context, _: Spot, _: f64, _: f64) -> Result<Margins> {
        let fonts = context.fonts;
        let caption = match title_height(&self.caption, fonts.label, context.cell_width) {
            height if height > 0.0 => GAP + height,
            _ => 0.0,
        };
        Ok(Margins {
            left: 1.0,
            right: 1.0,
            top: 1.0 + title_height(&self.title, fonts.title, context.cell_width),
            bottom: 1.0 + caption,
        })
    }

    fn draw(
        &self,
        context: &Context,
        surface: &mut dyn Surface,
        _: Spot,
        plot: Rect,
        outer: Rect,
    ) -> Result<()> {
        let pixels = |side: f64| (side * f64::from(PNG_SCALE)) as usize;
        let (columns, rows) = (pixels(plot.width), pixels(plot.height));
        let cells = self.resampled(columns, rows)?;
        surface.image(plot, columns, &cells, Scaling::Smooth)?;
        if self.frame {
            outline(surface, plot, 1.0, FRAME)?;
        }
        let middle = plot.centre().x;
        let lines = [
            (&self.title, context.fonts.title, outer.y),
            (&self.caption, context.fonts.label, plot.bottom() + GAP),
        ];
        for (text, em, top) in lines {
            let at = (middle, top);
            draw_lines(
                surface,
                text,
                (em, INK),
                HPos::Center,
                at,
                context.cell_width,
            )?;
        }
        Ok(())
    }
}
