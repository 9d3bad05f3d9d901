//! Circumstances under which interactions are harder to recognise: those that the paper tries in its section 5.6.
//!
//! In: one of them, or none, in [`Wanted`](super::draw::Wanted). Out: the same people, places, things and labels, performed
//! under it. Its random numbers are a stream of their own ([`Purpose::Circumstance`]): without one, data do not change by a
//! byte.
//!
//! | circumstance | what is other | what stays |
//! |---|---|---|
//! | `hand` | the target's tag is [`COVERED_DB`] weaker while the hand holds it | all else, but for reads that get lost |
//! | `body` | carried things that nothing is done to lie [`BEHIND_M`] behind the person | who, where, which things |
//! | `second-person` | somebody else moves, [`BESIDE_M`] away | what the first person and all tags do |
//!
//! [`Purpose::Circumstance`]: super::draw::Purpose::Circumstance

use std::ops::Range;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::rfid::link::BLOCKAGE_DB;
use super::scene::{Place, Scene};

/// How far what fingers take of a tag's signal is from the mean, to either side, dB: the paper gives the mean alone.
const SPREAD_DB: f32 = 3.0;
/// What fingers take of the signal of the tag that they cover, there and back, dB: evenly drawn, once a sample. The mean is that
/// of the paper's section 5.6.
pub const COVERED_DB: Range<f32> = BLOCKAGE_DB as f32 - SPREAD_DB..BLOCKAGE_DB as f32 + SPREAD_DB;
/// From the middle of a person to that of things behind them, m (section 5.6).
pub const BEHIND_M: Range<f32> = 0.20..0.50;
/// From the person who acts to a second one, m (section 5.6).
pub const BESIDE_M: Range<f32> = 1.0..2.0;
/// Half of a thing that lies behind a person: so far its middle is from a wall, m.
const HALF_THING_M: f32 = 0.1;
/// Depth that things behind a person have at least, m: who stands free has that much behind them.
const LEAST_M: f32 = 0.05;

/// A circumstance. All that comes of it is simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Circumstance {
    /// Fingers cover a part of the target's tag while the hand holds what it is on: carries it, or swings it open or shut. They
    /// weaken it whatever effects there are, and besides what [`blockage`](super::effects::Effects::blockage) makes of a hand
    /// that is in the way. Sitting down, standing up, wiping and doing nothing hold nothing.
    Hand,
    /// Tagged things that can be carried, and that nothing is done to, lie behind the person, on a board as high as the table.
    /// Bodies weaken tags with [`blockage`](super::effects::Effects::blockage) only.
    Body,
    /// Somebody else is busy with an untagged thing all the time: something that moves for the radar, and one more body in the
    /// way of tags. They are still during the reader's lead-in. What stands around them, their table or chair, is left out:
    /// it would be clutter that is not there without them.
    SecondPerson,
}

impl Circumstance {
    /// All.
    pub const ALL: [Self; 3] = [Self::Hand, Self::Body, Self::SecondPerson];

    /// Its name, as in files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hand => "hand",
            Self::Body => "body",
            Self::SecondPerson => "second-person",
        }
    }
}

/// How much fingers weaken a tag in one sample, there and back, dB.
pub(super) fn covered_db(rng: &mut ChaCha8Rng) -> f32 {
    rng.random_range(COVERED_DB)
}

/// How far behind a person at `place` things may lie, m: [`BEHIND_M`], or less where a wall or furniture is near.
pub(super) fn behind_m(scene: &Scene, place: &Place) -> Range<f32> {
    let Range { start, end } = BEHIND_M;
    start..(scene.room_behind(place) - HALF_THING_M).clamp(start + LEAST_M, end)
}

#[cfg(test)]
mod tests;
