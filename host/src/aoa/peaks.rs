//! Peaks of a map, and where they are between its points.

use pulp::{Simd, WithSimd};

use super::form::Form;
use super::grid::Grid;
use super::settings::MAX_PEAKS;

/// Steps of Newton's method, at most: three or four lead from a grid point to its peak, more along a ridge.
const STEPS: usize = 24;
/// Steps shorter than this are the last, in direction cosines.
const ENOUGH: f64 = 1e-6;
/// A peak is at most so many steps of the grid from its highest point.
const REACH: f64 = 3.0;
/// So many more points than peaks are refined.
const SPARE: usize = 3;
/// Peaks nearer to each other, in direction cosines, are the same.
const SAME: f64 = 1e-3;

/// A peak by its direction cosines.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Peak {
    pub(super) u: f64,
    pub(super) w: f64,
    /// The form there, or less it where small values are peaks.
    pub(super) height: f64,
    /// On the border of the grid, or drawn beyond it.
    pub(super) at_edge: bool,
}

/// Peaks of falling height; one more than can be given, to know how much lower the next is.
pub(super) type Peaks = heapless::Vec<Peak, { MAX_PEAKS + 1 }>;

/// Peaks of the map before they are refined: more than are wanted, as some may turn out the same. Height, place in the map.
type Highest = heapless::Vec<(f32, usize), { MAX_PEAKS + SPARE }>;

/// The highest peaks of `map`, at most `wanted` and one. `inverse`: they are minima of the form.
pub(super) fn find(grid: &Grid, form: &Form, map: &[f32], inverse: bool, wanted: usize) -> Peaks {
    let (columns, rows) = (grid.azimuth_deg.len(), grid.elevation_deg.len());
    let highest = grid.arch.dispatch(Search { map, columns });
    let mut peaks = Peaks::new();
    for &(_, place) in highest.iter().take(wanted + SPARE) {
        let (row, column) = (place / columns, place % columns);
        let border = column == 0 || column + 1 == columns || rows > 1 && (row == 0 || row + 1 == rows);
        let start = grid.direction(row, column);
        let Some((u, w, value)) = refine(form, start, inverse, rows > 1, grid.step()) else { continue };
        let height = if inverse { -value } else { value };
        if peaks.iter().any(|p| (p.u - u).abs().max((p.w - w).abs()) < SAME) {
            continue;
        }
        // Between points of the grid another may be higher.
        let rank = peaks.iter().position(|p| p.height < height).unwrap_or(peaks.len());
        if rank > wanted {
            continue;
        }
        if peaks.is_full() {
            peaks.pop();
        }
        let at_edge = border || grid.is_beyond(u, w);
        // There is room now.
        let _ = peaks.insert(rank, Peak { u, w, height, at_edge });
        peaks.truncate(wanted + 1);
    }
    peaks
}

/// All rows of a map.
struct Search<'a> {
    map: &'a [f32],
    columns: usize,
}

impl WithSimd for Search<'_> {
    type Output = Highest;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Highest {
        let Self { map, columns } = self;
        let mut highest = Highest::new();
        for start in (0..map.len()).step_by(columns) {
            let here = &map[start..start + columns];
            let below = if start > 0 { &map[start - columns..start] } else { here };
            let above = map.get(start + columns..start + 2 * columns).unwrap_or(here);
            maxima(here, below, above, |column| {
                let near = column.saturating_sub(1)..(column + 2).min(columns);
                if below[near.clone()].iter().chain(&above[near]).all(|&v| v <= here[column]) {
                    insert(&mut highest, (here[column], start + column));
                }
            });
        }
        highest
    }
}

/// Calls `found` for each column that is not lower than those on its four sides.
#[inline(always)]
fn maxima<'m>(here: &'m [f32], below: &'m [f32], above: &'m [f32], mut found: impl FnMut(usize)) {
    const BLOCK: usize = 16;
    let last = here.len() - 1;
    let is_peak = |i: usize| {
        let v = here[i];
        v >= below[i] && v >= above[i] && v >= here[i.saturating_sub(1)] && v > here[(i + 1).min(last)]
    };
    if here[last] > here[last - 1] && here[last] >= below[last] && here[last] >= above[last] {
        found(last);
    }
    if is_peak(0) {
        found(0);
    }
    // Most blocks have none: a look at all of a block at once.
    let mut first = 1;
    let block = |row: &'m [f32], start: usize| row.get(start..)?.first_chunk::<BLOCK>();
    while let (Some(v), Some(l), Some(r), Some(b), Some(a)) = (
        block(here, first),
        block(here, first - 1),
        block(here, first + 1),
        block(below, first),
        block(above, first),
    ) {
        let mut any = 0;
        for i in 0..BLOCK {
            any |= u32::from((v[i] >= l[i]) & (v[i] > r[i]) & (v[i] >= b[i]) & (v[i] >= a[i]));
        }
        if any != 0 {
            (first..first + BLOCK).filter(|&i| is_peak(i)).for_each(&mut found);
        }
        first += BLOCK;
    }
    (first..last).filter(|&i| is_peak(i)).for_each(&mut found);
}

fn insert<const N: usize>(highest: &mut heapless::Vec<(f32, usize), N>, peak: (f32, usize)) {
    let place = highest.iter().position(|p| p.0 < peak.0).unwrap_or(highest.len());
    if place == N {
        return;
    }
    if highest.is_full() {
        highest.pop();
    }
    // There is room now.
    let _ = highest.insert(place, peak);
}

/// Newton's method from a point of the grid, downhill: direction and value. `None` where that leads away: a ridge of a map too
/// coarse for it, or the slope of what is out of view.
fn refine(form: &Form, start: (f64, f64), inverse: bool, two: bool, step: f64) -> Option<(f64, f64, f64)> {
    let sign = if inverse { 1.0 } else { -1.0 };
    let (mut u, mut w) = start;
    let mut here = form.at(u, w);
    for _ in 0..STEPS {
        let [gu, gw] = here.gradient.map(|g| sign * g);
        let [mut uu, uw, mut ww] = here.curvature.map(|c| sign * c);
        let (mut du, mut dw) = if two {
            // On a ridge the curvature has a wrong sign: it is raised until all of it goes downhill.
            let least = (uu + ww) / 2.0 - ((uu - ww) / 2.0).hypot(uw);
            let most = (uu + ww) / 2.0 + ((uu - ww) / 2.0).hypot(uw);
            let lift = (1e-3 * most.abs().max(least.abs()) - least).max(0.0);
            (uu, ww) = (uu + lift, ww + lift);
            let determinant = uu * ww - uw * uw;
            ((uw * gw - ww * gu) / determinant, (uw * gu - uu * gw) / determinant)
        } else {
            (-gu / uu.abs(), 0.0)
        };
        let length = du.hypot(dw);
        if !length.is_finite() {
            return None;
        }
        if length > step {
            (du, dw) = (du * step / length, dw * step / length);
        }
        if (u + du - start.0).hypot(w + dw - start.1) > REACH * step {
            return None;
        }
        let next = form.at(u + du, w + dw);
        if sign * next.value >= sign * here.value {
            break;
        }
        (u, w, here) = (u + du, w + dw, next);
        if length < ENOUGH {
            break;
        }
    }
    Some((u, w, here.value))
}
