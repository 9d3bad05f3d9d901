//! The scene from above, from the side and from the radar.

use std::fmt;

use glam::Vec3;

use super::{Moment, Sample, Thing};
use crate::plot::{Axis, ColourScale, HIGHLIGHT, Paint, Panel, Shape, View};
use crate::simulate::scene::Room;

/// What is shown around people and things, m: from above, and in height.
const AROUND_M: f32 = 0.4;
const HEADROOM_M: f32 = 0.25;
/// Of the walls, m.
const WALL_M: f32 = 0.05;
/// Least height of the views, m.
const LEAST_HEIGHT_M: f32 = 2.0;
/// Paths weaker than the strongest by more than this are as pale as can be, dB.
const PATH_SPAN_DB: f32 = 40.0;
/// Colours of the target, of other things, and of reader antennas.
const TARGET: Paint = Paint::Series(HIGHLIGHT);
const OTHER: Paint = Paint::Series(0);
const ANTENNA: Paint = Paint::Series(2);
/// Greys of a surface that faces the eye, and of one that is seen edge-on: of what moves, and of what stands there.
const MOVING: (f32, f32) = (205.0, 105.0);
const STILL: (f32, f32) = (232.0, 196.0);

/// Where the eye is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Eye {
    Above,
    /// On the right wall as seen from the radar's.
    Side,
    /// On the radar's wall.
    Front,
}

impl Eye {
    pub(super) const ALL: [Self; 3] = [Self::Above, Self::Side, Self::Front];

    /// Towards the eye.
    fn direction(self) -> Vec3 {
        match self {
            Self::Above => Vec3::Z,
            Self::Side => Vec3::X,
            Self::Front => Vec3::NEG_Y,
        }
    }

    /// Right and up as the eye sees it.
    fn flat(self, point: Vec3) -> (f64, f64) {
        let (right, up) = match self {
            Self::Above => (point.x, point.y),
            Self::Side => (point.y, point.z),
            Self::Front => (point.x, point.z),
        };
        (right.into(), up.into())
    }

    fn labels(self) -> (&'static str, &'static str) {
        match self {
            Self::Above => ("x", "y"),
            Self::Side => ("y", "height"),
            Self::Front => ("x", "height"),
        }
    }
}

impl fmt::Display for Eye {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Above => "From above (squares: reader antennas)",
            Self::Side => "From the right",
            Self::Front => "From the radar",
        })
    }
}

/// How much is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scope {
    /// Radios, people and all things, with their names.
    Whole,
    /// People and the target, with the target's name.
    Near,
}

/// Views of a sample, all of the same part of the room.
pub(super) struct Views<'s> {
    sample: &'s Sample,
    /// Corners of what is shown as a whole, and near.
    whole: (Vec3, Vec3),
    near: (Vec3, Vec3),
    /// Level of the strongest path, if there is any.
    strongest_db: Option<f32>,
}

impl<'s> Views<'s> {
    pub(super) fn new(sample: &'s Sample) -> Self {
        let target =
            |m: &'s Moment| m.things.iter().zip(&sample.things).filter(|(_, t)| t.target).map(|(&at, _)| at);
        let near = sample.moments.iter().flat_map(|m| m.vertices.iter().copied().chain(target(m)));
        let radios =
            sample.scene.reader.antennas.iter().map(|a| a.position).chain([sample.scene.radar.position]);
        let things = sample.moments.iter().flat_map(|m| m.things.iter().copied());
        let whole = extent(&sample.scene.room, near.clone().chain(things).chain(radios));
        let near = extent(&sample.scene.room, near);
        let levels = sample.moments.iter().flat_map(|m| m.paths.iter().map(|p| p.level_db));
        let strongest_db = levels.filter(|l| l.is_finite()).reduce(f32::max);
        Self { sample, whole, near, strongest_db }
    }

    /// The view of moment number `moment`.
    pub(super) fn panel(&self, eye: Eye, moment: usize, scope: Scope, title: String) -> Panel {
        let (min, max) = if scope == Scope::Whole { self.whole } else { self.near };
        let ((x_from, y_from), (x_to, y_to)) = (eye.flat(min), eye.flat(max));
        let (x, y) = eye.labels();
        let mut shapes = self.fixed(eye);
        if let Some(moment) = self.sample.moments.get(moment) {
            let mut paths: Vec<_> = moment.paths.iter().collect();
            paths.sort_by(|a, b| a.level_db.total_cmp(&b.level_db));
            shapes.extend(paths.into_iter().map(|path| Shape::Line {
                points: path.points.iter().map(|&p| eye.flat(p)).collect(),
                paint: Paint::Level(path.level_db),
                width: 1,
            }));
            self.solids(eye, &moment.vertices, &mut shapes);
            // The target last, over the others.
            let mut things: Vec<(&Thing, Vec3)> =
                self.sample.things.iter().zip(moment.things.iter().copied()).collect();
            things.sort_by_key(|(thing, _)| thing.target);
            shapes.extend(things.into_iter().map(|(thing, at)| Shape::Mark {
                at: eye.flat(at),
                radius: if thing.target { 7.0 } else { 4.0 },
                square: false,
                paint: if thing.target { TARGET } else { OTHER },
                name: if thing.target || scope == Scope::Whole { thing.name.clone() } else { String::new() },
            }));
        }
        // The radar's own eye does not see the radar.
        if eye != Eye::Front {
            shapes.extend(self.radios(eye, scope));
        }
        let range = |top: f32| ColourScale::new("path", "dB").with_range(top - PATH_SPAN_DB, top);
        Panel::View(View {
            title,
            x: Axis::new(x, "m", x_from, x_to),
            y: Axis::new(y, "m", y_from, y_to),
            shapes,
            scale: self.strongest_db.map(range),
        })
    }

    /// Walls and furniture.
    fn fixed(&self, eye: Eye) -> Vec<Shape> {
        let scene = &self.sample.scene;
        let ((left, low), (right, high)) = (eye.flat(scene.room.min), eye.flat(scene.room.max));
        let mut furniture: Vec<_> =
            scene.furniture.iter().map(|f| (f, f.centre.dot(eye.direction()))).collect();
        furniture.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut shapes = Vec::new();
        for (furniture, _) in furniture {
            let mut outline = hull(furniture.corners().map(|c| eye.flat(c)).to_vec());
            shapes.push(Shape::Polygon { corners: outline.clone(), paint: Paint::Grey(238) });
            outline.extend(outline.first().copied());
            shapes.push(Shape::Line { points: outline, paint: Paint::Grey(190), width: 1 });
        }
        let walls = vec![(left, low), (right, low), (right, high), (left, high), (left, low)];
        shapes.push(Shape::Line { points: walls, paint: Paint::Grey(70), width: 3 });
        shapes
    }

    /// What moves and what stands there, lit from the eye, the farthest triangle first.
    fn solids(&self, eye: Eye, vertices: &[Vec3], shapes: &mut Vec<Shape>) {
        let towards = eye.direction();
        let (fixed, places) = &self.sample.fixtures;
        let mut seen = Vec::new();
        for (triangles, vertices, greys) in
            [(fixed, &places[..], STILL), (&self.sample.triangles, vertices, MOVING)]
        {
            for triangle in triangles {
                let [Some(&a), Some(&b), Some(&c)] = triangle.map(|n| vertices.get(n as usize)) else {
                    continue;
                };
                let facing = (b - a).cross(c - a).normalize_or_zero().dot(towards);
                if facing > 0.0 {
                    let (lit, shaded) = greys;
                    let grey = (shaded + (lit - shaded) * facing) as u8;
                    seen.push(((a + b + c).dot(towards), grey, [a, b, c]));
                }
            }
        }
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        shapes.extend(seen.into_iter().map(|(_, grey, corners)| Shape::Polygon {
            corners: corners.map(|c| eye.flat(c)).to_vec(),
            paint: Paint::Grey(grey),
        }));
    }

    /// Radar and reader antennas.
    fn radios(&self, eye: Eye, scope: Scope) -> impl Iterator<Item = Shape> {
        let scene = &self.sample.scene;
        let antennas = scene.reader.antennas.iter().map(move |antenna| Shape::Mark {
            at: eye.flat(antenna.position),
            radius: 4.5,
            square: true,
            paint: ANTENNA,
            name: String::new(),
        });
        let radar = Shape::Mark {
            at: eye.flat(scene.radar.position),
            radius: 5.0,
            square: false,
            paint: Paint::Grey(0),
            name: if scope == Scope::Whole { "radar".into() } else { String::new() },
        };
        antennas.chain([radar])
    }
}

/// Corners of what is shown of `room` so that `points` are seen; all of it if there are none.
fn extent(room: &Room, points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    let ends = |(low, high): (Vec3, Vec3), p: Vec3| (low.min(p), high.max(p));
    let known = points.filter(|p| p.is_finite()).map(|p| (p, p)).reduce(|a, b| ends(a, b.0));
    let (low, high) = known.unwrap_or((room.min, room.max));
    let margin = Vec3::new(AROUND_M, AROUND_M, HEADROOM_M);
    let (mut min, mut max) = ((low - margin).max(room.min), (high + margin).min(room.max));
    min.z = room.min.z;
    max.z = max.z.max(room.min.z + LEAST_HEIGHT_M);
    // A little more than the room, so that walls that are near are seen.
    (min - WALL_M, max + WALL_M)
}

/// The convex hull of points, counter-clockwise (A. Andrew's monotone chain, 1979).
fn hull(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let half = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        let mut chain: Vec<(f64, f64)> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut outline = half(&mut points.iter().copied());
    outline.extend(half(&mut points.iter().rev().copied()));
    outline
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hulls_hold_all_points_and_no_more() {
        let square = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)];
        let mut points = square.to_vec();
        points.extend([(1.0, 1.0), (2.0, 1.0), (0.0, 0.0)]);
        assert_eq!(hull(points), square);
    }

    #[test]
    fn eyes_see_right_handed_and_nearer_things_later() {
        let (right, up) = (Vec3::X, Vec3::Y);
        assert_eq!((Eye::Above.flat(right), Eye::Above.flat(up)), ((1.0, 0.0), (0.0, 1.0)));
        for eye in Eye::ALL {
            // Right x up points to the eye.
            let axes = [Vec3::X, Vec3::Y, Vec3::Z];
            let right = axes.into_iter().find(|&a| eye.flat(a) == (1.0, 0.0)).unwrap();
            let up = axes.into_iter().find(|&a| eye.flat(a) == (0.0, 1.0)).unwrap();
            assert_eq!(right.cross(up), eye.direction());
        }
    }
}
