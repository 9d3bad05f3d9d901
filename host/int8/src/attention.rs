//! Attention of all rows to all rows, head by head, in floats: `softmax(q k^T / sqrt(d)) v`.

use crate::isa::{Isa, LANES, Work};
use crate::lanes::{exp, greatest, sum};
use crate::out::Sink;

/// Rows of queries at once: with two groups of lanes, eight sums that do not wait for each other.
const QUERIES: usize = 4;
const GROUPS: usize = 2;
const BLOCK: usize = GROUPS * LANES;

/// A row of a block of columns.
type Row = [[f32; LANES]; GROUPS];

#[derive(Debug)]
pub(crate) struct Attention<'a> {
    /// `[rows][3 * width]`: queries, keys, values, heads one after the other in each.
    pub(crate) qkv: &'a [f32],
    pub(crate) rows: usize,
    pub(crate) width: usize,
    pub(crate) heads: usize,
    /// As [`scratch`] says: the keys, `[blocks of rows][d]`, the values, `[blocks of d][rows]`, and the scores.
    pub(crate) scratch: &'a mut [f32],
    /// `[rows][width]`.
    pub(crate) sink: Sink<'a>,
}

/// Floats of scratch: a head's keys transposed, its values, and its scores, all in whole blocks.
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
        // A block's columns of all k lie together: rows a power of two apart would meet in the cache.
        let (keys, scratch) = self.scratch.split_at_mut(d * columns);
        let (values, scores) = scratch.split_at_mut(rows * depth);
        let keys: &mut [Row] = keys.as_chunks_mut().0.as_chunks_mut().0;
        let values: &mut [Row] = values.as_chunks_mut().0.as_chunks_mut().0;
        let scale = isa.splat(1.0 / (d as f32).sqrt());
        for head in 0..self.heads {
            let (q, k, v) = (head * d, width + head * d, 2 * width + head * d);
            for (row, tokens) in self.qkv.chunks_exact(3 * width).enumerate() {
                let column = &mut keys[row / BLOCK * d..][..d];
                for (keys, &key) in column.iter_mut().zip(&tokens[k..][..d]) {
                    keys.as_flattened_mut()[row % BLOCK] = key;
                }
                let blocks = values.iter_mut().skip(row).step_by(rows);
                for (values, value) in blocks.zip(tokens[v..][..d].chunks(BLOCK)) {
                    values.as_flattened_mut()[..value.len()].copy_from_slice(value);
                }
            }
            // Scores: queries by transposed keys, so that lanes are keys and nothing is added across them.
            for start in (0..rows).step_by(QUERIES) {
                let mut queries: [&[f32]; QUERIES] = [&[]; QUERIES];
                for (offset, query) in queries.iter_mut().enumerate() {
                    let row = (start + offset).min(rows - 1);
                    *query = &self.qkv[row * 3 * width + q..][..d];
                }
                for (block, keys) in keys.chunks_exact(d).enumerate() {
                    let sums = product(isa, &queries, keys);
                    for (offset, sums) in sums.into_iter().enumerate() {
                        let to = &mut scores[(start + offset) * columns + block * BLOCK..][..BLOCK];
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
                for (block, values) in values.chunks_exact(rows).enumerate() {
                    let sums = product(isa, &shares, values);
                    for (row, sums) in (start..rows).zip(sums) {
                        for (column, sums) in (block * BLOCK..d).step_by(LANES).zip(sums) {
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

/// Rows of k numbers by a block of columns.
#[inline(always)]
fn product<I: Isa>(isa: I, rows: &[&[f32]; QUERIES], block: &[Row]) -> [[I::Floats; GROUPS]; QUERIES] {
    let mut a: [&[f32]; QUERIES] = [&[]; QUERIES];
    for (a, row) in a.iter_mut().zip(rows) {
        *a = &row[..block.len()];
    }
    let mut sums = [[isa.splat(0.0); GROUPS]; QUERIES];
    for (at, b) in block.iter().enumerate() {
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
