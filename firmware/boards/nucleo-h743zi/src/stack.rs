//! How much of the stack has been used: cortex-m-rt paints it before the program starts.

use core::ptr::addr_of;

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    /// Of the link map; only their addresses mean something.
    static _stack_start: u32;
    static _stack_end: u32;
}

/// Bytes of the stack.
pub fn size() -> u32 {
    (addr_of!(_stack_start) as u32) - (addr_of!(_stack_end) as u32)
}

/// Bytes of the stack that were in use at once so far, at most.
pub fn most_used() -> u32 {
    let (top, bottom) = (addr_of!(_stack_start), addr_of!(_stack_end));
    let mut word = bottom;
    // SAFETY: from the bottom of the stack to its top, where the last words are this function's own.
    unsafe {
        while word < top && word.read_volatile() == STACK_PAINT_VALUE {
            word = word.add(1);
        }
    }
    top as u32 - word as u32
}
