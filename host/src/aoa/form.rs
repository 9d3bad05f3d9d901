//! A quadratic form of the steering vector, as what it is over directions: a trigonometric polynomial.
//!
//! Antennas are at whole half wavelengths, so `a^H Q a` is the sum over pairs `Q_ij exp(j pi ((x_i - x_j) u + (y_i - y_j) w))`,
//! and pairs with the same difference go together: of 144 elements of a rectangle of 4 x 3 remain 18 (the difference
//! co-array).

use core::f64::consts::PI;

use num_complex::Complex64;
use rfhoi_shared::radar::MAX_VIRTUAL;

use super::geometry::{Geometry, Matrix};

/// Differences of positions, at most, each way.
const SPAN: usize = MAX_VIRTUAL;

/// `Re sum c[dx][dy] exp(j pi (dx u + dy w))` over `dx >= 0`, `-span <= dy <= span`.
#[derive(Debug, Clone)]
pub(super) struct Form {
    span: (usize, usize),
    /// By `dx`, then `dy + SPAN`.
    coefficients: [[Complex64; 2 * SPAN + 1]; SPAN],
}

/// Value, gradient and second derivatives by u and w: uu, uw, ww.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Local {
    pub(super) value: f64,
    pub(super) gradient: [f64; 2],
    pub(super) curvature: [f64; 3],
}

impl Form {
    pub(super) fn new(geometry: &Geometry) -> Self {
        Self { span: geometry.span(), coefficients: [[Complex64::default(); 2 * SPAN + 1]; SPAN] }
    }

    /// Takes the Hermitian `q` of `geometry`'s antennas; only its upper triangle and diagonal are read.
    #[allow(
        clippy::needless_range_loop,
        reason = "rows and columns by their numbers, as the formula has them"
    )]
    pub(super) fn set(&mut self, geometry: &Geometry, q: &Matrix) {
        for row in &mut self.coefficients[..=self.span.0] {
            *row = [Complex64::default(); 2 * SPAN + 1];
        }
        for i in 0..geometry.count {
            self.coefficients[0][SPAN] += q[i][i].re;
            for j in i + 1..geometry.count {
                let ((xi, yi), (xj, yj)) = (geometry.positions[i], geometry.positions[j]);
                let (dx, dy) = (xi - xj, yi - yj);
                // An element and its conjugate on the other side are together twice the real part of one.
                let twice = 2.0 * q[i][j];
                let (dx, dy, c) = if (dx, dy) < (0, 0) { (-dx, -dy, twice.conj()) } else { (dx, dy, twice) };
                self.coefficients[dx as usize][(dy + SPAN as i32) as usize] += c;
            }
        }
    }

    /// Coefficients of the row at w, of which `step` is `exp(j pi w)`: the form is `Re sum b[d] exp(j pi d u)`.
    pub(super) fn row(&self, step: Complex64) -> [Complex64; SPAN] {
        let (dx, dy) = self.span;
        let mut row = [Complex64::default(); SPAN];
        let mut turn = Complex64::new(1.0, 0.0);
        for d in 0..=dy {
            for (b, c) in row.iter_mut().zip(&self.coefficients).take(dx + 1) {
                *b += c[SPAN + d] * turn;
                if d > 0 {
                    *b += c[SPAN - d] * turn.conj();
                }
            }
            turn *= step;
        }
        row
    }

    /// Value and derivatives at (u, w).
    pub(super) fn at(&self, u: f64, w: f64) -> Local {
        let (dx, dy) = self.span;
        let mut local = Local::default();
        let phasor = |angle: f64| Complex64::cis(angle);
        let (step_u, step_w) = (phasor(PI * u), phasor(PI * w));
        let mut turn_u = Complex64::new(1.0, 0.0);
        for (d, row) in self.coefficients.iter().enumerate().take(dx + 1) {
            let d = PI * d as f64;
            let mut add = |e: f64, z: Complex64| {
                local.value += z.re;
                local.gradient[0] -= d * z.im;
                local.gradient[1] -= e * z.im;
                local.curvature[0] -= d * d * z.re;
                local.curvature[1] -= d * e * z.re;
                local.curvature[2] -= e * e * z.re;
            };
            let mut turn_w = Complex64::new(1.0, 0.0);
            for e in 0..=dy {
                let angle = PI * e as f64;
                add(angle, row[SPAN + e] * turn_u * turn_w);
                if e > 0 {
                    add(-angle, row[SPAN - e] * turn_u * turn_w.conj());
                }
                turn_w *= step_w;
            }
            turn_u *= step_u;
        }
        local
    }
}

#[cfg(test)]
mod tests {
    use rfhoi_shared::array::AntennaArray;
    use rfhoi_shared::radar::RadarProfile;

    use super::*;

    #[test]
    #[allow(
        clippy::needless_range_loop,
        reason = "rows and columns by their numbers, as the formula has them"
    )]
    fn it_is_the_quadratic_form() {
        for array in [AntennaArray::Awr1843Aop, AntennaArray::Xwr1843Boost, AntennaArray::Iwr6843Aop] {
            let geometry = Geometry::of(&RadarProfile { array, ..RadarProfile::bridge() }).unwrap();
            let n = geometry.count;
            let mut q = Matrix::default();
            for i in 0..n {
                for j in i..n {
                    let phase = (7 * i + 3 * j) as f64;
                    q[i][j] = if i == j { phase.into() } else { Complex64::new(phase.sin(), phase.cos()) };
                    q[j][i] = q[i][j].conj();
                }
            }
            let mut form = Form::new(&geometry);
            form.set(&geometry, &q);
            let slow = |u, w| {
                let a = geometry.steering(u, w);
                let sum = |i: usize| (0..n).map(|j| a[i].conj() * q[i][j] * a[j]).sum::<Complex64>();
                (0..n).map(sum).sum::<Complex64>().re
            };
            for (u, w) in [(0.0, 0.0), (0.3, -0.8), (-0.86, 0.5), (0.99, 0.01)] {
                let here = form.at(u, w);
                assert!((here.value - slow(u, w)).abs() < 1e-11);
                let row = form.row((Complex64::i() * PI * w).exp());
                let by_row =
                    |(d, b): (usize, &Complex64)| (b * (Complex64::i() * PI * u * d as f64).exp()).re;
                assert!((row.iter().enumerate().map(by_row).sum::<f64>() - here.value).abs() < 1e-11);
                let h = 1e-4;
                let du = (slow(u + h, w) - slow(u - h, w)) / (2.0 * h);
                let dw = (slow(u, w + h) - slow(u, w - h)) / (2.0 * h);
                let uw = (form.at(u, w + h).gradient[0] - form.at(u, w - h).gradient[0]) / (2.0 * h);
                let uu = (form.at(u + h, w).gradient[0] - form.at(u - h, w).gradient[0]) / (2.0 * h);
                let close = |a: f64, b: f64| (a - b).abs() < 1e-4 * (1.0 + b.abs());
                assert!(close(here.gradient[0], du) && close(here.gradient[1], dw));
                assert!(close(here.curvature[0], uu) && close(here.curvature[1], uw));
            }
        }
    }
}
