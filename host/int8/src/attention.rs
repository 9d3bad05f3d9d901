//! Attention of all rows to all rows, head by head, in floats: `softmax(q k^T / sqrt(d)) v`.

use std::ops::Range;

use crate::isa::{Isa, LANES, Work};
use crate::lanes::exp;
use crate::out::Sink;

/// Rows of queries at once: by a group of lanes of two registers, or two of one, that is eight sums that do not wait for each
/// other.
const QUERIES: usize = 4;

/// Of a row, a group of columns.
type Group = [f32; LANES];

#[derive(Debug)]
pub(crate) struct Attention<'a> {
    /// `[rows][3 * width]`: queries, keys, values, heads one after the other in each.
    pub(crate) qkv: &'a [f32],
    pub(crate) rows: usize,
    pub(crate) width: usize,
    pub(crate) heads: usize,
    /// As [`scratch`] says: the keys, `[groups of rows][d]`, the values, `[groups of d][rows]`, and the scores of a few queries.
    pub(crate) scratch: &'a mut [f32],
    /// `[rows][width]`.
    pub(crate) sink: Sink<'a>,
}

/// Floats of scratch: a head's keys transposed, its values, and scores of [`QUERIES`], all in whole groups.
pub(crate) fn scratch(rows: usize, width: usize, heads: usize) -> usize {
    let (d, columns) = (width / heads, rows.next_multiple_of(LANES));
    d * columns + rows * d.next_multiple_of(LANES) + QUERIES * columns
}

impl Work for Attention<'_> {
    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let (rows, width) = (self.rows, self.width);
        let d = width / self.heads;
        let (columns, depth) = (rows.next_multiple_of(LANES), d.next_multiple_of(LANES));
        // A group's columns of all k lie together: rows a power of two apart would meet in the cache.
        let (keys, scratch) = self.scratch.split_at_mut(d * columns);
        let (values, scores) = scratch.split_at_mut(rows * depth);
        let keys: &mut [Group] = keys.as_chunks_mut().0;
        let values: &mut [Group] = values.as_chunks_mut().0;
        let scale = isa.splat(1.0 / (d as f32).sqrt());
        for head in 0..self.heads {
            let (q, k, v) = (head * d, width + head * d, 2 * width + head * d);
            for (row, tokens) in self.qkv.chunks_exact(3 * width).enumerate() {
                let column = &mut keys[row / LANES * d..][..d];
                for (keys, &key) in column.iter_mut().zip(&tokens[k..][..d]) {
                    keys[row % LANES] = key;
                }
                let groups = values.iter_mut().skip(row).step_by(rows);
                for (values, value) in groups.zip(tokens[v..][..d].chunks(LANES)) {
                    values[..value.len()].copy_from_slice(value);
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
                let mut to = Scores { scores: &mut *scores, columns, scale };
                products(isa, &queries, keys, &mut to);
                softmax(isa, scores, rows);
                let mut shares: [&[f32]; QUERIES] = [&[]; QUERIES];
                for (share, scores) in shares.iter_mut().zip(scores.chunks_exact(columns)) {
                    *share = &scores[..rows];
                }
                let mut to = Seen { sink: self.sink, rows: start..rows, width, head: q..q + d };
                products(isa, &shares, values, &mut to);
            }
        }
    }
}

/// Where products of the queries with a group of columns go.
trait To<I: Isa> {
    fn put(&mut self, isa: I, group: usize, sums: [I::Floats; QUERIES]);
}

/// Scores before the softmax, `[QUERIES][columns]`.
struct Scores<'a, I: Isa> {
    scores: &'a mut [f32],
    columns: usize,
    scale: I::Floats,
}

impl<I: Isa> To<I> for Scores<'_, I> {
    #[inline(always)]
    fn put(&mut self, isa: I, group: usize, sums: [I::Floats; QUERIES]) {
        for (scores, sums) in self.scores.chunks_exact_mut(self.columns).zip(sums) {
            scores.as_chunks_mut().0[group] = isa.store(isa.multiply(sums, self.scale));
        }
    }
}

/// What the queries have seen: rows of the output, `width` wide, a head's part of them.
struct Seen<'a> {
    sink: Sink<'a>,
    rows: Range<usize>,
    width: usize,
    head: Range<usize>,
}

impl<I: Isa> To<I> for Seen<'_> {
    #[inline(always)]
    fn put(&mut self, isa: I, group: usize, sums: [I::Floats; QUERIES]) {
        let column = self.head.start + group * LANES;
        let count = LANES.min(self.head.end - column);
        for (row, sums) in self.rows.clone().zip(sums) {
            // SAFETY: one thread runs all of it; there are `rows` by `width`.
            unsafe { self.sink.store(isa, row * self.width + column, sums, count) };
        }
    }
}

/// Rows of k numbers by all groups of columns, `[groups][k]`.
#[inline(always)]
fn products<I: Isa>(isa: I, rows: &[&[f32]; QUERIES], columns: &[Group], to: &mut impl To<I>) {
    let k = rows[0].len();
    let mut groups = columns.chunks_exact(k).enumerate();
    if I::EIGHT_SUMS {
        while groups.len() >= 2 {
            let (Some((number, one)), Some((_, other))) = (groups.next(), groups.next()) else { return };
            let [one, other] = product(isa, rows, [one, other]);
            to.put(isa, number, one);
            to.put(isa, number + 1, other);
        }
    }
    for (number, group) in groups {
        let [sums] = product(isa, rows, [group]);
        to.put(isa, number, sums);
    }
}

/// Rows of k numbers by some groups of columns.
#[inline(always)]
fn product<I: Isa, const G: usize>(
    isa: I,
    rows: &[&[f32]; QUERIES],
    groups: [&[Group]; G],
) -> [[I::Floats; QUERIES]; G] {
    let k = rows[0].len();
    let (mut a, mut b) = (*rows, groups);
    for row in &mut a {
        *row = &row[..k];
    }
    for group in &mut b {
        *group = &group[..k];
    }
    let mut sums = [[isa.splat(0.0); QUERIES]; G];
    for at in 0..k {
        for group in 0..G {
            let b = isa.floats(&b[group][at]);
            for row in 0..QUERIES {
                sums[group][row] = isa.fused(isa.splat(a[row][at]), b, sums[group][row]);
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
