//! Paper of pixels: in, lines, polygons and text; out, a picture in a file or its pixels.
//!
//! Everything is drawn at [`SCALE`] times the size and averaged down, so that letters and thin lines come out even.

use std::path::Path;
use std::sync::OnceLock;

use plotters::backend::{BitMapBackend, DrawingBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{
    Color, FontDesc, FontFamily, FontStyle, FontTransform, RGBColor, ShapeStyle, TextStyle, register_font,
};

use super::{Anchor, Area, Drawn, Point, Rgb, Trouble};

/// Oversampling in each direction.
pub(super) const SCALE: i32 = 3;
/// How far the font's letters lie above the middle of their line, of its height.
const RISE: f64 = 0.12;
/// Bytes of a pixel.
const CHANNELS: usize = 3;
const FONT: &str = "rf-hoi";

/// White paper that becomes pixels.
pub(super) struct Pixels {
    pixels: Vec<u8>,
    width: i32,
    height: i32,
}

impl Pixels {
    pub(super) fn new(width: i32, height: i32) -> Self {
        let (width, height) = (width.max(1) * SCALE, height.max(1) * SCALE);
        Self { pixels: vec![255; (width * height) as usize * CHANNELS], width, height }
    }

    fn backend(&mut self) -> BitMapBackend<'_> {
        BitMapBackend::with_buffer(&mut self.pixels, (self.width as u32, self.height as u32))
    }

    /// Gives each pixel of a rectangle the colour that `colour(x, y)` has for it, counted from its upper left corner.
    pub(super) fn paint(&mut self, area: Area, colour: impl Fn(i32, i32) -> Rgb) {
        let (paper_width, paper_height) = (self.width / SCALE, self.height / SCALE);
        for y in area.top.max(0)..area.bottom().min(paper_height) {
            for x in area.left.max(0)..area.right().min(paper_width) {
                let colour = colour(x - area.left, y - area.top);
                for row in 0..SCALE {
                    let start = ((y * SCALE + row) * self.width + x * SCALE) as usize * CHANNELS;
                    for pixel in
                        self.pixels[start..start + SCALE as usize * CHANNELS].chunks_exact_mut(CHANNELS)
                    {
                        pixel.copy_from_slice(&colour);
                    }
                }
            }
        }
    }

    /// Draws a line through points, `width` pixels wide.
    pub(super) fn line(&mut self, points: &[Point], colour: Rgb, width: i32) -> Drawn {
        let points: Vec<_> = points.iter().map(|&p| scaled(p)).collect();
        let style = shape(colour, (width * SCALE) as u32);
        self.backend().draw_path(points, &style).map_err(Trouble::new)
    }

    /// Fills a circle.
    pub(super) fn circle(&mut self, at: Point, radius: f64, colour: Rgb) -> Drawn {
        let radius = (radius * f64::from(SCALE)).round() as u32;
        self.backend().draw_circle(scaled(at), radius, &shape(colour, 1), true).map_err(Trouble::new)
    }

    /// Fills a polygon.
    pub(super) fn polygon(&mut self, corners: &[Point], colour: Rgb) -> Drawn {
        let corners: Vec<_> = corners.iter().map(|&p| scaled(p)).collect();
        self.backend().fill_polygon(corners, &shape(colour, 1)).map_err(Trouble::new)
    }

    /// Writes a text with letters `size` pixels high.
    pub(super) fn text(&mut self, text: &str, size: f64, at: Point, anchor: Anchor, colour: Rgb) -> Drawn {
        let horizontal = match anchor {
            Anchor::Left => HPos::Left,
            Anchor::Right => HPos::Right,
            Anchor::Middle | Anchor::MiddleUpwards => HPos::Center,
        };
        let (mut font, mut at) = (font(size), at);
        if anchor == Anchor::MiddleUpwards {
            font = font.transform(FontTransform::Rotate270);
            at.0 += RISE * size;
        } else {
            at.1 += RISE * size;
        }
        let [red, green, blue] = colour;
        let colour = RGBColor(red, green, blue);
        let style = TextStyle::from(font).pos(Pos::new(horizontal, VPos::Center)).color(&colour);
        self.backend().draw_text(text, &style, scaled(at)).map_err(Trouble::new)
    }

    /// Averages the picture down and writes it to `path` in the format of its extension.
    pub(super) fn save(&self, path: &Path) -> Drawn {
        let (size, pixels) = self.pixels();
        let mut file = BitMapBackend::new(path, size);
        file.blit_bitmap((0, 0), size, &pixels).map_err(Trouble::new)?;
        file.present().map_err(Trouble::new)
    }

    /// Width and height of the picture averaged down, and its pixels, row by row.
    pub(super) fn pixels(&self) -> ((u32, u32), Vec<u8>) {
        let (width, height) = (self.width / SCALE, self.height / SCALE);
        let mut pixels = Vec::with_capacity((width * height) as usize * CHANNELS);
        for y in 0..height {
            for x in 0..width {
                for channel in 0..CHANNELS {
                    let part = |n: i32| {
                        let (row, column) = (y * SCALE + n / SCALE, x * SCALE + n % SCALE);
                        u32::from(self.pixels[(row * self.width + column) as usize * CHANNELS + channel])
                    };
                    let parts = SCALE * SCALE;
                    pixels.push(((0..parts).map(part).sum::<u32>() / parts as u32) as u8);
                }
            }
        }
        ((width as u32, height as u32), pixels)
    }
}

/// Width of a text with letters `size` pixels high, pixels.
pub(super) fn text_width(text: &str, size: f64) -> Result<i32, Trouble> {
    let (width, _) = font(size).box_size(text).map_err(Trouble::new)?;
    Ok(width as i32 / SCALE)
}

fn scaled((x, y): Point) -> (i32, i32) {
    let scale = f64::from(SCALE);
    ((x * scale).round() as i32, (y * scale).round() as i32)
}

fn shape([red, green, blue]: Rgb, width: u32) -> ShapeStyle {
    RGBColor(red, green, blue).filled().stroke_width(width)
}

/// The one font, at oversampled size.
fn font(size: f64) -> FontDesc<'static> {
    static REGISTERED: OnceLock<()> = OnceLock::new();
    REGISTERED.get_or_init(|| {
        // A font that fails to register shows as an error of the first text.
        let _ = register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT);
    });
    FontDesc::new(FontFamily::Name(FONT), size * f64::from(SCALE), FontStyle::Normal)
}
