use std::time::SystemTime;

use rfhoi_network::sample::{READ_CHANNELS, SCALARS, read, scalar};

use super::*;
use crate::features::{AngleMap, of_sample};
use crate::hoi::{Action, CATEGORIES, Object};
use crate::simulate::draw::{Wanted, draw};
use crate::simulate::effects::Effects;
use crate::simulate::sample::{Maker, epoch};
use crate::simulate::scene::Scene;
use crate::simulate::set as simulated;

const SAMPLES: u32 = 40;
const SETTINGS: Settings =
    Settings { points: 16, angles: AngleMap::Bartlett, antennas: 3, covariance: false };

/// A profile whose maps are made fast.
fn profile() -> RadarProfile {
    RadarProfile { loops: 16, frame_period_us: 250_000, ..RadarProfile::bridge() }
}

fn options(settings: Settings) -> Options {
    Options { settings, profile: Some(profile()), workers: 2 }
}

/// A simulated set in `folder`.
fn make(folder: &Path, domain: Domain, samples: u32, go_on: bool) -> Vec<crate::simulate::draw::Draw> {
    let scenes = [Scene::named("open-room").unwrap().with_profile(&profile()).unwrap()];
    let wanted = Wanted {
        domain,
        seed: 5,
        samples,
        categories: &CATEGORIES,
        nothing: 0.1,
        expand: false,
        setups: None,
        circumstance: None,
    };
    let options = simulated::Options { wanted, effects: Effects::of(domain), scenes: &scenes, workers: 2 };
    let made = simulated::write(folder, &options, &mut |_| go_on);
    assert_eq!(made.is_ok(), go_on);
    draw(&wanted, &scenes)
}

fn kept(folder: &Path, shard: u32) -> PathBuf {
    folder.join("features-16-bartlett-3").join(shard_name(shard))
}

fn modified(path: &Path) -> SystemTime {
    std::fs::metadata(path).unwrap().modified().unwrap()
}

#[test]
fn samples_are_what_was_drawn_and_measured() {
    let folder = tempfile::tempdir().unwrap();
    let draws = make(folder.path(), Domain::Train, SAMPLES, true);
    let mut shares = Vec::new();
    let set = load(folder.path(), &options(SETTINGS), &mut |share| {
        shares.push(share);
        true
    })
    .unwrap();
    assert!(shares.is_sorted() && shares.iter().all(|share| (0.0..=1.0).contains(share)));
    assert_eq!((set.samples.len(), set.setups.len(), set.seed), (SAMPLES as usize, SAMPLES as usize, 5));
    assert_eq!((set.domain, set.profile), (Domain::Train, profile().fingerprint()));
    for ((sample, setup), draw) in set.samples.iter().zip(&set.setups).zip(&draws) {
        let objects: Vec<usize> = draw.objects.iter().map(|object| object.index()).collect();
        assert_eq!((&sample.objects, sample.target), (&objects, draw.target));
        assert_eq!(sample.action, draw.label.map(|label| label.action.index()));
        assert_eq!((setup.person, setup.pose.distance_m), (draw.person, draw.distance_m));
        assert_eq!(setup.interaction_s != [0.0; 2], draw.label.is_some());

        let frames = &sample.frames;
        let count = frames.len();
        assert!((4..40).contains(&count), "{count} frames of 250 ms");
        assert_eq!((frames.points, frames.tags, frames.antennas), (16, 6, 3));
        assert_eq!(frames.maps.len(), count * 3 * 16 * 16);
        assert_eq!(frames.scalars.len(), count * SCALARS);
        assert_eq!(frames.reads.len(), count * 6 * 3 * READ_CHANNELS);
        assert!(frames.covariance.is_empty());
        assert!(frames.scalars.iter().chain(&frames.reads).all(|x| x.is_finite()));
        assert!((0..count).all(|n| frames.frame(n).scalars[scalar::PRESENT] == 1.0));
    }
    assert_eq!(set.actions, Action::ALL.iter().map(|action| action.name()).collect::<Vec<_>>());
    assert_eq!(set.objects, Object::ALL.iter().map(|object| object.name()).collect::<Vec<_>>());

    // Radar and reads are at work.
    let all = || set.samples.iter().flat_map(|s| (0..s.frames.len()).map(|n| s.frames.frame(n)));
    let share = |good: &dyn Fn(&rfhoi_network::sample::Frame<'_>) -> bool| {
        all().filter(|frame| good(frame)).count() as f64 / all().count() as f64
    };
    let moving = share(&|frame| frame.scalars[scalar::VALID + 1] == 1.0 && frame.maps.contains(&255));
    let seen = share(&|frame| frame.reads.iter().skip(read::READS).step_by(READ_CHANNELS).all(|x| *x > 0.0));
    assert!(moving > 0.3 && seen > 0.7, "{moving} {seen}");
}

#[test]
fn a_sample_in_memory_has_the_same_features() {
    let folder = tempfile::tempdir().unwrap();
    let draws = make(folder.path(), Domain::Site, 2, true);
    let set = load(folder.path(), &options(SETTINGS), &mut |_| true).unwrap();
    let scenes = [Scene::named("open-room").unwrap().with_profile(&profile()).unwrap()];
    let effects = Effects::of(Domain::Site);
    let mut maker = Maker::new(Domain::Site, set.seed, effects, &scenes).unwrap();
    let stream = SETTINGS.stream(maker.radar(0)).unwrap();
    for (draw, sample) in draws.iter().zip(&set.samples) {
        let measured = maker.make(draw).unwrap();
        let frames = of_sample(&measured, epoch(&effects), &stream, &SETTINGS).unwrap();
        assert!(frames == sample.frames, "sample {}", draw.sample);
    }
}

#[test]
fn what_is_kept_is_what_was_made() {
    let folder = tempfile::tempdir().unwrap();
    make(folder.path(), Domain::Site, 3, true);
    let options = options(Settings { covariance: true, ..SETTINGS });
    let fresh = load(folder.path(), &options, &mut |_| true).unwrap();
    let again = load(folder.path(), &options, &mut |_| true).unwrap();
    assert_eq!((fresh.shards_kept, again.shards_kept), (0, 1));
    assert_eq!(fresh, SetFeatures { shards_kept: 0, ..again });
    assert_eq!(fresh.samples[0].frames.covariance.len(), fresh.samples[0].frames.len() * 144);
    // Other settings are other features.
    let other = Options { settings: Settings { angles: AngleMap::None, ..SETTINGS }, ..options };
    let other = load(folder.path(), &other, &mut |_| true).unwrap();
    assert_eq!(other.shards_kept, 0);
    assert_ne!(fresh.fingerprint, other.fingerprint);
    let frame = other.samples[0].frames.frame(3);
    assert!(frame.scalars[scalar::VALID + 2] == 0.0 && frame.maps[2 * 16 * 16..].iter().all(|x| *x == 0));
    assert_eq!(frame.maps[..2 * 16 * 16], fresh.samples[0].frames.frame(3).maps[..2 * 16 * 16]);
}

#[test]
fn a_run_that_was_stopped_goes_on_and_damage_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    make(folder.path(), Domain::Train, SAMPLES, true);
    let whole = load(folder.path(), &options(SETTINGS), &mut |_| true).unwrap();
    std::fs::remove_file(kept(folder.path(), 1)).unwrap();
    // One shard is there; the other is not begun.
    let stopped = load(folder.path(), &options(SETTINGS), &mut |_| false);
    assert!(matches!(stopped, Ok(_) | Err(SetError::Interrupted)));
    let before = modified(&kept(folder.path(), 0));
    let again = load(folder.path(), &options(SETTINGS), &mut |_| true).unwrap();
    assert_eq!(modified(&kept(folder.path(), 0)), before);
    assert_eq!(whole.samples, again.samples);

    // A bit in the middle, and a file that was cut.
    let path = kept(folder.path(), 0);
    let bytes = std::fs::read(&path).unwrap();
    let mut damaged = bytes.clone();
    damaged[bytes.len() / 2] ^= 4;
    for damaged in [&damaged[..], &bytes[..bytes.len() / 2], b""] {
        std::fs::write(&path, damaged).unwrap();
        let again = load(folder.path(), &options(SETTINGS), &mut |_| true).unwrap();
        assert_eq!((again.shards_kept, &again.samples), (1, &whole.samples));
        assert!(std::fs::read(&path).unwrap() == bytes, "it is whole again");
    }
}

#[test]
fn what_cannot_be_read_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let sentence = |options: &Options| load(folder.path(), options, &mut |_| true).unwrap_err().to_string();
    assert!(sentence(&options(SETTINGS)).contains("cannot read"));
    make(folder.path(), Domain::Train, 2, false);
    assert!(sentence(&options(SETTINGS)).contains("is not complete"));
    make(folder.path(), Domain::Train, 2, true);
    let unnamed = Options { profile: None, ..options(SETTINGS) };
    // The set says it itself, unless what says it is another's or gone.
    assert!(load(folder.path(), &unnamed, &mut |_| true).is_ok());
    let beside = folder.path().join(simulated::PROFILE);
    let text = std::fs::read_to_string(&beside).unwrap();
    std::fs::write(&beside, text.replace("frameCfg 0 2 16", "frameCfg 0 2 32")).unwrap();
    assert!(sentence(&unnamed).contains("give that with --profile"));
    std::fs::remove_file(&beside).unwrap();
    assert!(sentence(&unnamed).contains("or put it there as profile.cfg"));
    let points = options(Settings { points: 7, ..SETTINGS });
    assert!(sentence(&points).contains("7 points"));
    let manifest = folder.path().join("manifest.json");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(&manifest, text.replace("\"version\": 1", "\"version\": 9")).unwrap();
    assert!(sentence(&options(SETTINGS)).contains("its version is 9, not 1"));
    std::fs::write(&manifest, &text).unwrap();
    // Features that are kept need no shards.
    std::fs::remove_dir_all(kept(folder.path(), 0).parent().unwrap()).unwrap();
    let shard = folder.path().join(shard_name(0));
    let bytes = std::fs::read(&shard).unwrap();
    std::fs::write(&shard, &bytes[..bytes.len() - 100]).unwrap();
    assert!(sentence(&options(SETTINGS)).contains("shard-00000.npz"));
}
