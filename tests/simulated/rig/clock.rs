//! The time of Embassy's timers: a counter of each thread's own, which goes on only when it is told to.

use std::cell::RefCell;
use std::task::Waker;

use embassy_time_driver::Driver;
use embassy_time_queue_utils::queue_generic::ConstGenericQueue;
use rfhoi_shared::units::BridgeTime;

/// Tasks that may wait for a time at once; one more wakes another early, which does no harm.
const TIMERS: usize = 256;
const _: () = assert!(embassy_time_driver::TICK_HZ == 1_000_000, "a tick is a unit of `BridgeTime`");

struct Clock {
    now: u64,
    timers: ConstGenericQueue<TIMERS>,
}

impl Clock {
    const fn new() -> Self {
        Self { now: 0, timers: ConstGenericQueue::new() }
    }
}

thread_local! {
    static CLOCK: RefCell<Clock> = const { RefCell::new(Clock::new()) };
}

struct VirtualTime;

impl Driver for VirtualTime {
    fn now(&self) -> u64 {
        CLOCK.with_borrow(|clock| clock.now)
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        CLOCK.with_borrow_mut(|clock| clock.timers.schedule_wake(at, waker));
    }
}

embassy_time_driver::time_driver_impl!(static DRIVER: VirtualTime = VirtualTime);

/// Begins again at 0, without timers.
pub(super) fn reset() {
    CLOCK.set(Clock::new());
}

/// The time.
pub fn now() -> BridgeTime {
    BridgeTime(CLOCK.with_borrow(|clock| clock.now))
}

/// Sets the time.
///
/// # Panics
/// If it would go back.
pub(super) fn set(time: BridgeTime) {
    CLOCK.with_borrow_mut(|clock| {
        assert!(time.0 >= clock.now, "time goes on");
        clock.now = time.0;
    });
}

/// Wakes whoever waited for a time that has come, and says when the next one is due.
pub(super) fn wake() -> Option<BridgeTime> {
    let next = CLOCK.with_borrow_mut(|clock| clock.timers.next_expiration(clock.now));
    (next != u64::MAX).then_some(BridgeTime(next))
}
