//! The watchdog: CMSDK APB watchdog (DDI 0479, section 4.7) at 25 MHz.
//!
//! When it runs out it first raises the NMI, which no critical section holds off: that notes the reason and resets. If
//! even that fails, it resets the board by itself after the same time again.

use cortex_m_rt::exception;

use crate::kept::{self, Restart};
use crate::register::Register;
use crate::timer;

/// The register `offset` bytes into the device.
const fn register(offset: usize) -> Register {
    // SAFETY: hw/arm/mps2.c has the watchdog there, which is no DMA master.
    unsafe { Register::at(0x4000_8000 + offset) }
}

const LOAD: Register = register(0);
const CONTROL: Register = register(8);
const INT_CLEAR: Register = register(0xc);
const LOCK: Register = register(0xc00);

/// CONTROL: count and raise the NMI; reset when it runs out again.
const INT_ENABLE: u32 = 1;
const RESET_ENABLE: u32 = 1 << 1;
/// LOCK: what lets writes through; anything else does not.
const UNLOCK: u32 = 0x1acc_e551;

/// Starts the watchdog: [`feed`] it at least every `milliseconds`, at most 171,000.
pub fn start(milliseconds: u32) {
    LOCK.write(UNLOCK);
    LOAD.write(milliseconds.saturating_mul((timer::HZ / 1000) as u32));
    CONTROL.write(INT_ENABLE | RESET_ENABLE);
    LOCK.write(0);
}

/// Begins the time anew.
pub fn feed() {
    LOCK.write(UNLOCK);
    INT_CLEAR.write(0);
    LOCK.write(0);
}

#[exception]
unsafe fn NonMaskableInt() {
    kept::restart(Restart::Watchdog)
}
