//! Answers of a model to samples, as it would give them live: a frame at a time.

use rfhoi_int8::Kernels;
use rfhoi_network::metrics::Metrics;
use rfhoi_network::model::Model;
use rfhoi_network::sample::{Answer, InputError, Sample};

use super::{Data, LEAST_PROBABILITY};
use crate::recognize::RecognizeError;
use crate::recognize::model::runner;

/// Temperatures that are tried, from the first in equal ratios.
const TEMPERATURES: (f32, f32, usize) = (0.3, 1.05, 60);

/// Why there are no answers.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// The model cannot run.
    #[error(transparent)]
    Runner(#[from] RecognizeError),
    /// A sample.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The user stopped it.
    #[error("stopped")]
    Interrupted,
}

/// Answers to samples, each by itself. `progress` is told the share that is done and says whether to go on.
///
/// # Errors
/// If the model does not run, or a sample does not fit it.
pub fn answers(
    model: &Model,
    data: &Data,
    samples: &[&Sample],
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Vec<Answer>, MeasureError> {
    answers_with(model, &|sample| data.vectors(sample), samples, progress)
}

/// The same of samples that are in no set; `vectors` makes the vectors of a sample's tags, one after the other.
///
/// # Errors
/// As [`answers`].
pub fn answers_with(
    model: &Model,
    vectors: &dyn Fn(&Sample) -> Vec<f32>,
    samples: &[&Sample],
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Vec<Answer>, MeasureError> {
    let mut runner = runner(model, Kernels::best())?;
    let mut answers = Vec::with_capacity(samples.len());
    for (number, sample) in samples.iter().enumerate() {
        if !progress(number as f64 / samples.len() as f64) {
            return Err(MeasureError::Interrupted);
        }
        runner.clear();
        for number in 0..sample.frames.len() {
            runner.push(sample.frames.frame(number))?;
        }
        answers.push(runner.answer(0..sample.frames.len(), &vectors(sample))?);
    }
    Ok(answers)
}

/// The temperature at which said probabilities of actions and targets are likeliest (Guo et al. 2017, section 4.2), from answers
/// at temperature 1.
pub fn calibrate(answers: &[Answer], samples: &[&Sample]) -> f32 {
    let (first, ratio, count) = TEMPERATURES;
    let loss = |temperature: f32| -> f64 {
        let of = |probabilities: &[f32], right: usize| {
            // The probabilities at another temperature are their powers, made to sum to 1 again.
            let powers: Vec<f64> = probabilities
                .iter()
                .map(|p| f64::from(p.max(1e-9)).powf(1.0 / f64::from(temperature)))
                .collect();
            -(powers[right] / powers.iter().sum::<f64>()).ln()
        };
        answers.iter().zip(samples).fold(0.0, |sum, (answer, sample)| {
            let action = of(&answer.actions, sample.action.unwrap_or(answer.actions.len() - 1));
            sum + action + sample.target.map_or(0.0, |target| of(&answer.targets, target))
        })
    };
    let tried = (0..count).map(|n| first * ratio.powi(n as i32));
    tried.min_by(|a, b| loss(*a).total_cmp(&loss(*b))).unwrap_or(1.0)
}

/// Figures of a model on samples.
///
/// # Errors
/// As [`answers`].
pub fn metrics(
    model: &Model,
    data: &Data,
    samples: &[&Sample],
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Metrics, MeasureError> {
    let answers = answers(model, data, samples, progress)?;
    Ok(Metrics::of(answers.iter().zip(samples.iter().copied()), least(model)))
}

/// Tuples less probable than this are not told by a model.
pub fn least(model: &Model) -> f32 {
    let own = model.description.least_probability;
    if own > 0.0 { own } else { LEAST_PROBABILITY }
}
