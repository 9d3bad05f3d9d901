//! The network against onnxruntime (`peers/onnx.py`): another implementation of the same shape, from the same file of weights,
//! says the same of the same frames as Burn.
//!
//! Needs Python with `numpy`, `onnx` and `onnxruntime` in `target/venv`; without it the test says so and passes, unless
//! `RFHOI_REQUIRE` is set.

use std::path::Path;
use std::process::Command;

use rfhoi_network::config::{Fusion, NetworkConfig};
use rfhoi_network::model::Model;
use rfhoi_tests::network_case::Case;

#[test]
fn onnxruntime_agrees() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let python = root.join("target/venv/bin/python");
    let can = Command::new(&python).args(["-c", "import numpy, onnx, onnxruntime"]).output();
    if !can.is_ok_and(|output| output.status.success()) {
        assert!(std::env::var_os("RFHOI_REQUIRE").is_none(), "{} lacks onnxruntime", python.display());
        println!("SKIPPED: {} lacks numpy, onnx or onnxruntime", python.display());
        return;
    }
    let mut frame_by_frame = NetworkConfig::small(32);
    frame_by_frame.radar.stack = 1;
    let shapes = [
        NetworkConfig::small(32),
        frame_by_frame,
        NetworkConfig { fusion: Fusion::None, ..NetworkConfig::small(32) },
        NetworkConfig { fusion: Fusion::Rfid, ..NetworkConfig::small(32) },
    ];
    for shape in shapes {
        let folder = tempfile::tempdir().unwrap();
        let fusion = shape.fusion;
        Case::new(Model::untrained(shape, 3).unwrap()).write(folder.path());
        let script = root.join("tests/peers/onnx.py");
        let output = Command::new(&python).arg(script).arg(folder.path()).arg("--check").output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{fusion:?}: {said}");
    }
}
