//! Levels: from radar cross sections to words of the ADC.

use std::f32::consts::PI;

use glam::Vec3;
use rfhoi_firmware::dca1000::samples::FULL_SCALE;
use rfhoi_shared::radar::RadarProfile;

/// Power of a transmitter, dBm: 20 mW, as TI gives it for the AWR1843AOP.
const TRANSMIT_DBM: f32 = 13.0;
/// Gain of an antenna on its boresight, dBi, from the same source.
const ANTENNA_DBI: f32 = 5.0;
/// Noise figure of a receiver, dB (AWR1843 data sheet, 77 to 81 GHz).
const NOISE_FIGURE_DB: f32 = 15.0;
/// Thermal noise in 1 Hz at 290 K, dBm.
const KT_DBM: f32 = -174.0;
/// One-way gain falls as this power of the cosine of the angle off boresight: -3 dB at 60 degrees, as a patch antenna.
const PATTERN_EXPONENT: f32 = 1.0;

/// Standard deviation of a word (I or Q) by thermal noise at [`NOISE_RATE_KSPS`], fitted to recordings of an AWR1642
/// with a DCA1000: 13.0 and 13.1 words in range bins 60 to 120 of two recordings at 10 Msps, where nothing reflects.
const NOISE_WORDS: f32 = 13.0;
/// Sample rate of these recordings, ksps.
const NOISE_RATE_KSPS: f32 = 10_000.0;

/// Standard deviation of the carrier from chirp to chirp, Hz. A path of delay tau turns by `2 pi tau` times that.
/// Fitted to the same recordings: echoes of still things 2.15 m and 3.7 m away turn by 1.4 and 1.9 mrad from chirp to
/// chirp, in common for all receivers, after thermal noise is taken off: 16 and 12 kHz.
pub(super) const CARRIER_JITTER_HZ: f32 = 14e3;

/// What levels depend on.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrontEnd {
    /// Amplitude, relative to full scale, of an echo of 1 m2 at 1 m on boresight.
    reference: f32,
    /// The same of a mirror that sends the wave back to the radar, after 1 m of way.
    mirror: f32,
    /// Standard deviation of I and of Q by thermal noise, relative to full scale.
    pub(super) noise: f32,
    pattern: bool,
}

impl FrontEnd {
    pub(super) fn new(profile: &RadarProfile, pattern: bool) -> Self {
        // White noise: its power in the band of the samples grows with their rate.
        let rate_ksps = profile.sample_rate_ksps as f32;
        let noise = NOISE_WORDS / FULL_SCALE * libm::sqrtf(rate_ksps / NOISE_RATE_KSPS);
        let noise_dbm = KT_DBM + 10.0 * libm::log10f(rate_ksps * 1e3) + NOISE_FIGURE_DB;
        // Power of the complex noise, 2 noise^2 of full scale, is `noise_dbm`.
        let full_scale_dbm = noise_dbm - 10.0 * libm::log10f(2.0 * noise * noise);
        let isotropic_db = TRANSMIT_DBM + 2.0 * ANTENNA_DBI - full_scale_dbm;
        let wavelength_m = profile.wavelength().0;
        let amplitude = libm::exp10f(isotropic_db / 20.0);
        // P lambda^2 sigma / ((4 pi)^3 R^4), and P lambda^2 / (4 pi R)^2 (Skolnik, "Introduction to Radar Systems", 1.2).
        Self {
            reference: amplitude * wavelength_m / libm::powf(4.0 * PI, 1.5),
            mirror: amplitude * wavelength_m / (4.0 * PI),
            noise,
            pattern,
        }
    }

    /// Amplitude of an echo of cross section `sigma_m2`, relative to full scale. `out` and `back` are where the wave
    /// leaves to and comes from, in the radar's axes, as long as the ways, m.
    pub(super) fn echo(&self, sigma_m2: f32, out: Vec3, back: Vec3) -> f32 {
        let (out_m, back_m) = (out.length(), back.length());
        self.reference * libm::sqrtf(sigma_m2 * self.gain(out / out_m) * self.gain(back / back_m))
            / (out_m * back_m)
    }

    /// Amplitude of the radar's own wave that comes back from a mirror, whose image of the radar is at `image`.
    pub(super) fn reflection(&self, reflectivity: f32, image: Vec3) -> f32 {
        let way_m = image.length();
        self.mirror * libm::sqrtf(reflectivity) * self.gain(image / way_m) / way_m
    }

    /// One-way power gain towards a unit vector in the radar's axes, relative to boresight.
    fn gain(&self, direction: Vec3) -> f32 {
        if !self.pattern {
            return if direction.y > 0.0 { 1.0 } else { 0.0 };
        }
        libm::powf(direction.y.max(0.0), PATTERN_EXPONENT)
    }
}

/// Cross section, m2, of a facet of `area_m2` that scatters as Lambert's law says, seen under `cos_in` and `cos_out`:
/// `4 rho A cos cos` (a Lambertian surface sends `rho cos / pi` of what falls on it into the unit of solid angle).
pub(super) fn lambert(reflectivity: f32, area_m2: f32, cos_in: f32, cos_out: f32) -> f32 {
    4.0 * reflectivity * area_m2 * cos_in * cos_out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_falls_with_the_fourth_power_of_range() {
        let front_end = FrontEnd::new(&RadarProfile::bridge(), false);
        let level = |r: f32| 20.0 * front_end.echo(1.0, Vec3::Y * r, Vec3::Y * r).log10();
        for r in [0.7, 1.0, 2.3] {
            assert!((level(r) - level(2.0 * r) - 12.041).abs() < 0.01);
        }
        // The radar equation by hand: 13 + 10 - 48.2 - 33 - 12 dBm against -95.6 dBm of noise at NOISE_FIGURE_DB.
        let noise_db = 10.0 * (2.0 * front_end.noise * front_end.noise).log10();
        assert!((level(2.0) - noise_db - 25.3).abs() < 0.3, "{}", level(2.0) - noise_db);
    }

    #[test]
    fn the_pattern_takes_three_db_each_way_at_60_degrees() {
        let front_end = FrontEnd::new(&RadarProfile::bridge(), true);
        let off = Vec3::new(3f32.sqrt() / 2.0, 0.5, 0.0);
        let ratio = front_end.echo(1.0, off, off) / front_end.echo(1.0, Vec3::Y, Vec3::Y);
        assert!((20.0 * ratio.log10() + 6.02).abs() < 0.01);
        assert_eq!(front_end.echo(1.0, -Vec3::Y, Vec3::Y), 0.0);
    }
}
