//! Series over one axis, as lines or as dots.

use super::axis::{Axis, Frame, MARGIN, Sides, TICK_LETTERS, TITLE_LETTERS, draw_title};
use super::canvas::{Anchor, Area, Canvas, Drawn, FRAME, INK, Marker, Point, Rgb, Trouble};
use super::colour;

/// Height of a row of the legend, and of its markers' part of an entry.
const LEGEND_ROW: i32 = 24;
const LEGEND_MARK: i32 = 26;
const LEGEND_GAP: i32 = 22;
/// From the middle of a dot to its edge.
const DOT: f64 = 2.6;
/// Hatching of marked parts: its period in pixels, its stripes and what is between them. Apart from the grey of the grid,
/// and light when printed.
const HATCH: i32 = 9;
const STRIPE: Rgb = [236, 176, 120];
const PALE: Rgb = [252, 236, 218];
/// Markers of series in turn, so that they stay apart without colour.
const MARKERS: [Marker; 4] = [Marker::Circle, Marker::Square, Marker::Triangle, Marker::Diamond];

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Style {
    /// A line from point to point, broken where y is no number; a point alone between breaks is a dot.
    #[default]
    Line,
    /// A dot for each point. For angles, which a line would run across the wrap.
    Dots,
}

/// A series of points.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend; series without one are not in it.
    pub name: String,
    /// The points, x and y in the units of the axes; what lies outside of them is not drawn.
    pub points: Vec<(f64, f64)>,
    /// How they are drawn.
    pub style: Style,
}

/// Parts of the x axis that are marked, for example where no value is valid.
#[derive(Debug, Clone, PartialEq)]
pub struct Marks {
    /// What is marked, for the legend.
    pub label: String,
    /// From where to where.
    pub spans: Vec<(f64, f64)>,
}

/// Series over one axis.
#[derive(Debug, Clone)]
pub struct Lines {
    /// Title of the panel.
    pub title: String,
    /// The axis over which the series run.
    pub x: Axis,
    /// The axis of their values.
    pub y: Axis,
    /// The series.
    pub series: Vec<Series>,
    /// Marked parts of the x axis.
    pub marks: Option<Marks>,
}

/// An entry of the legend.
struct Entry<'a> {
    name: &'a str,
    /// Number of the series, or the marks.
    series: Option<usize>,
}

impl Lines {
    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area, sides: Sides) -> Drawn {
        let area = area.inside(if sides.y { MARGIN } else { 0 }, MARGIN, MARGIN, MARGIN / 2);
        let rows = self.legend_rows(canvas, area.width)?;
        let title = TITLE_LETTERS as i32 + 8;
        let legend = rows.len() as i32 * LEGEND_ROW;
        let frame = Frame::new(canvas, area.inside(0, title + legend + 4, 0, 0), (&self.x, &self.y), sides)?;
        draw_title(canvas, &self.title, area, frame.plot)?;
        for (row, entries) in (0..).zip(&rows) {
            let middle = area.top + title + row * LEGEND_ROW + LEGEND_ROW / 2 - 2;
            self.draw_legend(canvas, entries, (frame.plot.left, middle))?;
        }
        self.draw_marks(canvas, &frame);
        frame.draw_grid(canvas)?;
        for (number, series) in self.series.iter().enumerate() {
            let colour = colour::of_series(number);
            match series.style {
                Style::Line => draw_line(canvas, &frame, &series.points, colour)?,
                Style::Dots => draw_dots(canvas, &frame, &series.points, marker(number), colour)?,
            }
        }
        frame.draw(canvas)
    }

    /// The legend's entries, in as many rows as they need.
    fn legend_rows(&self, canvas: &Canvas, width: i32) -> Result<Vec<Vec<Entry<'_>>>, Trouble> {
        let series = self.series.iter().enumerate();
        let named =
            series.filter(|(_, s)| !s.name.is_empty()).map(|(n, s)| Entry { name: &s.name, series: Some(n) });
        let marked = self.marks.iter().map(|m| Entry { name: &m.label, series: None });
        let mut rows: Vec<Vec<Entry<'_>>> = Vec::new();
        // Room for the y axis to the left of the first entry.
        let room = width - 70;
        let mut used = room;
        for entry in named.chain(marked) {
            let needed = LEGEND_MARK + canvas.text_width(entry.name, TICK_LETTERS)? + LEGEND_GAP;
            if used + needed > room {
                rows.push(Vec::new());
                used = 0;
            }
            used += needed;
            if let Some(row) = rows.last_mut() {
                row.push(entry);
            }
        }
        Ok(rows)
    }

    fn draw_legend(
        &self,
        canvas: &mut Canvas,
        entries: &[Entry<'_>],
        (mut left, middle): (i32, i32),
    ) -> Drawn {
        for Entry { name, series } in entries {
            let (from, row) = (f64::from(left), f64::from(middle));
            match series {
                Some(number) => {
                    let colour = colour::of_series(*number);
                    match self.series[*number].style {
                        Style::Line => canvas.line(&[(from, row), (from + 18.0, row)], colour, 2)?,
                        Style::Dots => canvas.marker(marker(*number), (from + 9.0, row), 5.0, colour)?,
                    }
                }
                None => {
                    let swatch = Area { left, top: middle - 7, width: 18, height: 14 };
                    canvas.paint(swatch, marked);
                    canvas.frame(swatch, FRAME)?;
                }
            }
            canvas.text(name, TICK_LETTERS, (from + f64::from(LEGEND_MARK), row), Anchor::Left, INK)?;
            left += LEGEND_MARK + canvas.text_width(name, TICK_LETTERS)? + LEGEND_GAP;
        }
        Ok(())
    }

    fn draw_marks(&self, canvas: &mut Canvas, frame: &Frame) {
        let plot = frame.plot;
        let edge = |value: f64| (frame.column(value).round() as i32).clamp(plot.left, plot.right());
        for &(from, to) in self.marks.iter().flat_map(|m| &m.spans) {
            let (left, right) = (edge(from.min(to)), edge(from.max(to)));
            if right - left < HATCH {
                canvas.fill(Area { left, width: (right - left).max(1), ..plot }, STRIPE);
            } else {
                canvas.paint(Area { left, width: right - left, ..plot }, marked);
            }
        }
    }
}

fn marker(number: usize) -> Marker {
    MARKERS[number % MARKERS.len()]
}

/// Colour of a marked part's pixel.
fn marked(x: i32, y: i32) -> Rgb {
    if (x - y).rem_euclid(HATCH) < 2 { STRIPE } else { PALE }
}

fn draw_dots(canvas: &mut Canvas, frame: &Frame, points: &[Point], marker: Marker, colour: Rgb) -> Drawn {
    let inside = 0.0..=1.0;
    for &(x, y) in points {
        if inside.contains(&frame.x.place(x)) && inside.contains(&frame.y.place(y)) {
            canvas.marker(marker, (frame.column(x), frame.row(y)), DOT, colour)?;
        }
    }
    Ok(())
}

fn draw_line(canvas: &mut Canvas, frame: &Frame, points: &[Point], colour: Rgb) -> Drawn {
    let known = |n: Option<usize>| n.and_then(|n| points.get(n)).is_some_and(|p| p.1.is_finite());
    let alone = |n: usize| known(Some(n)) && !known(n.checked_sub(1)) && !known(Some(n + 1));
    let dots: Vec<Point> = (0..points.len()).filter(|&n| alone(n)).map(|n| points[n]).collect();
    draw_dots(canvas, frame, &dots, Marker::Circle, colour)?;
    for pair in points.windows(2) {
        let places = [pair[0], pair[1]].map(|(x, y)| (frame.x.place(x), frame.y.place(y)));
        if let Some(places) = clipped(places) {
            let at = |(x, y): Point| {
                let plot = frame.plot;
                (
                    f64::from(plot.left) + x * f64::from(plot.width),
                    f64::from(plot.bottom()) - y * f64::from(plot.height),
                )
            };
            canvas.line(&[at(places[0]), at(places[1])], colour, 2)?;
        }
    }
    Ok(())
}

/// The part of a segment that lies in the unit square (Liang and Barsky, 1984); `None` if none does or an end is no
/// number.
pub(super) fn clipped([(x0, y0), (x1, y1)]: [Point; 2]) -> Option<[Point; 2]> {
    let (dx, dy) = (x1 - x0, y1 - y0);
    if !(dx.is_finite() && dy.is_finite()) {
        return None;
    }
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (towards, distance) in [(-dx, x0), (dx, 1.0 - x0), (-dy, y0), (dy, 1.0 - y0)] {
        if towards == 0.0 {
            if distance < 0.0 {
                return None;
            }
        } else if towards < 0.0 {
            enter = enter.max(distance / towards);
        } else {
            leave = leave.min(distance / towards);
        }
    }
    (enter <= leave).then(|| [enter, leave].map(|t| (x0 + t * dx, y0 + t * dy)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_are_clipped_to_the_frame() {
        let close = |clipped: Option<[Point; 2]>, expected: [Point; 2]| {
            let clipped = clipped.unwrap();
            for (a, b) in clipped.iter().zip(expected) {
                assert!((a.0 - b.0).abs() < 1e-12 && (a.1 - b.1).abs() < 1e-12, "{clipped:?}");
            }
        };
        close(clipped([(0.2, 0.3), (0.8, 0.9)]), [(0.2, 0.3), (0.8, 0.9)]);
        close(clipped([(-1.0, 0.5), (2.0, 0.5)]), [(0.0, 0.5), (1.0, 0.5)]);
        close(clipped([(0.5, -0.5), (0.5, 0.5)]), [(0.5, 0.0), (0.5, 0.5)]);
        assert_eq!(clipped([(-1.0, 1.5), (2.0, 1.5)]), None);
        assert_eq!(clipped([(-1.0, 0.5), (0.5, 2.5)]), None);
        assert_eq!(clipped([(0.0, f64::NAN), (1.0, 0.0)]), None);
    }
}
