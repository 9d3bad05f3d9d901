//! Paper of vectors: in, lines, polygons, circles, rectangles and text; out, an SVG 1.1 document.
//!
//! Text stays text. The reader's font is not the one that the picture was laid out with, so that each text carries its
//! length and is fitted to it. The same picture has the same bytes.

use std::fmt::Write as _;

use super::{Anchor, Area, Drawn, EDGE, Hatch, Point, Rgb, Weave, pixels};

/// Where the letters' base line lies under the middle of a text, of the height of its letters; as on paper of pixels.
const BASE: f64 = 0.217;
/// Size of the font for letters of height one: its em square is lower than its line.
const EM: f64 = 0.89;
/// Fonts like that of the pictures, the nearest first.
const FONTS: &str = "Ubuntu, 'Open Sans', 'DejaVu Sans', Verdana, sans-serif";
/// Bold letters are wider, of the usual width.
const BOLD: f64 = 1.06;
/// Parts of a ramp of colours; that of values has as many stops.
const STOPS: u8 = 10;
/// Beyond this, coordinates are cut, pixels.
const FARTHEST: f64 = 1e5;

/// How the outlines of letters are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stroke {
    /// Not at all.
    None,
    /// Wide, in the letters' colour.
    Edge,
    /// Not at all, but the letters are bold.
    Bold,
}

/// A line that may go on.
struct Open {
    points: Vec<Point>,
    colour: Rgb,
    width: i32,
}

/// White paper that becomes vectors.
pub(super) struct Svg {
    width: i32,
    height: i32,
    /// Elements.
    body: String,
    /// The last line, not yet in `body`: lines that meet end to end are one element.
    open: Option<Open>,
    hatches: Vec<Hatch>,
    ramps: usize,
}

impl Svg {
    pub(super) fn new(width: i32, height: i32) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        Self { width, height, body: String::new(), open: None, hatches: Vec::new(), ramps: 0 }
    }

    pub(super) fn fill(&mut self, area: Area, colour: Rgb) {
        self.rectangle(area, &hex(colour));
    }

    pub(super) fn hatch(&mut self, area: Area, hatch: &Hatch) {
        self.rectangle(area, &hex(hatch.ground));
        if hatch.weave == Weave::Plain {
            return;
        }
        let known = self.hatches.iter().position(|h| h == hatch);
        let number = known.unwrap_or_else(|| {
            self.hatches.push(*hatch);
            let number = self.hatches.len() - 1;
            let pattern = pattern(number, hatch);
            self.put(&pattern);
            number
        });
        self.rectangle(area, &format!("url(#hatch{number})"));
    }

    /// Colours that run upwards.
    pub(super) fn ramp(&mut self, area: Area, colour: fn(f64) -> Rgb) {
        let mut gradient =
            format!("<linearGradient id=\"ramp{}\" x1=\"0\" y1=\"1\" x2=\"0\" y2=\"0\">", self.ramps);
        for stop in 0..=STOPS {
            let at = f64::from(stop) / f64::from(STOPS);
            let _ = write!(gradient, "<stop offset=\"{at}\" stop-color=\"{}\"/>", hex(colour(at)));
        }
        self.put(&(gradient + "</linearGradient>"));
        let paint = format!("url(#ramp{})", self.ramps);
        self.ramps += 1;
        self.rectangle(area, &paint);
    }

    pub(super) fn line(&mut self, points: &[Point], colour: Rgb, width: i32) {
        if points.len() < 2 || !all_finite(points) {
            return;
        }
        match &mut self.open {
            Some(open)
                if (open.colour, open.width) == (colour, width) && open.points.last() == points.first() =>
            {
                open.points.extend(&points[1..]);
            }
            _ => {
                self.close();
                self.open = Some(Open { points: points.to_vec(), colour, width });
            }
        }
    }

    pub(super) fn polygon(&mut self, corners: &[Point], colour: Rgb) {
        if corners.len() > 2 && all_finite(corners) {
            self.put(&format!("<path d=\"{}z\" fill=\"{}\"/>", path(corners), hex(colour)));
        }
    }

    pub(super) fn circle(&mut self, at: Point, radius: f64, colour: Rgb) {
        if all_finite(&[at]) && radius > 0.0 {
            let (x, y, r) = (number(at.0), number(at.1), number(radius));
            self.put(&format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"{}\"/>", hex(colour)));
        }
    }

    pub(super) fn text(
        &mut self,
        text: &str,
        size: f64,
        at: Point,
        anchor: Anchor,
        colour: Rgb,
        stroke: Stroke,
    ) -> Drawn {
        if text.trim().is_empty() || !all_finite(&[at]) {
            return Ok(());
        }
        let position = match anchor {
            Anchor::Left => "start",
            Anchor::Right => "end",
            Anchor::Middle | Anchor::MiddleUpwards => "middle",
        };
        let upwards = anchor == Anchor::MiddleUpwards;
        let below = BASE * size;
        let (x, y) = if upwards { (at.0 + below, at.1) } else { (at.0, at.1 + below) };
        let (x, y) = (number(x), number(y));
        let wider = if stroke == Stroke::Bold { BOLD } else { 1.0 };
        let length = f64::from(pixels::text_width(text, size)?) * wider;
        let turned = if upwards { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
        let colour = hex(colour);
        let more = match stroke {
            Stroke::None => String::new(),
            Stroke::Edge => {
                let width = number(2.0 * EDGE);
                format!(" stroke=\"{colour}\" stroke-width=\"{width}\"")
            }
            Stroke::Bold => " font-weight=\"bold\"".to_owned(),
        };
        self.put(&format!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" text-anchor=\"{position}\" textLength=\"{}\" \
             lengthAdjust=\"spacingAndGlyphs\" fill=\"{colour}\"{more}{turned}>{}</text>",
            number(size * EM),
            number(length),
            escaped(text),
        ));
        Ok(())
    }

    /// The document.
    pub(super) fn document(&self) -> String {
        let (width, height) = (self.width, self.height);
        let last = self.open.as_ref().map(element).unwrap_or_default();
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" fill=\"none\" stroke-linejoin=\"round\" font-family=\"{FONTS}\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n{}{last}</svg>\n",
            self.body
        )
    }

    fn rectangle(&mut self, area: Area, fill: &str) {
        let Area { left, top, width, height } = area;
        if width > 0 && height > 0 {
            self.put(&format!(
                "<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"{fill}\"/>"
            ));
        }
    }

    /// Adds an element above all others.
    fn put(&mut self, element: &str) {
        self.close();
        self.body.push_str(element);
        self.body.push('\n');
    }

    fn close(&mut self) {
        if let Some(open) = self.open.take() {
            self.body.push_str(&element(&open));
        }
    }
}

fn element(Open { points, colour, width }: &Open) -> String {
    let wide = if *width == 1 { String::new() } else { format!(" stroke-width=\"{width}\"") };
    format!("<path d=\"{}\" stroke=\"{}\"{wide}/>\n", path(points), hex(*colour))
}

/// Stripes as a pattern; aslant ones are upright ones turned.
fn pattern(id: usize, hatch: &Hatch) -> String {
    let turn: i32 = match hatch.weave {
        Weave::Rising | Weave::Crossed => 45,
        Weave::Falling => -45,
        Weave::Level => 90,
        Weave::Plain | Weave::Upright => 0,
    };
    let aslant = if turn.abs() == 45 { std::f64::consts::FRAC_1_SQRT_2 } else { 1.0 };
    let (period, width) = (number(f64::from(hatch.period) * aslant), number(f64::from(hatch.width) * aslant));
    let across = match hatch.weave {
        Weave::Crossed => format!("M0 0h{period}v{width}h-{period}z"),
        _ => String::new(),
    };
    format!(
        "<pattern id=\"hatch{id}\" patternUnits=\"userSpaceOnUse\" width=\"{period}\" height=\"{period}\" \
         patternTransform=\"rotate({turn})\"><path d=\"M0 0h{width}v{period}h-{width}z{across}\" fill=\"{}\"/></pattern>",
        hex(hatch.stripe)
    )
}

fn path(points: &[Point]) -> String {
    let mut path = String::new();
    for (n, &(x, y)) in points.iter().enumerate() {
        let command = if n == 0 { 'M' } else { 'L' };
        let _ = write!(path, "{command}{} {}", number(x), number(y));
    }
    path
}

fn all_finite(points: &[Point]) -> bool {
    points.iter().all(|(x, y)| x.is_finite() && y.is_finite())
}

/// A coordinate to a hundredth of a pixel.
fn number(value: f64) -> String {
    // Adding zero makes "-0" a "0".
    let hundredths = (value.clamp(-FARTHEST, FARTHEST) * 100.0).round() + 0.0;
    (hundredths / 100.0).to_string()
}

fn hex([red, green, blue]: Rgb) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// A text with what XML 1.0 (sections 2.2 and 2.4) does not allow in text and attributes written otherwise.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&apos;"),
            '\t' | '\n' | '\r' => escaped.push(' '),
            '\0'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            _ => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_meet_are_one_element() {
        let mut svg = Svg::new(10, 10);
        svg.line(&[(0.0, 0.0), (1.0, 1.0)], [0; 3], 1);
        svg.line(&[(1.0, 1.0), (2.0, 0.125)], [0; 3], 1);
        svg.line(&[(2.0, 0.125), (3.0, 0.0)], [0; 3], 2);
        svg.line(&[(0.0, f64::NAN), (3.0, 0.0)], [0; 3], 2);
        let document = svg.document();
        assert_eq!(document.matches("<path").count(), 2, "{document}");
        assert!(document.contains("d=\"M0 0L1 1L2 0.13\" stroke=\"#000000\"/>"), "{document}");
        assert!(document.contains("stroke-width=\"2\""), "{document}");
    }

    #[test]
    fn text_of_any_letters_is_text() {
        assert_eq!(
            escaped("a<b & \"c\">'\u{1}\n\u{e9}"),
            "a&lt;b &amp; &quot;c&quot;&gt;&apos;\u{fffd} \u{e9}"
        );
    }

    #[test]
    fn coordinates_are_short() {
        let written = [1.0, -0.001, 2.5, 1.0 / 3.0, 1e300].map(number);
        assert_eq!(written, ["1", "0", "2.5", "0.33", "100000"]);
    }
}
