//! A board on a PC: it keeps bytes over restarts, and counts.

use std::sync::{Arc, Mutex, MutexGuard};

use rfhoi_bridge::{Board, KeepError};
use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::RestartReason;

use super::clock;
use super::switch::Mac;

/// MAC address of the bridge.
pub(super) const MAC: Mac = [0x02, 0, 0, 0, 0, 30];

/// What is on the board.
#[derive(Debug)]
pub struct State {
    /// The bytes kept.
    pub kept: Option<Vec<u8>>,
    /// It keeps nothing: its memory is worn out.
    pub worn_out: bool,
    /// When the watchdog was fed.
    pub feeds: Vec<BridgeTime>,
    /// Starts so far.
    pub starts: u16,
    pub(super) restart: bool,
    reason: RestartReason,
    seed: u64,
}

/// The board; clones are the same one.
#[derive(Debug, Clone)]
pub struct SimulatedBoard(Arc<Mutex<State>>);

impl SimulatedBoard {
    /// A board without power.
    pub(super) fn new(seed: u64) -> Self {
        Self(Arc::new(Mutex::new(State {
            kept: None,
            worn_out: false,
            feeds: Vec::new(),
            starts: 0,
            restart: false,
            reason: RestartReason::PowerOn,
            seed,
        })))
    }

    /// What is on it.
    ///
    /// # Panics
    /// If a thread panicked with it.
    pub fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().expect("one thread has it")
    }

    /// Power comes on, or the reset is over.
    pub(super) fn start(&self) {
        let state = &mut *self.state();
        state.starts += 1;
        state.restart = false;
    }
}

impl Board for SimulatedBoard {
    fn name(&self) -> &'static str {
        "simulated"
    }

    fn id(&self) -> [u8; 6] {
        MAC
    }

    fn seed(&mut self) -> u64 {
        let state = self.state();
        state.seed ^ u64::from(state.starts)
    }

    fn restart_reason(&self) -> RestartReason {
        self.state().reason
    }

    fn last_words(&self) -> &str {
        ""
    }

    fn feed_watchdog(&mut self) {
        self.state().feeds.push(clock::now());
    }

    fn decicelsius(&mut self) -> Option<i16> {
        Some(412)
    }

    fn idle_us(&self) -> u64 {
        // Half of the time.
        clock::now().0 / 2
    }

    fn kept<'b>(&mut self, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
        let state = self.state();
        let kept = state.kept.as_ref()?;
        let place = buffer.get_mut(..kept.len())?;
        place.copy_from_slice(kept);
        Some(place)
    }

    fn keep(&mut self, bytes: &[u8]) -> Result<(), KeepError> {
        let mut state = self.state();
        if state.worn_out {
            return Err(KeepError);
        }
        state.kept = Some(bytes.to_vec());
        Ok(())
    }

    fn restart(&mut self) {
        let mut state = self.state();
        state.restart = true;
        state.reason = RestartReason::Command;
    }
}
