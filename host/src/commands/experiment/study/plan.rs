//! What has to be trained for some studies: every run once, those that others begin with first.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use rfhoi::features::AngleMap;
use rfhoi::features::set::{self, Listed, Listing};
use rfhoi::learn;
use rfhoi_network::config::NetworkConfig;
use rfhoi_network::train::Recipe;
use serde::Serialize;

use super::run::{Run, Source, Test, Training};
use super::sets;
use crate::commands::train::names;

/// How large studies are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Scale {
    /// Whether it is [`Self::quick`].
    pub(super) quick: bool,
    /// The network that all others are changes of.
    pub(super) network: NetworkConfig,
    /// Samples to pre-train on.
    pub(super) pre_samples: usize,
    pub(super) pre_epochs: u32,
    pub(super) fine_epochs: u32,
    pub(super) scratch_epochs: u32,
    /// Random draws of each training.
    pub(super) seeds: u64,
}

/// Share of the site's samples that is there to be learnt from; the others are tested on (section 4.2 of the paper).
pub(super) const POOL: f64 = 0.3;
/// Share of these that most of the paper's smaller studies learn from.
pub(super) const USUAL: f64 = 0.67;

impl Scale {
    pub(super) fn full() -> Self {
        Self {
            quick: false,
            // Names have as many dimensions as they have; see `Plan::new`.
            network: NetworkConfig::small(1),
            pre_samples: 12_000,
            pre_epochs: 8,
            fine_epochs: 12,
            scratch_epochs: 25,
            seeds: 3,
        }
    }

    /// So small that nothing is learnt.
    pub(super) fn quick() -> Self {
        let mut network = NetworkConfig::small(1);
        network.points = 16;
        for branch in [&mut network.radar, &mut network.tags] {
            (branch.width, branch.layers, branch.feed_forward) = (8, 1, 8);
        }
        Self {
            quick: true,
            network,
            pre_samples: 24,
            pre_epochs: 1,
            fine_epochs: 1,
            scratch_epochs: 1,
            seeds: 1,
        }
    }
}

/// Runs, and the sets that they are of.
pub(super) struct Plan {
    folder: PathBuf,
    listings: BTreeMap<&'static str, Listing>,
    runs: Vec<Run>,
    pub(super) scale: Scale,
}

/// A network, and how the angle map that it looks at is made.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shape {
    pub(super) network: NetworkConfig,
    pub(super) angle: AngleMap,
}

/// With the angle map that ships.
impl From<&NetworkConfig> for Shape {
    fn from(network: &NetworkConfig) -> Self {
        Self { network: network.clone(), angle: AngleMap::Bartlett }
    }
}

/// What a network is before it is fine-tuned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Before {
    /// Pre-trained on simulated samples of other rooms and people.
    PreTrained,
    /// Random.
    Scratch,
}

impl Plan {
    pub(super) fn new(sets: &Path, mut scale: Scale) -> anyhow::Result<Self> {
        scale.network.name_dimensions = names()?.dimensions();
        Ok(Self { folder: sets.to_path_buf(), listings: BTreeMap::new(), runs: Vec::new(), scale })
    }

    /// The set of this name.
    pub(super) fn listing(&mut self, name: &'static str) -> anyhow::Result<&Listing> {
        if !self.listings.contains_key(name) {
            let folder = self.folder.join(name);
            let listing = set::list(&folder).with_context(|| {
                format!(
                    "{} is needed: `rfhoi experiment sets --out {}`",
                    folder.display(),
                    self.folder.display()
                )
            })?;
            self.listings.insert(name, listing);
        }
        Ok(&self.listings[name])
    }

    fn source(&mut self, name: &'static str) -> anyhow::Result<Source> {
        Ok(Source { name: name.to_owned(), fingerprint: self.listing(name)?.fingerprint })
    }

    /// Samples of a set that are of some kind, by number.
    pub(super) fn which(
        &mut self,
        name: &'static str,
        keep: impl Fn(&Listed) -> bool,
    ) -> anyhow::Result<Vec<usize>> {
        let samples = self.listing(name)?.samples.iter().enumerate();
        Ok(samples.filter(|(_, sample)| keep(sample)).map(|(number, _)| number).collect())
    }

    /// The site's samples to learn from, in the order of a draw, and those to be tested on.
    pub(super) fn split(&mut self, name: &'static str, seed: u64) -> anyhow::Result<learn::Split> {
        Ok(learn::random_split(self.listing(name)?.samples.len(), POOL, seed))
    }

    /// A test on these samples.
    pub(super) fn test(
        &mut self,
        name: &str,
        set: &'static str,
        samples: Vec<usize>,
    ) -> anyhow::Result<Test> {
        Ok(Test { name: name.to_owned(), set: self.source(set)?, samples })
    }

    /// Pre-trains a network on a share of the simulated samples for it.
    pub(super) fn pre_train(
        &mut self,
        shape: impl Into<Shape>,
        share: f64,
        change: impl FnOnce(&mut Recipe),
    ) -> anyhow::Result<String> {
        let samples = self.listing(sets::TRAIN)?.samples.len().min(self.scale.pre_samples);
        let count = ((samples as f64 * share).round() as usize).max(1);
        let mut recipe = Recipe { epochs: self.scale.pre_epochs, ..Recipe::pre_training(1) };
        change(&mut recipe);
        let set = self.source(sets::TRAIN)?;
        let learn = (0..count).collect();
        let Shape { network, angle } = shape.into();
        let training = Training { network, angle, recipe, from: None, set, learn };
        Ok(self.add(Run { training, tests: Vec::new(), int8: false }))
    }

    /// Learns a network from samples of a set of the site.
    pub(super) fn learn(
        &mut self,
        shape: impl Into<Shape>,
        before: Before,
        samples: (&'static str, Vec<usize>),
        tests: Vec<Test>,
        change: impl FnOnce(&mut Recipe),
    ) -> anyhow::Result<String> {
        let shape = shape.into();
        match before {
            Before::PreTrained => {
                let from = self.pre_train(shape.clone(), 1.0, |_| {})?;
                self.fine_tune(shape, from, samples, tests, change)
            }
            Before::Scratch => {
                let epochs = self.scale.scratch_epochs;
                let mut recipe = Recipe { epochs, batch: 16, ..Recipe::pre_training(1) };
                change(&mut recipe);
                self.training(shape, recipe, None, samples, tests)
            }
        }
    }

    /// Learns on from what the run in the folder `from` has learnt.
    pub(super) fn fine_tune(
        &mut self,
        shape: impl Into<Shape>,
        from: String,
        samples: (&'static str, Vec<usize>),
        tests: Vec<Test>,
        change: impl FnOnce(&mut Recipe),
    ) -> anyhow::Result<String> {
        let mut recipe = Recipe { epochs: self.scale.fine_epochs, ..Recipe::fine_tuning(1) };
        change(&mut recipe);
        self.training(shape.into(), recipe, Some(from), samples, tests)
    }

    fn training(
        &mut self,
        Shape { network, angle }: Shape,
        recipe: Recipe,
        from: Option<String>,
        (set, learn): (&'static str, Vec<usize>),
        tests: Vec<Test>,
    ) -> anyhow::Result<String> {
        let set = self.source(set)?;
        let training = Training { network, angle, recipe, from, set, learn };
        Ok(self.add(Run { training, tests, int8: false }))
    }

    /// Takes a run, or what else is asked of one that is there; gives its folder.
    pub(super) fn add(&mut self, run: Run) -> String {
        let folder = run.folder();
        match self.runs.iter_mut().find(|there| there.training == run.training) {
            Some(there) => {
                there.int8 |= run.int8;
                let new =
                    run.tests.into_iter().filter(|test| !there.tests.contains(test)).collect::<Vec<_>>();
                there.tests.extend(new);
            }
            None => self.runs.push(run),
        }
        folder
    }

    /// Also measures the int8 form of a run, and times both.
    pub(super) fn quantise(&mut self, folder: &str) {
        self.runs.iter_mut().filter(|run| run.folder() == folder).for_each(|run| run.int8 = true);
    }

    /// Runs that may be done at a time: first those that begin with none.
    pub(super) fn waves(&self) -> [Vec<&Run>; 2] {
        let (first, second) = self.runs.iter().partition(|run| run.training.from.is_none());
        [first, second]
    }
}
