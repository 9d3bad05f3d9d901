//! Recordings of real devices through the readers and the phase pipeline. Bounds are what was measured on them.
//!
//! Without the recordings each test says SKIPPED and passes.

use std::io::Read;

use num_complex::Complex;
use rfhoi::datagrams::{DATAGRAM, Datagrams};
use rfhoi::phase::{Invalid, PhaseReport, Settings, analyse};
use rfhoi::reads::ReadTable;
use rfhoi::samples::{RawSamples, Repair};

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
