//! From aligned frames to what the network takes ([`rfhoi_network::sample`]).
//!
//! ```text
//! packets ---> [FrameStream] --AlignedFrame--> [FrameFeatures] --Frame--> network, as it happens
//! data set --> [set]: the same stream and features, sample by sample ---> [Sample]s, kept in files beside the set
//! a simulated sample in memory --> [of_sample]: the same
//! ```
//!
//! [`Settings`] decide both: a network sees live what it was trained with.
//!
//! [`FrameStream`]: crate::align::FrameStream
//! [`Sample`]: rfhoi_network::sample::Sample

mod frame;
mod passage;
pub mod set;
mod settings;

pub use frame::{FrameFeatures, moving_cells};
pub use passage::of_sample;
pub use settings::{AngleMap, Settings};

/// Of what features mean; to be counted up when the same packets give others.
pub const VERSION: u32 = 1;
