//! What the stages must make of simulated scenes.

use std::vec;
use std::vec::Vec;

use num_complex::{Complex, Complex32};
use rfhoi_shared::array::virtual_antennas;
use rfhoi_shared::config::{ClutterRemoval, Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::{IqOrder, RadarProfile, SampleFormat};
use rfhoi_shared::units::{Metres, Seconds};

use crate::dsp::{Cube, CubeShape, DopplerStage, RangeStage};
use crate::simulated::{Noise, Scatterer, SimulatedRadar};

fn config(profile: RadarProfile) -> RadarConfig {
    let gate = profile.gate_to(Metres(3.05));
    RadarConfig { processing: Processing::with_gate(&profile, gate), input: RadarInput::Uart, profile }
}

/// Range bin and Doppler bin of the `bridge` profile, m and m/s.
const BIN: f64 = 0.042_939;
const DOPPLER_BIN: f64 = 0.140_39;

fn scatterer(range_m: f64, velocity_m_s: f64) -> Scatterer {
    Scatterer { range_m, velocity_m_s, azimuth_rad: 0.0, elevation_rad: 0.0, amplitude: 0.1 }
}

/// Maps of one frame.
struct Maps {
    doppler: Vec<Vec<f32>>,
    time: Vec<Vec<f32>>,
    covariance: Vec<f32>,
    cells: u32,
}

impl Maps {
    fn peak(&self) -> (usize, usize, f32) {
        let cells = self.doppler.iter().enumerate();
        let cells = cells.flat_map(|(r, row)| row.iter().enumerate().map(move |(d, &p)| (r, d, p)));
        cells.max_by(|a, b| a.2.total_cmp(&b.2)).unwrap()
    }
}

struct Bench {
    config: RadarConfig,
    radar: SimulatedRadar,
    range: RangeStage,
    doppler: DopplerStage,
    noise: Noise,
    frame: u32,
}

impl Bench {
    fn new(config: RadarConfig) -> Self {
        let mut range = RangeStage::new();
        range.configure(&config.profile, config.processing.gate);
        let mut doppler = DopplerStage::new();
        doppler.configure(&config);
        let radar = SimulatedRadar::new(&config.profile).unwrap();
        Self { config, radar, range, doppler, noise: Noise::new(7, 2.0), frame: 0 }
    }

    /// The next frame, without the chirps that `lost` names.
    fn frame(&mut self, scatterers: &[Scatterer], lost: impl Fn(u32) -> bool) -> Maps {
        let shape = CubeShape::of(&self.config);
        let mut memory = vec![Complex::default(); shape.cells()];
        let mut cube = Cube::new(&mut memory);
        assert!(cube.reshape(shape));
        let mut bytes = vec![0; self.config.profile.chirp_bytes() as usize];
        for index in (0..self.config.profile.chirps_per_frame()).filter(|&i| !lost(i)) {
            self.radar.chirp(scatterers, &mut self.noise, self.frame, index, &mut bytes);
            for (rx, row) in (0..).zip(bytes.chunks(self.config.profile.row_bytes() as usize)) {
                assert_eq!(self.range.row(index, rx, row, &mut cube), 0, "clipped");
            }
        }
        self.frame += 1;
        self.doppler.begin(&cube);
        let (mut doppler, mut time) = (Vec::new(), Vec::new());
        for bin in 0..shape.bins {
            let row = self.doppler.range_bin(&cube, bin);
            doppler.push(row.doppler().collect());
            time.push(row.time.to_vec());
        }
        let moving = self.doppler.finish();
        Maps { doppler, time, covariance: moving.covariance().collect(), cells: moving.cells() }
    }
}

fn db(power: f32) -> f32 {
    10.0 * power.log10()
}

#[test]
fn a_point_appears_at_its_range_and_velocity() {
    for format in [IqOrder::IFirst, IqOrder::QFirst].map(SampleFormat::Complex) {
        let profile = RadarProfile { format, ..RadarProfile::bridge() };
        let mut bench = Bench::new(config(profile));
        for (bin, doppler) in [(20, 9), (50, -20), (64, 31), (10, -32)] {
            bench.frame = 0;
            // Away from the gap that clutter removal leaves, and in the middle of its bin at mid-frame.
            let velocity = f64::from(doppler) * DOPPLER_BIN;
            let mid_frame = 32.0 * 3.0 * 70.3e-6;
            let target = scatterer(f64::from(bin) * BIN - velocity * mid_frame, velocity);
            let maps = bench.frame(&[target], |_| false);
            let (r, d, power) = maps.peak();
            assert_eq!((r as i32, d as i32 - 32), (bin, doppler));
            assert!((db(power) - -20.0).abs() < 0.5, "level of the tone is kept: {}", db(power));
            let time: f32 = maps.time[r].iter().sum::<f32>() / maps.time[r].len() as f32;
            // The fastest crosses 1.4 range bins within the frame.
            assert!((db(time) - -20.0).abs() < 1.0, "in the range-time map too: {}", db(time));
        }
    }
}

#[test]
fn real_samples_give_the_same_bin_and_level() {
    let profile = RadarProfile { format: SampleFormat::Real, ..RadarProfile::bridge() };
    let velocity = 9.0 * DOPPLER_BIN;
    let range = 20.0 * BIN;
    let maps = Bench::new(config(profile)).frame(&[scatterer(range, velocity)], |_| false);
    let (r, d, power) = maps.peak();
    assert_eq!((r, d), (20, 32 + 9));
    assert!((db(power) - -20.0).abs() < 0.5, "{}", db(power));
}

#[test]
fn the_wrong_word_order_mirrors_the_range() {
    let right = RadarProfile::bridge();
    let wrong = RadarProfile { format: SampleFormat::Complex(IqOrder::IFirst), ..right.clone() };
    let mut radar = SimulatedRadar::new(&right).unwrap();
    let mut bytes = vec![0; right.chirp_bytes() as usize];
    let target = scatterer(20.0 * BIN, 0.0);
    radar.chirp(&[target], &mut Noise::new(1, 1.0), 0, 0, &mut bytes);
    let mut stage = RangeStage::new();
    stage.configure(&wrong, wrong.gate_to(Metres(3.0)));
    let (spectrum, _) = stage.spectrum(&bytes[..512]);
    let strongest = |s: &[Complex32]| (0..128).max_by(|&a, &b| s[a].norm().total_cmp(&s[b].norm())).unwrap();
    assert_eq!(strongest(spectrum), 128 - 20);
}

#[test]
fn static_clutter_vanishes_and_lost_chirps_do_not_bring_it_back() {
    let wall = Scatterer { amplitude: 0.5, ..scatterer(47.0 * BIN, 0.0) };
    let hand = Scatterer { amplitude: 0.005, ..scatterer(23.0 * BIN, 9.0 * DOPPLER_BIN) };
    let clean = Bench::new(config(RadarProfile::bridge())).frame(&[wall, hand], |_| false);
    let lossy =
        Bench::new(config(RadarProfile::bridge())).frame(&[wall, hand], |i| i % 11 == 3 || i / 30 == 2);
    for maps in [&clean, &lossy] {
        let (r, _, power) = maps.peak();
        assert_eq!(r, 23, "the hand is strongest");
        assert!((db(power) - -46.0).abs() < 1.0, "{}", db(power));
        // The wall is 80 dB below where it was: its noise is left.
        let wall_row = maps.doppler[47].iter().copied().fold(0.0, f32::max);
        assert!(db(wall_row) < -86.0, "{}", db(wall_row));
    }
}

#[test]
fn a_frame_of_which_nothing_came_is_silent() {
    let maps = Bench::new(config(RadarProfile::bridge())).frame(&[scatterer(1.0, 1.0)], |_| true);
    assert_eq!(maps.cells, 0);
    assert!(maps.doppler.iter().chain(&maps.time).flatten().chain(&maps.covariance).all(|&p| p == 0.0));
}

#[test]
fn the_background_keeps_who_sits_still_and_the_mean_does_not() {
    let wall = Scatterer { amplitude: 0.2, ..scatterer(47.0 * BIN, 0.0) };
    let person = Scatterer { amplitude: 0.05, ..scatterer(23.0 * BIN, 0.0) };
    let levels = |clutter| {
        let mut config = config(RadarProfile::bridge());
        config.processing.clutter = clutter;
        let mut bench = Bench::new(config);
        bench.frame(&[wall], |_| false);
        // Sits down after the first frame, and is looked at after another second.
        let frames: Vec<Maps> = (0..10).map(|_| bench.frame(&[wall, person], |_| false)).collect();
        let level = |row: usize| db(frames[9].doppler[row].iter().copied().fold(0.0, f32::max));
        (level(23), level(47))
    };
    let (person_level, wall_level) = levels(ClutterRemoval::Background { time_constant: Seconds(10.0) });
    assert!((person_level - -27.0).abs() < 1.5, "{person_level}");
    assert!(wall_level < -80.0, "{wall_level}");
    let (person_level, _) = levels(ClutterRemoval::Mean);
    assert!(person_level < -80.0, "{person_level}");
    let (_, wall_level) = levels(ClutterRemoval::Off);
    assert!(wall_level > -15.0, "{wall_level}");
}

/// Phase of every virtual antenna against antenna 0 in a covariance of one source.
fn phases(covariance: &[f32], antennas: usize) -> Vec<f32> {
    (1..antennas)
        .map(|v| {
            let at = 1 + 2 * (v - 1);
            // (0, v) holds x0 conj(xv).
            Complex32::new(covariance[at], -covariance[at + 1]).arg()
        })
        .collect()
}

#[test]
fn tdm_compensation_leaves_only_the_direction() {
    use std::f32::consts::PI;
    let profile = RadarProfile::bridge();
    let antennas = virtual_antennas(&profile).unwrap();
    let (azimuth, elevation) = (0.3f32, -0.2f32);
    let (u, w) = (azimuth.sin() * elevation.cos(), elevation.sin());
    for doppler in [3.0, -7.0, 15.5, -29.0, 29.4] {
        let velocity = doppler * DOPPLER_BIN;
        let target = Scatterer {
            azimuth_rad: azimuth.into(),
            elevation_rad: elevation.into(),
            ..scatterer(1.0, velocity)
        };
        let maps = Bench::new(config(profile.clone())).frame(&[target], |_| false);
        assert!(maps.cells > 0);
        for (v, phase) in phases(&maps.covariance, 12).into_iter().enumerate() {
            let (p, origin) = (antennas[v + 1].position, antennas[0].position);
            let dx = f32::from(p.azimuth - origin.azimuth);
            let dy = f32::from(p.elevation - origin.elevation);
            let want = -PI * (dx * u + dy * w);
            let error = (phase - want + PI).rem_euclid(2.0 * PI) - PI;
            // Half a bin between the bin's middle and the target turns by pi / (2 N) in a slot: 0.025 rad.
            assert!(error.abs() < 0.06, "antenna {}, Doppler bin {doppler}: off by {error} rad", v + 1);
        }
    }
}

#[test]
fn past_the_ambiguity_compensation_fails_as_known() {
    // 36 bins fold to -28: elevation, which is across the slots, is wrong by 2 pi / 3 a slot, azimuth stays right.
    let profile = RadarProfile::bridge();
    let velocity = 36.0 * DOPPLER_BIN;
    let maps = Bench::new(config(profile)).frame(&[scatterer(1.0, velocity)], |_| false);
    let phases = phases(&maps.covariance, 12);
    assert!(phases[..3].iter().all(|p| p.abs() < 0.05), "{phases:?}");
    assert!((phases[3].abs() - 2.094).abs() < 0.1, "{phases:?}");
}

#[test]
fn nothing_moves_in_an_empty_room() {
    let mut bench = Bench::new(config(RadarProfile::bridge()));
    let cells: u32 = (0..5).map(|_| bench.frame(&[scatterer(2.0, 0.0)], |_| false).cells).sum();
    // Of 5 x 72 x 61 cells of noise.
    assert!(cells < 20, "{cells} cells");
}
