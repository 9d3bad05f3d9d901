//! The f32 network on Burn, a frame at a time: the reference of the int8 execution.

use std::ops::Range;

use burn::tensor::{Device, Tensor};

use crate::kept::Kept;
use crate::model::{Model, ModelError};
use crate::network::{Batch, FrameTensors, Network};
use crate::sample::{Answer, Frame, Frames, InputError, Runner};

/// Runs an f32 model on Burn.
#[derive(Debug)]
pub struct Reference {
    network: Network,
    description: crate::model::Description,
    device: Device,
    kept: Kept,
}

impl Reference {
    /// A runner of an f32 model on the `ndarray` backend.
    ///
    /// # Errors
    /// If it is none.
    pub fn new(model: &Model) -> Result<Self, ModelError> {
        #[allow(deprecated, reason = "the backend that f32 is asked for on; Burn prefers flex")]
        Self::on(model, Device::ndarray())
    }

    /// A runner of an f32 model on Burn's `flex` backend, which is there for training.
    ///
    /// # Errors
    /// If it is none.
    #[cfg(feature = "train")]
    pub fn on_flex(model: &Model) -> Result<Self, ModelError> {
        Self::on(model, Device::flex())
    }

    fn on(model: &Model, device: Device) -> Result<Self, ModelError> {
        Ok(Self {
            network: model.network(&device)?,
            description: model.description.clone(),
            device,
            kept: Kept::default(),
        })
    }
}

impl Runner for Reference {
    fn push(&mut self, frame: Frame<'_>) -> Result<(), InputError> {
        let config = &self.description.config;
        self.kept.take(config, frame)?;
        let mut one = Frames::new(config.points, 0, 0);
        one.push(Frame { reads: &[], ..frame });
        let tensors = FrameTensors::new(config, [&one].into_iter(), &self.device);
        let mut width = 0;
        if let Some(token) = self.network.embed(&tensors) {
            width = config.radar.width;
            self.kept.tokens.extend(token.into_data().iter::<f32>());
        }
        self.kept.forget(width);
        Ok(())
    }

    fn answer(&mut self, frames: Range<usize>, names: &[f32]) -> Result<Answer, InputError> {
        let config = &self.description.config;
        self.kept.check(config, &frames, names)?;
        let part = self.kept.part(frames.clone());
        let vectors = names.chunks_exact(config.name_dimensions).collect();
        let batch = Batch::without_frames(config, &[(&part, vectors)], &self.device);
        let tokens = (!self.kept.tokens.is_empty()).then(|| {
            let width = config.radar.width;
            let from = (frames.start - self.kept.first) * width;
            let values = &self.kept.tokens[from..from + frames.len() * width];
            Tensor::<1>::from_floats(values, &self.device).reshape([frames.len(), width])
        });
        let out = self.network.decide(tokens, &batch);
        let mut answer = out.answers(self.description.temperature).swap_remove(0);
        answer.targets.truncate(part.tags);
        Ok(answer)
    }

    fn clear(&mut self) {
        self.kept.clear();
    }
}
