//! The maps of a radar frame, as the network takes them: squares of `points` x `points`, each from 0 to 1.
//!
//! In: the codes of a bridge's heatmaps ([`HeatMap`](crate::receive::HeatMap)), or raw samples of a frame ([`raw`]). Out: the
//! map, and what is wrong with it, if anything ([`Flaw`]). [`VelocityGuard`] tells whether a frame's velocities are what they
//! seem.
//!
//! ```text
//! RadarFrame -----------------------------> codes --+--> floor, peak --> flaw
//! words --[raw::RawMaps]--> powers --dB--> levels --+--> resample --> 0 to 1
//! ```

mod flaw;
mod pair;
pub mod raw;
mod resample;
mod unit;
mod velocity;

pub use flaw::{Flaw, MapState};
pub use pair::{MapPair, PairState};
pub use resample::{Levels, MAX_POINTS, MIN_POINTS, PointsOutside, Resampler};
pub use unit::AngleSquare;
pub use velocity::{Velocity, VelocityGuard};
