//! Signal processing that comes late or not at all, and profiles of which memory holds one cube only.

use rfhoi_firmware::dca1000::DATA_PORT;
use rfhoi_shared::config::BridgeConfig;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::wire::Request;
use rfhoi_tests::simulated::path;
use rfhoi_tests::simulated::radar::{Measurement, configuration};
use rfhoi_tests::simulated::rig::{Setup, run_script};

use crate::{HOST, setup};

#[test]
fn frames_are_overrun_whole_until_signal_processing_runs() {
    const FRAMES: u32 = 300;
    run_script(Setup { dsp: false, ..setup(FRAMES) }, |rig| async move {
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.until(5.0).await;
        assert_eq!(host.host().frames().count(), 0);
        let counts = host.telemetry();
        assert_eq!((counts.frames.incomplete, counts.datagrams.lost), (0, 0), "reception goes on");
        assert!(counts.overruns > 50 && counts.overruns < counts.frames.complete);
        assert_eq!(rig.board.state().feeds.len(), 0, "the watchdog is not fed");
        rig.start_dsp();
        rig.pass(1.1).await;
        let (from, overruns) = (rig.seconds(), host.telemetry().overruns);
        rig.until(11.0).await;
        let counts = host.telemetry();
        assert_eq!(counts.overruns, overruns, "both cubes are in use again");
        assert_eq!(counts.frames.complete, FRAMES);
        assert_eq!(host.host().frames().count(), (FRAMES - overruns) as usize, "the others are there");
        let feeds = rig.board.state().feeds.iter().filter(|time| time.seconds() > from).count();
        assert!((4..=5).contains(&feeds), "{feeds} feeds in {} s", 11.0 - from);
    });
}

#[test]
fn the_watchdog_is_fed_once_a_second_while_all_runs() {
    run_script(setup(200), |rig| async move {
        // Also while no frames come.
        rig.until(20.5).await;
        let feeds = rig.board.state().feeds.clone();
        assert_eq!(feeds.len(), 20);
        assert!(feeds.windows(2).all(|pair| (990_000..=1_010_000).contains(&pair[1].since(pair[0]))));
    });
}

#[test]
fn the_fine_profile_runs_on_one_cube() {
    const FRAMES: u32 = 40;
    let profile = RadarProfile::fine();
    let config = BridgeConfig { radar: configuration(profile.clone()), ..BridgeConfig::default() };
    let measurement = Measurement { profile, ..setup(FRAMES).measurement };
    run_script(Setup { config: config.clone(), measurement, ..setup(FRAMES) }, |rig| async move {
        rig.switch.listen(rig.outlets.bridge, DATA_PORT);
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.until(8.0).await;
        let counts = host.telemetry();
        let arrived: Vec<u32> = host.host().frames().map(|f| f.frame).collect();
        println!("{counts:?}, frames {arrived:?}");
        assert_eq!((counts.frames.complete, counts.frames.incomplete), (FRAMES, 0));
        assert_eq!(arrived.len() as u32 + counts.overruns, FRAMES, "each frame is there or counted");
        // A frame ends in the datagram in which the next one begins, so the next one finds no cube.
        assert!(arrived.len() as u32 * 2 >= FRAMES);
        // Those that are there are whole.
        let expected = path::run(&config.radar, rig.switch.heard(rig.outlets.bridge, DATA_PORT));
        let host = host.host();
        for frame in host.frames() {
            let same = expected.frames.iter().find(|e| e.frame == frame.frame).expect("it was sent");
            assert!(frame.range_time == same.range_time && frame.range_doppler == same.range_doppler);
            assert_eq!(frame.covariance, same.covariance);
        }
    });
}
