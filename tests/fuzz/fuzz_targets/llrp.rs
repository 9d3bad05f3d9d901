//! LLRP: framing, decoding, and the client, from the greeting and while it reads.
//!
//! What a reading client receives is made of parts, whose first byte says what they become: bytes as they are, the body
//! of a message, or a tag read at a time of the part's choosing.
#![no_main]

use libfuzzer_sys::fuzz_target;
use rfhoi_firmware::llrp::client::{Client, Output};
use rfhoi_firmware::llrp::event::ConnectionAttempt;
use rfhoi_firmware::llrp::frame::Framer;
use rfhoi_firmware::llrp::message::{IMPINJ, MessageType, ParameterType};
use rfhoi_firmware::llrp::param::Parameters;
use rfhoi_firmware::llrp::reader_side::{self, MAX_REPORT_BYTES, ReaderModel, Responder};
use rfhoi_firmware::llrp::report::{TagReport, TagReports};
use rfhoi_firmware::llrp::{encode, fuzz};
use rfhoi_shared::config::ReaderConfig;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::tag::MAX_EPC_BYTES;
use rfhoi_shared::units::{AntennaPort, BridgeTime, Kilohertz, ReaderTime};
use rfhoi_shared::wire::ReaderState;

const MODEL: ReaderModel<'static> = ReaderModel {
    antennas: 4,
    model: [IMPINJ, 2_001_002],
    firmware: "",
    powers: &[],
    hop_table: Some(1),
    channels: &[Kilohertz(902_750)],
};

/// A tag report that decodes says the same after it is written.
fn reports_survive(body: &[u8]) {
    for report in TagReports::new(body).flatten().filter(|r| r.epc.len() <= MAX_EPC_BYTES) {
        let report = TagReport { unknown: 0, ..report };
        let mut buffer = [0; MAX_REPORT_BYTES];
        let written = reader_side::ro_access_report(&mut buffer, 0, [&report]).expect("there is room");
        let mut framer = Framer::<MAX_REPORT_BYTES>::new();
        let message = framer.next(&mut &*written).expect("no error").expect("a whole message");
        let value = Parameters::new(message.body).find(ParameterType::TAG_REPORT_DATA).expect("a report");
        assert_eq!(TagReport::decode(value), Ok(report));
    }
}

/// Brings a client to where it reads.
fn reading(now: BridgeTime) -> Client<512> {
    let mut client = Client::<512>::new(ReaderConfig::for_scene([192, 168, 1, 2], &Scene::default()), 1);
    client.start(now, &mut |_| {});
    client.connected(now, &mut |_| {});
    let reader = Responder { model: MODEL, refuses: None };
    let mut buffer = [0; 512];
    let greeting = reader.greeting(&mut buffer, ReaderTime(1), ConnectionAttempt::Success);
    let mut to_client = greeting.expect("there is room").to_vec();
    while !to_client.is_empty() {
        let mut sent = Vec::new();
        client.received(now, &to_client, &mut |output| {
            if let Output::Send(bytes) = output {
                sent.extend_from_slice(bytes);
            }
        });
        to_client.clear();
        let mut framer = Framer::<512>::new();
        let mut rest = sent.as_slice();
        while let Some(request) = framer.next(&mut rest).expect("the client frames its requests") {
            let mut buffer = [0; 512];
            if let Some(answer) = reader.answer(&mut buffer, &request) {
                to_client.extend(answer.expect("there is room"));
            }
        }
    }
    assert_eq!(client.state(), ReaderState::Reading);
    client
}

/// The parts of `data` as a reader's stream.
fn stream(mut data: &[u8]) -> Vec<u8> {
    let mut stream = Vec::new();
    while let Some((&kind, rest)) = data.split_first() {
        let (&length, rest) = rest.split_first().unwrap_or((&0, rest));
        let (part, rest) = rest.split_at_checked(usize::from(length) % 64).unwrap_or((rest, &[]));
        data = rest;
        match kind {
            0..=49 => stream.extend(part),
            50..=149 => {
                let kind = MessageType::ALL[usize::from(kind) % MessageType::ALL.len()];
                let mut buffer = [0; 128];
                let message = encode::message(&mut buffer, kind, length.into(), |w| w.bytes(part));
                stream.extend(message.expect("there is room"));
            }
            _ => {
                let (time, epc) = part.split_first_chunk().unwrap_or((&[0; 8], part));
                let time = Some(ReaderTime(u64::from_le_bytes(*time)));
                let report = TagReport {
                    epc,
                    last_seen_utc: time.filter(|_| kind & 1 == 0),
                    first_seen_uptime: time.filter(|_| kind & 2 == 0),
                    antenna: (kind & 4 == 0).then_some(AntennaPort(1)),
                    ..TagReport::default()
                };
                let mut buffer = [0; MAX_REPORT_BYTES];
                let message = reader_side::ro_access_report(&mut buffer, length.into(), [&report]);
                stream.extend(message.expect("there is room"));
            }
        }
    }
    stream
}

/// What a reading client makes of a stream depends on its bytes, not on how they are cut.
fn reads(cuts: &[u8], stream: &[u8]) {
    let now = BridgeTime(1_000_000);
    let take = |chunks: &mut dyn Iterator<Item = &[u8]>| {
        let mut client = reading(now);
        let mut reads = Vec::new();
        for chunk in chunks {
            client.received(now, chunk, &mut |output| {
                if let Output::Read(read) = output {
                    assert!(read.time <= now, "a read is never later than its arrival");
                    reads.push(read);
                }
            });
        }
        assert_eq!(client.counts().link.reads as usize, reads.len());
        assert_eq!(client.deadline().is_none(), client.state() == ReaderState::None);
        (reads, client.counts())
    };
    let cut = usize::from(cuts.first().copied().unwrap_or(0)) + 1;
    assert_eq!(take(&mut stream.chunks(cut)), take(&mut std::iter::once(stream)));
}

fuzz_target!(|data: &[u8]| {
    let (cuts, rest) = data.split_at_checked(4).unwrap_or((data, &[]));
    assert_eq!(fuzz::stream(rest, cuts), fuzz::stream(rest, &[0]));
    fuzz::bodies(data);
    fuzz::client(data);
    reports_survive(data);
    reads(cuts, rest);
    reads(cuts, &stream(rest));
});
