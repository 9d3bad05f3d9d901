//! Drivers of QEMU's mps2-an500 (Cortex-M7, 25 MHz clock) for an Embassy application.
//!
//! The board has what the bridge needs from any board: a network driver ([`lan9118`]), the radar's two serial ports
//! ([`uart`]), a clock ([`timer`]), two executors ([`interrupts`] for the network, [`idle`] for the rest) and memory that
//! outlives a reset ([`kept`]). Devices are ARM's CMSDK (DDI 0479) and SMSC's LAN9118; their places are those of QEMU's
//! `hw/arm/mps2.c`.
#![no_std]

pub mod idle;
pub mod interrupts;
pub mod lan9118;
pub mod tap;
pub mod timer;
pub mod uart;

mod register;

// The logger that `defmt` writes to, for every image of the board.
use defmt_semihosting as _;
