//! The shipped recording of a simulated evening, packet by packet, by the models that are built in: what the README shows.

use std::num::NonZeroUsize;
use std::path::Path;

use expect_test::expect;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi::profile;
use rfhoi::recognize::model::{built_in, names};
use rfhoi::recognize::tags::TagNames;
use rfhoi::recognize::{Outcome, Recognition, Recognizer, Settings, Why};
use rfhoi::replay::packets;
use rfhoi_firmware::mmwave::cfg::Board;
use rfhoi_network::model::Precision;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::wire::{MAX_PACKET, Message, Packet};

/// What becomes of a packet; `None` is lost.
type Change<'a> = &'a mut dyn FnMut(&[u8]) -> Option<Vec<u8>>;

/// The evening as it was recorded.
fn recognised(precision: Precision) -> Vec<Recognition> {
    changed(precision, &mut |packet| Some(packet.to_vec()))
}

fn changed(precision: Precision, change: Change<'_>) -> Vec<Recognition> {
    let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/evening.pcap.gz");
    let beside = recording.with_file_name("evening.cfg");
    let board = Board { array: RadarProfile::bridge().array, mounting: RadarProfile::bridge().mounting };
    let profile = profile::load(&beside.to_string_lossy(), board).unwrap();
    let settings = Settings {
        profile: Some(profile),
        tags: TagNames::simulated(),
        least: None,
        threads: NonZeroUsize::MIN,
    };
    let mut recognizer = Recognizer::new(&built_in(precision).unwrap(), &names().unwrap(), settings).unwrap();
    let mut all = Vec::new();
    let radar = recognizer.radar().clone();
    let mut push = |_, packet: &[u8]| {
        let Some(packet) = change(packet) else { return };
        recognizer.push(&packet).unwrap();
        all.extend(std::iter::from_fn(|| recognizer.next()));
    };
    packets(&recording, Some(&radar), &mut push, &mut |_| true).unwrap();
    recognizer.finish().unwrap();
    all.extend(std::iter::from_fn(|| recognizer.next()));
    all
}

fn line(recognition: &Recognition) -> String {
    let what = match &recognition.outcome {
        Outcome::Tuple(guess) => format!("<{}, {}>", guess.action, guess.object.as_deref().unwrap_or("?")),
        Outcome::Nothing { .. } => "nothing".to_owned(),
        Outcome::CannotTell { .. } => "cannot tell".to_owned(),
    };
    format!("{:.1} {:.1} {what}\n", recognition.begin_s, recognition.end_s)
}

#[test]
fn an_evening_is_told_as_the_readme_says() {
    let told: String = recognised(Precision::Int8).iter().map(line).collect();
    // Simulated: 11.8 to 15.3 s pick up book, about 19 s nothing, 23.5 to 27.1 s put down book, 30.3 to 32.9 s sit down chair.
    expect![[r#"
        11.6 15.5 <pick up, book>
        18.2 20.5 nothing
        23.4 27.5 <put down, book>
        30.3 33.1 <sit down, chair>
    "#]]
    .assert_eq(&told);
}

#[test]
fn f32_sees_the_same_segments_and_says_about_the_same() {
    let (int8, f32) = (recognised(Precision::Int8), recognised(Precision::F32));
    let probability = |recognition: &Recognition| match &recognition.outcome {
        Outcome::Tuple(guess) => guess.p,
        Outcome::Nothing { p } => *p,
        Outcome::CannotTell { guess, .. } => guess.as_ref().map_or(0.0, |guess| guess.p),
    };
    assert_eq!(int8.len(), f32.len());
    for (int8, f32) in int8.iter().zip(&f32) {
        assert_eq!((int8.begin_s, int8.end_s), (f32.begin_s, f32.end_s));
        assert!((probability(int8) - probability(f32)).abs() < 0.15, "{int8:?} {f32:?}");
    }
}

/// What was done, and from when to when, s; simulated.
const DONE: [(f64, f64, &str); 3] =
    [(11.8, 15.3, "<pick up, book>"), (23.5, 27.1, "<put down, book>"), (30.3, 32.9, "<sit down, chair>")];

/// How many of what was done are told.
fn right(all: &[Recognition]) -> usize {
    let told = |&&(begin, end, what): &&(f64, f64, &str)| {
        all.iter().any(|recognition| {
            (recognition.begin_s..recognition.end_s).contains(&(0.5 * (begin + end)))
                && line(recognition).trim_end().ends_with(what)
        })
    };
    DONE.iter().filter(told).count()
}

/// The evening with a share of its packets lost.
fn lossy(share: f64, seed: u64) -> Vec<Recognition> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    changed(Precision::Int8, &mut |packet| (!rng.random_bool(share)).then(|| packet.to_vec()))
}

#[test]
fn with_a_tenth_of_the_packets_lost_it_still_tells() {
    (0..3).for_each(|seed| assert!(right(&lossy(0.1, seed)) > 0, "{seed}"));
}

#[test]
fn with_a_fifth_of_the_packets_lost_it_says_that_maps_have_holes() {
    for recognition in (0..3).flat_map(|seed| lossy(0.2, seed)) {
        let holes = |why: &Why| matches!(why, Why::MapsInvalid { reason: "rows_missing", .. });
        assert!(
            matches!(&recognition.outcome, Outcome::CannotTell { why, .. } if holes(why)),
            "{recognition:?}"
        );
    }
}

#[test]
fn with_an_antenna_dead_it_still_tells() {
    for dead in 1..=4 {
        let silenced = changed(Precision::Int8, &mut |bytes| {
            let mut packet = Packet::decode(bytes).unwrap();
            if let Message::Tags(reads) = &mut packet.message {
                reads.retain(|read| read.antenna.0 != dead);
            }
            let mut buffer = [0; MAX_PACKET];
            Some(packet.encode(&mut buffer).unwrap().to_vec())
        });
        assert!(right(&silenced) > 0, "{dead}: {silenced:?}");
    }
}
