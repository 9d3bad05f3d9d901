//! What panels draw on. In: lines, markers, hatching and text, in the picture's pixels from its upper left corner. Out: a
//! file of pixels or of vectors ([`Pixels`] and [`Svg`]).

mod hatch;
mod pixels;
mod svg;

use std::path::Path;

pub(super) use hatch::{Hatch, Weave};
use pixels::Pixels;
use svg::Svg;

/// A colour: red, green, blue.
pub(super) type Rgb = [u8; 3];

/// Letters.
pub(super) const INK: Rgb = [24, 24, 24];
/// Axes and frames.
pub(super) const FRAME: Rgb = [96, 96, 96];
/// Grid lines.
pub(super) const GRID: Rgb = [224, 224, 224];
/// The paper.
pub(super) const WHITE: Rgb = [255; 3];
/// Width of the pale edge around labels, pixels.
pub(super) const EDGE: f64 = 2.0;
/// Width of the outline of hollow markers, pixels.
const OUTLINE: f64 = 1.8;

/// The drawing library's complaint.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct Trouble(String);

impl Trouble {
    fn new(error: impl std::fmt::Display) -> Self {
        Self(error.to_string())
    }
}

/// Outcome of drawing.
pub(super) type Drawn = Result<(), Trouble>;

/// A place in the picture; pixels, fractions allowed.
pub(super) type Point = (f64, f64);

/// A rectangle of the picture, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Area {
    pub(super) left: i32,
    pub(super) top: i32,
    pub(super) width: i32,
    pub(super) height: i32,
}

impl Area {
    /// The whole pixels that a rectangle of any size touches.
    pub(super) fn around((left, top): Point, (width, height): Point) -> Self {
        Self {
            left: left as i32,
            top: top as i32,
            width: width.ceil() as i32 + 1,
            height: height.ceil() as i32 + 1,
        }
    }

    /// First column right of it.
    pub(super) fn right(self) -> i32 {
        self.left + self.width
    }

    /// First row below it.
    pub(super) fn bottom(self) -> i32 {
        self.top + self.height
    }

    /// What is left inside these margins; at least one pixel.
    pub(super) fn inside(self, left: i32, top: i32, right: i32, bottom: i32) -> Self {
        Self {
            left: self.left + left,
            top: self.top + top,
            width: (self.width - left - right).max(1),
            height: (self.height - top - bottom).max(1),
        }
    }

    /// Middle of it.
    pub(super) fn middle(self) -> Point {
        (
            f64::from(self.left) + f64::from(self.width) / 2.0,
            f64::from(self.top) + f64::from(self.height) / 2.0,
        )
    }

    /// Whether all of `inner` is in it.
    pub(super) fn contains(self, inner: Self) -> bool {
        inner.left >= self.left
            && inner.top >= self.top
            && inner.right() <= self.right()
            && inner.bottom() <= self.bottom()
    }

    /// Whether a pixel is in both.
    pub(super) fn overlaps(self, other: Self) -> bool {
        self.left < other.right()
            && other.left < self.right()
            && self.top < other.bottom()
            && other.top < self.bottom()
    }
}

/// Which point of a text lies at the given place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    /// Middle of the left edge.
    Left,
    /// Middle of the right edge.
    Right,
    /// The middle.
    Middle,
    /// The middle of a text that runs upwards.
    MiddleUpwards,
}

/// Shape of a marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Marker {
    /// A circle.
    #[default]
    Circle,
    /// A square.
    Square,
    /// A triangle that points upwards.
    Triangle,
    /// A square on its corner.
    Diamond,
}

/// Markers of series in turn, so that they stay apart without colour.
const MARKERS: [Marker; 4] = [Marker::Circle, Marker::Square, Marker::Triangle, Marker::Diamond];

impl Marker {
    /// Number of shapes.
    pub(super) const COUNT: usize = MARKERS.len();

    /// That of series number `number`, counted from 0.
    pub(super) fn of_series(number: usize) -> Self {
        MARKERS[number % Self::COUNT]
    }
}

enum Paper {
    Pixels(Pixels),
    Svg(Svg),
}

/// The picture.
pub(super) struct Canvas {
    paper: Paper,
}

impl Canvas {
    /// White paper that becomes pixels.
    pub(super) fn of_pixels(width: i32, height: i32) -> Self {
        Self { paper: Paper::Pixels(Pixels::new(width, height)) }
    }

    /// White paper that becomes vectors.
    pub(super) fn of_vectors(width: i32, height: i32) -> Self {
        Self { paper: Paper::Svg(Svg::new(width, height)) }
    }

    /// Fills a rectangle, clipped to the paper.
    pub(super) fn fill(&mut self, area: Area, colour: Rgb) {
        match &mut self.paper {
            Paper::Pixels(pixels) => pixels.paint(area, |_, _| colour),
            Paper::Svg(svg) => svg.fill(area, colour),
        }
    }

    /// Gives each pixel of a rectangle the colour that `colour(x, y)` has for it, counted from its upper left corner.
    ///
    /// # Errors
    /// On paper of vectors, which has no pixels.
    pub(super) fn paint(&mut self, area: Area, colour: impl Fn(i32, i32) -> Rgb) -> Drawn {
        match &mut self.paper {
            Paper::Pixels(pixels) => {
                pixels.paint(area, colour);
                Ok(())
            }
            Paper::Svg(_) => Err(Trouble::new("a heatmap is made of pixels; save its figure as .png")),
        }
    }

    /// Fills a rectangle with a hatching.
    pub(super) fn hatch(&mut self, area: Area, hatch: &Hatch) {
        match &mut self.paper {
            Paper::Pixels(pixels) => pixels.paint(area, |x, y| hatch.colour(x, y)),
            Paper::Svg(svg) => svg.hatch(area, hatch),
        }
    }

    /// Fills a rectangle with colours that run upwards; `colour` has that of a height from 0 to 1.
    pub(super) fn ramp(&mut self, area: Area, colour: fn(f64) -> Rgb) {
        match &mut self.paper {
            Paper::Pixels(pixels) => {
                pixels.paint(area, |_, y| colour(1.0 - (f64::from(y) + 0.5) / f64::from(area.height)));
            }
            Paper::Svg(svg) => svg.ramp(area, colour),
        }
    }

    /// Draws the four sides of a rectangle, a pixel wide.
    pub(super) fn frame(&mut self, area: Area, colour: Rgb) -> Drawn {
        self.outline(area, colour, 1)
    }

    /// Draws the four sides of a rectangle, `width` pixels wide.
    pub(super) fn outline(&mut self, area: Area, colour: Rgb, width: i32) -> Drawn {
        let (left, top) = (f64::from(area.left), f64::from(area.top));
        let (right, bottom) = (f64::from(area.right()), f64::from(area.bottom()));
        self.line(&[(left, top), (right, top), (right, bottom), (left, bottom), (left, top)], colour, width)
    }

    /// Draws a line through points, `width` pixels wide.
    pub(super) fn line(&mut self, points: &[Point], colour: Rgb, width: i32) -> Drawn {
        match &mut self.paper {
            Paper::Pixels(pixels) => pixels.line(points, colour, width),
            Paper::Svg(svg) => {
                svg.line(points, colour, width);
                Ok(())
            }
        }
    }

    /// Fills a polygon.
    pub(super) fn polygon(&mut self, corners: &[Point], colour: Rgb) -> Drawn {
        match &mut self.paper {
            Paper::Pixels(pixels) => pixels.polygon(corners, colour),
            Paper::Svg(svg) => {
                svg.polygon(corners, colour);
                Ok(())
            }
        }
    }

    /// Draws a filled marker, `radius` pixels from its middle to its edge.
    pub(super) fn marker(&mut self, marker: Marker, at: Point, radius: f64, colour: Rgb) -> Drawn {
        let around = |corners: &[Point]| -> Vec<_> {
            corners.iter().map(|(x, y)| (at.0 + x * radius, at.1 + y * radius)).collect()
        };
        let corners = match marker {
            Marker::Circle => {
                return match &mut self.paper {
                    Paper::Pixels(pixels) => pixels.circle(at, radius, colour),
                    Paper::Svg(svg) => {
                        svg.circle(at, radius, colour);
                        Ok(())
                    }
                };
            }
            Marker::Square => around(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
            Marker::Triangle => around(&[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)]),
            Marker::Diamond => around(&[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)]),
        };
        self.polygon(&corners, colour)
    }

    /// Draws a marker, filled or in outline and white inside.
    pub(super) fn point(
        &mut self,
        marker: Marker,
        hollow: bool,
        at: Point,
        radius: f64,
        colour: Rgb,
    ) -> Drawn {
        self.marker(marker, at, radius, colour)?;
        if !hollow {
            return Ok(());
        }
        // Sides that lie aslant are nearer to the middle than corners are.
        let outline = match marker {
            Marker::Circle | Marker::Square => OUTLINE,
            Marker::Triangle => 1.5 * OUTLINE,
            Marker::Diamond => 1.1 * OUTLINE,
        };
        self.marker(marker, at, (radius - outline).max(0.0), WHITE)
    }

    /// Writes a text with letters `size` pixels high.
    pub(super) fn text(&mut self, text: &str, size: f64, at: Point, anchor: Anchor, colour: Rgb) -> Drawn {
        match &mut self.paper {
            Paper::Pixels(pixels) => pixels.text(text, size, at, anchor, colour),
            Paper::Svg(svg) => svg.text(text, size, at, anchor, colour, svg::Stroke::None),
        }
    }

    /// Writes a text with a pale edge, which keeps its letters readable on whatever they lie.
    pub(super) fn label(&mut self, text: &str, size: f64, at: Point, anchor: Anchor, bold: bool) -> Drawn {
        match &mut self.paper {
            Paper::Pixels(pixels) => {
                for n in 0..8 {
                    let (sin, cos) = (f64::from(n) * std::f64::consts::FRAC_PI_4).sin_cos();
                    pixels.text(text, size, (at.0 + EDGE * cos, at.1 + EDGE * sin), anchor, WHITE)?;
                }
                if bold {
                    // There is one font; its letters become bold by their width.
                    for step in [-1, 1, 2] {
                        let aside = f64::from(step) / f64::from(pixels::SCALE);
                        pixels.text(text, size, (at.0 + aside, at.1), anchor, INK)?;
                    }
                }
                pixels.text(text, size, at, anchor, INK)
            }
            Paper::Svg(svg) => {
                // Twice, for not all readers can draw the edge behind the letters of one text.
                svg.text(text, size, at, anchor, WHITE, svg::Stroke::Edge)?;
                svg.text(
                    text,
                    size,
                    at,
                    anchor,
                    INK,
                    if bold { svg::Stroke::Bold } else { svg::Stroke::None },
                )
            }
        }
    }

    /// Width of a text, pixels.
    pub(super) fn text_width(&self, text: &str, size: f64) -> Result<i32, Trouble> {
        pixels::text_width(text, size)
    }

    /// `text`, cut with an ellipsis if it is wider than `width`.
    pub(super) fn shortened(&self, text: &str, size: f64, width: i32) -> Result<String, Trouble> {
        if self.text_width(text, size)? <= width {
            return Ok(text.to_owned());
        }
        let mut letters: Vec<char> = text.chars().collect();
        while letters.pop().is_some() {
            let short = letters.iter().collect::<String>().trim_end().to_owned() + "\u{2026}";
            if self.text_width(&short, size)? <= width {
                return Ok(short);
            }
        }
        Ok(String::new())
    }

    /// Writes the picture to `path`: pixels in the format of its extension, vectors as SVG.
    pub(super) fn save(&self, path: &Path) -> Drawn {
        match &self.paper {
            Paper::Pixels(pixels) => pixels.save(path),
            Paper::Svg(svg) => std::fs::write(path, svg.document()).map_err(Trouble::new),
        }
    }

    /// Width and height of the picture and its pixels, row by row.
    ///
    /// # Errors
    /// On paper of vectors, which has no pixels.
    pub(super) fn pixels(&self) -> Result<((u32, u32), Vec<u8>), Trouble> {
        match &self.paper {
            Paper::Pixels(pixels) => Ok(pixels.pixels()),
            Paper::Svg(_) => Err(Trouble::new("a picture of vectors has no pixels")),
        }
    }
}
