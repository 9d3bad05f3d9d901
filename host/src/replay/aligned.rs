//! Aligned frames of a recording as numbers, and as a picture of what is valid.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ndarray::{Array1, Array2, Array3, Array4};
use serde::Serialize;

use super::ReplayError;
use crate::align::{AlignedFrame, FrameStream, MAPS, MapName, StreamCounts};
use crate::npz::Npz;
use crate::phase::MAX_ANTENNAS;
use crate::plot::{Axis, ColourScale, Figure, Heatmap, Panel, Reduce};

/// What became of a recording's frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlignedFigures {
    /// Points of a map each way.
    pub points: usize,
    /// What went through.
    pub counts: StreamCounts,
    /// Frames of which each map is valid.
    pub valid_maps: BTreeMap<&'static str, u64>,
    /// Maps that are not, by map and reason.
    pub invalid_maps: BTreeMap<String, u64>,
    /// Phase differences that are valid.
    pub valid_differences: u64,
    /// Those that are not, by reason.
    pub invalid_differences: BTreeMap<&'static str, u64>,
}

fn name(map: MapName) -> &'static str {
    match map {
        MapName::RangeTime => "range_time",
        MapName::RangeDoppler => "range_doppler",
        MapName::Angle => "angle",
    }
}

/// Writes `aligned.npz` and, where there are tags, `aligned.png` to `out`.
///
/// | array | shape, type | what it is |
/// |---|---|---|
/// | `begin_s` | F, f64 | when each frame begins, by the bridge's clock |
/// | `maps` | F x 3 x points x points, f32 | range-time, range-Doppler, angle, 0 to 1 |
/// | `map_valid` | F x 3, u8 | 1 where the map is to be trusted |
/// | `phase_rad` | F x tags x antennas, f32 | phase difference over the frame; not a number where it is not known |
pub(super) fn write(
    out: &Path,
    frames: &[AlignedFrame],
    stream: &FrameStream,
    counts: StreamCounts,
) -> Result<(AlignedFigures, Vec<PathBuf>), ReplayError> {
    let points = frames.first().map_or(0, |frame| frame.points);
    let mut figures = AlignedFigures {
        points,
        counts,
        valid_maps: BTreeMap::new(),
        invalid_maps: BTreeMap::new(),
        valid_differences: 0,
        invalid_differences: BTreeMap::new(),
    };
    for frame in frames {
        for map in MapName::ALL {
            match frame.invalid(map) {
                None => *figures.valid_maps.entry(name(map)).or_default() += 1,
                Some(why) => {
                    *figures.invalid_maps.entry(format!("{}: {}", name(map), why.reason())).or_default() += 1;
                }
            }
        }
        for difference in frame.phases().differences() {
            match difference {
                Ok(_) => figures.valid_differences += 1,
                Err(why) => *figures.invalid_differences.entry(why.reason()).or_default() += 1,
            }
        }
    }
    let tags: Vec<String> = stream.epcs().map(ToString::to_string).collect();
    let antennas = frames.iter().map(|frame| frame.phases().antennas()).max().unwrap_or(0).min(MAX_ANTENNAS);
    let phase = Array3::from_shape_fn((frames.len(), tags.len(), antennas), |(f, tag, antenna)| {
        frames[f].phase(tag, antenna).unwrap_or(f32::NAN)
    });
    let maps = Array4::from_shape_fn((frames.len(), MAPS, points, points), |(f, map, row, column)| {
        frames[f].map(MapName::ALL[map])[row * points + column]
    });
    let valid = Array2::from_shape_fn((frames.len(), MAPS), |(f, map)| {
        u8::from(frames[f].invalid(MapName::ALL[map]).is_none())
    });
    let numbers = out.join("aligned.npz");
    Npz::create(&numbers)?
        .array("begin_s", &frames.iter().map(|frame| frame.begin.seconds()).collect::<Array1<f64>>())?
        .array("maps", &maps)?
        .array("map_valid", &valid)?
        .array("phase_rad", &phase)?
        .finish()?;
    let mut written = vec![numbers];
    if !phase.is_empty() {
        let picture = out.join("aligned.png");
        picture_of(&phase, frames, &tags).save(&picture)?;
        written.push(picture);
    }
    Ok((figures, written))
}

/// Phase differences over time, a row for each tag and antenna; hatched where they are not known.
fn picture_of(phase: &Array3<f32>, frames: &[AlignedFrame], tags: &[String]) -> Figure {
    let (count, _, antennas) = phase.dim();
    let from = frames[0].begin.seconds();
    let to = frames[count - 1].end.seconds();
    let most = phase.iter().copied().filter(|v| !v.is_nan()).fold(0.1_f32, |m, v| m.max(v.abs()));
    let panels = tags.iter().enumerate().map(|(tag, epc)| {
        let values = Array2::from_shape_fn((antennas, count), |(antenna, f)| phase[(f, tag, antenna)]);
        Panel::Heatmap(Heatmap {
            title: format!("Phase difference over each frame, {epc}"),
            values,
            x: Axis::new("time", "s", from, to),
            y: Axis::new("antenna", "", 0.5, antennas as f64 + 0.5),
            scale: ColourScale::new("turned", "rad").with_range(-most, most),
            reduce: Reduce::Mean,
        })
    });
    // As many as a picture can hold.
    const MOST_PANELS: usize = 15;
    Figure { columns: 1, panel_height: 260, ..Figure::new(panels.take(MOST_PANELS).collect()) }
}
