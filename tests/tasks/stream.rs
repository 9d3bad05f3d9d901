//! Radar and reader to the host: nothing is lost where nothing goes wrong, and what the network loses is counted.

use rfhoi::receive::RadarFrame;
use rfhoi_firmware::dca1000::DATA_PORT;
use rfhoi_shared::tag::TagRead;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{FrameCounts, FrameInfo, RadarState, ReaderState, Request};
use rfhoi_tests::simulated::network::Conditions;
use rfhoi_tests::simulated::path;
use rfhoi_tests::simulated::rig::{Arrival, run_script};

use crate::{HOST, setup};

/// A frame without what tells when the bridge worked on it.
fn timeless(frame: &RadarFrame) -> RadarFrame {
    let info = frame.info.map(|info| FrameInfo { latency_us: 0, ..info });
    RadarFrame { time: BridgeTime(0), info, ..frame.clone() }
}

#[test]
fn everything_arrives_as_it_was_measured() {
    const FRAMES: u32 = 560;
    let config = setup(FRAMES).config;
    let (host, heard, reads) = run_script(setup(FRAMES), |rig| async move {
        rig.switch.listen(rig.outlets.bridge, DATA_PORT);
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.until(14.5).await;
        let telemetry = host.telemetry();
        assert_eq!((telemetry.reader.state, telemetry.radar), (ReaderState::Reading, RadarState::Streaming));
        assert_eq!(host.ask(Request::Stop).await, Some(Ok(())));
        rig.pass(1.6).await;
        let telemetry = host.telemetry();
        println!("{telemetry:?}");
        assert_eq!((telemetry.reader.state, telemetry.radar), (ReaderState::None, RadarState::Stopped));
        let complete = FrameCounts { complete: FRAMES, ..FrameCounts::default() };
        assert_eq!((telemetry.frames, telemetry.overruns, telemetry.uplink_dropped), (complete, 0, 0));
        let datagrams = telemetry.datagrams;
        assert_eq!(datagrams.received as usize, rig.recorder.sent());
        assert_eq!((datagrams.lost, datagrams.late, datagrams.malformed, datagrams.restarts), (0, 0, 0, 0));
        let reader = telemetry.reader;
        assert_eq!((reader.link_losses, reader.malformed, reader.unknown, telemetry.strays), (0, 0, 0, 0));
        assert_eq!(rig.switch.overflowed(rig.outlets.bridge), 0);
        assert_eq!(host.notices(), Vec::<String>::new());
        let reads = rig.reader.with(|reader| reader.reads().to_vec());
        (host, rig.switch.heard(rig.outlets.bridge, DATA_PORT), reads)
    });
    let link = host.host().receiver.counts();
    assert_eq!((link.packets_lost, link.packets_late, link.packets_malformed), (0, 0, 0));

    // What the tasks made of the datagrams is what the path makes of them in one go.
    let expected = path::run(&config.radar, heard);
    assert_eq!(expected.frames.len(), FRAMES as usize);
    assert!(host.host().frames().map(timeless).eq(expected.frames.iter().map(timeless)));
    let host = host.host();
    let latency_us = host.frames().filter_map(|f| f.info).map(|info| info.latency_us).max();
    println!("signal processing took {latency_us:?} us of rounds at most");

    let got: Vec<TagRead> = host.reads().cloned().collect();
    println!("{} reads of {}", got.len(), reads.len());
    // Those under way when the session ended are not taken any more.
    assert!(got.len() >= 2_000 && got.len() <= reads.len() && got.len() + 2 >= reads.len());
    assert!(got.iter().zip(&reads).all(|(got, sent)| TagRead { time: sent.time, ..got.clone() } == *sent));
}

/// The packets of a run of a few seconds in which the network loses some of everything.
fn packets(seed: u64) -> Vec<Arrival> {
    run_script(rfhoi_tests::simulated::rig::Setup { seed, ..setup(100) }, |rig| async move {
        let lossy = Conditions { loss: 0.02, late: 0.05, duplicates: 0.02, delay_us: 40, lateness_us: 500 };
        rig.switch.set_conditions(rig.outlets.bridge, DATA_PORT, lossy);
        let host = rig.host(HOST);
        rig.switch.set_conditions(rig.outlets.bridge, 0, lossy);
        while host.ask(Request::Hello).await.is_none() {}
        rig.until(6.0).await;
        host.packets().to_vec()
    })
}

#[test]
fn a_seed_is_a_run() {
    let first = packets(1);
    assert!(first.len() > 500, "{}", first.len());
    assert!(first == packets(1), "the same packets at the same times");
    assert!(first != packets(2), "chance is of the seed");
}

#[test]
fn lost_datagrams_are_counted_and_cost_what_they_hold() {
    run_script(setup(400), |rig| async move {
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        let bridge = rig.outlets.bridge;
        let usual = Conditions { delay_us: 40, ..Conditions::default() };
        rig.switch.set_conditions(bridge, DATA_PORT, usual);
        rig.until(4.0).await;
        let before = host.host().frames().count();
        rig.switch.set_conditions(bridge, DATA_PORT, Conditions { loss: 0.05, ..usual });
        rig.until(7.0).await;
        rig.switch.set_conditions(bridge, DATA_PORT, usual);
        let lossy = host.host().frames().count();
        rig.until(13.0).await;
        let dropped = rig.switch.with_network(bridge, DATA_PORT, |network| network.dropped().len());
        let telemetry = host.telemetry();
        println!("{dropped} dropped, {telemetry:?}");
        assert_eq!(telemetry.datagrams.lost as usize, dropped);
        assert_eq!(telemetry.datagrams.received as usize + dropped, rig.recorder.sent());
        assert_eq!((telemetry.frames.lost, telemetry.overruns, telemetry.datagrams.late), (0, 0, 0));
        assert_eq!(telemetry.frames.complete + telemetry.frames.incomplete, 400);
        let host = host.host();
        let marked = |f: &RadarFrame| f.info.is_some_and(|info| info.chirps_lost > 0);
        let frames: Vec<&RadarFrame> = host.frames().collect();
        assert!(frames.iter().map(|f| f.frame).eq(0..400));
        assert_eq!(frames.iter().filter(|f| marked(f)).count(), telemetry.frames.incomplete as usize);
        assert!(!frames[..before].iter().any(|f| marked(f)), "none before");
        let within = &frames[before + 1..lossy];
        // Of 67 datagrams that 3 or 4 are lost is the rule.
        assert!(within.iter().filter(|f| marked(f)).count() * 100 >= within.len() * 95);
        // The frame that was under way when the loss ended, and no other.
        assert!(!frames[lossy + 1..].iter().any(|f| marked(f)), "none after");
        assert_eq!(host.receiver.counts().packets_lost, 0);
    });
}
