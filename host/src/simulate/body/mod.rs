//! A person's body: from a height and a build, a skeleton of 20 joints, and a triangle mesh that follows the joints.
//!
//! Whoever moves a body, a plan or a recording, gives the positions of its joints ([`Joints`]); bones turn with them and
//! carry their part of the mesh rigidly. Twists of a limb about itself are not modelled: its cross-section is round.

mod frame;
mod limb;
mod mesh;
mod skeleton;
#[cfg(test)]
mod tests;

pub(crate) use frame::{arc, basis};
pub(crate) use limb::{highest_hip, softly_at_most, stretched, two_bones};
pub use mesh::Body;
pub use skeleton::{Joint, Joints, Lengths, Side};
