//! What a sample looks like to the radar, and how far two samples are apart.

use ndarray::{Array2, ArrayView1};
use rfhoi::simulate::radar::{FrameMaps, Radar};
use rfhoi_firmware::dsp::level;

/// Steps of time of a profile.
const STEPS: usize = 32;
/// Levels count down to so much under the strongest one of a sample, dB.
const SPAN_DB: f32 = 40.0;
/// Steps that may be matched are at most so far apart.
const BAND: usize = 10;

/// Velocity over time: levels of the strongest range, by velocity and step of time, 0 to 1 over the upper [`SPAN_DB`].
pub(crate) type Profile = Array2<f32>;

/// Levels of the strongest range of each frame, dB: velocity x frame.
pub(crate) fn strongest_ranges(radar: &Radar, frames: &[FrameMaps]) -> Array2<f32> {
    let loops = usize::from(radar.config().profile.loops);
    Array2::from_shape_fn((loops, frames.len()), |(velocity, frame)| {
        let column = frames[frame].range_doppler.iter().skip(velocity).step_by(loops);
        column.map(|&code| level::SCALE.level_db(code)).fold(f32::NEG_INFINITY, f32::max)
    })
}

/// The profile of these levels, of whatever number of frames.
pub(crate) fn profile(levels: &Array2<f32>) -> Profile {
    let top = levels.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let last = levels.ncols() - 1;
    Array2::from_shape_fn((levels.nrows(), STEPS), |(velocity, step)| {
        let at = step as f32 * last as f32 / (STEPS - 1) as f32;
        let (before, share) = (at.floor() as usize, at.fract());
        let next = (before + 1).min(last);
        let level = levels[(velocity, before)] * (1.0 - share) + levels[(velocity, next)] * share;
        ((level - top) / SPAN_DB + 1.0).clamp(0.0, 1.0)
    })
}

/// How far two profiles are apart: the mean difference of levels, in shares of [`SPAN_DB`] of what is above the floor in either,
/// along the best match of their times (dynamic time warping; H. Sakoe, S. Chiba, IEEE Trans. ASSP 26, 1978). Time is warped
/// because people rest before and after for as long as they like, and do one part fast and another slowly.
pub(crate) fn distance(a: &Profile, b: &Profile) -> f32 {
    let cost = |i: usize, j: usize| -> [f32; 2] {
        let sum = |f: fn(f32, f32) -> f32| columns(a, b, i, j).map(|(x, y)| f(x, y)).sum();
        [sum(|x, y| (x - y).abs()), sum(f32::max)]
    };
    // Least sum of differences so far, with the sum of the larger levels along that way.
    let mut best = Array2::from_elem((STEPS, STEPS), [f32::INFINITY, 0.0]);
    for i in 0..STEPS {
        for j in i.saturating_sub(BAND)..(i + BAND + 1).min(STEPS) {
            let before = [(1, 1), (1, 0), (0, 1)].into_iter().filter_map(|(di, dj)| {
                let at = (i.checked_sub(di)?, j.checked_sub(dj)?);
                Some(best[at])
            });
            let before = before.min_by(|x, y| x[0].total_cmp(&y[0])).unwrap_or([0.0; 2]);
            let [difference, larger] = cost(i, j);
            best[(i, j)] = [before[0] + difference, before[1] + larger];
        }
    }
    let [difference, larger] = best[(STEPS - 1, STEPS - 1)];
    difference / larger
}

fn columns<'a>(a: &'a Profile, b: &'a Profile, i: usize, j: usize) -> impl Iterator<Item = (f32, f32)> {
    let values = |column: ArrayView1<'a, f32>| column.into_iter().copied();
    values(a.column(i)).zip(values(b.column(j)))
}
