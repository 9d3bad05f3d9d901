//! How long a model takes, frame by frame and at the end.

use std::time::Instant;

use rfhoi_int8::Kernels;
use rfhoi_network::metrics::median;
use rfhoi_network::model::Model;
use rfhoi_network::sample::Frames;
use serde::{Deserialize, Serialize};

use super::{Data, MeasureError};
use crate::recognize::model::runner;

/// Frames of the window that is timed: 6 s.
pub const WINDOW: usize = 60;
/// Answers that are timed; the median counts.
const TRIALS: usize = 21;

/// Medians, ms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// A frame that arrives.
    pub frame_ms: f64,
    /// From the last frame of [`WINDOW`], that frame's own work included, to the answer.
    pub answer_ms: f64,
}

/// Times a model on a sample of `data`, repeated to [`WINDOW`] frames.
///
/// # Errors
/// If the model does not run.
pub fn time(model: &Model, data: &Data, threads: usize) -> Result<Timing, MeasureError> {
    let kernels = Kernels::best().with_threads(threads);
    let mut runner = runner(model, kernels)?;
    let Some(sample) = data.set.samples.iter().max_by_key(|sample| sample.frames.len()) else {
        return Ok(Timing { frame_ms: 0.0, answer_ms: 0.0 });
    };
    let mut window = Frames::new(sample.frames.points, sample.frames.tags, sample.frames.antennas);
    (0..WINDOW).for_each(|number| window.push(sample.frames.frame(number % sample.frames.len())));
    let names = data.vectors(sample);
    let (mut frames, mut answers) = (Vec::new(), Vec::new());
    for _ in 0..TRIALS {
        runner.clear();
        for number in 0..WINDOW - 1 {
            let began = Instant::now();
            runner.push(window.frame(number))?;
            frames.push(began.elapsed().as_secs_f64());
        }
        let began = Instant::now();
        runner.push(window.frame(WINDOW - 1))?;
        runner.answer(0..WINDOW, &names)?;
        answers.push(began.elapsed().as_secs_f64());
    }
    let median_ms = |seconds| 1e3 * median(seconds).unwrap_or(0.0);
    Ok(Timing { frame_ms: median_ms(frames), answer_ms: median_ms(answers) })
}
