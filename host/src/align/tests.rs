use rfhoi_shared::config::{BridgeConfig, RadarConfig};
use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, BridgeTime, CentiDbm, ChannelIndex, PhaseCode};
use rfhoi_shared::wire::{FrameInfo, Message, Sequencer};

use super::*;
use crate::maps::Flaw;
use crate::phase::Invalid;
use crate::receive::RadarFrame;

const PERIOD_US: u64 = 100_000;

fn radar() -> RadarConfig {
    BridgeConfig::default().radar
}

fn stream() -> FrameStream {
    FrameStream::new(Settings::new(radar())).unwrap()
}

/// A frame of which only the account came, stamped `us`.
fn bare(number: u32, us: u64) -> RadarFrame {
    let info = FrameInfo { frame: number, profile: radar().profile.fingerprint(), ..FrameInfo::default() };
    RadarFrame { frame: number, time: BridgeTime(us), info: Some(info), ..RadarFrame::default() }
}

fn read(us: u64, phase: u16) -> TagRead {
    TagRead {
        time: BridgeTime(us),
        epc: Epc::new(&[7]).unwrap(),
        antenna: AntennaPort(1),
        channel: ChannelIndex(3),
        phase: Some(PhaseCode(phase % PhaseCode::CODES_PER_TURN)),
        rssi: CentiDbm(-5_000),
        doppler: None,
    }
}

fn taken(stream: &mut FrameStream) -> Vec<AlignedFrame> {
    std::iter::from_fn(|| stream.next()).collect()
}

fn numbers(frames: &[AlignedFrame]) -> Vec<u32> {
    frames.iter().map(|frame| frame.number).collect()
}

#[test]
fn frames_follow_each_other_and_lost_ones_keep_their_place() {
    let mut stream = stream();
    for number in [5, 6, 9, 10] {
        stream.push_frame(&bare(number, u64::from(number) * PERIOD_US));
    }
    stream.finish();
    let frames = taken(&mut stream);
    assert_eq!(numbers(&frames), [5, 6, 7, 8, 9, 10]);
    assert!(frames.windows(2).all(|pair| pair[0].end == pair[1].begin));
    assert!(frames.iter().all(|frame| frame.end.since(frame.begin) == PERIOD_US));
    let missing = Some(MapInvalid::Flaw(Flaw::Missing));
    assert!(MapName::ALL.iter().all(|&name| frames[2].invalid(name) == missing));
    assert!(frames[2].map(MapName::Angle).iter().all(|&value| value == 0.0));
    assert_eq!((stream.counts().frames, stream.counts().frames_missing), (6, 2));
}

#[test]
fn a_frame_waits_for_its_reads_as_long_as_there_is_a_reader() {
    let mut stream = stream();
    stream.push_frame(&bare(0, 0));
    stream.advance(BridgeTime(60_000));
    assert_eq!(taken(&mut stream).len(), 1, "nobody reads");
    for step in 0..40u64 {
        let us = PERIOD_US + step * 10_000;
        if step % 10 == 6 {
            let number = (us / PERIOD_US) as u32;
            stream.push_frame(&bare(number, u64::from(number) * PERIOD_US));
        }
        // A turn of 40 codes each 10 ms.
        stream.push_reads(&[read(us, 40 * step as u16)], BridgeTime(us + 5_000));
        stream.advance(BridgeTime(us + 5_000));
        for frame in taken(&mut stream) {
            assert!(
                us + 5_000 >= frame.end.0 + 20_000 && us < frame.end.0 + 30_000,
                "{} at {us}",
                frame.number
            );
            if frame.begin.0 > PERIOD_US {
                let turned = frame.phase(0, 0).unwrap();
                assert!((turned - 400.0 / 4096.0 * std::f32::consts::TAU).abs() < 0.06, "{turned}");
            }
        }
    }
    assert_eq!(stream.counts().frames, 4);
}

#[test]
fn without_a_radar_tags_go_on() {
    let mut stream = stream();
    for step in 0..300u64 {
        let us = 7_000_000 + step * 10_000;
        stream.push_reads(&[read(us, 0)], BridgeTime(us));
        stream.advance(BridgeTime(us));
    }
    let frames = taken(&mut stream);
    assert!((24..=28).contains(&frames.len()), "{}", frames.len());
    let last = frames.last().unwrap();
    assert_eq!(last.invalid(MapName::RangeTime), Some(MapInvalid::Flaw(Flaw::Missing)));
    assert!(last.phase(0, 0).unwrap().abs() < 0.01);
    assert_eq!(last.phase(0, 3), Err(Invalid::NeverSeen));
    assert_eq!(last.phase(1, 0), Err(Invalid::NeverSeen), "there is no other tag");
    // The radar comes up and brings its own numbers.
    stream.push_frame(&bare(900, 10_000_000));
    stream.finish();
    assert_eq!(taken(&mut stream).last().unwrap().number, 900);
    assert_eq!(stream.counts().beginnings, 2);
}

#[test]
fn a_bridge_that_restarts_begins_a_new_grid() {
    let (mut before, mut after) = (Sequencer::new(1), Sequencer::new(2));
    let mut stream = stream();
    let profile = radar().profile.fingerprint();
    let mut push = |sequencer: &mut Sequencer, number: u32| {
        let message = Message::Frame(FrameInfo { frame: number, profile, ..FrameInfo::default() });
        let packet = sequencer.wrap(BridgeTime(u64::from(number) * PERIOD_US), message);
        stream.push(packet.encode(&mut [0; 256]).unwrap()).unwrap();
    };
    (70..73).for_each(|number| push(&mut before, number));
    (0..3).for_each(|number| push(&mut after, number));
    stream.finish();
    assert_eq!(numbers(&taken(&mut stream)), [70, 71, 72, 0, 1, 2]);
    assert_eq!((stream.counts().beginnings, stream.counts().link.restarts), (2, 1));
    assert!(stream.push(b"nothing").is_err());
}

#[test]
fn frames_of_another_profile_are_told() {
    let mut stream = stream();
    let mut frame = bare(0, 0);
    frame.info = frame.info.map(|info| FrameInfo { profile: 1, ..info });
    stream.push_frame(&frame);
    stream.finish();
    assert_eq!(stream.next().unwrap().invalid(MapName::RangeDoppler), Some(MapInvalid::OtherProfile));
}

#[test]
fn a_clock_that_leaps_ahead_costs_nothing() {
    let mut stream = stream();
    stream.push_frame(&bare(0, 0));
    stream.advance(BridgeTime(u64::MAX));
    stream.push_reads(&[read(u64::MAX - 9, 0)], BridgeTime(u64::MAX));
    stream.advance(BridgeTime(u64::MAX));
    stream.finish();
    assert!(taken(&mut stream).len() <= 2);
}

#[test]
fn a_long_silence_is_not_filled() {
    let mut stream = stream();
    stream.push_frame(&bare(0, 0));
    stream.push_frame(&bare(100_000, 100_000 * PERIOD_US));
    stream.finish();
    assert_eq!(numbers(&taken(&mut stream)), [0, 100_000]);
    assert_eq!(stream.counts().beginnings, 2);
}
