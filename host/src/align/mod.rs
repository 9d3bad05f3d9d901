//! Packets in, frames of both radios on one time axis out: what the network is fed with.
//!
//! ```text
//! packets --Receiver--> RadarFrame --maps--> range-time, range-Doppler  --+
//!                         |  Covariance --aoa--> angle                  --+--> AlignedFrame: three maps, phase
//!                         +--> TagRead, HopTable --phase--> differences --+    differences, and what is wrong with each
//! ```
//!
//! A frame of the radar begins at a time of the bridge and lasts for a frame period; the tags' phase differences of the same
//! frame are those between its beginning and its end. Every map and every difference is valid, or says why it is not.
//! Nothing is computed twice, and nothing is allocated once all tags have been seen.
