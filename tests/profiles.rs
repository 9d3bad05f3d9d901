//! Sample formats, receivers, boards and chirp orders, the latter from CLI profiles as people write them: the same target
//! is in the same cell, and its phase over the antennas is that of its direction.

use std::f32::consts::{PI, TAU};

use num_complex::Complex32;
use rfhoi::receive::RadarFrame;
use rfhoi_firmware::mmwave::cfg::{Board, CliProfile};
use rfhoi_firmware::simulated::Scatterer;
use rfhoi_shared::array::{AntennaArray, Mounting, virtual_antennas};
use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::radar::{IqOrder, RadarProfile, RangeGate, SampleFormat};
use rfhoi_shared::units::BridgeTime;
use rfhoi_tests::simulated::path::{run, strongest};
use rfhoi_tests::simulated::radar::{Measurement, configuration, point, short_frames};

const ROW: usize = 20;
const DOPPLER: usize = 3;
const AZIMUTH_RAD: f64 = 0.3;
const ELEVATION_RAD: f64 = -0.2;

/// The one frame of a radar with `radar`'s profile, on a bridge that is told `config`.
fn frame(radar: &RadarProfile, config: &RadarConfig) -> RadarFrame {
    let range_m = ROW as f64 * f64::from(radar.range_bin().0);
    let velocity = DOPPLER as f64 * f64::from(radar.velocity_bin().0);
    let target =
        Scatterer { azimuth_rad: AZIMUTH_RAD, elevation_rad: ELEVATION_RAD, ..point(range_m, velocity, 0.1) };
    let measurement = Measurement {
        profile: radar.clone(),
        scatterers: vec![target],
        frames: 1,
        start: BridgeTime(0),
        noise: 2.0,
        seed: 3,
    };
    let mut outcome = run(config, measurement.datagrams());
    assert_eq!(outcome.frame_counts.complete, 1);
    outcome.frames.remove(0)
}

/// By how much the phase of each virtual antenna against the first is not that of the target's direction, rad.
fn phase_errors(frame: &RadarFrame, profile: &RadarProfile) -> Vec<f32> {
    let covariance = frame.covariance.as_ref().expect("it arrived");
    let antennas = virtual_antennas(profile).expect("the geometry is known");
    assert_eq!(usize::from(covariance.antennas), antennas.len());
    let (u, w) = (AZIMUTH_RAD.sin() * ELEVATION_RAD.cos(), ELEVATION_RAD.sin());
    let path = |v: usize| {
        let position = antennas[v].position;
        let turned = if antennas[v].sign < 0 { PI } else { 0.0 };
        turned - PI * (f32::from(position.azimuth) * u as f32 + f32::from(position.elevation) * w as f32)
    };
    (1..antennas.len())
        .map(|v| {
            // (0, v) of the first row holds x0 conj(xv).
            let [re, im] = [2 * v - 1, 2 * v].map(|at| covariance.packed[at]);
            let error = Complex32::new(re, -im).arg() - (path(v) - path(0));
            (error + PI).rem_euclid(TAU) - PI
        })
        .collect()
}

fn sees_the_target(name: &str, profile: &RadarProfile) {
    let frame = frame(profile, &configuration(profile.clone()));
    let (row, column, level_db) = strongest(frame.range_doppler.as_ref().expect("it arrived"));
    assert_eq!((row, column), (ROW, usize::from(profile.loops / 2) + DOPPLER), "{name}");
    // 20 log10(0.1), half a code and 0.25 dB for where in its bins the target is.
    assert!((level_db + 20.0).abs() < 0.5, "{name}: {level_db} dB");
    for (v, error) in (1..).zip(phase_errors(&frame, profile)) {
        // The target crosses an eighth of a range bin in the frame and noise is 60 dB below: 0.01 rad each.
        assert!(error.abs() < 0.03, "{name}: antenna {v} is off by {error} rad");
    }
}

#[test]
fn both_word_orders_and_real_samples() {
    for format in
        [SampleFormat::Complex(IqOrder::IFirst), SampleFormat::Complex(IqOrder::QFirst), SampleFormat::Real]
    {
        sees_the_target(&format!("{format:?}"), &RadarProfile { format, ..short_frames() });
    }
}

#[test]
fn the_wrong_word_order_mirrors_the_range() {
    let right = short_frames();
    let wrong = RadarProfile { format: SampleFormat::Complex(IqOrder::IFirst), ..right.clone() };
    let mut config = configuration(wrong);
    config.processing.gate = RangeGate { first: 0, bins: 128 };
    let (row, ..) = strongest(frame(&right, &config).range_doppler.as_ref().expect("it arrived"));
    assert_eq!(row, 128 - ROW);
}

#[test]
fn any_receivers() {
    for rx_mask in [0b0001, 0b0010, 0b0011, 0b1010, 0b0111, 0b1111] {
        sees_the_target(&format!("receivers {rx_mask:04b}"), &RadarProfile { rx_mask, ..short_frames() });
    }
}

#[test]
fn every_board_and_mounting() {
    for array in [AntennaArray::Awr1843Aop, AntennaArray::Xwr1843Boost, AntennaArray::Iwr6843Aop] {
        for mounting in [Mounting::Upright, Mounting::Quarter, Mounting::Half, Mounting::ThreeQuarters] {
            let profile = RadarProfile { array, mounting, ..short_frames() };
            sees_the_target(&format!("{array:?} {mounting:?}"), &profile);
        }
    }
    let two = [0b01, 0b10].into_iter().collect();
    let boost = RadarProfile { array: AntennaArray::Xwr1642Boost, tx_order: two, ..short_frames() };
    sees_the_target("xWR1642 BOOST", &boost);
}

/// A profile as TI's visualiser writes it: this platform, and transmitter masks in this order.
fn cli_text(platform: &str, [first, second, third]: [u8; 3]) -> String {
    format!(
        "% ***************************************************************\r\n\
         % Created for SDK ver:03.06\r\n\
         % Platform:{platform}\r\n\
         % ***************************************************************\r\n\
         sensorStop\r\n\
         flushCfg\r\n\
         dfeDataOutputMode 1\r\n\
         channelCfg 15 7 0\r\n\
         adcCfg 2 1\r\n\
         adcbufCfg -1 0 1 1 1\r\n\
         profileCfg 0 77 5.3 6 65 0 0 60 1 128 2200 0 0 30\r\n\
         chirpCfg 0 0 0 0 0 0 0 {first}\r\n\
         chirpCfg 1 1 0 0 0 0 0 {second}\r\n\
         chirpCfg 2 2 0 0 0 0 0 {third}\r\n\
         frameCfg 0 2 16 0 20 1 0\r\n\
         lowPower 0 0\r\n\
         guiMonitor -1 1 1 0 0 0 1\r\n\
         lvdsStreamCfg -1 0 1 0\r\n\
         sensorStart\r\n"
    )
}

fn parsed(platform: &str, order: [u8; 3]) -> RadarProfile {
    let read = CliProfile::parse(&cli_text(platform, order), Board::default()).expect("a stock profile");
    assert_eq!(read.radar.tx_order.as_slice(), order);
    read.radar
}

#[test]
fn chirp_orders_of_cli_profiles() {
    let boost = parsed("xWR18xx", [1, 4, 2]);
    assert_eq!(boost.array, AntennaArray::Xwr1843Boost);
    sees_the_target("BOOST 1, 4, 2", &boost);
    let aop = parsed("xWR18xx_AOP", [1, 2, 4]);
    assert_eq!(aop, short_frames());
    sees_the_target("AOP 1, 2, 4", &aop);
    sees_the_target("AOP 4, 1, 2", &parsed("xWR18xx_AOP", [4, 1, 2]));
}

#[test]
fn a_wrong_chirp_order_shows_in_the_phases() {
    let (right, wrong) = (parsed("xWR18xx", [1, 4, 2]), parsed("xWR18xx", [1, 2, 4]));
    let frame = frame(&right, &configuration(wrong.clone()));
    let (row, ..) = strongest(frame.range_doppler.as_ref().expect("it arrived"));
    assert_eq!(row, ROW, "range and velocity need no order");
    let worst = phase_errors(&frame, &wrong).into_iter().fold(0.0, |worst: f32, e| worst.max(e.abs()));
    assert!(worst > 0.5, "{worst} rad");
}

/// The planner knows the memory of the boards.
#[test]
fn a_plan_counts_on_the_cubes_that_boards_have() {
    let bytes = rfhoi_bridge::CUBE_CELLS * size_of::<num_complex::Complex<i16>>();
    assert!(rfhoi::plan::limits::Board::ALL.iter().all(|board| board.cube_bytes as usize == bytes));
}
