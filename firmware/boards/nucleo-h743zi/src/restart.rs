//! Why the chip started, and the word left behind by the run before.
//!
//! The words lie in SRAM4, which a reset leaves alone and power-on fills with noise; so each is checked. They are atomics
//! only because statics must be; nothing races for them.

use core::fmt::{self, Write};
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering::Relaxed};

use cortex_m::peripheral::SCB;
use embassy_stm32::pac::RCC;
use rfhoi_shared::wire::RestartReason;

/// Bytes kept of a panic's message.
const TEXT_BYTES: usize = 160;
/// Marks a restart on purpose.
const COMMAND: u32 = 0x5ef1_c0de;
/// Marks a restart after a panic or a fault.
const PANIC: u32 = 0xdead_c0de;

#[unsafe(link_section = ".kept")]
static MARK: AtomicU32 = AtomicU32::new(0);
#[unsafe(link_section = ".kept")]
static BOOT: AtomicU32 = AtomicU32::new(0);
#[unsafe(link_section = ".kept")]
static LENGTH: AtomicU32 = AtomicU32::new(0);
#[unsafe(link_section = ".kept")]
static TEXT: [AtomicU8; TEXT_BYTES] = [const { AtomicU8::new(0) }; TEXT_BYTES];

/// The message of the run before.
pub struct LastWords {
    bytes: [u8; TEXT_BYTES],
    length: usize,
}

impl LastWords {
    /// The text, as far as it is one.
    pub fn text(&self) -> &str {
        let bytes = self.bytes.get(..self.length).unwrap_or(&[]);
        match core::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(e) => bytes.get(..e.valid_up_to()).and_then(|b| core::str::from_utf8(b).ok()).unwrap_or(""),
        }
    }
}

/// Reads, once, why the chip started and what a panic left; both are forgotten by it.
///
/// Needs SRAM4 uncached, so [`Memory::take`](crate::memory::Memory::take) comes first.
pub fn take() -> (RestartReason, Option<LastWords>) {
    let flags = RCC.rsr().read();
    RCC.rsr().modify(|w| w.set_rmvf(true));
    let mark = MARK.swap(0, Relaxed);
    // Every reset pulls the pin too, and power-on counts as a brown-out (RM0433, RCC_RSR): the rarest flag decides.
    let reason = if flags.porrstf() {
        RestartReason::PowerOn
    } else if flags.borrstf() {
        RestartReason::BrownOut
    } else if mark == PANIC {
        RestartReason::Panic
    } else if flags.iwdg1rstf() {
        RestartReason::Watchdog
    } else if mark == COMMAND && flags.sftrstf() {
        RestartReason::Command
    } else if flags.pinrstf() && !flags.sftrstf() {
        RestartReason::Pin
    } else {
        RestartReason::Unknown
    };
    let words = (reason == RestartReason::Panic).then(|| LastWords {
        bytes: core::array::from_fn(|i| TEXT.get(i).map_or(0, |b| b.load(Relaxed))),
        length: TEXT_BYTES.min(LENGTH.load(Relaxed) as usize),
    });
    (reason, words)
}

/// A number for this start, other than the last one's, from a random one.
pub fn number(random: u64) -> u16 {
    let last = BOOT.load(Relaxed) as u16;
    let number = if random as u16 == last { last.wrapping_add(1) } else { random as u16 };
    BOOT.store(number.into(), Relaxed);
    number
}

/// Restarts on purpose.
pub fn by_command() -> ! {
    MARK.store(COMMAND, Relaxed);
    SCB::sys_reset()
}

/// Restarts and leaves `message` to the next run; logs it too, after it is safe.
pub fn by_panic(message: fmt::Arguments<'_>) -> ! {
    cortex_m::interrupt::disable();
    // A panic inside a panic keeps the first message.
    if MARK.swap(PANIC, Relaxed) != PANIC {
        LENGTH.store(0, Relaxed);
        let _ = Kept.write_fmt(message);
        defmt::error!("{}", defmt::Display2Format(&message));
    }
    SCB::sys_reset()
}

/// Writes into the kept text; what does not fit is cut.
struct Kept;

impl Write for Kept {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let at = LENGTH.load(Relaxed) as usize;
        let free = TEXT.get(at..).unwrap_or(&[]);
        for (cell, byte) in free.iter().zip(text.bytes()) {
            cell.store(byte, Relaxed);
        }
        LENGTH.store((at + free.len().min(text.len())) as u32, Relaxed);
        Ok(())
    }
}
