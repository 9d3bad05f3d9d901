//! What the bridge sends: packets encoded as it would, and counted.

use num_complex::Complex;
use rfhoi_firmware::bridge::{FrameDone, Mapping};
use rfhoi_firmware::dsp::{Cube, CubeShape, DopplerStage};
use rfhoi_firmware::uplink::{ReadPacker, Uplink as Encoder};
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, BridgeTime, CentiDbm, ChannelIndex, DopplerCode, PhaseCode};
use rfhoi_shared::wire::Message;
use serde::Serialize;

/// Packets on their way to the host.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Uplink {
    /// Bytes of a radar frame's packets: maps, covariance, losses.
    pub frame_bytes: usize,
    /// Their number.
    pub frame_packets: usize,
    /// Tag reads of all antennas, 1/s.
    pub reads_s: f64,
    /// All of it, bit/s, without the headers of UDP.
    pub bit_s: f64,
}

impl Uplink {
    /// What a bridge with this radar sends, and a reader that reads so often.
    pub fn of(config: &RadarConfig, reads_s: f64) -> Self {
        let (mut frame_bytes, mut frame_packets) = (0, 0);
        frames(config, |packets| {
            frame_bytes = packets.iter().map(Vec::len).sum();
            frame_packets = packets.len();
            false
        });
        let frames_s = 1e6 / f64::from(config.profile.frame_period_us);
        let bytes_s = frame_bytes as f64 * frames_s + read_bytes_s(reads_s);
        Self { frame_bytes, frame_packets, reads_s, bit_s: 8.0 * bytes_s }
    }
}

/// Calls `each` with the packets of frame after frame, until it says no. Nothing is in the maps, whose size is the same
/// whatever is.
pub(super) fn frames(config: &RadarConfig, mut each: impl FnMut(&[Vec<u8>]) -> bool) {
    let shape = CubeShape::of(config);
    let mut memory = vec![Complex::default(); shape.cells()];
    let mut cube = Cube::new(&mut memory);
    cube.reshape(shape);
    let mut encoder = Encoder::new(0);
    let mut mapping = Mapping::new(config, Box::new(DopplerStage::new()));
    let mut packets: Vec<Vec<u8>> = Vec::new();
    for frame in 0.. {
        packets.clear();
        let time = BridgeTime(u64::from(frame) * u64::from(config.profile.frame_period_us));
        let done = FrameDone { frame, time, last: time, ..FrameDone::default() };
        mapping.frame(time, &cube, done, &mut encoder, &mut |_, packet| {
            packets.push(packet.to_vec());
            true
        });
        if !each(&packets) {
            return;
        }
    }
}

/// Bytes of a second of reads, evenly spaced.
fn read_bytes_s(reads_s: f64) -> f64 {
    const SECOND_US: u64 = 1_000_000;
    let mut encoder = Encoder::new(0);
    let mut packer = ReadPacker::default();
    let mut bytes = 0;
    for number in 0..reads_s as u64 {
        let now = BridgeTime(number * SECOND_US / reads_s as u64);
        let read = TagRead {
            time: now,
            epc: Epc::from_hex("e28069950000501800000001").unwrap_or_default(),
            antenna: AntennaPort(1),
            channel: ChannelIndex(50),
            phase: Some(PhaseCode(4095)),
            rssi: CentiDbm(-6_000),
            doppler: Some(DopplerCode(-1_000)),
        };
        let mut emit = |message: Message<'_>| {
            encoder.send(now, message, |_, packet| {
                bytes += packet.len();
                true
            });
        };
        packer.tick(now, &mut emit);
        packer.push(now, read, &mut emit);
    }
    bytes as f64
}
