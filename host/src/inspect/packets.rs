//! Recordings of packets: what radar, reader and bridge said on the network.

use std::collections::BTreeMap;
use std::net::SocketAddrV4;

use rfhoi_firmware::dca1000::{self, Event, Reassembly};
use rfhoi_shared::config::LLRP_PORT;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::wire::BRIDGE_PORT;
use serde::Serialize;

use super::adc::MAX_ROW;
use super::{Builder, InspectError, Options, Report, llrp};
use crate::receive::{LinkCounts, Receiver};
use crate::recording::{Protocol, Recording};

#[derive(Debug, Serialize)]
struct RadarFigures {
    datagrams: u32,
    datagrams_lost: u32,
    datagrams_duplicate: u32,
    datagrams_late: u32,
    datagrams_malformed: u32,
    restarts: u32,
    frames_complete: Option<u32>,
    frames_incomplete: Option<u32>,
    frames_lost: Option<u32>,
}

#[derive(Debug, Serialize)]
struct Figures {
    packets: u64,
    duration_s: f64,
    radar: Option<RadarFigures>,
    radar_commands: u64,
    reader: Option<llrp::Figures>,
    client_messages: u64,
    uplink: Option<LinkCounts>,
    other_datagrams: u64,
    other_streams_bytes: u64,
    packets_of_other_protocols: u64,
    packets_cut: u64,
    packets_malformed: u64,
    tcp_bytes_missing: u64,
}

#[derive(Debug, Serialize)]
struct FramePart {
    time_s: f64,
    frame: u32,
    chirps_lost: u32,
}

pub(super) fn inspect(mut builder: Builder<'_>, options: &Options) -> Result<Report, InspectError> {
    let mut recording = Recording::open(&builder.path)?;
    let default = RadarProfile::default();
    // Datagrams can be counted without knowing the profile, frames cannot.
    let profile = options.profile.as_ref();
    let mut reassembly = Reassembly::<MAX_ROW>::new(profile.unwrap_or(&default))
        .ok_or_else(|| builder.too_little("the profile's chirps are longer than any radar's"))?;
    let mut receiver = Receiver::new();
    let mut reader: Option<llrp::Stream> = None;
    let mut client: BTreeMap<SocketAddrV4, llrp::Stream> = BTreeMap::new();
    let (mut radar_commands, mut other_datagrams, mut other_streams_bytes) = (0, 0, 0);
    let (mut radar, mut uplink, mut last_us) = (false, false, 0);
    while let Some(record) = recording.next() {
        let record = record?;
        last_us = record.time_us;
        let ports = (record.source.port(), record.destination.port());
        match (record.protocol, ports) {
            (Protocol::Udp, (_, dca1000::DATA_PORT)) => {
                radar = true;
                reassembly.push(&record.payload, |event| {
                    if let (Event::FrameEnd { frame, chirps_lost }, true) = (event, profile.is_some()) {
                        builder.part(FramePart { time_s: record.time_us as f64 * 1e-6, frame, chirps_lost });
                    }
                });
            }
            (Protocol::Udp, (dca1000::CONFIG_PORT, _) | (_, dca1000::CONFIG_PORT)) => radar_commands += 1,
            (Protocol::Udp, (BRIDGE_PORT, _)) => {
                uplink = true;
                // What is wrong is counted.
                let _ = receiver.push(&record.payload);
                while receiver.next().is_some() {}
            }
            (Protocol::Udp, _) => other_datagrams += 1,
            (Protocol::Tcp { continues }, (LLRP_PORT, _) | (_, LLRP_PORT)) => {
                let stream = if ports.0 == LLRP_PORT {
                    reader.get_or_insert_with(llrp::Stream::new)
                } else {
                    client.entry(record.source).or_insert_with(llrp::Stream::new)
                };
                if !continues {
                    stream.reset();
                }
                if let Err(error) = stream.push(&record.payload, |_, _| {}) {
                    builder.note(format!(
                        "at {:.6} s, {}: {error}",
                        record.time_us as f64 * 1e-6,
                        record.source
                    ));
                }
            }
            (Protocol::Tcp { .. }, _) => other_streams_bytes += record.payload.len() as u64,
        }
        builder.go_on(recording.share_read())?;
    }
    let counts = recording.counts();
    if counts.packets == 0 {
        return Err(
            builder.too_little("a recording without packets: did the capture filter leave anything in?")
        );
    }
    let (datagrams, frames) = (reassembly.datagrams(), reassembly.frames());
    if radar && profile.is_none() {
        builder.note("give --profile to count radar frames");
    }
    let of_frames = |count: u32| profile.map(|_| count);
    let radar = radar.then(|| RadarFigures {
        datagrams: datagrams.received,
        datagrams_lost: datagrams.lost,
        datagrams_duplicate: datagrams.duplicate,
        datagrams_late: datagrams.late,
        datagrams_malformed: datagrams.malformed,
        restarts: datagrams.restarts,
        frames_complete: of_frames(frames.complete),
        frames_incomplete: of_frames(frames.incomplete),
        frames_lost: of_frames(frames.lost),
    });
    let figures = Figures {
        packets: counts.packets,
        duration_s: last_us as f64 * 1e-6,
        radar,
        radar_commands,
        reader: reader.map(|s| s.figures.finish()),
        client_messages: client.values().map(|s| s.figures.messages()).sum(),
        uplink: uplink.then(|| receiver.counts()),
        other_datagrams,
        other_streams_bytes,
        packets_of_other_protocols: counts.other,
        packets_cut: counts.cut,
        packets_malformed: counts.malformed,
        tcp_bytes_missing: counts.missing_bytes,
    };
    Ok(builder.finish("packets", figures))
}
