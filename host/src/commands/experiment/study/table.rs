//! What a study found, as a table: from the runs of its arms to means with intervals.

use std::path::Path;

use anyhow::{Context, ensure};
use rfhoi::atomic;
use rfhoi_network::metrics::{Metrics, Share, mean_interval, median};
use serde::{Deserialize, Serialize};

use super::run::Reached;
use super::scenes::Costs;
use super::studies::Study;

/// One setting, run once with each seed.
pub(super) struct Arm {
    pub(super) series: String,
    pub(super) at: At,
    /// Each run's folder, and the key of its test.
    pub(super) runs: Vec<(String, String)>,
    /// The paper's HOI accuracy, percent, where it says one.
    pub(super) paper: Option<f64>,
}

/// Where an arm is on the axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub(super) enum At {
    Number(f64),
    Label(String),
    /// Where its training's time is, which is known afterwards.
    Seconds,
}

/// A study's table.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Table {
    pub(super) simulated: bool,
    pub(super) name: String,
    pub(super) title: String,
    pub(super) section: String,
    pub(super) axis: String,
    pub(super) rows: Vec<Row>,
    /// What the rows of scenes cost.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) costs: Vec<Costs>,
}

/// One row.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) series: String,
    pub(super) at: At,
    pub(super) hoi: Mean,
    pub(super) action: Mean,
    pub(super) object: Mean,
    /// The paper's HOI accuracy on its real data, percent.
    pub(super) paper: Option<f64>,
    pub(super) parameters: usize,
    /// Samples learnt from, on average.
    pub(super) learnt: usize,
    /// Of a training, median.
    pub(super) seconds: f64,
    pub(super) int8: Option<Int8>,
}

/// Both forms of a network.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Int8 {
    pub(super) hoi: Mean,
    pub(super) f32_bytes: usize,
    pub(super) int8_bytes: usize,
    /// From the last frame of 6 s to the answer, one thread, medians.
    pub(super) f32_answer_ms: f64,
    pub(super) int8_answer_ms: f64,
}

/// A mean over runs with its 95 % interval, percent: Student's over several runs, Wilson's over the samples of one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Mean {
    pub(super) mean: f64,
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) runs: usize,
    /// Samples of a test, on average.
    pub(super) samples: u32,
}

impl Mean {
    pub(super) fn of(shares: &[Share]) -> Self {
        let values: Vec<f64> = shares.iter().map(|share| share.value()).collect();
        let samples = shares.iter().map(|share| share.of).sum::<u32>() / shares.len().max(1) as u32;
        let (mean, low, high) = match (mean_interval(&values), shares) {
            (Some((mean, half)), _) => (mean, mean - half, mean + half),
            (None, [share, ..]) => {
                let (low, high) = share.interval();
                (share.value(), low, high)
            }
            (None, []) => (f64::NAN, f64::NAN, f64::NAN),
        };
        let percent = |value: f64| 100.0 * value.clamp(0.0, 1.0);
        Self { mean: percent(mean), low: percent(low), high: percent(high), runs: shares.len(), samples }
    }
}

impl std::fmt::Display for Mean {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.1} [{:.1}, {:.1}]", self.mean, self.low, self.high)
    }
}

impl std::fmt::Display for At {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(value) => write!(f, "{}", (value * 10.0).round() / 10.0),
            Self::Label(label) => f.write_str(label),
            Self::Seconds => f.write_str("-"),
        }
    }
}

impl Row {
    fn of(arm: &Arm, folder: &Path) -> anyhow::Result<Self> {
        let reached = arm.runs.iter().map(|(run, key)| {
            let reached = Reached::read(&folder.join(run))?;
            let metrics =
                reached.test(key).cloned().with_context(|| format!("{run} lacks the test {key}"))?;
            Ok((reached, metrics))
        });
        let reached: Vec<(Reached, Metrics)> = reached.collect::<anyhow::Result<_>>()?;
        ensure!(!reached.is_empty(), "{} has no runs", arm.series);
        let mean = |share: fn(&Metrics) -> Share| {
            Mean::of(&reached.iter().map(|(_, metrics)| share(metrics)).collect::<Vec<_>>())
        };
        let seconds =
            median(reached.iter().map(|(reached, _)| reached.seconds).collect()).unwrap_or(f64::NAN);
        let at = match &arm.at {
            At::Seconds => At::Number(seconds),
            at => at.clone(),
        };
        Ok(Self {
            series: arm.series.clone(),
            at,
            hoi: mean(|m| m.hoi),
            action: mean(|m| m.action),
            object: mean(|m| m.object),
            paper: arm.paper,
            parameters: reached[0].0.parameters,
            learnt: reached.iter().map(|(reached, _)| reached.learnt).sum::<usize>() / reached.len(),
            seconds,
            int8: int8(&reached, &arm.runs),
        })
    }
}

fn int8(reached: &[(Reached, Metrics)], runs: &[(String, String)]) -> Option<Int8> {
    let mut shares = Vec::new();
    let (mut f32_ms, mut int8_ms, mut bytes) = (Vec::new(), Vec::new(), (0, 0));
    for ((reached, _), (_, key)) in reached.iter().zip(runs) {
        let quantised = reached.quantised.as_ref()?;
        let (int8_bytes, timing, _) = quantised.int8.as_ref()?;
        shares.push(reached.int8_test(key)?.hoi);
        f32_ms.push(quantised.f32_timing.answer_ms);
        int8_ms.push(timing.answer_ms);
        bytes = (quantised.f32_bytes, *int8_bytes);
    }
    Some(Int8 {
        hoi: Mean::of(&shares),
        f32_bytes: bytes.0,
        int8_bytes: bytes.1,
        f32_answer_ms: median(f32_ms)?,
        int8_answer_ms: median(int8_ms)?,
    })
}

impl Table {
    /// Of `study`, whose runs are in `folder`.
    pub(super) fn of(study: &Study, arms: &[Arm], folder: &Path) -> anyhow::Result<Self> {
        let rows = arms.iter().map(|arm| Row::of(arm, folder)).collect::<anyhow::Result<_>>()?;
        Ok(Self {
            simulated: true,
            name: study.name.into(),
            title: study.title.into(),
            section: study.section.into(),
            axis: study.axis.into(),
            rows,
            costs: Vec::new(),
        })
    }

    pub(super) fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        serde_json::from_slice(&text).with_context(|| format!("{} is no table of a study", path.display()))
    }

    pub(super) fn write(&self, out: &Path) -> anyhow::Result<()> {
        atomic::write(out.join(format!("{}.json", self.name)), &serde_json::to_vec_pretty(self)?)?;
        Ok(atomic::write(out.join(format!("{}.txt", self.name)), self.text().as_bytes())?)
    }

    /// For people: cells as wide as they need.
    pub(super) fn text(&self) -> String {
        let mut text = format!("{} (simulated; the paper's section {})\n", self.title, self.section);
        if let Some(Row { hoi: Mean { runs, samples, .. }, .. }) = self.rows.first() {
            let interval = if *runs > 1 { "Student's over them" } else { "Wilson's over samples" };
            text.push_str(&format!(
                "percent [95 % interval, {interval}]; runs of each: {runs}; tested on about {samples} samples\n"
            ));
        }
        let heads = ["", self.axis.as_str(), "HOI", "action", "object", "paper, HOI", "learnt", "parameters"];
        let mut cells = vec![heads.map(str::to_owned)];
        for row in &self.rows {
            cells.push([
                row.series.clone(),
                row.at.to_string(),
                row.hoi.to_string(),
                row.action.to_string(),
                row.object.to_string(),
                row.paper.map_or("-".into(), |paper| format!("{paper:.1}")),
                row.learnt.to_string(),
                row.parameters.to_string(),
            ]);
        }
        push_columns(&mut text, &cells);
        let both: Vec<(&Row, &Int8)> =
            self.rows.iter().filter_map(|row| Some((row, row.int8.as_ref()?))).collect();
        if !both.is_empty() {
            text.push_str("\nas int8, and from the last frame of 6 s to the answer, one thread\n");
            let heads = ["", "HOI, f32", "HOI, int8", "f32, bytes", "int8, bytes", "f32, ms", "int8, ms"];
            let mut cells = vec![heads.map(str::to_owned)];
            cells.extend(both.iter().map(|(row, int8)| {
                [
                    row.series.clone(),
                    row.hoi.to_string(),
                    int8.hoi.to_string(),
                    int8.f32_bytes.to_string(),
                    int8.int8_bytes.to_string(),
                    format!("{:.3}", int8.f32_answer_ms),
                    format!("{:.3}", int8.int8_answer_ms),
                ]
            }));
            push_columns(&mut text, &cells);
        }
        text
    }
}

fn push_columns<const N: usize>(text: &mut String, cells: &[[String; N]]) {
    let width = |column: usize| cells.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    for row in cells {
        let line: Vec<String> = row
            .iter()
            .zip(widths)
            .enumerate()
            // Words to the left, numbers to the right.
            .map(
                |(n, (cell, width))| {
                    if n == 0 { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
                },
            )
            .collect();
        text.push_str(line.join("  ").trim_end());
        text.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_over_runs_or_over_samples() {
        let share = |hits| Share { hits, of: 100 };
        let one = Mean::of(&[share(90)]);
        assert!((one.low - 82.6).abs() < 0.1 && (one.high - 94.5).abs() < 0.1, "{one}");
        let two = Mean::of(&[share(90), share(92)]);
        // 12.7 times half of their difference, cut at 100.
        assert!((two.mean - 91.0).abs() < 1e-9 && (two.low - 78.3).abs() < 0.1 && two.high == 100.0, "{two}");
        assert_eq!((two.runs, two.samples), (2, 100));
    }

    #[test]
    fn columns_are_even() {
        let mut text = String::new();
        push_columns(&mut text, &[["a", "bcd"].map(String::from), ["efg", "h"].map(String::from)]);
        assert_eq!(text, "a    bcd\nefg    h\n");
    }
}
