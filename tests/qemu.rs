//! The bridge's image on QEMU's Cortex-M7, end to end: the recorder's datagrams and a reader that is not ours go in,
//! packets come out at the host's side.
//!
//! Prints what a frame takes in instructions by stage, and holds it against the table in
//! `firmware/boards/qemu-an500/instructions.tsv`, which `RFHOI_KEEP=1` writes anew.
//!
//! Needs `qemu-system-arm`, a toolchain for the MCU (`firmware/boards/build` says what is missing) and `llrpkit`; without
//! them the test says so and passes, unless `RFHOI_REQUIRE` is set.

use std::collections::BTreeMap;
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::Path;
use std::time::{Duration, Instant};

use expect_test::expect;
use rfhoi::hoi::{Action, Category, Object};
use rfhoi::receive::{RadarFrame, Received};
use rfhoi::recognize::tags::TagNames;
use rfhoi::recognize::{Recognizer, Settings, model};
use rfhoi_firmware::dca1000::command::Command;
use rfhoi_firmware::reference;
use rfhoi_network::model::Precision;
use rfhoi_shared::config::{
    BridgeConfig, ConfigError, Endpoint, Processing, RadarConfig, RadarInput, ReaderConfig,
};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{
    DatagramCounts, FrameCounts, RadarState, ReaderState, Refusal, Request, RestartReason, Telemetry,
};
use rfhoi_tests::simulated::machine::{self, DEVICES, Machine};
use rfhoi_tests::simulated::radar::{Measurement, point};
use rfhoi_tests::simulated::{path, person};

/// Datagrams sent before the image is asked whether it has come so far. QEMU's network device keeps six, and QEMU may give
/// it several before the processor gets to run, besides what the reader sends.
const WINDOW: usize = 3;
/// Questions by which the work of one is measured.
const QUESTIONS: u32 = 200;
/// Frames over which work is measured.
const MEASURED: u32 = 10;
/// What part of a frame's processing reception may wait for it: it waits while a packet is put into a queue, no more.
const MOST_LATE: u64 = 20;
/// Reads a second of the emulated reader.
const READ_RATE: u32 = 100;

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
    questions: u32,
}

impl Recording {
    fn of(measurement: &Measurement) -> Self {
        let datagrams = measurement.datagrams().map(|(_, datagram)| datagram).collect();
        Self::new(&measurement.profile, datagrams)
    }

    fn new(profile: &RadarProfile, datagrams: Vec<Vec<u8>>) -> Self {
        Self {
            datagrams,
            datagrams_a_frame: f64::from(profile.frame_bytes()) / 1456.0,
            sent: 0,
            frames: 0,
            questions: 0,
        }
    }

    /// Sends the datagrams that complete the next frame, unless `drop` says not to, and waits for the image after each
    /// `window` of them: so QEMU loses none.
    fn frame(&mut self, machine: &mut Machine, window: usize, mut drop: impl FnMut(usize) -> bool) {
        self.frames += 1;
        let end = (self.frames as f64 * self.datagrams_a_frame).ceil() as usize;
        let end = end.min(self.datagrams.len());
        for number in self.sent..end {
            if !drop(number) {
                machine.send_data(&self.datagrams[number]);
            }
            if number % window == window - 1 || number == end - 1 {
                ask(machine);
                self.questions += 1;
            }
        }
        self.sent = end;
    }
}

/// Waits until the image has taken all datagrams sent so far.
fn ask(machine: &mut Machine) {
    machine.wait_for_qemu();
    machine.ask(Request::Identify);
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

/// Waits until the radar listens.
fn wait_for_radar(machine: &mut Machine) {
    let listens = |t: &Telemetry| matches!(t.radar, RadarState::Silent | RadarState::Streaming);
    machine.wait("the radar's start", |m| {
        m.console.is_started() && m.host.telemetry().last().is_some_and(listens)
    });
}

/// Streams `count` frames of `config`, which is in force since the last start, without a loss, and compares them with a
/// PC's.
fn stream(machine: &mut Machine, config: &RadarConfig, count: u32, seed: u64) {
    let mut recording = Recording::of(&measurement(config.profile.clone(), count, seed));
    wait_for_radar(machine);
    let had = machine.host.frames().count();
    let link = machine.host.receiver.counts();
    let start = Instant::now();
    for frame in 1..=count as usize {
        recording.frame(machine, WINDOW, |_| false);
        machine.wait("a frame", |m| m.host.frames().count() >= had + frame);
    }
    let seconds = start.elapsed().as_secs_f64();
    let after = machine.telemetry();
    let received = machine.host.receiver.counts();
    let frames = machine.host.frames().skip(had).cloned().collect::<Vec<_>>();
    assert_same_maps(&frames, config, &recording.datagrams);
    assert_eq!(received.packets_lost, link.packets_lost);
    assert_eq!(received.frames_with_holes, link.frames_with_holes);
    assert_eq!(after.frames, FrameCounts { complete: count, ..FrameCounts::default() });
    let datagrams = recording.datagrams.len() as u32;
    assert_eq!(after.datagrams, DatagramCounts { received: datagrams, ..DatagramCounts::default() });
    assert_eq!((after.overruns, after.uplink_dropped), (0, 0));
    say(&format!("{count} simulated frames in {seconds:.1} s, none lost, maps as on a PC"));
}

/// What a frame takes.
#[derive(Debug)]
struct Cost {
    /// Instructions of all that the image does for a frame, telemetry too.
    instructions: u64,
    /// Instructions of a question, left out above.
    question: u64,
    /// Instructions from the last datagram to the last packet of a frame, on average; interrupts too.
    latency: u64,
    bytes: u64,
    packets: u64,
}

/// Measures [`MEASURED`] frames whose datagrams come one by one, as the recorder sends them.
fn measure(machine: &mut Machine, config: &RadarConfig) -> Cost {
    wait_for_radar(machine);
    let idle = machine.telemetry();
    (0..QUESTIONS).for_each(|_| ask(machine));
    let before = machine.telemetry();
    let question_us = (before.busy_us - idle.busy_us) as f64 / f64::from(QUESTIONS);
    let had = machine.host.frames().count();
    let mut questions = 0;
    // Each is a recording of its own, and waited for: of `fine` there is room for one.
    let frame = measurement(config.profile.clone(), 1, 9);
    for frames in 1..=MEASURED as usize {
        let mut recording = Recording::of(&frame);
        recording.frame(machine, 1, |_| false);
        questions += recording.questions;
        machine.wait("a frame", |m| m.host.frames().count() >= had + frames);
    }
    let after = machine.telemetry();
    assert_eq!((after.datagrams.lost, after.overruns), (before.datagrams.lost, before.overruns));
    let infos = machine.host.frames().skip(had).filter_map(|f| f.info);
    let latency: u64 = infos.map(|info| u64::from(info.latency_us)).sum();
    let questions_us = question_us * f64::from(questions);
    let frames = u64::from(MEASURED);
    // They are the same here and there.
    let packets = path::packets(config, 1, frame.datagrams()).packets;
    // An instruction is a nanosecond.
    Cost {
        instructions: (((after.busy_us - before.busy_us) as f64 - questions_us) * 1e3) as u64 / frames,
        question: (question_us * 1e3) as u64,
        latency: latency * 1_000 / frames,
        bytes: packets.iter().map(|packet| packet.len() as u64).sum(),
        packets: packets.len() as u64,
    }
}

#[test]
fn the_image_works_end_to_end() {
    let Some(image) = machine::image("qemu-an500", "bridge") else { return };
    let reader_port = machine::free_tcp_port();
    let Some(mut emulator) = machine::reader_emulator(reader_port, READ_RATE, 1) else { return };
    let Some(stages) = machine::image("qemu-an500", "stages") else { return };
    let Some(mut machine) = Machine::start(&image) else { return };

    // As it comes out of the box: no reader, the `bridge` profile.
    machine.ask(Request::Hello);
    let hello = machine.hello().expect("it was asked").clone();
    assert_eq!(hello.board.as_str(), "qemu-an500");
    let default = BridgeConfig::default();
    assert_eq!(hello.profile, default.radar.profile.fingerprint());
    assert_eq!(machine.telemetry().restart, RestartReason::PowerOn);
    stream(&mut machine, &default.radar, 20, 1);
    let bridge = measure(&mut machine, &default.radar);
    assert_eq!(machine.recorder_commands.last(), Some(&Command::RecordStart));

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
    let late_us = machine.host.telemetry().map(|t| u64::from(t.late_us)).max().unwrap_or(0);
    let frame_us = bridge.latency / 1_000;
    say(&format!("reception waited less than {late_us} us while frames were worked on, {frame_us} us each"));
    assert!(late_us > 0 && late_us * MOST_LATE <= frame_us);

    let profile = RadarProfile::fine();
    let gate = default.radar.processing.gate;
    let fine = RadarConfig { processing: Processing::with_gate(&profile, gate), profile, ..default.radar };
    machine.configure(&BridgeConfig { radar: fine.clone(), ..default });
    let fine = measure(&mut machine, &fine);
    machine.configure(&BridgeConfig::default());
    recognise(&mut machine);
    drop(machine);
    hold_instructions(&stages, &bridge, &fine);
}

/// A simulated person opens a microwave before the image's radar: the same is recognised as through a PC's bridge.
fn recognise(machine: &mut Machine) {
    let acted = person::act("kitchen", Category { action: Action::Open, object: Object::Microwave }, 101);
    assert_eq!(acted.config.processing, BridgeConfig::default().radar.processing);
    wait_for_radar(machine);
    let had = machine.host.frames().count();
    let datagrams = acted.datagrams.clone();
    let mut recording = Recording::new(&acted.config.profile, datagrams);
    for frame in 1..=acted.frames as usize {
        recording.frame(machine, WINDOW, |_| false);
        machine.wait("a frame", |m| m.host.frames().count() >= had + frame);
    }
    let there = machine.host.frames().skip(had).cloned().collect::<Vec<_>>();
    let arrivals = acted.datagrams.iter().map(|datagram| (BridgeTime(0), datagram.clone()));
    let here = path::run(&acted.config, arrivals).frames;
    let model = model::built_in(Precision::Int8).expect("it is built in");
    let names = model::names().expect("they are built in");
    let told = |frames: &[RadarFrame]| {
        let settings =
            Settings { profile: None, tags: TagNames::simulated(), least: None, threads: NonZeroUsize::MIN };
        let mut recognizer = Recognizer::new(&model, &names, settings).expect("it is for this radar");
        acted.recognise(frames, &mut recognizer)
    };
    let (there, here) = (told(&there), told(&here));
    assert!(!here.is_empty(), "somebody moved");
    // To the last bit, probabilities too.
    assert_eq!(there, here);
    say(&format!("{} simulated frames: recognised as on a PC: {here:?}", acted.frames));
}

/// Digest of the reference on this machine.
fn digest_here() -> u32 {
    let profile = RadarProfile::bridge();
    let processing = Processing::for_scene(&profile, &Scene::default()).unwrap();
    let config = RadarConfig { profile, input: RadarInput::Uart, processing };
    reference::digest(&config, 2, &mut path::cube_memory(&config)).unwrap()
}

#[test]
fn digest_of_the_reference() {
    // Held here too, so that a change of any bit of maps, covariance or wire is seen in a diff.
    expect!["8eef1c9b"].assert_eq(&format!("{:08x}", digest_here()));
}

/// Where the instructions are kept.
const KEPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../firmware/boards/qemu-an500/instructions.tsv");
/// What a count may be above the kept one, for other compilers: a twentieth, and what a small stage varies.
fn most(kept: u64) -> u64 {
    kept + kept / 20 + 20_000
}

/// Instructions of all that a frame takes, at most; 100 ms at 480 MHz are 48 million.
const MOST: [(&str, u64); 2] = [("bridge", 15_000_000), ("fine", 30_000_000)];
/// The same without the FFTs, `bridge`: as much as they take themselves.
const MOST_BESIDES_FFT: u64 = 8_100_000;

/// Holds that the image of the stages computes the same bits, and that no stage takes more than is kept.
fn hold_instructions(stages: &Path, bridge: &Cost, fine: &Cost) {
    let text = machine::run_stages(stages);
    let digest = text.lines().find_map(|line| line.strip_prefix("digest bridge ")).expect("a digest");
    assert_eq!(digest, format!("{:08x}", digest_here()));
    let mut rows: Vec<(String, [u64; 2])> = Vec::new();
    let mut add = |name: &str, column: usize, count: u64| match rows.iter_mut().find(|row| row.0 == name) {
        Some(row) => row.1[column] = count,
        None => {
            let mut row = [0; 2];
            row[column] = count;
            rows.push((name.into(), row));
        }
    };
    let (mut fft, mut sums) = ([0; 2], [0; 2]);
    for (column, (name, cost)) in [("bridge", bridge), ("fine", fine)].into_iter().enumerate() {
        let prefix = format!("instructions {name} ");
        let line = text.lines().find_map(|line| line.strip_prefix(&prefix)).expect("a table");
        for (stage, count) in line.split(' ').filter_map(|pair| pair.split_once('=')) {
            let count: u64 = count.parse().expect("a count");
            if stage == "all" {
                sums[column] = count;
                continue;
            }
            fft[column] += if stage.ends_with("_fft") { count } else { 0 };
            add(stage, column, count);
        }
        add("network", column, cost.instructions.saturating_sub(sums[column]));
        add("all", column, cost.instructions);
        add("latency", column, cost.latency);
        add("uplink_bytes", column, cost.bytes);
        add("uplink_packets", column, cost.packets);
    }
    let mut table = String::from("stage\tbridge\tfine\n");
    for (name, [bridge, fine]) in &rows {
        table += &format!("{name}\t{bridge}\t{fine}\n");
    }
    say(&format!(
        "instructions of a frame on the Cortex-M7 (simulated datagrams, one by one; `network` is all that is not a stage; \
         a question of {} left out):\n{table}",
        bridge.question
    ));
    if std::env::var_os("RFHOI_KEEP").is_some() {
        std::fs::write(KEPT, &table).expect("the table can be written");
    }
    let kept = std::fs::read_to_string(KEPT).expect("the table is kept");
    let kept: BTreeMap<&str, Vec<u64>> = kept
        .lines()
        .skip(1)
        .map(|line| {
            let mut cells = line.split('\t');
            (cells.next().unwrap_or(""), cells.filter_map(|cell| cell.parse().ok()).collect())
        })
        .collect();
    for (name, counts) in &rows {
        for (count, &kept) in counts.iter().zip(&kept[name.as_str()]) {
            assert!(*count <= most(kept), "{name} takes {count}, {kept} is kept in {KEPT}");
        }
    }
    for (column, (name, most)) in MOST.into_iter().enumerate() {
        let all = [bridge, fine][column].instructions;
        assert!(all < most, "{name} takes {all} instructions a frame");
    }
    assert!(bridge.instructions - fft[0] <= MOST_BESIDES_FFT);
}

/// 200 frames and 2,000 reads, nothing lost.
fn both_at_once(machine: &mut Machine, config: &BridgeConfig) {
    const FRAMES: u32 = 200;
    const READS: usize = 2_000;
    // What was under way when the image restarted is not theirs.
    let before = machine.host.receiver.counts().packets_lost;
    machine.wait("reads", |m| m.host.reads().next().is_some());
    stream(machine, &config.radar, FRAMES, 2);
    machine.wait("reads", |m| m.host.reads().count() >= READS);
    let telemetry = machine.telemetry();
    let reads = machine.host.reads().count();
    // Reads on their way when telemetry was made.
    let underway = usize::try_from(telemetry.reader.reads).expect("few").abs_diff(reads);
    assert!(underway < READ_RATE as usize, "{reads} of {}", telemetry.reader.reads);
    assert_eq!((telemetry.reader.state, telemetry.reader.malformed), (ReaderState::Reading, 0));
    assert_eq!(machine.host.receiver.counts().packets_lost, before);
    assert!(machine.host.reads().all(|read| read.phase.is_some()));
    say(&format!("{reads} reads beside them, none lost ({before} packets before)"));
}

/// Everything that may go wrong outside of the bridge; what is lost is counted, and what comes back is taken up.
fn trouble(
    machine: &mut Machine,
    config: &BridgeConfig,
    emulator: machine::Process,
    reader_port: u16,
) -> machine::Process {
    let packets_lost = machine.host.receiver.counts().packets_lost;
    // One datagram in 20 is lost.
    const LOSSY: u32 = 40;
    let before = machine.telemetry();
    let mut recording = Recording::of(&measurement(config.radar.profile.clone(), LOSSY + 10, 3));
    let mut random = 7_u32;
    let mut dropped = 0;
    let lossy_end = (f64::from(LOSSY) * recording.datagrams_a_frame) as usize;
    for frame in 0..LOSSY + 10 {
        recording.frame(machine, WINDOW, |number| {
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
    assert_eq!(machine.host.receiver.counts().packets_lost, packets_lost);
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
