//! Places for labels beside markers: in, what is taken and how large a label is; out, the first free place around its
//! marker.

use super::canvas::{Anchor, Area, Point};

/// From the edge of a marker to its label, pixels; the farther one needs a line between the two.
const NEAR: f64 = 4.0;
const FAR: f64 = 22.0;
/// Directions in the order in which they are tried: x, y, and what part of the label is nearest to the marker.
const AROUND: [(f64, f64, Anchor); 8] = [
    (1.0, 0.0, Anchor::Left),
    (-1.0, 0.0, Anchor::Right),
    (0.0, -1.0, Anchor::Middle),
    (0.0, 1.0, Anchor::Middle),
    (0.7, -0.7, Anchor::Left),
    (0.7, 0.7, Anchor::Left),
    (-0.7, -0.7, Anchor::Right),
    (-0.7, 0.7, Anchor::Right),
];

/// What is taken in a panel.
pub(super) struct Labels {
    plot: Area,
    /// What no label may cover.
    taken: Vec<Area>,
    /// What a label covers only where there is nothing better.
    lines: Vec<Area>,
}

/// Where a label is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub(super) at: Point,
    pub(super) anchor: Anchor,
    /// Whether it is so far from its marker that a line should lead to it.
    pub(super) far: bool,
}

impl Labels {
    /// For labels in `plot`.
    pub(super) fn new(plot: Area) -> Self {
        Self { plot: plot.inside(2, 2, 2, 2), taken: Vec::new(), lines: Vec::new() }
    }

    /// No label may cover a marker here.
    pub(super) fn add_marker(&mut self, (x, y): Point, radius: f64) {
        self.taken.push(Area::around((x - radius, y - radius), (2.0 * radius, 2.0 * radius)));
    }

    /// Labels had better not cover this line, which is upright or level.
    pub(super) fn add_line(&mut self, from: Point, to: Point) {
        let corner = (from.0.min(to.0) - 1.0, from.1.min(to.1) - 1.0);
        self.lines.push(Area::around(corner, ((from.0 - to.0).abs() + 1.0, (from.1 - to.1).abs() + 1.0)));
    }

    /// Takes the first free place for a label of `(width, height)` pixels beside a marker: near it, then farther away,
    /// then over a line; none if all are taken.
    pub(super) fn place(&mut self, marker: Point, radius: f64, size: Point) -> Option<Place> {
        let rounds = [(NEAR, false), (FAR, false), (NEAR, true), (FAR, true)];
        rounds.into_iter().find_map(|(distance, over_lines)| {
            AROUND.into_iter().find_map(|direction| {
                let (at, area) = beside(marker, radius + distance, size, direction);
                let far = distance == FAR;
                let leader = if far { leader(marker, radius, at) } else { Vec::new() };
                let covers = |area: Area| {
                    self.taken.iter().any(|t| t.overlaps(area))
                        || !over_lines && self.lines.iter().any(|l| l.overlaps(area))
                };
                let free = self.plot.contains(area)
                    && !covers(area)
                    && !leader.iter().any(|dot| self.taken.iter().any(|t| t.overlaps(*dot)));
                free.then(|| {
                    self.taken.push(area);
                    self.lines.extend(leader);
                    Place { at, anchor: direction.2, far }
                })
            })
        })
    }
}

/// Places along the line from a marker to its label at `to`, less the parts that these cover.
fn leader((x, y): Point, radius: f64, to: Point) -> Vec<Area> {
    let length = (to.0 - x).hypot(to.1 - y);
    let between = |from: f64| move |n: i32| from + (1.0 - from) * f64::from(n) / 8.0;
    // The corners of what a marker covers are farther than its radius.
    let share = between(1.5 * radius / length);
    (0..6).map(|n| Area::around((x + share(n) * (to.0 - x), y + share(n) * (to.1 - y)), (0.0, 0.0))).collect()
}

/// Where a label that lies `distance` from the middle of its marker is anchored, and what it covers.
fn beside(
    marker: Point,
    distance: f64,
    (width, height): Point,
    (x, y, anchor): (f64, f64, Anchor),
) -> (Point, Area) {
    // Above and below, half a label is between its middle and the marker.
    let away = if anchor == Anchor::Middle { distance + height / 2.0 } else { distance };
    let at = (marker.0 + x * away, marker.1 + y * away);
    let left = match anchor {
        Anchor::Left => at.0,
        Anchor::Right => at.0 - width,
        Anchor::Middle | Anchor::MiddleUpwards => at.0 - width / 2.0,
    };
    (at, Area::around((left, at.1 - height / 2.0), (width, height)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLOT: Area = Area { left: 0, top: 0, width: 300, height: 200 };

    #[test]
    fn a_label_goes_around_what_is_there_and_is_left_out_of_a_crowd() {
        let mut labels = Labels::new(PLOT);
        labels.add_marker((100.0, 100.0), 5.0);
        let mut place = || labels.place((100.0, 100.0), 5.0, (40.0, 16.0));
        let first = place().unwrap();
        assert_eq!((first.anchor, first.at, first.far), (Anchor::Left, (109.0, 100.0), false));
        let second = place().unwrap();
        assert_eq!((second.anchor, second.at), (Anchor::Right, (91.0, 100.0)));
        let more = std::iter::from_fn(place).count();
        assert!((2..20).contains(&more), "{more}");
        for (n, a) in labels.taken.iter().enumerate() {
            assert!(labels.taken[..n].iter().all(|b| !a.overlaps(*b)));
        }
    }

    #[test]
    fn a_line_is_covered_only_if_nothing_else_is_free() {
        let mut labels = Labels::new(PLOT);
        labels.add_line((100.0, 150.0), (200.0, 150.0));
        assert_eq!(labels.place((100.0, 150.0), 5.0, (40.0, 16.0)).unwrap().anchor, Anchor::Right);
        let mut all = Labels::new(PLOT);
        for row in (0..200).step_by(4) {
            all.add_line((0.0, f64::from(row)), (300.0, f64::from(row)));
        }
        assert_eq!(all.place((100.0, 100.0), 5.0, (40.0, 16.0)).unwrap().anchor, Anchor::Left);
    }

    #[test]
    fn labels_stay_in_the_panel() {
        let mut labels = Labels::new(PLOT);
        assert_eq!(labels.place((295.0, 100.0), 5.0, (40.0, 16.0)).unwrap().anchor, Anchor::Right);
        assert_eq!(labels.place((295.0, 100.0), 5.0, (400.0, 16.0)), None);
    }
}
