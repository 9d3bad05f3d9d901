//! Attention of all rows to all rows, head by head, in floats: `softmax(q k^T / sqrt(d)) v`.

use crate::isa::{Isa, LANES, Work};
use crate::lanes::exp;
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
    /// As [`scratch`] says: the keys, `[blocks of rows][d]`, the values, `[blocks of d][rows]`, and the scores of a few queries.
    pub(crate) scratch: &'a mut [f32],
    /// `[rows][width]`.
    pub(crate) sink: Sink<'a>,
}

/// Floats of scratch: a head's keys transposed, its values, and scores of [`QUERIES`], all in whole blocks.
pub(crate) fn scratch(rows: usize, width: usize, heads: usize) -> usize {
    let (d, block) = (width / heads, rows.next_multiple_of(BLOCK));
    d * block + rows * d.next_multiple_of(BLOCK) + QUERIES * block
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
            // While scores of a few queries are in the cache, what they weigh is added up.
            for start in (0..rows).step_by(QUERIES) {
                let mut queries: [&[f32]; QUERIES] = [&[]; QUERIES];
                for (offset, query) in queries.iter_mut().enumerate() {
                    let row = (start + offset).min(rows - 1);
                    *query = &self.qkv[row * 3 * width + q..][..d];
                }
                // Queries by transposed keys, so that lanes are keys and nothing is added across them.
                for (block, keys) in keys.chunks_exact(d).enumerate() {
                    let sums = product(isa, &queries, keys);
                    for (offset, sums) in sums.into_iter().enumerate() {
                        let to = &mut scores[offset * columns + block * BLOCK..][..BLOCK];
                        for (to, sums) in to.as_chunks_mut().0.iter_mut().zip(sums) {
                            *to = isa.store(isa.multiply(sums, scale));
                        }
                    }
                }
                softmax(isa, scores, rows);
                let mut shares: [&[f32]; QUERIES] = [&[]; QUERIES];
                for (share, scores) in shares.iter_mut().zip(scores.chunks_exact(columns)) {
                    *share = &scores[..rows];
                }
                for (block, values) in values.chunks_exact(rows).enumerate() {
                    let sums = product(isa, &shares, values);
                    for (row, sums) in (start..rows).zip(sums) {
                        for (column, sums) in (block * BLOCK..d).step_by(LANES).zip(sums) {
                            let count = LANES.min(d - column);
                            // SAFETY: one thread runs all of it; there are `rows` by `width`.
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
    if I::EIGHT_SUMS {
        for (at, b) in block.iter().enumerate() {
            for row in 0..QUERIES {
                let a = isa.splat(a[row][at]);
                for group in 0..GROUPS {
                    sums[row][group] = isa.fused(a, isa.floats(&b[group]), sums[row][group]);
                }
            }
        }
    } else {
        for group in 0..GROUPS {
            let mut own = [isa.splat(0.0); QUERIES];
            for (at, b) in block.iter().enumerate() {
                let b = isa.floats(&b[group]);
                for row in 0..QUERIES {
                    own[row] = isa.fused(isa.splat(a[row][at]), b, own[row]);
                }
            }
            for row in 0..QUERIES {
                sums[row][group] = own[row];
            }
        }
    }
    sums
}

/// Of the first `count` scores of each of a few rows, in place; what is beyond becomes 0. The rows take turns, so that none waits
/// for its own sums.
#[inline(always)]
fn softmax<I: Isa>(isa: I, scores: &mut [f32], count: usize) {
    let columns = scores.len() / QUERIES;
    for row in scores.chunks_exact_mut(columns) {
        row[count..].fill(f32::NEG_INFINITY);
    }
    let groups = columns / LANES;
    let scores = &mut scores.as_chunks_mut::<LANES>().0[..QUERIES * groups];
    let mut most = [isa.splat(f32::NEG_INFINITY); QUERIES];
    for group in 0..groups {
        for row in 0..QUERIES {
            most[row] = isa.max(isa.floats(&scores[row * groups + group]), most[row]);
        }
    }
    for most in &mut most {
        *most = isa.splat(isa.greatest(*most));
    }
    let mut sums = [isa.splat(0.0); QUERIES];
    for group in 0..groups {
        for row in 0..QUERIES {
            let score = &mut scores[row * groups + group];
            let power = exp(isa, isa.subtract(isa.floats(score), most[row]));
            sums[row] = isa.add(sums[row], power);
            *score = isa.store(power);
        }
    }
    for sum in &mut sums {
        *sum = isa.splat(1.0 / isa.sum(*sum));
    }
    for group in 0..groups {
        for row in 0..QUERIES {
            let score = &mut scores[row * groups + group];
            *score = isa.store(isa.multiply(isa.floats(score), sums[row]));
        }
    }
}
