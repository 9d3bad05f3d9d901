//! Configurations: taken whole or not at all, kept over restarts; and the commands around them.

use rfhoi::receive::Received;
use rfhoi_shared::config::{BridgeConfig, ConfigError};
use rfhoi_shared::wire::{
    BRIDGE_PORT, Command, MAX_PACKET, Message, Packet, ReaderState, Refusal, Request, RestartReason,
    Sequencer, VERSION,
};
use rfhoi_tests::simulated::rig::{NetworkHost, Rig, clock, run_script};

use crate::{HOST, RUNNING, setup};

/// After a restart the IP stack looks up one address a second: the reader's, the recorder's, the host's; s.
const LOOKUPS: f64 = 3.0;
/// A restart waits 0.25 s so that its answer leaves, and the simulated board takes 0.1 s, s.
const RESTART: f64 = 0.4;

async fn configuration(host: &NetworkHost) -> BridgeConfig {
    assert_eq!(host.insist(Request::GetConfig).await, Some(Ok(())));
    let received = host.received();
    let mut configs =
        received.iter().filter_map(|r| if let Received::Config(c) = r { Some(c) } else { None });
    configs.next_back().expect("it came before its acknowledgement").clone()
}

/// Stops radar and reader, and waits until they are.
async fn stop(rig: &Rig, host: &NetworkHost) {
    assert_eq!(host.ask(Request::Stop).await, Some(Ok(())));
    rig.pass(1.5).await;
}

#[test]
fn a_configuration_is_kept_and_takes_effect() {
    run_script(setup(1_000), |rig| async move {
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.until(RUNNING).await;
        let before = setup(0).config;
        assert_eq!(configuration(&host).await, before);
        let mut wanted = before.clone();
        wanted.radar.processing.zero_doppler_guard = 3;
        wanted.host = Some(HOST);
        let configure = || Request::Configure(wanted.clone());
        assert_eq!(host.ask(configure()).await, Some(Err(Refusal::Busy)));
        stop(&rig, &host).await;

        let mut invalid = wanted.clone();
        invalid.radar.processing.range_time_columns = 3;
        let refused = Err(Refusal::Config(ConfigError::RangeTimeColumns(3)));
        assert_eq!(host.ask(Request::Configure(invalid)).await, Some(refused));
        rig.board.state().worn_out = true;
        assert_eq!(host.ask(configure()).await, Some(Err(Refusal::NotKept)));
        rig.board.state().worn_out = false;
        rig.pass(RESTART).await;
        assert_eq!(
            (configuration(&host).await, rig.board.state().starts),
            (before, 1),
            "nothing has changed"
        );

        assert_eq!(host.ask(configure()).await, Some(Ok(())));
        rig.pass(RESTART).await;
        assert_eq!((configuration(&host).await, rig.board.state().starts), (wanted.clone(), 2));
        rig.pass(RUNNING + LOOKUPS).await;
        let telemetry = host.telemetry();
        println!("{} packets dropped while addresses were looked up", telemetry.uplink_dropped);
        assert_eq!(telemetry.restart, RestartReason::Command);
        assert_eq!(telemetry.reader.state, ReaderState::Reading, "it runs after a restart");
        assert!(telemetry.frames.complete > 20 && telemetry.frames.incomplete == 0);
        assert_eq!(host.insist(Request::Restart).await, Some(Ok(())));
        rig.pass(RESTART).await;
        assert_eq!((configuration(&host).await, rig.board.state().starts), (wanted, 3));
        let link = host.host().receiver.counts();
        assert_eq!((link.restarts, link.packets_lost), (2, 0));
    });
}

#[test]
fn damaged_bytes_give_the_default() {
    run_script(setup(100), |rig| async move {
        let host = rig.host(HOST);
        let mut starts = 1;
        let whole = rig.board.state().kept.clone().expect("the rig's configuration");
        let mut other_version = whole.clone();
        other_version[0] = VERSION + 1;
        let cut = whole[..whole.len() / 2].to_vec();
        // An interior byte: a number of loops that no profile has, or the like.
        let mut wrong = whole.clone();
        wrong[20..60].fill(0xff);
        for kept in [None, Some(Vec::new()), Some(cut), Some(other_version), Some(wrong)] {
            rig.board.state().kept.clone_from(&kept);
            assert_eq!(host.insist(Request::Restart).await, Some(Ok(())));
            rig.pass(RESTART).await;
            starts += 1;
            assert_eq!(configuration(&host).await, BridgeConfig::default(), "{kept:?}");
            assert_eq!(rig.board.state().starts, starts);
        }
        rig.board.state().kept = Some(whole);
        assert_eq!(host.insist(Request::Restart).await, Some(Ok(())));
        rig.pass(RESTART).await;
        assert_eq!(configuration(&host).await, setup(0).config);
    });
}

#[test]
fn a_command_that_comes_twice_is_done_once() {
    run_script(setup(1_000), |rig| async move {
        let host = rig.host(HOST);
        assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
        rig.until(RUNNING).await;
        let config = setup(0).config;
        let busy = Some(Err(Refusal::Busy));
        let ack = host.ask_as(900, Request::Configure(config.clone())).await;
        assert_eq!(ack.map(|ack| ack.outcome), busy);
        stop(&rig, &host).await;
        assert_eq!(
            host.ask_as(901, Request::Configure(config.clone())).await.map(|a| a.outcome),
            Some(Ok(()))
        );
        // The answer was lost, so the host asks again while the bridge is about to restart.
        assert_eq!(host.ask_as(901, Request::Configure(config)).await.map(|a| a.outcome), Some(Ok(())));
        rig.pass(RESTART).await;
        rig.pass(RUNNING).await;
        assert_eq!(rig.board.state().starts, 2);
        let ack = host.ask_as(902, Request::Stop).await;
        assert_eq!(ack.map(|ack| ack.outcome), Some(Ok(())));
        rig.pass(1.5).await;
        assert_eq!(host.ask_as(903, Request::Start).await.map(|ack| ack.outcome), Some(Ok(())));
        rig.pass(2.5).await;
        let programmed =
            |rig: &Rig| rig.console.with(|c| c.taken().iter().filter(|l| *l == "sensorStart").count());
        let before = programmed(&rig);
        assert_eq!(host.ask_as(903, Request::Start).await.map(|ack| ack.outcome), Some(Ok(())));
        rig.pass(2.5).await;
        assert_eq!(programmed(&rig), before);
    });
}

#[test]
fn another_version_is_answered() {
    run_script(setup(100), |rig| async move {
        let host = rig.host(HOST);
        let command = Message::Command(Command { id: 5, request: Request::Identify });
        let packet = Sequencer::new(0).wrap(clock::now(), command);
        let mut buffer = [0; MAX_PACKET];
        let mut bytes = packet.encode(&mut buffer).expect("it fits").to_vec();
        bytes[4] = VERSION + 1;
        host.send(&bytes, BRIDGE_PORT).await;
        rig.pass(0.1).await;
        let packets = host.packets();
        assert_eq!(packets.len(), 1);
        let answer = Packet::decode(&packets[0].1).expect("the bridge's own");
        assert_eq!(answer.header.version, VERSION);
        assert!(matches!(answer.message, Message::Hello(hello) if hello.board == "simulated"));
    });
}
