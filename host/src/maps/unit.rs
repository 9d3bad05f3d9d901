//! Levels to values from 0 to 1 (min-max normalisation, the paper's section 3.2).

/// Values that are looked at abreast.
const LANES: usize = 16;

/// The least and the greatest of some levels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    least: [f32; LANES],
    most: [f32; LANES],
}

impl Extent {
    /// Of nothing yet.
    pub(super) const fn new() -> Self {
        Self { least: [f32::INFINITY; LANES], most: [f32::NEG_INFINITY; LANES] }
    }

    /// Takes more levels.
    #[inline(always)]
    pub(super) fn add(&mut self, levels: &[f32]) {
        let (chunks, rest) = levels.as_chunks::<LANES>();
        for chunk in chunks {
            for ((least, most), &x) in self.least.iter_mut().zip(&mut self.most).zip(chunk) {
                *least = if x < *least { x } else { *least };
                *most = if x > *most { x } else { *most };
            }
        }
        for &x in rest {
            self.least[0] = self.least[0].min(x);
            self.most[0] = self.most[0].max(x);
        }
    }

    /// Brings levels within it to 0 to 1; all to 0 where they are all the same.
    #[inline(always)]
    pub(super) fn stretch(&self, levels: &mut [f32]) {
        let least = self.least.into_iter().fold(f32::INFINITY, f32::min);
        let most = self.most.into_iter().fold(f32::NEG_INFINITY, f32::max);
        let scale = if most > least { 1.0 / (most - least) } else { 0.0 };
        for x in levels {
            // Rounding may leave the strongest a hair over 1.
            let share = (*x - least) * scale;
            *x = if share < 1.0 { share } else { 1.0 };
        }
    }
}

/// Angle maps to squares.
#[derive(Debug, Clone, Copy)]
pub struct AngleSquare {
    arch: pulp::Arch,
}

impl AngleSquare {
    /// For the machine at hand.
    pub fn new() -> Self {
        Self { arch: pulp::Arch::new() }
    }

    /// Writes `levels_db`, rows of elevation or the one row of an array that has none, to all rows of `out`, from 0 to 1. Both
    /// have rows of one length.
    pub fn map(&self, levels_db: &[f32], out: &mut [f32]) {
        let rows = levels_db.len().clamp(1, out.len().max(1));
        self.arch.dispatch(|| {
            let mut extent = Extent::new();
            extent.add(levels_db);
            for rows in out.chunks_mut(rows) {
                for (out, &level) in rows.iter_mut().zip(levels_db) {
                    *out = level;
                }
                extent.stretch(rows);
            }
        });
    }
}

impl Default for AngleSquare {
    fn default() -> Self {
        Self::new()
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
