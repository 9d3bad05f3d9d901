//! Radar and reader on one uplink for half a minute of simulated time, both networks losing: the streams are numbered
//! apart, what arrives is what was sent, what does not is counted, and nothing piles up.

use std::collections::BTreeMap;

use rfhoi_firmware::bridge::RadarPath;
use rfhoi_shared::config::ReaderConfig;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{Packet, ReaderState, Stream, Telemetry};
use rfhoi_tests::simulated::network::{Conditions, Network};
use rfhoi_tests::simulated::path::cube_memory;
use rfhoi_tests::simulated::radar::{Measurement, configuration, point, short_frames};
use rfhoi_tests::simulated::reader::{Setup, SimulatedReader, Tag};
use rfhoi_tests::simulated::world::{Host, Link, ROW, RadarSide, ReaderSide, SECOND, World};

const SECONDS: u64 = 30;

fn measurement() -> Measurement {
    let profile = short_frames();
    let frames = (SECONDS * SECOND / u64::from(profile.frame_period_us)) as u32;
    // 0.2 mm between frames: it stays within the gate.
    let hand = point(1.5, 0.01, 0.05);
    Measurement { profile, scatterers: vec![hand], frames, start: BridgeTime(5_000), noise: 2.0, seed: 4 }
}

fn reader() -> ReaderSide {
    let tag = |number: u8, distance_m, swing_m| Tag { epc: [number; 12], distance_m, swing_m };
    let setup = Setup { drift_ppm: 40.0, ..Setup::new(vec![tag(1, 1.5, 0.2), tag(2, 2.5, 0.0)]) };
    let config = ReaderConfig::for_scene([192, 168, 33, 40], &Scene::default());
    ReaderSide::new(SimulatedReader::new(setup), config, 300..=3_000, 23)
}

/// A world of both in these conditions, at its end.
fn run<'m>(
    measurement: &Measurement,
    memory: &'m mut [num_complex::Complex<i16>],
    recorder: Conditions,
    uplink: Conditions,
) -> World<'m> {
    let config = configuration(measurement.profile.clone());
    let path = RadarPath::<ROW>::new(&config, memory).expect("the configuration is valid");
    let mut world = World::new(3, Link::Datagrams(Network::new(uplink, 71)), Host::default());
    world.radar = Some(RadarSide::new(measurement.datagrams(), Network::new(recorder, 72), path));
    world.reader = Some(reader());
    world.run_until(BridgeTime(SECONDS * SECOND + 500_000));
    world.finish();
    world
}

#[test]
fn half_a_minute_of_both() {
    let measurement = measurement();
    let mut memory = cube_memory(&configuration(measurement.profile.clone()));
    let recorder = Conditions { loss: 2e-4, duplicates: 1e-3, late: 1e-4, delay_us: 50, lateness_us: 400 };
    let uplink = Conditions { loss: 0.01, delay_us: 200, ..Conditions::default() };
    let world = run(&measurement, &mut memory, recorder, uplink);
    let World { host, link: Link::Datagrams(network), .. } = &world else { panic!("it is a network") };
    let radar = world.radar.as_ref().expect("there is a radar");
    let reader = world.reader.as_ref().expect("there is a reader");

    // Every frame was made; of each, something came.
    let frames = radar.path.frames();
    assert_eq!((frames.complete + frames.incomplete, frames.lost), (measurement.frames, 0));
    assert!((5..300).contains(&frames.incomplete), "{frames:?}");
    assert!(host.frames().map(|f| f.frame).eq(0..measurement.frames), "each once and in order");
    let marked = host.frames().filter_map(|f| f.info).filter(|i| i.chirps_lost > 0).count();
    assert!(marked <= frames.incomplete as usize && marked + 20 > frames.incomplete as usize);

    // The packets that were dropped are counted as lost, but for the last ones of a stream. Those of the radar and
    // of the reader did not disturb each other's numbers: otherwise there were tens of thousands.
    let counts = host.receiver.counts();
    let dropped = network.dropped().len() as u64;
    assert!(dropped > 50);
    assert!(counts.packets_lost <= dropped && counts.packets_lost + 4 >= dropped, "{counts:?} of {dropped}");
    assert_eq!(counts.packets + dropped, network.sent());
    assert_eq!((counts.packets_late, counts.packets_malformed, counts.restarts), (0, 0, 0));

    // Reads: all true, in order, each once; a lost packet has those of 10 ms and what the network delays.
    let sent = reader.reader.reads();
    let mut rest = sent.iter();
    let same = |got: &TagRead, sent: &TagRead| TagRead { time: sent.time, ..got.clone() } == *sent;
    assert!(host.reads().all(|got| rest.any(|sent| same(got, sent))));
    let arrived = host.reads().count();
    assert!(sent.len() > 5_500 && arrived > sent.len() * 97 / 100 && arrived < sent.len());
    assert_eq!(reader.path.counts().link.link_losses, 0);

    // Telemetry came once a second, and agrees with what the paths count.
    let telemetry: Vec<&Telemetry> = host.telemetry().collect();
    assert!((29..=33).contains(&telemetry.len()), "{}", telemetry.len());
    let last = telemetry[telemetry.len() - 1];
    assert_eq!((last.frames, last.datagrams), (radar.path.frames(), radar.path.datagrams()));
    assert_eq!((last.reader.state, last.uplink_dropped), (ReaderState::None, 0));
    let grows = |pair: &[&Telemetry]| pair[0].datagrams.received <= pair[1].datagrams.received;
    assert!(telemetry.windows(2).all(grows));

    // Nothing piles up: a frame's packets and some reads are under way at most.
    assert!(network.most_flying() <= 16, "{}", network.most_flying());
    assert!(radar.network.most_flying() <= 32, "{}", radar.network.most_flying());
}

#[test]
fn streams_are_numbered_apart() {
    let measurement = Measurement { frames: 100, ..measurement() };
    let config = configuration(measurement.profile.clone());
    let mut memory = cube_memory(&config);
    let path = RadarPath::<ROW>::new(&config, &mut memory).expect("the configuration is valid");
    // Nothing arrives before the end: the packets are looked at instead.
    let slow = Conditions { delay_us: 100 * SECOND, ..Conditions::default() };
    let mut world = World::new(3, Link::Datagrams(Network::new(slow, 1)), Host::default());
    world.radar = Some(RadarSide::new(measurement.datagrams(), Network::new(Conditions::default(), 2), path));
    world.reader = Some(reader());
    world.run_until(BridgeTime(3 * SECOND));
    let Link::Datagrams(network) = &mut world.link else { panic!("it is a network") };
    let mut next = BTreeMap::<u8, u32>::new();
    let mut last = BridgeTime(0);
    while let Some(packet) = network.arrive(BridgeTime(u64::MAX)) {
        let header = Packet::decode(&packet).expect("the bridge's own").header;
        let expected = next.entry(header.stream as u8).or_default();
        assert_eq!(header.sequence, *expected, "{:?}", header.stream);
        *expected += 1;
        // A frame bears the time of its beginning, all others that of their sending.
        if header.stream != Stream::Radar {
            assert!(header.time >= last);
            last = header.time;
        }
    }
    assert_eq!(next.len(), 3, "radar, tags, telemetry");
    // Two maps, covariance and the frame itself are four packets.
    assert_eq!(next[&(Stream::Radar as u8)], 400);
}
