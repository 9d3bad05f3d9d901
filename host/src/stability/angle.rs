//! Angle of arrival where it is known to fail.
//!
//! Sources are simulated: circular Gaussian signals in white noise, from random directions within 50 degrees to the sides and
//! 40 up and down, seen by the array of the default profile. Without its guard a method gives what it finds; with it, the
//! answer of [`Settings::default`] but for what the case is about. Its error is the worst angle from a source to the nearest
//! direction found and from a direction found to the nearest source: sources closer than the tolerance may share a direction.

mod scene;
#[cfg(test)]
mod tests;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rfhoi_shared::radar::RadarProfile;

use super::{Case, Measure, Stress, Trial};
use crate::aoa::{Estimator, Method, Order, Settings, Subarray, bound_deg};
pub use scene::{Direction, Scene};
use scene::{direction, directions, error_deg, pair};

/// The cases of this module.
pub fn cases() -> Vec<Box<dyn Case>> {
    CASES.iter().map(|case| Box::new(*case) as Box<dyn Case>).collect()
}

/// Error above which a direction is wrong, degrees: a fifth of the array's beam width in azimuth.
const TOLERANCE_DEG: f64 = 5.0;
/// Powers of the sources over noise in an antenna, dB, and snapshots, where they are not what is stressed.
const SNR_DB: f64 = 20.0;
const SNAPSHOTS: u32 = 64;

/// Directions over which the bound is averaged.
const BOUND_DRAWS: u32 = 1000;

/// What is asked of an estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Question {
    /// Where everything is.
    All,
    /// Where the second source is, if it is found.
    Second,
}

/// A case as data.
#[derive(Debug, Clone, Copy)]
struct AngleCase {
    name: &'static str,
    about: &'static str,
    stress: Stress,
    question: Question,
    scene: fn(f64, &mut ChaCha8Rng) -> Scene,
    /// With the guard, or without, for true sources so many.
    settings: fn(f64, bool, usize) -> Settings,
    /// Signal over noise in an antenna, dB, and snapshots of the one source, where the bound is known.
    bound: Option<fn(f64) -> (f64, f64)>,
}

impl Case for AngleCase {
    fn name(&self) -> &'static str {
        self.name
    }

    fn about(&self) -> &'static str {
        self.about
    }

    fn stress(&self) -> Stress {
        self.stress
    }

    fn measure(&self) -> Measure {
        Measure { label: "error of direction", unit: "deg", tolerance: TOLERANCE_DEG }
    }

    fn trial(&self, stress: f64, guard: bool, rng: &mut ChaCha8Rng) -> Trial {
        let profile = RadarProfile::bridge();
        let scene = (self.scene)(stress, rng);
        let covariance = scene.covariance(&profile, rng);
        let settings = (self.settings)(stress, guard, scene.sources.len());
        let Ok(mut estimator) = Estimator::new(&profile, settings) else {
            return Trial { error: f64::INFINITY, announced: None };
        };
        let estimate = estimator.estimate(&covariance, scene.snapshots);
        let mut announced = estimate.doubt.map(|doubt| doubt.reason()).filter(|_| guard);
        if guard && self.question == Question::Second && estimate.peaks().len() < 2 {
            announced = announced.or(Some("not_found"));
        }
        Trial { error: error_deg(&scene.sources, &estimate), announced }
    }

    fn bound(&self, stress: f64) -> Option<f64> {
        let (snr_db, snapshots) = self.bound?(stress);
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut squares = 0.0;
        for _ in 0..BOUND_DRAWS {
            let snr = libm::pow(10.0, snr_db / 10.0);
            let bound = bound_deg(&RadarProfile::bridge(), direction(&mut rng), snr, snapshots).ok()?;
            squares += bound * bound / f64::from(BOUND_DRAWS);
        }
        Some(squares.sqrt())
    }
}

const fn stress(label: &'static str, unit: &'static str, values: &'static [f64]) -> Stress {
    Stress { label, unit, values }
}

/// The estimator of all cases; every snapshot is independent.
fn settings(guard: bool, order: usize) -> Settings {
    let default = Settings { snapshots_per_cell: 1.0, largest_order: 5, ..Settings::default() };
    if guard {
        return default;
    }
    Settings { order: Order::Fixed(order), loading: 0.0, guards: None, ..default }
}

fn of(method: Method, guard: bool, order: usize) -> Settings {
    Settings { method, ..settings(guard, order) }
}

fn one(snr_db: f64, snapshots: u32, rng: &mut ChaCha8Rng) -> Scene {
    Scene::of(vec![(direction(rng), snr_db)], snapshots)
}

fn two(apart_deg: f64, snr_db: [f64; 2], rng: &mut ChaCha8Rng) -> Scene {
    Scene::of(pair(apart_deg, rng).into_iter().zip(snr_db).collect(), SNAPSHOTS)
}

/// Few snapshots of one source at 10 dB.
fn few(snapshots: f64, rng: &mut ChaCha8Rng) -> Scene {
    one(10.0, snapshots as u32, rng)
}

/// So many sources, between 30 and 45 degrees from one to the next.
fn several(count: f64, rng: &mut ChaCha8Rng) -> Scene {
    let directions = directions(count as usize, 30.0, 45.0, rng);
    Scene::of(directions.into_iter().map(|d| (d, SNR_DB)).collect(), 4 * SNAPSHOTS)
}

/// One snapshot but for noise so much below.
fn singular(noise_db: f64, rng: &mut ChaCha8Rng) -> Scene {
    one(-noise_db, SNAPSHOTS, rng)
}

const SNAPSHOT_COUNTS: &[f64] = &[1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 64.0, 128.0, 256.0];
const NOISE_DB: &[f64] = &[-200.0, -180.0, -160.0, -140.0, -120.0, -100.0, -80.0, -60.0, -40.0, -20.0, 0.0];

const CASES: &[AngleCase] = &[
    AngleCase {
        name: "music-snr",
        about: "One source in ever less noise, 16 snapshots; the guard tells by signal, noise and snapshots how exact a \
                direction can be.",
        stress: stress(
            "signal over noise",
            "dB",
            &[-20.0, -15.0, -10.0, -7.5, -5.0, -2.5, 0.0, 2.5, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0],
        ),
        question: Question::All,
        scene: |stress, rng| one(stress, 16, rng),
        settings: |_, guard, order| settings(guard, order),
        bound: Some(|stress| (stress, 16.0)),
    },
    AngleCase {
        name: "music-snapshots",
        about: "One source at 10 dB from ever more snapshots; with fewer than 18 the guard takes Bartlett's spectrum.",
        stress: stress("snapshots", "", SNAPSHOT_COUNTS),
        question: Question::All,
        scene: few,
        settings: |_, guard, order| settings(guard, order),
        bound: Some(|stress| (10.0, stress)),
    },
    AngleCase {
        name: "music-two-sources",
        about: "Two sources ever farther apart; the guard sees two where there is one peak.",
        stress: stress(
            "separation",
            "deg",
            &[2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 26.0, 32.0, 40.0, 50.0, 60.0],
        ),
        question: Question::All,
        scene: |stress, rng| two(stress, [SNR_DB; 2], rng),
        settings: |_, guard, order| settings(guard, order),
        bound: None,
    },
    AngleCase {
        name: "music-coherent",
        about: "Two sources 40 degrees apart, ever more correlated; the guard averages forward and backward over subarrays \
                of 3 x 2 and sees what the directions do not explain.",
        stress: stress(
            "correlation",
            "",
            &[0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999, 1.0],
        ),
        question: Question::All,
        scene: |stress, rng| Scene { correlation: stress, ..two(40.0, [SNR_DB; 2], rng) },
        settings: |_, guard, order| {
            let smoothing = guard.then_some(Subarray { columns: 3, rows: 2 });
            Settings { smoothing, forward_backward: guard, ..settings(guard, order) }
        },
        bound: None,
    },
    AngleCase {
        name: "music-order-low",
        about: "One to five sources where one is assumed; the guard counts them by minimum description length.",
        stress: stress("sources", "", &[1.0, 2.0, 3.0, 4.0, 5.0]),
        question: Question::All,
        scene: several,
        settings: |_, guard, _| settings(guard, 1),
        bound: None,
    },
    AngleCase {
        name: "music-order-high",
        about: "Two sources where more are assumed; the guard counts them by minimum description length.",
        stress: stress("sources too many", "", &[-1.0, 0.0, 1.0, 2.0, 3.0]),
        question: Question::All,
        scene: |_, rng| several(2.0, rng),
        settings: |stress, guard, order| settings(guard, (order as f64 + stress) as usize),
        bound: None,
    },
    AngleCase {
        name: "music-calibration",
        about: "One source, antennas of ever larger phase errors; the guard sees what the direction does not explain.",
        stress: stress(
            "phase error",
            "deg rms",
            &[0.0, 2.0, 5.0, 8.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 90.0],
        ),
        question: Question::All,
        scene: |stress, rng| Scene { phase_error_deg: stress, ..one(SNR_DB, SNAPSHOTS, rng) },
        settings: |_, guard, order| settings(guard, order),
        bound: None,
    },
    AngleCase {
        name: "music-singular",
        about: "One source in noise down to below what the numbers can hold; the guard loads the diagonal by -30 dB.",
        stress: stress("noise", "dB", NOISE_DB),
        question: Question::All,
        scene: singular,
        // What is counted in rounding errors.
        settings: |_, guard, order| Settings { order: Order::Mdl, ..settings(guard, order) },
        bound: None,
    },
    AngleCase {
        name: "music-scale",
        about: "One source from far below to far above full scale, in noise 20 dB below; the guard knows the least normal number.",
        stress: stress(
            "level",
            "dB",
            &[
                -440.0, -400.0, -360.0, -340.0, -320.0, -300.0, -200.0, -100.0, 0.0, 100.0, 200.0, 300.0,
                360.0, 400.0,
            ],
        ),
        question: Question::All,
        scene: |stress, rng| Scene { level_db: stress, ..one(SNR_DB, SNAPSHOTS, rng) },
        settings: |_, guard, order| settings(guard, order),
        bound: None,
    },
    AngleCase {
        name: "music-dominating",
        about: "A source ever weaker beside one of 30 dB, 40 degrees away; the guard says if it finds one only.",
        stress: stress(
            "weaker by",
            "dB",
            &[0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 60.0],
        ),
        question: Question::Second,
        scene: |stress, rng| two(40.0, [30.0, 30.0 - stress], rng),
        settings: |_, guard, order| settings(guard, order),
        bound: None,
    },
    AngleCase {
        name: "capon-snapshots",
        about: "Capon's spectrum, one source at 10 dB from ever more snapshots; the guard loads the diagonal by -30 dB.",
        stress: stress("snapshots", "", SNAPSHOT_COUNTS),
        question: Question::All,
        scene: few,
        settings: |_, guard, order| Settings { forward_backward: guard, ..of(Method::Capon, guard, order) },
        bound: Some(|stress| (10.0, stress)),
    },
    AngleCase {
        name: "capon-singular",
        about: "Capon's spectrum, one source in noise down to below what the numbers can hold; the guard loads the diagonal.",
        stress: stress("noise", "dB", NOISE_DB),
        question: Question::All,
        scene: singular,
        settings: |_, guard, order| of(Method::Capon, guard, order),
        bound: None,
    },
    AngleCase {
        name: "bartlett-two-sources",
        about: "Bartlett's spectrum, two sources ever farther apart; the guard sees two where there is one peak.",
        stress: stress("separation", "deg", &[2.0, 6.0, 10.0, 15.0, 20.0, 26.0, 32.0, 40.0, 50.0, 60.0]),
        question: Question::All,
        scene: |stress, rng| two(stress, [SNR_DB; 2], rng),
        settings: |_, guard, order| of(Method::Bartlett, guard, order),
        bound: None,
    },
];
