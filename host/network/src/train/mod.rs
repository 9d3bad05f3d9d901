//! Training: AdamW on `loss = action + alpha x target` (section 3.3.4 of the paper), resumable, early-stopped.
//!
//! ```text
//! samples --shuffle by seed and epoch--> [loader: augment, pad, other thread] --> forward, backward, step
//!                                                     validation --> best weights, early stop, checkpoint
//! ```
//!
//! All that is random follows from the seed and the epoch's number, so a run that was killed goes on as if it had not been.

mod augment;
mod checkpoint;
mod learner;
mod loader;

use std::path::PathBuf;

use burn::grad_clipping::GradientClippingConfig;
use burn::module::Module;
use burn::optim::{AdamWConfig, GradientsParams};
use burn::tensor::Device;
use serde::{Deserialize, Serialize};

pub use augment::Augment;
pub use checkpoint::{CheckpointError, State};

use crate::config::{ConfigError, NetworkConfig};
use crate::metrics::Metrics;
use crate::model::{Description, Model, ModelError};
use crate::network::{Batch, BatchError, NameVectors, Network, Output};
use crate::sample::{Answer, Sample};
use learner::{Labels, Learner, loss};
use loader::{Loader, Step};

/// Norm to which a parameter's gradient is clipped.
const CLIP: f32 = 1.0;
/// Samples of a batch where nothing is learnt.
const EVALUATION_BATCH: usize = 32;

/// How to train.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Epochs at most.
    pub epochs: u32,
    /// Epochs without a better validation after which to stop; 0 is never.
    pub patience: u32,
    /// Samples of a batch.
    pub batch: usize,
    /// Highest learning rate; it rises over the first epoch and falls as a cosine.
    pub learning_rate: f64,
    /// Decay of weights.
    pub weight_decay: f64,
    /// Weight of the target's loss, alpha.
    pub target_weight: f64,
    /// Share of a label that is spread over all classes.
    pub smoothing: f64,
    /// Weight of the loss of where the person is and looks, which the radar's features have to tell beside; 0 is without.
    /// Which way something moves is worth little as long as the network does not know which way the person looks.
    pub pose_weight: f64,
    /// Of [`Material::beside`], so many are drawn for each sample to learn from.
    #[serde(default)]
    pub beside: f64,
    /// What is done to samples.
    pub augment: Augment,
    /// Seed of weights, order, augmentation and dropout.
    pub seed: u64,
}

impl Recipe {
    /// From nothing.
    pub fn pre_training(seed: u64) -> Self {
        Self {
            epochs: 10,
            patience: 0,
            batch: 32,
            learning_rate: 2e-3,
            weight_decay: 1e-2,
            target_weight: 0.5,
            smoothing: 0.05,
            pose_weight: 0.5,
            beside: 0.0,
            augment: Augment::default(),
            seed,
        }
    }

    /// From a network that is trained, on few samples.
    pub fn fine_tuning(seed: u64) -> Self {
        Self { epochs: 20, batch: 16, learning_rate: 5e-4, ..Self::pre_training(seed) }
    }
}

/// What to learn from.
#[derive(Debug, Clone, Copy)]
pub struct Material<'a> {
    /// Samples to learn from.
    pub samples: &'a [&'a Sample],
    /// Others, of which each epoch draws some: what was learnt before is not forgotten for a few samples' sake.
    pub beside: &'a [&'a Sample],
    /// Samples that say when to stop; may be empty, then the last epoch counts.
    pub validation: &'a [&'a Sample],
    /// Vectors of names, by the samples' numbers of objects.
    pub names: &'a NameVectors,
    /// Numbers of objects of which one may stand for another where the action is the same for both (algorithm 1 of the
    /// paper), and the actions of which that holds.
    pub interchangeable: (&'a [usize], &'a [usize]),
    /// What each action is when it is played backwards; empty where nobody knows.
    pub reversed: &'a [usize],
}

impl Material<'_> {
    /// Samples of those beside that an epoch draws.
    fn drawn(&self, recipe: &Recipe) -> usize {
        let wanted = (self.samples.len() as f64 * recipe.beside).round() as usize;
        wanted.min(self.beside.len())
    }

    /// Samples that an epoch learns from.
    fn in_an_epoch(&self, recipe: &Recipe) -> usize {
        self.samples.len() + self.drawn(recipe)
    }
}

/// One epoch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Epoch {
    /// Its number, from 0.
    pub epoch: u32,
    /// Mean loss of its batches.
    pub loss: f64,
    /// HOI accuracy on the batches it learnt from.
    pub training_hoi: f64,
    /// HOI, action and object accuracy on validation, and its loss.
    pub validation: Option<[f64; 4]>,
    /// Samples a second.
    pub samples_per_s: f64,
}

/// What training tells while it runs. Returning `false` stops it after the batch.
pub trait Watch {
    /// A batch of the epoch is done: which, of how many, and the loss.
    fn batch(&mut self, epoch: u32, batch: usize, of: usize, loss: f64) -> bool;
    /// An epoch is done.
    fn epoch(&mut self, epoch: &Epoch);
}

/// Why there is no trained network.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The network.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A sample.
    #[error(transparent)]
    Batch(#[from] BatchError),
    /// The model to begin with.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Files of the run.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Loss is no number.
    #[error("the loss is no number in epoch {epoch}: try a smaller learning rate than {rate}")]
    Diverged {
        /// Epoch.
        epoch: u32,
        /// Its learning rate.
        rate: f64,
    },
    /// Nothing to learn from.
    #[error("there is no sample to learn from")]
    NoSamples,
    /// The user stopped it.
    #[error("stopped; the same command goes on after the last complete epoch")]
    Interrupted,
}

/// Where a run keeps what it needs to go on.
#[derive(Debug, Clone)]
pub struct Folder(pub PathBuf);

/// A trained network and how it came about.
#[derive(Debug, Clone)]
pub struct Trained {
    /// The best on validation, or the last without one.
    pub model: Model,
    /// All epochs.
    pub history: Vec<Epoch>,
    /// Which the model is of.
    pub best_epoch: u32,
}

/// The device to train on.
pub fn device() -> Device {
    Device::flex().autodiff()
}

/// Trains the network of `description` from random weights, or from those of `from`. With a `folder`, goes on where a killed run
/// of the same recipe was.
///
/// # Errors
/// If anything does not fit, files cannot be written, or `watch` says stop.
pub fn train(
    description: &Description,
    from: Option<&Model>,
    recipe: &Recipe,
    material: Material<'_>,
    folder: Option<&Folder>,
    watch: &mut dyn Watch,
) -> Result<Trained, TrainError> {
    if material.samples.is_empty() {
        return Err(TrainError::NoSamples);
    }
    let device = device();
    let config = &description.config;
    device.seed(recipe.seed);
    let network = match from {
        Some(model) => model.network(&device)?.train(),
        None => Network::new(config, &device)?,
    };
    let mut learner = Learner::new(network, config, recipe, &device);
    let mut optimiser = AdamWConfig::new()
        .with_weight_decay(recipe.weight_decay as f32)
        .with_grad_clipping(Some(GradientClippingConfig::Norm(CLIP)))
        .init();
    let mut state = State::default();
    if let Some(folder) = folder {
        let kept = checkpoint::load(folder, description, from, recipe)?;
        if let Some(kept) = kept {
            learner = learner.load_record(kept.learner);
            optimiser = optimiser.load_record(kept.optimiser);
            state = kept.state;
        }
    }
    let mut best = match folder {
        Some(folder) if state.best.is_some() => Some(checkpoint::best(folder)?),
        _ => None,
    };
    let batches = material.in_an_epoch(recipe).div_ceil(recipe.batch);
    while !state.is_over(recipe) {
        let epoch = state.history.len() as u32;
        // Dropout draws from the device.
        device.seed(recipe.seed ^ u64::from(epoch + 1) << 32);
        let began = std::time::Instant::now();
        let (mut losses, mut hits) = (0.0, 0);
        let loader = Loader { config, recipe, material, device: &device };
        let stopped = loader.each(epoch, |number, step| {
            let Step { batch, labels } = step;
            let (out, pose) = learner.forward(&batch);
            hits += hits_of(&out, &labels);
            let loss = loss(&out, pose, &labels, recipe, &device);
            let value: f64 = loss.clone().into_scalar::<f32>().into();
            if !value.is_finite() {
                let rate = recipe.rate(epoch, number, batches);
                return Err(TrainError::Diverged { epoch, rate });
            }
            let gradients = GradientsParams::from_grads(loss.backward(), &learner);
            let rate = recipe.rate(epoch, number, batches);
            learner = optimiser.step(rate, learner.clone(), gradients);
            losses += value;
            Ok(watch.batch(epoch, number, batches, value))
        })?;
        if stopped {
            return Err(TrainError::Interrupted);
        }
        let validation = match material.validation {
            [] => None,
            validation => {
                let answers = answers(&learner.network, config, validation, material.names)?;
                Some(validated(&answers, validation, recipe))
            }
        };
        let entry = Epoch {
            epoch,
            loss: losses / batches as f64,
            training_hoi: f64::from(hits) / material.in_an_epoch(recipe) as f64,
            validation,
            samples_per_s: material.in_an_epoch(recipe) as f64 / began.elapsed().as_secs_f64(),
        };
        watch.epoch(&entry);
        if state.take(entry) {
            let mut description = description.clone();
            description.provenance = serde_json::Value::Null;
            best = Some(Model::of(&learner.network.valid(), description));
        }
        if let Some(folder) = folder {
            checkpoint::save(folder, &learner, &optimiser, &state, best.as_ref(), recipe, from, description)?;
        }
    }
    let mut model = best.ok_or(TrainError::NoSamples)?;
    model.description = description.clone();
    Ok(Trained { model, best_epoch: state.best.unwrap_or(0), history: state.history })
}

impl Recipe {
    /// Learning rate of a batch.
    fn rate(&self, epoch: u32, batch: usize, batches: usize) -> f64 {
        let (at, all) =
            (f64::from(epoch) * batches as f64 + batch as f64, f64::from(self.epochs) * batches as f64);
        let warm = (at + 1.0) / batches as f64;
        let cosine = 0.5 * (1.0 + (core::f64::consts::PI * at / all).cos());
        // Never to nothing, so that the last epochs still count.
        self.learning_rate * warm.min(1.0) * cosine.max(0.01)
    }
}

fn hits_of(out: &Output, labels: &Labels) -> u32 {
    let answers = out.answers(1.0);
    let hit = |(answer, (action, target)): (&Answer, (&usize, &Option<usize>))| {
        let action = Answer::best(&answer.actions).is_some_and(|(best, _)| best == *action);
        let target = target.is_none_or(|t| Answer::best(&answer.targets).is_some_and(|(best, _)| best == t));
        u32::from(action && target)
    };
    answers.iter().zip(labels.actions.iter().zip(&labels.targets)).map(hit).sum()
}

/// Answers of a network to samples, in batches; f32.
///
/// # Errors
/// If a sample does not fit.
pub fn answers(
    network: &Network,
    config: &NetworkConfig,
    samples: &[&Sample],
    names: &NameVectors,
) -> Result<Vec<Answer>, BatchError> {
    let device = device().inner();
    let network = network.valid();
    let mut order: Vec<usize> = (0..samples.len()).collect();
    order.sort_by_key(|&place| samples[place].frames.len());
    let mut answers = vec![None; samples.len()];
    for places in order.chunks(EVALUATION_BATCH) {
        let part: Vec<_> = places
            .iter()
            .map(|&place| {
                let sample = samples[place];
                (&sample.frames, sample.objects.iter().map(|&o| names[o].as_slice()).collect())
            })
            .collect();
        let batch = Batch::new(config, &part, &device)?;
        for (&place, mut answer) in places.iter().zip(network.forward(&batch).answers(1.0)) {
            answer.targets.truncate(samples[place].frames.tags);
            answers[place] = Some(answer);
        }
    }
    Ok(answers.into_iter().flatten().collect())
}

fn validated(answers: &[Answer], samples: &[&Sample], recipe: &Recipe) -> [f64; 4] {
    let metrics = Metrics::of(answers.iter().zip(samples.iter().copied()), 0.0);
    let mut loss = 0.0;
    for (answer, sample) in answers.iter().zip(samples) {
        let log = |p: f32| -f64::from(p.max(1e-12)).ln();
        loss += log(answer.actions[sample.action.unwrap_or(answer.actions.len() - 1)]);
        loss += sample.target.map_or(0.0, |target| recipe.target_weight * log(answer.targets[target]));
    }
    let share = |share: crate::metrics::Share| if share.of == 0 { 0.0 } else { share.value() };
    [share(metrics.hoi), share(metrics.action), share(metrics.object), loss / answers.len() as f64]
}
