//! One branch of the network with an action's head, trained on real recordings and held against others.

use std::path::Path;

use anyhow::{Context, ensure};
use rfhoi::atomic;
use rfhoi::real::Real;
use rfhoi_network::config::NetworkConfig;
use rfhoi_network::metrics::Share;
use rfhoi_network::model::Description;
use rfhoi_network::sample::{Answer, Sample};
use rfhoi_network::train::{self, Folder, Material, Recipe, train};
use serde::Serialize;
use serde_json::Value;

use crate::commands::train::Live;

/// What is learnt from, and what is held against.
pub(super) struct Trial<'a> {
    pub(super) name: String,
    pub(super) config: &'a NetworkConfig,
    pub(super) recipe: &'a Recipe,
    /// Vectors of the tags' names.
    pub(super) names: &'a [Vec<f32>],
    pub(super) classes: &'a [String],
    pub(super) learn: &'a [&'a Sample],
    pub(super) test: &'a [&'a Sample],
}

/// What was reached.
#[derive(Debug, Serialize)]
pub(super) struct Reached {
    pub(super) name: String,
    pub(super) learnt: usize,
    pub(super) parameters: usize,
    pub(super) right: Share,
    pub(super) accuracy: String,
    /// Row by row: what was done; columns: what was said.
    pub(super) confusion: Vec<Vec<u32>>,
}

impl Trial<'_> {
    /// Trains in a folder of its own below `out`, where a run that was stopped goes on.
    pub(super) fn run(&self, out: &Path) -> anyhow::Result<(Reached, Vec<Answer>)> {
        let Self { name, config, recipe, names, classes, learn, test } = self;
        ensure!(!learn.is_empty(), "{name}: nothing is left to learn from");
        ensure!(!test.is_empty(), "{name}: there is nothing to be tested on");
        let out = out.join(name);
        std::fs::create_dir_all(&out).with_context(|| format!("cannot make the folder {}", out.display()))?;
        let material = Material {
            samples: learn,
            beside: &[],
            // What is tested says nothing, not even when to stop.
            validation: &[],
            names,
            interchangeable: (&[], &[]),
            reversed: &[],
        };
        let mut description = Description::new((*config).clone(), Value::Null, "none".into(), 0);
        description.actions = classes.to_vec();
        let mut live = Live::new(name, Some(out.join("history.csv")), &[])?;
        let trained = train(&description, None, recipe, material, Some(&Folder(out.join("run"))), &mut live)?;
        drop(live);
        atomic::write(out.join("model.safetensors"), &trained.model.to_bytes()?)?;
        let network = trained.model.network(&train::device())?;
        let answers = train::answers(&network, config, test, names)?;
        let (mut right, mut confusion) = (Share::default(), vec![vec![0; classes.len()]; classes.len()]);
        for (answer, sample) in answers.iter().zip(*test) {
            let (Some((said, _)), Some(done)) = (Answer::best(&answer.actions), sample.action) else {
                continue;
            };
            right.add(said == done);
            confusion[done][said] += 1;
        }
        let reached = Reached {
            name: name.clone(),
            learnt: learn.len(),
            parameters: trained.model.parameters(),
            right,
            accuracy: right.to_string(),
            confusion,
        };
        Ok((reached, answers))
    }
}

/// Learns from all recordings but those of `people`, and is held against theirs.
pub(super) fn without(
    real: &Real,
    people: &[u32],
    name: String,
    (config, recipe): (&NetworkConfig, &Recipe),
    out: &Path,
) -> anyhow::Result<Reached> {
    let (learn, test) = real.without(people);
    let (learn, test) = (real.at(&learn), real.at(&test));
    let Real { names, classes, .. } = real;
    let trial = Trial { name, config, recipe, names, classes, learn: &learn, test: &test };
    Ok(trial.run(out)?.0)
}

/// All trials together.
pub(super) fn together<'a>(all: impl IntoIterator<Item = &'a Reached>) -> Share {
    all.into_iter().fold(Share::default(), |sum, reached| Share {
        hits: sum.hits + reached.right.hits,
        of: sum.of + reached.right.of,
    })
}
