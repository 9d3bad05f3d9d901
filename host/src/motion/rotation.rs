//! Rotations about axes, and the degrees of freedom that ASF and BVH make of them.

/// Rotation matrix, row by row.
pub(super) type Matrix = [[f64; 3]; 3];
pub(super) type Vector = [f64; 3];

pub(super) const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// A degree of freedom of a joint; the number of the axis is 0 to 2 for x to z.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Freedom {
    /// Along an axis.
    Translation(usize),
    /// About an axis.
    Rotation(usize),
}

/// Number of the axis named `letter`, in either case.
pub(super) fn axis(letter: char) -> Option<usize> {
    "xyz".find(letter.to_ascii_lowercase())
}

/// Rotation by `angle` radians about an axis, counterclockwise seen from its positive end.
pub(super) fn about(axis: usize, angle: f64) -> Matrix {
    let (sin, cos) = libm::sincos(angle);
    let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut matrix = IDENTITY;
    matrix[next][next] = cos;
    matrix[next][last] = -sin;
    matrix[last][next] = sin;
    matrix[last][last] = cos;
    matrix
}

pub(super) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

pub(super) fn transpose(a: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

pub(super) fn apply(a: &Matrix, v: Vector) -> Vector {
    std::array::from_fn(|i| (0..3).map(|k| a[i][k] * v[k]).sum())
}

pub(super) fn sum(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] + b[i])
}

pub(super) fn scaled(v: Vector, factor: f64) -> Vector {
    v.map(|x| x * factor)
}
