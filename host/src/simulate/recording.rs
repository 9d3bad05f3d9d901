//! A simulated recording at the level of the wire: the very bytes that a DCA1000EVM and an RFID reader would have sent.
//!
//! The reader connects and reads for a while before the radar starts, as in a real session, so that the hops' phase offsets can
//! be learnt. Datagrams of the radar and reports of the reader are written in the order of time; time 0 of the recording is
//! when the reader connects, and the sample begins at [`epoch`].

use std::net::SocketAddrV4;
use std::path::Path;

use rand_chacha::ChaCha8Rng;
use rfhoi_firmware::dca1000;
use rfhoi_firmware::llrp::encode::EncodeError;
use rfhoi_firmware::llrp::event::ConnectionAttempt;
use rfhoi_firmware::llrp::frame::Framer;
use rfhoi_firmware::llrp::message::IMPINJ;
use rfhoi_firmware::llrp::reader_side::{MAX_REPORT_BYTES, ReaderModel, Responder};
use rfhoi_firmware::llrp::request::{self, MAX_REQUEST_BYTES, ReaderSettings, TransmitChannel};
use rfhoi_shared::config::{LLRP_PORT, ReaderConfig};
use rfhoi_shared::scene::Scene as Needs;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::{CentiDbm, Kilohertz, ReaderTime};
use rfhoi_shared::wire::BRIDGE_PORT;

use super::radar::{Radar, RadarError};
use super::rfid::report::access_report;
use super::sample::epoch;
use super::scene;
use super::session::Session;
use crate::datagrams::{Cutter, Datagram};
use crate::recording::{BRIDGE_IP, HOST_IP, RADAR_IP, READER_IP, Writer, WriterError};
use crate::replay::{ReplayError, packets};

/// Why there is no recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The radar.
    #[error(transparent)]
    Radar(#[from] RadarError),
    /// A message was too long.
    #[error("cannot encode a simulated reader's message: {0}")]
    Llrp(#[from] EncodeError),
    /// The simulated client's bytes were not taken by the simulated reader.
    #[error("the simulated reader did not understand the client")]
    Client,
    /// The recording cannot be written.
    #[error(transparent)]
    Write(#[from] WriterError),
    /// No place for what the devices send to a bridge.
    #[error("cannot make a temporary folder: {0}")]
    Folder(std::io::Error),
    /// The bridge.
    #[error(transparent)]
    Bridge(#[from] ReplayError),
    /// The user stopped it.
    #[error("stopped; nothing was written")]
    Interrupted,
}

/// What was simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Summary {
    /// Frames of the radar.
    pub radar_frames: u32,
    /// Datagrams of the radar.
    pub datagrams: u32,
    /// Reads of the tags.
    pub tag_reads: u32,
}

/// UTC of the reader at the recording's start, us: 1 January 2026.
const READER_EPOCH: ReaderTime = ReaderTime(1_767_225_600_000_000);
/// Requests of the client until the reader reads.
const REQUESTS: u32 = 7;
/// From message to message meanwhile, us.
const PAUSE_US: u64 = 2_000;
/// When the reader begins to read, us.
const STARTED_US: u64 = (REQUESTS as u64 * 2 + 1) * PAUSE_US;
/// Share of the work on a bridge's recording that is simulation.
const SIMULATING: f64 = 0.9;
/// From singulation to the network, us.
const REPORT_DELAY_US: u64 = 700;

/// Writes a recording of `session` to `path`; `radar_rng` and `reader_rng` seed each device's noise. `progress` is told the
/// share that is done, 0 to 1, and says whether to go on.
///
/// # Errors
/// If the profile has no geometry or the file cannot be written.
pub fn record(
    path: &Path,
    session: &Session<'_>,
    radar_rng: &mut ChaCha8Rng,
    reader_rng: &mut ChaCha8Rng,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Summary, RecordError> {
    let effects = session.effects();
    let mut radar = Radar::new(session.takes()[0].scene, effects)?;
    let profile = radar.config().profile.clone();
    let mut writer = Writer::create(path)?;
    let (reads, channels) = session.reads(reader_rng);
    let mut reader = Reader::new(&reads);
    let antennas = &session.takes()[0].scene.reader;
    reader.connect(&channels, session.tags().len() as u8, antennas, &mut writer)?;
    let mut chirp = vec![0; profile.chirp_bytes() as usize];
    let mut cutter = Cutter::default();
    let mut datagrams = 0;
    let times = session.frame_times(&profile);
    let frames = times.len() as u32;
    let [from, to] = [RADAR_IP, BRIDGE_IP].map(|ip| SocketAddrV4::new(ip, dca1000::DATA_PORT));
    let mut send = |writer: &mut Writer, time_us, datagram: &Datagram| {
        datagrams += 1;
        writer.udp(time_us, from, to, &datagram.bytes)
    };
    let mut on = None;
    for (frame, time_s) in (0_u32..).zip(times) {
        if !progress(f64::from(frame) / f64::from(frames)) {
            return Err(RecordError::Interrupted);
        }
        let sample_us = u64::from(frame) * u64::from(profile.frame_period_us);
        let (number, time_s) = session.at(time_s);
        let take = &session.takes()[number];
        if on.replace(number) != Some(number) {
            radar.begin(take.fixtures, radar_rng);
        }
        radar.look(take.performance, time_s);
        for index in 0..profile.chirps_per_frame() {
            radar.chirp(index, &mut chirp);
            let end_us = u64::from(index + 1) * profile.chirp_period_ns() / 1_000;
            let chirp_us = epoch(&effects).after(sample_us + end_us).0;
            reader.report_until(chirp_us, &mut writer)?;
            for datagram in cutter.push(&chirp) {
                send(&mut writer, chirp_us, &datagram)?;
            }
        }
    }
    let end_us = epoch(&effects).after(u64::from(frames) * u64::from(profile.frame_period_us)).0;
    reader.report_until(end_us, &mut writer)?;
    if let Some(datagram) = cutter.finish() {
        send(&mut writer, end_us, &datagram)?;
    }
    writer.finish()?;
    Ok(Summary { radar_frames: frames, datagrams, tag_reads: reader.reports })
}

/// As [`record`], but of what a bridge would have sent to its host: the same through the bridge's own logic.
///
/// # Errors
/// As [`record`], or if the bridge refuses the profile.
pub fn record_bridge(
    path: &Path,
    session: &Session<'_>,
    radar_rng: &mut ChaCha8Rng,
    reader_rng: &mut ChaCha8Rng,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Summary, RecordError> {
    let config = Radar::new(session.takes()[0].scene, session.effects())?.config().clone();
    let mut writer = Writer::create(path)?;
    let folder = tempfile::tempdir().map_err(RecordError::Folder)?;
    let devices = folder.path().join("devices.pcap");
    let summary =
        record(&devices, session, radar_rng, reader_rng, &mut |share| progress(SIMULATING * share))?;
    let [from, to] = [BRIDGE_IP, HOST_IP].map(|ip| SocketAddrV4::new(ip, BRIDGE_PORT));
    let mut written = Ok(());
    packets(
        &devices,
        Some(&config),
        &mut |now, packet| {
            if written.is_ok() {
                written = writer.udp(now.0, from, to, packet);
            }
        },
        &mut |share| progress(SIMULATING + (1.0 - SIMULATING) * share),
    )?;
    written?;
    writer.finish()?;
    Ok(summary)
}

/// A simulated reader's end of the connection.
struct Reader<'a> {
    reader: SocketAddrV4,
    client: SocketAddrV4,
    reads: std::slice::Iter<'a, TagRead>,
    reports: u32,
}

impl<'a> Reader<'a> {
    fn new(reads: &'a [TagRead]) -> Self {
        Self {
            reader: SocketAddrV4::new(READER_IP, LLRP_PORT),
            client: SocketAddrV4::new(BRIDGE_IP, 49_152),
            reads: reads[reads.partition_point(|r| r.time.0 < STARTED_US)..].iter(),
            reports: 0,
        }
    }

    /// The exchange before reads arrive.
    fn connect(
        &self,
        channels: &[Kilohertz],
        tags: u8,
        reader: &scene::Reader,
        writer: &mut Writer,
    ) -> Result<(), RecordError> {
        let powers = [CentiDbm((reader.power_dbm * 100.0) as i16)];
        let model = ReaderModel {
            antennas: reader.antennas.len() as u16,
            model: [IMPINJ, 2_001_002],
            firmware: "simulated",
            powers: &powers,
            hop_table: Some(1),
            channels,
        };
        let responder = Responder { model, refuses: None };
        let mut answer = [0; 2048];
        let hello = responder.greeting(&mut answer, READER_EPOCH, ConnectionAttempt::Success)?;
        writer.tcp(0, self.reader, self.client, hello)?;

        let scene = Needs { tags, reader_antennas: reader.antennas.len() as u8, ..Needs::default() };
        let config = ReaderConfig::for_scene(READER_IP.octets(), &scene);
        let settings = ReaderSettings {
            keepalive_ms: Some(config.keepalive_ms),
            low_latency: true,
            ..ReaderSettings::default()
        };
        let channel = TransmitChannel { hop_table: 1, channel: 0 };
        let mut framer = Framer::<2048>::new();
        let mut buffer = [0; MAX_REQUEST_BYTES];
        for step in 1..=REQUESTS {
            let b = &mut buffer;
            let bytes = match step {
                1 => request::enable_extensions(b, step),
                2 => request::get_reader_capabilities(b, step),
                3 => request::set_reader_config(b, step, &settings),
                4 => request::delete_rospec(b, step, request::ALL_SPECS),
                5 => request::add_rospec(b, step, &config, channel, true),
                6 => request::enable_rospec(b, step, request::ROSPEC_ID),
                _ => request::start_rospec(b, step, request::ROSPEC_ID),
            }?;
            let at_us = u64::from(step) * 2 * PAUSE_US;
            writer.tcp(at_us, self.client, self.reader, bytes)?;
            let mut rest = bytes;
            let message = framer.next(&mut rest).ok().flatten().ok_or(RecordError::Client)?;
            let response = responder.answer(&mut answer, &message).ok_or(RecordError::Client)??;
            writer.tcp(at_us + PAUSE_US, self.reader, self.client, response)?;
        }
        Ok(())
    }

    /// Writes the reports that are out by `now_us`.
    fn report_until(&mut self, now_us: u64, writer: &mut Writer) -> Result<(), RecordError> {
        while let Some(read) = self.reads.as_slice().first()
            && read.time.after(REPORT_DELAY_US).0 <= now_us
        {
            self.reads.next();
            self.reports += 1;
            let mut buffer = [0; MAX_REPORT_BYTES];
            let read = std::slice::from_ref(read);
            let bytes = access_report(&mut buffer, self.reports, read, request::ROSPEC_ID, READER_EPOCH)?;
            writer.tcp(read[0].time.after(REPORT_DELAY_US).0, self.reader, self.client, bytes)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rfhoi_shared::radar::RadarProfile;

    use super::*;
    use crate::datagrams::Datagrams;
    use crate::hoi::CATEGORIES;
    use crate::recording::{Protocol, Recording};
    use crate::simulate::draw::{Wanted, draw};
    use crate::simulate::effects::{Domain, Effects};
    use crate::simulate::sample::{Take, perform};
    use crate::simulate::scene::Scene;

    /// A scene whose radar sends little.
    fn scene() -> Scene {
        let mut scene = Scene::named("working-space").unwrap();
        scene.radar.profile = RadarProfile {
            samples: 32,
            sample_rate_ksps: 550,
            loops: 4,
            frame_period_us: 500_000,
            ..RadarProfile::bridge()
        };
        scene
    }

    fn write(path: &Path, seed: u64, go_on: bool) -> Result<Summary, RecordError> {
        let scenes = [scene()];
        let wanted = Wanted::one(Domain::Site, 1, &CATEGORIES[1..2]);
        let draw = &draw(&wanted, &scenes)[0];
        let (performance, tags) = perform(wanted.domain, 1, draw, &scenes[0]).unwrap();
        let take = Take::of(&scenes[0], &performance, &tags, Effects::of(wanted.domain));
        let [mut radar, mut reader] = [seed, !seed].map(ChaCha8Rng::seed_from_u64);
        record(path, &Session::new(take, []), &mut radar, &mut reader, &mut |_| go_on)
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let bytes = |name: &str, seed| {
            let path = folder.path().join(name);
            write(&path, seed, true).unwrap();
            std::fs::read(path).unwrap()
        };
        let first = bytes("a.pcap.gz", 1);
        assert_eq!(first, bytes("b.pcap.gz", 1));
        assert_ne!(first, bytes("c.pcap.gz", 2));
    }

    #[test]
    fn datagrams_are_cut_as_from_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pcap");
        let summary = write(&path, 1, true).unwrap();
        let records = Recording::open(&path).unwrap().map(Result::unwrap);
        let datagrams: Vec<Vec<u8>> =
            records.filter(|r| r.protocol == Protocol::Udp).map(|r| r.payload).collect();
        assert_eq!(datagrams.len(), summary.datagrams as usize);
        let stream: Vec<u8> = datagrams.iter().flat_map(|d| d[10..].to_vec()).collect();
        assert_eq!(stream.len() as u32, summary.radar_frames * scene().radar.profile.frame_bytes());
        let again = Datagrams::new(stream.as_slice()).map(|d| d.unwrap().bytes);
        assert!(again.eq(datagrams));
    }

    #[test]
    fn stopping_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pcap");
        assert!(matches!(write(&path, 1, false), Err(RecordError::Interrupted)));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
