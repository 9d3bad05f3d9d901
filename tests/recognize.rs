//! The shipped recording of a simulated evening, packet by packet, by the models that are built in: what the README shows.

use std::path::Path;

use expect_test::expect;
use rfhoi::profile;
use rfhoi::recognize::model::{built_in, names};
use rfhoi::recognize::tags::TagNames;
use rfhoi::recognize::{Outcome, Recognition, Recognizer, Settings};
use rfhoi::replay::packets;
use rfhoi_firmware::mmwave::cfg::Board;
use rfhoi_network::model::Precision;
use rfhoi_shared::radar::RadarProfile;

fn recognised(precision: Precision) -> Vec<Recognition> {
    let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/evening.pcap.gz");
    let beside = recording.with_file_name("evening.cfg");
    let board = Board { array: RadarProfile::bridge().array, mounting: RadarProfile::bridge().mounting };
    let profile = profile::load(&beside.to_string_lossy(), board).unwrap();
    let settings = Settings { profile: Some(profile), tags: TagNames::simulated(), least: None };
    let mut recognizer = Recognizer::new(&built_in(precision).unwrap(), &names().unwrap(), settings).unwrap();
    let mut all = Vec::new();
    let radar = recognizer.radar().clone();
    let mut push = |_, packet: &[u8]| {
        recognizer.push(packet).unwrap();
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
    // Simulated: 11.4 to 15.5 s pick up book, about 21 s nothing, 24.1 to 27.3 s put down book, 30.2 to 33.1 s sit down chair.
    expect![[r#"
        11.4 15.4 <pick up, book>
        18.6 21.8 <pick up, bottle>
        24.2 27.4 <put down, book>
        29.9 33.0 cannot tell
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
