//! Points of a trade, as speed against accuracy: in, points with intervals and labels, in series; out, a panel in which
//! each series has its marker, with the Pareto front as a step line.

use super::axis::Axis;
use super::canvas::{Area, Canvas, Drawn, EDGE, FRAME, INK, Marker, Point};
use super::colour;
use super::frame::{Frame, MARGIN, Sides, TICK_LETTERS};
use super::front::Front;
use super::labels::Labels;
use super::legend::{Entry, Legend, Sign};
use super::lines::clipped;

/// From the middle of a marker, and of the ring around the default, to its edge, pixels.
const RADIUS: f64 = 6.0;
const RING: f64 = 11.5;
/// Half length of the caps of whiskers, pixels.
const CAP: f64 = 4.0;
/// Width of the front's line, pixels.
const FRONT: i32 = 2;
/// Name of the default's ring in the legend.
const DEFAULT: &str = "default";

/// A point of a scatter.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ScatterPoint {
    /// x and y in the units of the axes; what lies outside of them is not drawn.
    pub at: (f64, f64),
    /// Lower and upper end of an interval of y: a whisker.
    pub interval: Option<(f64, f64)>,
    /// What is written beside it, if there is room; may be empty.
    pub label: String,
    /// Whether it is what is taken if nothing else is asked for: it has a ring and a bold label.
    pub default: bool,
}

impl ScatterPoint {
    /// A point with a label.
    pub fn new(at: (f64, f64), label: impl Into<String>) -> Self {
        Self { at, label: label.into(), ..Self::default() }
    }

    /// The point with an interval of y.
    pub fn with_interval(self, low: f64, high: f64) -> Self {
        Self { interval: Some((low, high)), ..self }
    }

    /// The point as the default.
    pub fn as_default(self) -> Self {
        Self { default: true, ..self }
    }
}

/// Points with one marker.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ScatterSeries {
    /// Name in the legend; series without one are not in it.
    pub name: String,
    /// Shape of the marker, for example that of a backend.
    pub marker: Marker,
    /// Whether the marker is an outline, for example for a precision.
    pub hollow: bool,
    /// The points.
    pub points: Vec<ScatterPoint>,
}

/// Points over two axes.
///
/// ```
/// use rfhoi::plot::{Axis, Better, Figure, Front, Marker, Panel, Scatter, ScatterPoint, ScatterSeries};
///
/// let float = vec![
///     ScatterPoint::new((13.0, 91.9), "base").with_interval(90.7, 92.9),
///     ScatterPoint::new((40.0, 93.4), "wide"),
/// ];
/// let int8 = vec![ScatterPoint::new((3.4, 91.2), "base").with_interval(90.0, 92.3).as_default()];
/// let all: Vec<_> = float.iter().chain(&int8).map(|p| p.at).collect();
/// let scatter = Scatter {
///     title: "Speed against accuracy".into(),
///     x: Axis::logarithmic_around("time for a window", "ms", all.iter().map(|at| at.0)),
///     y: Axis::new("macro F1", "%", 85.0, 100.0),
///     series: vec![
///         ScatterSeries { name: "float".into(), marker: Marker::Square, hollow: true, points: float },
///         ScatterSeries { name: "8-bit".into(), marker: Marker::Square, hollow: false, points: int8 },
///     ],
///     front: Some(Front::of("Pareto front", all, Better::Larger)),
/// };
/// let figure = Figure::new(vec![Panel::Scatter(scatter)]);
/// # let directory = tempfile::tempdir().unwrap();
/// # figure.save(directory.path().join("scatter.svg"))?;
/// # Ok::<(), rfhoi::plot::PlotError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Scatter {
    /// Title of the panel.
    pub title: String,
    /// Axis to the right, often [logarithmic](Axis::logarithmic_around).
    pub x: Axis,
    /// Axis upwards.
    pub y: Axis,
    /// The points, by marker.
    pub series: Vec<ScatterSeries>,
    /// The best points.
    pub front: Option<Front>,
}

impl Scatter {
    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area, sides: Sides) -> Drawn {
        let area = area.inside(if sides.y { MARGIN } else { 0 }, MARGIN, MARGIN, MARGIN / 2);
        let legend = Legend::new(canvas, self.entries(), area.width)?;
        let frame = Frame::under(canvas, area, &legend, (&self.x, &self.y), sides)?;
        frame.draw_head(canvas, area, &self.title, &legend)?;
        frame.draw_grid(canvas)?;
        let mut labels = Labels::new(frame.plot);
        self.draw_front(canvas, &frame, &mut labels)?;
        self.draw_points(canvas, &frame, &mut labels)?;
        self.draw_labels(canvas, &frame, &mut labels)?;
        frame.draw_small_ticks(canvas)?;
        frame.draw(canvas)
    }

    fn entries(&self) -> impl Iterator<Item = Entry<'_>> {
        let series = self.series.iter().enumerate().map(|(n, s)| Entry {
            name: &s.name,
            sign: Sign::Marker(s.marker, s.hollow, RADIUS, colour::of_series(n)),
        });
        let front = self.front.iter().map(|f| Entry { name: &f.name, sign: Sign::Line(FRAME, FRONT) });
        let marked = self.series.iter().flat_map(|s| &s.points).any(|p| p.default);
        let ring = Entry { name: DEFAULT, sign: Sign::Marker(Marker::Circle, true, RADIUS + 3.0, INK) };
        series.chain(front).chain(marked.then_some(ring))
    }

    fn draw_front(&self, canvas: &mut Canvas, frame: &Frame, labels: &mut Labels) -> Drawn {
        let end = frame.x.from.max(frame.x.to);
        for step in self.front.iter().flat_map(|f| f.steps(end)) {
            let places = step.map(|(x, y)| (frame.x.place(x), frame.y.place(y)));
            if let Some(places) = clipped(places) {
                let ends = places.map(|p| frame.pixel(p));
                canvas.line(&ends, FRAME, FRONT)?;
                labels.add_line(ends[0], ends[1]);
            }
        }
        Ok(())
    }

    /// Points that are inside, with the number of their series.
    fn inside<'a>(&'a self, frame: &'a Frame) -> impl Iterator<Item = (usize, Point, &'a ScatterPoint)> + 'a {
        self.series.iter().enumerate().flat_map(move |(number, series)| {
            let inside = series.points.iter().filter(|p| frame.holds(p.at));
            inside.map(move |p| (number, (frame.column(p.at.0), frame.row(p.at.1)), p))
        })
    }

    fn draw_points(&self, canvas: &mut Canvas, frame: &Frame, labels: &mut Labels) -> Drawn {
        // First, for a ring's white inside must not cover whiskers and other points.
        for (_, at, _) in self.inside(frame).filter(|(_, _, p)| p.default) {
            canvas.point(Marker::Circle, true, at, RING, INK)?;
        }
        for (number, at, point) in self.inside(frame) {
            let Some(interval) = point.interval else { continue };
            frame.draw_whisker(canvas, at.0, interval, (CAP, colour::of_series(number)))?;
            if let Some([(top, _), (bottom, _)]) = frame.rows_of(interval) {
                labels.add_line((at.0, top), (at.0, bottom));
            }
        }
        for (number, at, point) in self.inside(frame) {
            let series = &self.series[number];
            canvas.point(series.marker, series.hollow, at, RADIUS, colour::of_series(number))?;
            labels.add_marker(at, radius(point));
        }
        Ok(())
    }

    /// Writes labels where there is room, that of the default first.
    fn draw_labels(&self, canvas: &mut Canvas, frame: &Frame, labels: &mut Labels) -> Drawn {
        let mut points: Vec<_> = self.inside(frame).filter(|(_, _, p)| !p.label.is_empty()).collect();
        points.sort_by_key(|(_, _, p)| !p.default);
        for (_, at, point) in points {
            let width = canvas.text_width(&point.label, TICK_LETTERS)?;
            let size = (f64::from(width) + 2.0 * EDGE, TICK_LETTERS);
            let Some(place) = labels.place(at, radius(point), size) else { continue };
            if place.far {
                let (x, y) = (place.at.0 - at.0, place.at.1 - at.1);
                let part = radius(point) / x.hypot(y);
                canvas.line(&[(at.0 + part * x, at.1 + part * y), place.at], FRAME, 1)?;
            }
            canvas.label(&point.label, TICK_LETTERS, place.at, place.anchor, point.default)?;
        }
        Ok(())
    }
}

fn radius(point: &ScatterPoint) -> f64 {
    if point.default { RING } else { RADIUS }
}
