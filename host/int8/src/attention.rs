//! Attention of all rows to all rows, head by head, in floats: `softmax(q k^T / sqrt(d)) v`.

use crate::isa::{Isa, LANES, Work};
use crate::lanes::{Lanes, exp};
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
    fn run<I: Isa>(self, _: I) {
        let (rows, width) = (self.rows, self.width);
        let d = width / self.heads;
        let (columns, depth) = (rows.next_multiple_of(BLOCK), d.next_multiple_of(BLOCK));
        let (keys, scratch) = self.scratch.split_at_mut(d * columns);
        let (values, scores) = scratch.split_at_mut(rows * depth);
        let scale = Lanes::splat(1.0 / (d as f32).sqrt());
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
                product(&queries, keys, columns, |offset, column, sums| {
                    let at = (start + offset) * columns + column;
                    scores[at..][..LANES].copy_from_slice(&sums.multiply(scale).0);
                });
            }
            for scores in scores.chunks_exact_mut(columns).take(rows) {
                softmax(scores, rows);
            }
            for start in (0..rows).step_by(QUERIES) {
                let mut shares: [&[f32]; QUERIES] = [&[]; QUERIES];
                for (offset, share) in shares.iter_mut().enumerate() {
                    let row = (start + offset).min(rows - 1);
                    *share = &scores[row * columns..][..rows];
                }
                product(&shares, values, depth, |offset, column, sums| {
                    let row = start + offset;
                    if row < rows && column < d {
                        let count = LANES.min(d - column);
                        // SAFETY: one thread runs all of it.
                        unsafe { self.sink.store(row * width + q + column, &sums, count) };
                    }
                });
            }
        }
    }
}

/// `a`, rows of k numbers, by `b`, `[k][columns]`; a row's number, a column and the sums from there on go to `put`.
#[inline(always)]
fn product(a: &[&[f32]; QUERIES], b: &[f32], columns: usize, mut put: impl FnMut(usize, usize, Lanes)) {
    let k = a[0].len();
    let mut rows: [&[f32]; QUERIES] = [&[]; QUERIES];
    for (row, a) in rows.iter_mut().zip(a) {
        *row = &a[..k];
    }
    for column in (0..columns).step_by(BLOCK) {
        let mut sums = [[Lanes::ZERO; GROUPS]; QUERIES];
        for (at, b) in b.chunks_exact(columns).take(k).enumerate() {
            let b = &b[column..][..BLOCK];
            for (sums, row) in sums.iter_mut().zip(&rows) {
                let a = Lanes::splat(row[at]);
                for (sums, b) in sums.iter_mut().zip(b.chunks_exact(LANES)) {
                    *sums = sums.add(a.multiply(Lanes::load(b, 0.0)));
                }
            }
        }
        for (row, sums) in sums.iter().enumerate() {
            for (group, sums) in sums.iter().enumerate() {
                put(row, column + group * LANES, *sums);
            }
        }
    }
}

/// Of the first `count` scores, in place; what is beyond becomes 0.
#[inline(always)]
fn softmax(scores: &mut [f32], count: usize) {
    scores[count..].fill(f32::NEG_INFINITY);
    let mut greatest = Lanes::splat(f32::NEG_INFINITY);
    for group in scores.chunks_exact(LANES) {
        greatest = greatest.max(Lanes::load(group, 0.0));
    }
    let greatest = Lanes::splat(greatest.greatest());
    let mut sums = Lanes::ZERO;
    for group in scores.chunks_exact_mut(LANES) {
        let power = exp(&Lanes::load(group, 0.0).subtract(greatest));
        sums = sums.add(power);
        group.copy_from_slice(&power.0);
    }
    let share = Lanes::splat(1.0 / sums.sum());
    for group in scores.chunks_exact_mut(LANES) {
        let share = Lanes::load(group, 0.0).multiply(share);
        group.copy_from_slice(&share.0);
    }
}
