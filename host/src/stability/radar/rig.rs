//! Scatterers to frames: a simulated radar, the bridge's path, and the host's receiver.

use num_complex::Complex;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rfhoi_firmware::bridge::RadarPath;
use rfhoi_firmware::dca1000::Datagram;
use rfhoi_firmware::simulated::{Noise, Scatterer, SimulatedRadar};
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::{ClutterRemoval, Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::{DCA1000_PAYLOAD, RadarProfile};
use rfhoi_shared::units::{BridgeTime, Metres};

use crate::maps::{MapPair, PairState};
use crate::receive::{RadarFrame, Received, Receiver};

/// Noise of the ADC's words: what a receiver has and more than rounding.
const NOISE_WORDS: f32 = 2.0;

/// A small profile, so that many draws take little time.
pub(super) fn config(samples: u16, loops: u16, clutter: ClutterRemoval) -> RadarConfig {
    let profile = RadarProfile { samples, loops, ..RadarProfile::bridge() };
    let gate = profile.gate_to(Metres(f32::MAX));
    let processing = Processing { clutter, ..Processing::with_gate(&profile, gate) };
    RadarConfig { profile, input: RadarInput::Uart, processing }
}

/// A scatterer straight ahead.
pub(super) fn ahead(range_m: f64, velocity_m_s: f64, amplitude: f64) -> Scatterer {
    Scatterer { range_m, velocity_m_s, azimuth_rad: 0.0, elevation_rad: 0.0, amplitude }
}

/// An amplitude of so many dB of full scale.
pub(super) fn amplitude(db: f64) -> f64 {
    10.0_f64.powf(db / 20.0)
}

/// The frames of a scene; `lost` says which of a frame's chirps the network loses.
pub(super) fn frames(
    config: &RadarConfig,
    count: u32,
    rng: &mut ChaCha8Rng,
    scene: impl Fn(u32) -> Vec<Scatterer>,
    lost: impl Fn(u32) -> bool,
) -> Vec<RadarFrame> {
    /// Bytes of a chirp of one receiver, at most.
    const ROW: usize = 512;
    let profile = &config.profile;
    let mut noise = Noise::new(rng.random(), NOISE_WORDS);
    let mut memory = vec![Complex::default(); profile.cube_bytes(config.processing.gate) as usize / 4];
    let Ok(mut path) = RadarPath::<ROW>::new(config, &mut memory).map(Box::new) else { return Vec::new() };
    let Some(mut radar) = SimulatedRadar::new(profile) else { return Vec::new() };
    let (mut uplink, mut receiver) = (Uplink::new(1), Receiver::new());
    let chirp_bytes = profile.chirp_bytes() as usize;
    let mut bytes = vec![0; chirp_bytes];
    let mut offset = 0u64;
    let mut sequence = 0;
    let send = |receiver: &mut Receiver, bytes: &[u8]| receiver.push(bytes).is_ok();
    let parts = chirp_bytes.div_ceil(DCA1000_PAYLOAD as usize);
    for frame in 0..count {
        let scatterers = scene(frame);
        for chirp in 0..profile.chirps_per_frame() {
            // Datagrams that end with a chirp, so that each loss is that of whole chirps. Nothing tells a radar's start or
            // end but its first and last bytes.
            let dropped = lost(chirp) && (frame, chirp) != (0, 0);
            if !dropped {
                radar.chirp(&scatterers, &mut noise, frame, chirp, &mut bytes);
            }
            for part in bytes.chunks(chirp_bytes.div_ceil(parts)) {
                sequence += 1;
                if !dropped {
                    let datagram = [&Datagram::header(sequence, offset), part].concat();
                    path.push(BridgeTime(offset), &datagram, &mut uplink, |_, b| send(&mut receiver, b));
                }
                offset += part.len() as u64;
            }
        }
    }
    path.finish(BridgeTime(offset), &mut uplink, |_, b| send(&mut receiver, b));
    receiver.finish();
    std::iter::from_fn(|| receiver.next())
        .filter_map(|r| if let Received::Frame(frame) = r { Some(frame) } else { None })
        .collect()
}

/// A frame's range-Doppler square with a point for each range bin, and what is known of both.
pub(super) fn square(config: &RadarConfig, frame: &RadarFrame) -> Option<(Vec<f32>, PairState)> {
    let points = usize::from(config.processing.gate.bins);
    let mut pair = MapPair::new(config, points).ok()?;
    let (mut range_doppler, mut range_time) = (vec![0.0; points * points], vec![0.0; points * points]);
    let state = pair.frame(frame, &mut range_doppler, &mut range_time);
    Some((range_doppler, state))
}

/// Range bin of the strongest cell of a frame's map, as it came, and its column and level in dB.
pub(super) fn strongest(frame: &RadarFrame) -> Option<(f64, f64, f64)> {
    let map = frame.range_doppler.as_ref()?;
    let (at, _) = map.codes.iter().enumerate().max_by_key(|&(_, code)| code)?;
    let (row, column) = (at / map.columns, at % map.columns);
    Some((row as f64, column as f64, f64::from(map.scale.level_db(map.codes[at]))))
}
