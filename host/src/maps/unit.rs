//! Levels to values from 0 to 1 (min-max normalisation, the paper's section 3.2).

use pulp::{Simd, WithSimd};

/// Brings levels from `least` to `most` to 0 to 1; all to 0 where they are all the same.
#[inline(always)]
pub(super) fn stretch<S: Simd>(simd: S, least: f32, most: f32, levels: &mut [f32]) {
    let scale = if most > least { 1.0 / (most - least) } else { 0.0 };
    // Rounding may leave the strongest a hair over 1.
    let (registers, rest) = S::as_mut_simd_f32s(levels);
    for x in registers {
        let share = simd.mul_f32s(simd.sub_f32s(*x, simd.splat_f32s(least)), simd.splat_f32s(scale));
        *x = simd.min_f32s(share, simd.splat_f32s(1.0));
    }
    for x in rest {
        *x = ((*x - least) * scale).min(1.0);
    }
}

/// The least and the greatest of `levels`.
#[inline(always)]
fn extent<S: Simd>(simd: S, levels: &[f32]) -> (f32, f32) {
    let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
    let (mut leasts, mut mosts) = (simd.splat_f32s(least), simd.splat_f32s(most));
    let (registers, rest) = S::as_simd_f32s(levels);
    for &x in registers {
        (leasts, mosts) = (simd.min_f32s(leasts, x), simd.max_f32s(mosts, x));
    }
    for &x in rest {
        (least, most) = (least.min(x), most.max(x));
    }
    (least.min(simd.reduce_min_f32s(leasts)), most.max(simd.reduce_max_f32s(mosts)))
}

/// Angle maps to squares.
#[derive(Debug, Clone, Copy, Default)]
pub struct AngleSquare {
    arch: pulp::Arch,
}

impl AngleSquare {
    /// For the machine at hand.
    pub fn new() -> Self {
        Self::default()
    }

    /// Writes `levels_db`, rows of elevation or the one row of an array that has none, to all rows of `out`, from 0 to 1. Both
    /// have rows of one length.
    pub fn map(&self, levels_db: &[f32], out: &mut [f32]) {
        self.arch.dispatch(Square { levels_db, out });
    }
}

struct Square<'a> {
    levels_db: &'a [f32],
    out: &'a mut [f32],
}

impl WithSimd for Square<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { levels_db, out } = self;
        let (least, most) = extent(simd, levels_db);
        for rows in out.chunks_mut(levels_db.len().max(1)) {
            for (out, &level) in rows.iter_mut().zip(levels_db) {
                *out = level;
            }
            stretch(simd, least, most, rows);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_reach_from_0_to_1_and_one_row_fills_the_square() {
        let row: Vec<f32> = (0..37).map(|i| -40.0 + (i * 11 % 37) as f32).collect();
        let mut out = vec![9.0; 37 * 37];
        AngleSquare::new().map(&row, &mut out);
        for rows in out.chunks_exact(37) {
            assert_eq!((rows[0], rows.iter().copied().fold(0.0, f32::max)), (0.0, 1.0));
            assert!(rows.iter().zip(&row).all(|(x, level)| (x - (level + 40.0) / 36.0).abs() < 1e-6));
        }
        AngleSquare::new().map(&[3.0; 37], &mut out);
        assert!(out.iter().all(|&x| x == 0.0));
    }
}
