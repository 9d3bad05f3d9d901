//! The fusion network of RF-HOI: which action, on which of the tags that are present.
//!
//! ```text
//! frame --maps, scalars--> [map encoders] --> radar token --+--(all frames)--> [temporal] --> pool --+
//!       --reads, by tag--> [phase encoder] -> tag token ----+--(all frames)--> [temporal] --> pool --+--> [fusion] --> action
//!       --reads, by tag--> net turn of each tag over all frames --------------------------------------+             +--> target
//! names -----------------> [name projection] -------------------------------------------------------+
//! ```
//!
//! * [`sample`]: what goes in and comes out, by shape and unit.
//! * [`config`]: the shape of a network.
//! * [`names`]: vectors of the names of things, and how a name is found.
//! * [`network`]: the network as Burn modules, [`model`]: as a file, [`mod@reference`]: a frame at a time.
//! * [`execute`]: the network without Burn, in int8.
//! * [`metrics`]: how good answers are.
//! * `train`, with the feature of that name: training.

pub mod config;
pub mod execute;
mod kept;
pub mod metrics;
pub mod model;
pub mod names;
pub mod network;
mod positions;
mod probability;
pub mod reference;
pub mod sample;
#[cfg(feature = "train")]
pub mod train;
