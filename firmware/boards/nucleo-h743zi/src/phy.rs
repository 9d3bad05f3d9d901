//! The board's Ethernet transceiver, a LAN8742A at address 0 (UM2407, Ethernet).
//!
//! embassy-stm32 sets its MAC to 100 Mbit/s in full duplex for good, so this transceiver offers nothing else; its generic
//! one offers 10 Mbit/s and half duplex too, and waits for a silent chip without end.

use core::future::Future as _;
use core::task::Context;

use embassy_stm32::eth::{Phy, StationManagement};
use embassy_time::{Duration, Instant, Timer, block_for};

/// How often the link is looked at.
const POLL: Duration = Duration::from_millis(500);
/// How long a reset may take (LAN8742A data sheet, soft reset: 0.5 s).
const RESET: Duration = Duration::from_millis(500);
/// Pause between two looks at the reset.
const RESET_STEP: Duration = Duration::from_millis(1);

/// Registers of IEEE 802.3, clause 22.
mod register {
    /// Basic control.
    pub const CONTROL: u8 = 0;
    /// Basic status.
    pub const STATUS: u8 = 1;
    /// What is offered to the other end.
    pub const ADVERTISEMENT: u8 = 4;
}

const CONTROL_RESET: u16 = 1 << 15;
const CONTROL_NEGOTIATE: u16 = 1 << 12;
const CONTROL_RESTART: u16 = 1 << 9;
const STATUS_NEGOTIATED: u16 = 1 << 5;
const STATUS_LINK: u16 = 1 << 2;
/// 100BASE-TX in full duplex, and the selector of 802.3.
const ADVERTISE_100_FULL: u16 = (1 << 8) | 1;
/// What a bus without a chip reads.
const NOBODY: u16 = 0xffff;

/// The transceiver.
pub struct Lan8742<S> {
    bus: S,
    address: u8,
    /// When the link is looked at next, and how it was last.
    next: Instant,
    up: bool,
}

impl<S: StationManagement> Lan8742<S> {
    /// The transceiver at `address` of `bus`.
    pub fn new(bus: S, address: u8) -> Self {
        Self { bus, address, next: Instant::MIN, up: false }
    }

    fn read(&mut self, register: u8) -> u16 {
        self.bus.smi_read(self.address, register)
    }

    fn write(&mut self, register: u8, value: u16) {
        self.bus.smi_write(self.address, register, value);
    }
}

impl<S: StationManagement> Phy for Lan8742<S> {
    fn phy_reset(&mut self) {
        self.write(register::CONTROL, CONTROL_RESET);
        for _ in 0..RESET.as_millis() / RESET_STEP.as_millis() {
            block_for(RESET_STEP);
            if self.read(register::CONTROL) & CONTROL_RESET == 0 {
                return;
            }
        }
        defmt::error!("the Ethernet transceiver does not answer");
    }

    fn phy_init(&mut self) {
        self.write(register::ADVERTISEMENT, ADVERTISE_100_FULL);
        self.write(register::CONTROL, CONTROL_NEGOTIATE | CONTROL_RESTART);
    }

    fn poll_link(&mut self, cx: &mut Context<'_>) -> bool {
        // The IP stack asks with every datagram, and the bus takes 26 us and more for an answer.
        if self.next <= Instant::now() {
            self.next = Instant::now() + POLL;
            let status = self.read(register::STATUS);
            const UP: u16 = STATUS_NEGOTIATED | STATUS_LINK;
            self.up = status != NOBODY && status & UP == UP;
        }
        // Wakes the network's task for the next look.
        let mut timer = core::pin::pin!(Timer::at(self.next));
        let _ = timer.as_mut().poll(cx);
        self.up
    }
}
