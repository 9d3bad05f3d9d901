//! A serial uplink with bit errors: a damaged frame costs itself, or with its end also the next, and is counted.

use rfhoi_shared::units::BridgeTime;
use rfhoi_tests::simulated::network::{Conditions, Network};
use rfhoi_tests::simulated::path::{cube_memory, packets, run};
use rfhoi_tests::simulated::radar::{Measurement, configuration};
use rfhoi_tests::simulated::reader::{Setup, SimulatedReader, Tag};
use rfhoi_tests::simulated::serial::SerialLine;
use rfhoi_tests::simulated::world::{Host, Link, ROW, RadarSide, ReaderSide, SECOND, World};

use rfhoi_firmware::bridge::RadarPath;
use rfhoi_shared::config::ReaderConfig;
use rfhoi_shared::scene::Scene;

#[test]
fn damaged_frames_cost_only_themselves() {
    let measurement = Measurement::hand_before_wall(60);
    let config = configuration(measurement.profile.clone());
    let sent = packets(&config, 1, measurement.datagrams()).packets;
    // Of the order of 10,000 bits a packet: none, a tenth, half and nearly all of the packets.
    for (bit_errors, seed) in [(0.0, 1), (1e-5, 2), (1e-4, 3), (1e-3, 4)] {
        let mut line = SerialLine::new(bit_errors, seed);
        let mut host = Host::default();
        for packet in &sent {
            line.send(packet).expect("the bridge's packets are not too long");
            while let Some(packet) = line.arrive() {
                host.take(&packet);
            }
        }
        host.finish();
        let damaged = line.damaged().range(..line.sent()).count() as u64;
        let counts = host.receiver.counts();
        assert_eq!(counts.packets, line.sent() - damaged, "{bit_errors}: whatever is not damaged comes");
        assert_eq!(u64::from(line.counts().good), counts.packets);
        assert_eq!((counts.packets_late, counts.packets_malformed), (0, 0), "nothing damaged is believed");
        // A changed byte may end a frame early, so one may count as several; one without its end counts with the next.
        let merged = u64::from(bit_errors > 0.0) * damaged / 2;
        assert!(u64::from(line.counts().bad) + merged >= damaged, "{:?} of {damaged}", line.counts());
        assert_eq!(bit_errors == 0.0, damaged == 0);
        // All are of the radar's stream: what is missing between two that came is counted.
        let intact = |n: &u64| !line.damaged().contains(n);
        let (first, last) = ((0..line.sent()).find(intact), (0..line.sent()).rfind(intact));
        let (first, last) = (first.expect("some came"), last.expect("some came"));
        assert_eq!(counts.packets_lost, line.damaged().range(first..last).count() as u64);
    }
}

#[test]
fn radar_and_reader_share_a_line() {
    let measurement = Measurement::hand_before_wall(100);
    let config = configuration(measurement.profile.clone());
    let clean = run(&config, measurement.datagrams());
    let mut memory = cube_memory(&config);
    let path = RadarPath::<ROW>::new(&config, &mut memory).expect("the configuration is valid");
    let mut world = World::new(1, Link::Serial(SerialLine::new(1e-5, 5)), Host::default());
    let network = Network::new(Conditions::default(), 1);
    world.radar = Some(RadarSide::new(measurement.datagrams(), network, path));
    let tags = vec![Tag { epc: [0xE2; 12], distance_m: 2.0, swing_m: 0.2 }];
    let reader_config = ReaderConfig::for_scene([192, 168, 33, 40], &Scene::default());
    let reader = SimulatedReader::new(Setup::new(tags));
    world.reader = Some(ReaderSide::new(reader, reader_config, 200..=1_000, 9));
    world.run_until(BridgeTime(3 * SECOND));
    world.finish();

    let Link::Serial(line) = &world.link else { panic!("it is a serial line") };
    let counts = world.host.receiver.counts();
    let damaged = line.damaged().range(..line.sent()).count() as u64;
    assert!(damaged > 3);
    assert_eq!(counts.packets, line.sent() - damaged);
    for frame in world.host.frames() {
        let same = &clean.frames[frame.frame as usize];
        assert!(frame.range_doppler.is_none() || frame.range_doppler == same.range_doppler);
    }
    let sent = world.reader.as_ref().map_or(&[][..], |r| r.reader.reads());
    let arrived = world.host.reads().count();
    // A packet has the reads of 10 ms: two of them.
    assert!(
        arrived <= sent.len() && arrived + 3 * damaged as usize >= sent.len(),
        "{arrived} of {}",
        sent.len()
    );
}
