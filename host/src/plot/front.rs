//! The Pareto front of a trade: in, points; out, those than which no other is better in both respects, and their steps.

/// Which values of y are better; of x, the smaller ones always are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    /// Larger ones, as of an accuracy.
    Larger,
    /// Smaller ones, as of an error.
    Smaller,
}

/// A step line along the best points: from each, its y holds up to the x of the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Front {
    /// Name in the legend.
    pub name: String,
    /// Its corners, x and y in the units of the axes, by rising x.
    pub points: Vec<(f64, f64)>,
}

impl Front {
    /// The front of `points`, x and y: those for which no other has an x as small and a better y, or a smaller x and a y
    /// as good. Points that are no numbers are left out.
    pub fn of(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>, better: Better) -> Self {
        let sign = if better == Better::Larger { 1.0 } else { -1.0 };
        let mut all: Vec<(f64, f64)> =
            points.into_iter().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then((sign * b.1).total_cmp(&(sign * a.1))));
        let mut best = f64::NEG_INFINITY;
        all.retain(|&(_, y)| {
            let ahead = sign * y > best;
            best = best.max(sign * y);
            ahead
        });
        Self { name: name.into(), points: all }
    }

    /// Its level and upright parts, from one end to the other; the last level one goes on to `end`.
    pub(super) fn steps(&self, end: f64) -> Vec<[(f64, f64); 2]> {
        let mut steps = Vec::new();
        for (n, &(x, y)) in self.points.iter().enumerate() {
            match self.points.get(n + 1) {
                Some(&(next_x, next_y)) => {
                    steps.push([(x, y), (next_x, y)]);
                    steps.push([(next_x, y), (next_x, next_y)]);
                }
                None if end > x => steps.push([(x, y), (end, y)]),
                None => {}
            }
        }
        steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [(f64, f64); 7] =
        [(3.0, 5.0), (1.0, 2.0), (2.0, 1.0), (1.0, 1.0), (2.0, 2.0), (4.0, 5.0), (f64::NAN, 9.0)];

    #[test]
    fn the_front_has_the_points_that_no_other_beats() {
        assert_eq!(Front::of("", POINTS, Better::Larger).points, [(1.0, 2.0), (3.0, 5.0)]);
        assert_eq!(Front::of("", POINTS, Better::Smaller).points, [(1.0, 1.0)]);
        assert!(Front::of("", [], Better::Larger).points.is_empty());
    }

    #[test]
    fn its_steps_hold_a_value_until_the_next() {
        let front = Front::of("", POINTS, Better::Larger);
        let steps = front.steps(6.0);
        assert_eq!(steps, [[(1.0, 2.0), (3.0, 2.0)], [(3.0, 2.0), (3.0, 5.0)], [(3.0, 5.0), (6.0, 5.0)]]);
        assert_eq!(front.steps(0.0).len(), 2);
    }
}
