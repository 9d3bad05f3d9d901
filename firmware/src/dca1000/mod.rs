//! The DCA1000EVM: commands to its FPGA, and the raw samples that it sends.
//!
//! * [`command`]: what goes over UDP port [`CONFIG_PORT`], both ways.
//! * [`setup`]: the commands that start and stop a recording, with their answers.
//! * [`Datagram`]: one datagram of raw samples on UDP port [`DATA_PORT`].
//! * [`Reassembly`]: datagrams in, chirps out, with holes marked.
//! * [`samples`]: the words of a chirp as numbers.
//!
//! Layouts: TI SPRUIJ4A and the FPGA's behaviour on the wire.

pub mod command;
mod datagram;
mod reassembly;
pub mod samples;
pub mod setup;

pub use datagram::{Datagram, DatagramError, HEADER_BYTES};
pub use reassembly::{Event, Reassembly};

/// UDP port for commands and their answers.
pub const CONFIG_PORT: u16 = 4096;
/// UDP port to which raw samples are sent.
pub const DATA_PORT: u16 = 4098;
