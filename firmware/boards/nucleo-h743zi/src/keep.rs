//! The kept configuration: one record in the last two sectors of flash, written so that a power cut leaves the old one or
//! the new one.
//!
//! sequential-storage appends records to a sector and moves to the other when one is full, so that hundreds of records
//! go between two erasures; each sector stands 10,000 of them (DS12110, flash memory). An erasure takes up to 4 s (same
//! place, at the slowest parallelism), in which only interrupts run: that is why the watchdog waits for 8.
//! Code is in bank 1, so that it runs on while bank 2 is busy.
//!
//! A word of flash that lost power while it was written may read with a double error, for which the bus answers with a
//! fault. [`Sectors`] reads such a word as zeros, which no record's checksum fits.

use core::fmt;

use cortex_m::peripheral::SCB;
use embassy_embedded_hal::adapter::BlockingAsync;
use embassy_futures::block_on;
use embassy_stm32::Peri;
use embassy_stm32::flash::{self, Blocking, Flash, WRITE_SIZE};
use embassy_stm32::pac::{FLASH, IWDG1};
use embassy_stm32::peripherals;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use sequential_storage::cache::NoCache;
use sequential_storage::map::{MapConfig, MapStorage};

/// Longest record, bytes.
pub const MAX_BYTES: usize = rfhoi_bridge::board::MAX_KEPT;
/// Offset of region CONFIG of the link map in flash.
const BEGIN: u32 = 0x1C_0000;
const END: u32 = 0x20_0000;
/// The one record's key.
const KEY: u8 = 0;
/// A key, a record and the rest of a word.
const BUFFER_BYTES: usize = (1 + MAX_BYTES).next_multiple_of(WRITE_SIZE);

/// Why a record was not kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub enum RecordError {
    /// More than [`MAX_BYTES`].
    TooLong,
    /// The flash refused.
    Flash,
    /// What is in the sectors makes no sense, even after an erasure.
    Corrupt,
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the record is too long",
            Self::Flash => "the flash refused to write",
            Self::Corrupt => "the flash does not hold what was written",
        })
    }
}

impl core::error::Error for RecordError {}

impl From<sequential_storage::Error<flash::Error>> for RecordError {
    fn from(error: sequential_storage::Error<flash::Error>) -> Self {
        match error {
            sequential_storage::Error::Storage { .. } => Self::Flash,
            sequential_storage::Error::ItemTooBig | sequential_storage::Error::BufferTooSmall(_) => {
                Self::TooLong
            }
            _ => Self::Corrupt,
        }
    }
}

/// The record.
pub struct Record {
    store: MapStorage<u8, BlockingAsync<Sectors>, NoCache>,
    buffer: [u8; BUFFER_BYTES],
}

impl Record {
    /// Takes the flash.
    pub fn new(flash: Peri<'static, peripherals::FLASH>) -> Self {
        let sectors = BlockingAsync::new(Sectors(Flash::new_blocking(flash)));
        let store = MapStorage::new(sectors, const { MapConfig::new(BEGIN..END) }, NoCache::new());
        Self { store, buffer: [0; BUFFER_BYTES] }
    }

    /// Copies the record into `to`; `None` where there is none, or it does not fit.
    pub fn read<'b>(&mut self, to: &'b mut [u8]) -> Option<&'b [u8]> {
        let found: Result<Option<&[u8]>, _> = block_on(self.store.fetch_item(&mut self.buffer, &KEY));
        match found {
            Ok(record) => {
                let record = record?;
                let to = to.get_mut(..record.len())?;
                to.copy_from_slice(record);
                Some(to)
            }
            Err(error) => {
                defmt::warn!("kept configuration: {}", RecordError::from(error));
                None
            }
        }
    }

    /// Keeps `bytes` in place of the record before.
    ///
    /// # Errors
    /// [`RecordError`]; the record before stays, unless the sectors hold no record that can be read.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), RecordError> {
        if bytes.len() > MAX_BYTES {
            return Err(RecordError::TooLong);
        }
        match self.store(bytes) {
            // Past sequential-storage's own repair: begin with empty sectors.
            Err(RecordError::Corrupt) => {
                block_on(self.store.erase_all())?;
                self.store(bytes)
            }
            result => result,
        }
    }

    fn store(&mut self, bytes: &[u8]) -> Result<(), RecordError> {
        Ok(block_on(self.store.store_item(&mut self.buffer, &KEY, &bytes))?)
    }
}

/// The flash, with reads that survive a half-written word and errors that do not stay.
struct Sectors(Flash<'static, Blocking>);

impl Sectors {
    /// Clears the errors of bank 2. embassy-stm32 0.6 writes them to the status register, which on this chip is read only,
    /// so that one error would make every later write fail.
    fn clear_errors() {
        let bank = FLASH.bank(1);
        bank.ccr().write(|w| w.0 = bank.sr().read().0 & CLEARABLE);
    }
}

/// Error bits of FLASH_SR2 that FLASH_CCR2 clears at the same places (RM0433, at these registers).
const CLEARABLE: u32 = 0x1fef_0000;

impl ErrorType for Sectors {
    type Error = flash::Error;
}

impl ReadNorFlash for Sectors {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), flash::Error> {
        let first = offset as usize % WRITE_SIZE;
        let (head, rest) = bytes.split_at_mut(bytes.len().min(WRITE_SIZE - first));
        let mut at = offset;
        for part in core::iter::once(head).chain(rest.chunks_mut(WRITE_SIZE)) {
            Self::clear_errors();
            let read = without_bus_faults(|| self.0.blocking_read(at, part));
            if FLASH.bank(1).sr().read().dbeccerr() {
                part.fill(0);
            }
            Self::clear_errors();
            read?;
            at += part.len() as u32;
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for Sectors {
    const WRITE_SIZE: usize = WRITE_SIZE;
    const ERASE_SIZE: usize = <Flash<'static, Blocking> as NorFlash>::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), flash::Error> {
        // Each may take 4 s, in which nothing else feeds the watchdog.
        for sector in (from..to).step_by(Self::ERASE_SIZE) {
            const FEED: u16 = 0xaaaa;
            IWDG1.kr().write(|w| w.0 = FEED.into());
            Self::clear_errors();
            self.0.blocking_erase(sector, sector + Self::ERASE_SIZE as u32)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), flash::Error> {
        Self::clear_errors();
        self.0.blocking_write(offset, bytes)
    }
}

/// Runs `work` with bus faults of its loads ignored (ARMv7-M, B3.2.8: CCR.BFHFNMIGN, at the priority of FAULTMASK).
fn without_bus_faults<T>(work: impl FnOnce() -> T) -> T {
    const BFHFNMIGN: u32 = 1 << 8;
    // SAFETY: the flag and the mask are put back below; in between runs a copy of at most one flash word, in which no
    // interrupt may run. `Sectors` is never read from a handler of HardFault or NMI.
    unsafe {
        let ccr = &(*SCB::PTR).ccr;
        core::arch::asm!("cpsid f", options(nostack));
        ccr.modify(|v| v | BFHFNMIGN);
        cortex_m::asm::dsb();
        cortex_m::asm::isb();
        let result = work();
        cortex_m::asm::dsb();
        ccr.modify(|v| v & !BFHFNMIGN);
        core::arch::asm!("cpsie f", options(nostack));
        cortex_m::asm::isb();
        result
    }
}
