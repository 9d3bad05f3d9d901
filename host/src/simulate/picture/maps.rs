//! The radar's maps: of one frame, and over time.

use ndarray::{Array2, Axis as Dim, concatenate};

use super::{Moment, Sample};
use crate::plot::{Axis, ColourScale, Heatmap, Panel, Reduce};

/// Colours span at most so much down from the strongest cell, dB; the weaker half of all cells is darkest in any case.
const SPAN_DB: f32 = 60.0;

/// Maps of a sample, each kind with one scale.
pub(super) struct Maps<'s> {
    sample: &'s Sample,
    range_doppler: (f32, f32),
    range_time: (f32, f32),
    angles: (f32, f32),
}

type Map = fn(&Moment) -> &Array2<f32>;

impl<'s> Maps<'s> {
    pub(super) fn new(sample: &'s Sample) -> Self {
        let range = |map: Map| levels(sample.moments.iter().flat_map(|m| map(m).iter().copied()));
        Self {
            sample,
            range_doppler: range(|m| &m.range_doppler),
            range_time: range(|m| &m.range_time),
            angles: range(|m| &m.angles),
        }
    }

    /// Number of the moment with most motion: the most power, weighted with speed.
    pub(super) fn liveliest(&self) -> usize {
        let motion = |moment: &Moment| -> f64 {
            let zero = moment.range_doppler.ncols() / 2;
            let cells = moment.range_doppler.indexed_iter().filter(|(_, level)| level.is_finite());
            cells.map(|((_, d), &level)| d.abs_diff(zero) as f64 * 10_f64.powf(f64::from(level) / 10.0)).sum()
        };
        let motions = self.sample.moments.iter().map(motion).enumerate();
        // The first of equals.
        motions.rev().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(n, _)| n)
    }

    pub(super) fn range_doppler(&self, moment: usize, title: String) -> Panel {
        let values = self.map(moment, |m| &m.range_doppler);
        heatmap(title, values, (self.velocity(), self.range()), self.range_doppler)
    }

    pub(super) fn range_time(&self, moment: usize, title: String) -> Panel {
        let start = moment as f64 * self.sample.frame_s;
        let time = Axis::new("time", "s", start, start + self.sample.frame_s);
        let values = self.map(moment, |m| &m.range_time);
        heatmap(title, values, (time, self.range()), self.range_time)
    }

    pub(super) fn angles(&self, moment: usize, title: String) -> Panel {
        let (from, to) = self.sample.axes.elevation_deg;
        let elevation = Axis::new("elevation", "deg", from, to);
        heatmap(title, self.map(moment, |m| &m.angles), (self.azimuth(), elevation), self.angles)
    }

    /// Range over all frames, with the interaction marked, or a moment.
    pub(super) fn range_over_time(&self, now_s: Option<f64>) -> Panel {
        let rows: Vec<_> = self.sample.moments.iter().map(|m| m.range_time.view()).collect();
        let values = concatenate(Dim(1), &rows).unwrap_or_default();
        let time = time_axis(self.sample, now_s);
        let marked = now_s.is_none() && self.sample.interaction_s.is_some();
        let title = if marked { "Range over time (dashed: interaction)" } else { "Range over time" };
        heatmap(title.into(), values, (time, self.range()), self.range_time)
    }

    /// Velocity over all frames: the strongest range.
    pub(super) fn velocity_over_time(&self) -> Panel {
        let values = self.strongest_over_time(|m| &m.range_doppler);
        let title = "Velocity over time, strongest range".into();
        heatmap(title, values, (time_axis(self.sample, None), self.velocity()), self.range_doppler)
    }

    /// Azimuth over all frames: the strongest elevation.
    pub(super) fn azimuth_over_time(&self) -> Panel {
        let values = self.strongest_over_time(|m| &m.angles);
        let title = "Azimuth over time, strongest elevation".into();
        heatmap(title, values, (time_axis(self.sample, None), self.azimuth()), self.angles)
    }

    fn map(&self, moment: usize, map: Map) -> Array2<f32> {
        self.sample.moments.get(moment).map(|m| map(m).clone()).unwrap_or_default()
    }

    /// The largest value of each column of a map, one column of the picture for each moment.
    fn strongest_over_time(&self, map: Map) -> Array2<f32> {
        let moments = &self.sample.moments;
        let rows = moments.first().map_or(0, |m| map(m).ncols());
        Array2::from_shape_fn((rows, moments.len()), |(row, moment)| {
            let map = map(&moments[moment]);
            (0..map.nrows()).filter_map(|r| map.get((r, row))).copied().fold(f32::NAN, f32::max)
        })
    }

    fn range(&self) -> Axis {
        let (from, to) = self.sample.axes.range_m;
        Axis::new("range", "m", from, to)
    }

    fn velocity(&self) -> Axis {
        let (from, to) = self.sample.axes.velocity_m_s;
        Axis::new("velocity", "m/s", from, to)
    }

    fn azimuth(&self) -> Axis {
        let (from, to) = self.sample.axes.azimuth_deg;
        Axis::new("azimuth", "deg", from, to)
    }
}

/// Time of the whole sample, with `now_s` marked, or else the interaction.
pub(super) fn time_axis(sample: &Sample, now_s: Option<f64>) -> Axis {
    let interaction = sample.interaction_s.map(|(from, to)| [from, to]);
    let marks = now_s.map_or_else(|| interaction.into_iter().flatten().collect(), |now| vec![now]);
    Axis::new("time", "s", 0.0, sample.duration_s()).with_marks(marks)
}

fn heatmap(title: String, values: Array2<f32>, (x, y): (Axis, Axis), range: (f32, f32)) -> Panel {
    let scale = ColourScale::new("level", "dB").with_range(range.0, range.1);
    Panel::Heatmap(Heatmap { title, values, x, y, scale, reduce: Reduce::Max })
}

/// From the median, or [`SPAN_DB`] under the largest, to the largest.
fn levels(values: impl Iterator<Item = f32>) -> (f32, f32) {
    let mut values: Vec<f32> = values.filter(|v| v.is_finite()).collect();
    let middle = values.len() / 2;
    if values.is_empty() {
        return (0.0, 1.0);
    }
    let median = *values.select_nth_unstable_by(middle, f32::total_cmp).1;
    let top = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    (median.max(top - SPAN_DB), top)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_begin_at_the_median_but_not_too_deep() {
        let noisy = (0..100).map(|n| n as f32 / 10.0).chain([50.0]);
        assert_eq!(levels(noisy), (5.0, 50.0));
        assert_eq!(levels([-200.0, -200.0, -200.0, 10.0].into_iter()), (-50.0, 10.0));
        assert_eq!(levels([f32::NAN].into_iter()), (0.0, 1.0));
    }
}
