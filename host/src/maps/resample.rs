//! A map of any size to a square one, from 0 to 1.
//!
//! Each axis has its weights: between cells' centres linear interpolation where the map grows, the mean over what a point
//! covers where it shrinks. Columns go first, row by row, since there are fewer rows than points; then rows, which are
//! contiguous.

use pulp::{Simd, WithSimd};
use rfhoi_firmware::dsp::level;
use rfhoi_shared::wire::LogScale;

use super::flaw::{Flaw, MapState};
use super::unit;
use crate::receive::HeatMap;

/// Least points of a map's side.
pub const MIN_POINTS: usize = 16;
/// Most points of a map's side: the paper's.
pub const MAX_POINTS: usize = 256;

/// Neighbouring rows that are filled from those around them, at most: an echo is as wide as the window's main lobe, four
/// bins, so it still shows on both sides of a gap of one.
const MAX_ROWS_FILLED: usize = 1;
/// Share of cells under the noise's level, whatever else is in the map.
const FLOOR_SHARE: f32 = 0.25;

/// A side of a map that is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("maps of {0} points a side: need {MIN_POINTS} to {MAX_POINTS}")]
pub struct PointsOutside(pub usize);

/// Where the levels of a map come from.
#[derive(Debug, Clone, Copy)]
pub enum Levels<'a> {
    /// A bridge's codes.
    Codes(&'a HeatMap),
    /// Powers relative to a full-scale tone, row by row.
    Powers(&'a [f32]),
}

/// The weights of one axis.
#[derive(Debug, Clone)]
struct Axis {
    /// First cell of each point.
    first: Vec<usize>,
    /// Weights by point, then cell; they sum to 1.
    weights: Vec<f32>,
    /// Cells of each point.
    taps: usize,
}

impl Axis {
    /// From `cells` to `points`, both at least 1.
    fn new(cells: usize, points: usize) -> Self {
        let step = cells as f64 / points as f64;
        // What a point covers, at least as wide as a cell: overlapped with cells this interpolates linearly.
        let width = step.max(1.0);
        let spans: Vec<[f64; 2]> = (0..points)
            .map(|p| (p as f64 + 0.5) * step)
            .map(|centre| [centre - width / 2.0, centre + width / 2.0])
            .collect();
        let edge = cells as f64;
        let cover = |[from, to]: [f64; 2]| {
            let first = from.max(0.0).floor() as usize;
            (first, (to.min(edge).ceil() as usize).max(first + 1) - first)
        };
        let taps = spans.iter().map(|&s| cover(s).1).max().unwrap_or(1).min(cells);
        let mut axis = Self { first: Vec::new(), weights: Vec::new(), taps };
        for span in spans {
            let first = cover(span).0.min(cells - taps);
            let overlap = |cell: usize| {
                // The outermost cells go on for ever.
                let from = if cell == 0 { f64::NEG_INFINITY } else { cell as f64 };
                let to = if cell + 1 == cells { f64::INFINITY } else { cell as f64 + 1.0 };
                (span[1].min(to) - span[0].max(from)).max(0.0) / width
            };
            axis.first.push(first);
            axis.weights.extend((first..first + taps).map(|cell| overlap(cell) as f32));
        }
        axis
    }

    /// One row of cells to points.
    fn row(&self, cells: &[f32], out: &mut [f32]) {
        let points = out.iter_mut().zip(&self.first);
        match self.taps {
            1 => points.for_each(|(out, &first)| *out = cells[first]),
            2 => points.zip(self.weights.as_chunks::<2>().0).for_each(|((out, &first), [a, b])| {
                if let Some([x, y]) = cells.get(first..first + 2) {
                    *out = a * x + b * y;
                }
            }),
            taps => points.zip(self.weights.chunks_exact(taps)).for_each(|((out, &first), weights)| {
                *out = weights.iter().zip(&cells[first..]).map(|(w, x)| w * x).sum();
            }),
        }
    }
}

/// Maps of one size to squares. Nothing is allocated after [`Self::new`].
#[derive(Debug, Clone)]
pub struct Resampler {
    rows: Axis,
    columns: Axis,
    shape: [usize; 2],
    points: usize,
    rise_db: f32,
    arch: pulp::Arch,
    /// Levels in codes, row by row.
    levels: Vec<f32>,
    /// Rows of cells by points.
    widened: Vec<f32>,
}

impl Resampler {
    /// From `rows` x `columns` cells to `points` x `points`. The strongest cell of a map with anything in it rises over its
    /// noise by `rise_db`.
    ///
    /// # Errors
    /// If there cannot be so few or many points.
    pub fn new(rows: usize, columns: usize, points: usize, rise_db: f32) -> Result<Self, PointsOutside> {
        if !(MIN_POINTS..=MAX_POINTS).contains(&points) {
            return Err(PointsOutside(points));
        }
        let (rows, columns) = (rows.max(1), columns.max(1));
        Ok(Self {
            rows: Axis::new(rows, points),
            columns: Axis::new(columns, points),
            shape: [rows, columns],
            points,
            rise_db,
            arch: pulp::Arch::new(),
            levels: vec![0.0; rows * columns],
            widened: vec![0.0; rows * points],
        })
    }

    /// Writes the square of a map to `out`: range from near to far, then columns in their order. It is all zeros where
    /// [`Flaw::is_blank`].
    pub fn map(&mut self, levels: Levels<'_>, out: &mut [f32]) -> MapState {
        let state = self.levels(levels, out.len());
        if state.flaw.is_some_and(Flaw::is_blank) {
            out.fill(0.0);
        } else {
            self.widen();
            let Self { rows, widened, points, .. } = self;
            // In the widest registers that the machine has.
            self.arch.dispatch(Stretch { rows, source: widened, points: *points, out });
        }
        state
    }

    /// Takes the levels and judges them.
    fn levels(&mut self, levels: Levels<'_>, out: usize) -> MapState {
        let [rows, columns] = self.shape;
        let mut counts = [0u32; 256];
        let (scale, fits) = match levels {
            Levels::Codes(map) => (
                map.scale,
                (map.arrived.len(), map.columns) == (rows, columns) && map.codes.len() == rows * columns,
            ),
            Levels::Powers(powers) => (level::SCALE, powers.len() == rows * columns),
        };
        if !fits || out != self.points * self.points {
            return MapState::none(Flaw::Shape);
        }
        let mut rows_filled = 0;
        match levels {
            Levels::Codes(map) => {
                let of_rows = map.codes.chunks_exact(columns).zip(&map.arrived);
                for ((codes, _), levels) in
                    of_rows.zip(self.levels.chunks_exact_mut(columns)).filter(|((_, arrived), _)| **arrived)
                {
                    for (level, &code) in levels.iter_mut().zip(codes) {
                        *level = code.into();
                        counts[usize::from(code)] += 1;
                    }
                }
                match self.fill(&map.arrived) {
                    Some(filled) => rows_filled = filled,
                    None => return MapState::none(Flaw::RowsMissing),
                }
            }
            Levels::Powers(powers) => {
                let levels = &mut self.levels;
                self.arch.dispatch(|| {
                    for (level, &power) in levels.iter_mut().zip(powers) {
                        *level = code_level(power);
                    }
                });
                for level in &self.levels {
                    counts[usize::from(*level as u8)] += 1;
                }
            }
        }
        let LogScale { step_db, .. } = scale;
        let (floor, peak) = floor_and_peak(&counts);
        let flaw = if counts[usize::from(u8::MAX)] > 0 {
            Some(Flaw::Clipped)
        } else {
            (f32::from(peak - floor) * step_db < self.rise_db).then_some(Flaw::Empty)
        };
        MapState { flaw, rows_filled, floor_db: scale.level_db(floor), peak_db: scale.level_db(peak) }
    }

    /// Fills rows that did not arrive from those around them. Returns how many, or `None` where there are too many.
    fn fill(&mut self, arrived: &[bool]) -> Option<usize> {
        let columns = self.shape[1];
        let mut filled = 0;
        let mut start = 0;
        while let Some(gap) = arrived[start..].iter().position(|a| !a).map(|at| start + at) {
            let length = arrived[gap..].iter().take_while(|a| !**a).count();
            let (before, after) = (gap.checked_sub(1), Some(gap + length).filter(|&r| r < arrived.len()));
            if length > MAX_ROWS_FILLED {
                return None;
            }
            let (before, after) = (before.or(after)?, after.or(before)?);
            for row in gap..gap + length {
                let share = (row + 1 - gap) as f32 / (length + 1) as f32;
                for column in 0..columns {
                    let [a, b] = [before, after].map(|r| self.levels[r * columns + column]);
                    self.levels[row * columns + column] = a + (b - a) * share;
                }
            }
            filled += length;
            start = gap + length;
        }
        Some(filled)
    }

    /// Resamples the columns.
    fn widen(&mut self) {
        let Self { columns, shape, points, levels, widened, .. } = self;
        for (cells, wide) in levels.chunks_exact(shape[1]).zip(widened.chunks_exact_mut(*points)) {
            columns.row(cells, wide);
        }
    }
}

/// Resamples rows and brings all to 0 to 1.
struct Stretch<'a> {
    rows: &'a Axis,
    /// Rows of cells by points.
    source: &'a [f32],
    points: usize,
    out: &'a mut [f32],
}

impl WithSimd for Stretch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { rows, source, points, out } = self;
        let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
        let (mut leasts, mut mosts) = (simd.splat_f32s(least), simd.splat_f32s(most));
        let of_rows = rows.first.iter().zip(rows.weights.chunks_exact(rows.taps));
        for (out, (&first, weights)) in out.chunks_exact_mut(points).zip(of_rows) {
            let sources = || source[first * points..].chunks_exact(points);
            let (registers, rest) = S::as_mut_simd_f32s(out);
            for (i, out) in registers.iter_mut().enumerate() {
                let mut sum = simd.splat_f32s(0.0);
                for (source, &weight) in sources().zip(weights) {
                    let x = S::as_simd_f32s(source).0[i];
                    sum = simd.mul_add_e_f32s(simd.splat_f32s(weight), x, sum);
                }
                *out = sum;
                (leasts, mosts) = (simd.min_f32s(leasts, sum), simd.max_f32s(mosts, sum));
            }
            let done = points - rest.len();
            for (i, out) in rest.iter_mut().enumerate() {
                *out = sources().zip(weights).map(|(source, weight)| weight * source[done + i]).sum();
                (least, most) = (least.min(*out), most.max(*out));
            }
        }
        least = least.min(simd.reduce_min_f32s(leasts));
        most = most.max(simd.reduce_max_f32s(mosts));
        unit::stretch(simd, least, most, out);
    }
}

/// `level::code` without its rounding to a whole code.
#[inline(always)]
fn code_level(power: f32) -> f32 {
    const PER_OCTAVE: f32 = level::DB_PER_OCTAVE / level::SCALE.step_db;
    const OFFSET: f32 = -level::SCALE.floor_db / level::SCALE.step_db;
    let code = level::log2(power) * PER_OCTAVE + OFFSET;
    // Plain comparisons, which there are instructions for.
    let code = if code > 0.0 { code } else { 0.0 };
    if code < 255.0 { code } else { 255.0 }
}

/// The noise's code and the strongest cell's, given how often each code is there.
fn floor_and_peak(counts: &[u32; 256]) -> (u8, u8) {
    let under = (counts.iter().sum::<u32>() as f32 * FLOOR_SHARE) as u32;
    let mut sum = 0;
    let floor = counts.iter().take_while(|&&c| {
        sum += c;
        sum <= under
    });
    let peak = counts.iter().rposition(|&c| c > 0).unwrap_or(0);
    ((floor.count().min(peak)) as u8, peak as u8)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rfhoi_shared::radar::RangeGate;

    use super::*;

    fn heat_map(rows: usize, columns: usize, codes: impl Fn(usize, usize) -> u8) -> HeatMap {
        HeatMap {
            gate: RangeGate { first: 0, bins: rows as u16 },
            columns,
            scale: level::SCALE,
            codes: (0..rows * columns).map(|i| codes(i / columns, i % columns)).collect(),
            arrived: vec![true; rows],
        }
    }

    #[test]
    fn axes_interpolate_and_take_means() {
        let grow = Axis::new(2, 4);
        let mut out = [0.0; 4];
        grow.row(&[0.0, 4.0], &mut out);
        assert_eq!(out, [0.0, 1.0, 3.0, 4.0]);
        let shrink = Axis::new(4, 2);
        let mut out = [0.0; 2];
        shrink.row(&[1.0, 3.0, 5.0, 9.0], &mut out);
        assert_eq!(out, [2.0, 7.0]);
        let third = Axis::new(3, 2);
        third.row(&[3.0, 6.0, 9.0], &mut out);
        assert_eq!(out, [4.0, 8.0]);
        assert_eq!(Axis::new(5, 5).taps, 1);
    }

    proptest! {
        #[test]
        fn weights_sum_to_one_and_stay_within(cells in 1usize..300, points in 16usize..=256) {
            let axis = Axis::new(cells, points);
            for (&first, weights) in axis.first.iter().zip(axis.weights.chunks_exact(axis.taps)) {
                prop_assert!(first + axis.taps <= cells);
                prop_assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
            }
            // A ramp stays one, to within half a cell where cells are taken together.
            let tolerance = if cells > points { 0.5 } else { 1e-3 * cells as f32 };
            let ramp: Vec<f32> = (0..cells).map(|i| i as f32 + 0.5).collect();
            let mut out = vec![0.0; points];
            axis.row(&ramp, &mut out);
            let step = cells as f32 / points as f32;
            for (p, x) in out.iter().enumerate() {
                let want = ((p as f32 + 0.5) * step).clamp(0.5, cells as f32 - 0.5);
                prop_assert!((x - want).abs() < tolerance, "{} at {}, not {}", x, p, want);
            }
        }
    }

    #[test]
    fn a_map_goes_from_zero_to_one_with_its_peak_in_place() {
        for points in [16, 64, 200, 256] {
            let mut resampler = Resampler::new(72, 64, points, 12.0).unwrap();
            let map =
                heat_map(72, 64, |r, c| if (r, c) == (18, 48) { 200 } else { 60 + (r * 7 + c) as u8 % 4 });
            let mut out = vec![f32::NAN; points * points];
            let state = resampler.map(Levels::Codes(&map), &mut out);
            assert_eq!(state.flaw, None);
            assert_eq!(state.peak_db, -30.0);
            let least = out.iter().copied().fold(f32::INFINITY, f32::min);
            let (at, &most) = out.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
            assert!(least == 0.0 && (most - 1.0).abs() < 1e-6);
            let share = |i: usize| (i as f64 + 0.5) / points as f64;
            assert!((share(at / points) - 18.5 / 72.0).abs() < 1.0 / points as f64);
            assert!((share(at % points) - 48.5 / 64.0).abs() < 1.0 / points as f64);
        }
        assert!(Resampler::new(72, 64, 15, 12.0).is_err() && Resampler::new(72, 64, 257, 12.0).is_err());
    }

    #[test]
    fn maps_that_mean_nothing_are_zeros_with_a_reason() {
        let mut resampler = Resampler::new(72, 64, 64, 12.0).unwrap();
        let mut out = vec![1.0; 64 * 64];
        let noise = heat_map(72, 64, |r, c| 60 + (r * 13 + c * 7) as u8 % 20);
        let state = resampler.map(Levels::Codes(&noise), &mut out);
        assert_eq!(state.flaw, Some(Flaw::Empty));
        assert!(out.iter().all(|&x| x == 0.0));
        let other = heat_map(72, 32, |_, _| 0);
        assert_eq!(resampler.map(Levels::Codes(&other), &mut out).flaw, Some(Flaw::Shape));
        let loud = heat_map(72, 64, |r, _| if r == 3 { 255 } else { 60 });
        assert_eq!(resampler.map(Levels::Codes(&loud), &mut out).flaw, Some(Flaw::Clipped));
        assert_eq!(resampler.map(Levels::Codes(&loud), &mut [0.0; 7]).flaw, Some(Flaw::Shape));
    }

    #[test]
    fn few_missing_rows_are_filled_and_many_are_not() {
        let mut resampler = Resampler::new(72, 64, 64, 12.0).unwrap();
        let whole = heat_map(72, 64, |r, c| (r * 3) as u8 + u8::from(c == 5));
        let mut want = vec![0.0; 64 * 64];
        resampler.map(Levels::Codes(&whole), &mut want);
        let mut out = want.clone();
        let mut lossy = whole.clone();
        for row in [10, 12, 40] {
            lossy.arrived[row] = false;
            lossy.codes[row * 64..(row + 1) * 64].fill(0);
        }
        let state = resampler.map(Levels::Codes(&lossy), &mut out);
        assert_eq!((state.flaw, state.rows_filled), (None, 3));
        for (got, want) in out.iter().zip(&want) {
            assert!((got - want).abs() < 1e-5, "a slope is filled as it was");
        }
        lossy.arrived[11] = false;
        assert_eq!(resampler.map(Levels::Codes(&lossy), &mut out).flaw, Some(Flaw::RowsMissing));
        lossy.arrived.fill(false);
        assert_eq!(resampler.map(Levels::Codes(&lossy), &mut out).flaw, Some(Flaw::RowsMissing));
    }

    #[test]
    fn powers_and_their_codes_give_the_same_map() {
        let power = |i: usize| level::power_of_db(-110.0 + ((i * 37) % 90) as f32);
        let powers: Vec<f32> = (0..72 * 64).map(power).collect();
        let map = heat_map(72, 64, |r, c| level::code(power(r * 64 + c)));
        let mut resampler = Resampler::new(72, 64, 128, 12.0).unwrap();
        let (mut of_codes, mut of_powers) = (vec![0.0; 128 * 128], vec![0.0; 128 * 128]);
        let a = resampler.map(Levels::Codes(&map), &mut of_codes);
        let b = resampler.map(Levels::Powers(&powers), &mut of_powers);
        assert!((a.peak_db - b.peak_db).abs() <= 0.5 && (a.floor_db - b.floor_db).abs() <= 0.5);
        // Half a code of 180.
        assert!(of_codes.iter().zip(&of_powers).all(|(a, b)| (a - b).abs() < 0.006));
    }
}
