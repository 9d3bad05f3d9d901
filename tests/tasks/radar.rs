//! Radar and recorder that are absent or fall silent: states, notices, and another attempt.

use embedded_io_async::Write;
use rfhoi_firmware::dca1000::command::Command;
use rfhoi_shared::wire::{RadarState, Request};
use rfhoi_tests::simulated::rig::{NetworkHost, Rig, run_script};

use crate::{HOST, RUNNING, setup};

/// A wait of 5 s, program and calibration of 2.0 s, and the next telemetry's second; the bridge sees data when it looks, every
/// 0.5 s; s.
const BACK: f64 = 5.0 + 2.0 + 0.5 + 1.1;
/// A stop waits for the console's answer and the recorder's: 1 s and ten times 0.3 s where there are none; s.
const STOP: f64 = 1.05 + 10.0 * 0.3 + 1.1;

async fn takes(rig: &Rig, host: &NetworkHost, state: RadarState, most: f64) -> f64 {
    let from = rig.seconds();
    while host.host().telemetry().last().is_none_or(|t| t.radar != state) {
        rig.pass(0.01).await;
        assert!(rig.seconds() - from <= most, "{state:?} was not reached within {most} s");
    }
    rig.seconds() - from
}

fn times(rig: &Rig, line: &str) -> usize {
    rig.console.with(|console| console.taken().iter().filter(|l| *l == line).count())
}

#[test]
fn a_recorder_that_is_absent_is_tried_until_it_is_there() {
    run_script(setup(1_000), |rig| async move {
        rig.switch.set_plugged(rig.outlets.recorder, false);
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.until(20.0).await;
        let notices = host.notices();
        println!("{notices:?}");
        assert!(notices.iter().all(|n| n.starts_with("the DCA1000EVM does not answer SystemConnect")));
        // 2.6 s of attempts, 5 s of waiting.
        assert_eq!(notices.len(), 3);
        assert_eq!(times(&rig, "sensorStart"), 0, "not before the recorder");
        let states: Vec<RadarState> = host.host().telemetry().map(|t| t.radar).collect();
        assert!(states.contains(&RadarState::Waiting), "{states:?}");
        rig.switch.set_plugged(rig.outlets.recorder, true);
        let back = takes(&rig, &host, RadarState::Streaming, BACK).await;
        println!("streaming {back:.2} s after the recorder is there");
        assert_eq!((times(&rig, "sensorStart"), host.telemetry().frames.incomplete), (1, 0));
    });
}

#[test]
fn a_stop_is_obeyed_without_recorder_and_console() {
    run_script(setup(1_000), |rig| async move {
        rig.switch.set_plugged(rig.outlets.recorder, false);
        rig.console.set_plugged(false);
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.until(30.0).await;
        assert_eq!(host.ask(Request::Stop).await, Some(Ok(())));
        let stopped = takes(&rig, &host, RadarState::Stopped, STOP).await;
        println!("stopped after {stopped:.2} s");
    });
}

#[test]
fn a_radar_without_console_is_started_by_somebody_else() {
    run_script(setup(200), |rig| async move {
        rig.console.set_plugged(false);
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.until(20.0).await;
        println!("{:?}", host.notices());
        assert_eq!(host.notices().len(), 1);
        assert!(host.notices()[0].starts_with("the radar's command line does not answer"));
        assert_eq!(host.telemetry().radar, RadarState::Silent);
        assert_eq!(rig.recorder.taken().last(), Some(&Command::RecordStart));
        rig.console.set_plugged(true);
        let mut console = rig.console.clone();
        console.write_all(b"sensorStart\n").await.expect("it is there");
        let streaming = takes(&rig, &host, RadarState::Streaming, 1.5 + 0.5 + 1.1).await;
        println!("streaming {streaming:.2} s after the start");
        rig.pass(5.0).await;
        assert_eq!((host.telemetry().frames.complete, host.telemetry().frames.incomplete), (200, 0));
    });
}

#[test]
fn a_radar_that_falls_silent_is_programmed_again() {
    run_script(setup(3_000), |rig| async move {
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.until(RUNNING).await;
        assert_eq!(host.telemetry().radar, RadarState::Streaming);
        rig.recorder.set_muted(true);
        // 3 s without data, as seen every 0.5 s.
        let silent = takes(&rig, &host, RadarState::Silent, 3.5 + 1.1).await;
        assert_eq!(host.notices(), ["no data of the radar for 3 s"]);
        let programming = takes(&rig, &host, RadarState::Programming, 10.0 + 1.1).await;
        rig.recorder.set_muted(false);
        let back = takes(&rig, &host, RadarState::Streaming, BACK).await;
        println!(
            "silent after {silent:.2} s, programmed after {programming:.2} s more, back after {back:.2} s"
        );
        assert_eq!(times(&rig, "sensorStart"), 2);
        let before = host.telemetry();
        rig.pass(3.1).await;
        let after = host.telemetry();
        println!("{after:?}");
        assert_eq!(after.datagrams.restarts, 1);
        assert!(after.frames.complete > before.frames.complete + 140, "it streams on");
        assert!(after.frames.incomplete <= 2, "the frame in which it fell silent");
    });
}
