//! Physics, with bounds.

use glam::{Vec2, Vec3};
use ndarray::Array2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rfhoi_firmware::dsp::{RangeStage, level};
use rfhoi_shared::radar::{RadarProfile, SampleFormat};
use rfhoi_shared::wire::Covariance;

use super::*;
use crate::aoa::{Estimator, Settings};
use crate::simulate::Capsule;
use crate::simulate::scene::{Place, RadarPose, Reader, Room, Stated};

/// Small triangles that face the radar and move evenly.
struct Points {
    surface: Surface,
    points: Vec<(Vec3, Vec3)>,
}

/// Area of a point's triangle, m2.
const AREA_M2: f32 = 1e-6;
/// Makes of it the cross section of a hand or a chest, some square decimetres.
const REFLECTIVITY: f32 = 2e4;

impl Points {
    /// Places and velocities, in the radar's axes with the radar at the origin.
    fn new(points: &[(Vec3, Vec3)]) -> Self {
        let count = points.len() as u32;
        let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let surface = Surface { triangles, reflectivity: vec![REFLECTIVITY; points.len()] };
        Self { surface, points: points.to_vec() }
    }
}

impl Performance for Points {
    fn duration_s(&self) -> f64 {
        1.0
    }
    fn surface(&self) -> &Surface {
        &self.surface
    }
    fn vertices(&self, time_s: f64, vertices: &mut Vec<Vec3>) {
        vertices.clear();
        for &(place, velocity) in &self.points {
            let centre = place + velocity * time_s as f32;
            let (right, up) = pair_facing(place);
            let size = (2.0 * AREA_M2).sqrt();
            let corners = [-right - up, 2.0 * right - up, 2.0 * up - right].map(|c| centre + c * size / 3.0);
            vertices.extend(corners);
        }
    }
    fn tags(&self) -> usize {
        0
    }
    fn tag(&self, _: usize, _: f64) -> Vec3 {
        Vec3::ZERO
    }
    fn blockers(&self, _: f64, blockers: &mut Vec<Capsule>) {
        blockers.clear();
    }
}

/// Two unit vectors across the way from `point` to the origin, such that a triangle along them shows its outside there.
fn pair_facing(point: Vec3) -> (Vec3, Vec3) {
    let toward = -point.normalize();
    let (a, b) = toward.any_orthonormal_pair();
    if a.cross(b).dot(toward) > 0.0 { (a, b) } else { (b, a) }
}

/// A hall of which nothing comes back, with the radar at its origin.
fn hall(profile: RadarProfile) -> Scene {
    Scene {
        name: "hall".into(),
        stated: Stated::default(),
        room: Room { min: Vec3::splat(-50.0), max: Vec3::splat(50.0), reflectivity: 0.0 },
        furniture: Vec::new(),
        radar: RadarPose { position: Vec3::ZERO, yaw_rad: 0.0, pitch_rad: 0.0, depth_m: 3.05, profile },
        reader: Reader { antennas: Vec::new(), power_dbm: 30.0 },
        tags: Vec::new(),
        people: Vec::new(),
        places: vec![Place { position: Vec2::new(0.0, 2.0), facing_rad: 0.0 }],
    }
}

fn radar(effects: Effects) -> Radar {
    radar_of(RadarProfile::bridge(), effects)
}

fn radar_of(profile: RadarProfile, effects: Effects) -> Radar {
    let scene = hall(profile);
    let mut radar = Radar::new(&scene, effects).unwrap();
    radar.begin(None, &mut ChaCha8Rng::seed_from_u64(1));
    radar
}

/// The same frame by way of samples, as the bridge takes them.
fn maps_of_samples(radar: &mut Radar) -> FrameMaps {
    let config = radar.config().clone();
    let mut stage = RangeStage::new();
    stage.configure(&config.profile, config.processing.gate);
    let mut mapper = Mapper::new(&config);
    let mut chirp = vec![0; config.profile.chirp_bytes() as usize];
    mapper.frame(|cube| {
        for index in 0..config.profile.chirps_per_frame() {
            radar.chirp(index, &mut chirp);
            for (rx, row) in chirp.chunks_exact(config.profile.row_bytes() as usize).enumerate() {
                stage.row(index, rx as u32, row, cube);
            }
        }
    })
}

fn db(maps: &FrameMaps, radar: &Radar) -> Array2<f32> {
    let bins = usize::from(radar.config().processing.gate.bins);
    let levels = maps.range_doppler.iter().map(|&code| level::SCALE.level_db(code)).collect();
    Array2::from_shape_vec((bins, maps.range_doppler.len() / bins), levels).unwrap()
}

fn peak(map: &Array2<f32>) -> ((usize, usize), f32) {
    map.indexed_iter().fold(((0, 0), f32::MIN), |best, (at, &v)| if v > best.1 { (at, v) } else { best })
}

#[test]
fn a_point_appears_where_it_is() {
    let mut radar = radar(Effects::NONE);
    let profile = radar.config().profile.clone();
    let (range_bin, velocity_bin) = (profile.range_bin().0, profile.velocity_bin().0);
    let mut estimator = Estimator::new(&profile, Settings::bartlett(181)).unwrap();
    for (range_m, velocity, azimuth_deg, elevation_deg) in [
        (1.2_f32, 1.0_f32, 0.0_f32, 0.0_f32),
        (2.4, -2.2, 30.0, 0.0),
        (1.9, 0.6, -25.0, 20.0),
        (2.8, 3.5, 10.0, -30.0),
    ] {
        let (az, el) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
        let direction = Vec3::new(az.sin() * el.cos(), az.cos() * el.cos(), el.sin());
        let points = Points::new(&[(direction * range_m, direction * velocity)]);
        radar.look(&points, 0.0);
        for maps in [radar.maps(), maps_of_samples(&mut radar)] {
            let ((range, doppler), _) = peak(&db(&maps, &radar));
            // In the middle of the frame it has moved on.
            let moved_m = range_m + velocity * radar.chirps.active_s as f32 / 2.0;
            assert!((range as f32 * range_bin - moved_m).abs() < 0.6 * range_bin, "{range} for {moved_m} m");
            let measured = (doppler as f32 - f32::from(profile.loops / 2)) * velocity_bin;
            assert!((measured - velocity).abs() < 0.6 * velocity_bin, "{measured} m/s for {velocity}");
            let packed = maps.covariance.iter().copied().collect();
            let covariance = Covariance { frame: 0, antennas: 12, packed };
            let found = estimator.estimate(&covariance, maps.moving_cells).peaks()[0];
            let found = (found.azimuth_deg, found.elevation_deg);
            assert!(
                (found.0 - azimuth_deg).abs() <= 2.0 && (found.1 - elevation_deg).abs() <= 2.0,
                "{found:?}"
            );
        }
    }
}

#[test]
fn power_falls_with_the_fourth_power_of_range() {
    let mut radar = radar(Effects::NONE);
    let bin = radar.config().profile.range_bin().0;
    // On bins, so that the window takes the same from all.
    let mut level = |bins: f32| {
        let place = Vec3::Y * bins * bin;
        radar.look(&Points::new(&[(place, Vec3::Y * 0.7)]), -radar.chirps.active_s / 2.0);
        let maps = radar.maps();
        peak(&db(&maps, &radar)).1
    };
    let (near, far, farthest) = (level(16.0), level(32.0), level(64.0));
    // Codes are steps of 0.5 dB.
    assert!(
        (near - far - 12.04).abs() <= 0.5 && (far - farthest - 12.04).abs() <= 0.5,
        "{near} {far} {farthest}"
    );
}

#[test]
fn two_equal_paths_interfere() {
    let mut radar = radar(Effects::NONE);
    let wavelength = radar.config().profile.wavelength().0;
    let mut level = |apart_m: f32| {
        let velocity = Vec3::Y;
        let points = Points::new(&[(Vec3::Y * 1.5, velocity), (Vec3::Y * (1.5 + apart_m), velocity)]);
        radar.look(&points, 0.0);
        peak(&db(&radar.maps(), &radar)).1
    };
    let single = level(wavelength / 4.0 * 2.0) - 6.02;
    // There and back the way differs by half a wavelength: they cancel; by a quarter: their powers add.
    assert!((level(wavelength / 8.0) - single - 3.01).abs() <= 0.6, "{} {single}", level(wavelength / 8.0));
    assert!(level(wavelength / 4.0) < single - 30.0, "{} {single}", level(wavelength / 4.0));
}

/// Some points like a person's, of levels like theirs.
fn crowd() -> Points {
    let points: Vec<_> = (0..60)
        .map(|i| {
            let x = i as f32;
            let place = Vec3::new((x * 0.7).sin() * 0.6, 1.8 + (x * 1.3).cos() * 0.5, (x * 2.1).sin() * 0.7);
            (place, Vec3::new((x * 0.3).cos(), (x * 0.9).sin() * 1.8, (x * 0.5).sin()))
        })
        .collect();
    Points::new(&points)
}

#[test]
fn samples_and_spectrum_agree_over_the_whole_map() {
    let mut radar = radar(Effects::NONE);
    radar.look(&crowd(), 0.0);
    let (spectrum, samples) = (radar.maps(), maps_of_samples(&mut radar));
    let (spectrum, samples) = (db(&spectrum, &radar), db(&samples, &radar));
    let power = |map: &Array2<f32>| map.iter().map(|v| 10f32.powf(v / 10.0)).sum::<f32>();
    let total = 10.0 * (power(&spectrum) / power(&samples)).log10();
    assert!(total.abs() < 0.05, "total energy differs by {total} dB");
    let (_, top) = peak(&samples);
    let worst = spectrum.iter().zip(&samples).filter(|(_, s)| **s > top - 40.0).map(|(a, b)| (a - b).abs());
    let worst = worst.fold(0.0, f32::max);
    assert!(worst <= 1.5, "a cell within 40 dB of the peak differs by {worst} dB");
}

#[test]
fn noise_is_the_same_in_both_forms() {
    let effects = Effects { thermal_noise: true, phase_noise: true, quantisation: true, ..Effects::NONE };
    let mean = |map: &Array2<f32>| {
        let power = map.iter().map(|v| 10f32.powf(v / 10.0)).sum::<f32>() / map.len() as f32;
        10.0 * power.log10()
    };
    let bridge = RadarProfile::bridge();
    let real =
        RadarProfile { format: SampleFormat::Real, samples: 256, sample_rate_ksps: 4_400, ..bridge.clone() };
    // Of 2 s^2 a transform of N x 64 with two Hann windows keeps 1.5^2 / (64 N); the bridge doubles real samples, of s^2.
    for (profile, factor_db) in [(bridge, 3.01), (real, 6.02)] {
        let samples = f32::from(profile.samples);
        let mut radar = radar_of(profile, effects);
        radar.look(&Points::new(&[]), 0.0);
        let spectrum = mean(&db(&radar.maps(), &radar));
        let words = maps_of_samples(&mut radar);
        let words = mean(&db(&words, &radar));
        assert!((spectrum - words).abs() < 0.3, "{spectrum} dB and {words} dB");
        let expected =
            20.0 * radar.front_end.noise.log10() + factor_db + 3.52 - 10.0 * (64.0 * samples).log10();
        assert!((spectrum - expected).abs() < 0.4, "{spectrum} dB for {expected} dB");
    }
}

#[test]
fn still_things_leave_nothing_but_their_jitter() {
    let scene = Scene {
        room: Room { min: Vec3::new(-1.5, -0.5, -1.0), max: Vec3::new(1.5, 2.5, 1.5), reflectivity: 0.3 },
        ..hall(RadarProfile::bridge())
    };
    let level = |effects| {
        let mut radar = Radar::new(&scene, effects).unwrap();
        radar.begin(None, &mut ChaCha8Rng::seed_from_u64(1));
        radar.look(&Points::new(&[]), 0.0);
        [radar.maps(), maps_of_samples(&mut radar)].map(|maps| peak(&db(&maps, &radar)).1)
    };
    let clutter = Effects { clutter: true, ..Effects::NONE };
    let [spectrum, samples] = level(clutter);
    assert!(spectrum < -125.0 && samples < -115.0, "{spectrum} {samples}");
    let jitter = level(Effects { phase_noise: true, ..clutter });
    assert!(jitter.iter().all(|&j| (-115.0..-80.0).contains(&j)), "{jitter:?}");
    assert!((jitter[0] - jitter[1]).abs() < 4.0, "{jitter:?}");
}

#[test]
fn walls_make_images_at_half_the_sum_of_the_ways() {
    // A wall on the right, 1 m away.
    let mut scene = hall(RadarProfile::bridge());
    scene.room.max.x = 1.0;
    scene.room.reflectivity = 0.5;
    let effects = Effects { images: true, ..Effects::NONE };
    let mut radar = Radar::new(&scene, effects).unwrap();
    radar.begin(None, &mut ChaCha8Rng::seed_from_u64(1));
    let place = Vec3::new(0.3, 1.5, 0.0);
    let points = Points::new(&[(place, Vec3::Y)]);
    let paths = radar.look(&points, 0.0).to_vec();
    let (direct, image) = (place.length(), Vec3::new(1.7, 1.5, 0.0).length());
    assert_eq!(paths.len(), 3, "the direct one, and by way of the wall in both directions: {paths:?}");
    assert!((paths[1].half_m[0] - (direct + image) / 2.0).abs() < 1e-3);
    assert_eq!((paths[1].departure, paths[1].arrival), (paths[2].arrival, paths[2].departure));
    assert!((paths[1].arrival[0] - 1.7 / image).abs() < 5e-3);
}

#[test]
fn a_profile_without_geometry_is_refused() {
    let mut profile = RadarProfile::bridge();
    profile.tx_order = [0b11].into_iter().collect();
    assert!(matches!(Radar::new(&hall(profile), Effects::NONE), Err(RadarError::Geometry)));
}
