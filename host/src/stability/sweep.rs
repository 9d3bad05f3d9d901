//! Runs cases over their stresses.

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use rfhoi_shared::fnv;
use serde::Serialize;

use super::{Case, Verdict};

/// How much is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Draws at each stress, fewer where one is dear.
    pub trials: u32,
    /// Seed of all draws.
    pub seed: u64,
}

/// What came of the draws at one stress.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Point {
    /// The stress.
    pub stress: f64,
    /// Draws.
    pub trials: u32,
    /// Right answers.
    pub right: u32,
    /// Wrong answers, announced.
    pub announced: u32,
    /// Right answers that were called invalid.
    pub needless: u32,
    /// Wrong answers given as if they were right.
    pub silent: u32,
    /// Root mean square error of the answers that were given; `None` where none was, or one has no finite error.
    pub rms_error: Option<f64>,
    /// Least root mean square error of any unbiased method.
    pub bound: Option<f64>,
    /// How often each reason was told.
    pub reasons: BTreeMap<&'static str, u32>,
}

/// One case with its guard, or without.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// Whether the guard was on.
    pub guard: bool,
    /// By rising stress.
    pub points: Vec<Point>,
}

/// What came of one case.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CaseResult {
    /// Its name.
    pub name: &'static str,
    /// What is stressed, and what the guard is.
    pub about: &'static str,
    /// Axis of the stress.
    pub stress: &'static str,
    /// Its unit.
    pub stress_unit: &'static str,
    /// What the error is of.
    pub error: &'static str,
    /// Its unit.
    pub error_unit: &'static str,
    /// Errors above are wrong answers.
    pub tolerance: f64,
    /// Without the guard, then with it.
    pub curves: [Curve; 2],
}

/// The user stopped it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("stopped; nothing was written")]
pub struct Interrupted;

/// Runs `cases`. The same options give the same results, on any number of cores. `progress` is told the share that is done, 0
/// to 1, and says whether to go on.
///
/// # Errors
/// If it was stopped.
pub fn run(
    cases: &[&dyn Case],
    options: Options,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Vec<CaseResult>, Interrupted> {
    let mut results = Vec::with_capacity(cases.len());
    for (i, &case) in cases.iter().enumerate() {
        let (stress, measure) = (case.stress(), case.measure());
        let mut curves = [false, true].map(|guard| Curve { guard, points: Vec::new() });
        for (j, &value) in stress.values.iter().enumerate() {
            let share = (i as f64 + j as f64 / stress.values.len() as f64) / cases.len() as f64;
            if !progress(share) {
                return Err(Interrupted);
            }
            for curve in &mut curves {
                curve.points.push(point(case, j, value, curve.guard, options));
            }
        }
        results.push(CaseResult {
            name: case.name(),
            about: case.about(),
            stress: stress.label,
            stress_unit: stress.unit,
            error: measure.label,
            error_unit: measure.unit,
            tolerance: measure.tolerance,
            curves,
        });
    }
    Ok(results)
}

fn point(case: &dyn Case, place: usize, stress: f64, guard: bool, options: Options) -> Point {
    let measure = case.measure();
    let count = options.trials.div_ceil(case.cost(stress).max(1));
    let trials: Vec<_> = (0..count)
        .into_par_iter()
        .map(|trial| {
            // The same draws with and without the guard, others for every case, stress and trial.
            let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
            let name = fnv::more(fnv::EMPTY, case.name().as_bytes());
            rng.set_stream(u64::from(name) << 32 | (place as u64) << 24 | u64::from(trial));
            case.trial(stress, guard, &mut rng)
        })
        .collect();
    let mut point = Point { stress, trials: count, bound: case.bound(stress), ..Point::default() };
    let (mut squares, mut given) = (0.0, 0u32);
    for trial in &trials {
        match trial.verdict(&measure) {
            Verdict::Right => point.right += 1,
            Verdict::Announced => point.announced += 1,
            Verdict::Needless => point.needless += 1,
            Verdict::Silent => point.silent += 1,
        }
        match trial.announced {
            Some(reason) => *point.reasons.entry(reason).or_default() += 1,
            None => {
                squares += trial.error * trial.error;
                given += 1;
            }
        }
    }
    point.rms_error = (given > 0).then(|| (squares / f64::from(given)).sqrt()).filter(|e| e.is_finite());
    point
}
