//! A simulated LLRP reader over TCP: reads reach the host as they were and on the bridge's clock; what goes wrong with the
//! reader is told, costs what it must, and is tried again within the backoff's bounds.

use rfhoi::receive::Received;
use rfhoi_firmware::llrp::client::{Loss, Notice};
use rfhoi_firmware::llrp::event::ConnectionAttempt;
use rfhoi_firmware::llrp::message::MessageType;
use rfhoi_firmware::llrp::status::StatusCode;
use rfhoi_firmware::uplink::ReadPacker;
use rfhoi_shared::config::ReaderConfig;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{HopTable, ReaderCounts, ReaderState};
use rfhoi_tests::simulated::network::{Conditions, Network};
use rfhoi_tests::simulated::reader::{CHANNELS, HOP_TABLE, Setup, SimulatedReader, Tag};
use rfhoi_tests::simulated::world::{Host, Link, ReaderSide, SECOND, World};

/// Delay of a TCP segment between reader and bridge, us.
const DELAY_US: std::ops::RangeInclusive<u64> = 300..=5_000;

fn tags() -> Vec<Tag> {
    let tag = |number: u8, distance_m, swing_m| Tag {
        epc: [0xE2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, number],
        distance_m,
        swing_m,
    };
    vec![tag(1, 1.2, 0.3), tag(2, 2.0, 0.0), tag(3, 2.7, 0.05)]
}

fn world(setup: Setup) -> World<'static> {
    let config = ReaderConfig::for_scene([192, 168, 33, 40], &Scene::default());
    let network = Network::new(Conditions::default(), 1);
    let mut world = World::new(1, Link::Datagrams(network), Host::default());
    world.reader = Some(ReaderSide::new(SimulatedReader::new(setup), config, DELAY_US, 17));
    world
}

fn side<'w>(world: &'w mut World<'static>) -> &'w mut ReaderSide {
    world.reader.as_mut().expect("these worlds have a reader")
}

fn reads(world: &World<'_>) -> Vec<TagRead> {
    world.host.reads().cloned().collect()
}

fn counts(world: &World<'_>) -> ReaderCounts {
    world.reader.as_ref().map(|r| r.path.counts().link).expect("these worlds have a reader")
}

fn losses(world: &World<'_>) -> Vec<Loss> {
    let notices = world.reader.iter().flat_map(|r| &r.notices);
    notices.filter_map(|n| if let Notice::Lost(loss) = n { Some(*loss) } else { None }).collect()
}

/// Seconds of the bridge's time.
fn at(seconds: f64) -> BridgeTime {
    BridgeTime((seconds * SECOND as f64) as u64)
}

fn differ_in_time_alone(got: &TagRead, sent: &TagRead) -> bool {
    TagRead { time: sent.time, ..got.clone() } == *sent
}

#[test]
fn reads_arrive_as_they_were_and_in_the_bridges_time() {
    for drift_ppm in [-80.0, 0.0, 80.0] {
        let mut world = world(Setup { drift_ppm, ..Setup::new(tags()) });
        world.run_until(at(20.0));
        world.finish();
        let sent = side(&mut world).reader.reads().to_vec();
        let got = reads(&world);
        assert!(sent.len() > 3_900);
        // Those that were under way when the session ended are not taken any more.
        assert!(got.len() <= sent.len() && got.len() + 2 >= sent.len());
        for (number, (got, sent)) in got.iter().zip(&sent).enumerate() {
            assert!(differ_in_time_alone(got, sent), "{got:?} of {sent:?}");
            assert!(got.phase.is_some() && got.doppler.is_some());
            // What nobody can know is the smallest delay, 300 us, so a read is late by that, and never early: the clock's
            // envelope rises by 100 ppm, more than these clocks drift. Until it has seen a fast read it is late by a
            // delay; then by what the envelope rises, 180 ppm against the reader's clock at most, until the next fast
            // read. Of 200 reads a second one in ten is within 0.5 ms of the fastest: 20 a second, so that half a second
            // without any is a matter of e^-10.
            let late_us = got.time.0 as f64 - sent.time.0 as f64;
            let latest_us = if number < 100 { 5_000.0 } else { 300.0 + 500.0 + 0.5e6 * 180e-6 };
            // Two roundings to a microsecond.
            assert!((298.0..=latest_us).contains(&late_us), "{drift_ppm} ppm, read {number}: {late_us} us");
        }
        assert_eq!(counts(&world).reads as usize, got.len());
        assert_eq!((counts(&world).link_losses, counts(&world).malformed, counts(&world).unknown), (0, 0, 0));
        assert!(losses(&world).is_empty(), "{:?}", losses(&world));
    }
}

#[test]
fn the_hop_table_comes_before_reads_and_reads_do_not_wait_long() {
    let mut world = world(Setup::new(tags()));
    let mut waited_us = 0;
    while world.now < at(3.0) {
        let had = world.host.reads().count();
        world.run_until(world.now.after(100));
        // The oldest of those that have just come has waited longest.
        if world.host.reads().count() > had {
            let oldest = side(&mut world).reader.reads()[had].time;
            waited_us = waited_us.max(world.now.since(oldest));
        }
    }
    let first_reads = world.host.received.iter().position(|r| matches!(r, Received::Reads(_)));
    let table = world.host.received.iter().position(|r| matches!(r, Received::HopTable(_)));
    assert!(table.is_some() && table < first_reads);
    let expected = HopTable { table: HOP_TABLE.into(), channels: CHANNELS.into_iter().collect() };
    assert!(world.host.received.contains(&Received::HopTable(expected)));
    let most_us = DELAY_US.end() + ReadPacker::PATIENCE_US + 100;
    assert!((5_000..=most_us).contains(&waited_us), "{waited_us} us, of {most_us}");
}

#[test]
fn the_session_ends_in_order() {
    let mut world = world(Setup::new(tags()));
    world.run_until(at(2.0));
    world.finish();
    assert_eq!(side(&mut world).path.state(), ReaderState::None);
    let states: Vec<ReaderState> = side(&mut world).states.iter().map(|(_, state)| *state).collect();
    use ReaderState::{Configuring, Connecting, None as Stopped, Reading};
    assert_eq!(states, [Connecting, Configuring, Reading, Stopped]);
    let read = side(&mut world).reader.reads().len();
    world.run_until(world.now.after(5 * SECOND));
    assert_eq!(side(&mut world).reader.reads().len(), read, "the reader reads no more");
}

#[test]
fn a_reader_that_vanishes_within_a_report_comes_back() {
    let mut world = world(Setup::new(tags()));
    world.run_until(at(5.0));
    while !side(&mut world).is_heard_soon() {
        world.run_until(world.now.after(100));
    }
    let vanished = world.now;
    side(&mut world).vanish(false);
    world.run_until(at(8.0));
    assert_eq!(side(&mut world).path.state(), ReaderState::Waiting);
    let before = reads(&world).len();
    side(&mut world).reachable = true;
    let attempts = side(&mut world).attempts.clone();
    // Waits double from half a second, each a quarter shorter or longer.
    let mut nominal = 0.5 * SECOND as f64;
    for (number, pair) in attempts.windows(2).enumerate() {
        let from = if number == 0 { vanished } else { pair[0] };
        let waited = pair[1].since(from) as f64;
        // A millisecond until the attempt fails, and one of the loop above.
        assert!(
            (0.75 * nominal..=1.25 * nominal + 2_000.0).contains(&waited),
            "attempt {number}: {waited} us"
        );
        nominal *= 2.0;
    }
    assert!(attempts.len() >= 3, "{attempts:?}");
    // The next wait is at most 1.25 x 4 s.
    world.run_until(at(8.0 + 5.1));
    assert_eq!(side(&mut world).path.state(), ReaderState::Reading);
    assert!(reads(&world).len() > before + 10, "reads go on");
    let expected = [Loss::Closed, Loss::ConnectFailed];
    assert!(losses(&world).iter().all(|l| expected.contains(l)) && losses(&world)[0] == Loss::Closed);
    assert_eq!(
        (counts(&world).link_losses, counts(&world).malformed),
        (1, 0),
        "the half report left nothing"
    );
    // All reads are true ones, in order; those on the way when it vanished are missing.
    let sent = side(&mut world).reader.reads().to_vec();
    let mut rest = sent.iter();
    assert!(reads(&world).iter().all(|got| rest.any(|sent| differ_in_time_alone(got, sent))));
    assert!(reads(&world).len() + 10 > sent.len());
    let tables = world.host.received.iter().filter(|r| matches!(r, Received::HopTable(_))).count();
    assert_eq!(tables, 2, "the table is told again: it may be another");
}

#[test]
fn a_cable_that_is_pulled_shows_by_missing_keepalives() {
    let mut world = world(Setup::new(tags()));
    world.run_until(at(12.0));
    assert_eq!(side(&mut world).reader.acks(), 2, "keepalives come every 5 s and are answered");
    side(&mut world).vanish(true);
    world.run_until(at(26.9));
    assert_eq!(side(&mut world).path.state(), ReaderState::Reading, "nothing says that it is gone");
    world.run_until(at(27.1));
    assert_eq!(side(&mut world).path.state(), ReaderState::Waiting, "three periods are over");
    assert_eq!(losses(&world), [Loss::Silent]);
    assert_eq!(counts(&world).link_losses, 1);
}

#[test]
fn a_reader_that_is_occupied_is_tried_until_it_is_free() {
    let mut world = world(Setup::new(tags()));
    side(&mut world).reader.occupied_until = at(6.0);
    world.run_until(at(6.0));
    assert_eq!(side(&mut world).path.state(), ReaderState::Occupied);
    assert!(losses(&world).len() >= 3);
    let refused = Loss::Refused(ConnectionAttempt::ClientInitiatedConnectionExists);
    assert!(losses(&world).iter().all(|loss| *loss == refused));
    assert_eq!((counts(&world).link_losses, reads(&world).len()), (0, 0), "it was never ours");
    // Waits of 0.5, 1, 2 and 4 s, each up to a quarter longer, end by 9.4 s.
    world.run_until(at(9.5));
    assert_eq!(side(&mut world).path.state(), ReaderState::Reading);
    assert!(!reads(&world).is_empty());
}

#[test]
fn a_reader_without_impinjs_extensions_reads_without_phase() {
    let setup = Setup::new(tags()).refusing(MessageType::CUSTOM_MESSAGE, StatusCode::UNSUPPORTED_MESSAGE);
    let mut world = world(setup);
    world.run_until(at(2.0));
    world.finish();
    assert!(side(&mut world).notices.contains(&Notice::NoExtensions));
    let got = reads(&world);
    assert!(got.len() > 300);
    assert!(got.iter().all(|read| read.phase.is_none() && read.doppler.is_none()), "none, not zero");
    assert!(got.iter().all(|read| read.rssi.0 % 100 == 0), "whole dBm");
}

#[test]
fn a_reader_that_refuses_the_phase_in_reports_is_not_read_without() {
    let setup = Setup::new(tags()).refusing(MessageType::ADD_ROSPEC, StatusCode::FIELD_ERROR);
    let mut world = world(setup);
    world.run_until(at(4.0));
    let refused = |n: &Notice| matches!(n, Notice::Rejected(r) if r.request == MessageType::ADD_ROSPEC);
    assert!(side(&mut world).notices.iter().any(refused), "{:?}", side(&mut world).notices);
    assert!(losses(&world).iter().all(|loss| *loss == Loss::Rejected(MessageType::ADD_ROSPEC)));
    assert!((3..=4).contains(&losses(&world).len()), "tried again with growing waits: {:?}", losses(&world));
    assert!(reads(&world).is_empty());
}

#[test]
fn a_reader_that_forgets_the_phase_is_counted() {
    let mut world = world(Setup { reports_phase: false, ..Setup::new(tags()) });
    world.run_until(at(2.0));
    world.finish();
    let got = reads(&world);
    assert!(got.len() > 300 && got.iter().all(|read| read.phase.is_none()));
    assert_eq!(side(&mut world).path.counts().without_phase as usize, got.len());
}

#[test]
fn garbage_on_the_stream_ends_the_link_and_not_the_bridge() {
    let mut world = world(Setup::new(tags()));
    world.run_until(at(3.0));
    side(&mut world).inject(at(3.0), b"\r\nlogin: ");
    world.run_until(at(3.1));
    assert!(matches!(losses(&world)[..], [Loss::Framing(_)]), "{:?}", losses(&world));
    let before = reads(&world).len();
    // Half a second and a quarter.
    world.run_until(at(4.0));
    assert_eq!(side(&mut world).path.state(), ReaderState::Reading);
    assert!(reads(&world).len() > before);
    assert_eq!(counts(&world).link_losses, 1);
}
