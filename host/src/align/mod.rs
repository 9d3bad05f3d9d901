//! Packets in, frames of both radios on one time axis out: what the network is fed with.
//!
//! ```text
//! packets --Receiver--> RadarFrame --maps--> range-time, range-Doppler  --+
//!                         |  Covariance --aoa--> angle                  --+--> AlignedFrame: three maps, phase
//!                         +--> TagRead, HopTable --phase--> differences --+    differences, and what is wrong with each
//! ```
//!
//! A frame of the radar begins at a time of the bridge and lasts for a frame period; the tags' phase differences of the same
//! frame are those between its beginning and its end. Every map and every difference is valid, or says why it is not. A frame
//! that the radar never sent has a place all the same, so that time goes on evenly.
//!
//! [`FrameStream::push`] takes a packet, [`FrameStream::next`] hands on the frames that are complete: a frame waits until the
//! bridge's time is past its end by [`Settings::patience_us`], as reads are sent a little later than they were made. Nothing
//! is computed twice; with frames given back ([`FrameStream::recycle`]) nothing is allocated once all tags have been seen.

mod frame;
mod grid;
mod stream;

pub use frame::{AlignedFrame, MAPS, MapInvalid, MapName};
#[cfg(feature = "train")]
pub(crate) use stream::SILENCE;
pub use stream::{AlignError, Angles, FrameStream, Settings, StreamCounts};

#[cfg(test)]
mod tests;
