//! The covariance as the methods take it: unpacked, of the right array, scaled to unit power, averaged.

use ndarray::Array2;
use num_complex::{Complex32, Complex64};
use rfhoi_shared::radar::MAX_VIRTUAL;
use rfhoi_shared::wire::Covariance;

use super::doubt::Doubt;
use super::geometry::{Geometry, Matrix};

/// Least mean power: below, parts of f32 numbers fall under its normal range.
const LEAST_POWER: f64 = f32::MIN_POSITIVE as f64 / f32::EPSILON as f64;

/// `covariance` as the Hermitian matrix that it packs; numbers that are not there are zero.
pub fn hermitian(covariance: &Covariance) -> Array2<Complex32> {
    let n = usize::from(covariance.antennas);
    let mut packed = covariance.packed.iter();
    let mut next = || packed.next().copied().unwrap_or(0.0);
    let mut matrix = Array2::zeros((n, n));
    for i in 0..n {
        matrix[(i, i)] = Complex32::new(next(), 0.0);
        for j in i + 1..n {
            matrix[(i, j)] = Complex32::new(next(), next());
            matrix[(j, i)] = matrix[(i, j)].conj();
        }
    }
    matrix
}

/// Unpacks `covariance` with the signs of the antennas undone, divided by its mean power. Returns this power, or why it is no
/// covariance of this array.
#[allow(clippy::needless_range_loop, reason = "rows and columns by their numbers, as the formula has them")]
pub(super) fn unpack(geometry: &Geometry, covariance: &Covariance, into: &mut Matrix) -> Result<f64, Doubt> {
    let n = geometry.count;
    if usize::from(covariance.antennas) != n || covariance.packed.len() != n * n {
        return Err(Doubt::OtherArray);
    }
    if !covariance.packed.iter().all(|p| p.is_finite()) {
        return Err(Doubt::NotANumber);
    }
    let mut packed = covariance.packed.iter().map(|&p| f64::from(p));
    let mut next = || packed.next().unwrap_or(0.0);
    let mut power = 0.0;
    *into = Matrix::default();
    for i in 0..n {
        into[i][i] = next().into();
        power += into[i][i].re / n as f64;
        for j in i + 1..n {
            into[i][j] = Complex64::new(next(), next()) * (geometry.signs[i] * geometry.signs[j]);
        }
    }
    if power < LEAST_POWER {
        return Err(if power < -LEAST_POWER { Doubt::NotPositive } else { Doubt::NothingMoves });
    }
    for i in 0..n {
        for j in i..n {
            let x = into[i][j] / power;
            // What no covariance has: an element larger than both its powers allow, by more than rounding.
            if x.norm_sqr() > n as f64 * n as f64 * 1.001 {
                return Err(Doubt::NotPositive);
            }
            into[i][j] = x;
            into[j][i] = x.conj();
        }
    }
    Ok(power)
}

/// The mean over subarrays, each given by its antennas (Shan, Wax and Kailath 1985).
pub(super) fn smooth(full: &Matrix, places: &[[usize; MAX_VIRTUAL]], n: usize, into: &mut Matrix) {
    *into = Matrix::default();
    let share = 1.0 / places.len() as f64;
    for place in places {
        for (row, &i) in into.iter_mut().zip(place).take(n) {
            for (x, &j) in row.iter_mut().zip(place).take(n) {
                *x += full[i][j] * share;
            }
        }
    }
}
