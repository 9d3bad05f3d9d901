//! The SDK demo's two UARTs: a profile goes to the radar line by line and comes to be what was asked, and what the demo
//! computes (points, range profiles, maps) reaches the host with its values, through damage in between.

use std::collections::VecDeque;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi::receive::{HeatMap, RadarFrame};
use rfhoi_firmware::bridge::{UART_SCALE, UartPath};
use rfhoi_firmware::mmwave::cfg::{self, Board, CliProfile, DemoOptions, TEXT_CAPACITY};
use rfhoi_firmware::mmwave::cli::{CliError, Event, Session, Timeouts};
use rfhoi_firmware::mmwave::tlv::{
    ComplexI16, DetectedPoint, FrameHeader, FrameWriter, HeaderFormat, LevelScale, SideInfo, Temperatures,
    TlvKind,
};
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::config::{RadarConfig, RadarInput};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{FrameCounts, MAX_POINTS};
use rfhoi_tests::simulated::console::{Console, Said};
use rfhoi_tests::simulated::radar::{configuration, short_frames};
use rfhoi_tests::simulated::world::Host;

/// Longest frame of the simulated bridge.
const CAPACITY: usize = 16 * 1024;
/// SDK 3.6.
const VERSION: u32 = 0x0306_0000;

fn config() -> RadarConfig {
    RadarConfig { input: RadarInput::Uart, ..configuration(short_frames()) }
}

/// Code of the demo for a range bin and a Doppler column (0 to 15 from the most negative); 16 bits of magnitude are 3072.
fn code(frame: u32, bin: usize, column: usize) -> u16 {
    (600 + 11 * bin + 60 * column + 3 * frame as usize) as u16
}

fn points(frame: u32) -> Vec<(DetectedPoint, SideInfo)> {
    let point = |i: u32| {
        let x = i as f32;
        let point =
            DetectedPoint { x_m: 0.1 * x, y_m: 1.0 + 0.01 * x, z_m: -0.5, velocity_m_s: 0.25 * frame as f32 };
        (point, SideInfo { snr_decidb: 100 + i as i16, noise_decidb: 300 })
    };
    // From none to more than a packet holds.
    (0..frame % 6 * 20).map(point).collect()
}

/// Samples of the antennas in a range bin: the same in all bins.
fn antenna(number: usize) -> ComplexI16 {
    ComplexI16 { re: 1_000 - 150 * number as i16, im: 70 * number as i16 }
}

fn frame(number: u32) -> Vec<u8> {
    let bins = 128;
    let mut buffer = vec![0; CAPACITY];
    let mut writer = FrameWriter::new(&mut buffer, HeaderFormat::Subframe).expect("room");
    let (points, side): (Vec<_>, Vec<_>) = points(number).into_iter().unzip();
    writer.points(&points, &side).expect("room");
    let profile: Vec<u16> = (0..bins).map(|bin| code(number, bin, 0)).collect();
    writer.elements(TlvKind::RangeProfile, &profile).expect("room");
    // On the wire from zero Doppler up, then the negative ones.
    let cells: Vec<u16> =
        (0..bins).flat_map(|bin| (0..16).map(move |d| code(number, bin, (d + 8) % 16))).collect();
    writer.elements(TlvKind::RangeDopplerHeatmap, &cells).expect("room");
    let samples: Vec<ComplexI16> = (0..bins).flat_map(|_| (0..12).map(antenna)).collect();
    writer.elements(TlvKind::AzimuthElevationHeatmap, &samples).expect("room");
    writer.temperatures(&Temperatures { rx: [41, 44, 43, 40], ..Temperatures::default() }).expect("room");
    let header = FrameHeader { version: VERSION, platform: 0xA1843, number, ..FrameHeader::default() };
    writer.finish(header).expect("room").to_vec()
}

/// What the host gets of a stream that comes in pieces of this many bytes.
fn receive(stream: &[u8], piece: usize) -> (Vec<RadarFrame>, FrameCounts, Option<i16>) {
    let mut path = UartPath::<CAPACITY>::new(&config());
    let mut uplink = Uplink::new(1);
    let mut host = Host::default();
    let mut packets = Vec::new();
    let mut keep = |_, packet: &[u8]| {
        packets.push(packet.to_vec());
        true
    };
    let mut now = BridgeTime(0);
    for bytes in stream.chunks(piece) {
        // 921 600 baud are 92 160 bytes a second.
        now = now.after(bytes.len() as u64 * 1_000_000 / 92_160);
        path.push(now, bytes, &mut uplink, &mut keep);
    }
    path.finish(now, &mut uplink, &mut keep);
    packets.iter().for_each(|packet| host.take(packet));
    host.finish();
    assert_eq!((uplink.unsent(), host.receiver.counts().packets_malformed), (0, 0));
    (host.frames().cloned().collect(), path.frames(), path.radar_celsius())
}

/// Checks every value of a frame against what the radar sent under this number.
fn check(got: &RadarFrame, number: u32) {
    assert_eq!(got.frame, number);
    let levels = LevelScale::new(VERSION, 12, 128).expect("antennas and bins");
    let near = |map: &HeatMap, row: usize, column: usize, code: u16| {
        // Half a step of the uplink's codes, and what floats round.
        let error = map.level_db(row, column) - levels.level(code).0;
        assert!(error.abs() <= UART_SCALE.step_db / 2.0 + 1e-3, "row {row}, column {column}: {error} dB");
    };
    let gate = config().processing.gate;
    let (profile, map) = (got.range_time.as_ref().expect("sent"), got.range_doppler.as_ref().expect("sent"));
    assert_eq!((profile.columns, map.columns, profile.gate, map.gate), (1, 16, gate, gate));
    for row in 0..usize::from(gate.bins) {
        let bin = row + usize::from(gate.first);
        near(profile, row, 0, code(number, bin, 0));
        (0..16).for_each(|column| near(map, row, column, code(number, bin, column)));
    }
    let sent: Vec<_> = points(number).into_iter().map(|(point, side)| point.to_wire(Some(side))).collect();
    assert_eq!(got.points, sent);
    let packed = &got.covariance.as_ref().expect("sent").packed;
    let z = |v: usize| {
        let ComplexI16 { re, im } = antenna(v);
        (f32::from(re) / 32768.0, f32::from(im) / 32768.0)
    };
    // All bins are the same, so their mean is one of them: x0 conj(x_v) in the first row.
    for v in 1..12 {
        let ((xr, xi), (yr, yi)) = (z(0), z(v));
        let [re, im] = [packed[2 * v - 1], packed[2 * v]];
        assert!((re - (xr * yr + xi * yi)).abs() < 1e-7 && (im - (xi * yr - xr * yi)).abs() < 1e-7);
    }
}

#[test]
fn points_profiles_maps_and_covariance_arrive_with_their_values() {
    assert!(points(5).len() > MAX_POINTS);
    let stream: Vec<u8> = (0..6).flat_map(frame).collect();
    for piece in [1, 64, 3_000, stream.len()] {
        let (frames, counts, celsius) = receive(&stream, piece);
        assert_eq!(frames.len(), 6);
        (0..).zip(&frames).for_each(|(number, got)| check(got, number));
        assert_eq!(counts, FrameCounts { complete: 6, ..FrameCounts::default() });
        assert_eq!(celsius, Some(44));
    }
}

#[test]
fn damage_costs_the_frames_that_it_touches() {
    let mut random = ChaCha8Rng::seed_from_u64(51);
    let mut stream = Vec::new();
    let mut whole = Vec::new();
    for number in 0..40 {
        let bytes = frame(number);
        match number % 4 {
            1 => {
                let mut garbage = vec![0; random.random_range(1..500)];
                random.fill_bytes(&mut garbage);
                stream.extend(garbage);
            }
            // Bytes are lost somewhere after the magic and before the padding.
            2 => {
                let length = random.random_range(1..2_000);
                let start = random.random_range(8..bytes.len() - 32 - length);
                stream.extend(&bytes[..start]);
                stream.extend(&bytes[start + length..]);
                continue;
            }
            _ => {}
        }
        stream.extend(bytes);
        whole.push(number);
    }
    let (frames, counts, _) = receive(&stream, 777);
    assert!(frames.iter().map(|f| f.frame).eq(whole.iter().copied()), "whatever is whole comes, once");
    frames.iter().zip(&whole).for_each(|(got, &number)| check(got, number));
    // The lost frames are missing in the numbers, and began and were not complete.
    assert_eq!(counts, FrameCounts { complete: 30, incomplete: 10, lost: 10 });
}

/// What became of a session.
#[derive(Debug, Default, PartialEq)]
struct Report {
    done: Vec<u32>,
    failure: Option<(u32, String, CliError, String)>,
    took_us: u64,
}

/// Runs `lines` against `console` in virtual time; `hears` says which characters sent get through.
fn configure(lines: &str, console: &mut Console, mut hears: impl FnMut(u64) -> bool) -> Report {
    let mut session = Session::new(lines.lines(), Timeouts::default());
    let mut report = Report::default();
    let mut now = BridgeTime(0);
    let mut coming = VecDeque::<Said>::new();
    let mut sent = 0;
    loop {
        if let Some(line) = session.transmit(now) {
            let mut keep = |_: &char| {
                sent += 1;
                hears(sent)
            };
            let heard: String = line.chars().filter(|c| keep(c)).collect();
            coming.extend(console.hear(now, &heard));
        }
        let said_at = coming.front().map(|(time, _)| *time);
        let Some(next) = [said_at, session.deadline()].into_iter().flatten().min() else { break };
        now = next.max(now);
        let mut take = |event: Event<'_>| match event {
            Event::Text(_) => {}
            Event::Done { line, .. } => report.done.push(line),
            Event::Failed(f) => report.failure = Some((f.number, f.line.into(), f.error, f.answer.into())),
        };
        if said_at.is_some_and(|time| time <= now)
            && let Some((_, said)) = coming.pop_front()
        {
            let mut bytes = said.as_bytes();
            while let Some(event) = session.receive(&mut bytes, now) {
                take(event);
            }
        }
        session.tick(now).into_iter().for_each(take);
        if session.is_finished() || session.failure().is_some() {
            break;
        }
    }
    report.took_us = now.0;
    report
}

fn text(profile: &RadarProfile) -> String {
    let mut text = String::new();
    cfg::write(profile, &DemoOptions::default(), &mut text).expect("a string takes all");
    assert!(text.len() <= TEXT_CAPACITY);
    text
}

#[test]
fn the_radar_is_programmed_with_what_was_asked() {
    for profile in [RadarProfile::bridge(), RadarProfile::fine(), short_frames()] {
        let text = text(&profile);
        let mut console = Console::default();
        let report = configure(&text, &mut console, |_| true);
        assert_eq!(report.failure, None);
        assert!(report.done.iter().copied().eq(1..=text.lines().count() as u32), "each line is answered");
        assert!(console.is_started());
        assert_eq!(console.unheard(), 0, "nothing is said while the radar does not listen");
        let taken = CliProfile::parse(&console.taken().join("\n"), Board::default()).expect("it was taken");
        assert_eq!(taken.radar, profile);
        // 30 lines of 3 ms and their characters both ways, 1.5 s of calibration and no time limit that runs out.
        assert!((1_500_000..2_500_000).contains(&report.took_us), "{} us", report.took_us);
    }
}

#[test]
fn a_refusal_names_its_line_and_ends_the_session() {
    let text = text(&RadarProfile::bridge());
    let mut console = Console::default();
    console.refuses = Some("cfarCfg");
    let report = configure(&text, &mut console, |_| true);
    let number = text.lines().position(|line| line.starts_with("cfarCfg")).expect("it is there") as u32 + 1;
    let (failed, line, error, answer) = report.failure.expect("it fails");
    assert_eq!((failed, error), (number, CliError::Refused));
    assert!(line.starts_with("cfarCfg"));
    assert_eq!(answer, "Error: Invalid usage of the CLI command");
    assert_eq!(report.done.len() as u32, number - 1);
    assert!(!console.is_started(), "what comes after is not sent");
}

#[test]
fn a_line_whose_end_is_lost_times_out() {
    let text = text(&RadarProfile::bridge());
    // The first character sent is the empty line, then `sensorStop` and `flushCfg` with an end each.
    let end = 1 + "sensorStop\nflushCfg\n".len() as u64;
    let mut console = Console::default();
    let report = configure(&text, &mut console, |number| number != end);
    assert_eq!(report.failure, Some((2, "flushCfg".into(), CliError::Timeout, String::new())));
    assert!(report.took_us >= Timeouts::default().answer_us);
    // Another session starts from a known state: its empty line ends what was left.
    let report = configure(&text, &mut console, |_| true);
    assert_eq!(report.failure, None);
    assert!(console.is_started());
}
