//! The simulator: a room, a person, tagged things, as the radar and the reader would see them.
//!
//! One moving scene feeds both radios, so that they agree in time and place:
//!
//! ```text
//! scene.toml ---> [scene::Scene] --------------------------------------------+----------------+
//! label, person, place --> [perform]  a person and things in motion          |                |
//! recorded joints -------> [recorded] the same, after a recording            |                |
//! OBJ files -------------> [meshes]   the same, as meshes                    |                |
//!                               | [Performance]: vertices, tags, blockers    |                |
//!                               +--> [radar]: facets -> paths -> range spectra of the gate ---+--> maps, covariance
//!                               |             (`spectrum`), or samples (`adc`) -> datagrams   |
//!                               +--> [rfid]: inventory -> tag reads -> LLRP reports ----------+--> reads
//! ```
//!
//! Room coordinates are right-handed: x to the right and y into the room as seen from the radar's wall, z up from the
//! floor; metres, seconds, radians. A time of 0 s is the beginning of the sample.
//!
//! What is computed beyond the direct paths is a matter of [`effects`], each a switch. What makes it harder for people and
//! networks alike, fingers on a tag or a second person, is a [`circumstance`], one at most. A [`sample`] is one performance as
//! both see it; [`draw`] says what it is about, [`set`] writes many, [`recording`] writes one, or
//! several as one [`session`], at the level of the wire.
//! [`picture`] draws a sample for people to see what it is of, [`portrait`] has one sit for it.

pub mod body;
pub mod circumstance;
pub mod cost;
pub mod draw;
pub mod effects;
pub(crate) mod grasp;
pub mod meshes;
pub mod perform;
mod performance;
pub mod picture;
pub mod portrait;
pub mod radar;
pub mod recorded;
pub mod recording;
pub mod rfid;
pub mod sample;
pub mod scene;
pub mod session;
pub mod set;
mod shape;
mod stage;
mod thing;

pub use performance::{Capsule, Performance, Surface};
