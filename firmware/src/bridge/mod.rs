//! The pieces joined: a device's bytes in, uplink packets out.
//!
//! * [`RadarPath`]: the DCA1000EVM's datagrams to maps and covariance. Its halves, [`Capture`] (as chirps arrive) and
//!   [`Mapping`] (when a frame is complete), can be run apart on two cubes.

mod radar;

pub use radar::{Capture, FrameDone, Mapping, RadarPath};
