//! The fusion network of RF-HOI: which action, on which of the tags that are present.
//!
//! ```text
//! frame --maps, scalars--> [map encoders] --> radar token --+--(all frames)--> [temporal] --> pool --+
//!       --reads, by tag--> [phase encoder] -> tag token ----+--(all frames)--> [temporal] --> pool --+--> [fusion] --> action
//! names -----------------> [name projection] ------------------------------------------------------ +             +--> target
//! ```
//!
//! * [`sample`]: what goes in and comes out, by shape and unit.
//! * [`config`]: the shape of a network.
//! * [`network`]: the network as Burn modules, [`model`]: as a file.
//! * [`execute`]: the network without Burn, in int8.
//! * [`metrics`]: how good answers are.
//! * `train`, with the feature of that name: training.

pub mod config;
pub mod execute;
pub mod metrics;
pub mod model;
pub mod network;
mod positions;
mod probability;
pub mod sample;
#[cfg(feature = "train")]
pub mod train;
