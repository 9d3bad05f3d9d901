use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::array::{AntennaArray, Mounting};

use super::*;
use crate::stability::angle::Scene;

fn profile(array: AntennaArray) -> RadarProfile {
    let mut profile = RadarProfile { array, ..RadarProfile::bridge() };
    if array == AntennaArray::Xwr1642Boost {
        profile.tx_order = [1, 2].into_iter().collect();
    }
    profile
}

const ARRAYS: [AntennaArray; 4] = [
    AntennaArray::Awr1843Aop,
    AntennaArray::Xwr1843Boost,
    AntennaArray::Xwr1642Boost,
    AntennaArray::Iwr6843Aop,
];

/// Covariance of one source (degrees) of 20 dB, 64 snapshots.
fn source(profile: &RadarProfile, azimuth: f64, elevation: f64) -> Covariance {
    let direction = (azimuth.to_radians(), elevation.to_radians());
    Scene::of(vec![(direction, 20.0)], 64).covariance(profile, &mut ChaCha8Rng::seed_from_u64(7))
}

#[test]
fn every_board_and_mounting_finds_a_source_by_every_method() {
    for array in ARRAYS {
        for mounting in [Mounting::Upright, Mounting::Quarter, Mounting::Half, Mounting::ThreeQuarters] {
            let profile = RadarProfile { mounting, ..profile(array) };
            let Ok(settings) = Settings::of(&profile) else {
                // A line on end.
                assert_eq!(
                    Estimator::new(&profile, Settings::default()).err(),
                    Some(SettingsError::NoAzimuth)
                );
                continue;
            };
            let line = array == AntennaArray::Xwr1642Boost;
            let elevation = if line { 0.0 } else { -17.0 };
            let covariance = source(&profile, 31.0, elevation);
            for method in [Method::Music, Method::Capon, Method::Bartlett] {
                for points in [41, 64] {
                    let settings = Settings { method, points, snapshots_per_cell: 1.0, ..settings };
                    let mut estimator = Estimator::new(&profile, settings).unwrap();
                    assert_eq!(estimator.elevation_deg().len(), if line { 1 } else { points });
                    let estimate = estimator.estimate(&covariance, 64);
                    assert_eq!((estimate.method, estimate.doubt), (method, None), "{array:?} {mounting:?}");
                    let found = estimate.peaks()[0];
                    assert!((f64::from(found.azimuth_deg) - 31.0).abs() < 1.0, "{array:?} {found:?}");
                    assert!((f64::from(found.elevation_deg) - elevation).abs() < 1.0, "{array:?} {found:?}");
                    // The map's highest point is the nearest of the grid or its neighbour.
                    let map = estimator.map_db().iter().enumerate();
                    let (place, _) = map.max_by(|a, b| a.1.total_cmp(b.1)).unwrap();
                    let azimuth = estimator.azimuth_deg()[place % points];
                    let elevation = estimator.elevation_deg()[place / points];
                    let step = estimator.azimuth_deg()[1] - estimator.azimuth_deg()[0];
                    assert!((azimuth - found.azimuth_deg).abs() <= step, "{azimuth} {found:?}");
                    assert!((elevation - found.elevation_deg).abs() <= step, "{elevation} {found:?}");
                }
            }
        }
    }
}

#[test]
fn powers_are_relative_to_full_scale() {
    let profile = profile(AntennaArray::Awr1843Aop);
    let covariance = source(&profile, 10.0, 5.0);
    for (method, settings) in
        [(Method::Bartlett, Settings::bartlett(64)), (Method::Capon, Settings::default())]
    {
        let mut estimator = Estimator::new(&profile, Settings { method, ..settings }).unwrap();
        let level_db = estimator.estimate(&covariance, 64).peaks()[0].level_db;
        // The scene's level is -60 dB; 64 snapshots make 1.25 dB of it.
        assert!((level_db + 60.0).abs() < 1.5, "{method}: {level_db}");
    }
}

#[test]
fn what_is_no_covariance_of_this_array_has_its_reason() {
    let profile = profile(AntennaArray::Awr1843Aop);
    let mut estimator = Estimator::new(&profile, Settings::default()).unwrap();
    let good = source(&profile, 0.0, 0.0);
    let with = |change: fn(&mut Covariance)| {
        let mut covariance = good.clone();
        change(&mut covariance);
        covariance
    };
    for (covariance, snapshots, doubt) in [
        (with(|c| c.packed.fill(0.0)), 9, Doubt::NothingMoves),
        (with(|c| c.packed.fill(1e-40)), 9, Doubt::NothingMoves),
        (with(|c| c.packed[5] = f32::NAN), 9, Doubt::NotANumber),
        (with(|c| c.packed[143] = f32::INFINITY), 9, Doubt::NotANumber),
        (with(|c| c.packed.fill(f32::MAX)), 9, Doubt::NotPositive),
        (with(|c| c.packed.iter_mut().for_each(|p| *p = -*p)), 9, Doubt::NotPositive),
        (with(|c| c.packed[1] *= 1e6), 9, Doubt::NotPositive),
        (with(|c| c.antennas = 8), 9, Doubt::OtherArray),
        (with(|c| c.packed.truncate(5)), 9, Doubt::OtherArray),
        (with(|c| c.packed.clear()), 9, Doubt::OtherArray),
        (good.clone(), 0, Doubt::TooFewSnapshots),
    ] {
        let estimate = estimator.estimate(&covariance, snapshots);
        assert_eq!(estimate.doubt, Some(doubt));
        assert!(estimate.peaks().is_empty() && estimator.map_db().iter().all(|v| v.is_nan()));
    }
    assert_eq!(estimator.estimate(&good, 200).doubt, None);
}

#[test]
fn any_bits_and_any_powers_do_no_harm() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let profile = profile(AntennaArray::Awr1843Aop);
    let mut estimators = [Method::Music, Method::Capon, Method::Bartlett].map(|method| {
        let settings = Settings { method, points: 16, largest_order: MAX_PEAKS, ..Settings::default() };
        let raw = Settings { order: Order::Aic, loading: 0.0, guards: None, ..settings };
        [settings, raw].map(|settings| Estimator::new(&profile, settings).unwrap())
    });
    for draw in 0..3000 {
        let mut any = |_| match draw % 3 {
            0 => f32::from_bits(rng.random()),
            1 => rng.random::<f32>() - 0.3,
            // Ones and zeros: ranks of every kind.
            _ => f32::from(rng.random::<bool>()),
        };
        let mut covariance = Covariance { frame: 0, antennas: 12, packed: (0..144).map(&mut any).collect() };
        if draw % 2 == 0 {
            // A diagonal that dominates, so that more of them are covariances.
            let mut at = 0;
            for i in 0..12 {
                covariance.packed[at] = 20.0;
                at += 1 + 2 * (11 - i);
            }
        }
        for estimator in estimators.as_flattened_mut() {
            let estimate = estimator.estimate(&covariance, rng.random());
            let peaks = estimate.peaks().iter();
            assert!(peaks.into_iter().all(|p| p.azimuth_deg.is_finite() && p.elevation_deg.is_finite()));
            let empty = estimate.doubt.is_some_and(Doubt::is_empty);
            assert!(empty || estimator.map_db().iter().all(|v| v.is_finite()), "{estimate:?}");
        }
    }
}

#[test]
fn settings_that_do_not_fit_are_refused() {
    let refused = |array, settings| Estimator::new(&profile(array), settings).err();
    let default = Settings::default();
    use AntennaArray::{Awr1843Aop, Iwr6843Aop, Xwr1642Boost};
    assert_eq!(refused(Iwr6843Aop, default), Some(SettingsError::NotSymmetric));
    let smoothing = |columns, rows| Some(Subarray { columns, rows });
    for (array, columns, rows) in
        [(Awr1843Aop, 5, 1), (Awr1843Aop, 1, 3), (Xwr1642Boost, 4, 2), (Awr1843Aop, 255, 255)]
    {
        let settings = Settings { smoothing: smoothing(columns, rows), ..default };
        assert_eq!(refused(array, settings), Some(SettingsError::NoSubarray(columns, rows)));
    }
    // An array without symmetry has symmetric rectangles.
    assert_eq!(refused(Iwr6843Aop, Settings { smoothing: smoothing(2, 2), ..default }), None);
    for settings in [
        Settings { points: 15, ..default },
        Settings { points: 257, ..default },
        Settings { half_span_deg: f32::NAN, ..default },
        Settings { loading: -1.0, ..default },
        Settings { snapshots_per_cell: 0.0, ..default },
        Settings { largest_order: 0, ..default },
        Settings { largest_order: 3, smoothing: smoothing(3, 1), ..default },
    ] {
        assert!(matches!(refused(Awr1843Aop, settings), Some(SettingsError::Range { .. })), "{settings:?}");
    }
}

#[test]
fn ranges_are_rows_of_one_map() {
    let profile = profile(AntennaArray::Awr1843Aop);
    let mut estimator = Estimator::new(&profile, Settings::default()).unwrap();
    let covariances = [source(&profile, -30.0, 0.0), source(&profile, 25.0, 10.0)];
    let columns = estimator.azimuth_deg().len();
    let mut map = vec![0.0; 3 * columns];
    let mut found = Vec::new();
    estimator.range_azimuth(covariances.iter().zip([200, 200]), &mut map, |range, estimate| {
        found.push((range, estimate.peaks()[0].azimuth_deg));
    });
    for (&(range, azimuth), expected) in found.iter().zip([-30.0, 25.0]) {
        let row = &map[range * columns..][..columns];
        let best = row.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
        assert!((azimuth - expected).abs() < 1.0 && (estimator.azimuth_deg()[best] - expected).abs() < 2.0);
    }
    assert_eq!(found.len(), 2);
    assert!(map[2 * columns..].iter().all(|v| v.is_nan()));
}
