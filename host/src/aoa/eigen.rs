//! Eigenvalues and eigenvectors of a covariance.
//!
//! A covariance averaged forward and backward is real after a fixed unitary transform (M. Haardt and J. A. Nossek 1995, unitary
//! ESPRIT): sums and differences of opposite antennas. The real part of the transformed covariance is the average, and its
//! decomposition costs half that of a complex one.

use core::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{ComplexField, SMatrix, SymmetricEigen};
use num_complex::Complex64;
use rfhoi_shared::radar::MAX_VIRTUAL;

use super::geometry::{Matrix, Vector};

/// Relative accuracy of eigenvalues, and steps after which a decomposition is given up: tens are usual.
const ACCURACY: f64 = 1e-15;
const STEPS: usize = 1000;

/// Eigenvalues of falling size with their eigenvectors.
#[derive(Debug, Clone, Default)]
pub(super) struct Eigen {
    pub(super) values: [f64; MAX_VIRTUAL],
    pub(super) vectors: [Vector; MAX_VIRTUAL],
}

/// Decomposes the Hermitian `matrix` of `n` antennas with a mean diagonal of 1; averages it forward and backward if `opposite`
/// says which antennas are opposite to each other. `None` where that does not converge.
pub(super) fn decompose(matrix: &Matrix, n: usize, opposite: Option<&[usize; MAX_VIRTUAL]>) -> Option<Eigen> {
    let Some(opposite) = opposite else {
        return sorted(SMatrix::from_fn(|i, j| padded(n, i, j, matrix[i][j])), n, |z| z);
    };
    let mut half = Matrix::default();
    for i in 0..n {
        for (j, row) in half.iter_mut().enumerate().take(n) {
            row[i] = into_sums(j, opposite[j], matrix[j][i], matrix[opposite[j]][i]);
        }
    }
    let real = SMatrix::from_fn(|i, j| {
        if i >= n || j >= n {
            return padded(n, i, j, 0.0);
        }
        // From the right by the conjugate transpose.
        into_sums(j, opposite[j], half[i][j].conj(), half[i][opposite[j]].conj()).re
    });
    let mut eigen = sorted(real, n, Complex64::from)?;
    for vector in &mut eigen.vectors[..n] {
        let sums = *vector;
        for (i, &j) in opposite.iter().enumerate().take(n) {
            vector[i] = match i.cmp(&j) {
                core::cmp::Ordering::Less => Complex64::new(sums[i].re, sums[j].re) * FRAC_1_SQRT_2,
                core::cmp::Ordering::Equal => sums[i],
                core::cmp::Ordering::Greater => Complex64::new(sums[j].re, -sums[i].re) * FRAC_1_SQRT_2,
            };
        }
    }
    Some(eigen)
}

/// Element `i` of the transform of a vector with elements `here` at `i` and `there` at its opposite `j`: the sum for the first
/// of both, the difference over the imaginary unit for the second.
fn into_sums(i: usize, j: usize, here: Complex64, there: Complex64) -> Complex64 {
    match i.cmp(&j) {
        core::cmp::Ordering::Less => (here + there) * FRAC_1_SQRT_2,
        core::cmp::Ordering::Equal => here,
        core::cmp::Ordering::Greater => (there - here) * Complex64::new(0.0, -FRAC_1_SQRT_2),
    }
}

/// An element within the array's, else of a diagonal far below all eigenvalues, so that the vectors stay apart.
fn padded<T: ComplexField<RealField = f64>>(n: usize, i: usize, j: usize, x: T) -> T {
    if i < n && j < n {
        x
    } else if i == j {
        T::from_real(-1e3)
    } else {
        T::zero()
    }
}

fn sorted<T: ComplexField<RealField = f64>>(
    matrix: SMatrix<T, MAX_VIRTUAL, MAX_VIRTUAL>,
    n: usize,
    complex: impl Fn(T) -> Complex64,
) -> Option<Eigen> {
    let found = SymmetricEigen::try_new(matrix, ACCURACY, STEPS)?;
    let mut order: [usize; MAX_VIRTUAL] = core::array::from_fn(|i| i);
    order.sort_unstable_by(|&a, &b| found.eigenvalues[b].total_cmp(&found.eigenvalues[a]));
    let mut eigen = Eigen::default();
    for (k, &from) in order.iter().enumerate().take(n) {
        eigen.values[k] = found.eigenvalues[from];
        for (i, x) in eigen.vectors[k].iter_mut().enumerate().take(n) {
            *x = complex(found.eigenvectors[(i, from)].clone());
        }
    }
    Some(eigen)
}
