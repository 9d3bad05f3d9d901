//! The pieces joined: a device's bytes in, uplink packets out.
//!
//! * [`RadarPath`]: the DCA1000EVM's datagrams to maps and covariance. Its halves, [`Capture`] (as chirps arrive) and
//!   [`Mapping`] (when a frame is complete), can be run apart on two cubes.
//! * [`UartPath`]: the SDK demo's TLV frames to maps and points.
//! * [`RadarControl`]: what the radar and its recorder are told.
//! * [`ReaderPath`]: the reader's TCP connection to tag reads.

mod control;
mod radar;
mod reader;
mod uart;

pub use control::{ControlAction, ControlInput, ControlNotice, QUIET_US, RETRY_US, RadarControl, SILENT_US};
pub use radar::{Capture, FrameDone, Mapping, RadarPath};
pub use reader::{ReaderAction, ReaderInput, ReaderPath};
pub use uart::{UART_SCALE, UartPath};
