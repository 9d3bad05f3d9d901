//! Statistics of angles, as unit vectors (Mardia and Jupp, "Directional Statistics", 2000, section 2.3).
//!
//! With `C = sum cos`, `S = sum sin` over n angles: the mean is `atan2(S, C)`, the mean resultant length
//! `R = sqrt(C^2 + S^2) / n`, and the circular standard deviation `sqrt(-2 ln R)`. For spreads small against a turn it
//! is the ordinary standard deviation; it grows without bound as R goes to 0.

use std::f64::consts::{PI, TAU};

use num_complex::Complex;

/// `angle` in radians, wrapped to (-pi, pi].
pub fn wrap(angle: f64) -> f64 {
    // Much quicker than a remainder, and as exact for the few turns that come.
    let wrapped = angle - TAU * (angle / TAU).round();
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}

/// Circular standard deviation in radians of angles with mean resultant length `r`.
///
/// Rounding may take `r` past 1; that is a spread of 0.
pub fn standard_deviation(r: f64) -> f64 {
    (-2.0 * r.min(1.0).ln()).sqrt()
}

/// Sum of unit vectors.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Resultant {
    sum: Complex<f64>,
    count: u64,
}

impl Resultant {
    /// Adds an angle in radians.
    pub fn add(&mut self, angle: f64) {
        self.sum += Complex::cis(angle);
        self.count += 1;
    }

    /// The angles of both.
    pub fn and(self, other: Self) -> Self {
        Self { sum: self.sum + other.sum, count: self.count + other.count }
    }

    /// Angles that were added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Circular mean in radians, in (-pi, pi]; `None` without angles.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| wrap(self.sum.arg()))
    }

    /// Length of the sum, 0 to the number of angles.
    pub fn length(&self) -> f64 {
        self.sum.norm()
    }

    /// Mean resultant length, 0 to 1; `None` without angles.
    pub fn mean_length(&self) -> Option<f64> {
        (self.count > 0).then(|| self.length() / self.count as f64)
    }

    /// Circular standard deviation in radians; `None` without angles.
    pub fn standard_deviation(&self) -> Option<f64> {
        self.mean_length().map(standard_deviation)
    }
}

/// Circular standard deviation in radians of each angle about the mean of its own group, over all `groups`:
/// `R = sum of the groups' lengths / sum of their counts`. Groups of one angle say nothing of a spread and are left out;
/// `None` if no group is left. Small groups make it too small, as each mean is taken from the same angles.
pub fn pooled_standard_deviation<'a>(groups: impl IntoIterator<Item = &'a Resultant>) -> Option<f64> {
    let (mut length, mut count) = (0.0, 0);
    for group in groups.into_iter().filter(|group| group.count > 1) {
        length += group.length();
        count += group.count;
    }
    (count > 0).then(|| standard_deviation(length / count as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resultant(angles: &[f64]) -> Resultant {
        let mut resultant = Resultant::default();
        angles.iter().for_each(|&a| resultant.add(a));
        resultant
    }

    #[test]
    fn wrapping_has_its_edge_at_pi() {
        for (angle, wrapped) in [(0.0, 0.0), (PI, PI), (-PI, PI), (3.5 * PI, -0.5 * PI), (-7.0, TAU - 7.0)] {
            assert!((wrap(angle) - wrapped).abs() < 1e-12, "{angle}: {}", wrap(angle));
        }
    }

    #[test]
    fn mean_and_spread_do_not_see_the_wrap() {
        let around_pi = resultant(&[PI - 0.1, -PI + 0.1]);
        assert!((around_pi.mean().unwrap().abs() - PI).abs() < 1e-12);
        let around_zero = resultant(&[-0.1, 0.1]);
        let difference = around_pi.standard_deviation().unwrap() - around_zero.standard_deviation().unwrap();
        assert!(difference.abs() < 1e-12);
        // R = cos 0.1, so sqrt(-2 ln cos 0.1).
        assert!((around_zero.standard_deviation().unwrap() - 0.100_083).abs() < 1e-6);
    }

    #[test]
    fn pooling_is_about_each_groups_own_mean() {
        let groups = [resultant(&[-0.1, 0.1]), resultant(&[1.9, 2.1]), resultant(&[-3.0])];
        let pooled = pooled_standard_deviation(&groups).unwrap();
        assert!((pooled - groups[0].standard_deviation().unwrap()).abs() < 1e-12);
        assert_eq!(pooled_standard_deviation(&[resultant(&[1.0])]), None);
    }

    #[test]
    fn spread_of_opposite_angles_is_unbounded_and_of_equal_ones_zero() {
        assert!(resultant(&[0.0, PI]).standard_deviation().unwrap() > 5.0);
        assert_eq!(resultant(&[1.0; 7]).standard_deviation(), Some(0.0));
        assert_eq!(resultant(&[]).standard_deviation(), None);
    }
}
