//! How good answers are: accuracy as the paper counts it (section 5.1), with intervals, confusion, calibration.

use serde::{Deserialize, Serialize};

use crate::sample::{Answer, Sample};

/// Of the normal distribution, for intervals that hold 95 % of the time.
const Z95: f64 = 1.959_964;
/// Bins of the reliability diagram.
const BINS: usize = 10;

/// A share of trials.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Share {
    /// Those that count.
    pub hits: u32,
    /// All.
    pub of: u32,
}

impl Share {
    /// Counts one.
    pub fn add(&mut self, hit: bool) {
        self.hits += u32::from(hit);
        self.of += 1;
    }

    /// The share, 0 to 1; not a number without trials.
    pub fn value(self) -> f64 {
        f64::from(self.hits) / f64::from(self.of)
    }

    /// Where the true share lies 19 times of 20 (Wilson 1927).
    pub fn interval(self) -> (f64, f64) {
        if self.of == 0 {
            return (0.0, 1.0);
        }
        let (n, p) = (f64::from(self.of), self.value());
        let middle = (p + Z95 * Z95 / (2.0 * n)) / (1.0 + Z95 * Z95 / n);
        let half = Z95 / (1.0 + Z95 * Z95 / n) * (p * (1.0 - p) / n + Z95 * Z95 / (4.0 * n * n)).sqrt();
        // Of none and of all the ends are exact; rounding would put them past the share.
        ((middle - half).clamp(0.0, p), (middle + half).clamp(p, 1.0))
    }
}

impl core::fmt::Display for Share {
    /// `97.1 % [96.0, 97.9]`
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if self.of == 0 {
            return f.write_str("-");
        }
        let (low, high) = self.interval();
        write!(f, "{:.1} % [{:.1}, {:.1}]", 100.0 * self.value(), 100.0 * low, 100.0 * high)
    }
}

/// Figures of many answers.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Metrics {
    /// Samples with an interaction whose action and target are both right.
    pub hoi: Share,
    /// Those whose action is right.
    pub action: Share,
    /// Those whose target is right.
    pub object: Share,
    /// Samples without an interaction of which that is said.
    pub nothing: Share,
    /// Tuples that are told, their probability being high enough, of all samples with an interaction.
    pub told: Share,
    /// Tuples that are right, of those told.
    pub right_of_told: Share,
    /// Samples without an interaction of which a tuple is told.
    pub false_alarms: Share,
    /// Row by row: true action, columns: said action; the last of each is none.
    pub confusion: Vec<Vec<u32>>,
    /// Hits of tuples by said probability, in tenths.
    pub reliability: Vec<Share>,
    /// Sum of said probabilities in each of these.
    said: Vec<f64>,
}

/// Probability that both are right, as far as the network tells.
pub fn tuple_probability(answer: &Answer) -> Option<(usize, usize, f32)> {
    let (action, p) = Answer::best(&answer.actions)?;
    let (target, q) = Answer::best(&answer.targets)?;
    (action + 1 < answer.actions.len()).then_some((action, target, p * q))
}

impl Metrics {
    /// None yet; `actions` counts that of none.
    pub fn new(actions: usize) -> Self {
        Self {
            confusion: vec![vec![0; actions]; actions],
            reliability: vec![Share::default(); BINS],
            said: vec![0.0; BINS],
            ..Self::default()
        }
    }

    /// Of all answers, tuples below `least` not being told.
    pub fn of<'a>(answers: impl IntoIterator<Item = (&'a Answer, &'a Sample)>, least: f32) -> Self {
        let mut metrics = Self::default();
        for (answer, sample) in answers {
            if metrics.confusion.is_empty() {
                metrics = Self::new(answer.actions.len());
            }
            metrics.add(answer, sample, least);
        }
        metrics
    }

    /// Counts one answer.
    pub fn add(&mut self, answer: &Answer, sample: &Sample, least: f32) {
        let Some((said, _)) = Answer::best(&answer.actions) else { return };
        let none = answer.actions.len() - 1;
        self.confusion[sample.action.unwrap_or(none)][said] += 1;
        let tuple = tuple_probability(answer);
        let told = tuple.filter(|&(_, _, p)| p >= least);
        let (Some(action), Some(target)) = (sample.action, sample.target) else {
            self.nothing.add(said == none);
            self.false_alarms.add(told.is_some());
            return;
        };
        let object = Answer::best(&answer.targets).is_some_and(|(tag, _)| tag == target);
        self.action.add(said == action);
        self.object.add(object);
        let hit = said == action && object;
        self.hoi.add(hit);
        self.told.add(told.is_some());
        if told.is_some() {
            self.right_of_told.add(hit);
        }
        if let Some((_, _, p)) = tuple {
            let bin = ((p * BINS as f32) as usize).min(BINS - 1);
            self.reliability[bin].add(hit);
            self.said[bin] += f64::from(p);
        }
    }

    /// Expected calibration error: mean distance between said and true probability of tuples (Guo et al. 2017).
    pub fn calibration_error(&self) -> f64 {
        let all: f64 = self.reliability.iter().map(|bin| f64::from(bin.of)).sum();
        let error = |(bin, said): (&Share, &f64)| (f64::from(bin.hits) - said).abs();
        self.reliability.iter().zip(&self.said).map(error).sum::<f64>() / all.max(1.0)
    }
}

/// Mean of several runs and where the true mean lies 19 times of 20 (Student's t); `None` below two runs.
pub fn mean_interval(values: &[f64]) -> Option<(f64, f64)> {
    /// 0.975 quantiles for 1, 2, ... degrees of freedom.
    const T975: [f64; 9] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262];
    let n = values.len();
    let degrees = n.checked_sub(2)?;
    let mean = values.iter().sum::<f64>() / n as f64;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1) as f64;
    let t = T975.get(degrees).copied().unwrap_or(Z95);
    Some((mean, t * (variance / n as f64).sqrt()))
}

/// The value in the middle, of two the larger; `None` without any.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(actions: &[f32], targets: &[f32]) -> Answer {
        Answer { actions: actions.to_vec(), targets: targets.to_vec() }
    }

    #[test]
    fn counts_as_the_paper_does() {
        let sample = |action, target| Sample { action, target, ..Sample::default() };
        let cases = [
            (answer(&[0.9, 0.05, 0.05], &[0.8, 0.2]), sample(Some(0), Some(0))),
            (answer(&[0.9, 0.05, 0.05], &[0.2, 0.8]), sample(Some(0), Some(0))),
            (answer(&[0.2, 0.1, 0.7], &[0.9, 0.1]), sample(Some(1), Some(0))),
            (answer(&[0.1, 0.2, 0.7], &[0.5, 0.5]), sample(None, None)),
            (answer(&[0.6, 0.3, 0.1], &[1.0, 0.0]), sample(None, None)),
        ];
        let metrics = Metrics::of(cases.iter().map(|(a, s)| (a, s)), 0.7);
        assert_eq!(metrics.hoi, Share { hits: 1, of: 3 });
        assert_eq!(metrics.action, Share { hits: 2, of: 3 });
        assert_eq!(metrics.object, Share { hits: 2, of: 3 });
        assert_eq!(metrics.nothing, Share { hits: 1, of: 2 });
        assert_eq!(metrics.told, Share { hits: 2, of: 3 });
        assert_eq!(metrics.right_of_told, Share { hits: 1, of: 2 });
        assert_eq!(metrics.false_alarms, Share { hits: 0, of: 2 });
        assert_eq!(metrics.confusion, [[2, 0, 0], [0, 0, 1], [1, 0, 1]]);
        // Two tuples said with 0.72, one of them right.
        assert!((metrics.calibration_error() - 0.22).abs() < 1e-6);
    }

    #[test]
    fn intervals_are_those_of_the_books() {
        // Wilson's interval of 8 of 10 (Newcombe 1998 gives 0.4902 to 0.9433).
        let (low, high) = Share { hits: 8, of: 10 }.interval();
        assert!((low - 0.4902).abs() < 1e-4 && (high - 0.9433).abs() < 1e-4);
        assert_eq!(Share { hits: 0, of: 31 }.interval().0, 0.0);
        assert_eq!(Share { hits: 31, of: 31 }.interval().1, 1.0);
        let (mean, half) = mean_interval(&[1.0, 2.0, 3.0]).unwrap();
        assert!((mean - 2.0).abs() < 1e-9 && (half - 4.303 / 3f64.sqrt()).abs() < 1e-9);
        assert_eq!(mean_interval(&[1.0]), None);
    }
}
