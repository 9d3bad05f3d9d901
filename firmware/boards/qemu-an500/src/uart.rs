//! The radar's serial ports: CMSDK APB UARTs (DDI 0479, section 4.5), 8N1.
//!
//! The device holds one byte each way. The receive interrupt moves bytes into a ring of [`RING`] bytes from which the
//! reader takes them; bytes that find the ring full, and those the device lost, are gone. Writing waits for the
//! transmit interrupt. QEMU takes bytes at any speed; the divisor is set as on hardware.

use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_sync::waitqueue::AtomicWaker;
use embedded_io_async::{ErrorType, Read, Write};

use crate::interrupts::{self, Interrupt};
use crate::register::Register;
use crate::timer;

/// Bytes received and not yet read: 44 ms at 921,600 baud.
pub const RING: usize = 4096;

/// STATE: a byte waits to be sent, one was received, one was lost (written back to clear).
const TX_FULL: u32 = 1;
const RX_FULL: u32 = 1 << 1;
const RX_OVERRUN: u32 = 1 << 3;
/// CTRL: both directions, with their interrupts.
const ENABLE_ALL: u32 = 0b1111;
/// INTSTATUS, written back to clear.
const TX_INTERRUPT: u32 = 1;
const RX_INTERRUPT: u32 = 1 << 1;

/// A UART with its ring.
pub struct Port {
    data: Register,
    state: Register,
    ctrl: Register,
    int_status: Register,
    baud_div: Register,
    interrupts: [Interrupt; 2],
    received: Pipe<CriticalSectionRawMutex, RING>,
    sent: AtomicWaker,
}

/// The radar's command line.
// SAFETY: hw/arm/mps2.c has the UART there.
pub static UART0: Port = unsafe { Port::at(0x4000_4000, [Interrupt::Uart0Rx, Interrupt::Uart0Tx]) };
/// The radar's data.
// SAFETY: as above.
pub static UART1: Port = unsafe { Port::at(0x4000_5000, [Interrupt::Uart1Rx, Interrupt::Uart1Tx]) };

impl Port {
    /// # Safety
    /// A CMSDK APB UART is at `base`.
    const unsafe fn at(base: usize, interrupts: [Interrupt; 2]) -> Self {
        // SAFETY: registers of the UART, which is no DMA master.
        unsafe {
            Self {
                data: Register::at(base),
                state: Register::at(base + 4),
                ctrl: Register::at(base + 8),
                int_status: Register::at(base + 0xc),
                baud_div: Register::at(base + 0x10),
                interrupts,
                received: Pipe::new(),
                sent: AtomicWaker::new(),
            }
        }
    }

    /// Opens the port at `baud` per second, at most a sixteenth of the clock; again to change the rate.
    pub fn open(&'static self, baud: u32) -> (Receiver, Sender) {
        self.ctrl.write(0);
        self.baud_div.write((timer::HZ as u32 / baud.max(1)).max(16));
        self.ctrl.write(ENABLE_ALL);
        for interrupt in self.interrupts {
            interrupts::enable(interrupt);
        }
        (Receiver(self), Sender(self))
    }

    fn is_sending(&self) -> bool {
        self.state.read() & TX_FULL != 0
    }

    /// Waits until the device can take a byte.
    async fn wait_sent(&self) {
        poll_fn(|cx| {
            self.sent.register(cx.waker());
            if self.is_sending() { Poll::Pending } else { Poll::Ready(()) }
        })
        .await;
    }

    pub(crate) fn on_rx(&self) {
        // Cleared first: a byte that comes from here on raises it again.
        self.int_status.write(RX_INTERRUPT);
        while self.state.read() & RX_FULL != 0 {
            // Without room it is lost; the protocols above notice.
            let _ = self.received.try_write(&[self.data.read() as u8]);
        }
        if self.state.read() & RX_OVERRUN != 0 {
            self.state.write(RX_OVERRUN);
        }
    }

    pub(crate) fn on_tx(&self) {
        self.int_status.write(TX_INTERRUPT);
        self.sent.wake();
    }
}

/// The receiving half of a [`Port`].
pub struct Receiver(&'static Port);

/// The sending half of a [`Port`].
pub struct Sender(&'static Port);

impl ErrorType for Receiver {
    type Error = Infallible;
}

impl ErrorType for Sender {
    type Error = Infallible;
}

impl Read for Receiver {
    async fn read(&mut self, buf: &mut [u8]) -> Result<usize, Infallible> {
        Ok(self.0.received.read(buf).await)
    }
}

impl Write for Sender {
    async fn write(&mut self, buf: &[u8]) -> Result<usize, Infallible> {
        if buf.is_empty() {
            return Ok(0);
        }
        self.0.wait_sent().await;
        let mut taken = 0;
        for &byte in buf {
            self.0.data.write(byte.into());
            taken += 1;
            if self.0.is_sending() {
                break;
            }
        }
        Ok(taken)
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        self.0.wait_sent().await;
        Ok(())
    }
}
