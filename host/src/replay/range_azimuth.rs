//! Range x azimuth of what moves, from raw samples: each range bin has a covariance of its own, which a bridge does not send.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use ndarray::{Array1, Array2};
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::wire::Covariance;

use super::ReplayError;
use crate::aoa::{Estimator, Settings};
use crate::inspect::InspectError;
use crate::maps::raw::RawMaps;
use crate::npz::Npz;
use crate::plot::{Axis, ColourScale, Figure, Heatmap, Panel, Reduce};
use crate::samples::RawSamples;

/// Colours of the picture span so much, dB, down from the strongest.
const SPAN_DB: f32 = 40.0;

/// Writes `range_azimuth.png` and `.npz` of the frame in which most moves to `out`. No files where nothing moves, or where the
/// array has no azimuth.
///
/// # Errors
/// If the samples cannot be read or a file not be written.
pub(super) fn write(
    path: &Path,
    config: &RadarConfig,
    out: &Path,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Vec<PathBuf>, ReplayError> {
    let Ok(settings) = Settings::of(&config.profile) else { return Ok(Vec::new()) };
    let Ok(mut estimator) = Estimator::new(&config.profile, settings) else { return Ok(Vec::new()) };
    let Some((frame, covariances)) = liveliest(path, config, progress)? else { return Ok(Vec::new()) };
    let azimuth = Array1::from(estimator.azimuth_deg().to_vec());
    let mut map = Array2::from_elem((covariances.len(), azimuth.len()), f32::NAN);
    if let Some(map) = map.as_slice_mut() {
        estimator.range_azimuth(covariances.iter().map(|(c, cells)| (c, *cells)), map, |_, _| {});
    }
    // The spectrum of each range says where; its power says how much.
    for (mut row, (covariance, _)) in map.outer_iter_mut().zip(&covariances) {
        let highest = row.iter().copied().filter(|x| !x.is_nan()).fold(f32::NEG_INFINITY, f32::max);
        let power_db =
            10.0 * covariance.packed.first().copied().unwrap_or(0.0).max(f32::MIN_POSITIVE).log10();
        row.mapv_inplace(|x| x - highest + power_db);
    }
    let gate = config.processing.gate;
    let bin_m = config.profile.range_bin().0;
    let range: Array1<f32> = (0..gate.bins).map(|bin| f32::from(gate.first + bin) * bin_m).collect();
    let files = ["range_azimuth.png", "range_azimuth.npz"].map(|name| out.join(name));
    let top = map.iter().copied().filter(|x| !x.is_nan()).fold(f32::NEG_INFINITY, f32::max);
    let half_deg = azimuth.last().copied().unwrap_or(60.0);
    let far = f64::from(f32::from(gate.first + gate.bins) - 0.5) * f64::from(bin_m);
    let panel = Heatmap {
        title: format!("Range and azimuth of what moves, frame {frame} (MUSIC in each range)"),
        values: map.clone(),
        x: Axis::new("azimuth", "deg", (-half_deg).into(), half_deg.into()),
        y: Axis::new("range", "m", f64::from(f32::from(gate.first) - 0.5) * f64::from(bin_m), far),
        scale: ColourScale::new("level", "dB re full scale").with_range(top - SPAN_DB, top),
        reduce: Reduce::Max,
    };
    Figure::new(vec![Panel::Heatmap(panel)]).save(&files[0])?;
    Npz::create(&files[1])?
        .array("azimuth_deg", &azimuth)?
        .array("range_m", &range)?
        .array("range_azimuth_db", &map)?
        .finish()?;
    Ok(files.into())
}

/// Number of the frame in which most moves, and the covariance and moving cells of each range bin; `None` where nothing moves.
#[allow(clippy::type_complexity, reason = "named in the line above")]
fn liveliest(
    path: &Path,
    config: &RadarConfig,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Option<(u32, Vec<(Covariance, u32)>)>, ReplayError> {
    let mut samples = RawSamples::open(path).map_err(InspectError::from)?;
    let total = samples.stream_bytes();
    let mut maps = RawMaps::new(config)?;
    let mut words = vec![0; config.profile.frame_bytes() as usize];
    let antennas = config.profile.virtual_count() as u8;
    let (mut most, mut found) = (0.0, None);
    for frame in 0.. {
        match samples.read_exact(&mut words) {
            Ok(()) => {}
            Err(e) if e.kind() == ErrorKind::UnexpectedEof => break,
            Err(source) => return Err(InspectError::Read { path: path.to_path_buf(), source }.into()),
        }
        // They are as many bytes as a frame has.
        let Ok(made) = maps.frame(&words, &[]) else { break };
        let power = maps.covariance().first().copied().unwrap_or(0.0) * made.moving_cells as f32;
        if power > most {
            most = power;
            let bins =
                (0..usize::from(config.processing.gate.bins)).filter_map(|bin| maps.covariance_of(bin));
            let covariance =
                |packed: &[f32]| Covariance { frame, antennas, packed: packed.iter().copied().collect() };
            found = Some((frame, bins.map(|(packed, cells)| (covariance(packed), cells)).collect()));
        }
        let done = (u64::from(frame) + 1) * u64::from(config.profile.frame_bytes());
        if !progress(done as f64 / total.max(1) as f64) {
            return Err(ReplayError::Interrupted);
        }
    }
    Ok(found)
}
