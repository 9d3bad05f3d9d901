//! The command as a user meets it: what it prints, what it says when it fails, and what it leaves behind.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

#[path = "../../tests/recorded.rs"]
mod recorded;
use recorded::recorded;

/// The simulated recording that the project ships.
fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/recordings/pick_up_book.pcap.gz")
}

fn rfhoi(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rfhoi")).args(arguments).output().unwrap()
}

fn json(arguments: &[&str]) -> Value {
    let output = rfhoi(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Runs a command that must fail, and returns its one sentence.
fn refused(arguments: &[&str]) -> String {
    let output = rfhoi(arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments:?} went through");
    assert!(output.stdout.is_empty(), "a failure prints nothing on standard output");
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.starts_with("rfhoi: ") && text.trim_end().lines().count() == 1, "{text}");
    text
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn a_reader_who_has_read_enough_is_no_failure_of_ours() {
    let command = env!("CARGO_BIN_EXE_rfhoi");
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = Command::new(command).args(["plan", "kitchen"]).stdout(writer).output().unwrap();
    assert_eq!(output.status.code(), Some(128 + 13));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn replay_of_the_shipped_recording() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let summary = json(&["replay", text(&shipped()), "--out", text(&out), "--json"]);
    assert_eq!(summary["radar_frames"], 36);
    assert_eq!(summary["frames_complete"], 36);
    assert_eq!(summary["datagrams_lost"], 0);
    assert_eq!(summary["uplink"]["packets_lost"], 0);
    // Somebody about 2 m away reaches for a book.
    let strongest = &summary["strongest_moving"];
    let range = strongest["range_m"].as_f64().unwrap();
    assert!((1.3..2.1).contains(&range), "{range}");
    assert!(strongest["velocity_m_s"].as_f64().unwrap().abs() < 2.5);
    assert_eq!(summary["tag_reads"]["channels"], 50);
    for name in ["range_time.png", "range_doppler.png", "angle.png", "radar.npz", "tags.png", "tags.npz"] {
        assert!(out.join(name).metadata().unwrap().len() > 1000, "{name}");
    }
    let written = summary["outputs"].as_array().unwrap().len();
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), written, "nothing else is left behind");
}

#[test]
fn the_shipped_recording_is_made_by_the_command_that_is_written_in_the_readme() {
    let folder = tempfile::tempdir().unwrap();
    let again = folder.path().join("pick_up_book.pcap.gz");
    let readme = include_str!("../../README.md");
    let line = readme
        .lines()
        .find(|l| l.contains("simulate --recording tests/recordings/pick_up_book"))
        .expect("the README has the command");
    let arguments: Vec<&str> = line.split_whitespace().skip_while(|a| *a != "simulate").collect();
    let arguments: Vec<&str> = arguments
        .iter()
        .map(|a| if a.ends_with("pick_up_book.pcap.gz") { text(&again) } else { a })
        .collect();
    json(&[&arguments[..], &["--json"]].concat());
    assert_eq!(std::fs::read(&again).unwrap(), std::fs::read(shipped()).unwrap());
    let profiles = [again, shipped()].map(|p| std::fs::read(p.with_file_name("pick_up_book.cfg")).unwrap());
    assert_eq!(profiles[0], profiles[1]);
}

#[test]
fn figures_of_the_recorded_uart() {
    let Some(file) = recorded("uart_tlv/AWR1642_test_data_SDK_3_6_0.dat") else { return };
    let found = json(&["inspect", "--json", text(&file)]);
    for (name, value) in [
        ("frames_complete", 100),
        ("frames_truncated", 1),
        ("first_frame", 69),
        ("last_frame", 168),
        ("junk_bytes", 376),
    ] {
        assert_eq!(found[name], value, "{name}");
    }
    assert_eq!(found["frames_missing"], 0);
    assert_eq!(found["tlv_types"], serde_json::json!([1, 7, 2, 6, 9]));
}

#[test]
fn the_logged_table_of_a_uart_holds_what_the_bytes_hold() {
    let name = "uart_tlv/iwr6843aop_static_2024-11-28";
    let (Some(table), Some(bytes)) = (recorded(&format!("{name}.csv")), recorded(&format!("{name}.dat")))
    else {
        return;
    };
    let [mut table, mut bytes] = [table, bytes].map(|file| json(&["inspect", "--json", text(&file)]));
    for found in [&mut table, &mut bytes] {
        let found = found.as_object_mut().unwrap();
        found.remove("file");
        found.remove("format");
    }
    assert_eq!(table, bytes);
    assert!(bytes["frames_complete"].as_u64().unwrap() > 80);
}

#[test]
fn figures_of_the_recorded_samples() {
    let Some(file) = recorded("raw_adc/awr1642_pipe_vibration_1000f_1ms.bin") else { return };
    let profile = recorded("raw_adc/awr1642_pipe_LogFile_0.txt").unwrap();
    let inspect = |more: &[&str]| {
        json(&[&["inspect", "--json", text(&file), "--profile", text(&profile)][..], more].concat())
    };
    let right = inspect(&[]);
    assert_eq!(right["frames_complete"], 1000);
    assert_eq!((right["receivers"].as_u64(), right["samples_per_chirp"].as_u64()), (Some(4), Some(256)));
    assert_eq!(right["iq_order"], "i-first");
    assert_eq!(right["strongest_bin"], 11);
    assert!((right["image_ratio_db"].as_f64().unwrap() - 29.0).abs() < 0.5, "{right}");
    assert!((right["strongest_range_m"].as_f64().unwrap() - 2.15).abs() < 0.01);
    assert_eq!(right["notes"].as_array().unwrap().len(), 0);

    let wrong = inspect(&["--iq", "q-first"]);
    for same in ["iq_order", "strongest_bin", "frames_complete"] {
        assert_eq!(wrong[same], right[same], "{same}");
    }
    let difference = wrong["image_ratio_db"].as_f64().unwrap() - right["image_ratio_db"].as_f64().unwrap();
    assert!(
        difference.abs() < 1e-4,
        "the spectrum is mirrored, so the ratio is the same to rounding: {difference}"
    );
    assert!(wrong["notes"][0].as_str().unwrap().contains("the samples are i-first"), "{wrong}");

    // The same by single numbers instead of the log.
    let numbers = ["--samples", "256", "--receivers", "4", "--transmitters", "1", "--loops", "1"];
    let clock = ["--sample-rate", "10000", "--slope", "29.982", "--frame-period", "1", "--iq", "i-first"];
    let by_options = json(&[&["inspect", "--json", text(&file)][..], &numbers, &clock].concat());
    for same in ["frames_complete", "strongest_bin", "iq_order", "strongest_range_m"] {
        assert_eq!(by_options[same], right[same], "{same}");
    }
}

#[test]
fn figures_of_the_recorded_array() {
    let Some(file) = recorded("raw_adc/openradar_doppler_example.npy") else { return };
    let numbers =
        ["--samples", "256", "--receivers", "1", "--transmitters", "1", "--loops", "128", "--iq", "i-first"];
    let found = json(&[&["inspect", "--json", text(&file)][..], &numbers].concat());
    assert_eq!(found["frames_complete"], 1);
    assert!([15, 45].contains(&found["strongest_bin"].as_u64().unwrap()), "{found}");
    assert!(found["notes"][0].as_str().unwrap().contains("decoded as unsigned"), "{found}");
}

#[test]
fn figures_of_recorded_llrp() {
    let Some(file) = recorded("llrp/ltk/dx101_a.bin") else { return };
    let found = json(&["inspect", "--json", text(&file)]);
    for (name, value) in [("messages", 934), ("tag_reads", 130), ("leftover_bytes", 0)] {
        assert_eq!(found[name], value, "{name}");
    }
    let body = recorded("llrp/edgex/ROAccessReport-001.bytes").unwrap();
    let found = json(&["inspect", "--json", text(&body)]);
    assert_eq!((found["tag_reads"].as_u64(), found["leftover_bytes"].as_u64()), (Some(1), Some(0)));
}

#[test]
fn figures_of_recorded_reads() {
    let Some(file) = recorded("rfid_phase/crozenboom/Test15-5-0.csv") else { return };
    let found = json(&["inspect", "--json", text(&file)]);
    for (name, value) in [("reads", 3114), ("antennas", 1), ("channels", 50)] {
        assert_eq!(found[name], value, "{name}");
    }
    let degrees = |name: &str| found[name].as_f64().unwrap();
    assert!((degrees("phase_std_within_channel_deg") - 2.86).abs() < 0.01);
    assert!((degrees("phase_std_after_correction_deg") - 3.57).abs() < 0.01);
    assert!((degrees("intervals_valid_share") - 0.984).abs() < 0.001);
}

#[test]
fn bad_input_is_told_in_a_sentence_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let out = folder.path().join("out");
    let missing = folder.path().join("missing.bin");
    let both = |path: &Path, more: &[&str], words: &[&str]| {
        for command in [&["inspect", text(path)][..], &["replay", text(path), "--out", text(&out)]] {
            let sentence = refused(&[command, more].concat());
            assert!(sentence.contains(text(path)), "names the file: {sentence}");
            for word in words {
                assert!(sentence.contains(word), "{word} is not in: {sentence}");
            }
            assert!(!out.exists(), "nothing is half-written");
        }
    };
    both(&missing, &[], &["No such file"]);
    both(&file("empty.bin", b""), &[], &["0 bytes"]);
    both(&file("text.txt", b"hello\n"), &[], &["offset 0", ".bin"]);
    both(&file("samples.bin", &[0; 4096]), &[], &["--profile"]);
    both(&file("short.bin", &[0; 4096]), &["--profile", "bridge"], &["4096 bytes", "393216 bytes"]);
    both(&file("odd.bin", &[0; 4097]), &["--profile", "bridge"], &["4097 bytes"]);
    both(&file("cut.pcap", &[0xd4, 0xc3, 0xb2, 0xa1, 2, 0]), &[], &["byte 0"]);
    both(&file("profile.cfg", b"sensorStop\nprofileCfg 0 77\n"), &[], &["--profile"]);
    both(
        &file(
            "reads.csv",
            b"time_us,epc,antenna,channel,phase_code,rssi_centidbm,doppler_sixteenth_hz\n1,zz,1,1,1,1,1\n",
        ),
        &[],
        &["line 2"],
    );

    // A length field of 4 GB: LLRP, and a TLV frame.
    let mut huge = vec![0x04, 0x3d];
    huge.extend(u32::MAX.to_be_bytes());
    huge.extend([0, 0, 0, 1, 1, 2, 3]);
    let sentence = refused(&["inspect", text(&file("huge.llrp", &huge))]);
    assert!(sentence.contains("length field"), "{sentence}");
    let mut frame = vec![2, 1, 4, 3, 6, 5, 8, 7, 0, 0, 6, 3];
    frame.extend(u32::MAX.to_le_bytes());
    frame.extend([0; 100]);
    let sentence = refused(&["inspect", text(&file("huge.dat", &frame))]);
    assert!(sentence.contains("no complete TLV frame"), "{sentence}");
}

#[test]
fn figures_of_recorded_motion() {
    let Some(file) = recorded("mocap/hdm05/HDM_bd_grabHighR_002_120.amc") else { return };
    let found = json(&["inspect", "--json", "--list", text(&file)]);
    assert_eq!(found["format"], "amc_motion");
    assert_eq!((&found["joints"], &found["frames"]), (&31.into(), &246.into()));
    assert_eq!(found["actions"][0]["action"], "pick_up");
    assert_eq!(found["actions"][0]["frames"], 246);
    assert_eq!(found["list"].as_array().unwrap().len(), 31);
    assert_eq!(found["list"][0]["parent"], Value::Null);
    let height = found["height_m"].as_f64().unwrap();
    assert!((1.6..1.63).contains(&height), "{height}");
}

#[test]
fn motion_that_cannot_be_read_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("07_cut.amc");
    std::fs::write(&file, b"#from f\xfcr\n:FULLY-SPECIFIED\n1\nroot 0 0 0 0 0 0\n").unwrap();
    let sentence = refused(&["inspect", text(&file)]);
    assert!(sentence.contains("07_cut.asf, 07.asf"), "{sentence}");
    std::fs::write(folder.path().join("07.asf"), ":version 1.10\n:bonedata\nlength x\n").unwrap();
    let sentence = refused(&["inspect", text(&file)]);
    assert!(sentence.contains("07.asf, line 3"), "{sentence}");
    let sentence = refused(&["replay", text(&file), "--out", text(&folder.path().join("out"))]);
    assert!(sentence.contains("no radar frame"), "{sentence}");
}

#[test]
fn wrong_profiles_name_line_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let (samples, profile) = (folder.path().join("a.bin"), folder.path().join("b.cfg"));
    std::fs::write(&samples, [0; 64]).unwrap();
    std::fs::write(&profile, "sensorStop\nchannelCfg 15 x 0\n").unwrap();
    let with = |profile: &str| refused(&["inspect", text(&samples), "--profile", profile]);
    let sentence = with(text(&profile));
    assert!(sentence.contains("b.cfg: line 2") && sentence.contains("channelCfg"), "{sentence}");
    let sentence = with("nowhere.cfg");
    assert!(sentence.contains("nowhere.cfg") && sentence.contains("paper, fine, bridge"), "{sentence}");
    let sentence = refused(&["inspect", text(&samples), "--profile", "bridge", "--samples", "100"]);
    assert!(sentence.contains("100 samples a chirp: need a power of two"), "{sentence}");
}

#[test]
fn a_folder_that_cannot_be_made_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "x").unwrap();
    let out = file.join("out");
    let sentence = refused(&["replay", text(&shipped()), "--out", text(&out)]);
    assert!(sentence.contains("cannot make the folder"), "{sentence}");
}

#[test]
fn simulated_recordings_need_a_known_name() {
    let sentence = refused(&["simulate", "--recording", "scene.bin"]);
    assert!(sentence.contains(".pcap"), "{sentence}");
}

#[test]
fn a_plan_is_made_compared_and_used() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("bridge.toml");
    let plan = json(&[
        "plan",
        "kitchen",
        "--tags",
        "6",
        "--json",
        "--compare",
        "--out",
        text(&out),
        "--reader",
        "192.168.33.40",
    ]);
    assert_eq!(plan["profile"]["name"], "bridge");
    assert_eq!((&plan["map_points"], &plan["antennas"]), (&64.into(), &3.into()));
    assert!(plan["reading"]["interval_s"].as_f64().unwrap() < 0.1);
    let instructions = |costs: &Value| costs["instructions"].as_f64().unwrap();
    assert!(instructions(&plan["paper"]) > 3.0 * instructions(&plan["costs"]));
    assert!(plan["costs"]["host_us"].as_f64().unwrap() > 0.0);
    let config = std::fs::read_to_string(&out).unwrap();
    assert!(config.contains("base = \"bridge\"") && config.contains("reader_antennas = 3"), "{config}");
    // The scene's file is as good as an option.
    let scene = folder.path().join("scene.toml");
    let kitchen = include_str!("../scenes/kitchen.toml")
        .replace("[reader]\n", "[needs]\nelevation = false\n\n[reader]\n");
    std::fs::write(&scene, kitchen).unwrap();
    assert_eq!(json(&["plan", text(&scene), "--json"])["profile"]["transmitters"], 1);
}

#[test]
fn a_plan_that_cannot_be_is_refused_with_what_binds_and_what_would_do() {
    for (arguments, words) in [
        (&["--depth", "15", "--fastest-hand", "6"][..], &["kitchen", "speed", "a range resolution of"][..]),
        (&["--fastest-hand", "12"], &["hands move at up to 12.00 m/s", "no elevation"]),
        (&["--tags", "30", "--antennas", "4"], &["30 tags and 4 antennas", "2 antennas"]),
        (&["--link", "uart"], &["raw samples take 31.5 Mbit/s of UART"]),
        (&["--depth", "9"], &["one gated cube takes 645120 bytes", "a depth of 6.1 m"]),
    ] {
        let out = ["plan", "kitchen", "--out", "/nowhere/bridge.toml"];
        let sentence = refused(&[&out[..], arguments].concat());
        for word in words {
            assert!(sentence.contains(word), "{word} is not in: {sentence}");
        }
    }
    let wrong = rfhoi(&["plan", "kitchen", "--link", "string"]);
    assert!(String::from_utf8(wrong.stderr).unwrap().contains("need the Mbit/s of an Ethernet"));
}
