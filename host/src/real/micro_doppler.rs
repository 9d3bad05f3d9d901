//! From a spectrogram to the maps of the radar's branch: what a movement's speeds are, and how often they come again.
//!
//! ```text
//! codes [Doppler][frames] --log2--> over the recording's floor, in parts of its height --rows pooled--> [32][frames]
//!     --windows of 6 s--> sorted over time: how much of the time a speed is that strong
//!                     --> power at each cadence: the cadence-velocity diagram (Björklund et al. 2012)
//! ```
//!
//! When something is done within the window matters to neither, how strong the echo is hardly.

use std::f32::consts::TAU;

use ndarray::{Array2, ArrayView2, ArrayView3, Axis};
use rfhoi_firmware::dsp::window;

use super::radar::POINTS;
use crate::motion::percentile;

/// Frames of a window, 6.2 s at 7.8 frames a second, and from one to the next.
const WINDOW: usize = 48;
const HOP: usize = 6;
/// Cadences of neighbouring columns differ by so much of a frame's rate: 0.098 Hz at 7.8 frames a second.
const CADENCE: f32 = 1.0 / 80.0;
/// Share of a recording's cells below its floor, and of those below its height.
const FLOOR: f64 = 0.5;
const HEIGHT: f64 = 0.98;
/// A height of fewer octaves is noise.
const LEAST_HEIGHT: f32 = 0.5;
/// Codes of a height: twice of it still fits. And where it is that of a cadence's mean over a window: a row that goes from floor to
/// height and back at one cadence has 1 / pi of it, 153 codes.
const CODES_OF_HEIGHT: f32 = 122.0;
const CODES_OF_CADENCE: f32 = 480.0;

/// Frames of three maps: of the low band what is sorted and its cadences, of the high band its cadences.
///
/// `both` is `[Doppler][frames][high band, low band]` of amplitudes.
pub(super) fn frames(both: ArrayView3<'_, u8>) -> Vec<Vec<u8>> {
    let [high, low] = [0, 1].map(|band| pooled(&over_floor(both.index_axis(Axis(2), band))));
    let count = low.dim().1;
    // What is shorter than a window is one.
    let starts = (0..).map(|number| number * HOP).take_while(|start| *start == 0 || start + WINDOW <= count);
    starts
        .map(|start| {
            let times = start..(start + WINDOW).min(count);
            let mut maps = Vec::with_capacity(3 * POINTS * POINTS);
            let window = |band: &Array2<f32>| -> Vec<Vec<f32>> {
                band.outer_iter()
                    .map(|row| row.iter().copied().take(times.end).skip(times.start).collect())
                    .collect()
            };
            let (low, high) = (window(&low), window(&high));
            low.iter().for_each(|row| sorted(row.clone(), &mut maps));
            low.iter().chain(&high).for_each(|row| cadences(row, &mut maps));
            maps
        })
        .collect()
}

/// Octaves over the recording's floor, in parts of its height.
fn over_floor(codes: ArrayView2<'_, u8>) -> Array2<f32> {
    let mut octaves = codes.mapv(|code| (1.0 + f32::from(code)).log2());
    let level = |share| percentile(octaves.iter().copied().collect(), share).unwrap_or(0.0);
    let floor = level(FLOOR);
    let height = (level(HEIGHT) - floor).max(LEAST_HEIGHT);
    octaves.mapv_inplace(|octaves| (octaves - floor).max(0.0) / height);
    octaves
}

/// Mean of neighbouring rows, so that there are as many as a map has.
fn pooled(cells: &Array2<f32>) -> Array2<f32> {
    let each = cells.dim().0 / POINTS;
    Array2::from_shape_fn((POINTS, cells.dim().1), |(row, time)| {
        (0..each).map(|n| cells[(row * each + n, time)]).sum::<f32>() / each as f32
    })
}

/// A row's values from the least to the most.
fn sorted(mut row: Vec<f32>, maps: &mut Vec<u8>) {
    row.sort_by(f32::total_cmp);
    let last = (row.len() - 1) as f32;
    maps.extend((0..POINTS).map(|column| {
        let place = last * column as f32 / (POINTS - 1) as f32;
        let (below, above) = (row[place as usize], row[(place as usize + 1).min(row.len() - 1)]);
        (CODES_OF_HEIGHT * (below + place.fract() * (above - below))) as u8
    }));
}

/// A row's amplitudes at the cadences.
fn cadences(row: &[f32], maps: &mut Vec<u8>) {
    let mean = row.iter().sum::<f32>() / row.len() as f32;
    let mut weights = vec![0.0; row.len()];
    window::hann(&mut weights, 1.0);
    let moved: Vec<f32> = row.iter().zip(&weights).map(|(value, weight)| weight * (value - mean)).collect();
    maps.extend((1..=POINTS).map(|column| {
        let turn = TAU * CADENCE * column as f32;
        let sum = |part: fn(f32) -> f32| -> f32 {
            moved.iter().enumerate().map(|(time, value)| value * part(turn * time as f32)).sum()
        };
        (CODES_OF_CADENCE * sum(f32::cos).hypot(sum(f32::sin))) as u8
    }));
}

#[cfg(test)]
mod tests {
    use ndarray::Array3;

    use super::*;

    const SIZE: usize = POINTS * POINTS;

    /// Both bands: in a row and the next a movement that comes again every eight frames.
    fn comes_again(row: usize, strength: u8) -> Array3<u8> {
        Array3::from_shape_fn((128, 78, 2), |(at, time, _)| {
            if at / 8 == row / 2 && time % 8 < 4 { strength } else { 3 + (at * 7 + time * 3) as u8 % 2 }
        })
    }

    #[test]
    fn a_speed_that_comes_again_shows_at_its_cadence() {
        let frames = frames(comes_again(20, 200).view());
        assert_eq!(frames.len(), 6);
        for maps in &frames {
            for map in [1, 2] {
                let map = &maps[map * SIZE..(map + 1) * SIZE];
                let (place, most) = map.iter().enumerate().max_by_key(|(_, code)| **code).unwrap();
                // One in eight frames is ten times 1 / 80.
                assert_eq!(((place / POINTS) & !1, place % POINTS), (20, 9));
                assert!(*most > 100, "{most}");
            }
            assert!(maps[20 * POINTS..21 * POINTS].is_sorted());
            // Half of the time it is there.
            assert!(maps[20 * POINTS + 4] < 20 && maps[20 * POINTS + 28] > 100);
        }
    }

    #[test]
    fn how_strong_it_is_hardly_matters() {
        let [weak, strong] = [100, 200].map(|strength| frames(comes_again(6, strength).view()));
        for (weak, strong) in weak.iter().flatten().zip(strong.iter().flatten()) {
            assert!(weak.abs_diff(*strong) <= 12, "{weak} {strong}");
        }
        let none = frames(Array3::zeros((128, 20, 2)).view());
        assert_eq!(none.len(), 1, "what is short is one window");
        assert!(none[0].iter().all(|code| *code == 0));
    }
}
