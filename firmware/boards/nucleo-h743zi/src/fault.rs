//! Panics and faults: each says what it was, leaves it to the next run, and restarts.

use core::arch::naked_asm;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;

use crate::restart;

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    restart::by_panic(format_args!("{info}"))
}

/// Memory, bus and usage faults end here too, since their own handlers are not enabled.
///
/// A stack that overflowed cannot hold the handler, which then starts over at the stack's top.
#[unsafe(naked)]
#[unsafe(export_name = "HardFault")]
unsafe extern "C" fn hard_fault() -> ! {
    naked_asm!(
        "mrs r0, msp",
        "movw r1, :lower16:_stack_end",
        "movt r1, :upper16:_stack_end",
        "add r2, r1, #{room}",
        "cmp r0, r2",
        "bhs 1f",
        "movw r2, :lower16:_stack_start",
        "movt r2, :upper16:_stack_start",
        "msr msp, r2",
        "1: b {report}",
        room = const HANDLER_STACK,
        report = sym report,
    )
}

/// Bytes of stack that the report needs.
const HANDLER_STACK: u32 = 2048;
/// Bytes from the frame that an exception stacks to the program counter in it (ARMv7-M, B1.5.6).
const FRAME_PC: u32 = 24;

/// `frame` is where the exception stacked its registers, `bottom` the end of the stack.
extern "C" fn report(frame: u32, bottom: u32) -> ! {
    /// CFSR, HFSR, MMFAR and BFAR (ARMv7-M, B3.2.2).
    const STATUS: *const u32 = 0xE000_ED28 as *const u32;
    let overflow = frame < bottom + HANDLER_STACK;
    // SAFETY: the frame lies in the stack, by the test; the status registers may always be read.
    let (pc, cfsr, address) = unsafe {
        let pc = if overflow { 0 } else { ((frame + FRAME_PC) as *const u32).read_volatile() };
        (pc, STATUS.read_volatile(), STATUS.add(4).read_volatile())
    };
    let hfsr = SCB::PTR;
    // SAFETY: as above.
    let hfsr = unsafe { (*hfsr).hfsr.read() };
    let what = if overflow { "stack overflow" } else { "fault" };
    restart::by_panic(format_args!(
        "{what} at {pc:#010x}: CFSR {cfsr:#010x}, HFSR {hfsr:#010x}, BFAR {address:#010x}"
    ))
}
