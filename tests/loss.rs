//! A lossy network between recorder and bridge: losses add up exactly, frames with holes are marked, whole frames are
//! those of the clean stream to the last code, and what is left of a frame with holes is sound.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::sync::LazyLock;

use expect_test::expect;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi::receive::RadarFrame;
use rfhoi_firmware::dca1000::Datagram;
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::DCA1000_PAYLOAD;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{DatagramCounts, FrameCounts};
use rfhoi_tests::simulated::network::{Conditions, Network};
use rfhoi_tests::simulated::path::{Outcome, carry, run, strongest};
use rfhoi_tests::simulated::radar::{Measurement, WALL_BIN, configuration};

type Datagrams = Vec<(BridgeTime, Vec<u8>)>;

const FRAMES: u32 = 40;

static MEASUREMENT: LazyLock<Measurement> = LazyLock::new(|| Measurement::hand_before_wall(FRAMES));
static CONFIG: LazyLock<RadarConfig> = LazyLock::new(|| configuration(MEASUREMENT.profile.clone()));
static SENT: LazyLock<Datagrams> = LazyLock::new(|| MEASUREMENT.datagrams().collect());
static CLEAN: LazyLock<Outcome> = LazyLock::new(|| run(&CONFIG, SENT.clone()));

/// What a bridge should count of these datagrams, from their numbers alone: what is ahead is taken and what it skips is
/// lost, what is behind came twice or too late. The recording's last datagram is not full, so what comes after
/// it is at no distance that full ones have, and does not fit.
fn expected_counts(arrivals: &Datagrams) -> DatagramCounts {
    let mut counts = DatagramCounts::default();
    let mut taken = BTreeSet::new();
    let mut ended = false;
    for (_, datagram) in arrivals {
        let Datagram { sequence, payload, .. } = Datagram::decode(datagram).expect("the recorder's own");
        match taken.last() {
            Some(&last) if sequence <= last => {
                let count = match (ended, taken.contains(&sequence)) {
                    (true, _) => &mut counts.malformed,
                    (false, true) => &mut counts.duplicate,
                    (false, false) => &mut counts.late,
                };
                *count += 1;
            }
            last => {
                counts.lost += last.map_or(0, |&last| sequence - last - 1);
                counts.received += 1;
                taken.insert(sequence);
                ended = payload.len() < DCA1000_PAYLOAD as usize;
            }
        }
    }
    counts
}

/// Checks that frames are all there, and those without lost chirps as in the clean run; the numbers of the others.
fn incomplete(outcome: &Outcome) -> Vec<u32> {
    let frames = &outcome.frames;
    assert!(frames.iter().map(|f| f.frame).eq(0..FRAMES), "every frame, in order, under its own number");
    let lost = |f: &RadarFrame| f.info.expect("all packets arrive").chirps_lost;
    for (frame, clean) in frames.iter().zip(&CLEAN.frames).filter(|(frame, _)| lost(frame) == 0) {
        assert!(frame.range_doppler == clean.range_doppler, "range-Doppler map of {}", frame.frame);
        assert!(frame.range_time == clean.range_time, "range-time map of {}", frame.frame);
        assert!(frame.covariance == clean.covariance, "covariance of {}", frame.frame);
    }
    let incomplete: Vec<u32> = frames.iter().filter(|f| lost(f) > 0).map(|f| f.frame).collect();
    let counts = FrameCounts {
        complete: FRAMES - incomplete.len() as u32,
        incomplete: incomplete.len() as u32,
        lost: 0,
    };
    assert_eq!(outcome.frame_counts, counts, "as marked, so counted");
    incomplete
}

/// Strongest level about the wall, dB.
fn wall_db(frame: &RadarFrame) -> f32 {
    let map = frame.range_doppler.as_ref().expect("all packets arrive");
    let rows = WALL_BIN - 2..=WALL_BIN + 2;
    let cells = rows.flat_map(|row| (0..map.columns).map(move |column| map.level_db(row, column)));
    cells.fold(f32::NEG_INFINITY, f32::max)
}

fn lossy(loss: f64, seed: u64) -> (Network, Datagrams, Outcome) {
    let mut network = Network::new(Conditions::losing(loss), seed);
    let arrivals = carry(&mut network, SENT.clone());
    let outcome = run(&CONFIG, arrivals.clone());
    (network, arrivals, outcome)
}

#[test]
fn losses_add_up_and_holes_are_marked() {
    let mut table = String::from("loss % | sent | lost | complete | incomplete | chirps lost\n");
    for percent in [0, 1, 5, 10, 20] {
        let (network, arrivals, outcome) = lossy(f64::from(percent) / 100.0, 11);
        let counts = outcome.datagrams;
        assert_eq!(counts, expected_counts(&arrivals));

        // As lost as dropped, apart from those before the first and after the last that came.
        let number = |(_, bytes): &(_, Vec<u8>)| {
            u64::from(Datagram::decode(bytes).expect("the recorder's own").sequence - 1)
        };
        let (first, last) = (number(&arrivals[0]), number(&arrivals[arrivals.len() - 1]));
        let dropped = network.dropped().iter().filter(|&&n| n > first && n < last).count();
        assert_eq!(counts.lost as usize, dropped);
        assert_eq!(u64::from(counts.received + counts.lost), last - first + 1);

        let incomplete = incomplete(&outcome);
        // A frame has a hole if and only if one of its datagrams was dropped.
        let frame_bytes = u64::from(CONFIG.profile.frame_bytes());
        let touched = network.dropped().iter().flat_map(|n| {
            let start = n * u64::from(DCA1000_PAYLOAD);
            let end = (start + u64::from(DCA1000_PAYLOAD)).min(frame_bytes * u64::from(FRAMES));
            start / frame_bytes..=(end - 1) / frame_bytes
        });
        let touched: BTreeSet<u64> = touched.collect();
        assert!(incomplete.iter().map(|&f| u64::from(f)).eq(touched));

        let chirps_lost: u32 = outcome.frames.iter().filter_map(|f| f.info).map(|i| i.chirps_lost).sum();
        let FrameCounts { complete, incomplete, .. } = outcome.frame_counts;
        let (sent, lost) = (network.sent(), counts.lost);
        writeln!(
            table,
            "{percent:>6} | {sent} | {lost:>4} | {complete:>8} | {incomplete:>10} | {chirps_lost:>11}"
        )
        .expect("a string takes all");
    }
    expect![[r#"
        loss % | sent | lost | complete | incomplete | chirps lost
             0 | 2701 |    0 |       40 |          0 |           0
             1 | 2701 |   25 |       22 |         18 |          42
             5 | 2701 |  130 |        3 |         37 |         203
            10 | 2701 |  260 |        0 |         40 |         406
            20 | 2701 |  548 |        0 |         40 |         804
    "#]]
    .assert_eq(&table);
}

#[test]
fn a_wall_does_not_leak_into_frames_with_holes() {
    let clean_db = CLEAN.frames.iter().map(wall_db).fold(f32::NEG_INFINITY, f32::max);
    for percent in [1, 5, 10, 20] {
        let (_, _, outcome) = lossy(f64::from(percent) / 100.0, 12);
        let worst = outcome.frames.iter().map(wall_db).fold(f32::NEG_INFINITY, f32::max);
        // What is left of the wall is its noise, which is 3 dB stronger after a Doppler FFT of half the chirps. The wall
        // itself is at -10 dB.
        assert!(worst < clean_db + 3.0, "{percent} % lost: {worst} dB, clean {clean_db} dB");
    }
}

#[test]
fn the_hand_stays_in_its_cell() {
    let (_, _, outcome) = lossy(0.2, 13);
    assert!(outcome.frame_counts.incomplete > FRAMES * 9 / 10, "this test is about holes");
    for (frame, clean) in outcome.frames.iter().zip(&CLEAN.frames) {
        let cell = |f: &RadarFrame| strongest(f.range_doppler.as_ref().expect("all packets arrive"));
        let ((row, column, level_db), (clean_row, clean_column, clean_db)) = (cell(frame), cell(clean));
        assert_eq!((row, column), (clean_row, clean_column), "frame {}", frame.frame);
        // The level is normalised by the loops that came. What varies is the mean that clutter removal takes off: the
        // hand cancels over 16 loops, but over the 9 that are left on average up to a third stays: 3.5 dB.
        assert!((level_db - clean_db).abs() < 3.5, "frame {}: {level_db} for {clean_db} dB", frame.frame);
    }
}

#[test]
fn duplicates_change_nothing() {
    let conditions = Conditions { duplicates: 0.1, lateness_us: 500, ..Conditions::default() };
    let mut network = Network::new(conditions, 21);
    let arrivals = carry(&mut network, SENT.clone());
    let duplicates = arrivals.len() - SENT.len();
    assert!(duplicates > 200, "{duplicates}");
    let outcome = run(&CONFIG, arrivals.clone());
    assert_eq!(outcome.datagrams, expected_counts(&arrivals));
    assert_eq!((outcome.datagrams.duplicate + outcome.datagrams.malformed) as usize, duplicates);
    assert!(incomplete(&outcome).is_empty());
}

#[test]
fn late_datagrams_are_dropped_and_nothing_is_shifted() {
    for (seed, lateness_us) in [(31, 150), (32, 500), (33, 2_000)] {
        let conditions = Conditions { late: 0.01, duplicates: 0.01, lateness_us, ..Conditions::default() };
        let mut network = Network::new(conditions, seed);
        let arrivals = carry(&mut network, SENT.clone());
        let outcome = run(&CONFIG, arrivals.clone());
        let counts = outcome.datagrams;
        assert_eq!(counts, expected_counts(&arrivals));
        assert!(counts.late > 5, "{counts:?}");
        assert_eq!(counts.lost, counts.late - late_twice(&arrivals), "what was given up came late");
        assert!(!incomplete(&outcome).is_empty());
    }
}

/// Datagrams that were late both times that they came.
fn late_twice(arrivals: &Datagrams) -> u32 {
    let (mut highest, mut taken, mut late, mut twice) = (0, BTreeSet::new(), BTreeSet::new(), 0);
    for (_, datagram) in arrivals {
        let sequence = Datagram::decode(datagram).expect("the recorder's own").sequence;
        if sequence > highest {
            highest = sequence;
            taken.insert(sequence);
        } else if !taken.contains(&sequence) {
            twice += u32::from(!late.insert(sequence));
        }
    }
    twice
}

/// A second recording that begins when the first was cut after so many datagrams, without its first `missing` ones.
fn restarted(cut: usize, missing: usize) -> (Measurement, Outcome) {
    let second = Measurement { start: SENT[cut].0, seed: 2, frames: 10, ..MEASUREMENT.clone() };
    let arrivals = SENT[..cut].iter().cloned().chain(second.datagrams().skip(missing));
    let outcome = run(&CONFIG, arrivals);
    (second, outcome)
}

#[test]
fn a_restart_within_a_frame_costs_that_frame() {
    // 67.5 datagrams a frame: the fifth is under way.
    let (second, outcome) = restarted(300, 0);
    let alone = run(&CONFIG, second.datagrams());
    assert_eq!(outcome.datagrams.restarts, 1);
    assert_eq!((outcome.datagrams.lost, outcome.datagrams.malformed, outcome.datagrams.late), (0, 0, 0));
    assert_eq!(outcome.frame_counts, FrameCounts { complete: 14, incomplete: 1, lost: 0 });
    assert!(outcome.frames.iter().map(|f| f.frame).eq(0..15), "numbers go on");
    // 300 x 1456 bytes are 213 chirps and a part: 21 of the fifth frame's 48.
    assert_eq!(outcome.frames[4].info.map(|i| i.chirps_lost), Some(27));
    for (frame, alone) in outcome.frames[5..].iter().zip(&alone.frames) {
        assert!(frame.range_doppler == alone.range_doppler && frame.range_time == alone.range_time);
        assert!(frame.info.is_some_and(|i| i.chirps_lost == 0));
    }
}

#[test]
fn a_restart_whose_first_datagram_is_lost_costs_a_frame_more() {
    let (second, outcome) = restarted(300, 1);
    let alone = run(&CONFIG, second.datagrams());
    let counts = outcome.datagrams;
    // Fifteen datagrams are not believed, since any of them may be an old one; with the sixteenth they are a stream.
    assert_eq!((counts.restarts, counts.late, counts.lost), (1, 15, 0));
    assert_eq!(outcome.frame_counts, FrameCounts { complete: 13, incomplete: 2, lost: 0 });
    // 16 x 1456 bytes touch 12 chirps.
    assert_eq!(outcome.frames[5].info.map(|i| i.chirps_lost), Some(12));
    for (frame, alone) in outcome.frames[6..].iter().zip(&alone.frames[1..]) {
        assert!(frame.range_doppler == alone.range_doppler && frame.range_time == alone.range_time);
    }
}

#[test]
fn garbage_on_the_data_port_is_counted_and_changes_nothing() {
    let mut random = ChaCha8Rng::seed_from_u64(41);
    let mut garbage = 0;
    let mut arrivals = Datagrams::new();
    for (time, datagram) in SENT.iter() {
        while random.random_bool(0.1) {
            let mut bytes = vec![0; random.random_range(0..1_600)];
            random.fill_bytes(&mut bytes);
            arrivals.push((*time, bytes));
            garbage += 1;
        }
        arrivals.push((*time, datagram.clone()));
    }
    let outcome = run(&CONFIG, arrivals);
    assert!(garbage > 200);
    let received = SENT.len() as u32;
    assert_eq!(
        outcome.datagrams,
        DatagramCounts { received, malformed: garbage, ..DatagramCounts::default() }
    );
    assert!(incomplete(&outcome).is_empty());
}
