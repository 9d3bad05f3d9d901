//! What passes between the executor in the interrupt and thread mode.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use rfhoi_firmware::bridge::FrameDone;
use rfhoi_firmware::dsp::Cube;
use static_cell::StaticCell;

use crate::packet::Outgoing;

/// Packets of maps that wait for the uplink: more than two frames of the `bridge` profile with ten each leave.
const RADAR_PACKETS: usize = 24;

/// Packets of tags, telemetry and answers that wait for the uplink.
const PACKETS: usize = 16;

/// A complete frame on its way to signal processing.
pub(crate) type Frame = (&'static mut Cube<'static>, FrameDone);

/// The channels, all bounded. A board places it where it likes: 70 KiB, all zeros at first.
pub struct Handover {
    pub(crate) frames: Channel<CriticalSectionRawMutex, Frame, 1>,
    pub(crate) spare: Channel<CriticalSectionRawMutex, &'static mut Cube<'static>, 1>,
    /// Two cubes, and one that holds nothing.
    pub(crate) cubes: [StaticCell<Cube<'static>>; 3],
    pub(crate) radar: Channel<CriticalSectionRawMutex, Outgoing, RADAR_PACKETS>,
    /// Used by the executor in the interrupt alone; it is here to lie where the board wants its queues.
    pub(crate) packets: Channel<CriticalSectionRawMutex, Outgoing, PACKETS>,
    /// Somebody listens.
    pub(crate) host: AtomicBool,
    /// Packets of maps that did not fit.
    pub(crate) unsent: AtomicU32,
    /// Signal processing works on a frame.
    pub(crate) working: AtomicBool,
    /// Thread mode has run since the watchdog was last fed.
    pub(crate) alive: AtomicBool,
}

impl Handover {
    /// Empty channels.
    pub const fn new() -> Self {
        Self {
            frames: Channel::new(),
            spare: Channel::new(),
            cubes: [const { StaticCell::new() }; 3],
            radar: Channel::new(),
            packets: Channel::new(),
            host: AtomicBool::new(false),
            unsent: AtomicU32::new(0),
            working: AtomicBool::new(false),
            alive: AtomicBool::new(false),
        }
    }

    /// Puts a packet of maps into the uplink's queue. Returns whether it was taken; without a host all are, and go
    /// nowhere.
    pub(crate) fn send(&self, bytes: &[u8]) -> bool {
        if !self.host.load(Ordering::Relaxed) {
            return true;
        }
        Outgoing::new(None, bytes).is_some_and(|packet| self.radar.try_send(packet).is_ok())
    }
}

impl Default for Handover {
    fn default() -> Self {
        Self::new()
    }
}
