//! A view of a scene: polygons, lines and named markers over two axes of the same scale.

use super::axis::Axis;
use super::bar::{Bar, ColourScale};
use super::canvas::{Anchor, Area, Canvas, Drawn, EDGE, Marker, Point, Rgb, WHITE};
use super::colour;
use super::frame::{Frame, Sides, TICK_LETTERS, draw_title, title_room};
use super::lines::clipped;

/// Height of the letters of names, pixels.
const NAME_LETTERS: f64 = TICK_LETTERS;
/// From a marker to its name, pixels, in the order in which places are tried.
const NAME_AT: [f64; 4] = [12.0, 26.0, 44.0, 66.0];
/// A name farther than this from its marker is joined to it by a line, pixels.
const NEAR: f64 = 14.0;

/// A colour by what it means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Paint {
    /// A grey, 0 black to 255 white.
    Grey(u8),
    /// That of a series.
    Series(usize),
    /// That of a level on the view's scale.
    Level(f32),
}

/// What is drawn, in the units of the axes.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A filled convex polygon.
    Polygon {
        /// Its corners.
        corners: Vec<(f64, f64)>,
        /// Its colour.
        paint: Paint,
    },
    /// A line from point to point.
    Line {
        /// The points.
        points: Vec<(f64, f64)>,
        /// Its colour.
        paint: Paint,
        /// Its width, pixels.
        width: i32,
    },
    /// A marker.
    Mark {
        /// Where it is.
        at: (f64, f64),
        /// From its middle to its edge, pixels.
        radius: f64,
        /// A square instead of a circle.
        square: bool,
        /// Its colour.
        paint: Paint,
        /// What is written beside it; may be empty.
        name: String,
    },
}

/// A view.
#[derive(Debug, Clone)]
pub struct View {
    /// Title of the panel.
    pub title: String,
    /// Axis to the right. It is lengthened on both sides so that a unit is as long on both axes.
    pub x: Axis,
    /// Axis upwards; as `x`.
    pub y: Axis,
    /// What is drawn, the first farthest from the eye.
    pub shapes: Vec<Shape>,
    /// What [`Paint::Level`] means, with its range.
    pub scale: Option<ColourScale>,
}

impl View {
    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area, sides: Sides) -> Drawn {
        let area = sides.inside(area);
        let title = title_room(&self.title);
        let scale = self.scale.as_ref().map(|s| s.axis(std::iter::empty()));
        let bar = match &scale {
            Some(scale) if sides.bar => Some(Bar::new(canvas, scale.clone(), area.height - title)?),
            _ => None,
        };
        let room = bar.as_ref().map_or(0, Bar::width);
        let inner = area.inside(0, title, room, 0);
        // Labels take their room first; then the axes fill what is left.
        let plot = Frame::new(canvas, inner, (&self.x, &self.y), sides)?.plot;
        let (x, y) = same_scale(&self.x.sound(), &self.y.sound(), plot);
        let frame = Frame::new(canvas, inner, (&x, &y), sides)?;
        draw_title(canvas, &self.title, area, frame.plot)?;
        canvas.fill(frame.plot, WHITE);
        frame.draw_grid(canvas)?;
        let colour = |paint: Paint| match paint {
            Paint::Grey(level) => [level; 3],
            Paint::Series(number) => colour::of_series(number),
            Paint::Level(level) => colour::of_level(scale.as_ref().map_or(1.0, |s| s.place(level.into()))),
        };
        for shape in &self.shapes {
            draw_shape(canvas, &frame, shape, colour)?;
        }
        self.draw_names(canvas, &frame)?;
        frame.draw(canvas)?;
        bar.map_or(Ok(()), |bar| bar.draw(canvas, area, frame.plot, colour::of_level))
    }

    /// Writes the names of markers where they cover neither each other nor other markers.
    fn draw_names(&self, canvas: &mut Canvas, frame: &Frame) -> Drawn {
        let marks: Vec<(Point, f64, &str)> = self
            .shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Mark { at, radius, name, .. } if frame.holds(*at) => {
                    Some(((frame.column(at.0), frame.row(at.1)), *radius, name.as_str()))
                }
                _ => None,
            })
            .collect();
        let mut taken: Vec<Area> =
            marks.iter().map(|&((x, y), r, _)| Area::around((x - r, y - r), (2.0 * r, 2.0 * r))).collect();
        for (at, radius, name) in marks.iter().filter(|m| !m.2.is_empty()) {
            let size = (f64::from(canvas.text_width(name, NAME_LETTERS)?) + 2.0 * EDGE, NAME_LETTERS + 2.0);
            let plot = frame.plot.inside(2, 2, 2, 2);
            let places = NAME_AT.into_iter().flat_map(|far| {
                // To the right, to the left, and above and below of both.
                [
                    (1.0, 0.0),
                    (-1.0, 0.0),
                    (0.8, -0.8),
                    (0.8, 0.8),
                    (-0.8, -0.8),
                    (-0.8, 0.8),
                    (0.1, -1.0),
                    (0.1, 1.0),
                ]
                .map(|(x, y)| (at.0 + x * (far + radius - 5.0), at.1 + y * (far + radius - 5.0), x < 0.0))
            });
            let area = |&(x, y, left): &(f64, f64, bool)| {
                Area::around((if left { x - size.0 } else { x }, y - size.1 / 2.0), size)
            };
            let free = |place: &(f64, f64, bool)| {
                let area = area(place);
                plot.contains(area) && !taken.iter().any(|&other| area.overlaps(other))
            };
            // A crowd may leave no room; then the first place is as good as any.
            let all: Vec<_> = places.collect();
            let Some(place) = all.iter().find(|p| free(p)).or(all.first()) else { continue };
            let (x, y, left) = *place;
            if (x - at.0).hypot(y - at.1) > NEAR + radius {
                canvas.line(&[*at, (x, y)], colour::of_grey(150), 1)?;
            }
            let anchor = if left { Anchor::Right } else { Anchor::Left };
            taken.push(area(place));
            canvas.label(name, NAME_LETTERS, (x, y), anchor, false)?;
        }
        Ok(())
    }
}

/// The axes, the shorter one lengthened about its middle so that a unit is as long on both.
fn same_scale(x: &Axis, y: &Axis, plot: Area) -> (Axis, Axis) {
    let unit = |axis: &Axis, pixels: i32| (axis.to - axis.from).abs() / f64::from(pixels.max(1));
    let larger = unit(x, plot.width).max(unit(y, plot.height));
    let lengthened = |axis: &Axis, pixels: i32| {
        let more = (larger / unit(axis, pixels) - 1.0) / 2.0 * (axis.to - axis.from);
        Axis { from: axis.from - more, to: axis.to + more, ..axis.clone() }
    };
    (lengthened(x, plot.width), lengthened(y, plot.height))
}

fn draw_shape(canvas: &mut Canvas, frame: &Frame, shape: &Shape, colour: impl Fn(Paint) -> Rgb) -> Drawn {
    let places = |points: &[Point]| -> Vec<Point> {
        points.iter().map(|&(x, y)| (frame.x.place(x), frame.y.place(y))).collect()
    };
    let pixel = |place: Point| frame.pixel(place);
    match shape {
        Shape::Polygon { corners, paint } => {
            let corners: Vec<Point> = cut(places(corners)).into_iter().map(pixel).collect();
            if corners.len() < 3 { Ok(()) } else { canvas.polygon(&corners, colour(*paint)) }
        }
        Shape::Line { points, paint, width } => {
            for pair in places(points).windows(2) {
                if let Some(ends) = clipped([pair[0], pair[1]]) {
                    canvas.line(&ends.map(pixel), colour(*paint), *width)?;
                }
            }
            Ok(())
        }
        Shape::Mark { at, radius, square, paint, .. } => {
            if !frame.holds(*at) {
                return Ok(());
            }
            let (marker, at) = (
                if *square { Marker::Square } else { Marker::Circle },
                (frame.column(at.0), frame.row(at.1)),
            );
            canvas.marker(marker, at, radius + 1.5, WHITE)?;
            canvas.marker(marker, at, *radius, colour(*paint))
        }
    }
}

/// The part of a convex polygon in the unit square (I. Sutherland and G. Hodgman, 1974); nothing if a corner is no number.
fn cut(mut corners: Vec<Point>) -> Vec<Point> {
    if corners.iter().any(|(x, y)| !(x.is_finite() && y.is_finite())) {
        return Vec::new();
    }
    // How far a point is inside of each side.
    let sides: [fn(Point) -> f64; 4] = [|p| p.0, |p| 1.0 - p.0, |p| p.1, |p| 1.0 - p.1];
    for depth in sides {
        let mut kept = Vec::with_capacity(corners.len() + 1);
        for (n, &to) in corners.iter().enumerate() {
            let from = corners[(n + corners.len() - 1) % corners.len()];
            let (a, b) = (depth(from), depth(to));
            if (a < 0.0) != (b < 0.0) {
                let share = a / (a - b);
                kept.push((from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1)));
            }
            if b >= 0.0 {
                kept.push(to);
            }
        }
        corners = kept;
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metre_is_as_long_both_ways() {
        let plot = Area { left: 0, top: 0, width: 300, height: 200 };
        let (x, y) = same_scale(&Axis::new("x", "m", -2.0, 2.0), &Axis::new("y", "m", 0.0, 6.0), plot);
        assert!(((x.to - x.from) / 300.0 - (y.to - y.from) / 200.0).abs() < 1e-12);
        assert_eq!((y.from, y.to, x.from + x.to), (0.0, 6.0, 0.0));
    }

    #[test]
    fn polygons_are_cut_to_the_frame() {
        let area = |corners: &[Point]| {
            let next = |n: usize| corners[(n + 1) % corners.len()];
            let cross = corners.iter().enumerate().map(|(n, p)| p.0 * next(n).1 - p.1 * next(n).0);
            cross.sum::<f64>() / 2.0
        };
        let square = |from: f64, to: f64| vec![(from, from), (to, from), (to, to), (from, to)];
        assert!((area(&cut(square(0.2, 0.4))) - 0.04).abs() < 1e-12);
        assert!((area(&cut(square(-1.0, 0.5))) - 0.25).abs() < 1e-12);
        assert!((area(&cut(square(-9.0, 9.0))) - 1.0).abs() < 1e-12);
        assert!((area(&cut(vec![(-1.0, 0.0), (1.0, 0.0), (1.0, 1.0)])) - 0.75).abs() < 1e-12);
        assert!(cut(square(2.0, 3.0)).is_empty() && cut(square(0.0, f64::NAN)).is_empty());
    }
}
