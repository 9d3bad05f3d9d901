//! Batches of an epoch, made ready by another thread.

use std::sync::mpsc::sync_channel;

use burn::tensor::Device;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand::seq::index::sample;
use rand_chacha::ChaCha8Rng;

use super::learner::Labels;
use super::{Material, Recipe, TrainError};
use crate::config::NetworkConfig;
use crate::network::Batch;
use crate::sample::Sample;

/// Batches that wait.
const AHEAD: usize = 3;
/// Batches whose samples are sorted by length among each other, so that little is padded.
const SORTED: usize = 8;

pub(super) struct Loader<'a> {
    pub(super) config: &'a NetworkConfig,
    pub(super) recipe: &'a Recipe,
    pub(super) material: Material<'a>,
    pub(super) device: &'a Device,
}

/// A batch and what is right.
pub(super) struct Step {
    pub(super) batch: Batch,
    pub(super) labels: Labels,
}

impl Loader<'_> {
    /// All batches of an epoch, by number. Ends early where `take` says `false`; returns whether it did.
    pub(super) fn each(
        &self,
        epoch: u32,
        mut take: impl FnMut(usize, Step) -> Result<bool, TrainError>,
    ) -> Result<bool, TrainError> {
        let batches = self.batches(epoch);
        std::thread::scope(|scope| {
            let (sender, receiver) = sync_channel(AHEAD);
            scope.spawn(move || {
                for (number, batch) in batches.into_iter().enumerate() {
                    // Hung up: the epoch has ended early.
                    if sender.send(self.step(epoch, number, &batch)).is_err() {
                        return;
                    }
                }
            });
            for (number, step) in receiver.iter().enumerate() {
                if !take(number, step?)? {
                    return Ok(true);
                }
            }
            Ok(false)
        })
    }

    /// The sample at a place: those to learn from first, then those beside.
    fn sample(&self, place: usize) -> &Sample {
        let Material { samples, beside, .. } = self.material;
        match place.checked_sub(samples.len()) {
            Some(place) => beside[place],
            None => samples[place],
        }
    }

    /// Places of the samples, batch by batch.
    fn batches(&self, epoch: u32) -> Vec<Vec<usize>> {
        let Material { samples, beside, .. } = self.material;
        let mut rng = ChaCha8Rng::seed_from_u64(self.recipe.seed);
        rng.set_stream(u64::from(epoch));
        let mut order: Vec<usize> = (0..samples.len()).collect();
        let drawn = sample(&mut rng, beside.len(), self.material.drawn(self.recipe));
        order.extend(drawn.into_iter().map(|place| samples.len() + place));
        order.shuffle(&mut rng);
        for part in order.chunks_mut(SORTED * self.recipe.batch) {
            part.sort_by_key(|&place| self.sample(place).frames.len());
        }
        let mut batches: Vec<Vec<usize>> = order.chunks(self.recipe.batch).map(<[usize]>::to_vec).collect();
        batches.shuffle(&mut rng);
        batches
    }

    fn step(&self, epoch: u32, number: usize, places: &[usize]) -> Result<Step, TrainError> {
        let names = self.material.names;
        let mut rng = ChaCha8Rng::seed_from_u64(self.recipe.seed);
        rng.set_stream(1 << 63 | u64::from(epoch) << 32 | number as u64);
        let changed: Vec<Sample> = places
            .iter()
            .map(|&place| self.recipe.augment.apply(self.sample(place), &self.material, &mut rng))
            .collect();
        let part: Vec<_> = changed
            .iter()
            .map(|s| (&s.frames, s.objects.iter().map(|&o| names[o].as_slice()).collect()))
            .collect();
        let labels = Labels {
            actions: changed.iter().map(|s| s.action.unwrap_or(self.config.actions - 1)).collect(),
            targets: changed.iter().map(|s| s.target).collect(),
            poses: changed.iter().map(|s| s.pose).collect(),
        };
        Ok(Step { batch: Batch::new(self.config, &part, self.device)?, labels })
    }
}
