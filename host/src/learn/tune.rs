//! Fine-tuning on a part of a set.

use rfhoi_network::model::Model;
use rfhoi_network::sample::Sample;
use rfhoi_network::train::{self, Folder, Material, Recipe, TrainError, Trained, Watch};
use serde_json::json;

use super::{Data, LEAST_PROBABILITY, Split, calibrate};

/// Share of the samples to learn from that is held back to learn how much probabilities are to be believed.
const HELD_BACK: f64 = 0.1;

/// What is learnt from in tuning.
#[derive(Debug, Clone, Copy)]
pub struct Lesson<'a> {
    /// The set.
    pub data: &'a Data,
    /// Which of its samples.
    pub split: &'a Split,
    /// Samples of another set, as [`Recipe::beside`] says, whose objects have the same numbers.
    pub beside: &'a [&'a Sample],
}

/// Tunes `from` on a lesson. A tenth of the split's part to learn from is held back: from it comes the temperature of the model's
/// probabilities.
///
/// # Errors
/// As [`train::train`].
pub fn tune(
    from: &Model,
    Lesson { data, split, beside }: Lesson<'_>,
    recipe: &Recipe,
    command: &str,
    folder: Option<&Folder>,
    watch: &mut dyn Watch,
) -> Result<Trained, TrainError> {
    let held_back = (split.learn.len() as f64 * HELD_BACK) as usize;
    let (held_back, learn) = split.learn.split_at(held_back);
    let (samples, held_back) = (data.samples(learn), data.samples(held_back));
    let mut description = from.description.clone();
    description.temperature = 1.0;
    description.least_probability = LEAST_PROBABILITY;
    if let Some(steps) = description.provenance["steps"].as_array_mut() {
        steps.push(json!({
            "command": command,
            "domain": data.set.domain,
            "set_seed": data.set.seed,
            "samples": samples.len(),
            "recipe": recipe,
        }));
    }
    let material = Material { beside, ..data.material(&samples, &[]) };
    let mut tuned = train::train(&description, Some(from), recipe, material, folder, watch)?;
    if !held_back.is_empty() {
        let network = tuned.model.network(&train::device())?;
        let answers = train::answers(&network, &description.config, &held_back, &data.names)?;
        tuned.model.description.temperature = calibrate(&answers, &held_back);
    }
    Ok(tuned)
}
