//! What outlives a reset: the configuration, and why the board restarted.
//!
//! Both lie in RAM that neither start-up code nor loader touches, each as a record of magic, length, CRC and content, so
//! that what power-on leaves there is not taken for one. A board with flash would keep the configuration there.

use core::cell::UnsafeCell;
use core::fmt::{self, Write};
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use crc::{CRC_32_ISO_HDLC, Crc};
use critical_section::CriticalSection;

/// Bytes of the longest configuration.
pub const CONFIGURATION_BYTES: usize = rfhoi_bridge::board::MAX_KEPT;
/// Bytes of the longest note on a restart.
const NOTE_BYTES: usize = 120;

const MAGIC: u32 = u32::from_le_bytes(*b"kept");
const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Why the board last started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
#[repr(u8)]
pub enum Restart {
    /// Power came on, or a reset from outside.
    PowerOn,
    /// Asked for, as by a new configuration.
    Command,
    /// The firmware panicked or faulted; the note says where.
    Panic,
    /// The firmware no longer fed the watchdog.
    Watchdog,
}

/// A note on a restart: place and message of a panic.
pub type Note = heapless::String<NOTE_BYTES>;

/// The configuration is longer than [`CONFIGURATION_BYTES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub struct TooLong;

impl fmt::Display for TooLong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a configuration may have {CONFIGURATION_BYTES} bytes")
    }
}

impl core::error::Error for TooLong {}

#[repr(C)]
struct Record<const N: usize> {
    magic: u32,
    length: u32,
    crc: u32,
    content: [u8; N],
}

impl<const N: usize> Record<N> {
    fn load(&self) -> Option<&[u8]> {
        let content = self.content.get(..self.length as usize)?;
        (self.magic == MAGIC && self.crc == CRC.checksum(content)).then_some(content)
    }

    fn store(&mut self, bytes: &[u8]) -> Result<(), TooLong> {
        self.content.get_mut(..bytes.len()).ok_or(TooLong)?.copy_from_slice(bytes);
        self.magic = MAGIC;
        self.length = bytes.len() as u32;
        self.crc = CRC.checksum(bytes);
        Ok(())
    }

    fn erase(&mut self) {
        self.magic = 0;
    }
}

#[repr(C)]
struct Kept {
    /// [`Restart`] and the note.
    restart: Record<{ 1 + NOTE_BYTES + 3 }>,
    /// Number of starts since power came on.
    starts: Record<4>,
    configuration: Record<CONFIGURATION_BYTES>,
}

const _: () = assert!(size_of::<Kept>() <= 4096, "memory.x has 4 KiB for it");

unsafe extern "C" {
    /// From memory.x.
    static _kept: UnsafeCell<Kept>;
}

/// Calls `f` with what is kept.
fn with<R>(_: CriticalSection<'_>, f: impl FnOnce(&mut Kept) -> R) -> R {
    // SAFETY: memory.x keeps that memory for this; any bits are a valid `Kept`; the critical section makes the reference
    // the only one, since no `f` here calls `with`.
    f(unsafe { &mut *_kept.get() })
}

/// Why the board last started, with a note. The second call in a run says [`Restart::PowerOn`], as does the next run
/// after a reset that nobody here asked for.
pub fn take_restart() -> (Restart, Note) {
    critical_section::with(|cs| {
        with(cs, |kept| {
            let record = kept.restart.load().and_then(<[u8]>::split_first);
            let reasons = [Restart::Command, Restart::Panic, Restart::Watchdog];
            let reason = record.and_then(|(&byte, _)| reasons.into_iter().find(|r| *r as u8 == byte));
            let text = record.and_then(|(_, note)| core::str::from_utf8(note).ok()).unwrap_or_default();
            let note = Note::try_from(text).unwrap_or_default();
            kept.restart.erase();
            (reason.unwrap_or(Restart::PowerOn), note)
        })
    })
}

/// Counts this start; from 1 after power came on.
pub fn count_start() -> u32 {
    critical_section::with(|cs| {
        with(cs, |kept| {
            let last =
                kept.starts.load().and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes);
            let starts = last.wrapping_add(1);
            // Four bytes fit.
            let _ = kept.starts.store(&starts.to_le_bytes());
            starts
        })
    })
}

/// Resets the board, which then knows the reason.
pub fn restart(reason: Restart) -> ! {
    restart_with(reason, format_args!(""))
}

/// Resets the board after a panic, for use as its handler.
pub fn restart_after(panic: &PanicInfo<'_>) -> ! {
    restart_with(Restart::Panic, format_args!("{panic}"))
}

fn restart_with(reason: Restart, note: fmt::Arguments<'_>) -> ! {
    let mut text = Note::new();
    // A note that is too long ends where it no longer fits.
    let _ = Clipped(&mut text).write_fmt(note);
    critical_section::with(|cs| {
        with(cs, |kept| {
            let mut content = heapless::Vec::<u8, { 1 + NOTE_BYTES }>::new();
            let fits =
                content.push(reason as u8).is_ok() && content.extend_from_slice(text.as_bytes()).is_ok();
            if !fits || kept.restart.store(&content).is_err() {
                kept.restart.erase();
            }
        });
    });
    // SYSRESETREQ of AIRCR (ARMv7-M B3.2.6).
    SCB::sys_reset()
}

/// Takes characters while they fit.
struct Clipped<'a>(&'a mut Note);

impl Write for Clipped<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for c in text.chars() {
            self.0.push(c).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

/// Keeps `configuration` for the runs after the next resets.
///
/// # Errors
/// [`TooLong`], and the one before is kept.
pub fn store_configuration(configuration: &[u8]) -> Result<(), TooLong> {
    critical_section::with(|cs| with(cs, |kept| kept.configuration.store(configuration)))
}

/// The configuration kept, at the front of `buffer`; `None` if there is none, or none that fits.
pub fn load_configuration(buffer: &mut [u8]) -> Option<&[u8]> {
    critical_section::with(|cs| {
        with(cs, |kept| {
            let content = kept.configuration.load()?;
            let place = buffer.get_mut(..content.len())?;
            place.copy_from_slice(content);
            Some(&*place)
        })
    })
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    restart_with(Restart::Panic, format_args!("fault at {:#010x}", frame.pc()))
}
