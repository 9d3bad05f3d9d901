//! The board as the application sees it.

use rfhoi_bridge::{Board, KeepError};
use rfhoi_shared::wire::RestartReason;

use crate::kept::{self, Restart};
use crate::{idle, watchdog};

/// Locally administered MAC address; QEMU has one board on its network.
const ID: [u8; 6] = [2, 0, 0, 0xa5, 0, 1];

/// The board.
pub struct An500 {
    reason: RestartReason,
    last_words: kept::Note,
    seed: u64,
}

impl An500 {
    /// Finds out why the board started.
    pub fn new() -> Self {
        let (restart, last_words) = kept::take_restart();
        let reason = match restart {
            Restart::PowerOn => RestartReason::PowerOn,
            Restart::Command => RestartReason::Command,
            Restart::Panic => RestartReason::Panic,
            Restart::Watchdog => RestartReason::Watchdog,
        };
        Self { reason, last_words, seed: kept::count_start().into() }
    }
}

impl Default for An500 {
    fn default() -> Self {
        Self::new()
    }
}

impl Board for An500 {
    fn name(&self) -> &'static str {
        "qemu-an500"
    }

    fn id(&self) -> [u8; 6] {
        ID
    }

    fn seed(&mut self) -> u64 {
        // There is no source of noise: the number of the start.
        self.seed
    }

    fn restart_reason(&self) -> RestartReason {
        self.reason
    }

    fn last_words(&self) -> &str {
        &self.last_words
    }

    fn feed_watchdog(&mut self) {
        watchdog::feed();
    }

    fn decicelsius(&mut self) -> Option<i16> {
        None
    }

    fn idle_us(&self) -> u64 {
        idle::idle_us()
    }

    fn kept<'b>(&mut self, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
        kept::load_configuration(buffer)
    }

    fn keep(&mut self, bytes: &[u8]) -> Result<(), KeepError> {
        kept::store_configuration(bytes).map_err(|_| KeepError)
    }

    fn restart(&mut self) {
        kept::restart(Restart::Command)
    }
}
