//! What simulated readers of several cases share: channels, phase codes, the time from read to read, and an arm's reach.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, BridgeTime, CentiDbm, ChannelIndex, PhaseCode, SPEED_OF_LIGHT};

use crate::phase::ChannelPlan;
use crate::simulate::grasp::minimum_jerk;

/// A frame of the radar, us.
pub(super) const FRAME_US: u64 = 100_000;
/// The bridge's time when it begins, us.
pub(super) const EPOCH_US: u64 = 20_000_000;
/// Stay on a channel, us.
pub(super) const DWELL_US: u64 = 200_000;
/// Every fifth channel of the FCC's 50: as wide a band, and all are visited in 2 s.
pub(super) const CHANNELS: usize = 10;
const CHANNEL_STEP: usize = 5;
/// Phase codes come in steps of four, as an R420's.
const CODE_STEP: f64 = 4.0;

/// The channel of this number among those in use.
pub(super) fn channel(number: usize) -> ChannelIndex {
    ChannelIndex((number * CHANNEL_STEP) as u16 + 1)
}

/// Place in the hop table at a time.
pub(super) fn place(time_us: u64) -> usize {
    (time_us / DWELL_US) as usize % CHANNELS
}

/// By how much the phase turns on `channel` where a tag recedes by a metre, rad.
pub(super) fn radians_per_metre(channel: ChannelIndex) -> f64 {
    let frequency = ChannelPlan::fcc().frequency(channel);
    frequency.map_or(0.0, |f| 2.0 * TAU * f64::from(f.0) * 1e3 / SPEED_OF_LIGHT)
}

/// Share of a reach from `begin` to `end` that is done, with least jerk.
pub(super) fn reached(time_us: u64, begin: u64, end: u64) -> f64 {
    minimum_jerk(time_us.saturating_sub(begin) as f64 / (end - begin) as f64).into()
}

/// The time to the next read where it is `step_us` on the average: a few per cent of jitter, as rounds have.
pub(super) fn step_us(step_us: f64, rng: &mut ChaCha8Rng) -> f64 {
    step_us * (1.0 + 0.03 * rng.sample::<f64, _>(StandardNormal)).max(0.5)
}

/// The read of a tag with this number, as the bridge tells of it; antennas count from 0.
pub(super) fn read(time_us: u64, tag: usize, antenna: usize, channel: ChannelIndex, phase: f64) -> TagRead {
    let steps = f64::from(PhaseCode::CODES_PER_TURN) / CODE_STEP;
    let code = ((phase / TAU).rem_euclid(1.0) * steps).round() * CODE_STEP;
    TagRead {
        time: BridgeTime(time_us),
        epc: epc(tag),
        antenna: AntennaPort(antenna as u16 + 1),
        channel,
        phase: Some(PhaseCode(code as u16 % PhaseCode::CODES_PER_TURN)),
        rssi: CentiDbm(-5_000),
        doppler: None,
    }
}

/// The EPC of a tag.
pub(super) fn epc(tag: usize) -> Epc {
    Epc::new(&[0xe2, 0x80, tag as u8]).unwrap_or_default()
}
