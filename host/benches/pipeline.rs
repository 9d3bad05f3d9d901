//! The host's maps against a careful numpy + scipy pipeline (`tests/peers/pipeline.py`), interleaved in one run on one core:
//!
//! ```text
//! cargo bench -p rfhoi --bench pipeline
//! ```
//!
//! That is the build that users install. The dev profile has overflow checks, which make the raw samples' FFTs half as fast.
//!
//! Python with numpy and scipy is that of `target/venv`, or what `RFHOI_PYTHON` names; without it only ours is timed. The peer
//! first checks that its maps are ours. Input is simulated: hands and a wall in noise, as words of the `paper` profile.
//! A round's time of a stage is the least of its repetitions, since whatever else runs only adds to it. Prints the median of
//! the rounds, and of their ratios.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use ndarray::{Array1, Array2};
use num_complex::Complex;
use rfhoi::aoa::{Estimator, Settings, hermitian};
use rfhoi::maps::raw::{RawFrame, RawMaps};
use rfhoi::maps::{AngleSquare, MapPair};
use rfhoi::npz::Npz;
use rfhoi::receive::{RadarFrame, Received, Receiver};
use rfhoi_firmware::bridge::RadarPath;
use rfhoi_firmware::dca1000::Datagram;
use rfhoi_firmware::simulated::{Noise, Scatterer, SimulatedRadar};
use rfhoi_firmware::uplink::Uplink;
use rfhoi_shared::array::virtual_antennas;
use rfhoi_shared::config::{BridgeConfig, Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::{DCA1000_PAYLOAD, RadarProfile, RangeGate};
use rfhoi_shared::units::{BridgeTime, Metres};
use rfhoi_shared::wire::Covariance;
use serde_json::json;

/// Rounds of both, and repetitions of a round.
const ROUNDS: usize = 15;
const REPEATS: usize = 20;

/// The angle map of a covariance, by MUSIC.
struct Angle {
    estimator: Estimator,
    square: AngleSquare,
    map: Vec<f32>,
}

impl Angle {
    fn new(profile: &RadarProfile, points: usize) -> Self {
        let settings = Settings { points, ..Settings::default() };
        let estimator = Estimator::new(profile, settings).expect("the array's geometry is known");
        Self { estimator, square: AngleSquare::new(), map: vec![0.0; points * points] }
    }

    fn map(&mut self, covariance: &Covariance, cells: u32) {
        std::hint::black_box(self.estimator.estimate(covariance, cells));
        self.square.map(self.estimator.map_db(), &mut self.map);
    }
}

/// What is timed: a step gives the time of each stage, us.
trait Work {
    fn step(&mut self, times: &mut Times);
    /// Writes what the peer needs into `folder`.
    fn write(&mut self, folder: &Path);
}

/// Times from mark to mark, us.
struct Times {
    last: Instant,
    of: BTreeMap<&'static str, Vec<f64>>,
}

impl Times {
    fn new() -> Self {
        Self { last: Instant::now(), of: BTreeMap::new() }
    }

    fn mark(&mut self, stage: &'static str) {
        let now = Instant::now();
        self.of.entry(stage).or_default().push((now - self.last).as_secs_f64() * 1e6);
        self.last = now;
    }
}

/// Raw samples to three maps.
struct Raw {
    config: RadarConfig,
    points: usize,
    words: Vec<u8>,
    maps: RawMaps,
    pair: MapPair,
    angle: Angle,
    squares: [Vec<f32>; 2],
    frame: RawFrame,
}

impl Raw {
    fn new(gate: RangeGate, points: usize) -> Self {
        let profile = RadarProfile::paper();
        let processing = Processing::with_gate(&profile, gate);
        let config = RadarConfig { profile, input: RadarInput::Uart, processing };
        Self {
            words: words(&config.profile),
            maps: RawMaps::new(&config).expect("the configuration is valid"),
            pair: MapPair::new(&config, points).expect("the points are within"),
            angle: Angle::new(&config.profile, points),
            squares: [(); 2].map(|()| vec![0.0; points * points]),
            frame: RawFrame::default(),
            config,
            points,
        }
    }

    fn covariance(&self) -> Covariance {
        let packed = self.maps.covariance().iter().copied().collect();
        Covariance { frame: 0, antennas: self.config.profile.virtual_count() as u8, packed }
    }
}

impl Work for Raw {
    fn step(&mut self, times: &mut Times) {
        times.last = Instant::now();
        self.frame = self.maps.powers(&self.words, &[]).expect("it is one frame");
        times.mark("range, Doppler, powers");
        self.frame.moving_cells = self.maps.moving_cells();
        times.mark("covariances");
        let [range_doppler, range_time] = &mut self.squares;
        self.pair.raw(&self.maps, self.frame, range_doppler, range_time);
        times.mark("squares");
        let covariance = self.covariance();
        self.angle.map(&covariance, self.frame.moving_cells);
        times.mark("angle");
    }

    fn write(&mut self, folder: &Path) {
        self.step(&mut Times::new());
        write_case(folder, &self.config, self.points);
        std::fs::write(folder.join("words.bin"), &self.words).expect("the folder is ours");
        let bins = usize::from(self.config.processing.gate.bins);
        let rows = |values: &[f32]| {
            Array2::from_shape_vec((bins, values.len() / bins), values.to_vec()).expect("rows are whole")
        };
        let squares = self.squares.each_ref().map(|s| square(s, self.points));
        Npz::create(folder.join("ours.npz"))
            .and_then(|npz| npz.array("range_doppler", &rows(self.maps.range_doppler())))
            .and_then(|npz| npz.array("range_time", &rows(self.maps.range_time())))
            .and_then(|npz| npz.array("covariance", &hermitian(&self.covariance())))
            .and_then(|npz| npz.array("cells", &Array1::from_elem(1, self.frame.moving_cells)))
            .and_then(|npz| npz.array("square_doppler", &squares[0]))
            .and_then(|npz| npz.array("square_time", &squares[1]))
            .and_then(Npz::finish)
            .expect("the folder is ours");
    }
}

/// A bridge's packets, received, to three maps.
struct Packets {
    config: RadarConfig,
    points: usize,
    frame: RadarFrame,
    pair: MapPair,
    angle: Angle,
    squares: [Vec<f32>; 2],
}

impl Packets {
    fn new(points: usize) -> Self {
        let config = BridgeConfig::default().radar;
        Self {
            frame: received(&config),
            pair: MapPair::new(&config, points).expect("the points are within"),
            angle: Angle::new(&config.profile, points),
            squares: [(); 2].map(|()| vec![0.0; points * points]),
            config,
            points,
        }
    }
}

impl Work for Packets {
    fn step(&mut self, times: &mut Times) {
        times.last = Instant::now();
        let [range_doppler, range_time] = &mut self.squares;
        let state = self.pair.frame(&self.frame, range_doppler, range_time);
        assert_eq!(state.range_doppler.flaw.or(state.range_time.flaw), None);
        times.mark("squares");
        if let Some(covariance) = &self.frame.covariance {
            self.angle.map(covariance, self.frame.info.map_or(0, |info| info.moving_cells));
        }
        times.mark("angle");
    }

    fn write(&mut self, folder: &Path) {
        self.step(&mut Times::new());
        write_case(folder, &self.config, self.points);
        let codes = |map: &Option<rfhoi::receive::HeatMap>| {
            let map = map.as_ref().expect("the frame is whole");
            Array2::from_shape_vec((map.arrived.len(), map.columns), map.codes.clone())
                .expect("rows are whole")
        };
        let squares = self.squares.each_ref().map(|s| square(s, self.points));
        Npz::create(folder.join("ours.npz"))
            .and_then(|npz| npz.array("codes_doppler", &codes(&self.frame.range_doppler)))
            .and_then(|npz| npz.array("codes_time", &codes(&self.frame.range_time)))
            .and_then(|npz| {
                npz.array(
                    "covariance",
                    &hermitian(self.frame.covariance.as_ref().expect("the frame is whole")),
                )
            })
            .and_then(|npz| npz.array("square_doppler", &squares[0]))
            .and_then(|npz| npz.array("square_time", &squares[1]))
            .and_then(Npz::finish)
            .expect("the folder is ours");
    }
}

fn square(values: &[f32], points: usize) -> Array2<f32> {
    Array2::from_shape_vec((points, points), values.to_vec()).expect("it is a square")
}

fn write_case(folder: &Path, config: &RadarConfig, points: usize) {
    let RadarConfig { profile, processing, .. } = config;
    let antennas = virtual_antennas(profile).expect("the array's geometry is known");
    let positions: Vec<_> = antennas.iter().map(|a| [a.position.azimuth, a.position.elevation]).collect();
    let case = json!({
        "samples": profile.samples,
        "loops": profile.loops,
        "slots": profile.tx_slots(),
        "receivers": profile.rx_count(),
        "first": processing.gate.first,
        "bins": processing.gate.bins,
        "columns": processing.range_time_columns,
        "detection_db": processing.detection.0,
        "guard": processing.zero_doppler_guard,
        "points": points,
        "positions": positions,
    });
    std::fs::write(folder.join("case.json"), case.to_string()).expect("the folder is ours");
}

/// Two hands, a body and a wall.
fn scene() -> [Scatterer; 4] {
    let at = |range_m, velocity_m_s, azimuth_rad, elevation_rad, amplitude| Scatterer {
        range_m,
        velocity_m_s,
        azimuth_rad,
        elevation_rad,
        amplitude,
    };
    [
        at(2.8, 0.0, -0.4, 0.0, 0.2),
        at(1.5, 0.3, 0.1, 0.0, 0.05),
        at(1.2, 1.4, 0.3, 0.2, 0.01),
        at(1.3, -2.1, -0.2, -0.3, 0.01),
    ]
}

/// The words of one frame.
fn words(profile: &RadarProfile) -> Vec<u8> {
    let mut radar = SimulatedRadar::new(profile).expect("the profile is valid");
    let mut noise = Noise::new(5, 3.0);
    let mut words = vec![0; profile.frame_bytes() as usize];
    for (chirp, bytes) in (0..).zip(words.chunks_mut(profile.chirp_bytes() as usize)) {
        radar.chirp(&scene(), &mut noise, 0, chirp, bytes);
    }
    words
}

/// A frame as a bridge sends it.
fn received(config: &RadarConfig) -> RadarFrame {
    let profile = &config.profile;
    let mut memory = vec![Complex::default(); profile.cube_bytes(config.processing.gate) as usize / 4];
    let mut path = RadarPath::<512>::new(config, &mut memory).expect("the configuration is valid");
    let (mut uplink, mut receiver) = (Uplink::new(1), Receiver::new());
    let mut offset = 0;
    for (sequence, part) in (1..).zip(words(profile).chunks(DCA1000_PAYLOAD as usize)) {
        let datagram = [&Datagram::header(sequence, offset), part].concat();
        path.push(BridgeTime(offset), &datagram, &mut uplink, |_, b| receiver.push(b).is_ok());
        offset += part.len() as u64;
    }
    path.finish(BridgeTime(offset), &mut uplink, |_, b| receiver.push(b).is_ok());
    match receiver.next() {
        Some(Received::Frame(frame)) => frame,
        other => panic!("no frame but {other:?}"),
    }
}

/// The peer, waiting for work.
struct Peer {
    child: Child,
    answers: BufReader<std::process::ChildStdout>,
}

impl Peer {
    /// Starts it on what `folder` holds, and prints by how much it differs from ours. `None` where there is no numpy.
    fn start(folder: &Path) -> Option<Self> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let python = std::env::var_os("RFHOI_PYTHON")
            .unwrap_or_else(|| root.join("target/venv/bin/python").into_os_string());
        let has = Command::new(&python).args(["-c", "import numpy, scipy"]).output();
        if !has.is_ok_and(|output| output.status.success()) {
            println!("SKIPPED the peer: no Python with numpy and scipy in target/venv");
            return None;
        }
        let mut child = Command::new(&python)
            .arg(root.join("tests/peers/pipeline.py"))
            .arg(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("Python starts");
        let answers = BufReader::new(child.stdout.take().expect("it is piped"));
        let mut peer = Self { child, answers };
        println!("the peer's maps differ from ours by {} at most", peer.line().trim());
        Some(peer)
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.answers.read_line(&mut line).expect("the peer is there");
        assert!(!line.is_empty(), "the peer has failed, see above");
        line
    }

    /// Least times of its stages, us.
    fn run(&mut self, count: usize) -> BTreeMap<String, f64> {
        writeln!(self.child.stdin.as_mut().expect("it is piped"), "run {count}").expect("the peer is there");
        serde_json::from_str(&self.line()).expect("it answers in JSON")
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        let _ = self.child.wait();
    }
}

/// Stages of ours, and those of the peer that do the same.
const STAGES: [(&str, &[&str]); 4] = [
    ("range, Doppler, powers", &["range", "doppler"]),
    ("covariances", &["covariance"]),
    ("squares", &["squares"]),
    ("angle", &["angle"]),
];

fn least(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn compare(name: &str, work: &mut dyn Work) {
    println!("\n{name}");
    let folder = tempfile::tempdir().expect("a temporary folder");
    work.write(folder.path());
    let mut peer = Peer::start(folder.path());
    let (mut ours, mut theirs): (Vec<BTreeMap<_, _>>, Vec<BTreeMap<_, _>>) = Default::default();
    for _ in 0..ROUNDS {
        let mut times = Times::new();
        for _ in 0..REPEATS {
            work.step(&mut times);
        }
        ours.push(times.of.into_iter().map(|(stage, times)| (stage, least(&times))).collect());
        theirs.extend(peer.as_mut().map(|peer| peer.run(REPEATS)));
    }
    println!("| {:<24} | ours, us | numpy + scipy, us | ratio |", "stage");
    println!("|--------------------------|---------:|------------------:|------:|");
    let row = |label: &str, stages: &[(&str, &[&str])]| {
        let our = |round: &BTreeMap<&str, f64>| stages.iter().filter_map(|(s, _)| round.get(s)).sum::<f64>();
        let their = |round: &BTreeMap<String, f64>| {
            stages.iter().flat_map(|(_, s)| *s).filter_map(|&s| round.get(s)).sum::<f64>()
        };
        let ratios = ours.iter().zip(&theirs).map(|(o, t)| their(t) / our(o)).collect();
        let (o, t) = (median(ours.iter().map(our).collect()), median(theirs.iter().map(their).collect()));
        println!("| {label:<24} | {o:>8.1} | {t:>17.1} | {:>5.1} |", median(ratios));
    };
    for stage in STAGES.iter().filter(|(stage, _)| ours[0].contains_key(stage)) {
        row(stage.0, std::slice::from_ref(stage));
    }
    row("all but angle", &STAGES[..3]);
    row("all", &STAGES);
}

fn main() {
    let profile = RadarProfile::paper();
    let all = RangeGate { first: 0, bins: profile.range_bins() };
    compare("`paper`, all 256 bins, raw samples to maps of 256 points", &mut Raw::new(all, 256));
    let gate = profile.gate_to(Metres(3.05));
    compare("`paper`, 72 bins, raw samples to maps of 256 points", &mut Raw::new(gate, 256));
    compare("`bridge`, packets to maps of 64 points", &mut Packets::new(64));
    compare("`bridge`, packets to maps of 256 points", &mut Packets::new(256));
}
