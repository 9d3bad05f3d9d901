//! Angle spectra against numpy's and scipy's (`peers/music.py`): all boards' arrays, every method with and without averaging,
//! smoothing and loading, on simulated scenes and on the covariances of a shipped recording.
//!
//! Needs Python with `numpy` and `scipy` in `target/venv`; without it the test says so and passes, unless `RFHOI_REQUIRE` is
//! set.

use std::fs::File;
use std::path::Path;

use ndarray::{Array1, Array2, Array3, ArrayView2, Axis};
use ndarray_npy::NpzReader;
use num_complex::Complex32;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rfhoi::aoa::{Estimator, Method, Order, Settings, Subarray, hermitian};
use rfhoi::npz::Npz;
use rfhoi::replay::{Options, replay};
use rfhoi::stability::angle::Scene;
use rfhoi_firmware::mmwave::cfg::Board;
use rfhoi_shared::array::{AntennaArray, virtual_antennas};
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::wire::Covariance;
use rfhoi_tests::simulated::machine;

const POINTS: usize = 48;
/// Scenes of each case, of one and of two sources in turn.
const SCENES: usize = 6;
/// Deeper than this below its scale a form is the rounding of f32 in part: peaks of MUSIC, and nulls of Bartlett's beam.
const ROUNDING_DB: f64 = 40.0;
/// Forms end here: what f32 holds of them, `10 log10(1 / 2e-6)`.
const FLOOR_DB: f64 = 56.99;

/// Covariances with one estimator's settings.
struct Peered {
    name: String,
    profile: RadarProfile,
    settings: Settings,
    covariances: Vec<Covariance>,
}

fn profile(array: AntennaArray) -> RadarProfile {
    let mut profile = RadarProfile { array, ..RadarProfile::bridge() };
    if array == AntennaArray::Xwr1642Boost {
        profile.tx_order = [1, 2].into_iter().collect();
    }
    profile
}

/// Scenes of one source and two, in 5 to 25 dB.
fn scenes(profile: &RadarProfile, two_dimensional: bool) -> Vec<Covariance> {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let scene = |index: usize| {
        let tilt = if two_dimensional { 0.15 } else { 0.0 };
        let first = (0.7 - 0.2 * index as f64, tilt * index as f64 - 0.4 * tilt);
        let second = (first.0 - 0.6, -first.1);
        let snr_db = 5.0 + 4.0 * index as f64;
        let sources = [(first, snr_db), (second, snr_db - 3.0)];
        Scene::of(sources[..1 + index % 2].to_vec(), 40)
    };
    let mut covariances: Vec<_> =
        (0..SCENES).map(|index| scene(index).covariance(profile, &mut rng)).collect();
    // On points of the grid, where a spectrum of MUSIC has a null: one that f32 holds, and one that it does not.
    let degrees = |point: usize| (point as f64 / (POINTS - 1) as f64 - 0.5) * 120.0;
    for snr_db in [35.0, 60.0] {
        let elevation = if two_dimensional { degrees(20) } else { 0.0 };
        let source = (degrees(30).to_radians(), elevation.to_radians());
        covariances.push(Scene::of(vec![(source, snr_db)], 40).covariance(profile, &mut rng));
    }
    covariances
}

/// The covariances of the recording's frames in which something moves.
fn recorded(folder: &Path) -> (RadarProfile, Vec<Covariance>) {
    let recordings = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings");
    let source = recordings.join("evening.cfg");
    let profile =
        rfhoi::profile::load(source.to_str().expect("UTF-8"), Board::default()).expect("it is shipped");
    let options = Options {
        profile: Some(profile.clone()),
        scene: Default::default(),
        clutter: None,
        whole_range: true,
        vibration: None,
        aligned: None,
    };
    replay(&recordings.join("evening.pcap.gz"), &options, folder, &mut |_| true).expect("it replays");
    let mut numbers =
        NpzReader::new(File::open(folder.join("radar.npz")).expect("it was written")).expect("npz");
    let all: Array3<Complex32> = numbers.by_name("covariance").expect("frames have covariances");
    let moving: Array1<u32> = numbers.by_name("moving_cells").expect("frames have counts");
    let pack = |matrix: ArrayView2<'_, Complex32>| {
        let mut packed = heapless::Vec::new();
        for i in 0..matrix.nrows() {
            packed.push(matrix[(i, i)].re).expect("it fits");
            for j in i + 1..matrix.nrows() {
                packed.extend([matrix[(i, j)].re, matrix[(i, j)].im]);
            }
        }
        Covariance { frame: 0, antennas: matrix.nrows() as u8, packed }
    };
    let moving = all.outer_iter().zip(&moving).filter(|(_, cells)| **cells > 0);
    (profile, moving.map(|(matrix, _)| pack(matrix)).collect())
}

/// Every combination that a board's array takes.
fn cases(name: &str, profile: &RadarProfile, covariances: &[Covariance]) -> Vec<Peered> {
    let mut cases = Vec::new();
    for method in [Method::Bartlett, Method::Capon, Method::Music] {
        for forward_backward in [false, true] {
            for smoothing in
                [None, Some(Subarray { columns: 3, rows: 2 }), Some(Subarray { columns: 6, rows: 1 })]
            {
                for loading in [1e-3, 0.1] {
                    let settings = Settings {
                        method,
                        points: POINTS,
                        forward_backward,
                        smoothing,
                        loading,
                        order: Order::Fixed(2),
                        guards: None,
                        ..Settings::default()
                    };
                    if Estimator::new(profile, settings).is_ok() {
                        cases.push(Peered {
                            name: format!("{name}-{:03}", cases.len()),
                            profile: profile.clone(),
                            settings,
                            covariances: covariances.to_vec(),
                        });
                    }
                }
            }
        }
    }
    cases
}

/// As complex matrices.
fn unpacked(covariances: &[Covariance]) -> Array3<Complex32> {
    let n = usize::from(covariances[0].antennas);
    let mut all = Array3::zeros((covariances.len(), n, n));
    for (mut matrix, covariance) in all.outer_iter_mut().zip(covariances) {
        matrix.assign(&hermitian(covariance));
    }
    all
}

/// Mean power in an antenna, dB.
fn power_db(covariance: &Covariance) -> f64 {
    let n = usize::from(covariance.antennas);
    // Rows get shorter by an antenna, two numbers, each.
    let diagonal = (0..n).map(|i| f64::from(covariance.packed[i * (2 * n - i)]));
    10.0 * (diagonal.sum::<f64>() / n as f64).log10()
}

/// Largest and root mean square difference, dB.
#[derive(Debug, Default)]
struct Differences {
    most: f32,
    /// Above [`ROUNDING_DB`].
    most_at_nulls: f32,
    nulls: usize,
    squares: f64,
    points: usize,
}

impl Differences {
    /// `power_db` is the mean power in an antenna, which Bartlett's spectrum is at most.
    fn add(&mut self, method: Method, power_db: f64, ours: &[f32], theirs: ArrayView2<'_, f64>) {
        for (&ours, &theirs) in ours.iter().zip(theirs) {
            let (depth, theirs) = match method {
                Method::Bartlett => (power_db - theirs, theirs.max(power_db - FLOOR_DB)),
                Method::Music => (theirs, theirs.min(FLOOR_DB)),
                Method::Capon => (0.0, theirs),
            };
            let difference = (f64::from(ours) - theirs).abs() as f32;
            let near_null = depth > ROUNDING_DB;
            self.nulls += usize::from(near_null);
            let most = if near_null { &mut self.most_at_nulls } else { &mut self.most };
            *most = most.max(difference);
            self.squares += f64::from(difference).powi(2);
            self.points += 1;
        }
    }

    fn rms(&self) -> f64 {
        (self.squares / self.points.max(1) as f64).sqrt()
    }
}

#[test]
fn spectra_are_those_of_numpy() {
    let mut python = machine::python();
    if !python.args(["-c", "import numpy, scipy"]).output().is_ok_and(|o| o.status.success()) {
        return machine::missing("numpy and scipy for Python");
    }
    let folder = tempfile::tempdir().unwrap();
    let mut all = Vec::new();
    for array in [
        AntennaArray::Awr1843Aop,
        AntennaArray::Xwr1843Boost,
        AntennaArray::Xwr1642Boost,
        AntennaArray::Iwr6843Aop,
    ] {
        let profile = profile(array);
        let covariances = scenes(&profile, array != AntennaArray::Xwr1642Boost);
        all.extend(cases(&format!("{array:?}"), &profile, &covariances));
    }
    let (recorded_profile, covariances) = recorded(&folder.path().join("replayed"));
    assert!(covariances.len() > 20, "{} frames in which something moves", covariances.len());
    all.extend(cases("recorded", &recorded_profile, &covariances));

    let (given, answer) = (folder.path().join("given.npz"), folder.path().join("answer.npz"));
    let mut npz = Npz::create(&given).unwrap();
    for Peered { name, profile, settings, covariances } in &all {
        let estimator = Estimator::new(profile, *settings).unwrap();
        let antennas = virtual_antennas(profile).unwrap();
        let rows: Vec<[f32; 3]> = antennas
            .iter()
            .map(|a| [a.position.azimuth, a.position.elevation, a.sign].map(f32::from))
            .collect();
        let subarray = settings.smoothing.map_or([0.0; 2], |s| [s.columns, s.rows].map(f64::from));
        let method =
            [Method::Bartlett, Method::Capon, Method::Music].iter().position(|&m| m == settings.method);
        let numbers = [
            method.unwrap() as f64,
            f64::from(settings.forward_backward),
            subarray[0],
            subarray[1],
            settings.loading,
        ];
        npz = npz
            .array(&format!("{name}.covariance"), &unpacked(covariances))
            .and_then(|npz| npz.array(&format!("{name}.antennas"), &Array2::from(rows)))
            .and_then(|npz| {
                npz.array(&format!("{name}.azimuth"), &Array1::from(estimator.azimuth_deg().to_vec()))
            })
            .and_then(|npz| {
                npz.array(&format!("{name}.elevation"), &Array1::from(estimator.elevation_deg().to_vec()))
            })
            .and_then(|npz| npz.array(&format!("{name}.settings"), &Array1::from(numbers.to_vec())))
            .and_then(|npz| npz.array(&format!("{name}.order"), &Array1::from_elem(covariances.len(), 2u32)))
            .unwrap();
    }
    npz.finish().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/music.py");
    let output = machine::python().arg(script).args([&given, &answer]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let mut theirs = NpzReader::new(File::open(&answer).unwrap()).unwrap();
    let mut differences = [(); 3].map(|()| Differences::default());
    let mut maps = 0;
    for Peered { name, profile, settings, covariances } in &all {
        let theirs: Array3<f64> = theirs.by_name(name).unwrap();
        let mut estimator = Estimator::new(profile, *settings).unwrap();
        let of_method = &mut differences[settings.method as usize];
        for (covariance, theirs) in covariances.iter().zip(theirs.axis_iter(Axis(0))) {
            let estimate = estimator.estimate(covariance, 40);
            assert_eq!((estimate.method, estimate.order, estimate.doubt), (settings.method, 2, None));
            let ours = estimator.map_db();
            let highest = |levels: &mut dyn Iterator<Item = f64>| {
                levels.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(place, _)| place)
            };
            assert_eq!(
                highest(&mut ours.iter().map(|&v| f64::from(v))),
                highest(&mut theirs.iter().copied()),
                "{name} {settings:?}"
            );
            of_method.add(settings.method, power_db(covariance), ours, theirs);
            maps += 1;
        }
    }
    for (name, d) in ["Bartlett", "Capon", "MUSIC"].iter().zip(&differences) {
        println!(
            "{name}: most {} dB, at {} nulls {} dB, rms {} dB",
            d.most,
            d.nulls,
            d.most_at_nulls,
            d.rms()
        );
    }
    assert!(maps > 1000, "{maps} maps");
    let [bartlett, capon, music] = differences;
    // f32 holds a form to some 4e-8 of its scale: at 40 dB below that is 0.002 dB, at the floor 0.1 dB.
    assert!(bartlett.most < 0.005 && bartlett.most_at_nulls < 0.15 && bartlett.rms() < 1e-3);
    assert!(capon.most < 0.02 && capon.rms() < 1e-3);
    assert!(music.nulls > 20, "{} points of MUSIC near a null", music.nulls);
    assert!(music.most < 0.01 && music.most_at_nulls < 0.3 && music.rms() < 1e-3);
}
