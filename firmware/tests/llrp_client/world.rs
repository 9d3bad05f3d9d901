//! A client and a simulated reader, and the virtual time in which they meet.

use rfhoi_firmware::llrp::client::{Client, Counts, Loss, Notice, Output};
use rfhoi_firmware::llrp::event::{ConnectionAttempt, Event};
use rfhoi_firmware::llrp::frame::Framer;
use rfhoi_firmware::llrp::message::{IMPINJ, MessageType};
use rfhoi_firmware::llrp::reader_side::{self, ReaderModel, Responder};
use rfhoi_firmware::llrp::report::TagReport;
use rfhoi_shared::config::ReaderConfig;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::{
    AntennaPort, BridgeTime, CentiDbm, ChannelIndex, DopplerCode, Kilohertz, PhaseCode, ReaderTime,
};
use rfhoi_shared::wire::{HopTable, ReaderState};

pub(super) const UTC: u64 = 1_700_000_000_000_000;
pub(super) const SECOND: u64 = 1_000_000;
pub(super) const EPC: [u8; 12] = [0xE2; 12];
pub(super) const CHANNELS: [Kilohertz; 3] = [Kilohertz(902_750), Kilohertz(903_250), Kilohertz(903_750)];

pub(super) const IMPINJ_READER: ReaderModel<'static> = ReaderModel {
    antennas: 4,
    model: [IMPINJ, 2_001_002],
    firmware: "5.14.0.240",
    powers: &[CentiDbm(1000), CentiDbm(3000)],
    hop_table: Some(1),
    channels: &CHANNELS,
};
pub(super) const OTHER_READER: ReaderModel<'static> = ReaderModel { model: [1, 1], ..IMPINJ_READER };

/// What the client said, with owned bytes.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Said {
    Connect,
    Close,
    Read(TagRead),
    HopTable(HopTable),
    State(ReaderState),
    Notice(Notice),
}

/// A client and a reader, and the time.
pub(super) struct World {
    pub(super) client: Client,
    pub(super) reader: Responder<'static>,
    pub(super) greeting: Option<ConnectionAttempt>,
    /// A request of this type is never answered.
    pub(super) deaf_to: Option<MessageType>,
    pub(super) now: BridgeTime,
    pub(super) said: Vec<Said>,
    pub(super) requests: Vec<MessageType>,
    pub(super) acks: Vec<u32>,
    /// Bytes that the reader sent since it took the connection.
    pub(super) sent: u64,
    /// Bytes of that stream that arrive changed: place, and the bits that differ.
    pub(super) corrupt: Vec<(u64, u8)>,
}

impl World {
    pub(super) fn new(model: ReaderModel<'static>) -> Self {
        let config = ReaderConfig {
            antennas: [AntennaPort(1)].into_iter().collect(),
            ..ReaderConfig::for_scene([192, 168, 1, 2], &Scene::default())
        };
        Self {
            client: Client::new(config, 42),
            reader: Responder { model, refuses: None },
            greeting: Some(ConnectionAttempt::Success),
            deaf_to: None,
            now: BridgeTime(SECOND),
            said: Vec::new(),
            requests: Vec::new(),
            acks: Vec::new(),
            sent: 0,
            corrupt: Vec::new(),
        }
    }

    /// Lets the client do something, and returns the bytes that it sent.
    pub(super) fn act(
        &mut self,
        act: impl FnOnce(&mut Client, BridgeTime, &mut dyn FnMut(Output<'_>)),
    ) -> Vec<u8> {
        let mut sent = Vec::new();
        act(&mut self.client, self.now, &mut |output| {
            self.said.push(match output {
                Output::Send(bytes) => return sent.extend(bytes),
                Output::Connect(_) => Said::Connect,
                Output::Close => Said::Close,
                Output::Read(read) => Said::Read(read),
                Output::HopTable(table) => Said::HopTable(table.clone()),
                Output::State(state) => Said::State(state),
                Output::Notice(notice) => Said::Notice(notice),
            });
        });
        sent
    }

    /// Answers requests until there are no more.
    pub(super) fn converse(&mut self, mut sent: Vec<u8>) {
        while !sent.is_empty() {
            let mut answers = Vec::new();
            let mut framer = Framer::<1024>::new();
            let mut chunk = sent.as_slice();
            while let Some(request) = framer.next(&mut chunk).unwrap() {
                self.requests.push(request.kind);
                if request.kind == MessageType::KEEPALIVE_ACK {
                    self.acks.push(request.id);
                }
                let mut buffer = [0; 1024];
                if self.deaf_to != Some(request.kind)
                    && let Some(answer) = self.reader.answer(&mut buffer, &request)
                {
                    answers.extend(answer.unwrap());
                }
            }
            sent = self.deliver(&answers);
        }
    }

    /// The reader's bytes reach the client; returns what it sends.
    pub(super) fn deliver(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        for &(place, bits) in &self.corrupt {
            if let Some(byte) = place.checked_sub(self.sent).and_then(|at| bytes.get_mut(at as usize)) {
                *byte ^= bits;
            }
        }
        self.sent += bytes.len() as u64;
        self.act(|c, now, out| c.received(now, &bytes, out))
    }

    pub(super) fn receive(&mut self, bytes: &[u8]) {
        let sent = self.deliver(bytes);
        self.converse(sent);
    }

    pub(super) fn event(&mut self, event: Event<'_>) {
        let mut buffer = [0; 256];
        let time = ReaderTime(UTC + self.now.0);
        let bytes = reader_side::event_notification(&mut buffer, 0, time, [event]).unwrap();
        self.receive(bytes);
    }

    /// Does what is due at the client's deadline.
    pub(super) fn tick(&mut self) {
        self.now = self.client.deadline().expect("something is due").max(self.now);
        let sent = self.act(|c, now, out| c.tick(now, out));
        self.converse(sent);
    }

    /// The reader takes the connection that was asked for.
    pub(super) fn connect(&mut self) {
        self.sent = 0;
        let sent = self.act(|c, now, out| c.connected(now, out));
        assert!(sent.is_empty(), "the reader speaks first");
        if let Some(outcome) = self.greeting {
            let mut buffer = [0; 64];
            let bytes = self.reader.greeting(&mut buffer, ReaderTime(UTC + self.now.0), outcome).unwrap();
            self.receive(bytes);
        }
    }

    pub(super) fn start(&mut self) {
        self.act(|c, now, out| c.start(now, out));
        assert_eq!(self.said.last(), Some(&Said::Connect));
        self.connect();
    }

    pub(super) fn reading(model: ReaderModel<'static>) -> Self {
        let mut world = Self::new(model);
        world.start();
        assert_eq!(world.client.state(), ReaderState::Reading, "{:?}", world.said);
        world.said.clear();
        world.requests.clear();
        world
    }

    pub(super) fn report(&mut self, report: &TagReport<'_>) {
        let bytes = report_bytes(report);
        self.receive(&bytes);
    }

    pub(super) fn keepalive(&mut self, id: u32) {
        let mut buffer = [0; 16];
        let bytes = reader_side::keepalive(&mut buffer, id).unwrap();
        self.receive(bytes);
    }

    pub(super) fn losses(&self) -> Vec<Loss> {
        self.said
            .iter()
            .filter_map(|s| if let Said::Notice(Notice::Lost(l)) = s { Some(*l) } else { None })
            .collect()
    }

    pub(super) fn notices(&self) -> Vec<&Notice> {
        self.said.iter().filter_map(|s| if let Said::Notice(n) = s { Some(n) } else { None }).collect()
    }

    pub(super) fn reads(&self) -> Vec<&TagRead> {
        self.said.iter().filter_map(|s| if let Said::Read(r) = s { Some(r) } else { None }).collect()
    }

    pub(super) fn counts(&self) -> Counts {
        self.client.counts()
    }
}

pub(super) fn report_bytes(report: &TagReport<'_>) -> Vec<u8> {
    let mut buffer = [0; reader_side::MAX_REPORT_BYTES + 64];
    reader_side::ro_access_report(&mut buffer, 0, [report]).unwrap().to_vec()
}

/// A read of the reader at `now`.
pub(super) fn read_at(now: BridgeTime) -> TagReport<'static> {
    TagReport {
        epc: &EPC,
        antenna: Some(AntennaPort(1)),
        peak_rssi_dbm: Some(-53),
        channel: Some(ChannelIndex(2)),
        first_seen_utc: Some(ReaderTime(UTC + now.0)),
        last_seen_utc: Some(ReaderTime(UTC + now.0)),
        count: Some(1),
        phase: Some(PhaseCode(2608)),
        peak_rssi: Some(CentiDbm(-5310)),
        doppler: Some(DopplerCode(-40)),
        ..TagReport::default()
    }
}
