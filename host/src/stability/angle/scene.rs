//! Simulated covariances of sources in known directions, and how far an estimate is from them.

use num_complex::Complex64;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rfhoi_shared::array::{VirtualAntenna, virtual_antennas};
use rfhoi_shared::radar::{MAX_VIRTUAL, RadarProfile};
use rfhoi_shared::wire::Covariance;

use crate::aoa::Estimate;

/// Sources are drawn within so many degrees to the sides, and up and down.
const AZIMUTH_DEG: f64 = 50.0;
const ELEVATION_DEG: f64 = 40.0;

/// A direction in radians: azimuth to the right, elevation upwards.
pub type Direction = (f64, f64);

/// Sources, and what is between them and a covariance.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Directions, and power over noise in an antenna, dB.
    pub sources: Vec<(Direction, f64)>,
    /// Snapshots, independent.
    pub snapshots: u32,
    /// Correlation of all sources with the first, 0 to 1; the phase is drawn.
    pub correlation: f64,
    /// Phase errors of the antennas, degrees, root mean square.
    pub phase_error_deg: f64,
    /// Power of the strongest source in an antenna, dB relative to full scale.
    pub level_db: f64,
}

impl Scene {
    /// Uncorrelated sources and antennas without errors, the strongest at -60 dB.
    pub fn of(sources: Vec<(Direction, f64)>, snapshots: u32) -> Self {
        Self { sources, snapshots, correlation: 0.0, phase_error_deg: 0.0, level_db: -60.0 }
    }

    /// Draws what is random, and the covariance.
    #[allow(
        clippy::needless_range_loop,
        reason = "rows and columns by their numbers, as the formula has them"
    )]
    pub fn covariance(&self, profile: &RadarProfile, rng: &mut ChaCha8Rng) -> Covariance {
        let antennas = virtual_antennas(profile).unwrap_or_default();
        let n = antennas.len();
        let errors: Vec<Complex64> =
            antennas.iter().map(|_| turn(self.phase_error_deg.to_radians() * normal(rng))).collect();
        let steering: Vec<Vec<Complex64>> = self.sources.iter().map(|s| steering(&antennas, s.0)).collect();
        let phases: Vec<Complex64> =
            self.sources.iter().map(|_| turn(rng.random::<f64>() * core::f64::consts::TAU)).collect();
        let own = (1.0 - self.correlation * self.correlation).max(0.0).sqrt();
        let mut sum = [[Complex64::default(); MAX_VIRTUAL]; MAX_VIRTUAL];
        for _ in 0..self.snapshots {
            let mut x = [Complex64::default(); MAX_VIRTUAL];
            let first = gaussian(rng);
            for (k, ((_, snr_db), steering)) in self.sources.iter().zip(&steering).enumerate() {
                let drawn = if k == 0 { first } else { gaussian(rng) * own + first * self.correlation };
                let amplitude = drawn * phases[k] * libm::pow(10.0, snr_db / 20.0);
                for (x, a) in x.iter_mut().zip(steering) {
                    *x += amplitude * a;
                }
            }
            for (x, error) in x.iter_mut().zip(&errors) {
                *x = (*x + gaussian(rng)) * error;
            }
            for i in 0..n {
                for j in i..n {
                    sum[i][j] += x[i] * x[j].conj();
                }
            }
        }
        let strongest = self.sources.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
        let scale = libm::pow(10.0, (self.level_db - strongest) / 10.0) / f64::from(self.snapshots.max(1));
        pack(&sum, n, scale)
    }
}

/// As it travels.
#[allow(clippy::needless_range_loop, reason = "rows and columns by their numbers, as the formula has them")]
fn pack(matrix: &[[Complex64; MAX_VIRTUAL]; MAX_VIRTUAL], n: usize, scale: f64) -> Covariance {
    let mut packed = heapless::Vec::new();
    for i in 0..n {
        for j in i..n {
            let x = matrix[i][j] * scale;
            let parts = [x.re as f32, x.im as f32];
            packed.extend(parts.into_iter().take(if i == j { 1 } else { 2 }));
        }
    }
    Covariance { frame: 0, antennas: n as u8, packed }
}

fn steering(antennas: &[VirtualAntenna], (azimuth, elevation): Direction) -> Vec<Complex64> {
    let (u, w) = (libm::sin(azimuth) * libm::cos(elevation), libm::sin(elevation));
    let phase = |a: &VirtualAntenna| {
        -core::f64::consts::PI * (f64::from(a.position.azimuth) * u + f64::from(a.position.elevation) * w)
    };
    antennas.iter().map(|a| turn(phase(a)) * f64::from(a.sign)).collect()
}

fn turn(angle: f64) -> Complex64 {
    Complex64::new(libm::cos(angle), libm::sin(angle))
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A circular complex number of mean power 1.
fn gaussian(rng: &mut ChaCha8Rng) -> Complex64 {
    Complex64::new(normal(rng), normal(rng)) * core::f64::consts::FRAC_1_SQRT_2
}

/// A direction within view.
pub(super) fn direction(rng: &mut ChaCha8Rng) -> Direction {
    let mut within = |degrees: f64| ((rng.random::<f64>() * 2.0 - 1.0) * degrees).to_radians();
    (within(AZIMUTH_DEG), within(ELEVATION_DEG))
}

/// Directions within view, each at least `least_deg` and neighbours in the list at most `most_deg` from each other.
pub(super) fn directions(
    count: usize,
    least_deg: f64,
    most_deg: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<Direction> {
    let mut found: Vec<Direction> = Vec::new();
    for draw in 0.. {
        let next = direction(rng);
        let apart = found.iter().all(|&d| separation_deg(d, next) >= least_deg);
        if apart && found.last().is_none_or(|&d| separation_deg(d, next) <= most_deg) {
            found.push(next);
        } else if draw % 100 == 99 {
            // The first ones left no room.
            found.clear();
        }
        if found.len() == count {
            break;
        }
    }
    found
}

/// Two directions within view, `apart_deg` from each other.
pub(super) fn pair(apart_deg: f64, rng: &mut ChaCha8Rng) -> Vec<Direction> {
    let apart = apart_deg.to_radians();
    loop {
        let first = direction(rng);
        let bearing = rng.random::<f64>() * core::f64::consts::TAU;
        // Along a great circle that leaves at `bearing` from upwards to the right.
        let (sin, cos) = (libm::sin(first.1), libm::cos(first.1));
        let elevation = libm::asin(sin * libm::cos(apart) + cos * libm::sin(apart) * libm::cos(bearing));
        let right = libm::sin(bearing) * libm::sin(apart) * cos;
        let azimuth = first.0 + libm::atan2(right, libm::cos(apart) - sin * libm::sin(elevation));
        if azimuth.abs() <= AZIMUTH_DEG.to_radians() && elevation.abs() <= ELEVATION_DEG.to_radians() {
            return vec![first, (azimuth, elevation)];
        }
    }
}

/// Angle between two directions, degrees.
pub(super) fn separation_deg(a: Direction, b: Direction) -> f64 {
    let half = |x: f64| libm::sin(x / 2.0) * libm::sin(x / 2.0);
    let chord = half(a.1 - b.1) + libm::cos(a.1) * libm::cos(b.1) * half(a.0 - b.0);
    (2.0 * libm::asin(chord.sqrt().min(1.0))).to_degrees()
}

/// The worst angle from a source to the nearest direction of `estimate`, and from a direction to the nearest source, degrees:
/// their Hausdorff distance. Sources that are nearer to each other may share a direction. Infinite where there is none.
pub(super) fn error_deg(sources: &[(Direction, f64)], estimate: &Estimate) -> f64 {
    let found: Vec<Direction> = estimate
        .peaks()
        .iter()
        .map(|p| (f64::from(p.azimuth_deg).to_radians(), f64::from(p.elevation_deg).to_radians()))
        .collect();
    let sources: Vec<Direction> = sources.iter().map(|s| s.0).collect();
    farthest(&sources, &found).max(farthest(&found, &sources))
}

/// The largest distance from one of `from` to the nearest of `to`, degrees.
fn farthest(from: &[Direction], to: &[Direction]) -> f64 {
    let nearest = |&a: &Direction| to.iter().map(|&b| separation_deg(a, b)).fold(f64::INFINITY, f64::min);
    from.iter().map(nearest).fold(0.0, f64::max)
}
