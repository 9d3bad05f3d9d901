//! The board's interrupts: numbers, priorities, vector table, and the executor that runs in one of them.
//!
//! Priorities, highest first: devices and timers; the network's executor; thread mode. A device's interrupt therefore
//! comes through while the stack runs, and the stack while the radar's frame is computed.

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use embassy_executor::{InterruptExecutor, SendSpawner};

use crate::{lan9118, timer, uart};

/// Interrupts of the mps2-an500 (ARM DAI 0400 for the FPGA image AN500; QEMU `hw/arm/mps2.c`), as far as they are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u16)]
pub enum Interrupt {
    /// UART0 received a byte.
    Uart0Rx = 0,
    /// UART0 sent a byte.
    Uart0Tx = 1,
    /// UART1 received a byte.
    Uart1Rx = 2,
    /// UART1 sent a byte.
    Uart1Tx = 3,
    /// Timer 0 reached zero.
    Timer0 = 8,
    /// Timer 1 reached zero.
    Timer1 = 9,
    /// LAN9118.
    Ethernet = 13,
    /// Software interrupt of the network's executor; belongs to a touch screen that QEMU does not have.
    NetworkExecutor = 14,
    /// Never enabled: its pending bit says that thread mode has work ([`crate::idle`]); belongs to a port that QEMU does
    /// not have.
    ThreadExecutor = 15,
}

/// Lines into the NVIC.
const LINES: usize = 32;

// SAFETY: the numbers are below `LINES` and do not change.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Priority of an interrupt; a lower value comes first. Only the top three bits count on every Cortex-M7.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum Priority {
    Device = 0x40,
    Executor = 0x80,
}

fn set_priority(interrupt: Interrupt, priority: Priority) {
    let number = usize::from(interrupt.number());
    // SAFETY: a byte store to IPR; priorities are set before the interrupt is enabled, and no critical section here is
    // built on BASEPRI.
    unsafe { (*NVIC::PTR).ipr[number].write(priority as u8) }
}

/// Lets a device's interrupt through.
pub(crate) fn enable(interrupt: Interrupt) {
    set_priority(interrupt, Priority::Device);
    // SAFETY: the handler is in the vector table below, and critical sections are built on PRIMASK, not on masks.
    unsafe { NVIC::unmask(interrupt) }
}

static NETWORK: InterruptExecutor = InterruptExecutor::new();

/// Starts the executor of the network, which preempts thread mode.
///
/// # Panics
/// When called twice.
pub fn start_network_executor() -> SendSpawner {
    set_priority(Interrupt::NetworkExecutor, Priority::Executor);
    NETWORK.start(Interrupt::NetworkExecutor)
}

extern "C" fn network_executor() {
    // SAFETY: called from the executor's interrupt only, which `start` enables.
    unsafe { NETWORK.on_interrupt() }
}

extern "C" fn uart0_rx() {
    uart::UART0.on_rx();
}

extern "C" fn uart0_tx() {
    uart::UART0.on_tx();
}

extern "C" fn uart1_rx() {
    uart::UART1.on_rx();
}

extern "C" fn uart1_tx() {
    uart::UART1.on_tx();
}

/// An entry of the vector table: `None` is zero, as for reserved ones, and is never enabled.
type Vector = Option<extern "C" fn()>;

/// The part of the vector table behind the core's own exceptions.
// SAFETY (link_section, no_mangle): the name and place that cortex-m-rt's `device` feature asks for, 32 words.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
static __INTERRUPTS: [Vector; LINES] = {
    let mut table: [Vector; LINES] = [None; LINES];
    table[Interrupt::Uart0Rx as usize] = Some(uart0_rx);
    table[Interrupt::Uart0Tx as usize] = Some(uart0_tx);
    table[Interrupt::Uart1Rx as usize] = Some(uart1_rx);
    table[Interrupt::Uart1Tx as usize] = Some(uart1_tx);
    table[Interrupt::Timer0 as usize] = Some(timer::on_wrap);
    table[Interrupt::Timer1 as usize] = Some(timer::on_alarm);
    table[Interrupt::Ethernet as usize] = Some(lan9118::on_interrupt);
    table[Interrupt::NetworkExecutor as usize] = Some(network_executor);
    table
};
