//! The executor of thread mode, which knows how long the processor slept.
//!
//! embassy-executor's own one sleeps with WFE, and an interrupt that ends the sleep is taken before the loop can read the
//! clock: its work would count as idle. This loop masks interrupts, reads the clock, sleeps with WFI (a pending interrupt
//! ends it, masked or not), reads the clock, and only then lets the interrupt in. So everything that is not between the
//! two readings is work, whichever interrupt or task does it.
//!
//! embassy-executor's `__pender` requests the interrupt whose number is the executor's context. Here that is an interrupt
//! of an unused peripheral, which stays disabled: its pending bit, set by any waker in any context, is the flag that thread
//! mode has work, and no waker can be missed between looking at it and sleeping.

use core::cell::Cell;

use cortex_m::asm;
use cortex_m::interrupt::InterruptNumber as _;
use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embassy_executor::{Spawner, raw};
use embassy_stm32::interrupt::Interrupt;
use embassy_time::Instant;
use static_cell::StaticCell;

/// The board has no SPDIF input.
const WORK: Interrupt = Interrupt::SPDIF_RX;

static EXECUTOR: StaticCell<raw::Executor> = StaticCell::new();

/// Microseconds asleep since start.
static IDLE_US: Mutex<Cell<u64>> = Mutex::new(Cell::new(0));

/// Time that the processor slept since start, us.
pub fn idle_us() -> u64 {
    critical_section::with(|cs| IDLE_US.borrow(cs).get())
}

/// Runs thread mode's tasks for ever; `init` spawns the first.
///
/// # Panics
/// When called twice.
pub fn run(init: impl FnOnce(Spawner)) -> ! {
    let context = usize::from(WORK.number()) as *mut ();
    let executor = EXECUTOR.init(raw::Executor::new(context));
    init(executor.spawner());
    loop {
        // Before the poll: a waker during it must be seen after it.
        NVIC::unpend(WORK);
        // SAFETY: the executor is initialised, and polled from here only.
        unsafe { executor.poll() };
        while !NVIC::is_pending(WORK) {
            sleep();
        }
    }
}

/// Sleeps until an interrupt is pending, and lets it in.
fn sleep() {
    critical_section::with(|cs| {
        // Once more, with no interrupt to come between this and the sleep.
        if !NVIC::is_pending(WORK) {
            let from = Instant::now();
            asm::dsb();
            asm::wfi();
            let idle = IDLE_US.borrow(cs);
            idle.set(idle.get() + from.elapsed().as_micros());
        }
    });
    // What ended the sleep runs here, before the flag is looked at again.
    asm::isb();
}
