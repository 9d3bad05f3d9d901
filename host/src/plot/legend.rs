//! Legends: in, names and how what they name is drawn; out, rows of entries under a panel's title.

use super::canvas::{Anchor, Area, Canvas, Drawn, Hatch, INK, Marker, Rgb, Trouble};
use super::frame::TICK_LETTERS;

/// Height of a row, width of the drawn part of an entry, and room after an entry, pixels.
const ROW: i32 = 24;
const MARK: i32 = 26;
const GAP: i32 = 22;
/// Width of lines and swatches, and from their left end to their middle.
const SWATCH: i32 = 18;
const MIDDLE: f64 = 9.0;
/// Room for the y axis to the left of the first entry.
const LEFT: i32 = 70;

/// How what an entry names is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sign {
    /// A line, pixels wide.
    Line(Rgb, i32),
    /// A filled or hollow marker, with its radius.
    Marker(Marker, bool, f64, Rgb),
    /// A line with a marker on it.
    LineAndMarker(Marker, bool, f64, Rgb),
    /// A filled rectangle.
    Swatch(Hatch, Rgb),
}

/// An entry.
pub(super) struct Entry<'a> {
    pub(super) name: &'a str,
    pub(super) sign: Sign,
}

/// A legend.
pub(super) struct Legend<'a> {
    rows: Vec<Vec<Entry<'a>>>,
    /// Longest name, pixels.
    longest: i32,
}

impl<'a> Legend<'a> {
    /// The entries that have a name, in as many rows as they need in a panel `width` pixels wide.
    pub(super) fn new(
        canvas: &Canvas,
        entries: impl IntoIterator<Item = Entry<'a>>,
        width: i32,
    ) -> Result<Self, Trouble> {
        let mut rows: Vec<Vec<Entry<'a>>> = Vec::new();
        let room = width - LEFT;
        let mut used = room;
        for entry in entries.into_iter().filter(|e| !e.name.is_empty()) {
            let needed = MARK + canvas.text_width(entry.name, TICK_LETTERS)? + GAP;
            if used + needed > room {
                rows.push(Vec::new());
                used = 0;
            }
            used += needed;
            if let Some(row) = rows.last_mut() {
                row.push(entry);
            }
        }
        Ok(Self { rows, longest: room - MARK })
    }

    /// Height of all rows, pixels.
    pub(super) fn height(&self) -> i32 {
        self.rows.len() as i32 * ROW
    }

    /// Draws it with its upper left corner at `(left, top)`.
    pub(super) fn draw(&self, canvas: &mut Canvas, (left, top): (i32, i32)) -> Drawn {
        for (row, entries) in (0..).zip(&self.rows) {
            let middle = top + row * ROW + ROW / 2 - 2;
            let mut left = left;
            for Entry { name, sign } in entries {
                draw_sign(canvas, sign, (left, middle))?;
                let name = canvas.shortened(name, TICK_LETTERS, self.longest)?;
                let at = (f64::from(left + MARK), f64::from(middle));
                canvas.text(&name, TICK_LETTERS, at, Anchor::Left, INK)?;
                left += MARK + canvas.text_width(&name, TICK_LETTERS)? + GAP;
            }
        }
        Ok(())
    }
}

fn draw_sign(canvas: &mut Canvas, sign: &Sign, (left, middle): (i32, i32)) -> Drawn {
    let (from, row) = (f64::from(left), f64::from(middle));
    let line = [(from, row), (from + f64::from(SWATCH), row)];
    match *sign {
        Sign::Line(colour, width) => canvas.line(&line, colour, width),
        Sign::Marker(marker, hollow, radius, colour) => {
            canvas.point(marker, hollow, (from + MIDDLE, row), radius, colour)
        }
        Sign::LineAndMarker(marker, hollow, radius, colour) => {
            canvas.line(&line, colour, 2)?;
            canvas.point(marker, hollow, (from + MIDDLE, row), radius, colour)
        }
        Sign::Swatch(hatch, frame) => {
            let swatch = Area { left, top: middle - 7, width: SWATCH, height: 14 };
            canvas.hatch(swatch, &hatch);
            canvas.frame(swatch, frame)
        }
    }
}
