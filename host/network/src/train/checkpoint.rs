//! What a run needs to go on after it was killed.

use std::path::{Path, PathBuf};

use burn::module::Module;
use burn::optim::{ModuleOptimizer, OptimizerRecord};
use burn::store::ModuleRecord;
use burn::tensor::Bytes;
use serde::{Deserialize, Serialize};

use super::learner::Learner;
use super::{Epoch, Folder, Recipe};
use crate::model::{Description, Model, ModelError};

const STATE: &str = "state.json";
const BEST: &str = "best.safetensors";

/// How far a run is.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Fingerprint of what the run is.
    run: u64,
    /// Epochs so far.
    pub history: Vec<Epoch>,
    /// Best epoch so far.
    pub best: Option<u32>,
}

/// Why a run cannot be kept or taken up.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// A file.
    #[error("{path}: {source}")]
    File {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// What is in it.
    #[error("{path} is damaged ({why}): remove the folder to begin anew")]
    Damaged {
        /// Which.
        path: PathBuf,
        /// How.
        why: String,
    },
    /// Another run's.
    #[error("{0} holds another run: choose another folder, or remove it")]
    Other(PathBuf),
}

/// A run to go on with.
pub(super) struct Kept {
    pub(super) learner: ModuleRecord,
    pub(super) optimiser: OptimizerRecord,
    pub(super) state: State,
}

impl State {
    /// Takes an epoch. Returns whether it is the best so far.
    pub(super) fn take(&mut self, epoch: Epoch) -> bool {
        // Accuracy first; of equals, the loss.
        let score = |epoch: &Epoch| epoch.validation.map(|[hoi, _, _, loss]| (hoi, -loss));
        let best = self.best.and_then(|best| self.history.get(best as usize));
        let better = match (best.and_then(score), score(&epoch)) {
            (Some(best), Some(new)) => new > best,
            _ => true,
        };
        if better {
            self.best = Some(epoch.epoch);
        }
        self.history.push(epoch);
        better
    }

    /// Whether there is nothing more to do.
    pub(super) fn is_over(&self, recipe: &Recipe) -> bool {
        let epochs = self.history.len() as u32;
        let since = epochs - self.best.map_or(0, |best| best + 1);
        epochs >= recipe.epochs || recipe.patience > 0 && since >= recipe.patience
    }
}

/// FNV-1a of all that decides how a run goes.
fn fingerprint(description: &Description, from: Option<&Model>, recipe: &Recipe) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    let mut add = |bytes: &[u8]| {
        for &byte in bytes {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    add(format!("{:?} {recipe:?} {} {}", description.config, description.angle, description.names).as_bytes());
    if let Some(model) = from {
        add(&model.to_bytes().unwrap_or_default());
    }
    hash
}

fn file(path: &Path) -> impl FnOnce(std::io::Error) -> CheckpointError {
    let path = path.to_path_buf();
    |source| CheckpointError::File { path, source }
}

fn damaged<E: core::fmt::Display>(path: &Path) -> impl FnOnce(E) -> CheckpointError {
    let path = path.to_path_buf();
    move |why| CheckpointError::Damaged { path, why: why.to_string() }
}

/// Network and optimiser of an epoch; the state names the epoch, so that a kill between files loses nothing.
fn names(epoch: usize) -> [String; 2] {
    [format!("epoch-{epoch}.network"), format!("epoch-{epoch}.optimiser")]
}

pub(super) fn load(
    Folder(folder): &Folder,
    description: &Description,
    from: Option<&Model>,
    recipe: &Recipe,
) -> Result<Option<Kept>, CheckpointError> {
    let path = folder.join(STATE);
    if !path.is_file() {
        return Ok(None);
    }
    let text = std::fs::read(&path).map_err(file(&path))?;
    let state: State = serde_json::from_slice(&text).map_err(damaged(&path))?;
    if state.run != fingerprint(description, from, recipe) {
        return Err(CheckpointError::Other(folder.clone()));
    }
    let [network, optimiser] = names(state.history.len()).map(|name| folder.join(name));
    let bytes = |path: &Path| std::fs::read(path).map(Bytes::from_bytes_vec).map_err(file(path));
    let record = ModuleRecord::from_bytes(bytes(&network)?).map_err(damaged(&network))?;
    let kept = OptimizerRecord::from_bytes(bytes(&optimiser)?).map_err(damaged(&optimiser))?;
    Ok(Some(Kept { learner: record, optimiser: kept, state }))
}

pub(super) fn best(Folder(folder): &Folder) -> Result<Model, CheckpointError> {
    let path = folder.join(BEST);
    let bytes = std::fs::read(&path).map_err(file(&path))?;
    Model::from_bytes(&bytes).map_err(damaged(&path))
}

#[allow(clippy::too_many_arguments, reason = "all that a run is")]
pub(super) fn save(
    Folder(folder): &Folder,
    learner: &Learner,
    optimiser: &ModuleOptimizer,
    state: &State,
    best: Option<&Model>,
    recipe: &Recipe,
    from: Option<&Model>,
    description: &Description,
) -> Result<(), CheckpointError> {
    std::fs::create_dir_all(folder).map_err(file(folder))?;
    let epoch = state.history.len();
    let [network_path, optimiser_path] = names(epoch).map(|name| folder.join(name));
    let record = learner.clone().into_record().into_bytes().map_err(damaged(&network_path))?;
    write(&network_path, &record)?;
    write(&optimiser_path, &optimiser.into_bytes().map_err(damaged(&optimiser_path))?)?;
    if let (Some(best), Some(number)) = (best, state.best)
        && number as usize + 1 == epoch
    {
        let path = folder.join(BEST);
        let bytes = best.to_bytes().map_err(|error: ModelError| damaged(&path)(error))?;
        write(&path, &bytes)?;
    }
    let state = State { run: fingerprint(description, from, recipe), ..state.clone() };
    let path = folder.join(STATE);
    let text = serde_json::to_vec_pretty(&state).map_err(damaged(&path))?;
    write(&path, &text)?;
    // The epoch before is no longer needed.
    for name in names(epoch.wrapping_sub(1)) {
        let _ = std::fs::remove_file(folder.join(name));
    }
    Ok(())
}

/// Whole, or not there.
fn write(path: &Path, bytes: &[u8]) -> Result<(), CheckpointError> {
    let part = path.with_extension("part");
    std::fs::write(&part, bytes).and_then(|()| std::fs::rename(&part, path)).map_err(file(path))
}
