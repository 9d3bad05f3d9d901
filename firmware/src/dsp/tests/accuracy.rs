//! Every stage against a direct DFT in double precision, with a fixed seed.

use std::f64::consts::TAU;
use std::format;
use std::string::String;
use std::vec;
use std::vec::Vec;

use expect_test::expect;
use num_complex::{Complex, Complex32, Complex64};
use rfhoi_shared::config::{ClutterRemoval, Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::{RadarProfile, RangeGate};

use crate::dsp::{Cube, CubeShape, DopplerStage, RangeStage};
use crate::simulated::Noise;

/// Errors of one stage.
#[derive(Default)]
struct Errors {
    max: f64,
    squares: f64,
    count: usize,
}

impl Errors {
    fn add(&mut self, got: Complex64, want: Complex64) {
        let error = (got - want).norm();
        self.max = self.max.max(error);
        self.squares += error * error;
        self.count += 1;
    }

    fn max_db(&self) -> f64 {
        20.0 * self.max.log10()
    }

    fn line(&self, stage: &str) -> String {
        let rms = (self.squares / self.count as f64).sqrt();
        format!("{stage:<34} max {:>4.0} dB, RMS {:>4.0} dB\n", self.max_db(), 20.0 * rms.log10())
    }
}

fn hann(length: usize) -> Vec<f64> {
    (0..length).map(|n| (1.0 - (TAU * (n as f64 + 0.5) / length as f64).cos()) / length as f64).collect()
}

fn dft(x: &[Complex64]) -> Vec<Complex64> {
    let n = x.len();
    let turn = |k: usize| Complex64::from_polar(1.0, -TAU * (k % n) as f64 / n as f64);
    (0..n).map(|k| x.iter().enumerate().map(|(i, x)| x * turn(i * k)).sum()).collect()
}

fn wide(z: &Complex32) -> Complex64 {
    Complex64::new(z.re.into(), z.im.into())
}

fn wide_cell(z: Complex<i16>, scale: f32) -> Complex64 {
    Complex64::new(z.re.into(), z.im.into()) * f64::from(scale)
}

/// Words of one frame: a static tone near full scale, two that move, and noise of one word.
fn frame(profile: &RadarProfile) -> Vec<u8> {
    /// Amplitude, range bin, turns from chirp to chirp.
    const TONES: [(f64, f64, f64); 3] = [(0.8, 7.3, 0.0), (0.1, 40.6, 0.0713), (0.01, 63.0, -0.11)];
    let n = usize::from(profile.samples);
    let mut noise = Noise::new(2026, 1.0);
    let mut words = Vec::new();
    for chirp in 0..profile.chirps_per_frame() {
        for rx in 0..profile.rx_count() {
            let sample = |i: usize| -> Complex64 {
                let tone = |(a, k, v): (f64, f64, f64)| {
                    let turns = k * i as f64 / n as f64 + v * f64::from(chirp) + k * rx as f64;
                    Complex64::from_polar(a, TAU * turns)
                };
                TONES.into_iter().map(tone).sum()
            };
            for pair in 0..n / 2 {
                let [z0, z1] = [sample(2 * pair), sample(2 * pair + 1)];
                for x in [z0.im, z1.im, z0.re, z1.re] {
                    words.extend(((x * 32767.0) as i16).saturating_add(noise.draw() as i16).to_le_bytes());
                }
            }
        }
    }
    words
}

#[test]
fn stages_against_double_precision() {
    let profile = RadarProfile::bridge();
    let gate = RangeGate { first: 0, bins: 72 };
    let mut processing = Processing::with_gate(&profile, gate);
    processing.clutter = ClutterRemoval::Mean;
    let config = RadarConfig { processing, input: RadarInput::Uart, profile };
    let profile = &config.profile;
    let shape = CubeShape::of(&config);
    let (samples, loops, virtuals) = (usize::from(profile.samples), shape.loops, shape.virtuals);

    let words = frame(profile);
    let mut range = RangeStage::new();
    range.configure(profile, gate);
    let mut memory = vec![Complex::default(); shape.cells()];
    let mut cube = Cube::new(&mut memory);
    assert!(cube.reshape(shape));

    let range_window = hann(samples);
    let (mut range_errors, mut cube_errors) = (Errors::default(), Errors::default());
    for (index, chirp) in words.chunks(profile.chirp_bytes() as usize).enumerate() {
        for (rx, receiver) in chirp.chunks(samples * 4).enumerate() {
            range.row(index as u32, rx as u32, receiver, &mut cube);
            let word = |i: usize| f64::from(i16::from_le_bytes([receiver[2 * i], receiver[2 * i + 1]]));
            let z = |n: usize| Complex64::new(word(n / 2 * 4 + 2 + n % 2), word(n / 2 * 4 + n % 2));
            let windowed: Vec<_> = (0..samples).map(|n| z(n) * range_window[n] / 32768.0).collect();
            let want = dft(&windowed);
            for (got, want) in range.spectrum(receiver).0.iter().zip(&want) {
                range_errors.add(wide(got), *want);
            }
            let (v, l) = (index % 3 * 4 + rx, index / 3);
            let scale = cube.scales(v).nth(l).unwrap().unwrap();
            for (bin, want) in want.iter().enumerate().take(72) {
                cube_errors.add(wide_cell(cube.row(bin, v)[l], scale), *want);
            }
        }
    }

    let mut stage = DopplerStage::new();
    stage.configure(&config);
    stage.begin(&cube);
    let doppler_window = hann(loops);
    let [mut doppler, mut power, mut time, mut covariance] = <[Errors; 4]>::default();
    let mut want_covariance = vec![Complex64::default(); virtuals * virtuals];
    for bin in 0..shape.bins {
        let cells_before = stage.finish().cells();
        let row = stage.range_bin(&cube, bin);
        let got_power: Vec<f32> = row.doppler().collect();
        let got_time = row.time.to_vec();
        let mut want_power = vec![0.0; loops];
        let mut want_time = vec![0.0; got_time.len()];
        let mut spectra = Vec::new();
        for v in 0..virtuals {
            let cells: Vec<_> =
                cube.row(bin, v).iter().zip(cube.scales(v)).map(|(&z, s)| wide_cell(z, s.unwrap())).collect();
            let mean: Complex64 = cells.iter().zip(&doppler_window).map(|(z, w)| z * w).sum();
            let moving: Vec<_> = cells.iter().map(|z| z - mean).collect();
            let columns = got_time.len();
            for (l, z) in moving.iter().enumerate().filter(|_| v % 4 == 0) {
                want_time[l * columns / loops] +=
                    z.norm_sqr() * columns as f64 / (loops * virtuals / 4) as f64;
            }
            let windowed: Vec<_> = moving.iter().zip(&doppler_window).map(|(z, w)| z * w).collect();
            let spectrum = dft(&windowed);
            for (got, want) in stage.spectra[v].iter().zip(&spectrum) {
                doppler.add(wide(got), *want);
            }
            for (p, x) in want_power.iter_mut().zip(&spectrum) {
                *p += x.norm_sqr() / virtuals as f64;
            }
            spectra.push(spectrum);
        }
        want_power.rotate_left(loops / 2);
        for (got, want) in got_power.iter().zip(&want_power) {
            power.add(f64::from(*got).into(), (*want).into());
        }
        for (got, want) in got_time.iter().zip(&want_time) {
            time.add(f64::from(*got).into(), (*want).into());
        }
        // The strongest cells of this bin outside the guard, as many as were taken.
        let taken = (stage.finish().cells() - cells_before) as usize;
        let mut order: Vec<usize> = (2..loops - 1).collect();
        let half = loops / 2;
        order.sort_by(|&a, &b| want_power[(b + half) % loops].total_cmp(&want_power[(a + half) % loops]));
        for &d in &order[..taken] {
            let signed = if d < half { d as f64 } else { d as f64 - loops as f64 };
            let turn =
                |v: usize| Complex64::from_polar(1.0, -TAU * signed * (v / 4) as f64 / (3 * loops) as f64);
            let x: Vec<_> = (0..virtuals).map(|v| spectra[v][d] * turn(v)).collect();
            for i in 0..virtuals {
                for j in 0..virtuals {
                    want_covariance[i * virtuals + j] += x[i] * x[j].conj();
                }
            }
        }
    }
    let moving = stage.finish();
    let mut packed = moving.covariance();
    for i in 0..virtuals {
        for j in i..virtuals {
            let re = packed.next().unwrap();
            let im = if i == j { 0.0 } else { packed.next().unwrap() };
            let want = want_covariance[i * virtuals + j] / f64::from(moving.cells());
            covariance.add(Complex64::new(re.into(), im.into()), want);
        }
    }
    assert!(packed.next().is_none() && moving.cells() > 0);

    let table = [
        range_errors.line("window and range FFT (f32)"),
        cube_errors.line("gated cube (i16, block exponent)"),
        doppler.line("clutter, window, Doppler FFT (f32)"),
        power.line("range-Doppler power (f32)"),
        time.line("range-time power (f32)"),
        covariance.line("covariance of moving cells (f32)"),
    ];
    for errors in [&range_errors, &doppler, &power, &time, &covariance] {
        assert!(errors.max_db() < -100.0, "an f32 stage is off by {:.1} dB", errors.max_db());
    }
    assert!(cube_errors.max_db() < -80.0);
    expect![[r#"
        window and range FFT (f32)         max -136 dB, RMS -158 dB
        gated cube (i16, block exponent)   max  -93 dB, RMS  -99 dB
        clutter, window, Doppler FFT (f32) max -147 dB, RMS -176 dB
        range-Doppler power (f32)          max -178 dB, RMS -215 dB
        range-time power (f32)             max -181 dB, RMS -202 dB
        covariance of moving cells (f32)   max -201 dB, RMS -207 dB
    "#]]
    .assert_eq(&table.concat());
}
