//! Radar frames over time as pictures and numbers.

use std::path::{Path, PathBuf};

use ndarray::{Array1, Array2, Array3, ArrayView2, Axis as Dim};
use num_complex::Complex32;
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::wire::Covariance;
use serde::Serialize;

use super::ReplayError;
use crate::aoa::{Estimator, Method, Settings, hermitian};
use crate::npz::Npz;
use crate::plot::{Axis, ColourScale, Figure, Heatmap, Lines, Panel, Reduce, Series, Style};
use crate::receive::{HeatMap, RadarFrame};

/// Points of the angle grid, each way: 2 degrees apart.
const ANGLES: usize = 61;
/// Colours of a picture span so much, dB, down from the strongest cell.
const SPAN_DB: f32 = 60.0;
/// The same of a picture of angles.
const ANGLE_SPAN_DB: f32 = 30.0;
/// Frames that are missing between two are shown as a gap of at most so many.
const LONGEST_GAP: u32 = 1_000;

/// The strongest range-Doppler cell outside zero Doppler.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Strongest {
    /// Number of the frame.
    pub frame: u32,
    /// Time of the frame.
    pub time_s: f64,
    /// Range.
    pub range_m: f32,
    /// Radial velocity, positive recedes.
    pub velocity_m_s: f32,
    /// Level.
    pub level_db: f32,
}

/// Frames as arrays over time; NaN where nothing arrived.
pub(super) struct RadarSeries<'f> {
    frames: &'f [RadarFrame],
    config: &'f RadarConfig,
    time_s: Array1<f64>,
    range_m: Array1<f32>,
    velocity_m_s: Array1<f32>,
    /// Frame x range x column.
    range_time: Option<Array3<f32>>,
    /// Frame x range x Doppler.
    range_doppler: Option<Array3<f32>>,
    angles: Option<Angles>,
}

/// Spectra over time, dB below the highest point of each: the maximum over the other angle; NaN where they are doubted.
struct Angles {
    azimuth_deg: Array1<f32>,
    elevation_deg: Array1<f32>,
    /// Frame x azimuth.
    azimuth: Array2<f32>,
    /// Frame x elevation.
    elevation: Array2<f32>,
}

/// One map of all frames, of the shape that the first one has.
fn stack<'f>(
    frames: &'f [RadarFrame],
    map: impl Fn(&'f RadarFrame) -> Option<&'f HeatMap>,
) -> Option<Array3<f32>> {
    let first = frames.iter().find_map(&map)?;
    let shape = (frames.len(), usize::from(first.gate.bins), first.columns);
    Some(Array3::from_shape_fn(shape, |(f, row, column)| {
        map(&frames[f]).filter(|m| m.columns == shape.2).map_or(f32::NAN, |m| m.level_db(row, column))
    }))
}

impl<'f> RadarSeries<'f> {
    pub(super) fn new(config: &'f RadarConfig, frames: &'f [RadarFrame]) -> Self {
        let (profile, gate) = (&config.profile, config.processing.gate);
        let range_doppler = stack(frames, |f| f.range_doppler.as_ref());
        let doppler_bins = range_doppler.as_ref().map_or(0, |m| m.len_of(Dim(2)));
        let bin = 2.0 * profile.velocity_span().0 / doppler_bins.max(1) as f32;
        Self {
            frames,
            config,
            time_s: frames.iter().map(|f| f.time.seconds()).collect(),
            range_m: (0..gate.bins).map(|b| f32::from(gate.first + b) * profile.range_bin().0).collect(),
            velocity_m_s: (0..doppler_bins).map(|d| (d as f32 - (doppler_bins / 2) as f32) * bin).collect(),
            range_time: stack(frames, |f| f.range_time.as_ref()),
            range_doppler,
            angles: angles(config, frames),
        }
    }

    /// The strongest cell that moves.
    pub(super) fn strongest(&self) -> Option<Strongest> {
        let map = self.range_doppler.as_ref()?;
        let guard = usize::from(self.config.processing.zero_doppler_guard);
        let zero = map.len_of(Dim(2)) / 2;
        let moving =
            map.indexed_iter().filter(|((_, _, d), level)| d.abs_diff(zero) > guard && !level.is_nan());
        let ((f, r, d), &level_db) = moving.max_by(|a, b| a.1.total_cmp(b.1))?;
        Some(Strongest {
            frame: self.frames[f].frame,
            time_s: self.time_s[f],
            range_m: self.range_m[r],
            velocity_m_s: self.velocity_m_s[d],
            level_db,
        })
    }

    /// Writes the pictures and `radar.npz` to the folder `out`.
    pub(super) fn write(&self, out: &Path) -> Result<Vec<PathBuf>, ReplayError> {
        let mut written = Vec::new();
        for (name, figure) in [
            ("range_time.png", self.range_time_picture()),
            ("range_doppler.png", self.range_doppler_picture()),
            ("angle.png", self.angle_picture()),
        ] {
            if let Some(figure) = figure {
                let path = out.join(name);
                figure.save(&path)?;
                written.push(path);
            }
        }
        let path = out.join("radar.npz");
        self.numbers(&path)?;
        written.push(path);
        Ok(written)
    }

    fn numbers(&self, path: &Path) -> Result<(), ReplayError> {
        let of_info = |value: fn(&rfhoi_shared::wire::FrameInfo) -> u32| {
            self.frames.iter().map(|f| f.info.as_ref().map_or(0, value)).collect::<Array1<u32>>()
        };
        let mut npz = Npz::create(path)?
            .array("frame", &self.frames.iter().map(|f| f.frame).collect::<Array1<u32>>())?
            .array("time_s", &self.time_s)?
            .array("range_m", &self.range_m)?
            .array("chirps_lost", &of_info(|i| i.chirps_lost))?
            .array("words_clipped", &of_info(|i| i.clipped))?
            .array("moving_cells", &of_info(|i| i.moving_cells))?;
        if let Some(map) = &self.range_time {
            npz = npz.array("range_time_db", map)?;
        }
        if let Some(map) = &self.range_doppler {
            npz = npz.array("velocity_m_s", &self.velocity_m_s)?.array("range_doppler_db", map)?;
        }
        if let Some(covariances) = covariances(self.frames) {
            npz = npz.array("covariance", &covariances)?;
        }
        if let Some(angles) = &self.angles {
            npz = npz
                .array("azimuth_deg", &angles.azimuth_deg)?
                .array("elevation_deg", &angles.elevation_deg)?
                .array("azimuth_time_db", &angles.azimuth)?
                .array("elevation_time_db", &angles.elevation)?;
        }
        let points: Vec<[f32; 6]> = self
            .frames
            .iter()
            .flat_map(|f| f.points.iter().map(|p| (f.frame, p)))
            .map(|(frame, p)| {
                let [x, y, z] = p.position_m;
                [
                    frame as f32,
                    x,
                    y,
                    z,
                    p.velocity_m_s,
                    p.snr_decidb.map_or(f32::NAN, |s| f32::from(s) / 10.0),
                ]
            })
            .collect();
        if !points.is_empty() {
            // Columns: frame, x, y, z in m, velocity in m/s, SNR in dB.
            npz = npz.array("points", &Array2::from(points))?;
        }
        Ok(npz.finish()?)
    }

    /// Rows of a map over frames as columns of a picture, with gaps where frame numbers are missing.
    fn over_time(
        &self,
        rows: usize,
        per_frame: usize,
        value: impl Fn(usize, usize, usize) -> f32,
    ) -> Array2<f32> {
        let mut columns: Vec<Option<usize>> = Vec::new();
        for (f, frame) in self.frames.iter().enumerate() {
            let missing = f
                .checked_sub(1)
                .map_or(0, |before| frame.frame.saturating_sub(self.frames[before].frame).saturating_sub(1));
            columns.extend((0..missing.min(LONGEST_GAP)).map(|_| None));
            columns.push(Some(f));
        }
        Array2::from_shape_fn((rows, columns.len() * per_frame), |(row, column)| {
            columns[column / per_frame].map_or(f32::NAN, |f| value(f, row, column % per_frame))
        })
    }

    fn time_axis(&self) -> Axis {
        let from = self.time_s.first().copied().unwrap_or(0.0);
        let to = self.time_s.last().copied().unwrap_or(0.0) + f64::from(self.config.profile.frame_period().0);
        Axis::new("time", "s", from, to)
    }

    fn range_axis(&self) -> Axis {
        around("range", "m", &self.range_m)
    }

    fn level_name(&self) -> (&'static str, &'static str) {
        // Maps that the radar computed have a scale of their own.
        if self.frames.iter().any(|f| f.covariance.is_some() && f.range_doppler.is_some()) {
            ("level", "dB re full scale")
        } else {
            ("level", "dB")
        }
    }

    fn heatmap(&self, title: impl Into<String>, values: Array2<f32>, x: Axis, y: Axis) -> Panel {
        let (label, unit) = self.level_name();
        let top = values.iter().copied().filter(|v| !v.is_nan()).fold(f32::NEG_INFINITY, f32::max);
        let bottom = values.iter().copied().filter(|v| !v.is_nan()).fold(f32::INFINITY, f32::min);
        let mut scale = ColourScale::new(label, unit);
        if top.is_finite() && top > bottom {
            scale = scale.with_range(bottom.max(top - SPAN_DB), top);
        }
        Panel::Heatmap(Heatmap { title: title.into(), values, x, y, scale, reduce: Reduce::Max })
    }

    fn range_time_picture(&self) -> Option<Figure> {
        let map = self.range_time.as_ref()?;
        let (_, bins, columns) = map.dim();
        let values = self.over_time(bins, columns, |f, row, column| map[(f, row, column)]);
        let mut panels = vec![self.heatmap("Range over time", values, self.time_axis(), self.range_axis())];
        // The radar's own profile has all that is still in it.
        if columns == 1 && self.range_doppler.is_none() {
            let usual: Vec<f32> = (0..bins).map(|row| median(map.index_axis(Dim(1), row).iter())).collect();
            let values = self.over_time(bins, 1, |f, row, _| map[(f, row, 0)] - usual[row]);
            let title = "Range over time, less each range's median: what changes";
            panels.push(self.heatmap(title, values, self.time_axis(), self.range_axis()));
        }
        let points = self.points(|p| f64::from(p.position_m.map(|x| x * x).iter().sum::<f32>().sqrt()));
        if !points.is_empty() {
            panels.push(Panel::Lines(Lines {
                title: "Range of the points that the radar detected".into(),
                x: self.time_axis(),
                y: self.range_axis(),
                series: vec![Series::new("", points, Style::Dots)],
                marks: None,
            }));
        }
        Some(Figure { columns: 1, panel_height: 520, ..Figure::new(panels) })
    }

    fn range_doppler_picture(&self) -> Option<Figure> {
        let map = self.range_doppler.as_ref()?;
        let (_, bins, doppler_bins) = map.dim();
        let velocity = || around("velocity", "m/s", &self.velocity_m_s);
        let shown =
            self.strongest().and_then(|s| self.frames.iter().position(|f| f.frame == s.frame)).unwrap_or(0);
        let one = map.index_axis(Dim(0), shown).to_owned();
        let title =
            format!("Range-Doppler, frame {} at {:.1} s", self.frames[shown].frame, self.time_s[shown]);
        let over_time = self
            .over_time(doppler_bins, 1, |f, d, _| (0..bins).map(|r| map[(f, r, d)]).fold(f32::NAN, f32::max));
        let panels = vec![
            self.heatmap(title, one, velocity(), self.range_axis()),
            self.heatmap("Velocity over time, strongest range", over_time, self.time_axis(), velocity()),
        ];
        Some(Figure { columns: 1, panel_height: 520, ..Figure::new(panels) })
    }

    fn angle_picture(&self) -> Option<Figure> {
        let Some(angles) = &self.angles else {
            let points = self.points(|p| f64::from(p.position_m[0].atan2(p.position_m[1]).to_degrees()));
            return (!points.is_empty()).then(|| {
                Figure::new(vec![Panel::Lines(Lines {
                    title: "Azimuth of the points that the radar detected".into(),
                    x: self.time_axis(),
                    y: Axis::new("azimuth", "deg", -90.0, 90.0),
                    series: vec![Series::new("", points, Style::Dots)],
                    marks: None,
                })])
            });
        };
        let panel = |title: &str, name: &str, values: &Array2<f32>, degrees: &Array1<f32>| {
            let image = self.over_time(degrees.len(), 1, |f, a, _| values[(f, a)]);
            let scale = ColourScale::new("below the highest", "dB").with_range(-ANGLE_SPAN_DB, 0.0);
            let (x, y) = (self.time_axis(), around(name, "deg", degrees));
            Panel::Heatmap(Heatmap { title: title.into(), values: image, x, y, scale, reduce: Reduce::Max })
        };
        let title = |angle: &str| {
            let methods = [Method::Music, Method::Bartlett];
            format!(
                "{angle} over time ({}, {} where little moves), hatched where doubted",
                methods[0], methods[1]
            )
        };
        let mut panels = vec![panel(&title("Azimuth"), "azimuth", &angles.azimuth, &angles.azimuth_deg)];
        if angles.elevation_deg.len() > 1 {
            panels.push(panel(&title("Elevation"), "elevation", &angles.elevation, &angles.elevation_deg));
        }
        Some(Figure { columns: 1, panel_height: 480, ..Figure::new(panels) })
    }

    /// A value of every detected point over time.
    fn points(&self, value: impl Fn(&rfhoi_shared::wire::Point) -> f64) -> Vec<(f64, f64)> {
        let frames = self.frames.iter().zip(&self.time_s);
        frames.flat_map(|(f, &t)| f.points.iter().map(move |p| (t, p))).map(|(t, p)| (t, value(p))).collect()
    }
}

/// The median of the values that are there; NaN if there are none.
fn median<'a>(values: impl Iterator<Item = &'a f32>) -> f32 {
    let mut sorted: Vec<f32> = values.copied().filter(|v| !v.is_nan()).collect();
    sorted.sort_by(f32::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f32::NAN)
}

/// An axis whose cells are centred on `values`.
fn around(label: &str, unit: &str, values: &Array1<f32>) -> Axis {
    let ends = values.first().zip(values.last());
    let (first, last) = ends.map_or((0.0, 1.0), |(&a, &b)| (f64::from(a), f64::from(b)));
    let half = if values.len() > 1 { (last - first) / (values.len() - 1) as f64 / 2.0 } else { 0.5 };
    Axis::new(label, unit, first - half, last + half)
}

/// Frame x antenna x antenna; NaN where none arrived.
fn covariances(frames: &[RadarFrame]) -> Option<Array3<Complex32>> {
    let n = usize::from(frames.iter().find_map(|f| f.covariance.as_ref())?.antennas);
    let mut all = Array3::from_elem((frames.len(), n, n), Complex32::new(f32::NAN, f32::NAN));
    for (mut matrix, frame) in all.outer_iter_mut().zip(frames) {
        let Some(covariance) = frame.covariance.as_ref().filter(|c| usize::from(c.antennas) == n) else {
            continue;
        };
        matrix.assign(&hermitian(covariance));
    }
    Some(all)
}

fn angles(config: &RadarConfig, frames: &[RadarFrame]) -> Option<Angles> {
    // Frames in which nothing moves have a covariance of zeros, and no angle.
    let moves = |c: &&Covariance| c.packed.first().is_some_and(|&p| p > 0.0);
    frames.iter().filter_map(|f| f.covariance.as_ref()).find(moves)?;
    let settings = Settings { points: ANGLES, ..Settings::of(&config.profile).ok()? };
    let mut estimator = Estimator::new(&config.profile, settings).ok()?;
    let azimuth_deg = Array1::from(estimator.azimuth_deg().to_vec());
    let elevation_deg = Array1::from(estimator.elevation_deg().to_vec());
    let mut azimuth = Array2::from_elem((frames.len(), azimuth_deg.len()), f32::NAN);
    let mut elevation = Array2::from_elem((frames.len(), elevation_deg.len()), f32::NAN);
    let most = |row: ndarray::ArrayView1<'_, f32>| row.fold(f32::NEG_INFINITY, |m, &level| m.max(level));
    for (f, frame) in frames.iter().enumerate() {
        let cells = frame.info.as_ref().map_or(0, |info| info.moving_cells);
        let Some(covariance) = frame.covariance.as_ref() else { continue };
        if estimator.estimate(covariance, cells).doubt.is_none() {
            let shape = (elevation_deg.len(), azimuth_deg.len());
            let map = ArrayView2::from_shape(shape, estimator.map_db()).ok()?;
            // The scales of the methods differ.
            let top = map.fold(f32::NEG_INFINITY, |m, &level| m.max(level));
            azimuth.row_mut(f).assign(&(map.map_axis(Dim(0), most) - top));
            elevation.row_mut(f).assign(&(map.map_axis(Dim(1), most) - top));
        }
    }
    Some(Angles { azimuth_deg, elevation_deg, azimuth, elevation })
}
