//! The bridge's tasks among simulated devices, in virtual time: what a board runs, but for its drivers.
//!
//! Times that a recovery may take are constants beside the tests, with their reasons; what was measured is printed.

mod configuration;
mod dsp;
mod garbage;
mod host;
mod radar;
mod reader;
mod stream;
mod uart;

use rfhoi_shared::config::{BridgeConfig, Endpoint, ReaderConfig};
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::BridgeTime;
use rfhoi_tests::simulated::radar::{Measurement, configuration, point, short_frames};
use rfhoi_tests::simulated::reader::{Setup as ReaderSetup, Tag};
use rfhoi_tests::simulated::rig::{READER, Setup};

/// Where most tests have their host.
const HOST: Endpoint = Endpoint { address: [192, 168, 33, 20], port: 50_000 };
/// By then the radar is programmed, calibrated (1.5 s) and streams, and the reader reads, s.
const RUNNING: f64 = 4.5;

/// A radar of 50 short frames a second, for `frames` of them, and a reader of 200 reads a second.
fn setup(frames: u32) -> Setup {
    // 0.2 mm between frames: it stays within the gate.
    let hand = point(1.5, 0.01, 0.05);
    let tag = |number, distance_m, swing_m| Tag { epc: [number; 12], distance_m, swing_m };
    Setup {
        seed: 7,
        config: BridgeConfig {
            radar: configuration(short_frames()),
            reader: Some(ReaderConfig::for_scene(READER, &Scene::default())),
            ..BridgeConfig::default()
        },
        measurement: Measurement {
            profile: short_frames(),
            scatterers: vec![hand],
            frames,
            start: BridgeTime(0),
            noise: 2.0,
            seed: 4,
        },
        reader: ReaderSetup::new(vec![tag(1, 1.5, 0.2), tag(2, 2.5, 0.0)]),
        dsp: true,
    }
}
