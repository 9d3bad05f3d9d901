use std::collections::BTreeSet;
use std::io::Cursor;

use ndarray::{Array1, Array2, Array3};
use ndarray_npy::NpzReader;
use rfhoi_shared::radar::RadarProfile;

use super::*;
use crate::hoi::CATEGORIES;
use crate::simulate::circumstance::Circumstance;
use crate::simulate::effects::Domain;

/// A room whose maps are made fast.
fn scenes() -> Vec<Scene> {
    let profile = RadarProfile { loops: 16, frame_period_us: 500_000, ..RadarProfile::bridge() };
    vec![Scene::named("open-room").unwrap().with_profile(&profile).unwrap()]
}

fn options(scenes: &[Scene], samples: u32) -> Options<'_> {
    let wanted = Wanted {
        domain: Domain::Train,
        seed: 5,
        samples,
        categories: &CATEGORIES,
        nothing: 0.1,
        expand: false,
        setups: None,
        circumstance: None,
    };
    Options { wanted, effects: Effects::of(Domain::Train), scenes, workers: 2 }
}

fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let mut files: Vec<_> = entries
        .map(|p| (p.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(p).unwrap()))
        .collect();
    files.sort();
    files
}

#[test]
fn the_same_options_give_the_same_bytes_with_any_number_of_workers() {
    let (scenes, folder) = (scenes(), tempfile::tempdir().unwrap());
    let make = |name: &str, options: Options<'_>| {
        let path = folder.path().join(name);
        write(&path, &options, &mut |_| true).unwrap();
        files(&path)
    };
    let first = make("a", options(&scenes, 40));
    let names: Vec<&str> = first.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, [MANIFEST, PROFILE, "shard-00000.npz", "shard-00001.npz"]);
    assert!(first == make("b", Options { workers: 1, ..options(&scenes, 40) }));
    let mut other = options(&scenes, 40);
    other.wanted.seed = 6;
    assert!(first != make("c", other));
}

#[test]
fn a_set_that_was_stopped_goes_on_where_it_stood() {
    let (scenes, folder) = (scenes(), tempfile::tempdir().unwrap());
    let (whole, parts) = (folder.path().join("whole"), folder.path().join("parts"));
    let options = Options { workers: 1, ..options(&scenes, 70) };
    write(&whole, &options, &mut |_| true).unwrap();
    // Stopped as soon as a shard is there.
    let stopped = write(&parts, &options, &mut |_| !parts.join(shard_name(0)).is_file());
    assert!(matches!(stopped, Err(SetError::Interrupted)));
    let manifest: Value = serde_json::from_slice(&std::fs::read(parts.join(MANIFEST)).unwrap()).unwrap();
    assert_eq!(manifest["complete"], false);
    let kept = std::fs::metadata(parts.join(shard_name(0))).unwrap().modified().unwrap();
    let summary = write(&parts, &options, &mut |_| true).unwrap();
    assert!(summary.shards_kept >= 1 && summary.shards == 3);
    assert_eq!(std::fs::metadata(parts.join(shard_name(0))).unwrap().modified().unwrap(), kept);
    assert!(files(&whole) == files(&parts));
}

#[test]
fn another_set_is_not_overwritten() {
    let (scenes, folder) = (scenes(), tempfile::tempdir().unwrap());
    write(folder.path(), &options(&scenes, 2), &mut |_| true).unwrap();
    let mut other = options(&scenes, 2);
    other.wanted.seed = 6;
    let sentence = write(folder.path(), &other, &mut |_| true).unwrap_err().to_string();
    assert!(sentence.contains("its seed is 5, not 6"), "{sentence}");
    std::fs::write(folder.path().join(MANIFEST), "{").unwrap();
    let sentence = write(folder.path(), &other, &mut |_| true).unwrap_err().to_string();
    assert!(sentence.contains("is no manifest"), "{sentence}");
}

#[test]
fn the_manifest_says_what_made_it_harder_and_sets_are_not_mixed() {
    let (scenes, folder) = (scenes(), tempfile::tempdir().unwrap());
    let plain = options(&scenes, 2);
    let mut harder = plain;
    harder.wanted.circumstance = Some(Circumstance::SecondPerson);
    let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
    write(&a, &plain, &mut |_| true).unwrap();
    write(&b, &harder, &mut |_| true).unwrap();
    let manifest = |folder: &Path| -> Value {
        serde_json::from_slice(&std::fs::read(folder.join(MANIFEST)).unwrap()).unwrap()
    };
    let (without, mut with) = (manifest(&a), manifest(&b));
    assert_eq!(with["circumstance"], "second-person");
    with.as_object_mut().unwrap().remove("circumstance");
    assert_eq!(without, with, "all else is the same, and says nothing of it");
    let shards = [&a, &b].map(|folder| std::fs::read(folder.join(shard_name(0))).unwrap());
    assert!(shards[0] != shards[1]);
    for (folder, other, sentence) in [
        (&a, &harder, "is missing, not \"second-person\""),
        (&b, &plain, "is \"second-person\", not missing"),
    ] {
        let refused = write(folder, other, &mut |_| true).unwrap_err().to_string();
        assert!(refused.contains(&format!("its circumstance {sentence}")), "{refused}");
    }
}

#[test]
fn maps_of_different_shapes_make_no_set() {
    let kitchen = Scene::named("kitchen").unwrap();
    let coarse = RadarProfile { loops: 16, ..RadarProfile::bridge() };
    let scenes = [kitchen.clone(), kitchen.with_profile(&coarse).unwrap()];
    let folder = tempfile::tempdir().unwrap();
    let refused = write(folder.path(), &options(&scenes, 2), &mut |_| true);
    assert!(matches!(refused, Err(SetError::Shapes(..))));
}

#[test]
fn shards_hold_what_the_table_says() {
    let (scenes, folder) = (scenes(), tempfile::tempdir().unwrap());
    let samples = 20;
    write(folder.path(), &options(&scenes, samples), &mut |_| true).unwrap();
    let draws = draw(&options(&scenes, samples).wanted, &scenes);
    let bytes = std::fs::read(folder.path().join(shard_name(0))).unwrap();
    let mut npz = NpzReader::new(Cursor::new(&bytes)).unwrap();
    let listed: BTreeSet<String> =
        npz.names().unwrap().into_iter().map(|n| n.trim_end_matches(".npy").to_owned()).collect();
    let page = include_str!("../set.rs");
    let table: BTreeSet<String> = page
        .lines()
        .filter(|l| l.starts_with("//! | `"))
        .flat_map(|l| l.split('|').nth(1).unwrap_or_default().split(',').map(|n| n.trim().replace('`', "")))
        .collect();
    assert_eq!(listed, table, "arrays and the table of the module's page");

    let first: Array1<u32> = npz.by_name("frame_first").unwrap();
    let durations: Array1<f32> = npz.by_name("duration_s").unwrap();
    let lengths: Vec<u32> = first.windows(2).into_iter().map(|w| w[1] - w[0]).collect();
    for (frames, duration) in lengths.iter().zip(&durations) {
        assert_eq!(*frames, (duration / 0.5).ceil() as u32);
    }
    let frames = *first.last().unwrap() as usize;
    let range_doppler: Array3<u8> = npz.by_name("range_doppler").unwrap();
    assert_eq!(range_doppler.dim(), (frames, 72, 16));
    let covariance: Array2<f32> = npz.by_name("covariance").unwrap();
    assert_eq!(covariance.dim(), (frames, 144));
    let (action, target): (Array1<i8>, Array1<i8>) =
        (npz.by_name("action").unwrap(), npz.by_name("target").unwrap());
    for (i, d) in draws.iter().enumerate() {
        assert_eq!(usize::try_from(action[i]).ok(), d.label.map(|l| l.action.index()));
        assert_eq!(usize::try_from(target[i]).ok(), d.target);
    }
    assert!(action.iter().filter(|a| **a < 0).count() == 2, "a tenth is no interaction");

    let read_first: Array1<u32> = npz.by_name("read_first").unwrap();
    let time: Array1<i32> = npz.by_name("read_time_us").unwrap();
    let tag: Array1<u8> = npz.by_name("read_tag").unwrap();
    assert!(tag.iter().all(|t| usize::from(*t) < SAMPLE_TAGS));
    for (i, w) in read_first.windows(2).into_iter().enumerate() {
        let of_sample = &time.as_slice().unwrap()[w[0] as usize..w[1] as usize];
        assert!(of_sample.is_sorted());
        let (begin, end) = (of_sample[0], of_sample[of_sample.len() - 1]);
        assert!((-1_000_000..-900_000).contains(&begin), "the lead-in: {begin}");
        assert!(end as f32 * 1e-6 < durations[i] && end as f32 * 1e-6 > durations[i] - 0.3);
    }
}
