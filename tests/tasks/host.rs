//! Hosts come, go and are absent; the stream goes to the one that said hello last, and answers to whoever asks.

use std::collections::BTreeMap;

use rfhoi_shared::config::{BridgeConfig, Endpoint};
use rfhoi_shared::wire::{Packet, Request, Stream};
use rfhoi_tests::simulated::rig::{NetworkHost, Setup, run_script};

use crate::{HOST, RUNNING, setup};

/// Numbers of the packets that a host got, by stream.
fn numbers(host: &NetworkHost) -> BTreeMap<u8, Vec<u32>> {
    let mut numbers = BTreeMap::<u8, Vec<u32>>::new();
    for (_, packet) in host.packets().iter() {
        let header = Packet::decode(packet).expect("the bridge's own").header;
        numbers.entry(header.stream as u8).or_default().push(header.sequence);
    }
    numbers
}

#[test]
fn the_stream_goes_to_whoever_said_hello_last() {
    run_script(setup(600), |rig| async move {
        let other_port = Endpoint { port: 50_001, ..HOST };
        let other_address = Endpoint { address: [192, 168, 33, 21], ..HOST };
        let hosts = [HOST, other_port, other_address].map(|endpoint| rig.host(endpoint));
        for (turn, host) in hosts.iter().enumerate() {
            assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
            rig.until(RUNNING + 3.0 * turn as f64).await;
            // Who identifies a bridge does not take its stream away.
            assert_eq!(hosts[0].ask(Request::Identify).await, Some(Ok(())));
        }
        rig.pass(3.0).await;
        let all = hosts.iter().map(numbers).collect::<Vec<_>>();
        for stream in [Stream::Radar, Stream::Tags, Stream::Telemetry] {
            let parts = all.iter().filter_map(|numbers| numbers.get(&(stream as u8)));
            assert_eq!(parts.clone().count(), 3, "each had its turn");
            let joined: Vec<u32> = parts.flatten().copied().collect();
            let first = joined[0];
            assert!(
                joined.iter().copied().eq(first..first + joined.len() as u32),
                "{stream:?} without a gap"
            );
        }
        let telemetry = hosts[2].telemetry();
        assert_eq!((telemetry.uplink_dropped, telemetry.frames.incomplete, telemetry.overruns), (0, 0, 0));
    });
}

#[test]
fn an_absent_host_does_not_keep_another_from_its_answers() {
    let absent = Endpoint { address: [192, 168, 33, 99], ..HOST };
    let config = BridgeConfig { host: Some(absent), ..setup(0).config };
    run_script(Setup { config, ..setup(600) }, |rig| async move {
        let host = rig.host(HOST);
        rig.until(RUNNING).await;
        let mut answered = 0;
        for _ in 0..20 {
            answered += u32::from(host.ask(Request::Identify).await == Some(Ok(())));
            rig.pass(0.1).await;
        }
        println!("{answered} of 20 answered");
        assert_eq!(answered, 20);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        let since = rig.seconds();
        rig.pass(3.0).await;
        let telemetry = host.telemetry();
        println!("{telemetry:?}");
        // All that was made is here or counted, but for what waits.
        let all = numbers(&host);
        let radar = &all[&(Stream::Radar as u8)];
        assert!(radar.windows(2).all(|pair| pair[1] == pair[0] + 1), "no gap after hello at {since}");
        assert_eq!((telemetry.frames.incomplete, telemetry.datagrams.lost, telemetry.overruns), (0, 0, 0));
        assert!(telemetry.uplink_dropped > 100);
        assert_eq!(telemetry.reader.link_losses, 0);
    });
}

#[test]
fn packets_that_cannot_leave_are_counted() {
    let absent = Endpoint { address: [192, 168, 33, 99], ..HOST };
    let config = BridgeConfig { host: Some(absent), ..setup(0).config };
    run_script(Setup { config, ..setup(400) }, |rig| async move {
        rig.until(9.0).await;
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.pass(2.0).await;
        assert_eq!(host.ask(Request::Stop).await, Some(Ok(())));
        rig.pass(3.0).await;
        let made: u32 = numbers(&host).values().map(|n| n[n.len() - 1] + 1).sum();
        let came: usize = numbers(&host).values().map(Vec::len).sum();
        println!("{} of {made} packets dropped", made as usize - came);
        assert_eq!(host.telemetry().uplink_dropped as usize, made as usize - came);
    });
}
