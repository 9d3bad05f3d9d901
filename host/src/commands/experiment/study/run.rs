//! One training of a study, and what it reached.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::Args;
use rfhoi::features::AngleMap;
use rfhoi::learn::{self, Data, Timing};
use rfhoi::{atomic, hoi, recognize};
use rfhoi_network::config::NetworkConfig;
use rfhoi_network::execute::{ExecuteError, quantize};
use rfhoi_network::metrics::Metrics;
use rfhoi_network::model::{Description, Model};
use rfhoi_network::train::{self, Folder, Recipe, train};
use rfhoi_shared::fnv;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::commands::Progress;
use crate::commands::train::{Live, MODEL, data, model, names};

/// What a run is.
const RUN: &str = "run.json";
/// What it reached.
pub(super) const RESULT: &str = "result.json";
/// Folder of what a run needs to go on after it was stopped.
const CHECKPOINT: &str = "run";
/// The model in int8.
pub(super) const INT8: &str = "int8.safetensors";

/// A set by its folder's name, as it was.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Source {
    pub(super) name: String,
    /// Of its manifest.
    pub(super) fingerprint: u32,
}

/// Samples to be tested on. The same name may be of other samples in another study of the same run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Test {
    pub(super) name: String,
    pub(super) set: Source,
    pub(super) samples: Vec<usize>,
}

impl Test {
    /// Its name, and the fingerprint of what it is on.
    pub(super) fn key(&self) -> String {
        format!("{}-{}", self.name, fingerprint(&self))
    }
}

/// In hexadecimals, of what something is as JSON. Two of 32 bits, since one alone may meet another's.
fn fingerprint(of: &impl Serialize) -> String {
    let text = serde_json::to_string(of).unwrap_or_default();
    let (low, high) = (fnv::more(fnv::EMPTY, text.as_bytes()), fnv::more(!fnv::EMPTY, text.as_bytes()));
    format!("{high:08x}{low:08x}")
}

/// A run: what decides it, and what is asked of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Run {
    pub(super) training: Training,
    pub(super) tests: Vec<Test>,
    /// Whether its int8 form is measured too, and both are timed.
    pub(super) int8: bool,
}

/// All that decides what is learnt.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Training {
    pub(super) network: NetworkConfig,
    pub(super) angle: AngleMap,
    pub(super) recipe: Recipe,
    /// Folder of the run that it begins with.
    pub(super) from: Option<String>,
    pub(super) set: Source,
    /// Samples to learn from, by number.
    pub(super) learn: Vec<usize>,
}

/// What a run reached.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Reached {
    pub(super) simulated: bool,
    pub(super) parameters: usize,
    pub(super) learnt: usize,
    /// Of training alone, on a machine that may have done more at a time.
    pub(super) seconds: f64,
    pub(super) tests: Vec<Tested>,
    pub(super) quantised: Option<Quantised>,
}

/// A test.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Tested {
    /// [`Test::key`].
    pub(super) key: String,
    pub(super) metrics: Metrics,
}

/// The int8 form, where it can be had, and times of both.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Quantised {
    pub(super) f32_bytes: usize,
    pub(super) f32_timing: Timing,
    pub(super) int8: Option<(usize, Timing, Vec<Tested>)>,
}

impl Run {
    /// Folder of the run: what it is of, and the fingerprint of all that decides it.
    pub(super) fn folder(&self) -> String {
        let Training { set, learn, .. } = &self.training;
        format!("{}-{}-{}", set.name, learn.len(), fingerprint(&self.training))
    }

    /// Whether all that is asked of it is in its folder.
    pub(super) fn is_done(&self, folder: &Path) -> bool {
        let tested = |reached: &Reached| self.tests.iter().all(|test| reached.test(&test.key()).is_some());
        let timed = |reached: &Reached| !self.int8 || reached.quantised.is_some();
        folder.join(MODEL).is_file() && Reached::read(folder).is_ok_and(|r| tested(&r) && timed(&r))
    }

    pub(super) fn write(&self, folder: &Path) -> anyhow::Result<()> {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        Ok(atomic::write(folder.join(RUN), &serde_json::to_vec(self)?)?)
    }
}

impl Reached {
    pub(super) fn read(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join(RESULT);
        let text = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        serde_json::from_slice(&text).with_context(|| format!("{} is damaged: remove it", path.display()))
    }

    pub(super) fn test(&self, key: &str) -> Option<&Metrics> {
        self.tests.iter().find(|test| test.key == key).map(|test| &test.metrics)
    }

    /// The same of its int8 form, where it has one.
    pub(super) fn int8_test(&self, key: &str) -> Option<&Metrics> {
        let (_, _, tests) = self.quantised.as_ref()?.int8.as_ref()?;
        tests.iter().find(|test| test.key == key).map(|test| &test.metrics)
    }
}

/// `rfhoi experiment run`: what a study starts in a process of its own.
#[derive(Debug, Args)]
pub(in super::super) struct RunArgs {
    /// Folder of the data sets.
    #[arg(long, value_name = "DIR")]
    sets: PathBuf,
    /// The run's folder, which holds run.json, beside the folders of the runs that it begins with.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl RunArgs {
    pub(in super::super) fn run(&self, json: bool) -> anyhow::Result<()> {
        let path = self.out.join(RUN);
        let text = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let run: Run = serde_json::from_slice(&text).with_context(|| path.display().to_string())?;
        let names = names()?;
        let before = Reached::read(&self.out).ok().filter(|_| self.out.join(MODEL).is_file());
        let Training { network, angle, from, set, learn, .. } = &run.training;
        let from = match from {
            Some(from) if before.is_none() => Some(model(&self.out.with_file_name(from).join(MODEL))?),
            _ => None,
        };
        let description = match &from {
            Some(model) => model.description.clone(),
            None => Description::new(network.clone(), Value::Null, angle.to_string(), names.fingerprint()),
        };
        let settings = recognize::model::settings(&description)?;
        let load = |source: &Source| data(&self.sets.join(&source.name), settings, &names);
        let learnt = load(set)?;
        let (trained, seconds) = match &before {
            Some(before) => (model(&self.out.join(MODEL))?, before.seconds),
            None => run.training.train(&self.out, &learnt, description, from.as_ref())?,
        };
        atomic::write(self.out.join(MODEL), &trained.to_bytes()?)?;
        let mut reached = before.unwrap_or_else(|| Reached {
            simulated: true,
            parameters: trained.parameters(),
            learnt: learn.len(),
            seconds,
            tests: Vec::new(),
            quantised: None,
        });
        let network = trained.network(&train::device())?;
        for test in &run.tests {
            if reached.test(&test.key()).is_some() {
                continue;
            }
            let other = if test.set == *set { None } else { Some(load(&test.set)?) };
            let data = other.as_ref().unwrap_or(&learnt);
            let samples = data.samples(&test.samples);
            let answers = train::answers(&network, &trained.description.config, &samples, &data.names)?;
            let metrics = Metrics::of(answers.iter().zip(samples.iter().copied()), learn::LEAST_PROBABILITY);
            reached.tests.push(Tested { key: test.key(), metrics });
        }
        if run.int8 && reached.quantised.is_none() {
            reached.quantised = Some(run.quantised(&trained, &learnt, &self.out)?);
        }
        atomic::write(self.out.join(RESULT), &serde_json::to_vec_pretty(&reached)?)?;
        // What it needed to go on is of no more use; where it cannot be removed it is only in the way.
        let _ = std::fs::remove_dir_all(self.out.join(CHECKPOINT));
        if json {
            println!("{}", serde_json::to_string(&reached)?);
        }
        Ok(())
    }
}

impl Training {
    fn train(
        &self,
        out: &Path,
        data: &Data,
        mut description: Description,
        from: Option<&Model>,
    ) -> anyhow::Result<(Model, f64)> {
        let there = data.set.samples.len();
        ensure!(
            self.learn.iter().all(|&sample| sample < there),
            "{} is not the set that the run was planned on: it has {there} samples",
            self.set.name
        );
        description.maps = data.maps.clone();
        description.actions = hoi::Action::ALL.iter().map(|action| action.name().to_owned()).collect();
        let samples = data.samples(&self.learn);
        let mut live = Live::new("training", Some(out.join("history.csv")), &[])?;
        let began = std::time::Instant::now();
        let folder = Folder(out.join(CHECKPOINT));
        let material = data.material(&samples, &[]);
        let trained = train(&description, from, &self.recipe, material, Some(&folder), &mut live)?;
        Ok((trained.model, began.elapsed().as_secs_f64()))
    }
}

impl Run {
    fn quantised(&self, model: &Model, data: &Data, out: &Path) -> anyhow::Result<Quantised> {
        let calibration = &self.training.learn[..learn::CALIBRATION_SAMPLES.min(self.training.learn.len())];
        let int8 = match quantize(model, &data.samples(calibration), &data.names) {
            Ok(int8) => {
                let mut tests = Vec::new();
                for test in self.tests.iter().filter(|test| test.set == self.training.set) {
                    let progress = Progress::new("measuring int8")?;
                    let samples = data.samples(&test.samples);
                    let metrics = learn::metrics(&int8, data, &samples, &mut |share| progress.show(share))?;
                    tests.push(Tested { key: test.key(), metrics });
                }
                let bytes = int8.to_bytes()?;
                atomic::write(out.join(INT8), &bytes)?;
                Some((bytes.len(), learn::time(&int8, data, 1)?, tests))
            }
            // Burn alone runs such a network.
            Err(ExecuteError::Unsupported(_)) => None,
            Err(error) => return Err(error.into()),
        };
        Ok(Quantised { f32_bytes: model.to_bytes()?.len(), f32_timing: learn::time(model, data, 1)?, int8 })
    }
}
