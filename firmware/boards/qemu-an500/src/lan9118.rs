//! The network: SMSC's LAN9118 (data sheet DS00002266) behind `embassy_net_driver::Driver`.
//!
//! The interrupt drains the device's FIFO into a ring of [`FRAMES`] frames, and the stack works on a frame in the ring.
//! Waking only would leave frames in the FIFO until the stack's executor comes to them: QEMU's holds six full ones, and
//! drops the next without a word. Words are read once either way, so the ring costs its memory and one interrupt a burst.
//!
//! A frame begins at a whole word of its slot, so that what follows the 10 bytes of a DCA1000 header behind Ethernet (14),
//! IPv4 (20) and UDP (8) does too.

use core::arch::asm;
use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::Context;

use critical_section::Mutex;
use embassy_net_driver::{Capabilities, Driver, HardwareAddress, LinkState};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::waitqueue::AtomicWaker;
use embassy_sync::zerocopy_channel::{Channel, Receiver, Sender};
use static_cell::{ConstStaticCell, StaticCell};

use crate::interrupts::{self, Interrupt};
use crate::register::Register;

/// Frames of the ring.
pub const FRAMES: usize = 64;
/// Bytes of the longest frame, without its check sum: 1500 of payload.
pub const FRAME_BYTES: usize = 1514;
/// Words that one `ldm` takes from the FIFO, which answers at eight addresses (data sheet 3.10).
const BLOCK_WORDS: usize = 8;
/// Blocks of a slot: the longest frame with its check sum, padded to a block.
const BLOCKS: usize = (FRAME_BYTES + CHECK_SUM_BYTES).div_ceil(4 * BLOCK_WORDS);
const CHECK_SUM_BYTES: usize = 4;

const BASE: usize = 0xa000_0000;

/// The register `offset` bytes into the device.
const fn register(offset: usize) -> Register {
    // SAFETY: hw/arm/mps2.c has the device at `BASE`, of 256 bytes, and no register makes it write memory by itself.
    unsafe { Register::at(BASE + offset) }
}

// Direct registers (data sheet 5.2, 5.3).
const RX_DATA_FIFO: usize = BASE;
const TX_DATA_FIFO: Register = register(0x20);
const RX_STATUS_FIFO: Register = register(0x40);
const TX_STATUS_FIFO: Register = register(0x48);
const ID_REV: Register = register(0x50);
const IRQ_CFG: Register = register(0x54);
const INT_STS: Register = register(0x58);
const INT_EN: Register = register(0x5c);
const FIFO_INT: Register = register(0x68);
const RX_CFG: Register = register(0x6c);
const TX_CFG: Register = register(0x70);
const HW_CFG: Register = register(0x74);
const RX_FIFO_INF: Register = register(0x7c);
const TX_FIFO_INF: Register = register(0x80);
const MAC_CSR_CMD: Register = register(0xa4);
const MAC_CSR_DATA: Register = register(0xa8);

/// ID_REV 31:16 of this device.
const ID: u32 = 0x0118;
/// HW_CFG: soft reset, which clears itself; store and forward, which must be set; kilobytes of the transmit FIFOs.
const SRST: u32 = 1;
const SF: u32 = 1 << 20;
const TX_FIF_SZ: u32 = 2 << 16;
/// IRQ_CFG: let interrupts out; active high; push-pull.
const IRQ_EN: u32 = 1 << 8;
const IRQ_POL: u32 = 1 << 4;
const IRQ_TYPE: u32 = 1;
/// INT_STS, INT_EN: more entries in the RX status FIFO than FIFO_INT 7:0; an interrupt of the PHY.
const RSFL_INT: u32 = 1 << 3;
const PHY_INT: u32 = 1 << 18;
/// RX_CFG 31:30: frames padded to 32 bytes, a block.
const RX_EA_32: u32 = 2 << 30;
/// TX_CFG: transmitter on.
const TX_ON: u32 = 1 << 1;
/// RX status (3.13.3): error summary, and the bytes with check sum in 29:16.
const RX_ERROR: u32 = 1 << 15;
/// TX command A (3.12.2): first and last segment of the frame; its bytes in 10:0.
const TX_WHOLE_FRAME: u32 = 1 << 13 | 1 << 12;
/// Bytes that the two TX commands take.
const TX_COMMAND_BYTES: u32 = 8;

// Registers of the MAC, behind MAC_CSR_CMD and MAC_CSR_DATA (5.4).
const MAC_CR: u32 = 1;
const ADDRH: u32 = 2;
const ADDRL: u32 = 3;
const MII_ACC: u32 = 6;
const MII_DATA: u32 = 7;
/// MAC_CSR_CMD: busy; a read.
const CSR_BUSY: u32 = 1 << 31;
const CSR_READ: u32 = 1 << 30;
/// MAC_CR: full duplex, transmitter, receiver.
const FDPX: u32 = 1 << 20;
const TXEN: u32 = 1 << 3;
const RXEN: u32 = 1 << 2;

// Registers of the internal PHY, at address 1, behind MII_ACC and MII_DATA (5.5).
const PHY_CONTROL: u32 = 0;
const PHY_STATUS: u32 = 1;
const PHY_INT_SOURCE: u32 = 29;
const PHY_INT_MASK: u32 = 30;
const PHY_ADDRESS: u32 = 1 << 11;
const MII_WRITE: u32 = 1 << 1;
const MII_BUSY: u32 = 1;
/// PHY_CONTROL: auto-negotiation on, and begun anew.
const AUTO_NEGOTIATE: u32 = 1 << 12 | 1 << 9;
/// PHY_STATUS: link is up.
const LINK_UP: u32 = 1 << 2;
/// PHY_INT_SOURCE, PHY_INT_MASK: auto-negotiation complete, link down.
const LINK_CHANGED: u32 = 1 << 6 | 1 << 4;

/// Looks at a register before the device counts as dead.
const PATIENCE: u32 = 1_000_000;

/// Why the device cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub enum InitError {
    /// Another or no device at its address; ID_REV's upper half.
    Id(u16),
    /// It does not come out of reset.
    Reset,
}

impl core::fmt::Display for InitError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Id(id) => write!(f, "no LAN9118 on the bus, its ID reads {id:#06x}"),
            Self::Reset => f.write_str("the LAN9118 does not come out of reset"),
        }
    }
}

impl core::error::Error for InitError {}

/// As the PHY last said; asking it anew takes 50 us on hardware.
static LINK: AtomicBool = AtomicBool::new(false);
static LINK_WAKER: AtomicWaker = AtomicWaker::new();

/// A slot of the ring.
#[repr(C, align(4))]
struct Frame {
    words: [[u32; BLOCK_WORDS]; BLOCKS],
    /// Without the check sum.
    bytes: usize,
}

impl Frame {
    const EMPTY: Self = Self { words: [[0; BLOCK_WORDS]; BLOCKS], bytes: 0 };

    fn as_mut_slice(&mut self) -> &mut [u8] {
        // SAFETY: words are bytes without padding, and any byte is a valid one of a word.
        let (_, bytes, _) = unsafe { self.words.as_flattened_mut().align_to_mut() };
        &mut bytes[..self.bytes]
    }
}

type Ring = Channel<'static, CriticalSectionRawMutex, Frame>;

static SLOTS: ConstStaticCell<[Frame; FRAMES]> = ConstStaticCell::new([Frame::EMPTY; FRAMES]);
static RING: StaticCell<Ring> = StaticCell::new();
/// The end of the ring that the interrupt writes.
static RECEIVED: Mutex<RefCell<Option<Sender<'static, CriticalSectionRawMutex, Frame>>>> =
    Mutex::new(RefCell::new(None));

/// Moves a block from the RX FIFO to `block`.
#[inline(always)]
fn read_block(block: &mut [u32; BLOCK_WORDS]) {
    // SAFETY: the FIFO answers at eight consecutive words, `block` has eight, and interrupts are masked (a restarted
    // `ldm` would lose words). r6, r7 and r9 are the compiler's own.
    unsafe {
        asm!(
            "ldm {fifo}, {{r0, r1, r2, r3, r4, r5, r8, r12}}",
            "stm {block}, {{r0, r1, r2, r3, r4, r5, r8, r12}}",
            fifo = in(reg) RX_DATA_FIFO,
            block = in(reg) block.as_mut_ptr(),
            out("r0") _, out("r1") _, out("r2") _, out("r3") _,
            out("r4") _, out("r5") _, out("r8") _, out("r12") _,
            options(nostack, preserves_flags),
        );
    }
}

pub(crate) extern "C" fn on_interrupt() {
    if INT_STS.read() & PHY_INT != 0 {
        read_link();
    }
    // Cleared first: a frame that comes from here on raises it again.
    INT_STS.write(RSFL_INT);
    // RX status entries, 23:16.
    while RX_FIFO_INF.read() >> 16 & 0xff != 0 {
        // A critical section a frame, so that other devices need not wait for a burst.
        critical_section::with(|cs| {
            let status = RX_STATUS_FIFO.read();
            let length = (status >> 16 & 0x3fff) as usize;
            let blocks = length.div_ceil(4 * BLOCK_WORDS);
            let good = status & RX_ERROR == 0 && blocks <= BLOCKS && length > CHECK_SUM_BYTES;
            let mut ring = RECEIVED.borrow_ref_mut(cs);
            match ring.as_mut().filter(|_| good).and_then(Sender::try_send) {
                Some(frame) => {
                    frame.words.iter_mut().take(blocks).for_each(read_block);
                    frame.bytes = length - CHECK_SUM_BYTES;
                    if let Some(ring) = ring.as_mut() {
                        ring.send_done();
                    }
                }
                None => {
                    // No room, or damaged; what is missing of the radar shows in its numbers. QEMU's RX_FFWD leaves its FIFO's count wrong, so words are read and forgotten.
                    (0..blocks).for_each(|_| read_block(&mut [0; BLOCK_WORDS]));
                }
            }
        });
    }
}

/// Waits until `done`.
fn wait(mut done: impl FnMut() -> bool) -> bool {
    (0..PATIENCE).any(|_| done())
}

fn mac_write(register: u32, value: u32) {
    MAC_CSR_DATA.write(value);
    MAC_CSR_CMD.write(CSR_BUSY | register);
    wait(|| MAC_CSR_CMD.read() & CSR_BUSY == 0);
}

fn mac_read(register: u32) -> u32 {
    MAC_CSR_CMD.write(CSR_BUSY | CSR_READ | register);
    wait(|| MAC_CSR_CMD.read() & CSR_BUSY == 0);
    MAC_CSR_DATA.read()
}

fn phy_write(register: u32, value: u32) {
    mac_write(MII_DATA, value);
    mac_write(MII_ACC, PHY_ADDRESS | register << 6 | MII_WRITE | MII_BUSY);
    wait(|| mac_read(MII_ACC) & MII_BUSY == 0);
}

fn phy_read(register: u32) -> u32 {
    mac_write(MII_ACC, PHY_ADDRESS | register << 6 | MII_BUSY);
    wait(|| mac_read(MII_ACC) & MII_BUSY == 0);
    mac_read(MII_DATA)
}

/// Clears the PHY's interrupt and sees whether the link is up.
fn read_link() {
    phy_read(PHY_INT_SOURCE);
    LINK.store(phy_read(PHY_STATUS) & LINK_UP != 0, Ordering::Relaxed);
    LINK_WAKER.wake();
}

/// The device, started.
pub struct Lan9118 {
    mac: [u8; 6],
    received: Receiver<'static, CriticalSectionRawMutex, Frame>,
    transmit: [u8; FRAME_BYTES],
}

impl Lan9118 {
    /// Resets and starts the device with the address `mac`.
    ///
    /// # Panics
    /// When called twice.
    pub fn start(mac: [u8; 6]) -> Result<Self, InitError> {
        let id = ID_REV.read() >> 16;
        if id != ID {
            return Err(InitError::Id(id as u16));
        }
        HW_CFG.write(SRST);
        if !wait(|| HW_CFG.read() & SRST == 0) {
            return Err(InitError::Reset);
        }
        // The least for sending, one frame, leaves 13,440 bytes for reception (table 5-3; QEMU keeps its 10,560).
        HW_CFG.write(SF | TX_FIF_SZ);
        RX_CFG.write(RX_EA_32);
        TX_CFG.write(TX_ON);
        let [a, b, c, d, e, f] = mac;
        mac_write(ADDRL, u32::from_le_bytes([a, b, c, d]));
        mac_write(ADDRH, u32::from_le_bytes([e, f, 0, 0]));
        phy_write(PHY_INT_MASK, LINK_CHANGED);
        phy_write(PHY_CONTROL, AUTO_NEGOTIATE);
        read_link();

        mac_write(MAC_CR, FDPX | TXEN | RXEN);

        let (sender, received) = RING.init(Channel::new(SLOTS.take())).split();
        critical_section::with(|cs| RECEIVED.borrow_ref_mut(cs).replace(sender));
        // At the first frame.
        FIFO_INT.write(0);
        INT_STS.write(u32::MAX);
        INT_EN.write(RSFL_INT | PHY_INT);
        IRQ_CFG.write(IRQ_EN | IRQ_POL | IRQ_TYPE);
        interrupts::enable(Interrupt::Ethernet);
        Ok(Self { mac, received, transmit: [0; FRAME_BYTES] })
    }

    /// Takes what became of frames sent out of the TX status FIFO, and says whether another one fits.
    fn can_transmit() -> bool {
        let inf = TX_FIFO_INF.read();
        // TX status entries, 23:16; free bytes, 15:0.
        for _ in 0..(inf >> 16 & 0xff) {
            TX_STATUS_FIFO.read();
        }
        inf & 0xffff >= FRAME_BYTES.next_multiple_of(4) as u32 + TX_COMMAND_BYTES
    }
}

impl Driver for Lan9118 {
    type RxToken<'a> = RxToken<'a>;
    type TxToken<'a> = TxToken<'a>;

    fn receive(&mut self, cx: &mut Context<'_>) -> Option<(RxToken<'_>, TxToken<'_>)> {
        if self.received.poll_receive(cx).is_pending() {
            return None;
        }
        if !Self::can_transmit() {
            cx.waker().wake_by_ref();
            return None;
        }
        Some((RxToken(&mut self.received), TxToken(&mut self.transmit)))
    }

    fn transmit(&mut self, cx: &mut Context<'_>) -> Option<TxToken<'_>> {
        if !Self::can_transmit() {
            // It takes 123 us at most, the longest frame at 100 Mbit/s.
            cx.waker().wake_by_ref();
            return None;
        }
        Some(TxToken(&mut self.transmit))
    }

    fn link_state(&mut self, cx: &mut Context<'_>) -> LinkState {
        LINK_WAKER.register(cx.waker());
        if LINK.load(Ordering::Relaxed) { LinkState::Up } else { LinkState::Down }
    }

    fn capabilities(&self) -> Capabilities {
        let mut capabilities = Capabilities::default();
        capabilities.max_transmission_unit = FRAME_BYTES;
        capabilities
    }

    fn hardware_address(&self) -> HardwareAddress {
        HardwareAddress::Ethernet(self.mac)
    }
}

/// A frame in the ring.
pub struct RxToken<'a>(&'a mut Receiver<'static, CriticalSectionRawMutex, Frame>);

impl embassy_net_driver::RxToken for RxToken<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, f: F) -> R {
        let result = match self.0.try_receive() {
            Some(frame) => f(frame.as_mut_slice()),
            None => f(&mut []),
        };
        self.0.receive_done();
        result
    }
}

/// Room for a frame in the transmit FIFO, and where it is made.
pub struct TxToken<'a>(&'a mut [u8; FRAME_BYTES]);

impl embassy_net_driver::TxToken for TxToken<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        let frame = &mut self.0[..length];
        let result = f(frame);
        let length = length as u32;
        TX_DATA_FIFO.write(TX_WHOLE_FRAME | length);
        TX_DATA_FIFO.write(length);
        let (words, rest) = frame.as_chunks();
        for word in words {
            TX_DATA_FIFO.write(u32::from_le_bytes(*word));
        }
        if !rest.is_empty() {
            let mut word = [0; 4];
            word[..rest.len()].copy_from_slice(rest);
            TX_DATA_FIFO.write(u32::from_le_bytes(word));
        }
        result
    }
}
