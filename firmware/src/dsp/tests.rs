//! The stages against double precision, and what they must make of known scenes.

mod accuracy;
mod scenes;
