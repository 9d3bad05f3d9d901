//! The clock: `embassy-time` in microseconds, and a free-running counter of 40 ns for measuring.
//!
//! Two CMSDK APB timers (DDI 0479, section 4.4) count down at 25 MHz. Timer 0 runs freely over a period of 2^27 us, so
//! that microseconds need no 64-bit division (25 counts are one): whole periods are the upper bits, and the count in the
//! period over 25 is the rest. Timer 1 counts once to the next alarm. QEMU runs one instruction in 1 ns of that time.

use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Waker;
use core::{cell::RefCell, ops::Sub};

use critical_section::{CriticalSection, Mutex};
use embassy_time_driver::{Driver, TICK_HZ};
use embassy_time_queue_utils::Queue;

use crate::interrupts::{self, Interrupt};
use crate::register::Register;

/// The timers' clock in Hz.
pub const HZ: u64 = 25_000_000;
/// Counts of one tick of `embassy-time`, a microsecond.
const COUNTS: u32 = (HZ / TICK_HZ) as u32;
const _: () = assert!(HZ.is_multiple_of(TICK_HZ));
/// Ticks of timer 0's period, as a power of two: the largest whose counts fit 32 bits.
const PERIOD_BITS: u32 = 27;
/// Counts of timer 0's period, 134 s.
const PERIOD: u32 = COUNTS << PERIOD_BITS;
/// Longest alarm at once, in counts; a later one is reached in steps.
const LONGEST_ALARM: u64 = 1 << 31;

/// CTRL: count, and raise the interrupt on reaching zero.
const ENABLE: u32 = 1;
const INTERRUPT_ENABLE: u32 = 1 << 3;
/// INTSTATUS: zero was reached; written back to clear.
const REACHED_ZERO: u32 = 1;

struct CmsdkTimer {
    ctrl: Register,
    value: Register,
    reload: Register,
    int_status: Register,
}

impl CmsdkTimer {
    /// # Safety
    /// A CMSDK APB timer is at `base`.
    const unsafe fn at(base: usize) -> Self {
        // SAFETY: registers of the timer, which is no DMA master.
        unsafe {
            Self {
                ctrl: Register::at(base),
                value: Register::at(base + 4),
                reload: Register::at(base + 8),
                int_status: Register::at(base + 0xc),
            }
        }
    }
}

// SAFETY: hw/arm/mps2.c has the timers there.
static TIMER0: CmsdkTimer = unsafe { CmsdkTimer::at(0x4000_0000) };
// SAFETY: as above.
static TIMER1: CmsdkTimer = unsafe { CmsdkTimer::at(0x4000_1000) };

/// Periods of timer 0 that are over.
static PERIODS: AtomicU32 = AtomicU32::new(0);

/// A moment as timer 0 tells it.
#[derive(Clone, Copy)]
struct Moment {
    /// Whole periods before.
    periods: u32,
    /// Counts since, at most [`PERIOD`].
    counts: u32,
}

impl Moment {
    /// The moment at which timer 0 read `value`, `reached_zero` if its interrupt was pending then.
    ///
    /// The counter goes 2, 1, 0, PERIOD - 1: a period begins at zero, not at the reload. At zero the interrupt may or may
    /// not be pending yet; both give the same time.
    fn new(periods: u32, value: u32, reached_zero: bool) -> Self {
        match (reached_zero, value) {
            (false, value) => Self { periods, counts: PERIOD - value },
            (true, 0) => Self { periods: periods.wrapping_add(1), counts: 0 },
            (true, value) => Self { periods: periods.wrapping_add(1), counts: PERIOD - value },
        }
    }

    fn now(_: CriticalSection<'_>) -> Self {
        let periods = PERIODS.load(Ordering::Relaxed);
        let value = TIMER0.value.read();
        if TIMER0.int_status.read() & REACHED_ZERO == 0 {
            Self::new(periods, value, false)
        } else {
            // The first reading may be from before the wrap.
            Self::new(periods, TIMER0.value.read(), true)
        }
    }

    /// Ticks of `embassy-time`.
    fn ticks(self) -> u64 {
        (u64::from(self.periods) << PERIOD_BITS) + u64::from(self.counts / COUNTS)
    }
}

/// A moment in counts of 40 ns since [`start`]; never wraps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Counts(pub u64);

impl Counts {
    /// The present.
    pub fn now() -> Self {
        let moment = critical_section::with(Moment::now);
        Self(u64::from(moment.periods) * u64::from(PERIOD) + u64::from(moment.counts))
    }
}

impl Sub for Counts {
    type Output = u64;

    fn sub(self, earlier: Self) -> u64 {
        self.0.saturating_sub(earlier.0)
    }
}

struct TimeDriver {
    queue: Mutex<RefCell<Queue>>,
}

impl TimeDriver {
    /// Sets timer 1 to the next alarm of the queue, after waking those that are due.
    fn rearm(cs: CriticalSection<'_>, queue: &mut Queue) {
        TIMER1.ctrl.write(0);
        TIMER1.int_status.write(REACHED_ZERO);
        let now = Moment::now(cs).ticks();
        let next = queue.next_expiration(now);
        if next != u64::MAX {
            // Of the next tick at the earliest, since what was due is out of the queue.
            let counts = (next - now).saturating_mul(u64::from(COUNTS)).min(LONGEST_ALARM);
            TIMER1.value.write(counts as u32);
            TIMER1.ctrl.write(ENABLE | INTERRUPT_ENABLE);
        }
    }
}

impl Driver for TimeDriver {
    fn now(&self) -> u64 {
        critical_section::with(Moment::now).ticks()
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|cs| {
            let mut queue = self.queue.borrow_ref_mut(cs);
            if queue.schedule_wake(at, waker) {
                Self::rearm(cs, &mut queue);
            }
        });
    }
}

embassy_time_driver::time_driver_impl!(static DRIVER: TimeDriver = TimeDriver {
    queue: Mutex::new(RefCell::new(Queue::new())),
});

/// Starts both timers. Call it before anything asks for the time.
pub fn start() {
    // A write to RELOAD sets the count too.
    TIMER0.reload.write(PERIOD - 1);
    TIMER0.ctrl.write(ENABLE | INTERRUPT_ENABLE);
    // Reload 0: timer 1 counts once.
    TIMER1.reload.write(0);
    interrupts::enable(Interrupt::Timer0);
    interrupts::enable(Interrupt::Timer1);
}

pub(crate) extern "C" fn on_wrap() {
    critical_section::with(|_| {
        TIMER0.int_status.write(REACHED_ZERO);
        PERIODS.store(PERIODS.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    });
}

pub(crate) extern "C" fn on_alarm() {
    critical_section::with(|cs| TimeDriver::rearm(cs, &mut DRIVER.queue.borrow_ref_mut(cs)));
}
