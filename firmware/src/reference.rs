//! A simulated scene through the whole radar path, and a digest of the packets that come out.
//!
//! The same profile gives the same digest on every machine, if its processor and compiler compute as they should: the
//! sum of all that the signal processing and the wire do. Boards print it at first light; tests compare it.

use num_complex::Complex;
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::fnv;
use rfhoi_shared::radar::{DCA1000_PAYLOAD, MAX_RX};
use rfhoi_shared::units::BridgeTime;

use crate::bridge::RadarPath;
use crate::dca1000::{Datagram, HEADER_BYTES};
use crate::simulated::{Noise, Scatterer, SimulatedRadar};
use crate::uplink::Uplink;

/// Bytes of the longest row of the reference: 256 samples; a chirp has 4.
const MAX_ROW: usize = 1024;

/// A hand that moves, a body that hardly does, and a wall.
pub const SCENE: [Scatterer; 3] =
    [scatterer(1.0, 0.8, 0.2, 0.01), scatterer(1.5, 0.1, 0.0, 0.05), scatterer(2.4, 0.0, -0.3, 0.2)];

const fn scatterer(range_m: f64, velocity_m_s: f64, azimuth_rad: f64, amplitude: f64) -> Scatterer {
    Scatterer { range_m, velocity_m_s, azimuth_rad, elevation_rad: 0.0, amplitude }
}

/// The reference's radar: [`SCENE`] with two words of noise.
#[derive(Debug)]
pub struct ReferenceRadar {
    radar: SimulatedRadar,
    noise: Noise,
}

impl ReferenceRadar {
    /// The radar of `config`, or `None` where its antennas have no geometry.
    pub fn new(config: &RadarConfig) -> Option<Self> {
        Some(Self { radar: SimulatedRadar::new(&config.profile)?, noise: Noise::new(2026, 2.0) })
    }

    /// Writes chirp `index` of `frame`; chirps must be asked for in their order.
    pub fn chirp(&mut self, frame: u32, index: u32, out: &mut [u8]) {
        self.radar.chirp(&SCENE, &mut self.noise, frame, index, out);
    }
}

/// FNV-1a hash of all packets, with the length of each, that `frames` frames of the reference lead to; `None` where the
/// path refuses `config`. `memory` holds the cube.
pub fn digest(config: &RadarConfig, frames: u32, memory: &mut [Complex<i16>]) -> Option<u32> {
    let mut radar = ReferenceRadar::new(config)?;
    let mut path = RadarPath::<MAX_ROW>::new(config, memory).ok()?;
    let mut uplink = Uplink::new(0);
    let mut hash = fnv::EMPTY;
    let mut take = |bytes: &[u8]| {
        hash = fnv::more(hash, bytes.iter().chain(&(bytes.len() as u32).to_le_bytes()));
        true
    };
    let mut chirp = [0; MAX_RX * MAX_ROW];
    let chirp = chirp.get_mut(..config.profile.chirp_bytes() as usize)?;
    let mut datagram = heapless::Vec::<u8, { HEADER_BYTES + DCA1000_PAYLOAD as usize }>::new();
    let (mut sequence, mut sent) = (1, 0);
    for frame in 0..frames {
        let now = BridgeTime(u64::from(frame) * u64::from(config.profile.frame_period_us));
        for index in 0..config.profile.chirps_per_frame() {
            radar.chirp(frame, index, chirp);
            for &byte in &*chirp {
                if datagram.is_empty() {
                    datagram.extend(Datagram::header(sequence, sent));
                }
                // Never full here: it is emptied as soon as it is.
                let _ = datagram.push(byte);
                if datagram.is_full() {
                    path.push(now, &datagram, &mut uplink, |_, bytes| take(bytes));
                    sent += u64::from(DCA1000_PAYLOAD);
                    sequence += 1;
                    datagram.clear();
                }
            }
        }
    }
    path.push(BridgeTime(0), &datagram, &mut uplink, |_, bytes| take(bytes));
    Some(hash)
}

#[cfg(test)]
mod tests {
    use std::vec;

    use rfhoi_shared::config::{Processing, RadarInput};
    use rfhoi_shared::radar::RadarProfile;

    use super::*;

    #[test]
    fn the_digest_tells_configurations_apart_and_nothing_else() {
        let profile = RadarProfile::bridge();
        let processing = Processing::with_gate(&profile, profile.gate_to(rfhoi_shared::units::Metres(3.05)));
        let config = RadarConfig { profile, input: RadarInput::Uart, processing };
        let run = |config: &RadarConfig| {
            let mut memory = vec![Complex::default(); 72 * 12 * 64];
            digest(config, 2, &mut memory).unwrap()
        };
        assert_eq!(run(&config), run(&config));
        let mut other = config.clone();
        other.processing.range_time_columns = 4;
        assert_ne!(run(&config), run(&other));
        assert_eq!(digest(&config, 1, &mut []), None);
    }
}
