//! Series over one axis: in, points with or without intervals; out, a panel of lines, dots or both.

use super::axis::Axis;
use super::canvas::{Area, Canvas, Drawn, FRAME, Hatch, Marker, Point, Rgb, Weave};
use super::colour;
use super::frame::{Frame, MARGIN, Sides};
use super::legend::{Entry, Legend, Sign};

/// From the middle of a dot, of one in the legend, and of one on a line to its edge, pixels.
const DOT: f64 = 2.6;
const LEGEND_DOT: f64 = 5.0;
const LINE_DOT: f64 = 4.6;
/// Half length of the caps of whiskers, pixels.
const CAP: f64 = 4.0;
/// Hatching of marked parts: apart from the grey of the grid, and light when printed.
const MARKED: Hatch =
    Hatch { weave: Weave::Falling, stripe: [236, 176, 120], ground: [252, 236, 218], period: 9, width: 2 };

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Style {
    /// A line from point to point, broken where y is no number; a point alone between breaks is a dot.
    #[default]
    Line,
    /// A dot for each point. For angles, which a line would run across the wrap.
    Dots,
    /// A line with a marker on each point, of another shape for each series, so that they stay apart in grey.
    LineAndDots,
}

/// Points, x and y in the units of the axes, with or without intervals of y.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Points {
    at: Vec<(f64, f64)>,
    /// Of the first points; empty if none has one.
    intervals: Vec<(f64, f64)>,
}

impl Points {
    /// The points.
    pub fn at(&self) -> &[(f64, f64)] {
        &self.at
    }

    /// Lower and upper end of each point's interval of y, which is missing for the last points if there are fewer.
    pub fn intervals(&self) -> &[(f64, f64)] {
        &self.intervals
    }
}

impl From<Vec<(f64, f64)>> for Points {
    fn from(at: Vec<(f64, f64)>) -> Self {
        Self { at, intervals: Vec::new() }
    }
}

impl FromIterator<(f64, f64)> for Points {
    fn from_iter<I: IntoIterator<Item = (f64, f64)>>(points: I) -> Self {
        Vec::from_iter(points).into()
    }
}

/// A series of points.
///
/// ```
/// use rfhoi::plot::{Series, Style};
///
/// let series = Series::new("fusion", vec![(1.0, 71.0), (2.0, 79.0)], Style::LineAndDots)
///     .with_intervals([(66.5, 75.5), (76.0, 82.0)]);
/// # assert_eq!(series.points.intervals().len(), 2);
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Name in the legend; series without one are not in it.
    pub name: String,
    /// The points; what lies outside of the axes is not drawn.
    pub points: Points,
    /// How they are drawn.
    pub style: Style,
}

impl Series {
    /// A series without intervals.
    pub fn new(name: impl Into<String>, points: impl Into<Points>, style: Style) -> Self {
        Self { name: name.into(), points: points.into(), style }
    }

    /// The series with an interval of y, lower and upper end, for each point: a thin whisker in the series' colour. One
    /// that has an end that is no number is not drawn.
    pub fn with_intervals(mut self, intervals: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.points.intervals = intervals.into_iter().take(self.points.at.len()).collect();
        self
    }
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

impl Lines {
    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area, sides: Sides) -> Drawn {
        let area = area.inside(if sides.y { MARGIN } else { 0 }, MARGIN, MARGIN, MARGIN / 2);
        let series =
            self.series.iter().enumerate().map(|(n, s)| Entry { name: &s.name, sign: sign(n, s.style) });
        let marked = self.marks.iter().map(|m| Entry { name: &m.label, sign: Sign::Swatch(MARKED, FRAME) });
        let legend = Legend::new(canvas, series.chain(marked), area.width)?;
        let frame = Frame::under(canvas, area, &legend, (&self.x, &self.y), sides)?;
        frame.draw_head(canvas, area, &self.title, &legend)?;
        self.draw_marks(canvas, &frame);
        frame.draw_grid(canvas)?;
        for (number, series) in self.series.iter().enumerate() {
            let (colour, points) = (colour::of_series(number), series.points.at());
            draw_intervals(canvas, &frame, &series.points, colour)?;
            let marker = Marker::of_series(number);
            match series.style {
                Style::Line => draw_line(canvas, &frame, points, colour)?,
                Style::Dots => draw_dots(canvas, &frame, points, (marker, false, DOT), colour)?,
                Style::LineAndDots => {
                    draw_line(canvas, &frame, points, colour)?;
                    draw_dots(canvas, &frame, points, (marker, hollow(number), LINE_DOT), colour)?;
                }
            }
        }
        frame.draw(canvas)
    }

    fn draw_marks(&self, canvas: &mut Canvas, frame: &Frame) {
        let plot = frame.plot;
        let edge = |value: f64| (frame.column(value).round() as i32).clamp(plot.left, plot.right());
        for &(from, to) in self.marks.iter().flat_map(|m| &m.spans) {
            let (left, right) = (edge(from.min(to)), edge(from.max(to)));
            if right - left < MARKED.period {
                canvas.fill(Area { left, width: (right - left).max(1), ..plot }, MARKED.stripe);
            } else {
                canvas.hatch(Area { left, width: right - left, ..plot }, &MARKED);
            }
        }
    }
}

/// Whether the markers on a series' line are hollow: where their shapes begin again.
fn hollow(number: usize) -> bool {
    number / Marker::COUNT % 2 == 1
}

fn sign(number: usize, style: Style) -> Sign {
    let (marker, colour) = (Marker::of_series(number), colour::of_series(number));
    match style {
        Style::Line => Sign::Line(colour, 2),
        Style::Dots => Sign::Marker(marker, false, LEGEND_DOT, colour),
        Style::LineAndDots => Sign::LineAndMarker(marker, hollow(number), LINE_DOT, colour),
    }
}

fn draw_intervals(canvas: &mut Canvas, frame: &Frame, points: &Points, colour: Rgb) -> Drawn {
    for (&(x, _), &interval) in points.at.iter().zip(&points.intervals) {
        if (0.0..=1.0).contains(&frame.x.place(x)) {
            frame.draw_whisker(canvas, frame.column(x), interval, (CAP, colour))?;
        }
    }
    Ok(())
}

fn draw_dots(
    canvas: &mut Canvas,
    frame: &Frame,
    points: &[Point],
    (marker, hollow, radius): (Marker, bool, f64),
    colour: Rgb,
) -> Drawn {
    for &(x, y) in points.iter().filter(|p| frame.holds(**p)) {
        canvas.point(marker, hollow, (frame.column(x), frame.row(y)), radius, colour)?;
    }
    Ok(())
}

fn draw_line(canvas: &mut Canvas, frame: &Frame, points: &[Point], colour: Rgb) -> Drawn {
    let known = |n: Option<usize>| n.and_then(|n| points.get(n)).is_some_and(|p| p.1.is_finite());
    let alone = |n: usize| known(Some(n)) && !known(n.checked_sub(1)) && !known(Some(n + 1));
    let dots: Vec<Point> = (0..points.len()).filter(|&n| alone(n)).map(|n| points[n]).collect();
    draw_dots(canvas, frame, &dots, (Marker::Circle, false, DOT), colour)?;
    for pair in points.windows(2) {
        let places = [pair[0], pair[1]].map(|(x, y)| (frame.x.place(x), frame.y.place(y)));
        if let Some(places) = clipped(places) {
            canvas.line(&places.map(|p| frame.pixel(p)), colour, 2)?;
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
