//! What a board is to the application, besides its network driver and its UARTs.

use core::fmt;

use rfhoi_shared::config::BridgeConfig;
use rfhoi_shared::wire::RestartReason;

use crate::bridge::cube_bytes;

/// A board. Called by one task at a time; no call may take longer than a few milliseconds, but [`Board::keep`], which is
/// only called while the radar is stopped.
pub trait Board {
    /// Name of the board, at most [`rfhoi_shared::wire::MAX_BOARD_NAME`] bytes.
    fn name(&self) -> &'static str;
    /// MAC address.
    fn id(&self) -> [u8; 6];
    /// A number that differs from start to start.
    fn seed(&mut self) -> u64;
    /// Why the board started.
    fn restart_reason(&self) -> RestartReason;
    /// What went wrong before the start, in words; empty if nothing did, or it is not known.
    fn last_words(&self) -> &str;
    /// Keeps the watchdog from restarting the board; called once a second while everything runs.
    fn feed_watchdog(&mut self);
    /// Temperature of the MCU, 0.1 degrees Celsius.
    fn decicelsius(&mut self) -> Option<i16>;
    /// Time that the processor has slept since the start, us.
    fn idle_us(&self) -> u64;
    /// The bytes last kept, or `None` if there are none or they are damaged.
    fn kept<'b>(&mut self, buffer: &'b mut [u8]) -> Option<&'b [u8]>;
    /// Keeps at most [`MAX_KEPT`] bytes over a restart and, where the board has memory for it, without power.
    ///
    /// # Errors
    /// If they cannot be kept; what was kept before then still is.
    fn keep(&mut self, bytes: &[u8]) -> Result<(), KeepError>;
    /// Restarts the board; the reason is [`RestartReason::Command`]. On a PC it may return.
    fn restart(&mut self);
}

/// Bytes that a board can keep: a configuration takes at most 151.
pub const MAX_KEPT: usize = 256;

/// The board's memory did not take the configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct KeepError;

impl fmt::Display for KeepError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the board's memory did not take the configuration")
    }
}

impl core::error::Error for KeepError {}

/// Bytes before a kept configuration: the version of the wire whose layout it has.
const VERSION: [u8; 1] = [rfhoi_shared::wire::VERSION];

/// The configuration to start with: the one kept, or the default where none is kept, or it is of another version or no
/// longer valid.
pub fn boot_configuration(board: &mut dyn Board) -> BridgeConfig {
    let mut buffer = [0; MAX_KEPT];
    let kept = board.kept(&mut buffer).and_then(|bytes| bytes.strip_prefix(&VERSION));
    let config = kept.and_then(|bytes| postcard::from_bytes::<BridgeConfig>(bytes).ok());
    config.filter(|config| config.validate(cube_bytes()).is_ok()).unwrap_or_default()
}

/// Keeps a configuration for the next start.
///
/// # Errors
/// As [`Board::keep`].
pub fn keep_configuration(board: &mut dyn Board, config: &BridgeConfig) -> Result<(), KeepError> {
    let mut buffer = [0; MAX_KEPT];
    let [version, body @ ..] = &mut buffer;
    [*version] = VERSION;
    let length = postcard::to_slice(config, body).map_err(|_| KeepError)?.len();
    board.keep(buffer.get(..VERSION.len() + length).ok_or(KeepError)?)
}
