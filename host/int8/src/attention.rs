//! Attention of all rows to all rows, head by head, in floats: `softmax(q k^T / sqrt(d)) v`.

use crate::isa::{Isa, LANES, Work};
use crate::lanes::{exp, greatest, sum};
use crate::out::Sink;

/// Rows of queries at once: with two groups of lanes, eight sums that do not wait for each other.
const QUERIES: usize = 4;
const GROUPS: usize = 2;
const BLOCK: usize = GROUPS * LANES;

#[derive(Debug)]
pub(crate) struct Attention<'a> {
    /// `[rows][3 * width]`: queries, keys, values, heads one after the other in each.
    pub(crate) qkv: &'a [f32],
    pub(crate) rows: usize,
    pub(crate) width: usize,
    pub(crate) heads: usize,
    /// As [`scratch`] says.
    pub(crate) scratch: &'a mut [f32],
    /// `[rows][width]`.
    pub(crate) sink: Sink<'a>,
}

/// Floats of scratch: a head's keys transposed, its values, and its scores.
pub(crate) fn scratch(rows: usize, width: usize, heads: usize) -> usize {
    let (d, block) = (width / heads, rows.next_multiple_of(BLOCK));
    d * block + rows * d.next_multiple_of(BLOCK) + rows.next_multiple_of(QUERIES) * block
}

impl Work for Attention<'_> {
    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let (rows, width) = (self.rows, self.width);
        let d = width / self.heads;
        let (columns, depth) = (rows.next_multiple_of(BLOCK), d.next_multiple_of(BLOCK));
        let (keys, scratch) = self.scratch.split_at_mut(d * columns);
        let (values, scores) = scratch.split_at_mut(rows * depth);
        let scale = isa.splat(1.0 / (d as f32).sqrt());
        for head in 0..self.heads {
            let (q, k, v) = (head * d, width + head * d, 2 * width + head * d);
            for (row, tokens) in self.qkv.chunks_exact(3 * width).enumerate() {
                for (keys, &key) in keys.chunks_exact_mut(columns).zip(&tokens[k..][..d]) {
                    keys[row] = key;
                }
                values[row * depth..][..d].copy_from_slice(&tokens[v..][..d]);
            }
            // Scores: queries by transposed keys, so that lanes are keys and nothing is added across them.
            for start in (0..rows).step_by(QUERIES) {
                let mut queries: [&[f32]; QUERIES] = [&[]; QUERIES];
                for (offset, query) in queries.iter_mut().enumerate() {
                    let row = (start + offset).min(rows - 1);
                    *query = &self.qkv[row * 3 * width + q..][..d];
                }
                for column in (0..columns).step_by(BLOCK) {
                    let sums = product(isa, &queries, keys, columns, column);
                    for (offset, sums) in sums.into_iter().enumerate() {
                        let to = &mut scores[(start + offset) * columns + column..][..BLOCK];
                        for (to, sums) in to.as_chunks_mut().0.iter_mut().zip(sums) {
                            *to = isa.store(isa.multiply(sums, scale));
                        }
                    }
                }
            }
            for scores in scores.chunks_exact_mut(columns).take(rows) {
                softmax(isa, scores, rows);
            }
            for start in (0..rows).step_by(QUERIES) {
                let mut shares: [&[f32]; QUERIES] = [&[]; QUERIES];
                for (offset, share) in shares.iter_mut().enumerate() {
                    let row = (start + offset).min(rows - 1);
                    *share = &scores[row * columns..][..rows];
                }
                for block in (0..depth).step_by(BLOCK) {
                    let sums = product(isa, &shares, values, depth, block);
                    for (row, sums) in (start..rows).zip(sums) {
                        for (column, sums) in (block..d).step_by(LANES).zip(sums) {
                            let count = LANES.min(d - column);
                            // SAFETY: one thread runs all of it.
                            unsafe { self.sink.store(isa, row * width + q + column, sums, count) };
                        }
                    }
                }
            }
        }
    }
}

/// Rows of k numbers by `b`, `[k][columns]`: of each row a block of columns, from `column` on.
#[inline(always)]
fn product<I: Isa>(
    isa: I,
    rows: &[&[f32]; QUERIES],
    b: &[f32],
    columns: usize,
    column: usize,
) -> [[I::Floats; GROUPS]; QUERIES] {
    let k = rows[0].len();
    let mut a: [&[f32]; QUERIES] = [&[]; QUERIES];
    for (a, row) in a.iter_mut().zip(rows) {
        *a = &row[..k];
    }
    let mut sums = [[isa.splat(0.0); GROUPS]; QUERIES];
    for (at, b) in b.chunks_exact(columns).take(k).enumerate() {
        let b: &[[f32; LANES]; GROUPS] = b[column..][..BLOCK].as_chunks().0.as_array().expect("a block");
        for row in 0..QUERIES {
            let a = isa.splat(a[row][at]);
            for group in 0..GROUPS {
                sums[row][group] = isa.add(sums[row][group], isa.multiply(a, isa.floats(&b[group])));
            }
        }
    }
    sums
}

/// Of the first `count` scores, in place; what is beyond becomes 0.
#[inline(always)]
fn softmax<I: Isa>(isa: I, scores: &mut [f32], count: usize) {
    scores[count..].fill(f32::NEG_INFINITY);
    let groups = scores.as_chunks_mut::<LANES>().0;
    let mut most = isa.splat(f32::NEG_INFINITY);
    for group in &*groups {
        most = isa.max(isa.floats(group), most);
    }
    let most = isa.splat(greatest(isa, most));
    let mut sums = isa.splat(0.0);
    for group in &mut *groups {
        let power = exp(isa, isa.subtract(isa.floats(group), most));
        sums = isa.add(sums, power);
        *group = isa.store(power);
    }
    let share = isa.splat(1.0 / sum(isa, sums));
    for group in groups {
        *group = isa.store(isa.multiply(isa.floats(group), share));
    }
}
