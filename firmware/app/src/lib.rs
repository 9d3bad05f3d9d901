//! The bridge's application: Embassy tasks around the logic of `rfhoi-firmware`.
//!
//! A board lends pins, clock, network driver and memory ([`Board`]); everything else is here and the same on every board, in
//! QEMU and on a PC.
//!
//! ```text
//!            executor in an interrupt: whatever must not wait                     thread mode: whatever may
//!  UDP 4098 --Tap, radar: chirps, range FFT--> cube --Handover::frames--> dsp: Doppler FFT, maps --+
//!                                          ^-----Handover::spare--------+                     |
//!  UART TLV --> uart ---------------------------+                                       Handover::radar
//!  UDP 4096, CLI UART <--> control --notices----+                                             |
//!  LLRP/TCP <--> reader --tag reads-------------+--> Handover::packets --> host <---------------+
//!  once a second: telemetry, watchdog ----------+                         ^
//!                                                                         +--> UDP 4780, commands and packets
//! ```
//!
//! The recorder's datagrams do not pass through the IP stack: [`Tap`] takes them where they lie in the driver's buffer.
//! Signal processing cannot delay reception: it runs in thread mode, and every interrupt of the network runs before it.
//!
//! What happens when a channel is full:
//!
//! | channel | holds | when full |
//! |---|---|---|
//! | `Handover::frames` | 1 cube | the new frame is dropped whole and counted as an overrun; the older one is finished |
//! | `Handover::radar` | 24 packets of maps | the packet is dropped and counted; the host sees the gap |
//! | `Handover::packets` | 16 packets of tags, telemetry, answers | the packet is dropped and counted; the host sees the gap |
//! | UDP 4780 out | 4 answers, 4 others | waits 100 ms, then drops what cannot leave and counts it; an absent host gets nothing for 1 s |
//! | the driver's ring | what the board gives it | the datagram is lost, and counted by its number |
//! | UDP 4780 in, 4096 in | 2, 4 datagrams of 64 bytes | lost; whoever asked asks again |
//! | LLRP in | 4 KiB | TCP makes the reader wait |
//! | LLRP out | 2 KiB | the message is left out; the client's time limits notice |
//!
//! A configuration takes effect by a restart, so there is one way to start, and it is used every time.
#![no_std]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable,
        clippy::indexing_slicing
    )
)]

pub mod board;
mod bridge;
mod control;
mod dsp;
mod handover;
mod host;
mod net;
mod packet;
mod radar;
mod reader;
mod tap;
mod telemetry;
mod uart;

pub use board::{Board, KeepError, boot_configuration, keep_configuration};
pub use bridge::{Bridge, Parts};
pub use control::radar_control;
pub use dsp::spawn as spawn_dsp;
pub use handover::Handover;
pub use net::{SOCKETS, ip_configuration};
pub use tap::{Datagrams, Tap};
pub use uart::radar_uart;

/// Cells of the cube memory that a board lends: two gated cubes of the `bridge` profile (72 bins, 12 antennas, 64
/// loops), or one of `fine`; 442,368 bytes.
pub const CUBE_CELLS: usize = 2 * 72 * 12 * 64;

/// Bridges in one process: one on a board, several in tests on a PC.
const BRIDGES: usize = if cfg!(feature = "std") { 64 } else { 1 };

/// The time of a bridge.
fn now() -> rfhoi_shared::units::BridgeTime {
    rfhoi_shared::units::BridgeTime(embassy_time::Instant::now().as_micros())
}

/// When a deadline of the bridge's logic is due, for [`embassy_time::Timer::at`]; far away if there is none.
fn instant(deadline: Option<rfhoi_shared::units::BridgeTime>) -> embassy_time::Instant {
    deadline.map_or(embassy_time::Instant::MAX, |time| embassy_time::Instant::from_micros(time.0))
}
