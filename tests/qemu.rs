//! The bridge's image on QEMU's Cortex-M7, end to end: the recorder's datagrams and a reader that is not ours go in,
//! packets come out at the host's side.
//!
//! Needs `qemu-system-arm`, a toolchain for the MCU (`firmware/boards/build` says what is missing) and `llrpkit`; without
//! them the test says so and passes, unless `RFHOI_REQUIRE` is set.

use std::collections::BTreeMap;
use std::io::Write;
use std::time::{Duration, Instant};

use rfhoi::receive::{RadarFrame, Received};
use rfhoi_firmware::dca1000::command::Command;
use rfhoi_shared::config::{BridgeConfig, ConfigError, Endpoint, RadarConfig, ReaderConfig};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{
    DatagramCounts, FrameCounts, RadarState, ReaderState, Refusal, Request, RestartReason, Telemetry,
};
use rfhoi_tests::simulated::machine::{self, DEVICES, Machine};
use rfhoi_tests::simulated::path;
use rfhoi_tests::simulated::radar::{Measurement, point};

/// Datagrams sent before the image is asked whether it has come so far: it keeps 64 frames of Ethernet.
const WINDOW: usize = 32;
/// Reads a second of the emulated reader.
const READ_RATE: u32 = 400;

/// A hand before a wall, in frames of `profile`.
fn measurement(profile: RadarProfile, frames: u32, seed: u64) -> Measurement {
    let scatterers = vec![point(1.2, 0.9, 0.05), point(2.5, 0.0, 0.3)];
    Measurement { profile, scatterers, frames, start: BridgeTime(0), noise: 2.0, seed }
}

/// A recording under way.
struct Recording {
    datagrams: Vec<Vec<u8>>,
    datagrams_a_frame: f64,
    sent: usize,
    frames: usize,
}

impl Recording {
    fn new(measurement: &Measurement) -> Self {
        let profile = &measurement.profile;
        Self {
            datagrams: measurement.datagrams().map(|(_, datagram)| datagram).collect(),
            datagrams_a_frame: f64::from(profile.frame_bytes()) / 1456.0,
            sent: 0,
            frames: 0,
        }
    }

    /// Sends the datagrams that complete the next frame, unless `drop` says not to; waits for the image after each
    /// window, and for the frame at the host where `whole`.
    fn frame(&mut self, machine: &mut Machine, mut drop: impl FnMut(usize) -> bool) {
        self.frames += 1;
        let end = (self.frames as f64 * self.datagrams_a_frame).ceil() as usize;
        let end = end.min(self.datagrams.len());
        for number in self.sent..end {
            if !drop(number) {
                machine.send_data(&self.datagrams[number]);
            }
            if number % WINDOW == WINDOW - 1 {
                machine.ask(Request::Identify);
            }
        }
        self.sent = end;
        machine.ask(Request::Identify);
    }
}

fn frames_by_number(frames: &[RadarFrame]) -> BTreeMap<u32, &RadarFrame> {
    frames.iter().map(|frame| (frame.frame, frame)).collect()
}

/// Holds that `frames` have the maps and covariances of the same logic on a PC, bit for bit.
fn assert_same_maps(frames: &[RadarFrame], config: &RadarConfig, datagrams: &[Vec<u8>]) {
    let arrivals = datagrams.iter().map(|datagram| (BridgeTime(0), datagram.clone()));
    let here = path::run(config, arrivals).frames;
    let here = frames_by_number(&here);
    for frame in frames {
        let same = here[&frame.frame];
        assert_eq!(frame.range_doppler, same.range_doppler, "frame {}", frame.frame);
        assert_eq!(frame.range_time, same.range_time, "frame {}", frame.frame);
        assert_eq!(frame.covariance, same.covariance, "frame {}", frame.frame);
    }
}

fn say(words: &str) {
    let _ = writeln!(std::io::stderr(), "{words}");
}

/// Radar frames that the host has.
fn frames(machine: &Machine) -> Vec<RadarFrame> {
    machine.host.frames().cloned().collect()
}

/// Work of the image for a frame of `profile`: instructions, and those of its latency, over `count` frames.
struct Cost {
    instructions: u64,
    latency: u32,
    bytes: u64,
    packets: u64,
}

/// Streams `count` frames of `config`, which is in force, without a loss, and compares them with a PC's.
fn stream(machine: &mut Machine, config: &RadarConfig, count: u32, seed: u64) -> Cost {
    let measurement = measurement(config.profile.clone(), count, seed);
    let mut recording = Recording::new(&measurement);
    let listens = |t: &Telemetry| matches!(t.radar, RadarState::Silent | RadarState::Streaming);
    machine.wait("the radar's start", |m| m.host.telemetry().last().is_some_and(listens));
    assert!(machine.console.is_started());
    let had = machine.host.frames().count();
    let before = machine.telemetry();
    let idle = idle_rate(machine);
    let link = machine.host.receiver.counts();
    let start = Instant::now();
    for frame in 1..=count as usize {
        recording.frame(machine, |_| false);
        machine.wait("a frame", |m| m.host.frames().count() >= had + frame);
    }
    let seconds = start.elapsed().as_secs_f64();
    let after = machine.telemetry();
    let received = machine.host.receiver.counts();
    let frames = frames(machine).split_off(had);
    assert_same_maps(&frames, config, &recording.datagrams);
    assert_eq!(received.packets_lost, link.packets_lost);
    assert_eq!(received.frames_with_holes, link.frames_with_holes);
    let counts = |t: &Telemetry| (t.frames.complete, t.datagrams.received);
    let (complete, datagrams) = (counts(&after).0 - counts(&before).0, counts(&after).1 - counts(&before).1);
    assert_eq!((complete, datagrams as usize), (count, recording.datagrams.len()));
    assert_eq!(after.frames, FrameCounts { complete: after.frames.complete, ..before.frames });
    assert_eq!(after.datagrams, DatagramCounts { received: after.datagrams.received, ..before.datagrams });
    assert_eq!((after.overruns, after.uplink_dropped), (before.overruns, before.uplink_dropped));
    let infos = frames.iter().filter_map(|f| f.info);
    let latency = infos.map(|info| info.latency_us).max().expect("there are frames");
    say(&format!("{count} simulated frames in {seconds:.1} s, {idle:.0} us of work a second without any"));
    Cost {
        instructions: (after.busy_us - before.busy_us) * 1_000 / u64::from(count),
        latency: latency * 1_000,
        bytes: (received.bytes - link.bytes) / u64::from(count),
        packets: (received.packets - link.packets) / u64::from(count),
    }
}

/// Microseconds of work in a second of the image's time in which no frame comes.
fn idle_rate(machine: &mut Machine) -> f64 {
    let times = |machine: &mut Machine| {
        let telemetry = machine.telemetry();
        telemetry.busy_us
    };
    let from = times(machine);
    let count = machine.host.telemetry().count();
    let to = times(machine);
    let seconds = (machine.host.telemetry().count() - count) as f64;
    (to - from) as f64 / seconds
}

#[test]
fn the_image_works_end_to_end() {
    let Some(image) = machine::image("qemu-an500", "bridge") else { return };
    let reader_port = machine::free_tcp_port();
    let Some(mut emulator) = machine::reader_emulator(reader_port, READ_RATE, 1) else { return };
    let Some(mut machine) = Machine::start(&image) else { return };

    // As it comes out of the box: no reader, the `bridge` profile.
    machine.ask(Request::Hello);
    let hello = machine.hello().expect("it was asked").clone();
    assert_eq!(hello.board.as_str(), "qemu-an500");
    let default = BridgeConfig::default();
    assert_eq!(hello.profile, default.radar.profile.fingerprint());
    assert_eq!(machine.telemetry().restart, RestartReason::PowerOn);
    let bridge = stream(&mut machine, &default.radar, 30, 1);
    assert_eq!(machine.recorder_commands.last(), Some(&Command::RecordStart));
    say(&format!(
        "Cortex-M7, bridge: {} instructions a frame in all, {} from the last datagram to the last packet, {} bytes in {} packets",
        bridge.instructions, bridge.latency, bridge.bytes, bridge.packets
    ));

    // A configuration that cannot be, and one that can.
    let mut wrong = default.clone();
    wrong.radar.processing.range_time_columns = 3;
    machine.ask(Request::Stop).outcome.expect("it may");
    machine.wait("a stop", |m| m.host.telemetry().last().is_some_and(|t| t.radar == RadarState::Stopped));
    let refused = Refusal::Config(ConfigError::RangeTimeColumns(3));
    assert_eq!(machine.ask(Request::Configure(wrong)).outcome, Err(refused));
    let mut with_reader = default.clone();
    let mut reader = ReaderConfig::for_scene(DEVICES, &with_reader.scene);
    reader.endpoint = Endpoint { address: DEVICES, port: reader_port };
    reader.keepalive_ms = 1_000;
    with_reader.reader = Some(reader);
    machine.configure(&with_reader);
    machine.ask(Request::GetConfig);
    let config = machine.host.received.iter().rev().find_map(|r| match r {
        Received::Config(config) => Some(config.clone()),
        _ => None,
    });
    assert_eq!(config, Some(with_reader.clone()));
    assert_eq!(machine.telemetry().restart, RestartReason::Command);

    both_at_once(&mut machine, &with_reader);
    emulator = trouble(&mut machine, &with_reader, emulator, reader_port);
    drop(emulator);
}

/// 200 frames and 2,000 reads, nothing lost.
fn both_at_once(machine: &mut Machine, config: &BridgeConfig) {
    const FRAMES: u32 = 200;
    const READS: usize = 2_000;
    machine.wait("reads", |m| m.host.reads().next().is_some());
    let cost = stream(machine, &config.radar, FRAMES, 2);
    machine.wait("reads", |m| m.host.reads().count() >= READS);
    let telemetry = machine.telemetry();
    let reads = machine.host.reads().count();
    // Reads on their way when telemetry was made.
    let underway = usize::try_from(telemetry.reader.reads).expect("few").abs_diff(reads);
    assert!(underway < READ_RATE as usize, "{reads} of {}", telemetry.reader.reads);
    assert_eq!((telemetry.reader.state, telemetry.reader.malformed), (ReaderState::Reading, 0));
    assert_eq!(machine.host.receiver.counts().packets_lost, 0);
    assert!(machine.host.reads().all(|read| read.phase.is_some()));
    say(&format!("with the reader: {} instructions a frame, {reads} reads", cost.instructions));
}

/// Everything that may go wrong outside of the bridge; what is lost is counted, and what comes back is taken up.
fn trouble(
    machine: &mut Machine,
    config: &BridgeConfig,
    emulator: machine::Process,
    reader_port: u16,
) -> machine::Process {
    // One datagram in 20 is lost.
    const LOSSY: u32 = 40;
    let before = machine.telemetry();
    let mut recording = Recording::new(&measurement(config.radar.profile.clone(), LOSSY + 10, 3));
    let mut random = 7_u32;
    let mut dropped = 0;
    let lossy_end = (f64::from(LOSSY) * recording.datagrams_a_frame) as usize;
    for frame in 0..LOSSY + 10 {
        recording.frame(machine, |number| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Not the first of a recording, by which it is recognised as one.
            let lost = number > 0 && number < lossy_end && random >> 16 < 65_536 / 20;
            dropped += u32::from(lost);
            lost
        });
        // Garbage at the port for data, and at those for commands and answers, from whoever can send there.
        if frame % 4 == 0 {
            machine.send_data(b"garbage");
            machine.send_data(&[0xff; 1466]);
            machine.send_to_bridge(b"garbage");
            machine.send_to_bridge(&[0x52; 1400]);
            machine.say(b"\x00\xffgarbage\r\n");
        }
    }
    let after = machine.telemetry();
    let lost = after.datagrams.lost - before.datagrams.lost;
    assert_eq!(lost, dropped, "datagrams lost as counted, as dropped");
    assert!(after.datagrams.malformed - before.datagrams.malformed >= 2 * (LOSSY + 10).div_ceil(4));
    assert!(after.strays - before.strays >= 2 * (LOSSY + 10).div_ceil(4), "{after:?}");
    let incomplete = after.frames.incomplete - before.frames.incomplete;
    // The first frames after the losses are whole again.
    assert!((LOSSY - 2..=LOSSY + 1).contains(&incomplete), "{incomplete} of {LOSSY} frames had holes");
    assert_eq!(machine.host.receiver.counts().packets_lost, 0);
    say(&format!(
        "{dropped} datagrams dropped, {lost} counted; {incomplete} of {LOSSY} frames with holes, none after"
    ));

    // The reader loses its power for a while.
    drop(emulator);
    machine.wait("the loss of the reader", |m| {
        m.host.telemetry().last().is_some_and(|t| t.reader.link_losses > after.reader.link_losses)
    });
    let emulator = machine::reader_emulator(reader_port, READ_RATE, 2).expect("it was there before");
    let had = machine.host.reads().count();
    let recovered = machine.wait("reads after the reader's restart", |m| m.host.reads().count() > had);
    say(&format!("reads again {recovered:.1?} after the reader's restart"));
    // The longest pause between attempts, and the connection.
    assert!(recovered < Duration::from_secs(45));

    // Another host takes over; it takes the packets from where they are.
    machine.new_host();
    let had = machine.host.reads().count();
    let start = Instant::now();
    machine.ask(Request::Hello);
    machine.wait("reads at the new host", |m| m.host.reads().count() > had);
    say(&format!("packets at the new host {:.2?} after its hello", start.elapsed()));
    let counts = machine.host.receiver.counts();
    assert!(start.elapsed() < Duration::from_secs(5), "{counts:?}");
    emulator
}
