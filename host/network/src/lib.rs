//! The fusion network of RF-HOI: which action, on which of the tags that are present.
//!
//! ```text
//! frame --maps, scalars--> [map encoders] --> radar token --+--(all frames)--> [temporal] --> pool --+
//!       --reads, by tag--> [phase encoder] -> tag token ----+--(all frames)--> [temporal] --> pool --+--> [fusion] --> action
//! names -----------------> [name projection] ------------------------------------------------------ +             +--> target
//! ```
//!
//! * [`names`]: vectors of the names of things, and how a name is found.
//! * [`sample`]: what goes in and comes out, by shape and unit.

pub mod names;
pub mod sample;
