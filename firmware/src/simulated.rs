//! A simulated radar for tests and demonstrations: point scatterers as the words of chirps.
//!
//! After mixing, a path of delay tau is a tone of phase `2 pi tau (f + S t)` at time t from the first sample, f the
//! carrier at that sample and S the slope; the phase grows with the path. A scatterer to the right is nearer to
//! the antennas on the right, so the phase at position (x, y) in half wavelengths is less by `pi (x u + y w)`, with
//! `u = sin(azimuth) cos(elevation)` and `w = sin(elevation)`. Nothing but the phase depends on direction, and
//! nothing on range.

use core::f64::consts::{PI, TAU};

use num_complex::{Complex32, Complex64};
use rfhoi_shared::array::{VirtualAntenna, virtual_antennas};
use rfhoi_shared::radar::{MAX_SAMPLES, RadarProfile};
use rfhoi_shared::units::SPEED_OF_LIGHT;

use crate::dca1000::samples;

/// A point that reflects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatterer {
    /// Distance at time zero, m.
    pub range_m: f64,
    /// Radial velocity, m/s, positive recedes.
    pub velocity_m_s: f64,
    /// To the right, rad.
    pub azimuth_rad: f64,
    /// Upwards, rad.
    pub elevation_rad: f64,
    /// Amplitude relative to full scale.
    pub amplitude: f64,
}

/// Pseudo-random numbers for noise: xorshift64*, the same on every machine.
#[derive(Debug, Clone)]
pub struct Noise {
    state: u64,
    /// Standard deviation of each part, in words of the ADC.
    deviation: f32,
}

impl Noise {
    /// Noise of this standard deviation in ADC words; the same `seed` gives the same noise.
    pub fn new(seed: u64, deviation: f32) -> Self {
        // The state may not be zero.
        Self { state: seed.wrapping_mul(2).wrapping_add(1), deviation }
    }

    #[inline]
    fn bits(&mut self) -> u64 {
        self.state ^= self.state >> 12;
        self.state ^= self.state << 25;
        self.state ^= self.state >> 27;
        self.state.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// The next value, in ADC words: the sum of four uniform ones, near enough to a normal one.
    #[inline]
    pub fn draw(&mut self) -> f32 {
        let bits = self.bits();
        let sum: i32 = (0..4).map(|i| i32::from((bits >> (16 * i)) as i16)).sum();
        // Each has a standard deviation of 2^16 / sqrt(12), four of them twice that.
        const UNIT: f32 = 1.732_050_8 / 65536.0;
        sum as f32 * UNIT * self.deviation
    }
}

/// A radar with this profile.
#[derive(Debug)]
pub struct SimulatedRadar {
    profile: RadarProfile,
    antennas: heapless::Vec<VirtualAntenna, { rfhoi_shared::radar::MAX_VIRTUAL }>,
    samples: [Complex64; MAX_SAMPLES],
}

impl SimulatedRadar {
    /// A radar, or `None` where the profile is invalid or its antennas have no geometry.
    pub fn new(profile: &RadarProfile) -> Option<Self> {
        profile.validate().ok()?;
        let antennas = virtual_antennas(profile)?;
        Some(Self { profile: profile.clone(), antennas, samples: [Complex64::default(); MAX_SAMPLES] })
    }

    /// Writes chirp `index` of `frame`, all receivers, to `out`, which is as long as a chirp's bytes.
    pub fn chirp(
        &mut self,
        scatterers: &[Scatterer],
        noise: &mut Noise,
        frame: u32,
        index: u32,
        out: &mut [u8],
    ) {
        let profile = &self.profile;
        let count = usize::from(profile.samples);
        let time_s = f64::from(frame) * f64::from(profile.frame_period_us) * 1e-6
            + f64::from(index) * profile.chirp_period_ns() as f64 * 1e-9;
        let slope = f64::from(profile.slope_khz_per_us) * 1e9;
        let first_hz = f64::from(profile.start_khz) * 1e3 + slope * f64::from(profile.adc_start_ns) * 1e-9;
        let sample_s = 1e-3 / f64::from(profile.sample_rate_ksps);
        let receivers = profile.rx_count();
        let slot = index as usize % profile.tx_slots().max(1);
        let receiver_bytes = count * profile.format.bytes() as usize;
        for (rx, raw) in out.chunks_exact_mut(receiver_bytes.max(1)).take(receivers).enumerate() {
            let Some(antenna) = self.antennas.get(slot * receivers + rx) else { return };
            let Some(sum) = self.samples.get_mut(..count) else { return };
            sum.fill(Complex64::default());
            for s in scatterers {
                let delay = 2.0 * (s.range_m + s.velocity_m_s * time_s) / SPEED_OF_LIGHT;
                let (u, w) =
                    (libm::sin(s.azimuth_rad) * libm::cos(s.elevation_rad), libm::sin(s.elevation_rad));
                let position = antenna.position;
                let nearer = PI * (f64::from(position.azimuth) * u + f64::from(position.elevation) * w);
                let mut z = turn(TAU * fraction(delay * first_hz) - nearer);
                z *= s.amplitude * 32767.0 * f64::from(antenna.sign);
                let step = turn(TAU * delay * slope * sample_s);
                for x in sum.iter_mut() {
                    *x += z;
                    z *= step;
                }
            }
            let mut words = [Complex32::default(); MAX_SAMPLES];
            for (word, x) in words.iter_mut().zip(sum) {
                *word = Complex32::new(x.re as f32 + noise.draw(), x.im as f32 + noise.draw());
            }
            samples::pack(words.get(..count).unwrap_or(&[]), profile.format, raw);
        }
    }
}

fn turn(radians: f64) -> Complex64 {
    let (sin, cos) = libm::sincos(radians);
    Complex64::new(cos, sin)
}

fn fraction(x: f64) -> f64 {
    x - libm::floor(x)
}
