//! A clean stream of a simulated radar: the host's maps are those of the signal processing run on the same chirps, and a
//! hand that moves is where it is.

use rfhoi::aoa::{Estimator, Settings};
use rfhoi::receive::{HeatMap, RadarFrame};
use rfhoi_firmware::dsp::{Cube, CubeShape, DopplerStage, RangeStage, level};
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::RadarProfile;
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::{DatagramCounts, FrameCounts};
use rfhoi_tests::simulated::path::{cube_memory, run, strongest};
use rfhoi_tests::simulated::radar::{Measurement, configuration, point};

/// Codes of both maps and bits of the covariance of every frame, from the stages without what is around them.
fn directly(config: &RadarConfig, measurement: &Measurement) -> Vec<(Vec<u8>, Vec<u8>, Vec<u32>)> {
    let mut memory = cube_memory(config);
    let mut cube = Cube::new(&mut memory);
    assert!(cube.reshape(CubeShape::of(config)));
    let (mut range, mut doppler) = (RangeStage::new(), DopplerStage::new());
    range.configure(&config.profile, config.processing.gate);
    doppler.configure(config);
    let mut frames = Vec::new();
    for chirp in measurement.chirps() {
        if chirp.index == 0 {
            cube.clear();
        }
        for (receiver, row) in (0..).zip(chirp.bytes.chunks(config.profile.row_bytes() as usize)) {
            range.row(chirp.index, receiver, row, &mut cube);
        }
        if chirp.index + 1 < config.profile.chirps_per_frame() {
            continue;
        }
        doppler.begin(&cube);
        let (mut range_doppler, mut range_time) = (Vec::new(), Vec::new());
        for bin in 0..cube.shape().bins {
            let row = doppler.range_bin(&cube, bin);
            range_doppler.extend(row.doppler().map(level::code));
            range_time.extend(row.time.iter().copied().map(level::code));
        }
        frames.push((range_doppler, range_time, doppler.finish().covariance().map(f32::to_bits).collect()));
    }
    frames
}

fn whole(map: &Option<HeatMap>) -> &HeatMap {
    let map = map.as_ref().expect("the map arrived");
    assert_eq!(map.rows_missing(), 0);
    map
}

#[test]
fn the_hosts_maps_are_those_of_the_signal_processing() {
    let bridge = Measurement {
        profile: RadarProfile::bridge(),
        scatterers: vec![point(1.1, -0.8, 0.05), point(0.7, 2.1, 0.01), point(2.5, 0.0, 0.3)],
        frames: 3,
        start: BridgeTime(77),
        noise: 8.0,
        seed: 5,
    };
    for measurement in [bridge, Measurement::hand_before_wall(20)] {
        let config = configuration(measurement.profile.clone());
        let outcome = run(&config, measurement.datagrams());
        let expected = directly(&config, &measurement);
        assert_eq!(outcome.frames.len(), measurement.frames as usize);
        for (number, (frame, (range_doppler, range_time, covariance))) in
            (0..).zip(outcome.frames.iter().zip(&expected))
        {
            assert_eq!(frame.frame, number);
            assert!(
                whole(&frame.range_doppler).codes == *range_doppler,
                "range-Doppler map of frame {number}"
            );
            assert!(whole(&frame.range_time).codes == *range_time, "range-time map of frame {number}");
            let packed = &frame.covariance.as_ref().expect("the covariance arrived").packed;
            assert!(
                packed.iter().map(|x| x.to_bits()).eq(covariance.iter().copied()),
                "covariance of {number}"
            );
            let info = frame.info.expect("the frame's end arrived");
            assert_eq!((info.chirps, info.chirps_lost), (config.profile.chirps_per_frame(), 0));
            assert_eq!((info.clipped, info.profile), (0, config.profile.fingerprint()));
        }
        let complete = FrameCounts { complete: measurement.frames, ..FrameCounts::default() };
        assert_eq!(outcome.frame_counts, complete);
        let received = measurement.datagrams().count() as u32;
        assert_eq!(outcome.datagrams, DatagramCounts { received, ..DatagramCounts::default() });
        assert_eq!((outcome.link.packets_lost, outcome.link.frames_with_holes), (0, 0));
    }
}

#[test]
fn a_frames_time_is_that_of_its_first_datagram() {
    let measurement = Measurement::hand_before_wall(5);
    let outcome = run(&configuration(measurement.profile.clone()), measurement.datagrams());
    for (number, frame) in (0u64..).zip(&outcome.frames) {
        let began = measurement.start.after(number * 20_000);
        // The datagram that a frame begins in is full one or two chirps of 70.3 us later.
        assert!((0..=141).contains(&frame.time.since(began)), "{:?}", frame.time);
    }
}

#[test]
fn a_moving_hand_is_at_its_range_velocity_and_angle() {
    let mut measurement = Measurement::hand_before_wall(40);
    // On the grid of angles below.
    let (azimuth_deg, elevation_deg) = (18.0f64, -12.0f64);
    measurement.scatterers[0].azimuth_rad = azimuth_deg.to_radians();
    measurement.scatterers[0].elevation_rad = elevation_deg.to_radians();
    let outcome = run(&configuration(measurement.profile.clone()), measurement.datagrams());
    let mut estimator =
        Estimator::new(&measurement.profile, Settings::bartlett(41)).expect("the geometry is known");
    for frame in &outcome.frames {
        let (range, column) = measurement.cell(0, frame.frame);
        let (row, strongest_column, level_db) = strongest(whole(&frame.range_doppler));
        // Half a bin, and a twentieth for noise where it is between two.
        assert!((row as f64 - range).abs() < 0.55, "frame {}: row {row}, hand at {range:.2}", frame.frame);
        assert_eq!(strongest_column, column);
        // 20 log10(0.05), less up to 1.4 dB of the Hann window between two bins, and half a code.
        assert!((-27.75..-25.75).contains(&level_db), "frame {}: {level_db} dB", frame.frame);
        assert!(frame.info.expect("the frame's end arrived").moving_cells > 0);
        estimator.estimate(frame.covariance.as_ref().expect("it arrived"), 1);
        let map = estimator.map_db().iter().enumerate();
        let (place, _) = map.max_by(|a, b| a.1.total_cmp(b.1)).expect("a grid");
        let (e, a) = (place / estimator.azimuth_deg().len(), place % estimator.azimuth_deg().len());
        let found = (f64::from(estimator.azimuth_deg()[a]), f64::from(estimator.elevation_deg()[e]));
        assert!((found.0 - azimuth_deg).abs() < 1e-3 && (found.1 - elevation_deg).abs() < 1e-3, "{found:?}");
    }
}

#[test]
fn nothing_but_noise_gives_maps_of_noise() {
    let measurement = Measurement { scatterers: Vec::new(), ..Measurement::hand_before_wall(10) };
    let outcome = run(&configuration(measurement.profile.clone()), measurement.datagrams());
    // Noise of 2 words a part: power 2 x 2^2 / 32768^2 = -81.3 dB, less 10 log10 of 128 samples and 16 loops over the
    // noise bandwidth of both windows (1.5 each), or of their sums for the range-time map: no Doppler window there.
    let per_cell = |gain: f64| 10.0 * (8.0 / 32768f64.powi(2) / gain).log10();
    let expected = per_cell(128.0 / 1.5 * 16.0 / 1.5);
    let mean_db = |frame: &RadarFrame| {
        let map = whole(&frame.range_doppler);
        // Clutter removal leaves nothing of zero Doppler and its neighbours.
        let columns = (0..16usize).filter(|c| c.abs_diff(8) > 2);
        let cells =
            columns.flat_map(|c| (1..72).map(move |r| 10f64.powf(f64::from(map.level_db(r, c)) / 10.0)));
        let cells: Vec<f64> = cells.collect();
        10.0 * (cells.iter().sum::<f64>() / cells.len() as f64).log10()
    };
    for frame in &outcome.frames {
        let off = mean_db(frame) - expected;
        // Mean of 71 x 11 cells of 12 antennas: 0.05 dB of spread; rounding the ADC's words adds 0.1 dB.
        assert!(off.abs() < 0.4, "frame {}: noise is off by {off:.2} dB", frame.frame);
    }
}
