//! How a target vibrates: the phase of one range bin over the frames of raw samples, as a displacement and its spectrum.
//!
//! The first chirp of every frame is taken, so the rate is that of the frames and lines appear up to half of it. The phase of
//! an echo turns by `4 pi d / lambda`; what stands still in the same range bin makes the displacement appear smaller.

use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use ndarray::Array1;
use num_complex::Complex;
use rfhoi_firmware::dca1000::{Event, Reassembly};
use rfhoi_firmware::dsp::{RangeStage, window};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::Metres;
use serde::Serialize;

use super::ReplayError;
use crate::datagrams::Datagrams;
use crate::inspect::{InspectError, MAX_ROW};
use crate::npz::Npz;
use crate::phase::circular::wrap;
use crate::plot::{Axis, Figure, Lines, Panel, Series, Style};
use crate::samples::RawSamples;

/// Fewest frames that make a spectrum.
const FEWEST_FRAMES: usize = 16;
/// Lines below are drift, not vibration: periods of the recording.
const SLOWEST: usize = 3;

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Vibration {
    /// Range of the target.
    pub range_m: f32,
    /// Frames.
    pub frames: usize,
    /// Frames a second.
    pub rate_hz: f64,
    /// Width of a line of the spectrum.
    pub resolution_hz: f64,
    /// The line that stands out most from its neighbours; drift makes all slow ones strong.
    pub frequency_hz: f64,
    /// Its amplitude: the target moves by as much either way.
    pub amplitude_um: f64,
    /// How far it rises over the median of the lines from half to twice its frequency.
    pub rise_db: f64,
    /// Displacement at each frame, um, positive is away from the radar.
    #[serde(skip)]
    displacement_um: Vec<f64>,
    /// Amplitude by frequency, um, in steps of the resolution.
    #[serde(skip)]
    spectrum_um: Vec<f64>,
}

/// Measures the strongest target, or that at `range`, in the raw samples at `path`.
///
/// # Errors
/// If the samples cannot be read, are too few, or the range is past the profile's.
pub(super) fn measure(
    path: &Path,
    profile: &RadarProfile,
    range: Option<Metres>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Vibration, ReplayError> {
    let too_little = |reason: String| InspectError::TooLittle { path: path.to_path_buf(), reason };
    let series = first_chirps(path, profile, progress)?;
    let receivers = profile.rx_count();
    let frames = series.len() / receivers;
    if frames < FEWEST_FRAMES {
        let reason = format!("a spectrum over slow time needs {FEWEST_FRAMES} frames, it has {frames}");
        return Err(too_little(reason).into());
    }
    let bins = usize::from(profile.range_bins());
    let power = |bin: usize| series.iter().map(|spectrum| f64::from(spectrum[bin].norm_sqr())).sum::<f64>();
    let bin = match range {
        Some(range) => (range.0 / profile.range_bin().0).round() as usize,
        // Past what leaks from transmitter to receiver.
        None => (2..bins).max_by(|&a, &b| power(a).total_cmp(&power(b))).unwrap_or(0),
    };
    if bin >= bins {
        let reason = format!("its range ends at {:.2} m", profile.range_span().0);
        return Err(too_little(reason).into());
    }
    let um_per_rad = f64::from(profile.wavelength().0) * 1e6 / (4.0 * PI);
    let displacement_um: Vec<f64> = {
        let mut sum = vec![0.0; frames];
        for receiver in 0..receivers {
            let of_receiver =
                series.iter().skip(receiver).step_by(receivers).map(|s| f64::from(s[bin].arg()));
            let mut last = None;
            let mut total = 0.0;
            for (sum, phase) in sum.iter_mut().zip(of_receiver) {
                total += last.replace(phase).map_or(0.0, |last| wrap(phase - last));
                // The beat frequency's phase grows with the path (I + jQ, positive beat).
                *sum += total * um_per_rad / receivers as f64;
            }
        }
        sum
    };
    let spectrum_um = spectrum(&displacement_um);
    let rate_hz = 1e6 / f64::from(profile.frame_period_us);
    let resolution_hz = rate_hz / frames as f64;
    let lines = SLOWEST..spectrum_um.len();
    let best = lines.max_by(|&a, &b| rise(&spectrum_um, a).total_cmp(&rise(&spectrum_um, b))).unwrap_or(0);
    Ok(Vibration {
        range_m: bin as f32 * profile.range_bin().0,
        frames,
        rate_hz,
        resolution_hz,
        frequency_hz: best as f64 * resolution_hz,
        amplitude_um: spectrum_um[best],
        rise_db: 20.0 * rise(&spectrum_um, best).log10(),
        displacement_um,
        spectrum_um,
    })
}

/// Range spectra of the first chirp of every whole frame, receiver by receiver.
fn first_chirps(
    path: &Path,
    profile: &RadarProfile,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Vec<Vec<Complex<f32>>>, ReplayError> {
    let samples = RawSamples::open(path).map_err(InspectError::from)?;
    let bytes = samples.stream_bytes();
    let too_long = || InspectError::TooLittle {
        path: path.to_path_buf(),
        reason: "the profile's chirps are longer than any radar's".into(),
    };
    let mut reassembly = Reassembly::<MAX_ROW>::new(profile).ok_or_else(too_long)?;
    let mut range = RangeStage::new();
    range.configure(profile, profile.gate_to(profile.range_span()));
    let mut series = Vec::new();
    for datagram in Datagrams::new(samples) {
        let datagram = datagram.map_err(|source| InspectError::Read { path: path.to_path_buf(), source })?;
        reassembly.push(&datagram.bytes, |event| {
            if let Event::Row { chirp: 0, bytes, intact: true, .. } = event {
                series.push(range.spectrum(bytes).0.to_vec());
            }
        });
        if !progress(datagram.byte_count as f64 / bytes.max(1) as f64) {
            return Err(ReplayError::Interrupted);
        }
    }
    Ok(series)
}

/// Amplitude of each line, from zero to half the rate, of a series without its mean and trend, through a Hann window.
fn spectrum(series: &[f64]) -> Vec<f64> {
    let n = series.len();
    let slope = (series[n - 1] - series[0]) / (n - 1) as f64;
    let level: Vec<f64> = series.iter().enumerate().map(|(i, x)| x - slope * i as f64).collect();
    let mean = level.iter().sum::<f64>() / n as f64;
    let mut weights = vec![0.0; n];
    window::hann(&mut weights, 1.0);
    let line = |k: usize| {
        let turn = -TAU * k as f64 / n as f64;
        let terms = level.iter().zip(&weights).enumerate();
        let sum: Complex<f64> =
            terms.map(|(i, (x, &w))| Complex::from_polar((x - mean) * f64::from(w), turn * i as f64)).sum();
        2.0 * sum.norm()
    };
    (0..=n / 2).map(line).collect()
}

/// Line `k` relative to the median of those from half to twice its frequency.
fn rise(spectrum: &[f64], k: usize) -> f64 {
    let mut around = spectrum[k / 2..(2 * k + 1).min(spectrum.len())].to_vec();
    around.sort_by(f64::total_cmp);
    spectrum[k] / around[around.len() / 2].max(f64::MIN_POSITIVE)
}

impl Vibration {
    /// Writes `vibration.png` and `vibration.npz`.
    ///
    /// # Errors
    /// If one of them cannot be written.
    pub(super) fn write(&self, out: &Path) -> Result<[PathBuf; 2], ReplayError> {
        let paths = [out.join("vibration.png"), out.join("vibration.npz")];
        self.picture().save(&paths[0])?;
        Npz::create(&paths[1])?
            .array("displacement_um", &Array1::from_vec(self.displacement_um.clone()))?
            .array(
                "time_s",
                &self
                    .displacement_um
                    .iter()
                    .enumerate()
                    .map(|(i, _)| i as f64 / self.rate_hz)
                    .collect::<Array1<_>>(),
            )?
            .array("spectrum_um", &Array1::from_vec(self.spectrum_um.clone()))?
            .array(
                "frequency_hz",
                &(0..self.spectrum_um.len()).map(|k| k as f64 * self.resolution_hz).collect::<Array1<_>>(),
            )?
            .finish()?;
        Ok(paths)
    }

    fn picture(&self) -> Figure {
        let line = |points: Vec<(f64, f64)>| Series::new("", points, Style::Line);
        let time: Vec<_> =
            self.displacement_um.iter().enumerate().map(|(i, &d)| (i as f64 / self.rate_hz, d)).collect();
        let lines: Vec<_> = (self.spectrum_um.iter().enumerate().skip(1))
            .map(|(k, &a)| (k as f64 * self.resolution_hz, a))
            .collect();
        let highest = self.spectrum_um[1..].iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let panels = vec![
            Panel::Lines(Lines {
                title: format!("Displacement at {:.2} m", self.range_m),
                x: Axis::new("time", "s", 0.0, self.displacement_um.len() as f64 / self.rate_hz),
                y: Axis::around("displacement", "um", self.displacement_um.iter().copied()),
                series: vec![line(time)],
                marks: None,
            }),
            Panel::Lines(Lines {
                title: format!(
                    "Spectrum over slow time: {:.2} um at {:.1} Hz",
                    self.amplitude_um, self.frequency_hz
                ),
                x: Axis::new("frequency", "Hz", 0.0, self.rate_hz / 2.0),
                y: Axis::logarithmic("amplitude", "um", highest * 1e-5, highest * 2.0),
                series: vec![line(lines)],
                marks: None,
            }),
        ];
        Figure { columns: 1, panel_height: 440, ..Figure::new(panels) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_its_amplitude_whatever_the_drift() {
        let n = 400;
        let series: Vec<f64> =
            (0..n).map(|i| 3.0 * (TAU * 20.0 * i as f64 / n as f64).sin() + 0.5 * i as f64 + 7.0).collect();
        let lines = spectrum(&series);
        assert!((lines[20] - 3.0).abs() < 0.05, "{}", lines[20]);
        assert!(lines[40..].iter().all(|&a| a < 0.01));
        let strongest = (SLOWEST..lines.len()).max_by(|&a, &b| rise(&lines, a).total_cmp(&rise(&lines, b)));
        assert_eq!(strongest, Some(20));
    }
}
