//! The maps of a radar frame, as the network takes them: squares of `points` x `points`, each from 0 to 1.
//!
//! In: the codes of a bridge's heatmaps ([`HeatMap`](crate::receive::HeatMap)), or raw samples of a frame. Out: the map, and
//! what is wrong with it, if anything.

pub mod raw;
