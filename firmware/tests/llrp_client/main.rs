//! The client against a simulated reader, over virtual time.

mod world;

use MessageType as M;
use proptest::prelude::*;
use rfhoi_firmware::llrp::client::{Loss, Notice};
use rfhoi_firmware::llrp::event::{ConnectionAttempt, Event, RoSpecChange};
use rfhoi_firmware::llrp::frame::{FrameError, HeaderFault};
use rfhoi_firmware::llrp::message::MessageType;
use rfhoi_firmware::llrp::reader_side::{self, ReaderModel};
use rfhoi_firmware::llrp::report::TagReport;
use rfhoi_firmware::llrp::request::ROSPEC_ID;
use rfhoi_firmware::llrp::status::StatusCode;
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{
    AntennaPort, BridgeTime, CentiDbm, ChannelIndex, DopplerCode, Kilohertz, PhaseCode,
};
use rfhoi_shared::wire::{HopTable, ReaderState};

use world::{CHANNELS, EPC, IMPINJ_READER, OTHER_READER, SECOND, Said, World, read_at, report_bytes};

const SETUP: [MessageType; 9] = [
    M::CUSTOM_MESSAGE,
    M::GET_READER_CAPABILITIES,
    M::SET_READER_CONFIG,
    M::DELETE_ACCESSSPEC,
    M::DELETE_ROSPEC,
    M::ADD_ROSPEC,
    M::ENABLE_ROSPEC,
    M::ENABLE_EVENTS_AND_REPORTS,
    M::START_ROSPEC,
];

#[test]
fn from_start_to_read() {
    let mut world = World::new(IMPINJ_READER);
    assert_eq!(world.client.deadline(), None);
    world.start();
    assert_eq!(world.requests, SETUP);
    let table = HopTable { table: 1, channels: CHANNELS.into_iter().collect() };
    let expected = [
        Said::State(ReaderState::Connecting),
        Said::Connect,
        Said::State(ReaderState::Configuring),
        Said::HopTable(table),
        Said::State(ReaderState::Reading),
    ];
    assert_eq!(world.said, expected);

    world.now = BridgeTime(2 * SECOND);
    let seen = world.now;
    world.now = world.now.after(3_000);
    world.report(&read_at(seen));
    let read = TagRead {
        time: seen.after(100),
        epc: Epc::new(&EPC).unwrap(),
        antenna: AntennaPort(1),
        channel: ChannelIndex(2),
        phase: Some(PhaseCode(2608)),
        rssi: CentiDbm(-5310),
        doppler: Some(DopplerCode(-40)),
    };
    // The greeting came without delay, a second before: the envelope has risen by 100 us since.
    assert_eq!(world.reads(), [&read]);
    assert_eq!(world.counts().link.reads, 1);
    assert_eq!(world.counts().link.state, ReaderState::Reading);
}

#[test]
fn a_reader_of_another_make_reads_without_phase() {
    let mut world = World::new(OTHER_READER);
    world.start();
    assert_eq!(world.requests, SETUP);
    assert_eq!(world.client.state(), ReaderState::Reading);
    let [Notice::Rejected(rejection), Notice::NoExtensions] = world.notices()[..] else {
        panic!("{:?}", world.notices());
    };
    assert_eq!((rejection.request, rejection.code), (M::CUSTOM_MESSAGE, StatusCode::UNSUPPORTED_MESSAGE));
    let plain = TagReport { phase: None, peak_rssi: None, doppler: None, ..read_at(world.now) };
    world.report(&plain);
    assert_eq!(world.reads()[0].phase, None);
    assert_eq!(world.reads()[0].rssi, CentiDbm(-5300));
    assert_eq!(world.counts().without_phase, 0, "none was promised");
}

#[test]
fn an_impinj_reader_that_leaves_the_phase_out_is_counted() {
    let mut world = World::reading(IMPINJ_READER);
    world.report(&TagReport { phase: None, ..read_at(world.now) });
    world.report(&read_at(world.now));
    assert_eq!(world.counts().without_phase, 1);
    assert_eq!(world.counts().link.reads, 2);
}

#[test]
fn every_refusal_is_told() {
    for request in SETUP {
        if request == M::ENABLE_EVENTS_AND_REPORTS {
            continue; // has no response
        }
        let mut world = World::new(IMPINJ_READER);
        world.reader.refuses = Some((request, StatusCode::FIELD_ERROR));
        world.start();
        let Some(Notice::Rejected(rejection)) = world.notices().first().copied() else {
            panic!("{request}: {:?}", world.notices());
        };
        assert_eq!((rejection.request, rejection.code), (request, StatusCode::FIELD_ERROR));
        assert!(
            rejection.to_string().starts_with(&format!("the reader refused {request} with M_FieldError"))
        );
        assert!(world.counts().rejected > 0);
        if matches!(request, M::CUSTOM_MESSAGE | M::DELETE_ACCESSSPEC | M::DELETE_ROSPEC) {
            assert_eq!(world.client.state(), ReaderState::Reading, "{request}");
            assert!(world.losses().is_empty());
        } else {
            assert_eq!(world.client.state(), ReaderState::Waiting, "{request}");
            assert_eq!(world.losses(), [Loss::Rejected(request)]);
            assert_eq!(world.requests.last(), Some(&M::CLOSE_CONNECTION), "the session is not left behind");
        }
    }
}

#[test]
fn every_request_has_a_time_limit() {
    for request in SETUP {
        if request == M::ENABLE_EVENTS_AND_REPORTS {
            continue; // has no response
        }
        let mut world = World::new(IMPINJ_READER);
        world.deaf_to = Some(request);
        world.start();
        let asked = world.now;
        world.tick();
        assert_eq!(world.now.since(asked), 5 * SECOND);
        assert_eq!(world.losses(), [Loss::Timeout(request)]);
        assert_eq!(world.counts().link.link_losses, 1);
        // Next time it works.
        world.deaf_to = None;
        world.tick();
        world.connect();
        assert_eq!(world.client.state(), ReaderState::Reading);
    }
}

#[test]
fn an_occupied_reader_is_told_and_tried_again() {
    let mut world = World::new(IMPINJ_READER);
    world.greeting = Some(ConnectionAttempt::ClientInitiatedConnectionExists);
    world.start();
    assert!(world.requests.is_empty(), "not ours to talk to");
    assert_eq!(world.client.state(), ReaderState::Occupied);
    assert_eq!(world.losses(), [Loss::Refused(ConnectionAttempt::ClientInitiatedConnectionExists)]);
    assert_eq!(world.counts().link.link_losses, 0, "it was never ours");
    world.greeting = Some(ConnectionAttempt::Success);
    world.tick();
    assert_eq!(world.client.state(), ReaderState::Connecting);
    world.connect();
    assert_eq!(world.client.state(), ReaderState::Reading);
}

#[test]
fn failures_to_connect() {
    let mut world = World::new(IMPINJ_READER);
    world.act(|c, now, out| c.start(now, out));
    world.act(|c, now, out| c.connect_failed(now, out));
    world.tick();
    world.tick(); // no answer to the second Connect
    world.tick();
    world.greeting = None;
    world.connect();
    world.tick();
    assert_eq!(world.losses(), [Loss::ConnectFailed, Loss::ConnectTimeout, Loss::NoGreeting]);
    assert_eq!(world.client.state(), ReaderState::Waiting);
    // A connection that opens after it was given up is closed.
    world.said.clear();
    world.act(|c, now, out| c.connected(now, out));
    assert_eq!(world.said, [Said::Close]);
}

#[test]
fn waits_grow_to_half_a_minute_and_shrink_after_a_stable_link() {
    let mut world = World::new(IMPINJ_READER);
    world.act(|c, now, out| c.start(now, out));
    let mut nominal = 500_000;
    for _ in 0..10 {
        world.act(|c, now, out| c.connect_failed(now, out));
        let failed = world.now;
        world.tick();
        let waited = world.now.since(failed);
        assert!((nominal * 3 / 4..=nominal * 5 / 4).contains(&waited), "{waited} for {nominal}");
        nominal = (nominal * 2).min(30 * SECOND);
    }
    // A link that fails at once leaves the wait long.
    world.connect();
    world.act(|c, now, out| c.closed(now, out));
    let failed = world.now;
    world.tick();
    assert!(world.now.since(failed) > 20 * SECOND);
    // One that reads for half a minute makes it short.
    world.connect();
    for id in 0..7 {
        world.now = world.now.after(5 * SECOND);
        world.keepalive(id);
    }
    world.act(|c, now, out| c.closed(now, out));
    let failed = world.now;
    world.tick();
    assert!(world.now.since(failed) < SECOND);
}

#[test]
fn keepalives_are_answered_with_their_id() {
    let mut world = World::reading(IMPINJ_READER);
    world.keepalive(0x1122_3344);
    world.keepalive(7);
    assert_eq!(world.acks, [0x1122_3344, 7]);
    assert_eq!(world.counts().keepalives, 2);
}

#[test]
fn a_silent_link_is_lost_after_three_keepalives() {
    let mut world = World::reading(IMPINJ_READER);
    world.now = world.now.after(14 * SECOND);
    world.keepalive(1);
    let heard = world.now;
    world.tick();
    assert_eq!(world.now.since(heard), 15 * SECOND);
    assert_eq!(world.losses(), [Loss::Silent]);
    assert_eq!(world.said[0], Said::Close);
    assert_eq!(world.counts().link.link_losses, 1);
}

#[test]
fn a_reader_that_vanishes_within_a_report_leaves_nothing_behind() {
    let mut world = World::reading(IMPINJ_READER);
    let bytes = report_bytes(&read_at(world.now));
    world.receive(&bytes[..50]);
    world.act(|c, now, out| c.closed(now, out));
    assert_eq!(world.losses(), [Loss::Closed]);
    world.receive(&bytes[50..]);
    assert!(world.reads().is_empty(), "bytes after the close are ignored");
    world.tick();
    world.connect();
    world.report(&read_at(world.now));
    assert_eq!(world.reads().len(), 1, "the half report is forgotten");
    assert!(world.said.iter().any(|s| matches!(s, Said::HopTable(_))), "the hop table is told again");
}

#[test]
fn garbage_closes_the_link_and_says_where() {
    let mut world = World::reading(IMPINJ_READER);
    let error = FrameError { offset: world.sent, fault: HeaderFault::Version(2) };
    world.receive(b"HTTP/1.1 400 Bad Request\r\n\r\n");
    assert_eq!(world.losses(), [Loss::Framing(error)]);
    assert_eq!(world.client.state(), ReaderState::Waiting);
}

#[test]
fn malformed_and_unknown_messages_are_counted_and_passed_over() {
    let mut world = World::reading(IMPINJ_READER);
    world.receive(&[0x04, 61, 0, 0, 0, 14, 0, 0, 0, 1, 0x00, 0xF0, 0, 99]);
    world.receive(&[0x04, 200, 0, 0, 0, 10, 0, 0, 0, 1]);
    world.receive(&[0x07, 0xFF, 0, 0, 0, 15, 0, 0, 0, 1, 0, 0, 0, 9, 1]);
    let mut long = vec![0x04, 61, 0, 0, 0x40, 0, 0, 0, 0, 1];
    long.resize(0x4000, 0);
    world.receive(&long);
    world.report(&TagReport { epc: &[1; 64], ..read_at(world.now) });
    world.report(&read_at(world.now));
    let counts = world.counts();
    assert_eq!((counts.link.malformed, counts.link.unknown), (1, 2));
    assert_eq!((counts.oversized, counts.long_epcs, counts.link.reads), (1, 1, 1));
    assert!(matches!(world.notices()[..], [Notice::Malformed(M::RO_ACCESS_REPORT, _)]));
}

#[test]
fn reads_of_an_earlier_client_are_dropped() {
    let mut world = World::new(IMPINJ_READER);
    world.deaf_to = Some(M::ADD_ROSPEC);
    world.start();
    world.report(&read_at(world.now));
    assert!(world.reads().is_empty());
    assert_eq!(world.counts().foreign, 1);
    // From the start on they are ours, even before the response.
    let mut world = World::new(IMPINJ_READER);
    world.deaf_to = Some(M::START_ROSPEC);
    world.start();
    world.report(&read_at(world.now));
    assert_eq!(world.reads().len(), 1);
}

#[test]
fn fields_left_out_are_the_last_ones() {
    let mut world = World::reading(IMPINJ_READER);
    world.report(&read_at(world.now));
    world.report(&TagReport { epc: &EPC, phase: Some(PhaseCode(1)), ..TagReport::default() });
    let reads = world.reads();
    assert_eq!(reads[1].channel, reads[0].channel);
    assert_eq!(reads[1].time, reads[0].time);
    assert_eq!((reads[1].phase, reads[1].doppler), (Some(PhaseCode(1)), None));
}

#[test]
fn events_of_the_reader() {
    let mut world = World::reading(IMPINJ_READER);
    world.event(Event::Antenna { port: AntennaPort(1), connected: false });
    world.event(Event::BufferLevel(80));
    world.event(Event::BufferOverflow);
    world.event(Event::Exception("too hot"));
    world.event(Event::ConnectionAttempt(ConnectionAttempt::AnotherAttempted));
    world.event(Event::Hopping { table: 1, next: ChannelIndex(2) });
    world.event(Event::RoSpec { change: RoSpecChange::Start, rospec: ROSPEC_ID });
    world.event(Event::RoSpec { change: RoSpecChange::End, rospec: 77 });
    let expected = [
        &Notice::Antenna { port: AntennaPort(1), connected: false },
        &Notice::BufferLevel(80),
        &Notice::BufferOverflow,
        &Notice::Exception("too hot".try_into().unwrap()),
        &Notice::OtherClient,
    ];
    assert_eq!(world.notices(), expected);
    assert_eq!(world.client.state(), ReaderState::Reading);
    world.event(Event::RoSpec { change: RoSpecChange::End, rospec: ROSPEC_ID });
    assert_eq!(world.losses(), [Loss::RoSpecEnded]);

    let mut world = World::reading(IMPINJ_READER);
    world.event(Event::ConnectionClose);
    assert_eq!(world.losses(), [Loss::ClosedByReader]);
}

#[test]
fn an_error_message_and_a_stray_response_change_nothing_while_reading() {
    let mut world = World::reading(IMPINJ_READER);
    let mut buffer = [0; 64];
    let code = StatusCode::UNSUPPORTED_MESSAGE;
    let bytes = reader_side::status_response(&mut buffer, M::ERROR_MESSAGE, 3, code, "what?").unwrap();
    world.receive(bytes);
    let mut buffer = [0; 64];
    let kind = M::START_ROSPEC_RESPONSE;
    let bytes = reader_side::status_response(&mut buffer, kind, 999, StatusCode::SUCCESS, "").unwrap();
    world.receive(bytes);
    let [Notice::Error(error)] = world.notices()[..] else { panic!("{:?}", world.notices()) };
    assert_eq!((error.code, error.text.as_str()), (code, "what?"));
    assert_eq!(world.counts().unexpected, 1);
    assert_eq!(world.client.state(), ReaderState::Reading);
}

#[test]
fn what_a_reader_lacks_is_told() {
    let mut world = World::new(ReaderModel { antennas: 0, hop_table: None, ..IMPINJ_READER });
    world.start();
    assert_eq!(world.notices(), [&Notice::MissingAntennas { ports: 0 }]);
    let many = [Kilohertz(865_700); 70];
    let mut world = World::new(ReaderModel { channels: Box::leak(Box::new(many)), ..IMPINJ_READER });
    world.start();
    assert_eq!(world.notices(), [&Notice::ChannelsOmitted(6)]);
}

#[test]
fn stop_ends_the_session_in_order() {
    let mut world = World::reading(IMPINJ_READER);
    let sent = world.act(|c, now, out| c.stop(now, out));
    world.converse(sent);
    assert_eq!(world.requests, [M::STOP_ROSPEC, M::DELETE_ROSPEC, M::CLOSE_CONNECTION]);
    assert_eq!(world.said, [Said::Close, Said::State(ReaderState::None)]);
    assert_eq!(world.client.deadline(), None);
    assert_eq!(world.counts().link.link_losses, 0);
    assert_eq!(world.counts().unexpected, 0);
    world.said.clear();
    world.start();
    assert_eq!(world.client.state(), ReaderState::Reading);
}

#[test]
fn stop_does_not_wait_for_ever() {
    let mut world = World::reading(IMPINJ_READER);
    world.deaf_to = Some(M::CLOSE_CONNECTION);
    let sent = world.act(|c, now, out| c.stop(now, out));
    world.converse(sent);
    // Started again meanwhile.
    world.act(|c, now, out| c.start(now, out));
    assert!(world.said.is_empty());
    let asked = world.now;
    world.tick();
    assert_eq!(world.now.since(asked), SECOND);
    let said =
        [Said::Close, Said::State(ReaderState::None), Said::State(ReaderState::Connecting), Said::Connect];
    assert_eq!(world.said, said);

    // In every other state it is immediate.
    world.act(|c, now, out| c.stop(now, out));
    assert_eq!(world.client.deadline(), None);
    world.act(|c, now, out| c.start(now, out));
    world.act(|c, now, out| c.connect_failed(now, out));
    world.act(|c, now, out| c.stop(now, out));
    assert_eq!((world.client.deadline(), world.client.state()), (None, ReaderState::None));
}

#[test]
fn chunks_of_any_size_make_the_same_session() {
    for size in [1, 2, 3, 7, 64] {
        let mut world = World::reading(IMPINJ_READER);
        let stream: Vec<u8> = (0..20).flat_map(|n| report_bytes(&read_at(BridgeTime(SECOND + n)))).collect();
        for chunk in stream.chunks(size) {
            world.receive(chunk);
        }
        assert_eq!(world.reads().len(), 20);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn corrupted_streams_are_recovered_from(
        corrupt in proptest::collection::vec((0..700_u64, 1..=u8::MAX), 1..5)
    ) {
        let mut world = World::new(IMPINJ_READER);
        world.corrupt = corrupt;
        world.start();
        for _ in 0..5 {
            if world.client.state() == ReaderState::Reading {
                world.report(&read_at(world.now));
            }
        }
        world.corrupt.clear();
        // Where a changed length makes the client wait for bytes that never come, its time limits end that.
        world.tick();
        for _ in 0..4 {
            if world.client.state() == ReaderState::Connecting {
                world.connect();
            }
            if world.client.state() != ReaderState::Reading {
                world.tick();
            }
        }
        prop_assert_eq!(world.client.state(), ReaderState::Reading);
        let before = world.reads().len();
        world.report(&read_at(world.now));
        prop_assert_eq!(world.reads().len(), before + 1);
    }
}
