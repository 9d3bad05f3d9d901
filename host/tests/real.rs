//! Experiments on recordings of real devices, on a few that are made up here: none says anything of accuracy.
#![cfg(feature = "train")]

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use ndarray::Array3;
use rfhoi::real::radar::{self, Recordings};
use rfhoi::real::reads;
use rfhoi_network::sample::{READ_CHANNELS, read};
use serde_json::Value;

#[path = "made_up/kinect.rs"]
mod kinect;

/// A clip of six frames of which the fourth and fifth are labelled, with one cell that rests and two that do not; made with h5py.
const CLIP: &[u8] = include_bytes!("data/clip.h5");

fn rfhoi(words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rfhoi")).args(words).output().expect("it runs")
}

/// What the experiment leaves after one epoch.
fn real_radar(folder: &Path) -> Value {
    let out = folder.join("out");
    let words = ["experiment", "real-radar", "--epochs", "1", "--json", "--data"];
    let run = rfhoi(&[&words[..], &[folder.to_str().unwrap(), "--out", out.to_str().unwrap()]].concat());
    assert!(run.status.success(), "{run:?}");
    serde_json::from_slice(&std::fs::read(out.join("results.json")).unwrap()).unwrap()
}

/// Samples of the RDA form: in activity 1 the second tag is far, and is turned from read to read.
fn write_reads(folder: &Path) {
    for person in 0..4 {
        std::fs::create_dir_all(folder.join(format!("{person:04}"))).unwrap();
        for sample in 0..6 {
            let activity = sample % 2;
            let mut text = String::new();
            for n in 0..20 {
                let us = 1_655_900_275_000_000_u64 + n * 50_000 + person;
                let (tag, turned) =
                    (n % 2, if activity == n % 2 && activity == 1 { n as f32 * 0.2 } else { 1.0 });
                let dbm = if activity == 1 && tag == 1 { -70.0 } else { -55.0 };
                writeln!(text, "{person:04} {tag:04} {us} 1.5 {dbm} {turned} {activity}").unwrap();
            }
            std::fs::write(folder.join(format!("{person:04}/{sample}_{activity}.txt")), text).unwrap();
        }
    }
}

#[test]
fn reads_become_frames_of_all_tags() {
    let folder = tempfile::tempdir().unwrap();
    write_reads(folder.path());
    let real = reads::load(folder.path(), &mut |_| true).unwrap();
    assert_eq!((real.samples.len(), real.names.len()), (24, 2));
    assert_eq!((&real.classes[..], real.people[23]), (&["0".to_owned(), "1".to_owned()][..], 3));
    let (learn, test) = real.without(&[3]);
    assert_eq!((learn.len(), test.len()), (18, 6));
    let sample = &real.samples[1];
    assert_eq!((sample.action, sample.target, sample.frames.tags), (Some(1), None, 2));
    // 20 reads 50 ms apart: each tag is read once in each of ten frames.
    assert_eq!(sample.frames.len(), 10);
    let second = &sample.frames.frame(4).reads[READ_CHANNELS..];
    assert_eq!(second[read::READS], 0.25);
    assert!((second[read::RSSI] + 0.5).abs() < 1e-6, "5 dB less than usual: {second:?}");
    // From one of its reads to the next it turns by 0.4 rad.
    assert!((second[read::TURN].atan2(second[read::TURN + 1]) - 0.4).abs() < 0.01, "{second:?}");
}

#[test]
fn real_reads_are_learnt_and_tested_by_person() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("data"), folder.path().join("out"));
    write_reads(&data);
    let (data, out) = (data.to_str().unwrap(), out.to_str().unwrap());
    let words =
        ["experiment", "real-reads", "--data", data, "--test", "3", "--out", out, "--epochs", "1", "--json"];
    let run = rfhoi(&words);
    assert!(run.status.success(), "{run:?}");
    let result: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(result["simulated"], false);
    assert_eq!(
        (&result["trials"][0]["learnt"], &result["trials"][0]["right"]["of"]),
        (&18.into(), &6.into())
    );
    assert!(Path::new(out).join("people-3/model.safetensors").is_file());
    let nobody = rfhoi(&["experiment", "real-reads", "--data", data, "--test", "9", "--out", out]);
    assert_eq!(nobody.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&nobody.stderr).contains("there is nobody with number 9"));
}

#[test]
fn each_person_of_a_radar_set_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let mut index = "row,class,person,number\n".to_owned();
    for row in 0..4 {
        writeln!(index, "{row},{},{},1", ["fall", "wave"][row % 2], ["A", "B"][row / 2]).unwrap();
    }
    std::fs::write(folder.path().join("index.csv"), index).unwrap();
    let values =
        Array3::<u8>::from_shape_fn(
            (4, 128, 156),
            |(row, doppler, _)| {
                if doppler == 30 + 40 * (row % 2) { 200 } else { 0 }
            },
        );
    ndarray_npy::write_npy(folder.path().join("doppler_u8_128x156.npy"), &values).unwrap();
    let result = real_radar(folder.path());
    let trials = result["trials"].as_array().unwrap();
    assert_eq!(trials.len(), 2);
    assert!(trials.iter().all(|trial| trial["learnt"] == 2 && trial["right"]["of"] == 2));
}

#[test]
fn clips_are_read_and_their_three_tasks_done() {
    let folder = tempfile::tempdir().unwrap();
    let mut index = "file,class,recorded,label_first,label_last\n".to_owned();
    for number in 0..12 {
        let class = ["fist", "left", "background"][number % 3];
        let name = format!("{class}_{number}.h5");
        writeln!(index, "{name},{class},2024-07-28T12:{number:02}:00,3,4").unwrap();
        std::fs::write(folder.path().join(name), CLIP).unwrap();
    }
    std::fs::write(folder.path().join("index.csv"), index).unwrap();
    let Recordings::Heatmaps(clips) = radar::load(folder.path(), &mut |_| true).unwrap() else {
        panic!("they are clips")
    };
    assert_eq!((clips.len(), clips[0].len(), clips[0].gesture()), (12, 6, Some(3..5)));
    // 60 more than before are 5.93 octaves of 1 + 60; what rests is gone.
    let maps = clips[0].without_rest(3..5, 0..3);
    let map = &maps.frame(0).maps[32 * 32..2 * 32 * 32];
    assert_eq!((map[20 * 32 + 10], map[16 * 32 + 8]), (128 + 83, 128));
    let result = real_radar(folder.path());
    assert_eq!(result["tasks"]["gestures"]["reached"]["right"]["of"], 2);
    assert_eq!(result["tasks"]["placebo"]["most_frequent"], 0.5);
    assert!(
        result["tasks"]["frames"]["area_under_curve"]
            .as_f64()
            .is_some_and(|area| (0.0..=1.0).contains(&area))
    );
    std::fs::write(folder.path().join("left_1.h5"), &CLIP[..CLIP.len() / 2]).unwrap();
    let cut = rfhoi(&["experiment", "real-radar", "--data", folder.path().to_str().unwrap(), "--out", "out"]);
    assert_eq!(cut.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&cut.stderr).contains("left_1.h5"), "{cut:?}");
}

/// A folder of one made-up motion, whose table lists what is known, what is not, and what is too short.
fn write_motions(folder: &Path) {
    std::fs::create_dir_all(folder.join("kinect")).unwrap();
    std::fs::write(folder.join("kinect/joints_a_1.txt"), kinect::lines()).unwrap();
    let mut table = "file\taction\tstart\tend\n".to_owned();
    let (sits, picks) = (kinect::SITS, kinect::PICKS);
    let rows = [
        ("sit_down", sits.clone()),
        ("wave", sits),
        ("pick_up", picks.clone()),
        ("push (no object; proxy for close)", picks),
        ("put_down", 0..=4),
    ];
    for (action, frames) in rows {
        writeln!(table, "made/joints_a_1.txt\t{action}\t{}\t{}", frames.start(), frames.end()).unwrap();
    }
    std::fs::write(folder.join("ACTION_INDEX.tsv"), table).unwrap();
}

#[test]
fn recorded_motion_stands_beside_generated_motion() {
    let folder = tempfile::tempdir().unwrap();
    let motions = folder.path().join("motions");
    write_motions(&motions);
    let run = |name: &str, words: &[&str]| {
        let out = folder.path().join(name);
        let (motions, to) = (motions.to_str().unwrap(), out.to_str().unwrap());
        let all = ["experiment", "real-motion", "--motions", motions, "--out", to, "--setups", "2"];
        let run = rfhoi(&[&all[..], words].concat());
        assert!(run.status.success(), "{run:?}");
        ["real-motion.json", "real-motion.txt"].map(|file| std::fs::read_to_string(out.join(file)).unwrap())
    };
    let [json, text] = run("first", &[]);
    assert_eq!(run("again", &["--workers", "1"]), [json.clone(), text.clone()]);
    let result: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(result["simulated"], "radar and reader; motion recorded");
    assert_eq!((&result["motions"][0]["person"], &result["setups"]), (&"kinect/a".into(), &2.into()));
    let left_out = result["left_out"].as_array().unwrap();
    assert!(left_out.len() == 1 && left_out[0]["why"].as_str().unwrap().contains("3 frames"), "{left_out:?}");
    let rows = result["actions"].as_array().unwrap();
    let done: Vec<&str> = rows.iter().map(|row| row["action"].as_str().unwrap()).collect();
    assert_eq!(done, ["sit down", "pick up", "all"]);
    for row in rows.iter().chain(result["people"].as_array().unwrap()) {
        let pairs = if row["action"] == "all" { 4 } else { 2 };
        for kind in ["recorded", "generated"] {
            let said = row[kind]["said"].as_array().unwrap();
            assert_eq!(said.iter().filter_map(Value::as_u64).sum::<u64>(), pairs);
            assert_eq!(
                (&row[kind]["tuple"]["of"], &row[kind]["object"]["of"]),
                (&pairs.into(), &pairs.into())
            );
        }
        assert_eq!(row["pairs"].as_array().unwrap().iter().filter_map(Value::as_u64).sum::<u64>(), pairs);
    }
    // The made-up thing lies near the floor, generated ones on a table.
    let lies_m = |kind: &str| rows[1][kind]["medians"]["lies_m"].as_f64().unwrap();
    assert!(lies_m("recorded") < 0.6 && lies_m("generated") > 0.7, "{}", rows[1]);
    assert_eq!(result["samples"].as_array().unwrap().len(), 8);
    assert!(
        text.contains("sit down   recorded         2") && text.contains("left out: joints_a_1.txt"),
        "{text}"
    );
}

#[test]
fn motions_that_are_not_there_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let (motions, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    let fails = || {
        let words = ["experiment", "real-motion", "--motions", motions, "--out", out.to_str().unwrap()];
        let run = rfhoi(&words);
        assert_eq!(run.status.code(), Some(1));
        assert!(!out.exists());
        String::from_utf8_lossy(&run.stderr).into_owned()
    };
    let error = fails();
    assert!(error.contains("holds no ACTION_INDEX.tsv"), "{error}");
    write_motions(folder.path());
    std::fs::remove_file(folder.path().join("kinect/joints_a_1.txt")).unwrap();
    let error = fails();
    assert!(error.contains("lists joints_a_1.txt, which is neither"), "{error}");
    std::fs::write(folder.path().join("ACTION_INDEX.tsv"), "file\taction\tstart\tend\na.txt\twave\t1\t9\n")
        .unwrap();
    let error = fails();
    assert!(error.contains("lists none of sit_down"), "{error}");
}
