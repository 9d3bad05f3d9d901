//! Garbage on every port: it is counted, and costs nothing else.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_firmware::dca1000::{CONFIG_PORT, DATA_PORT};
use rfhoi_shared::config::Endpoint;
use rfhoi_shared::wire::{BRIDGE_PORT, ReaderState, Request};
use rfhoi_tests::simulated::rig::run_script;

use crate::{HOST, RUNNING, setup};

/// Datagrams of garbage from each sender to each port.
const EACH: u32 = 50;

fn garbage(random: &mut ChaCha8Rng, most: usize) -> Vec<u8> {
    let mut bytes = vec![0; random.random_range(1..most)];
    random.fill_bytes(&mut bytes);
    bytes
}

#[test]
fn garbage_is_counted_and_nothing_else_is_lost() {
    run_script(setup(500), |rig| async move {
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        let stranger = rig.host(Endpoint { address: [192, 168, 33, 66], port: 4098 });
        rig.until(RUNNING).await;
        let mut random = ChaCha8Rng::seed_from_u64(9);
        let bridge = |port| Endpoint { address: [192, 168, 33, 30], port };
        for _ in 0..EACH {
            // What does not fit a socket is dropped before it is seen: 256 bytes for the recorder's answers, of
            // which the task hears 64 and counts a longer one.
            for (port, most) in [(DATA_PORT, 1_400), (CONFIG_PORT, 120), (BRIDGE_PORT, 1_400)] {
                stranger.send(&garbage(&mut random, most), port).await;
            }
            rig.recorder.send(&garbage(&mut random, 1_400), bridge(DATA_PORT)).await;
            rig.pass(0.003).await;
            rig.recorder.send(&garbage(&mut random, 60), bridge(CONFIG_PORT)).await;
            host.send(&garbage(&mut random, 1_400), BRIDGE_PORT).await;
            rig.console.say(&garbage(&mut random, 100));
            rig.pass(0.007).await;
        }
        rig.pass(2.0).await;
        let telemetry = host.telemetry();
        println!("{telemetry:?}");
        assert_eq!(telemetry.strays, 5 * EACH);
        assert_eq!(telemetry.datagrams.malformed, EACH);
        assert_eq!((telemetry.datagrams.lost, telemetry.datagrams.restarts), (0, 0));
        assert_eq!((telemetry.frames.incomplete, telemetry.frames.lost, telemetry.overruns), (0, 0, 0));
        assert_eq!((telemetry.reader.link_losses, telemetry.uplink_dropped), (0, 0));
        assert_eq!(stranger.packets().len(), 0);
        assert_eq!(host.notices(), Vec::<String>::new());

        rig.reader.say(b"\r\nlogin: ");
        rig.pass(3.0).await;
        let telemetry = host.telemetry();
        println!("{:?}", host.notices());
        assert_eq!((telemetry.reader.state, telemetry.reader.link_losses), (ReaderState::Reading, 1));
        assert_eq!((telemetry.frames.incomplete, telemetry.datagrams.lost), (0, 0));
        assert_eq!(host.host().receiver.counts().packets_lost, 0);
    });
}

#[test]
fn garbage_instead_of_answers_does_not_stop_the_radar_from_starting() {
    run_script(setup(100), |rig| async move {
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        let mut random = ChaCha8Rng::seed_from_u64(10);
        while rig.seconds() < 2.0 {
            rig.recorder
                .send(&garbage(&mut random, 60), Endpoint { address: [192, 168, 33, 30], port: CONFIG_PORT })
                .await;
            rig.pass(0.005).await;
        }
        rig.until(6.0).await;
        assert_eq!(host.telemetry().frames.complete, 100);
    });
}
