//! A simulated recording at the level of the wire: what a DCA1000EVM and an RFID reader would have sent.
//!
//! One scene for both, consistent in time: a person at rest, then a hand that takes a tagged thing to and fro, before a
//! wall, and a second tag that stays where it is. The radar sees points, the reader phases of direct paths; reflections
//! off walls, bodies in the way and lost reads are left out.

use std::f64::consts::{PI, TAU};
use std::net::SocketAddrV4;
use std::path::Path;

use rfhoi_firmware::dca1000;
use rfhoi_firmware::llrp::encode::EncodeError;
use rfhoi_firmware::llrp::event::ConnectionAttempt;
use rfhoi_firmware::llrp::frame::Framer;
use rfhoi_firmware::llrp::message::IMPINJ;
use rfhoi_firmware::llrp::reader_side::{ReaderModel, Responder, ro_access_report};
use rfhoi_firmware::llrp::report::TagReport;
use rfhoi_firmware::llrp::request::{self, MAX_REQUEST_BYTES, ReaderSettings, TransmitChannel};
use rfhoi_firmware::simulated::{Noise, Scatterer, SimulatedRadar};
use rfhoi_shared::config::{LLRP_PORT, ReaderConfig};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::{
    AntennaPort, CentiDbm, ChannelIndex, DopplerCode, Kilohertz, PhaseCode, ReaderTime, SPEED_OF_LIGHT,
};

use crate::datagrams::{Cutter, Datagram};
use crate::recording::{BRIDGE_IP, RADAR_IP, READER_IP, Writer, WriterError};

/// What is simulated.
#[derive(Debug, Clone)]
pub struct Options {
    /// The radar's profile.
    pub profile: RadarProfile,
    /// Length, s.
    pub seconds: f64,
    /// Seed of all noise: the same seed gives the same bytes.
    pub seed: u64,
}

/// Why there is no recording.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// The profile has no antenna geometry.
    #[error(
        "this profile's antennas have no known positions (several transmitters at once, or one that the board does not have)"
    )]
    Geometry,
    /// Nothing to record.
    #[error("{0} s is no length of a recording: give --seconds above 0 and up to 3600")]
    Seconds(f64),
    /// A message was too long.
    #[error("cannot encode a simulated reader's message: {0}")]
    Llrp(#[from] EncodeError),
    /// The simulated client's bytes were not taken by the simulated reader.
    #[error("the simulated reader did not understand the client")]
    Client,
    /// The recording cannot be written.
    #[error(transparent)]
    Write(#[from] WriterError),
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

/// How long everything is at rest first, s: the reader visits each channel once.
const REST_S: f64 = 1.0;
/// Time on a channel, s.
const DWELL_S: f64 = 0.2;
/// The European band's four channels, kHz (ETSI EN 302 208, channels 4, 7, 10, 13).
const CHANNELS: [Kilohertz; 4] =
    [Kilohertz(865_700), Kilohertz(866_300), Kilohertz(866_900), Kilohertz(867_500)];
/// From read to read, us.
const READ_US: u64 = 5_000;
/// UTC of the reader at the recording's start, us: 1 January 2026.
const READER_EPOCH_US: u64 = 1_767_225_600_000_000;
/// Noise of a read's phase, codes: 2.9 degrees, as measured on a still tag.
const PHASE_NOISE: f32 = 33.0;
/// Noise of the ADC, words.
const ADC_NOISE: f32 = 2.0;

/// The hand's distance from the radar, m.
fn hand_m(time_s: f64) -> f64 {
    let moving_s = (time_s - REST_S).max(0.0);
    1.2 + 0.3 * (1.0 - (TAU * 0.5 * moving_s).cos()) / 2.0
}

/// The hand's azimuth, rad.
fn hand_rad(time_s: f64) -> f64 {
    let moving_s = (time_s - REST_S).max(0.0);
    0.4 * (TAU * 0.25 * moving_s).sin()
}

fn scatterers(time_s: f64) -> [Scatterer; 3] {
    let point = |range_m, velocity_m_s, azimuth_rad, amplitude| Scatterer {
        // The simulated radar moves a scatterer from time zero on.
        range_m: range_m - velocity_m_s * time_s,
        velocity_m_s,
        azimuth_rad,
        elevation_rad: 0.0,
        amplitude,
    };
    const STEP_S: f64 = 1e-3;
    let velocity = (hand_m(time_s + STEP_S) - hand_m(time_s)) / STEP_S;
    [
        point(hand_m(time_s), velocity, hand_rad(time_s), 0.01),
        point(1.7, 0.0, 0.05, 0.05),
        point(2.4, 0.0, -0.3, 0.2),
    ]
}

/// Writes a recording to `path`. `progress` is told the share that is done, 0 to 1, and says whether to go on.
///
/// # Errors
/// If the profile has no geometry or the file cannot be written.
pub fn record(
    path: &Path,
    options: &Options,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Summary, SimulateError> {
    if !(options.seconds > 0.0 && options.seconds <= 3600.0) {
        return Err(SimulateError::Seconds(options.seconds));
    }
    let profile = &options.profile;
    let mut radar = SimulatedRadar::new(profile).ok_or(SimulateError::Geometry)?;
    let mut writer = Writer::create(path)?;
    let mut reader = Reader::new(options.seed);
    reader.connect(&mut writer)?;
    let mut noise = Noise::new(options.seed, ADC_NOISE);
    let mut chirp = vec![0; profile.chirp_bytes() as usize];
    let mut cutter = Cutter::default();
    let mut datagrams = 0;
    let frames = (options.seconds * 1e6 / f64::from(profile.frame_period_us)).ceil() as u32;
    let [from, to] = [RADAR_IP, BRIDGE_IP].map(|ip| SocketAddrV4::new(ip, dca1000::DATA_PORT));
    let mut send = |writer: &mut Writer, time_us, datagram: &Datagram| {
        datagrams += 1;
        writer.udp(time_us, from, to, &datagram.bytes)
    };
    for frame in 0..frames {
        if !progress(f64::from(frame) / f64::from(frames)) {
            return Err(SimulateError::Interrupted);
        }
        let start_us = u64::from(frame) * u64::from(profile.frame_period_us);
        let moved = scatterers(start_us as f64 * 1e-6);
        for index in 0..profile.chirps_per_frame() {
            radar.chirp(&moved, &mut noise, frame, index, &mut chirp);
            let chirp_us = start_us + u64::from(index) * profile.chirp_period_ns() / 1_000;
            reader.read_until(chirp_us, &mut writer)?;
            for datagram in cutter.push(&chirp) {
                send(&mut writer, chirp_us, &datagram)?;
            }
        }
    }
    let end_us = u64::from(frames) * u64::from(profile.frame_period_us);
    reader.read_until(end_us, &mut writer)?;
    if let Some(datagram) = cutter.finish() {
        send(&mut writer, end_us, &datagram)?;
    }
    writer.finish()?;
    Ok(Summary { radar_frames: frames, datagrams, tag_reads: reader.reads })
}

/// A simulated reader with two antennas and two tags in view.
struct Reader {
    reader: SocketAddrV4,
    client: SocketAddrV4,
    noise: Noise,
    next_us: u64,
    reads: u32,
}

impl Reader {
    fn new(seed: u64) -> Self {
        Self {
            reader: SocketAddrV4::new(READER_IP, LLRP_PORT),
            client: SocketAddrV4::new(BRIDGE_IP, 49_152),
            // Apart from the radar's noise.
            noise: Noise::new(!seed, PHASE_NOISE),
            next_us: 50_000,
            reads: 0,
        }
    }

    /// The exchange before reads arrive.
    fn connect(&self, writer: &mut Writer) -> Result<(), SimulateError> {
        /// From message to message, us.
        const PAUSE_US: u64 = 2_000;
        let powers = [CentiDbm(1_000), CentiDbm(3_000)];
        let model = ReaderModel {
            antennas: 4,
            model: [IMPINJ, 2_001_002],
            firmware: "simulated",
            powers: &powers,
            hop_table: Some(1),
            channels: &CHANNELS,
        };
        let responder = Responder { model, refuses: None };
        let mut answer = [0; 2048];
        let hello =
            responder.greeting(&mut answer, ReaderTime(READER_EPOCH_US), ConnectionAttempt::Success)?;
        writer.tcp(0, self.reader, self.client, hello)?;

        let scene = Scene { tags: 2, reader_antennas: 2, ..Scene::default() };
        let config = ReaderConfig::for_scene(READER_IP.octets(), &scene);
        let settings = ReaderSettings {
            keepalive_ms: Some(config.keepalive_ms),
            low_latency: true,
            ..ReaderSettings::default()
        };
        let channel = TransmitChannel { hop_table: 1, channel: 0 };
        let mut framer = Framer::<2048>::new();
        let mut buffer = [0; MAX_REQUEST_BYTES];
        for step in 1..=7u32 {
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
            let message = framer.next(&mut rest).ok().flatten().ok_or(SimulateError::Client)?;
            let response = responder.answer(&mut answer, &message).ok_or(SimulateError::Client)??;
            writer.tcp(at_us + PAUSE_US, self.reader, self.client, response)?;
        }
        Ok(())
    }

    /// Writes the reads up to `now_us`.
    fn read_until(&mut self, now_us: u64, writer: &mut Writer) -> Result<(), SimulateError> {
        while self.next_us <= now_us {
            let at_us = self.next_us;
            self.next_us += READ_US;
            self.read(at_us, writer)?;
        }
        Ok(())
    }

    fn read(&mut self, at_us: u64, writer: &mut Writer) -> Result<(), SimulateError> {
        /// From singulation to the network, us.
        const DELAY_US: u64 = 700;
        let time_s = at_us as f64 * 1e-6;
        let (tag, antenna) = (self.reads % 2, self.reads / 2 % 2);
        let channel = (time_s / DWELL_S) as usize % CHANNELS.len();
        let wavelength = SPEED_OF_LIGHT / (f64::from(CHANNELS[channel].0) * 1e3);
        // The antennas are to the left and right of the radar; the second tag lies on the table.
        let side_m = if antenna == 0 { -0.45 } else { 0.45 };
        let (range, angle) = if tag == 0 { (hand_m(time_s), hand_rad(time_s)) } else { (1.5, -0.2) };
        let (x, y) = (range * angle.sin() - side_m, range * angle.cos());
        let distance = x.hypot(y);
        // Each tag, antenna and channel has an offset of its own.
        let offset = f64::from(tag) * 1.3 + f64::from(antenna) * 2.1 + channel as f64 * 1.7;
        let radians = 4.0 * PI * distance / wavelength + offset;
        let code = PhaseCode::from_radians(radians.rem_euclid(TAU) as f32);
        let noisy = (f32::from(code.0) + self.noise.draw()).rem_euclid(4096.0);
        let rssi_dbm = -45.0 - 40.0 * (distance / 1.5).log10();
        let epc = [0xe2, 0x80, 0x11, 0x60, 0x60, 0, 0, 0, 0, 0, 0, tag as u8 + 1];
        let seen = Some(ReaderTime(READER_EPOCH_US + at_us));
        let report = TagReport {
            epc: &epc,
            antenna: Some(AntennaPort(antenna as u16 + 1)),
            channel: Some(ChannelIndex(channel as u16 + 1)),
            peak_rssi_dbm: Some(rssi_dbm.round() as i8),
            first_seen_utc: seen,
            last_seen_utc: seen,
            count: Some(1),
            phase: Some(PhaseCode(noisy as u16 % PhaseCode::CODES_PER_TURN)),
            peak_rssi: Some(CentiDbm((rssi_dbm * 2.0).round() as i16 * 50)),
            doppler: Some(DopplerCode(0)),
            ..TagReport::default()
        };
        let mut buffer = [0; 256];
        self.reads += 1;
        let bytes = ro_access_report(&mut buffer, self.reads, [&report])?;
        Ok(writer.tcp(at_us + DELAY_US, self.reader, self.client, bytes)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::datagrams::Datagrams;
    use crate::recording::{Protocol, Recording};

    fn options() -> Options {
        let profile = RadarProfile { samples: 32, sample_rate_ksps: 550, loops: 4, ..RadarProfile::bridge() };
        Options { profile, seconds: 0.5, seed: 1 }
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let bytes = |name: &str, seed| {
            let path = folder.path().join(name);
            record(&path, &Options { seed, ..options() }, &mut |_| true).unwrap();
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
        let summary = record(&path, &options(), &mut |_| true).unwrap();
        let records = Recording::open(&path).unwrap().map(Result::unwrap);
        let datagrams: Vec<Vec<u8>> =
            records.filter(|r| r.protocol == Protocol::Udp).map(|r| r.payload).collect();
        assert_eq!(datagrams.len(), summary.datagrams as usize);
        let stream: Vec<u8> = datagrams.iter().flat_map(|d| d[10..].to_vec()).collect();
        assert_eq!(stream.len() as u32, summary.radar_frames * options().profile.frame_bytes());
        let again = Datagrams::new(stream.as_slice()).map(|d| d.unwrap().bytes);
        assert!(again.eq(datagrams));
    }

    #[test]
    fn lengths_that_are_none_are_refused() {
        for seconds in [0.0, -1.0, f64::NAN, 1e9] {
            let refused = record(Path::new("x.pcap"), &Options { seconds, ..options() }, &mut |_| true);
            assert!(matches!(refused, Err(SimulateError::Seconds(_))));
        }
    }

    #[test]
    fn stopping_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.pcap");
        assert!(matches!(record(&path, &options(), &mut |_| false), Err(SimulateError::Interrupted)));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
