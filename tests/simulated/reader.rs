//! A simulated LLRP reader with tags in view: answers requests, hops, reports each read, sends keepalives.

use std::f64::consts::TAU;

use rfhoi_firmware::llrp::event::ConnectionAttempt;
use rfhoi_firmware::llrp::frame::Framer;
use rfhoi_firmware::llrp::message::{IMPINJ, Message, MessageType, ParameterType};
use rfhoi_firmware::llrp::param::Fields;
use rfhoi_firmware::llrp::reader_side::{self, MAX_REPORT_BYTES, ReaderModel, Responder};
use rfhoi_firmware::llrp::report::TagReport;
use rfhoi_firmware::llrp::status::StatusCode;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{
    AntennaPort, BridgeTime, CentiDbm, ChannelIndex, DopplerCode, Kilohertz, PhaseCode, ReaderTime,
    SPEED_OF_LIGHT,
};

/// Channels of the simulated reader (FCC, a part of the 50).
pub const CHANNELS: [Kilohertz; 5] =
    [Kilohertz(902_750), Kilohertz(927_250), Kilohertz(910_250), Kilohertz(915_250), Kilohertz(921_750)];
/// Number of its hop table.
pub const HOP_TABLE: u8 = 1;
/// Time on a channel, us.
const DWELL_US: u64 = 200_000;
/// UTC of the reader when the bridge starts, us.
const UTC: u64 = 1_767_225_600_000_000;

/// A reader as Impinj makes it.
pub const IMPINJ_READER: ReaderModel<'static> = ReaderModel {
    antennas: 4,
    model: [IMPINJ, 2_001_002],
    firmware: "simulated",
    powers: &[CentiDbm(1_000), CentiDbm(3_000)],
    hop_table: Some(HOP_TABLE),
    channels: &CHANNELS,
};

/// A tag that swings to and fro before the antennas.
#[derive(Debug, Clone, Copy)]
pub struct Tag {
    /// Its EPC.
    pub epc: [u8; 12],
    /// Distance in the middle, m.
    pub distance_m: f64,
    /// Distance from there to either end, m.
    pub swing_m: f64,
}

impl Tag {
    fn distance_m(&self, time: BridgeTime) -> f64 {
        self.distance_m + self.swing_m * (TAU * 0.5 * time.seconds()).sin()
    }
}

/// What a reader is and does.
#[derive(Debug, Clone)]
pub struct Setup {
    /// How it answers.
    pub responder: Responder<'static>,
    /// Tags in view.
    pub tags: Vec<Tag>,
    /// Antennas that it reads with, in turns.
    pub antennas: u16,
    /// From read to read, us.
    pub read_us: u64,
    /// How much faster than the bridge's its clock runs, parts per million.
    pub drift_ppm: f64,
    /// It reports the phase once it is asked to; some firmware forgets.
    pub reports_phase: bool,
}

impl Setup {
    /// An Impinj reader with these tags, 200 reads a second by two antennas, and a perfect clock.
    pub fn new(tags: Vec<Tag>) -> Self {
        Self {
            responder: Responder { model: IMPINJ_READER, refuses: None },
            tags,
            antennas: 2,
            read_us: 5_000,
            drift_ppm: 0.0,
            reports_phase: true,
        }
    }

    /// The same, refusing a request.
    pub fn refusing(mut self, request: MessageType, code: StatusCode) -> Self {
        self.responder.refuses = Some((request, code));
        self
    }
}

/// A connection of a client.
#[derive(Debug, Default)]
struct Connection {
    framer: Framer<1024>,
    next_read: Option<BridgeTime>,
    keepalive_us: Option<u64>,
    next_keepalive: Option<BridgeTime>,
    /// Impinj's extensions are on.
    extended: bool,
    closing: bool,
}

/// The reader.
#[derive(Debug)]
pub struct SimulatedReader {
    /// What it is.
    pub setup: Setup,
    /// Until when another client holds it.
    pub occupied_until: BridgeTime,
    /// It neither answers nor reads.
    pub silent: bool,
    connection: Option<Connection>,
    reads: Vec<TagRead>,
    acks: u32,
}

impl SimulatedReader {
    /// A reader without a client.
    pub fn new(setup: Setup) -> Self {
        Self {
            setup,
            occupied_until: BridgeTime(0),
            silent: false,
            connection: None,
            reads: Vec::new(),
            acks: 0,
        }
    }

    /// Its clock, which is not the bridge's.
    fn clock(&self, time: BridgeTime) -> ReaderTime {
        ReaderTime(UTC + (time.0 as f64 * (1.0 + self.setup.drift_ppm * 1e-6)).round() as u64)
    }

    /// A client has connected; what it is told first.
    ///
    /// # Panics
    /// Here and below if a message does not fit its buffer, which all do.
    pub fn accept(&mut self, now: BridgeTime) -> Vec<u8> {
        let mine = now >= self.occupied_until;
        self.connection = mine.then(Connection::default);
        let outcome = if mine {
            ConnectionAttempt::Success
        } else {
            ConnectionAttempt::ClientInitiatedConnectionExists
        };
        let mut buffer = [0; 128];
        let greeting = self.setup.responder.greeting(&mut buffer, self.clock(now), outcome);
        greeting.expect("the buffer is long enough").to_vec()
    }

    /// The connection is gone.
    pub fn disconnect(&mut self) {
        self.connection = None;
    }

    /// Takes bytes of the client; its answers.
    pub fn receive(&mut self, now: BridgeTime, mut bytes: &[u8]) -> Vec<u8> {
        let mut answers = Vec::new();
        let Some(connection) = &mut self.connection else { return answers };
        if self.silent {
            return answers;
        }
        while let Some(request) = connection.framer.next(&mut bytes).expect("the client frames its requests")
        {
            let mut buffer = [0; 1024];
            if let Some(answer) = self.setup.responder.answer(&mut buffer, &request) {
                answers.extend(answer.expect("the buffer is long enough"));
            }
            let refused = self.setup.responder.refuses.is_some_and(|(kind, _)| kind == request.kind);
            if refused {
                continue;
            }
            match request.kind {
                MessageType::SET_READER_CONFIG => connection.keepalive_us = keepalive_us(&request),
                MessageType::CUSTOM_MESSAGE => connection.extended = true,
                MessageType::START_ROSPEC => {
                    connection.next_read = Some(now.after(self.setup.read_us));
                    connection.next_keepalive = connection.keepalive_us.map(|period| now.after(period));
                }
                MessageType::STOP_ROSPEC | MessageType::DELETE_ROSPEC => connection.next_read = None,
                MessageType::CLOSE_CONNECTION => {
                    connection.next_read = None;
                    connection.closing = true;
                }
                MessageType::KEEPALIVE_ACK => self.acks += 1,
                _ => {}
            }
        }
        answers
    }

    /// Whether it closes the connection, as a client asked it to.
    pub fn is_closing(&self) -> bool {
        self.connection.as_ref().is_some_and(|c| c.closing)
    }

    /// When it has something to say by itself.
    pub fn next_message(&self) -> Option<BridgeTime> {
        let connection = self.connection.as_ref().filter(|_| !self.silent)?;
        [connection.next_read, connection.next_keepalive].into_iter().flatten().min()
    }

    /// What it has to say by `now`: one message.
    pub fn message(&mut self, now: BridgeTime) -> Option<Vec<u8>> {
        let due = self.next_message().filter(|&due| due <= now)?;
        let connection = self.connection.as_mut()?;
        if connection.next_keepalive == Some(due) {
            connection.next_keepalive = connection.keepalive_us.map(|period| due.after(period));
            let mut buffer = [0; 16];
            return Some(reader_side::keepalive(&mut buffer, 0).expect("the buffer is long enough").to_vec());
        }
        connection.next_read = Some(due.after(self.setup.read_us));
        let extended = connection.extended;
        Some(self.read(due, extended))
    }

    /// Reads the next tag, and reports it.
    fn read(&mut self, time: BridgeTime, extended: bool) -> Vec<u8> {
        let turn = self.reads.len();
        let tag = self.setup.tags[turn % self.setup.tags.len()];
        let antenna = (turn / self.setup.tags.len()) as u16 % self.setup.antennas;
        let hop = (time.0 / DWELL_US) as usize * 3 % CHANNELS.len();
        // Cables and tag add a phase of their own on each channel.
        let offset = 1.3 * hop as f64 + 0.7 * f64::from(antenna);
        let turns = 2.0 * tag.distance_m(time) * f64::from(CHANNELS[hop].0) * 1e3 / SPEED_OF_LIGHT;
        let with_phase = extended && self.setup.reports_phase;
        let whole_dbm = -40 - (40.0 * tag.distance_m(time).log10()) as i8;
        let fine = extended.then_some(CentiDbm(i16::from(whole_dbm) * 100 - turn as i16 % 100));
        let read = TagRead {
            time,
            epc: Epc::new(&tag.epc).expect("12 bytes"),
            antenna: AntennaPort(antenna + 1),
            channel: ChannelIndex(hop as u16 + 1),
            phase: with_phase.then(|| PhaseCode::from_radians((turns.fract() * TAU + offset) as f32)),
            rssi: fine.unwrap_or(CentiDbm::from_whole_dbm(whole_dbm)),
            doppler: extended.then_some(DopplerCode(turn as i16 % 100 - 50)),
        };
        let seen = Some(self.clock(time));
        let report = TagReport {
            epc: read.epc.bytes(),
            antenna: Some(read.antenna),
            channel: Some(read.channel),
            peak_rssi_dbm: Some(whole_dbm),
            first_seen_utc: seen,
            last_seen_utc: seen,
            count: Some(1),
            phase: read.phase,
            peak_rssi: fine,
            doppler: read.doppler,
            ..TagReport::default()
        };
        let mut buffer = [0; MAX_REPORT_BYTES];
        let bytes = reader_side::ro_access_report(&mut buffer, 0, [&report]);
        let bytes = bytes.expect("the buffer is long enough").to_vec();
        self.reads.push(read);
        bytes
    }

    /// All reads so far as they were, with the bridge's time at which they happened.
    pub fn reads(&self) -> &[TagRead] {
        &self.reads
    }

    /// Keepalives that the client acknowledged.
    pub fn acks(&self) -> u32 {
        self.acks
    }
}

/// The period that `SET_READER_CONFIG` asks for.
fn keepalive_us(request: &Message<'_>) -> Option<u64> {
    let mut fields = Fields::new(request.body);
    fields.u8().ok()?;
    let mut spec = fields.parameters().find(ParameterType::KEEPALIVE_SPEC).ok()?;
    spec.u8().ok()?;
    Some(u64::from(spec.u32().ok()?) * 1_000)
}
