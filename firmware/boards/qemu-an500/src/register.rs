//! A device's register at a fixed address.

use core::ptr;

/// A 32-bit register.
#[derive(Clone, Copy)]
pub(crate) struct Register(usize);

impl Register {
    /// The register at `address`.
    ///
    /// # Safety
    /// `address` is a register of a device of this board, and neither reading nor writing it breaks memory safety: the
    /// device is no DMA master.
    pub(crate) const unsafe fn at(address: usize) -> Self {
        Self(address)
    }

    #[inline(always)]
    pub(crate) fn read(self) -> u32 {
        // SAFETY: a device's register, by the contract of `at`.
        unsafe { ptr::read_volatile(self.0 as *const u32) }
    }

    #[inline(always)]
    pub(crate) fn write(self, value: u32) {
        // SAFETY: as in `read`.
        unsafe { ptr::write_volatile(self.0 as *mut u32, value) }
    }
}
