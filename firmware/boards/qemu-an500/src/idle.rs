//! The executor of thread mode, which knows exactly how long it slept.
//!
//! embassy-executor's own one sleeps with WFE, and an interrupt that ends the sleep is taken before the loop can read the
//! clock: its work would count as idle. This loop masks interrupts, reads the clock, sleeps with WFI (a pending interrupt
//! ends it, masked or not), reads the clock, and only then lets the interrupt in. So everything that is not between the
//! two readings is work, whichever interrupt or task does it.
//!
//! embassy-executor's `__pender` requests the interrupt whose number is the executor's context. The context here is
//! [`Interrupt::ThreadExecutor`], which stays disabled: its pending bit, set by any waker in any context, is the flag
//! that thread mode has work, and no waker can be missed between looking at it and sleeping.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::asm;
use cortex_m::interrupt::{self, InterruptNumber};
use cortex_m::peripheral::NVIC;
use embassy_executor::{Spawner, raw};
use static_cell::StaticCell;

use crate::interrupts::Interrupt;
use crate::timer::Counts;

static EXECUTOR: StaticCell<raw::Executor> = StaticCell::new();

/// Idle counts of 40 ns, modulo 2^32 (171 s).
static IDLE: AtomicU32 = AtomicU32::new(0);

/// A reading of the clocks of work and idleness.
#[derive(Debug, Clone, Copy, Default)]
pub struct Load {
    all: Counts,
    idle: u32,
}

impl Load {
    /// The present reading; take one less than 171 s later for the difference.
    pub fn now() -> Self {
        critical_section::with(|_| Self { all: Counts::now(), idle: IDLE.load(Ordering::Relaxed) })
    }

    /// Counts of 40 ns since `earlier` in which the processor worked, and all of them.
    pub fn since(self, earlier: Self) -> (u64, u64) {
        let all = self.all - earlier.all;
        (all.saturating_sub(u64::from(self.idle.wrapping_sub(earlier.idle))), all)
    }
}

/// Runs thread mode's tasks for ever; `init` spawns the first.
///
/// # Panics
/// When called twice.
pub fn run(init: impl FnOnce(Spawner)) -> ! {
    let context = usize::from(Interrupt::ThreadExecutor.number()) as *mut ();
    let executor = EXECUTOR.init(raw::Executor::new(context));
    init(executor.spawner());
    loop {
        // Before the poll: a waker during it must be seen after it.
        NVIC::unpend(Interrupt::ThreadExecutor);
        // SAFETY: the executor is initialised, and polled from here only.
        unsafe { executor.poll() };
        while !NVIC::is_pending(Interrupt::ThreadExecutor) {
            sleep();
        }
    }
}

/// Sleeps until an interrupt is pending, and lets it in.
fn sleep() {
    interrupt::free(|_| {
        // Once more, with no interrupt to come between this and the sleep.
        if !NVIC::is_pending(Interrupt::ThreadExecutor) {
            let from = Counts::now();
            asm::dsb();
            asm::wfi();
            let slept = Counts::now() - from;
            IDLE.store(IDLE.load(Ordering::Relaxed).wrapping_add(slept as u32), Ordering::Relaxed);
        }
    });
    // What ended the sleep runs here, before the flag is looked at again.
    asm::isb();
}
