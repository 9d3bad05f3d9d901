//! Recordings of real devices through the readers and the phase pipeline. Bounds are what was measured on them.
//!
//! Without the recordings each test says SKIPPED and passes.

use std::io::Read;

use ndarray::{Array1, Array3};
use ndarray_npy::NpzReader;
use num_complex::Complex;
use rfhoi::datagrams::{DATAGRAM, Datagrams};
use rfhoi::phase::{Invalid, PhaseReport, Settings, analyse};
use rfhoi::profile::{self, Changes};
use rfhoi::reads::ReadTable;
use rfhoi::replay::{Options, VibratingTarget, replay};
use rfhoi::samples::{RawSamples, Repair};
use rfhoi_firmware::mmwave::cfg::Board;
use rfhoi_shared::array::AntennaArray;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::scene::Scene;
use rfhoi_shared::units::Metres;

#[path = "../../tests/recorded.rs"]
mod recorded;
use recorded::recorded;

fn phases(name: &str) -> Option<(ReadTable, PhaseReport)> {
    let table = ReadTable::open(recorded(&format!("rfid_phase/crozenboom/{name}.csv"))?).unwrap();
    let (_, report) = analyse(&table.reads, Settings::default());
    Some((table, report))
}

/// Rounded for comparison, so that a changed figure shows itself.
fn rounded(value: Option<f64>, decimals: i32) -> Option<f64> {
    let scale = 10_f64.powi(decimals);
    value.map(|v| (v * scale).round() / scale)
}

#[test]
fn a_still_tag_over_fifty_channels() {
    let Some((table, report)) = phases("Test15-5-0") else { return };
    assert_eq!((table.reads.len(), table.duplicates), (3_114, 0));
    assert_eq!((report.groups, report.calibrated_groups), (50, 50));
    // The same figure comes out of numpy.
    assert_eq!(rounded(report.phase_std_within_channel_deg, 2), Some(2.86));
    // 3.69 with the offsets of the first visits alone, which are not refined.
    assert_eq!(rounded(report.phase_std_after_correction_deg, 2), Some(3.57));
    assert_eq!(report.corrected, 2_401, "held out: the first visits' 713 reads do not count");
    // A read every 14 ms; each channel but the first is new once, so 49 hops have no offset yet.
    assert_eq!((report.intervals.valid, report.intervals.invalid(Invalid::UncalibratedHop)), (3_064, 49));
    assert_eq!(report.intervals.total(), 3_113);
    assert!(report.pi_ambiguous.is_empty());
}

#[test]
fn a_tag_walked_past_four_antennas_is_read_too_seldom_for_its_speed() {
    let mut counts = (0, 0, 0);
    for number in 1..=8 {
        let Some((_, report)) = phases(&format!("MoveTest1-{number}")) else { return };
        assert_eq!(report.tracks, 4);
        assert!(report.calibrated_groups <= 1, "the tag is never still: {report:?}");
        assert!(report.pi_ambiguous.is_empty(), "{report:?}");
        let intervals = report.intervals;
        let too_long = intervals.invalid(Invalid::TooLong);
        counts = (counts.0 + intervals.valid, counts.1 + too_long, counts.2 + intervals.total());
    }
    // Four antennas in turn leave about 160 ms between the reads of one, where 1.5 m/s allows 55 ms.
    assert_eq!(counts, (35, 1_289, 1_375));
}

/// Mean power of each range bin over the chirps of a stream of `samples` complex samples each, I first.
fn range_power(stream: &[u8], samples: usize) -> Vec<f64> {
    let words: Vec<f64> =
        stream.chunks_exact(2).map(|b| f64::from(i16::from_le_bytes([b[0], b[1]]))).collect();
    let turn = |k: usize, n: usize| {
        Complex::cis(-std::f64::consts::TAU * ((k * n) % samples) as f64 / samples as f64)
    };
    let mut power = vec![0.0; samples];
    for chirp in words.chunks_exact(2 * samples) {
        let z: Vec<_> = chirp
            .chunks_exact(4)
            .flat_map(|w| [Complex::new(w[0], w[2]), Complex::new(w[1], w[3])])
            .collect();
        for (k, bin) in power.iter_mut().enumerate() {
            *bin += z.iter().enumerate().map(|(n, z)| z * turn(k, n)).sum::<Complex<f64>>().norm_sqr();
        }
    }
    power
}

fn strongest(power: &[f64]) -> usize {
    (0..power.len()).max_by(|&a, &b| power[a].total_cmp(&power[b])).unwrap()
}

#[test]
fn an_array_decoded_as_unsigned_is_repaired() {
    let Some(path) = recorded("raw_adc/openradar_doppler_example.npy") else { return };
    let mut samples = RawSamples::open(path).unwrap();
    assert_eq!(samples.repair(), Repair { rewrapped: 32_073, rounded: 0 });
    let mut stream = Vec::new();
    samples.read_to_end(&mut stream).unwrap();
    assert_eq!(stream.len(), 128 * 256 * 4);
    let mut power = range_power(&stream, 256);
    let first = strongest(&power);
    power[first - 3..=first + 3].fill(0.0);
    let mut peaks = [first, strongest(&power)];
    peaks.sort_unstable();
    assert_eq!(peaks, [15, 45]);
}

#[test]
fn a_recorders_file_is_cut_into_its_datagrams() {
    let Some(path) = recorded("raw_adc/awr1642_pipe_vibration_1000f_1ms.bin") else { return };
    let samples = RawSamples::open(path).unwrap();
    assert_eq!(samples.stream_bytes(), 4_096_000);
    let datagrams: Vec<_> = Datagrams::new(samples).map(Result::unwrap).collect();
    assert_eq!(datagrams.len(), 2_814);
    let last = datagrams.last().unwrap();
    assert_eq!((last.sequence, last.byte_count), (2_814, 4_095_728));
    assert!(datagrams[..2_813].iter().all(|d| d.bytes.len() == DATAGRAM));
    // 20 chirps of four receivers; the pipe at 2.15 m is in bin 11.
    let stream: Vec<u8> = datagrams.iter().take(60).flat_map(|d| d.samples().to_vec()).collect();
    let mut power = range_power(&stream[..20 * 4 * 256 * 4], 256);
    power[..4].fill(0.0);
    assert_eq!(strongest(&power), 11);
}

fn whole(profile: RadarProfile) -> Options {
    Options {
        profile: Some(profile),
        scene: Scene::default(),
        clutter: None,
        whole_range: true,
        vibration: None,
        aligned: None,
    }
}

#[test]
fn a_pipe_at_two_metres_vibrates_at_158_hz() {
    let (Some(samples), Some(log)) = (
        recorded("raw_adc/awr1642_pipe_vibration_1000f_1ms.bin"),
        recorded("raw_adc/awr1642_pipe_LogFile_0.txt"),
    ) else {
        return;
    };
    let board = Board { array: AntennaArray::Xwr1642Boost, ..Board::default() };
    let profile = profile::load(log.to_str().unwrap(), board).unwrap();
    let out = tempfile::tempdir().unwrap();
    for target in [VibratingTarget::Strongest, VibratingTarget::At(Metres(2.15))] {
        let options = Options { vibration: Some(target), ..whole(profile.clone()) };
        let found = replay(&samples, &options, out.path(), &mut |_| true).unwrap().vibration.unwrap();
        assert!((found.range_m - 2.148).abs() < 0.001 && found.frames == 1_000, "{found:?}");
        // 0.28 um, 18 dB over the lines around it; its harmonics are at 316 and 474 Hz.
        assert!((found.frequency_hz - 158.0).abs() < 1.5 && found.rise_db > 15.0, "{found:?}");
        assert!((0.2..0.4).contains(&found.amplitude_um), "{found:?}");
    }
    assert!(out.path().join("vibration.png").is_file() && out.path().join("vibration.npz").is_file());
}

#[test]
fn who_walks_straight_is_in_the_range_profile_while_he_stands_and_fades_as_he_walks() {
    let Some(log) = recorded("uart_tlv/iwr6843aop_straightline_2024-12-09.csv") else { return };
    // Its profile is not recorded: 512 bins, and the points lie on multiples of 2.86 cm.
    let changes = Changes {
        samples: Some(512),
        slope_mhz_us: Some(95.0),
        sample_rate_ksps: Some(9_275),
        frame_ms: Some(100.0),
        ..Changes::default()
    };
    let profile = RadarProfile { array: AntennaArray::Iwr6843Aop, ..RadarProfile::bridge() };
    let out = tempfile::tempdir().unwrap();
    replay(&log, &whole(changes.apply(profile).unwrap()), out.path(), &mut |_| true).unwrap();
    let mut numbers = NpzReader::new(std::fs::File::open(out.path().join("radar.npz")).unwrap()).unwrap();
    let level: Array3<f32> = numbers.by_name("range_time_db").unwrap();
    let time: Array1<f64> = numbers.by_name("time_s").unwrap();
    let range: Array1<f32> = numbers.by_name("range_m").unwrap();
    assert_eq!(level.dim(), (176, 512, 1));
    let strongest = |frame: usize, from: f32, to: f32| {
        let bins = (0..512).filter(|&b| (from..to).contains(&range[b]));
        bins.max_by(|&a, &b| level[(frame, a, 0)].total_cmp(&level[(frame, b, 0)])).unwrap()
    };
    let mut followed = 11.58;
    for frame in 0..time.len() {
        match time[frame] {
            t if t < 3.5 => {
                followed = range[strongest(frame, followed - 0.2, followed + 0.2)];
                assert!(t > 2.4 || (followed - 11.576).abs() < 0.03, "{t}: {followed}");
            }
            t if t > 9.6 => {
                let bin = strongest(frame, 1.0, 7.0);
                assert!((1.4..1.8).contains(&range[bin]), "{t}: {}", range[bin]);
            }
            _ => {}
        }
    }
    assert!((10.9..11.3).contains(&followed), "by 3.5 s he has come to {followed}");
}
