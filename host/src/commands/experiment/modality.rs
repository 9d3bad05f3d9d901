//! `rfhoi experiment modality`.
//!
//! Each training is a run of `rfhoi train` or `finetune` in a folder of its own, so it can be seen, stopped and taken up again;
//! what a folder holds is not done again.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use rfhoi::learn::{self, Timing};
use rfhoi::{atomic, hoi};
use rfhoi_network::metrics::{Metrics, mean_interval};
use rfhoi_network::model::{Model, Precision};
use serde::{Deserialize, Serialize};

use super::runs::{Job, Runs, cores, path};
use crate::commands::train::{MODEL, data, model, names, settings};
use crate::commands::{Progress, listen_for_ctrl_c};

/// Result of a run's folder.
const RESULT: &str = "result.json";

#[derive(Debug, Args)]
pub(super) struct Modality {
    /// Folder of the set to pre-train on.
    #[arg(long, value_name = "DIR")]
    train: PathBuf,
    /// Folder of the set to fine-tune and to measure on.
    #[arg(long, value_name = "DIR")]
    site: PathBuf,
    /// Folder for all runs and the table.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Splits of the site's samples, each with a seed of its own.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=100))]
    seeds: u64,
    /// Share of the site's samples to learn from.
    #[arg(long, default_value_t = 0.3)]
    share: f64,
    /// Networks, by what their heads see.
    #[arg(long, value_delimiter = ',', default_value = "concat,none,rfid,radar")]
    networks: Vec<String>,
    /// Trainings at a time; by default one for each core.
    #[arg(long)]
    workers: Option<usize>,
    /// Epochs of pre-training and of fine-tuning.
    #[arg(long, num_args = 2, value_names = ["PRE", "FINE"])]
    epochs: Option<Vec<u32>>,
}

/// What a network reached with one split.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Reached {
    seed: u64,
    parameters: usize,
    f32: Metrics,
    /// Of the int8 form, where it can be had.
    int8: Option<Metrics>,
    /// Bytes of both files.
    f32_bytes: usize,
    int8_bytes: Option<usize>,
    /// Medians of answers to the longest window, one thread.
    f32_timing: Timing,
    int8_timing: Option<Timing>,
}

/// One row.
#[derive(Debug, Serialize)]
struct Row {
    network: String,
    parameters: usize,
    /// Mean and half of its 95 % interval, percent; of f32, then of int8.
    hoi: Mean,
    action: Mean,
    object: Mean,
    int8_hoi: Option<Mean>,
    f32_answer_ms: f64,
    int8_answer_ms: Option<f64>,
    seeds: Vec<Reached>,
}

#[derive(Debug, Clone, Copy, Serialize)]
struct Mean {
    mean: f64,
    half: Option<f64>,
}

impl Mean {
    fn of(values: &[f64]) -> Self {
        match mean_interval(values) {
            Some((mean, half)) => Self { mean: 100.0 * mean, half: Some(100.0 * half) },
            None => Self { mean: 100.0 * values.iter().sum::<f64>() / values.len() as f64, half: None },
        }
    }
}

impl std::fmt::Display for Mean {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.half {
            Some(half) => write!(f, "{:.2} +- {half:.2}", self.mean),
            None => write!(f, "{:.2}", self.mean),
        }
    }
}

impl Modality {
    pub(super) fn run(&self, json: bool) -> anyhow::Result<()> {
        listen_for_ctrl_c()?;
        ensure!(self.share > 0.0 && self.share < 1.0, "--share must be between 0 and 1");
        let runs = Runs { workers: self.workers.unwrap_or_else(cores) };
        let pre = |network: &str| self.out.join(format!("{network}/pre-training"));
        let fine = |network: &str, seed: u64| self.out.join(format!("{network}/seed-{seed}"));
        let epochs = |which: usize| self.epochs.as_ref().map(|epochs| epochs[which].to_string());
        let mut jobs = Vec::new();
        for network in &self.networks {
            let mut words =
                vec!["train".into(), "--set".into(), path(&self.train), "--fusion".into(), network.clone()];
            words.extend(epochs(0).into_iter().flat_map(|n| ["--epochs".into(), n]));
            jobs.push(Job { out: pre(network), words });
        }
        runs.all(&jobs)?;
        let mut jobs = Vec::new();
        for network in &self.networks {
            for seed in 1..=self.seeds {
                let model = pre(network).join(MODEL);
                let mut words = vec!["finetune".into(), path(&model), "--set".into(), path(&self.site)];
                words.extend(["--share".into(), self.share.to_string()]);
                words.extend(["--split-seed".into(), seed.to_string(), "--seed".into(), seed.to_string()]);
                words.extend(epochs(1).into_iter().flat_map(|n| ["--epochs".into(), n]));
                jobs.push(Job { out: fine(network, seed), words });
            }
        }
        runs.all(&jobs)?;
        let mut rows = Vec::new();
        for network in &self.networks {
            let reached = (1..=self.seeds).map(|seed| self.reached(&fine(network, seed), seed));
            rows.push(Row::of(network, reached.collect::<anyhow::Result<_>>()?));
        }
        let table = table(&rows);
        atomic::write(self.out.join("modality.json"), &serde_json::to_vec_pretty(&rows)?)?;
        atomic::write(self.out.join("modality.txt"), table.as_bytes())?;
        if json {
            println!("{}", serde_json::to_string(&rows)?);
        } else {
            print!("{table}");
        }
        Ok(())
    }

    /// Measures a run, or takes what was measured.
    fn reached(&self, folder: &Path, seed: u64) -> anyhow::Result<Reached> {
        let kept = folder.join(RESULT);
        if let Ok(text) = std::fs::read(&kept) {
            return serde_json::from_slice(&text)
                .with_context(|| format!("{} is damaged: remove it", kept.display()));
        }
        let names = names()?;
        let model = model(&folder.join(MODEL))?;
        let data = data(&self.site, settings(&model)?, &names)?;
        let split = learn::random_split(data.set.samples.len(), self.share, seed);
        let samples = data.samples(&split.test);
        let progress = Progress::new(format!("measuring {}", folder.display()))?;
        let measure =
            |model: &Model| learn::metrics(model, &data, &samples, &mut |share| progress.show(share));
        let f32 = measure(&model)?;
        let calibration = &split.learn[..learn::CALIBRATION_SAMPLES.min(split.learn.len())];
        let quantised = rfhoi_network::execute::quantize(&model, &data.samples(calibration), &data.names);
        let (int8, int8_bytes, int8_timing) = match &quantised {
            Ok(int8) => {
                atomic::write(folder.join("int8.safetensors"), &int8.to_bytes()?)?;
                (Some(measure(int8)?), Some(int8.to_bytes()?.len()), Some(learn::time(int8, &data, 1)?))
            }
            Err(rfhoi_network::execute::ExecuteError::Unsupported(_)) => (None, None, None),
            Err(error) => anyhow::bail!("{error}"),
        };
        ensure!(model.description.precision == Precision::F32, "{} is not f32", folder.display());
        let reached = Reached {
            seed,
            parameters: model.parameters(),
            f32,
            int8,
            f32_bytes: model.to_bytes()?.len(),
            int8_bytes,
            f32_timing: learn::time(&model, &data, 1)?,
            int8_timing,
        };
        atomic::write(&kept, &serde_json::to_vec_pretty(&reached)?)?;
        Ok(reached)
    }
}

impl Row {
    fn of(network: &str, seeds: Vec<Reached>) -> Self {
        let mean = |value: &dyn Fn(&Reached) -> f64| Mean::of(&seeds.iter().map(value).collect::<Vec<_>>());
        let int8 = seeds.iter().all(|reached| reached.int8.is_some());
        let median = |value: &dyn Fn(&Reached) -> f64| {
            let mut values: Vec<f64> = seeds.iter().map(value).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        };
        let hoi8 = |r: &Reached| r.int8.as_ref().map_or(0.0, |m| m.hoi.value());
        let ms8 = |r: &Reached| r.int8_timing.map_or(0.0, |t| t.answer_ms);
        Self {
            network: network.to_owned(),
            parameters: seeds[0].parameters,
            hoi: mean(&|r| r.f32.hoi.value()),
            action: mean(&|r| r.f32.action.value()),
            object: mean(&|r| r.f32.object.value()),
            int8_hoi: int8.then(|| mean(&hoi8)),
            f32_answer_ms: median(&|r| r.f32_timing.answer_ms),
            int8_answer_ms: int8.then(|| median(&ms8)),
            seeds,
        }
    }
}

fn table(rows: &[Row]) -> String {
    let test = rows.first().map_or(0, |row| row.seeds[0].f32.hoi.of);
    let seeds = rows.first().map_or(0, |row| row.seeds.len());
    let mut text = format!(
        "Simulated site, {} categories. Accuracy in percent: mean over {seeds} random splits and half of its 95 % interval,\n\
         {test} samples with an interaction in each test part. Times: from the last frame of 6 s to the answer, one thread.\n\n\
         {:<10} {:>10}  {:>14} {:>14} {:>14} {:>14}  {:>9} {:>9}\n",
        hoi::CATEGORIES.len(),
        "network",
        "parameters",
        "HOI",
        "action",
        "object",
        "HOI, int8",
        "f32, ms",
        "int8, ms"
    );
    for row in rows {
        let optional = |value: Option<String>| value.unwrap_or_else(|| "-".into());
        text.push_str(&format!(
            "{:<10} {:>10}  {:>14} {:>14} {:>14} {:>14}  {:>9.3} {:>9}\n",
            row.network,
            row.parameters,
            row.hoi.to_string(),
            row.action.to_string(),
            row.object.to_string(),
            optional(row.int8_hoi.map(|mean| mean.to_string())),
            row.f32_answer_ms,
            optional(row.int8_answer_ms.map(|ms| format!("{ms:.3}"))),
        ));
    }
    text
}
