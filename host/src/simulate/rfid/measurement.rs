//! What a reader makes of an answer: codes of phase, signal strength and Doppler, with their noise.
//!
//! Fitted to two recordings. "RDA" are pairs of reads of a worn tag 95 to 130 ms apart, of activities in which people
//! keep still (numbers 2, 5, 14, 16; that reader stays on its channel), 134,635 in all, by the tag's signal strength;
//! a spread of one read is that of a difference over the square root of two. "Still" is `Test15-5-0`, a still tag at -40
//! dBm.
//!
//! | what | law here | measured |
//! |---|---|---|
//! | phase noise | 4.8 deg at -65 dBm, as 1 / amplitude | RDA: 7.7, 5.9, 4.8, 3.7, 2.95, 2.2, 1.8 at -69, -67 ... -57 dBm |
//! | its floor | 0.5 deg | Still: 0.54 deg |
//! | weaker than -74 dBm | 0.34 of that noise; half a turn off in 15 of 100 | RDA: 5.0, 6.6, 8.1 deg at -75, -77, -79 dBm; 18 to 26 % of differences are near half a turn, none is near a quarter |
//! | signal strength | 5.1 dB for each rad of phase noise, steps of 0.5 dB | RDA: 0.45 dB at -65, 0.27 dB at -59 dBm, steps included |
//! | Doppler | 790 Hz for each rad of phase noise | RDA: 74, 47, 29, 23 Hz at -66, -62, -58, -54 dBm; Still: 7.2 Hz |
//! | sway | 2.8 deg, 0.1 to 0.9 Hz | Still: within a channel's visits 0.75 deg, over all 2.86 deg; 8.5 deg/s in the middle |
//! | phase steps | 4 codes of 4096 | Still: all 3,114 are multiples of 4; RDA: 99 % |
//!
//! Below -74 dBm that reader seems to have gone over to a slower mode, which takes longer to listen and knows the
//! carrier only up to its sign. The sway is slow enough to be air and people, and is not seen in a difference of reads that
//! follow each other.

use std::f64::consts::{PI, TAU};

use rand::{Rng, RngExt};
use rfhoi_shared::units::{CentiDbm, DopplerCode, PhaseCode};

use super::link::Link;
use super::{db, normal};
use crate::simulate::effects::Effects;

/// Phase noise at [`REFERENCE_DBM`], rad.
const PHASE_NOISE: f64 = 4.8 * PI / 180.0;
const REFERENCE_DBM: f64 = -65.0;
/// Phase noise of the strongest signals, rad.
const PHASE_FLOOR: f64 = 0.5 * PI / 180.0;
/// Weaker signals are received in a slower mode, dBm.
pub(super) const SLOW_DBM: f64 = -74.0;
/// Its phase noise relative to that of the fast mode.
const SLOW_NOISE: f64 = 0.34;
/// Its Doppler noise relative to that of the fast mode: also over a longer time.
const SLOW_DOPPLER: f64 = 0.044;
/// Share of its phases that are half a turn off.
pub(super) const SLOW_FLIPS: f64 = 0.15;
/// Noise of the signal strength, dB for each rad of phase noise.
const RSSI_NOISE: f64 = 5.1;
/// Steps of the signal strength, dBm / 100.
const RSSI_STEP: f64 = 50.0;
/// Noise of the Doppler shift, Hz for each rad of phase noise.
const DOPPLER_NOISE: f64 = 790.0;
/// Steps of a noisy phase, codes.
const PHASE_STEP: u16 = 4;
/// Sway, standard deviation, rad.
const SWAY: f64 = 2.8 * PI / 180.0;
/// Its slowest and fastest part, Hz.
const SWAY_HZ: [f64; 2] = [0.1, 0.9];
const SWAY_PARTS: usize = 3;

/// The slow sway of the phase of one tag and antenna.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sway {
    /// Frequency, Hz, and phase, rad.
    parts: [[f64; 2]; SWAY_PARTS],
}

impl Sway {
    pub(super) fn draw(rng: &mut impl Rng) -> Self {
        let [low, high] = SWAY_HZ;
        let part = |_| [low + (high - low) * rng.random::<f64>(), TAU * rng.random::<f64>()];
        Self { parts: [0; SWAY_PARTS].map(part) }
    }

    fn at(&self, time_s: f64) -> f64 {
        let amplitude = SWAY * (2.0 / SWAY_PARTS as f64).sqrt();
        self.parts.iter().map(|[hertz, phase]| amplitude * libm::sin(TAU * hertz * time_s + phase)).sum()
    }
}

/// Standard deviation of the phase at a signal strength, rad.
pub fn phase_noise(rssi_dbm: f64) -> f64 {
    let thermal = PHASE_NOISE * db::amplitude(REFERENCE_DBM - rssi_dbm);
    let thermal = if rssi_dbm < SLOW_DBM { SLOW_NOISE * thermal } else { thermal };
    (thermal * thermal + PHASE_FLOOR * PHASE_FLOOR).sqrt()
}

/// Codes of a read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measurement {
    pub(super) phase: PhaseCode,
    pub(super) rssi: CentiDbm,
    pub(super) doppler: DopplerCode,
}

/// Measures `link` with the phase offset `offset`, rad, of a tag whose way there and back changes as `doppler_hz` tells.
pub(super) fn measure(
    link: &Link,
    offset: f64,
    doppler_hz: f64,
    sway: (&Sway, f64),
    effects: &Effects,
    rng: &mut impl Rng,
) -> Measurement {
    let (mut phase, mut rssi, mut doppler) = (link.phase + offset, link.rssi_dbm, doppler_hz);
    let slow = rssi < SLOW_DBM;
    if effects.pi_ambiguity && slow && rng.random_bool(SLOW_FLIPS) {
        phase += PI;
    }
    let mut step = 1;
    if effects.phase_error {
        let noise = phase_noise(rssi);
        let listened = if slow { SLOW_DOPPLER / SLOW_NOISE } else { 1.0 };
        phase += noise * normal(rng) + sway.0.at(sway.1);
        rssi += RSSI_NOISE * noise * normal(rng);
        doppler += DOPPLER_NOISE * listened * noise * normal(rng);
        step = PHASE_STEP;
    }
    Measurement {
        phase: phase_code(phase, step),
        rssi: CentiDbm((libm::round(rssi * 100.0 / RSSI_STEP) * RSSI_STEP) as i16),
        doppler: DopplerCode(libm::round(doppler * 16.0) as i16),
    }
}

/// The code nearest to a phase, in rad, that is a multiple of `step`.
fn phase_code(phase: f64, step: u16) -> PhaseCode {
    let steps = f64::from(PhaseCode::CODES_PER_TURN / step);
    let nearest = libm::round((phase / TAU).rem_euclid(1.0) * steps) as u16;
    PhaseCode(nearest * step % PhaseCode::CODES_PER_TURN)
}
