//! Recordings of every kind into the bridge.

use std::collections::HashMap;
use std::net::SocketAddrV4;
use std::path::Path;

use rfhoi_firmware::dca1000;
use rfhoi_firmware::llrp::capabilities::Capabilities;
use rfhoi_firmware::llrp::clock::ReaderClock;
use rfhoi_firmware::llrp::decode::Incoming;
use rfhoi_firmware::llrp::frame::Framer;
use rfhoi_firmware::llrp::message::{Message, MessageType};
use rfhoi_firmware::llrp::report::{Repeated, TagReports};
use rfhoi_shared::config::{LLRP_PORT, RadarConfig};
use rfhoi_shared::units::{AntennaPort, BridgeTime, ReaderTime};
use rfhoi_shared::wire::BRIDGE_PORT;

use super::ReplayError;
use super::bridge::Bridge;
use crate::datagrams::Datagrams;
use crate::detect::{Format, detect};
use crate::inspect::{InspectError, MAX_LLRP_MESSAGE, UART_CHUNK};
use crate::reads::ReadTable;
use crate::recording::{Protocol, Recording};
use crate::samples::RawSamples;
use crate::uart_log;

/// Records and datagrams from one look at the progress to the next.
const PROGRESS_STEP: usize = 256;

/// Feeds the file at `path` to `bridge`, piece by piece as it would arrive.
pub(super) fn feed(
    path: &Path,
    config: Option<&RadarConfig>,
    bridge: &mut Bridge<'_>,
    notes: &mut Vec<String>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<(), ReplayError> {
    let needs_profile = || InspectError::NoProfile { path: path.to_path_buf() };
    match detect(path)? {
        Format::AdcBin | Format::AdcNpy => {
            let config = config.ok_or_else(needs_profile)?;
            bridge.use_raw_samples(config)?;
            samples(path, config, bridge, notes, progress)
        }
        Format::Tlv => {
            let config = config.ok_or_else(needs_profile)?;
            bridge.use_uart(config)?;
            let bytes = read(path)?;
            let chunks: Vec<&[u8]> = bytes.chunks(UART_CHUNK).collect();
            uart(&chunks, config, bridge, progress)
        }
        Format::TlvCsv => {
            let config = config.ok_or_else(needs_profile)?;
            bridge.use_uart(config)?;
            let log = uart_log::read(path).map_err(InspectError::from)?;
            let rows: Vec<&[u8]> = log.rows.iter().map(Vec::as_slice).collect();
            uart(&rows, config, bridge, progress)
        }
        Format::Packets => packets(path, config, bridge, notes, progress),
        Format::Llrp => {
            Observer::default().stream(None, &read(path)?, bridge, notes);
            finish(bridge, BridgeTime::default())
        }
        Format::LlrpBody => {
            ObservedReads::default().reports(None, TagReports::new(&read(path)?), bridge);
            finish(bridge, BridgeTime::default())
        }
        // It may say how a scene moved, but no radar and no reader saw it.
        Format::Motion => Err(ReplayError::Nothing { path: path.to_path_buf() }),
        Format::Reads => {
            let table = ReadTable::open(path).map_err(InspectError::from)?;
            if table.duplicates > 0 {
                notes.push(format!("{} rows repeat another one exactly and were dropped", table.duplicates));
            }
            for (i, read) in table.reads.iter().enumerate() {
                bridge.read(read.time, read.clone());
                go_on(i, table.reads.len(), progress)?;
            }
            finish(bridge, table.reads.last().map_or_else(BridgeTime::default, |r| r.time))
        }
    }
}

fn read(path: &Path) -> Result<Vec<u8>, ReplayError> {
    let read_error = |source| InspectError::Read { path: path.to_path_buf(), source };
    Ok(std::fs::read(path).map_err(read_error)?)
}

fn go_on(done: usize, total: usize, progress: &mut dyn FnMut(f64) -> bool) -> Result<(), ReplayError> {
    let stop = done.is_multiple_of(PROGRESS_STEP) && !progress(done as f64 / total.max(1) as f64);
    if stop { Err(ReplayError::Interrupted) } else { Ok(()) }
}

fn finish(bridge: &mut Bridge<'_>, now: BridgeTime) -> Result<(), ReplayError> {
    bridge.finish(now);
    Ok(())
}

/// Raw samples have no times: frames come in the profile's period, their datagrams at its start.
fn samples(
    path: &Path,
    config: &RadarConfig,
    bridge: &mut Bridge<'_>,
    notes: &mut Vec<String>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<(), ReplayError> {
    let samples = RawSamples::open(path).map_err(InspectError::from)?;
    let total = samples.stream_bytes();
    let frame_bytes = u64::from(config.profile.frame_bytes());
    if total < frame_bytes {
        let reason = format!("{total} bytes are less than one frame of this profile ({frame_bytes} bytes)");
        return Err(InspectError::TooLittle { path: path.to_path_buf(), reason }.into());
    }
    let after = total % frame_bytes;
    if after > 0 {
        notes.push(format!("the last frame is cut: {after} of {frame_bytes} bytes; the rest counts as lost"));
    }
    let time_at = |byte: u64| BridgeTime(byte / frame_bytes * u64::from(config.profile.frame_period_us));
    for (i, datagram) in Datagrams::new(samples).enumerate() {
        let datagram = datagram.map_err(|source| InspectError::Read { path: path.to_path_buf(), source })?;
        // A frame that begins within a datagram begins when the datagram ends.
        let last_byte = datagram.byte_count + datagram.samples().len() as u64 - 1;
        bridge.radar(time_at(last_byte), &datagram.bytes);
        go_on(i, (total / datagram.samples().len().max(1) as u64) as usize, progress)?;
    }
    finish(bridge, time_at(total))
}

/// Bytes of a UART in the order in which they came; frames come in the profile's period.
fn uart(
    chunks: &[&[u8]],
    config: &RadarConfig,
    bridge: &mut Bridge<'_>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<(), ReplayError> {
    let period = u64::from(config.profile.frame_period_us);
    let mut now = BridgeTime::default();
    for (i, bytes) in chunks.iter().enumerate() {
        // The radar sends a frame in each period; what a chunk completes is dated by the frames before it.
        for piece in bytes.chunks(64) {
            let (_, frames) = bridge.counts();
            now = BridgeTime(u64::from(frames.complete) * period);
            bridge.radar(now, piece);
        }
        go_on(i, chunks.len(), progress)?;
    }
    finish(bridge, now)
}

fn packets(
    path: &Path,
    config: Option<&RadarConfig>,
    bridge: &mut Bridge<'_>,
    notes: &mut Vec<String>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<(), ReplayError> {
    let mut recording = Recording::open(path).map_err(InspectError::from)?;
    let mut readers: HashMap<SocketAddrV4, Observer> = HashMap::new();
    let (mut now, mut unused, mut raw) = (BridgeTime::default(), 0u64, false);
    let mut records = 0;
    while let Some(record) = recording.next() {
        let record = record.map_err(InspectError::from)?;
        now = BridgeTime(record.time_us);
        match (record.protocol, record.source.port(), record.destination.port()) {
            (Protocol::Udp, _, dca1000::DATA_PORT) => match config {
                Some(config) => {
                    if !raw {
                        bridge.use_raw_samples(config)?;
                        raw = true;
                    }
                    bridge.radar(now, &record.payload);
                }
                None => unused += 1,
            },
            (Protocol::Udp, BRIDGE_PORT, _) => bridge.packet(now, &record.payload),
            (Protocol::Tcp { continues }, LLRP_PORT, _) => {
                let observer = readers.entry(record.source).or_default();
                if !continues {
                    observer.restart();
                }
                observer.stream(Some(now), &record.payload, bridge, notes);
            }
            _ => {}
        }
        records += 1;
        if (records as usize).is_multiple_of(PROGRESS_STEP) && !progress(recording.share_read()) {
            return Err(ReplayError::Interrupted);
        }
    }
    if unused > 0 {
        notes.push(format!("{unused} radar datagrams were not used: give --profile"));
    }
    finish(bridge, now)
}

/// Listens to what a reader says to a client.
struct Observer {
    framer: Box<Framer<MAX_LLRP_MESSAGE>>,
    reads: ObservedReads,
    failed: bool,
}

/// Reads of one reader, on the bridge's clock.
#[derive(Default)]
struct ObservedReads {
    clock: ReaderClock,
    repeated: Repeated,
    /// Reader's time of the first read, where the recording has no times of its own.
    epoch: Option<ReaderTime>,
}

impl Default for Observer {
    fn default() -> Self {
        Self { framer: Box::new(Framer::new()), reads: ObservedReads::default(), failed: false }
    }
}

impl Observer {
    /// Begins anew, as with a new connection.
    fn restart(&mut self) {
        self.framer.reset();
        self.failed = false;
    }

    /// Takes bytes that arrived at `now`, or at a time that is not known.
    fn stream(
        &mut self,
        now: Option<BridgeTime>,
        mut bytes: &[u8],
        bridge: &mut Bridge<'_>,
        notes: &mut Vec<String>,
    ) {
        loop {
            match self.framer.next(&mut bytes) {
                Ok(Some(message)) => self.reads.message(now, &message, bridge),
                Ok(None) => return,
                Err(error) => {
                    if !std::mem::replace(&mut self.failed, true) {
                        notes.push(format!("reader's stream: {error}; what follows was not used"));
                    }
                    return;
                }
            }
        }
    }
}

impl ObservedReads {
    fn message(&mut self, now: Option<BridgeTime>, message: &Message<'_>, bridge: &mut Bridge<'_>) {
        match Incoming::decode(message) {
            Ok(Incoming::Reports(reports)) => self.reports(now, reports, bridge),
            Ok(Incoming::Response(MessageType::GET_READER_CAPABILITIES_RESPONSE, _)) => {
                if let Ok(Capabilities { channels: Some(table), .. }) = Capabilities::decode(message.body) {
                    bridge.hop_table(now.unwrap_or_default(), table);
                }
            }
            _ => {}
        }
    }

    fn reports(&mut self, now: Option<BridgeTime>, reports: TagReports<'_>, bridge: &mut Bridge<'_>) {
        for mut report in reports.flatten() {
            self.repeated.fill(&mut report);
            let time = match (now, report.time()) {
                (Some(now), Some(time)) => self.clock.observe(time, now),
                (Some(now), None) => now,
                (None, Some(time)) => BridgeTime(time.0.saturating_sub(self.epoch.get_or_insert(time).0)),
                (None, None) => BridgeTime::default(),
            };
            if let Some(read) = report.to_read(time, AntennaPort(0)) {
                bridge.read(now.unwrap_or(time), read);
            }
        }
    }
}
