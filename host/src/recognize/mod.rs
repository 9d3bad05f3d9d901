//! From packets to tuples: who did what to which thing, or why that cannot be told.
//!
//! ```text
//! packets --FrameStream--> AlignedFrame --FrameFeatures--> Frame --> network, as it comes     (encoders run once a frame)
//!                               | moving cells, turns of tags
//!                               +--> [segment]: when something moves --> network's answer --> [outcome]
//!                                                                         +-- what was measured at all --+
//! ```
//!
//! In: packets of a bridge ([`Recognizer::push`]), from the network or out of [`replay::packets`](crate::replay::packets). Out:
//! a [`Recognition`] for each time that something moved. The network always has an opinion; what it was formed on is looked at
//! first, and where that is nothing (no tag read, no radar, no map that can be trusted) no tuple is told.
//!
//! * [`model`]: models that are built in or in files, and what runs them.
//! * [`radar`]: what a model needs the radar to be configured for.
//! * [`tags`]: which tag is on which thing.

pub mod model;
pub mod outcome;
pub mod radar;
mod recognizer;
pub mod segment;
pub mod tags;
#[cfg(test)]
mod tests;
mod window;

pub use outcome::{Guess, Outcome, Recognition, Why};
pub use recognizer::{Recognizer, Settings};

use rfhoi_network::execute::ExecuteError;
use rfhoi_network::model::ModelError;
use rfhoi_network::names::NamesError;
use rfhoi_network::sample::InputError;

use crate::align::AlignError;

/// Why nothing can be recognised.
#[derive(Debug, thiserror::Error)]
pub enum RecognizeError {
    /// The model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The model cannot run.
    #[error(transparent)]
    Execute(#[from] ExecuteError),
    /// The names that this program was built with.
    #[error("the names that this program was built with: {0}")]
    Names(#[from] NamesError),
    /// The model was trained with other vectors.
    #[error(
        "the model was trained with other vectors of names ({trained:08x}) than this program has ({here:08x}): take a model of \
         this version with --model, or none for the one that is built in"
    )]
    OtherNames {
        /// Fingerprint of those that it was trained with.
        trained: u32,
        /// Fingerprint of those here.
        here: u32,
    },
    /// The model says something that is not understood.
    #[error(
        "the model's {0}: it was made by another version; train it anew, or take the one that is built in"
    )]
    Description(String),
    /// The radar is not configured for the model.
    #[error(transparent)]
    Radar(#[from] radar::Mismatch),
    /// No stream of frames.
    #[error("no frames: {0}")]
    Align(#[from] AlignError),
    /// The network.
    #[error("the network refuses what was measured: {0}")]
    Input(#[from] InputError),
}
