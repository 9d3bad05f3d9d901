//! Frames of simulated reads.

use std::f64::consts::{PI, TAU};

use rfhoi_shared::tag::{Epc, TagRead};
use rfhoi_shared::units::{AntennaPort, BridgeTime, CentiDbm, ChannelIndex, PhaseCode};

use super::super::circular;
use super::*;

const FRAME_US: u64 = 100_000;

fn epc(tag: u8) -> Epc {
    Epc::new(&[0xe2, 0x80, tag]).unwrap()
}

fn read(time: u64, tag: u8, antenna: u16, channel: u16, phase: f64) -> TagRead {
    TagRead {
        time: BridgeTime(time),
        epc: epc(tag),
        antenna: AntennaPort(antenna),
        channel: ChannelIndex(channel),
        phase: Some(PhaseCode::from_radians(phase.rem_euclid(TAU) as f32)),
        rssi: CentiDbm(-4_500),
        doppler: None,
    }
}

fn push_all(frames: &mut PhaseFrames, reads: &[TagRead]) {
    reads.iter().for_each(|read| frames.push(read, read.time));
}

/// Reads of tag 1 by antenna 1 each 14 ms, on channel 1, of which the phase is `phase(seconds)`.
fn reads(from_us: u64, until_us: u64, phase: impl Fn(f64) -> f64) -> Vec<TagRead> {
    let times = (from_us..until_us).step_by(14_000);
    times.map(|time| read(time, 1, 1, 1, phase(time as f64 * 1e-6))).collect()
}

fn frame(frames: &mut PhaseFrames, number: u64) -> PhaseFrame {
    frames.frame(BridgeTime(number * FRAME_US), BridgeTime((number + 1) * FRAME_US)).clone()
}

#[test]
fn frames_add_up_to_a_movement_that_turns_by_more_than_half_a_turn_in_each() {
    // 1.2 m/s away from the antenna, reached within 0.3 s: 4.6 rad in a frame.
    let rate = 1.2 * 4.0 * PI / 0.332;
    let phase = |s: f64| match s - 1.0 {
        t if t < 0.0 => 0.0,
        t if t < 0.3 => rate * t * t / 0.6,
        t => rate * (t - 0.15),
    };
    let mut frames = PhaseFrames::new(Settings::default());
    let mut due = reads(0, 2_020_000, phase).into_iter().peekable();
    let mut sum = 0.0;
    for number in 1..20 {
        // A little more than the frame, as its packets take their time.
        while let Some(read) = due.next_if(|read| read.time.0 < (number + 1) * FRAME_US + 20_000) {
            frames.push(&read, read.time);
        }
        let turned = f64::from(frame(&mut frames, number).tag(0)[0].unwrap());
        let (begin, end) = (number as f64 * 0.1, (number + 1) as f64 * 0.1);
        assert!((turned - phase(end) + phase(begin)).abs() < 0.15, "{number}: {turned}");
        sum += turned;
    }
    assert!((sum - phase(2.0)).abs() < 0.05 && sum > 30.0, "{sum}");
}

#[test]
fn holes_are_told_with_their_reason_and_frames_after_are_valid_again() {
    let mut frames = PhaseFrames::new(Settings::default());
    let mut all = reads(0, 1_000_000, |_| 1.0);
    all.retain(|read| !(310_000..520_000).contains(&read.time.0));
    push_all(&mut frames, &all);
    let reasons: Vec<_> = (0..9).map(|n| frame(&mut frames, n).tag(0)[0].err()).collect();
    assert_eq!(reasons[1..3], [None, None]);
    assert!(reasons[3..6].iter().all(Option::is_some), "{reasons:?}");
    assert!(reasons[5] == Some(Invalid::TooLong) && reasons[6..].iter().all(Option::is_none), "{reasons:?}");
    // The other antennas have never seen it.
    assert_eq!(frame(&mut frames, 9).tag(0)[1..], [Err(Invalid::NeverSeen); 3]);
}

#[test]
fn a_tag_that_rests_is_followed_over_gaps_in_which_others_of_its_antennas_look() {
    // Two reads by each of four antennas in turn: 140 ms without a read by the same.
    let mut frames = PhaseFrames::new(Settings::default());
    let all: Vec<_> = (0..150_u64)
        .map(|n| {
            let antenna = n / 2 % 4;
            read(n * 20_000, 1, antenna as u16 + 1, 1, antenna as f64)
        })
        .collect();
    push_all(&mut frames, &all);
    for number in 0..28 {
        let frame = frame(&mut frames, number);
        if number > 10 {
            let still = |cell: &Result<f32, Invalid>| cell.is_ok_and(|turned| turned.abs() < 0.6);
            assert!(frame.tag(0).iter().all(still), "{number}: {frame:?}");
        }
    }
}

#[test]
fn reads_that_cannot_be_are_left_out_and_counted() {
    let listed = [epc(1)];
    let mut frames = PhaseFrames::with_calibration(Settings::default(), &listed, &Calibration::default());
    let sent = BridgeTime(10_000_000);
    frames.push(&read(9_990_000, 1, 1, 1, 0.0), sent);
    frames.push(&read(15_000_000, 1, 1, 1, 0.0), sent);
    frames.push(&read(5_000_000, 1, 1, 1, 0.0), sent);
    frames.push(&read(9_991_000, 2, 1, 1, 0.0), sent);
    frames.push(&read(9_992_000, 1, 9, 1, 0.0), sent);
    frames.push(&TagRead { phase: None, ..read(9_993_000, 1, 1, 1, 0.0) }, sent);
    let frame = frames.frame(BridgeTime(9_950_000), BridgeTime(10_050_000));
    assert_eq!(frame.tag(0)[0], Err(Invalid::ClockJump));
    assert_eq!((frame.tags(), frame.antennas()), (1, 4));
    let expected = Dropped {
        from_the_future: 1,
        long_past: 1,
        late: 0,
        without_phase: 1,
        other_tags: 1,
        other_antennas: 1,
    };
    assert_eq!(frames.dropped(), expected);
}

#[test]
fn packets_out_of_order_change_nothing() {
    let phase = |s: f64| 8.0 * s * s;
    let all = reads(0, 1_000_000, phase);
    let (mut straight, mut mixed) =
        (PhaseFrames::new(Settings::default()), PhaseFrames::new(Settings::default()));
    push_all(&mut straight, &all);
    for pair in all.chunks(2) {
        pair.iter().rev().for_each(|read| mixed.push(read, read.time));
    }
    for number in 0..9 {
        assert_eq!(frame(&mut straight, number), frame(&mut mixed, number), "{number}");
    }
    assert_eq!(mixed.dropped(), Dropped::default());
}

#[test]
fn more_tags_than_fit_are_counted() {
    let mut frames = PhaseFrames::new(Settings::default());
    for tag in 0..MAX_TAGS as u8 + 3 {
        let read = read(1_000_000 + u64::from(tag), tag, 1, 1, 0.0);
        frames.push(&read, read.time);
    }
    assert_eq!(frame(&mut frames, 10).tags(), MAX_TAGS);
    assert_eq!((frames.epcs().len(), frames.dropped().other_tags), (MAX_TAGS, 3));
}

#[test]
fn reads_tell_how_many_how_strong_and_how_far_however_fast_the_tag_is() {
    // Read each 70 ms at 2 m/s: 5.3 rad, which no guard lets through.
    let rate = 2.0 * 4.0 * PI / 0.332;
    let phase = |s: f64| if s < 1.0 { 0.0 } else { rate * (s - 1.0) };
    let mut frames = PhaseFrames::new(Settings::default());
    let times: Vec<u64> = (0..30).map(|n| n * 70_000).collect();
    let all: Vec<_> = times.iter().map(|&us| read(us, 1, 1, 1, phase(us as f64 * 1e-6))).collect();
    push_all(&mut frames, &all);
    for number in 1..20 {
        let frame = frame(&mut frames, number);
        let sighting = frame.sightings()[0];
        let (begin, end) = (number * FRAME_US, (number + 1) * FRAME_US);
        let within = times.iter().filter(|&&us| us > begin && us <= end);
        assert_eq!((sighting.reads, sighting.rssi_dbm), (within.count() as u32, Some(-45.0)));
        let last = |until: u64| *times.iter().rfind(|&&us| us <= until).unwrap() as f64 * 1e-6;
        let turned = circular::wrap(phase(last(end)) - phase(last(begin)));
        let off = circular::wrap(f64::from(sighting.turn.unwrap()) - turned);
        assert!(off.abs() < 2e-3, "{number}: {off}");
        assert_eq!(frame.sightings()[1..], [Sighting::default(); 3], "nobody else has read it");
    }
    let moving = frame(&mut frames, 20).tag(0)[0];
    assert!(moving.is_err(), "{moving:?}");
}

#[test]
fn turns_compare_what_compares() {
    // Each channel has an offset of its own, which is not known at first.
    let hopping = |from: u64, until: u64| {
        let times = (from..until).step_by(40_000);
        times.map(|us| {
            let channel = us / 200_000 % 2 + 1;
            read(us, 1, 1, channel as u16, 1.3 * channel as f64)
        })
    };
    let mut frames = PhaseFrames::new(Settings::default());
    let mut turn = |number: u64| {
        push_all(&mut frames, &hopping(number * FRAME_US, (number + 1) * FRAME_US).collect::<Vec<_>>());
        frame(&mut frames, number).sightings()[0].turn
    };
    let turns: Vec<_> = (0..30).map(&mut turn).collect();
    assert!(turns.iter().all(|turn| turn.is_some_and(|turn| turn.abs() < 0.05)), "{turns:?}");
    // A clock that was set back.
    push_all(&mut frames, &hopping(500_000, 520_000).collect::<Vec<_>>());
    let sighting = frames.frame(BridgeTime(490_000), BridgeTime(590_000)).sightings()[0];
    assert_eq!((sighting.reads, sighting.turn), (1, None));
}
