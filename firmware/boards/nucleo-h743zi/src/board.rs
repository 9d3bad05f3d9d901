//! The board as the application sees it.

use embassy_stm32::peripherals::{self, IWDG1};
use embassy_stm32::rng::Rng;
use embassy_stm32::wdg::IndependentWatchdog;
use rfhoi_bridge::{Board, KeepError};
use rfhoi_shared::wire::RestartReason;

use crate::keep::Record;
use crate::restart::LastWords;
use crate::temperature::Thermometer;
use crate::{idle, restart, stack};

/// The watchdog's period, us: longer than an erasure of flash, 4 s (see [`crate::keep`]), whose oscillator's
/// 32 kHz are not exact (DS12110, LSI).
pub const WATCHDOG_US: u32 = 8_000_000;

/// NUCLEO-H743ZI or NUCLEO-H743ZI2.
pub struct Nucleo {
    /// Made from the chip's number by [`mac_address`].
    pub id: [u8; 6],
    /// From [`restart::take`], as what follows.
    pub restart_reason: RestartReason,
    pub last_words: Option<LastWords>,
    pub random: Rng<'static, peripherals::RNG>,
    pub watchdog: IndependentWatchdog<'static, IWDG1>,
    pub thermometer: Thermometer,
    pub record: Record,
    /// Most stack used when last looked at, bytes.
    pub stack_used: u32,
}

impl Board for Nucleo {
    fn name(&self) -> &'static str {
        "nucleo-h743zi"
    }

    fn id(&self) -> [u8; 6] {
        self.id
    }

    fn seed(&mut self) -> u64 {
        self.random.next_u64()
    }

    fn restart_reason(&self) -> RestartReason {
        self.restart_reason
    }

    fn last_words(&self) -> &str {
        self.last_words.as_ref().map_or("", LastWords::text)
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.pet();
        let most = stack::most_used();
        if most > self.stack_used {
            self.stack_used = most;
            defmt::info!("stack: at most {} of {} bytes used so far", most, stack::size());
        }
    }

    fn decicelsius(&mut self) -> Option<i16> {
        self.thermometer.decicelsius()
    }

    fn idle_us(&self) -> u64 {
        idle::idle_us()
    }

    fn kept<'b>(&mut self, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
        self.record.read(buffer)
    }

    fn keep(&mut self, bytes: &[u8]) -> Result<(), KeepError> {
        self.record.write(bytes).map_err(|error| {
            defmt::error!("{}", error);
            KeepError
        })
    }

    fn restart(&mut self) {
        restart::by_command()
    }
}

/// A MAC address from the chip's 96-bit number: locally administered, not a group's.
pub fn mac_address(uid: [u8; 12]) -> [u8; 6] {
    // FNV-1a, 64 bit: the numbers of one lot differ in few bits.
    const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0100_0000_01b3;
    const LOCAL: u8 = 0b10;
    const GROUP: u8 = 0b01;
    let hash = uid.iter().fold(BASIS, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(PRIME));
    let [a, b, c, d, e, f, ..] = hash.to_be_bytes();
    [(a | LOCAL) & !GROUP, b, c, d, e, f]
}
