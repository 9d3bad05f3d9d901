//! A lossy network between bridge and host: a lost packet costs its own rows, every loss is counted, and a restart of the
//! bridge is no loss.

use std::collections::BTreeMap;

use rfhoi::receive::{HeatMap, RadarFrame, Received};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{MapKind, Message, Packet};
use rfhoi_tests::simulated::network::{Conditions, Network};
use rfhoi_tests::simulated::path::{Packets, carry, packets};
use rfhoi_tests::simulated::radar::{Measurement, configuration, point};
use rfhoi_tests::simulated::world::Host;

const FRAMES: u32 = 12;

/// Frames of the `bridge` profile, whose range-Doppler maps take four packets.
fn bridge_packets(boot: u16) -> Vec<Vec<u8>> {
    let profile = RadarProfile::bridge();
    let measurement = Measurement {
        profile: profile.clone(),
        scatterers: vec![point(1.1, -0.8, 0.05), point(2.5, 0.0, 0.3)],
        frames: FRAMES,
        start: BridgeTime(0),
        noise: 4.0,
        seed: 6,
    };
    let Packets { packets, frames, .. } = packets(&configuration(profile), boot, measurement.datagrams());
    assert_eq!(frames.complete, FRAMES);
    packets
}

fn timed(packets: Vec<Vec<u8>>) -> impl Iterator<Item = (BridgeTime, Vec<u8>)> {
    (0..).map(|i| BridgeTime(i * 1_000)).zip(packets)
}

/// Rows of each map of each frame that are in these packets.
fn rows_in<'p>(packets: impl Iterator<Item = &'p [u8]>) -> BTreeMap<(u32, bool), Vec<u16>> {
    let mut rows = BTreeMap::<_, Vec<u16>>::new();
    for packet in packets {
        if let Message::MapRows(part) = Packet::decode(packet).expect("the bridge's own").message {
            let count = part.codes.len() as u16 / part.columns;
            let key = (part.frame, part.map == MapKind::RangeDoppler);
            rows.entry(key).or_default().extend(part.first_row..part.first_row + count);
        }
    }
    rows
}

fn map(frame: &RadarFrame, range_doppler: bool) -> Option<&HeatMap> {
    if range_doppler { frame.range_doppler.as_ref() } else { frame.range_time.as_ref() }
}

#[test]
fn lost_packets_cost_their_rows_only() {
    let sent = bridge_packets(1);
    let mut whole = Host::default();
    sent.iter().for_each(|packet| whole.take(packet));
    let clean: Vec<&RadarFrame> = whole.frames().collect();
    for seed in 1..=5 {
        let mut network = Network::new(Conditions::losing(0.15), seed);
        let arrived = carry(&mut network, timed(sent.clone()));
        let mut host = Host::default();
        arrived.iter().for_each(|(_, packet)| host.take(packet));
        host.finish();

        // All are of one stream: lost is what was dropped between the first and the last that came.
        let counts = host.receiver.counts();
        let number = |at: usize| u64::from(Packet::decode(&arrived[at].1).expect("whole").header.sequence);
        let (first, last) = (number(0), number(arrived.len() - 1));
        let dropped = network.dropped().iter().filter(|&&n| n > first && n < last).count() as u64;
        assert!(dropped > 4, "this test is about losses");
        assert_eq!((counts.packets_lost, counts.packets), (dropped, arrived.len() as u64));
        assert_eq!((counts.packets_late, counts.packets_malformed), (0, 0));

        let expected = rows_in(arrived.iter().map(|(_, packet)| packet.as_slice()));
        let frames: BTreeMap<u32, &RadarFrame> = host.frames().map(|f| (f.frame, f)).collect();
        assert_eq!(frames.len() as u64, counts.frames, "no frame comes twice");
        let mut with_rows_missing = 0;
        for clean in &clean {
            let frame = frames[&clean.frame];
            for range_doppler in [true, false] {
                let rows = expected.get(&(clean.frame, range_doppler));
                let (got, want) =
                    (map(frame, range_doppler), map(clean, range_doppler).expect("all arrived"));
                assert_eq!(got.is_some(), rows.is_some());
                let (Some(got), Some(rows)) = (got, rows) else { continue };
                with_rows_missing += u32::from(got.rows_missing() > 0);
                for (row, (codes, same)) in
                    got.codes.chunks(got.columns).zip(want.codes.chunks(want.columns)).enumerate()
                {
                    let arrived = rows.contains(&(row as u16));
                    assert_eq!(got.arrived[row], arrived);
                    assert!(codes == same || !arrived, "frame {}, row {row}", clean.frame);
                    assert_eq!(got.level_db(row, 0).is_nan(), !arrived, "what is missing has no level");
                }
            }
            assert!(frame.covariance.is_none() || frame.covariance == clean.covariance);
            assert!(frame.info.is_none() || frame.info == clean.info);
        }
        assert!(with_rows_missing > 0);
    }
}

#[test]
fn packets_that_come_late_or_twice_are_counted_and_not_used() {
    let sent = bridge_packets(1);
    let conditions = Conditions { duplicates: 0.1, late: 0.1, lateness_us: 5_000, ..Conditions::default() };
    let mut network = Network::new(conditions, 8);
    let arrived = carry(&mut network, timed(sent.clone()));
    let mut host = Host::default();
    arrived.iter().for_each(|(_, packet)| host.take(packet));
    host.finish();
    let counts = host.receiver.counts();
    let (mut highest, mut late) = (None, 0);
    for (_, packet) in &arrived {
        let sequence = Packet::decode(packet).expect("whole").header.sequence;
        late += u64::from(highest >= Some(sequence));
        highest = highest.max(Some(sequence));
    }
    assert!(late > 10);
    assert_eq!((counts.packets_late, counts.packets + counts.packets_late), (late, arrived.len() as u64));
    assert!(host.frames().map(|f| f.frame).eq(0..FRAMES), "each frame once, in order");
}

#[test]
fn a_restart_of_the_bridge_is_no_loss() {
    let (first, second) = (bridge_packets(7), bridge_packets(8));
    let mut host = Host::default();
    // It loses its power within a frame.
    let cut = first.len() - 5;
    first[..cut].iter().chain(&second).for_each(|packet| host.take(packet));
    let counts = host.receiver.counts();
    assert_eq!((counts.restarts, counts.packets_lost, counts.packets_late), (1, 0, 0));
    let restart = host.received.iter().position(|r| matches!(r, Received::Restarted)).expect("it is told");
    let before = host.received[..restart].iter().filter(|r| matches!(r, Received::Frame(_))).count();
    assert_eq!(before, FRAMES as usize, "the frame under way is handed on before");
    assert!(host.frames().skip(before).map(|f| f.frame).eq(0..FRAMES), "numbers begin again");
    assert_eq!(counts.frames_with_holes, 1);
}

#[test]
fn garbage_on_the_hosts_port_is_counted() {
    let sent = bridge_packets(1);
    let mut host = Host::default();
    for (i, packet) in sent.iter().enumerate() {
        host.take(packet);
        // Cut short, of another version, and no packet at all.
        host.take(&packet[..packet.len() - 1 - i % 8]);
        host.take(&[&packet[..4], &[packet[4] + 1], &packet[5..]].concat());
        host.take(b"M-SEARCH * HTTP/1.1\r\n");
    }
    let counts = host.receiver.counts();
    let packets = sent.len() as u64;
    assert_eq!((counts.packets, counts.packets_malformed), (packets, 3 * packets));
    assert_eq!((counts.packets_lost, counts.frames_with_holes), (0, 0));
}
