//! The reader's link: what breaks it is noticed, told and counted, and it comes back by itself.

use std::rc::Rc;

use rfhoi_shared::wire::{RadarState, ReaderCounts, ReaderState, Request};
use rfhoi_tests::simulated::network::Conditions;
use rfhoi_tests::simulated::rig::{NetworkHost, Rig, run_script};

use crate::{HOST, RUNNING, setup};

/// A reset or a close is noticed as soon as it comes; what is longer is the next telemetry's second, s.
const NOTICED: f64 = 1.1;
/// After three seconds without a reader the wait under way is of 2 s or 4 s, a quarter longer at most; the session takes
/// 0.1 s, and what is longer is the next telemetry's second, s.
const BACK: f64 = 4.0 * 1.25 + 0.1 + 1.1;
/// Three keepalive periods of 5 s, and the next telemetry's second, s.
const SILENCE: f64 = 15.0 + 1.1;
/// An attempt at a reader that does not answer takes 5 s, the wait after the third one 5 s at most; then as [`BACK`], s.
const BACK_FROM_SILENCE: f64 = 5.0 + 4.0 * 1.25 + 0.1 + 1.1;

/// Waits until the telemetry tells this; the seconds that it took, which may not be more than `most`.
async fn takes(rig: &Rig, host: &NetworkHost, told: impl Fn(ReaderCounts) -> bool, most: f64) -> f64 {
    let from = rig.seconds();
    while !told(host.telemetry().reader) {
        rig.pass(0.01).await;
        assert!(rig.seconds() - from <= most, "not within {most} s: {:?}", host.telemetry().reader);
    }
    rig.seconds() - from
}

fn reads(counts: ReaderCounts) -> bool {
    counts.state == ReaderState::Reading
}

async fn running(rig: &Rig) -> NetworkHost {
    let host = rig.host(HOST);
    assert_eq!(host.ask(Request::Hello).await, Some(Ok(())));
    rig.until(RUNNING).await;
    assert_eq!(host.telemetry().reader.state, ReaderState::Reading);
    host
}

async fn goes_and_comes(rig: Rc<Rig>, go: impl Fn(&Rig), come: impl Fn(&Rig), noticed: f64, back: f64) {
    let host = running(&rig).await;
    let before = host.host().reads().count();
    go(&rig);
    let noticed = takes(&rig, &host, |counts| counts.link_losses == 1, noticed).await;
    rig.pass(3.0).await;
    come(&rig);
    let back = takes(&rig, &host, reads, back).await;
    println!("noticed after {noticed:.2} s, back after {back:.2} s, {:?}", host.notices());
    rig.pass(1.1).await;
    assert!(host.host().reads().count() > before + 150, "reads go on");
    assert_eq!(host.telemetry().reader.link_losses, 1);
    assert_eq!(host.telemetry().radar, RadarState::Streaming);
    assert_eq!((host.telemetry().frames.incomplete, host.telemetry().datagrams.lost), (0, 0));
}

#[test]
fn a_reset_is_noticed_and_the_reader_comes_back() {
    run_script(setup(1_000), |rig| {
        goes_and_comes(rig, |r| r.reader.go_down(), |r| r.reader.come_up(), NOTICED, BACK)
    });
}

#[test]
fn a_close_is_noticed_and_the_reader_comes_back() {
    run_script(setup(1_000), |rig| {
        goes_and_comes(rig, |r| r.reader.shut_down(), |r| r.reader.come_up(), NOTICED, BACK)
    });
}

#[test]
fn a_cable_that_is_pulled_shows_by_missing_keepalives() {
    run_script(setup(2_000), |rig| {
        let plug = |plugged| move |rig: &Rig| rig.switch.set_plugged(rig.outlets.reader, plugged);
        goes_and_comes(rig, plug(false), plug(true), SILENCE, BACK_FROM_SILENCE)
    });
}

#[test]
fn a_stop_ends_the_session_and_a_start_begins_another() {
    /// The reader answers a goodbye at once; what is longer is the next telemetry's second, s.
    const STOP: f64 = 1.2;
    run_script(setup(1_000), |rig| async move {
        let host = running(&rig).await;
        assert_eq!(host.ask(Request::Stop).await, Some(Ok(())));
        takes(&rig, &host, |counts| counts.state == ReaderState::None, STOP).await;
        let read = rig.reader.with(|reader| reader.reads().len());
        rig.pass(1.0).await;
        assert_eq!(rig.reader.with(|reader| reader.reads().len()), read, "the reader reads no more");
        assert_eq!(host.ask(Request::Start).await, Some(Ok(())));
        takes(&rig, &host, reads, STOP).await;
        // A start while the goodbye is under way, which takes longer than the question.
        let slow = Conditions { delay_us: 20_000, ..Conditions::default() };
        rig.switch.set_conditions(rig.outlets.reader, 0, slow);
        assert_eq!(host.ask(Request::Stop).await, Some(Ok(())));
        assert_eq!(host.ask(Request::Start).await, Some(Ok(())));
        rig.pass(STOP + 1.0).await;
        assert_eq!(host.telemetry().reader.state, ReaderState::Reading);
        assert_eq!(rig.reader.connections(), 3);
        assert_eq!((host.telemetry().reader.link_losses, host.notices()), (0, Vec::new()));
    });
}
