//! What a radar's profile and a reader's antennas cost before the host: instructions, bytes.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use rfhoi::plan::Uplink;
use rfhoi::plan::instructions::Instructions;
use rfhoi::receive::{Received, Receiver};
use rfhoi::recognize::radar::Maps;
use rfhoi::replay::packets;
use rfhoi_network::model::Description;
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::RadarProfile;
use serde::{Deserialize, Serialize};

use super::points::Point;
use crate::commands::experiment::runs::{Job, Runs, path};
use crate::commands::experiment::study::sets::Radar;

/// Costs that the network has no part in.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Cost {
    /// Of a frame on the bridge, by the planner's model of QEMU's counts.
    pub(super) mcu_instructions: f64,
    /// From the radar to the bridge.
    pub(super) radar_link_bytes_s: f64,
    /// From the bridge to the host: frames, and reads at the rate of the recording.
    pub(super) host_link_bytes_s: f64,
}

impl Cost {
    /// `packets` are a recording of a bridge with four antennas, of which the first `antennas` are taken.
    pub(super) fn of(radar: &RadarConfig, packets: &[Vec<u8>], antennas: usize) -> Self {
        let RadarConfig { profile, processing, .. } = radar;
        Self {
            mcu_instructions: Instructions::of(profile, processing.gate).total().round(),
            radar_link_bytes_s: profile.raw_bit_rate() / 8.0,
            host_link_bytes_s: Uplink::of(radar, reads_s(packets, antennas)).bit_s / 8.0,
        }
    }
}

/// Reads a second by the first `antennas`.
fn reads_s(packets: &[Vec<u8>], antennas: usize) -> f64 {
    let mut receiver = Receiver::new();
    let (mut reads, mut times) = (0_usize, Vec::new());
    for packet in packets {
        // What is no packet is counted by the receiver.
        let _ = receiver.push(packet);
        while let Some(received) = receiver.next() {
            if let Received::Reads(some) = received {
                reads += some.iter().filter(|read| usize::from(read.antenna.0) <= antennas).count();
                times.extend(some.iter().map(|read| read.time.0));
            }
        }
    }
    match (times.iter().min(), times.iter().max()) {
        (Some(first), Some(last)) if last > first => reads as f64 * 1e6 / (last - first) as f64,
        _ => 0.0,
    }
}

/// A recording by each radar: the packets of its bridge.
pub(super) struct Radars(BTreeMap<&'static str, (RadarProfile, Vec<Vec<u8>>)>);

impl Radars {
    /// Simulates a performance of the site as each radar of `points` sees it; what is in `folder` is not made again.
    pub(super) fn record(folder: &Path, points: &[Point]) -> anyhow::Result<Self> {
        let mut radars = BTreeMap::new();
        for Point { radar: Radar { set, words }, .. } in points {
            if radars.contains_key(set) {
                continue;
            }
            let (file, cfg) = (folder.join(format!("{set}.pcap")), folder.join(format!("{set}.cfg")));
            if !cfg.is_file() {
                let words = words.split_whitespace().map(String::from);
                let common = ["simulate", "--seed", "1", "--as-bridge", "--recording", &path(&file)];
                let words = common.map(String::from).into_iter().chain(words).collect();
                Runs { workers: 1 }.all(&[Job { folder: folder.to_path_buf(), words }])?;
            }
            let profile = rfhoi::profile::load(&path(&cfg), Default::default())?;
            let mut all: Vec<Vec<u8>> = Vec::new();
            packets(&file, None, &mut |_, packet| all.push(packet.to_vec()), &mut |_| true)
                .with_context(|| format!("cannot read {}", file.display()))?;
            radars.insert(*set, (profile, all));
        }
        Ok(Self(radars))
    }

    /// The packets of a radar's bridge, and its configuration as a model's maps need it.
    pub(super) fn of(&self, radar: &Radar, model: &Description) -> anyhow::Result<(&[Vec<u8>], RadarConfig)> {
        let (profile, packets) =
            self.0.get(radar.set).with_context(|| format!("{} was not recorded", radar.set))?;
        Ok((packets, Maps::of(model)?.config(Some(profile))?))
    }
}
