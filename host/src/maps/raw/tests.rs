//! Against the firmware's path, on the same simulated words.

use num_complex::Complex;
use rfhoi_firmware::dsp::{Cube, CubeShape, DopplerStage, RangeStage};
use rfhoi_firmware::simulated::{Noise, Scatterer, SimulatedRadar};
use rfhoi_shared::config::{ClutterRemoval, Processing, RadarInput};
use rfhoi_shared::radar::{IqOrder, RadarProfile, RangeGate, SampleFormat};
use rfhoi_shared::units::Seconds;

use super::*;

fn at(range_m: f64, velocity_m_s: f64, amplitude: f64) -> Scatterer {
    Scatterer { range_m, velocity_m_s, azimuth_rad: 0.3, elevation_rad: -0.2, amplitude }
}

/// The firmware's maps: range-Doppler, range-time, covariance, clipped words and moving cells.
struct Reference {
    range: RangeStage,
    doppler: DopplerStage,
    memory: Vec<Complex<i16>>,
    range_doppler: Vec<f32>,
    range_time: Vec<f32>,
}

impl Reference {
    fn new(config: &RadarConfig) -> Self {
        let mut range = RangeStage::new();
        range.configure(&config.profile, config.processing.gate);
        let mut doppler = DopplerStage::new();
        doppler.configure(config);
        let memory = vec![Complex::default(); CubeShape::of(config).cells()];
        Self { range, doppler, memory, range_doppler: Vec::new(), range_time: Vec::new() }
    }

    fn frame(&mut self, config: &RadarConfig, words: &[u8], lost: &[u32]) -> (Vec<f32>, RawFrame) {
        let mut cube = Cube::new(&mut self.memory);
        assert!(cube.reshape(CubeShape::of(config)));
        let mut frame = RawFrame { chirps_lost: lost.len() as u32, ..RawFrame::default() };
        for (chirp, bytes) in (0..).zip(words.chunks(config.profile.chirp_bytes() as usize)) {
            for (rx, row) in (0..).zip(bytes.chunks(config.profile.row_bytes() as usize)) {
                if !lost.contains(&chirp) {
                    frame.clipped += self.range.row(chirp, rx, row, &mut cube);
                }
            }
        }
        self.doppler.begin(&cube);
        self.range_doppler.clear();
        self.range_time.clear();
        for bin in 0..cube.shape().bins {
            let row = self.doppler.range_bin(&cube, bin);
            self.range_doppler.extend(row.doppler());
            self.range_time.extend(row.time);
        }
        let moving = self.doppler.finish();
        frame.moving_cells = moving.cells();
        (moving.covariance().collect(), frame)
    }
}

/// Largest difference of powers, as an amplitude in dB relative to full scale.
fn worst_db(got: &[f32], want: &[f32]) -> f32 {
    assert_eq!(got.len(), want.len());
    let worst = got.iter().zip(want).map(|(g, w)| (g.sqrt() - w.sqrt()).abs()).fold(0.0, f32::max);
    20.0 * worst.log10()
}

/// Largest difference of covariances against the largest element, dB.
fn covariance_db(got: &[f32], want: &[f32]) -> f32 {
    let largest = want.iter().fold(0.0, |m: f32, w| m.max(w.abs()));
    let worst = got.iter().zip(want).map(|(g, w)| (g - w).abs()).fold(0.0, f32::max);
    10.0 * (worst / largest).log10()
}

fn compare(config: &RadarConfig, frames: u32, lost: &[u32]) {
    let profile = &config.profile;
    let bin = f64::from(profile.range_bin().0);
    let velocity = f64::from(profile.velocity_bin().0);
    let gate = config.processing.gate;
    let range = |share: f64| (f64::from(gate.first) + share * f64::from(gate.bins)) * bin;
    let scene = [
        at(range(0.8), 0.0, 0.3),
        at(range(0.4), 0.23 * f64::from(profile.loops) * velocity, 0.1),
        at(range(0.6), -0.31 * f64::from(profile.loops) * velocity, 0.02),
    ];
    let mut radar = SimulatedRadar::new(profile).unwrap();
    let mut noise = Noise::new(11, 3.0);
    let (mut maps, mut reference) = (RawMaps::new(config).unwrap(), Reference::new(config));
    let mut words = vec![0; profile.frame_bytes() as usize];
    for frame in 0..frames {
        for (i, chirp) in (0..).zip(words.chunks_mut(profile.chirp_bytes() as usize)) {
            radar.chirp(&scene, &mut noise, frame, i, chirp);
        }
        let (covariance, want) = reference.frame(config, &words, lost);
        let got = maps.frame(&words, lost).unwrap();
        let name = format!("{} samples, {} loops", profile.samples, profile.loops);
        assert_eq!((got.clipped, got.chirps_lost), (want.clipped, want.chirps_lost), "{name}");
        // Cells that only just rise over the threshold may be seen by one of them.
        assert!(
            got.moving_cells.abs_diff(want.moving_cells) * 6 <= want.moving_cells,
            "{name}: {got:?}, {want:?}"
        );
        let sum = |mean: &[f32], frame: RawFrame| -> Vec<f32> {
            mean.iter().map(|c| c * frame.moving_cells as f32).collect()
        };
        let errors = [
            worst_db(maps.range_doppler(), &reference.range_doppler),
            worst_db(maps.range_time(), &reference.range_time),
            covariance_db(&sum(maps.covariance(), got), &sum(&covariance, want)),
        ];
        println!("{name}: range-Doppler, range-time, covariance off by {errors:.0?} dB at most");
        // The rounding of the firmware's cube is at -93 dB at most, near a wall at -10 dB.
        assert!(errors[0] < -85.0 && errors[1] < -85.0, "{name}: {errors:?}");
        assert!(want.moving_cells == 0 || errors[2] < -40.0, "{name}: {errors:?}");
    }
}

fn config(samples: u16, loops: u16, format: SampleFormat) -> RadarConfig {
    let mut profile = RadarProfile { samples, loops, format, ..RadarProfile::bridge() };
    // The longer ramps sample faster.
    profile.sample_rate_ksps = 2_200 * u32::from(samples.max(128)) / 128;
    profile.frame_period_us = 200_000;
    let gate = RangeGate { first: 0, bins: profile.range_bins().min(256) };
    RadarConfig { processing: Processing::with_gate(&profile, gate), input: RadarInput::Uart, profile }
}

const Q_FIRST: SampleFormat = SampleFormat::Complex(IqOrder::QFirst);

#[test]
fn maps_are_the_firmwares_at_every_size() {
    for (samples, loops) in [(16, 16), (32, 8), (64, 32), (128, 64), (256, 128), (512, 16), (1024, 256)] {
        compare(&config(samples, loops, Q_FIRST), 1, &[]);
    }
    compare(&config(128, 64, SampleFormat::Complex(IqOrder::IFirst)), 1, &[]);
    compare(&config(128, 64, SampleFormat::Real), 1, &[]);
}

#[test]
fn gates_may_begin_and_end_anywhere() {
    for (first, bins) in [(5, 40), (16, 16), (31, 2), (100, 28)] {
        let mut config = config(128, 64, Q_FIRST);
        config.processing.gate = RangeGate { first, bins };
        compare(&config, 1, &[]);
    }
}

#[test]
fn clutter_removal_and_lost_chirps_are_the_firmwares() {
    let background = ClutterRemoval::Background { time_constant: Seconds(1.0) };
    for clutter in [ClutterRemoval::Off, ClutterRemoval::Mean, background] {
        for lost in [&[][..], &[3, 4, 5, 77, 120]] {
            let mut config = config(64, 64, Q_FIRST);
            config.processing.clutter = clutter;
            compare(&config, 3, lost);
        }
    }
    let all: Vec<u32> = (0..192).collect();
    let config = config(64, 64, Q_FIRST);
    let mut maps = RawMaps::new(&config).unwrap();
    maps.frame(&vec![0x55; config.profile.frame_bytes() as usize], &all).unwrap();
    assert!(maps.range_doppler().iter().chain(maps.range_time()).all(|&p| p == 0.0));
}

#[test]
fn bins_covariances_add_up() {
    let config = config(64, 64, Q_FIRST);
    let mut radar = SimulatedRadar::new(&config.profile).unwrap();
    let mut words = vec![0; config.profile.frame_bytes() as usize];
    for (i, chirp) in (0..).zip(words.chunks_mut(config.profile.chirp_bytes() as usize)) {
        radar.chirp(&[at(1.0, 2.0, 0.1), at(2.0, -1.0, 0.1)], &mut Noise::new(1, 2.0), 0, i, chirp);
    }
    let mut maps = RawMaps::new(&config).unwrap();
    let frame = maps.frame(&words, &[]).unwrap();
    let mut sum = vec![0.0; 144];
    let mut cells = 0;
    for bin in 0..64 {
        let (covariance, count) = maps.covariance_of(bin).unwrap();
        sum.iter_mut().zip(covariance).for_each(|(s, c)| *s += c * count as f32);
        cells += count;
    }
    assert_eq!(cells, frame.moving_cells);
    sum.iter_mut().for_each(|s| *s /= cells as f32);
    assert!(covariance_db(&sum, maps.covariance()) < -60.0);
    assert!(maps.covariance_of(64).is_none());
    let error = maps.frame(&words[4..], &[]).unwrap_err();
    assert_eq!(error.to_string(), "a frame of this profile has 196608 bytes, these are 196604");
}
