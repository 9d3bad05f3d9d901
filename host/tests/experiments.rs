//! Every study in its quick form: one epoch of a tiny network on a few simulated samples. It says nothing of accuracy.
#![cfg(feature = "train")]

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn rfhoi(words: &[&str]) -> Output {
    let run = Command::new(env!("CARGO_BIN_EXE_rfhoi")).args(words).output().expect("it runs");
    assert!(run.status.success(), "{words:?}: {}", String::from_utf8_lossy(&run.stderr));
    run
}

fn table(out: &Path, name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(out.join(name).with_extension("json")).unwrap()).unwrap()
}

/// Started runs, as they are told.
fn started(run: &Output) -> usize {
    String::from_utf8_lossy(&run.stderr)
        .lines()
        .filter(|line| line.starts_with("rfhoi experiment run"))
        .count()
}

#[test]
fn all_studies_run_and_nothing_is_done_twice() {
    let folder = tempfile::tempdir().unwrap();
    let (sets, out) = (folder.path().join("sets"), folder.path().join("out"));
    let (sets, results) = (sets.to_str().unwrap(), out.to_str().unwrap());
    rfhoi(&["experiment", "sets", "--quick", "--out", sets]);
    let words = ["--quick", "--sets", sets, "--out", results];
    // The first alone, so that those that share its runs find them.
    let modality = rfhoi(&[&["experiment", "modality"][..], &words].concat());
    // Four networks, each pre-trained once and fine-tuned on four shares.
    assert_eq!(started(&modality), 4 + 4 * 4);
    let rows = table(&out, "modality")["rows"].as_array().unwrap().clone();
    assert_eq!(rows.len(), 16);
    for row in &rows {
        let [mean, low, high] = ["mean", "low", "high"].map(|key| row["hoi"][key].as_f64().unwrap());
        assert!(low <= mean && mean <= high && high <= 100.0, "{row}");
        assert_eq!(row["at"] == 100.0, !row["int8"].is_null(), "{row}");
    }
    let all = rfhoi(&[&["experiment", "all"][..], &words].concat());
    assert!(started(&all) > 30, "{}", started(&all));
    let text = String::from_utf8_lossy(&all.stdout);
    for study in [
        "modality",
        "pre-training",
        "setups",
        "factors",
        "pairs",
        "objects",
        "fusion",
        "encoders",
        "antennas",
        "loss-weight",
        "synthetic",
        "occlusion",
        "second-person",
        "fine-tuning",
        "scenes",
    ] {
        let table = table(&out, study);
        assert_eq!(table["simulated"], true);
        assert!(text.contains(table["title"].as_str().unwrap()), "{study}");
        assert!(table["rows"].as_array().unwrap().iter().all(|row| row["hoi"]["samples"].as_u64() > Some(0)));
    }
    let again = rfhoi(&[&["experiment", "all"][..], &words].concat());
    assert_eq!(started(&again), 0);
    assert_eq!(again.stdout, all.stdout);
    let evening = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/recordings/evening.pcap.gz");
    rfhoi(&["experiment", "latency", evening.to_str().unwrap(), "--out", results]);
    let latency: Value = serde_json::from_slice(&std::fs::read(out.join("latency.json")).unwrap()).unwrap();
    assert_eq!((&latency["tags"], &latency["models"][0]["window_frames"]), (&6.into(), &60.into()));
    rfhoi(&[&["chart"][..], &words].concat());
    let mut chart = csv::Reader::from_path(out.join("chart.csv")).unwrap();
    let rows: Vec<csv::StringRecord> = chart.records().collect::<Result<_, _>>().unwrap();
    let ways: BTreeSet<String> = rows.iter().map(|row| format!("{} {}", &row[1], &row[2])).collect();
    assert_eq!(ways.len(), 3, "{ways:?}");
    // All run in all ways, and no time or count is nothing.
    assert_eq!(rows.len(), 3 * 21);
    for row in &rows {
        let costs = row.iter().skip(12).map(|cell| cell.parse::<f64>().unwrap());
        assert!(costs.clone().count() == 10 && costs.into_iter().all(|cost| cost > 0.0), "{row:?}");
    }
    assert!(out.join("chart.png").metadata().unwrap().len() > 1000);
    rfhoi(&["experiment", "report", "--out", results]);
    let page = std::fs::read_to_string(out.join("README.md")).unwrap();
    assert_eq!(page.matches("](").count(), 15 + 1, "a picture of each study, and the chart");
    assert!(page.contains("All data here are simulated") && page.contains("network, int8: answer"));
    assert!(out.join("second-person.svg").metadata().unwrap().len() > 1000);
}

#[test]
fn what_is_missing_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let words = ["experiment", "fusion", "--sets", "nowhere", "--out", folder.path().to_str().unwrap()];
    let run = Command::new(env!("CARGO_BIN_EXE_rfhoi")).args(words).output().unwrap();
    assert_eq!(run.status.code(), Some(1));
    let error = String::from_utf8_lossy(&run.stderr);
    assert!(error.contains("nowhere/site is needed: `rfhoi experiment sets --out nowhere`"), "{error}");
}
