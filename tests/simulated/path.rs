//! The radar's path alone: datagrams in the order of arrival, through the bridge, to frames at the host.

use num_complex::Complex;
use rfhoi::receive::{HeatMap, LinkCounts, RadarFrame};
use rfhoi_firmware::bridge::RadarPath;
use rfhoi_firmware::dsp::CubeShape;
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{DatagramCounts, FrameCounts};

use super::network::Network;
use super::world::{Host, ROW};

/// Memory for the gated cube of `config`.
pub fn cube_memory(config: &RadarConfig) -> Vec<Complex<i16>> {
    vec![Complex::default(); CubeShape::of(config).cells()]
}

/// What the bridge made of datagrams.
#[derive(Debug)]
pub struct Packets {
    /// Its packets in order.
    pub packets: Vec<Vec<u8>>,
    /// Its counts of datagrams.
    pub datagrams: DatagramCounts,
    /// Its counts of frames.
    pub frames: FrameCounts,
}

/// Runs a bridge that has started for the `boot`th time.
///
/// # Panics
/// If the configuration is invalid.
pub fn packets(
    config: &RadarConfig,
    boot: u16,
    arrivals: impl IntoIterator<Item = (BridgeTime, Vec<u8>)>,
) -> Packets {
    let mut memory = cube_memory(config);
    let mut path = RadarPath::<ROW>::new(config, &mut memory).expect("the configuration is valid");
    let mut uplink = Uplink::new(boot);
    let mut packets = Vec::new();
    let mut last = BridgeTime(0);
    let mut keep = |_, packet: &[u8]| {
        packets.push(packet.to_vec());
        true
    };
    for (time, datagram) in arrivals {
        path.push(time, &datagram, &mut uplink, &mut keep);
        last = time;
    }
    path.finish(last, &mut uplink, &mut keep);
    let (datagrams, frames) = (path.datagrams(), path.frames());
    Packets { packets, datagrams, frames }
}

/// What bridge and host made of datagrams.
#[derive(Debug)]
pub struct Outcome {
    /// Frames at the host.
    pub frames: Vec<RadarFrame>,
    /// The bridge's counts of datagrams.
    pub datagrams: DatagramCounts,
    /// The bridge's counts of frames.
    pub frame_counts: FrameCounts,
    /// The host's counts of packets.
    pub link: LinkCounts,
}

/// Runs bridge and host, all packets arriving.
pub fn run(config: &RadarConfig, arrivals: impl IntoIterator<Item = (BridgeTime, Vec<u8>)>) -> Outcome {
    let Packets { packets, datagrams, frames } = packets(config, 1, arrivals);
    let mut host = Host::default();
    packets.iter().for_each(|packet| host.take(packet));
    host.finish();
    let link = host.receiver.counts();
    Outcome { frames: host.frames().cloned().collect(), datagrams, frame_counts: frames, link }
}

/// Sends all of `source` over a network; what arrives, in order, with the times of arrival.
pub fn carry(
    network: &mut Network,
    source: impl IntoIterator<Item = (BridgeTime, Vec<u8>)>,
) -> Vec<(BridgeTime, Vec<u8>)> {
    for (time, datagram) in source {
        network.send(time, datagram);
    }
    let next = || network.next_arrival().and_then(|time| Some((time, network.arrive(time)?)));
    std::iter::from_fn(next).collect()
}

/// Row, column and level in dB of a map's strongest cell.
pub fn strongest(map: &HeatMap) -> (usize, usize, f32) {
    let cells = (0..map.arrived.len()).flat_map(|row| (0..map.columns).map(move |column| (row, column)));
    let cells = cells.map(|(row, column)| (row, column, map.level_db(row, column)));
    cells.filter(|cell| !cell.2.is_nan()).max_by(|a, b| a.2.total_cmp(&b.2)).unwrap_or((0, 0, f32::NAN))
}
