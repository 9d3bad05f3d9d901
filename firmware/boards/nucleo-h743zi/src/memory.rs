//! Memory outside DTCM, the MPU's regions and the caches.
//!
//! The Cortex-M7's D-cache does not see what DMAs write, and embassy-stm32 0.6 does no cache maintenance for Ethernet or
//! UART; its own examples leave the D-cache off. Here it is on, since the cubes in AXI SRAM live by it, and what a DMA
//! touches is not cached (AN4839, on DMA coherency): both caches and the DMAs are then right by construction.
//!
//! | region | address | why |
//! |---|---|---|
//! | SRAM1 | 0x3000_0000 | descriptors and buffers of Ethernet, ring of the UART |
//! | SRAM4 | 0x3800_0000 | words that outlive a reset must not wait in a dirty line |
//! | CONFIG | 0x081C_0000 | flash that changes while the program runs |
//! | system memory | 0x1FF0_0000 | no speculative reads, which the flash controller takes for an intrusion (RDSERR) |
//! | below DTCM | 0x1FF8_0000 | no access: where a stack that overflows arrives |

use core::arch::naked_asm;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::{CPUID, MPU, SCB};
use embassy_stm32::eth::PacketQueue;
use num_complex::Complex;
use rfhoi_bridge::{CUBE_CELLS, Handover};

use crate::clocks::Revision;

/// Packets that wait to be sent.
pub const TX_PACKETS: usize = 16;
/// Packets that wait for the network task: 7 ms of a burst, at 127 us a datagram.
pub const RX_PACKETS: usize = 56;
/// Bytes of the radar's data UART that wait for their task: 178 ms at 921,600 baud.
pub const RADAR_RING_BYTES: usize = 16 * 1024;

/// Runs before any memory is initialised: switches on the clocks of SRAM1 to 3, without which the processor does not reach
/// them (RM0433, RCC_AHB2ENR), and loads section `.dtcm`.
#[unsafe(naked)]
#[unsafe(export_name = "__pre_init")]
unsafe extern "C" fn pre_init() {
    naked_asm!(
        // RCC_AHB2ENR; a read after the write lets it settle.
        "movw r0, #0x44dc",
        "movt r0, #0x5802",
        "ldr r1, [r0]",
        "orr r1, r1, #0xe0000000",
        "str r1, [r0]",
        "ldr r1, [r0]",
        "dsb",
        "movw r0, :lower16:__sdtcm",
        "movt r0, :upper16:__sdtcm",
        "movw r1, :lower16:__edtcm",
        "movt r1, :upper16:__edtcm",
        "movw r2, :lower16:__sidtcm",
        "movt r2, :upper16:__sidtcm",
        "b 2f",
        "1: ldr r3, [r2], #4",
        "str r3, [r0], #4",
        "2: cmp r0, r1",
        "blo 1b",
        "bx lr",
    )
}

/// A static that is not zeroed at start.
#[repr(transparent)]
struct Uninit<T>(UnsafeCell<MaybeUninit<T>>);

// SAFETY: the only access is in `Memory::take`, which hands each out once.
unsafe impl<T: Send> Sync for Uninit<T> {}

impl<T> Uninit<T> {
    const fn new() -> Self {
        Self(UnsafeCell::new(MaybeUninit::uninit()))
    }

    /// Fills the memory with zeros and lends it.
    ///
    /// # Safety
    /// Zeros must be a value of `T`, and this must be called once.
    #[allow(clippy::mut_from_ref)]
    unsafe fn zeroed(&'static self) -> &'static mut T {
        // SAFETY: called once, so that no other reference is there; zeros are a value of `T`.
        unsafe {
            let memory = &mut *self.0.get();
            memory.as_mut_ptr().write_bytes(0, 1);
            memory.assume_init_mut()
        }
    }
}

#[unsafe(link_section = ".axisram")]
static CUBES: Uninit<[Complex<i16>; CUBE_CELLS]> = Uninit::new();
#[unsafe(link_section = ".axisram")]
static HANDOVER: Uninit<Handover> = Uninit::new();
#[unsafe(link_section = ".sram1")]
static PACKETS: Uninit<PacketQueue<TX_PACKETS, RX_PACKETS>> = Uninit::new();
#[unsafe(link_section = ".sram1")]
static RADAR_RING: Uninit<[u8; RADAR_RING_BYTES]> = Uninit::new();

/// Memory for the application and the drivers.
pub struct Memory {
    /// The gated cubes.
    pub cubes: &'static mut [Complex<i16>; CUBE_CELLS],
    /// Packets between the executors.
    pub handover: &'static Handover,
    /// Rings of the Ethernet controller.
    pub packets: &'static mut PacketQueue<TX_PACKETS, RX_PACKETS>,
    /// Ring of the radar's data UART.
    pub radar_ring: &'static mut [u8; RADAR_RING_BYTES],
}

impl Memory {
    /// Sets up regions and caches and lends the memories; `None` at the second call.
    pub fn take(core: &mut cortex_m::Peripherals, revision: Revision) -> Option<Self> {
        static TAKEN: AtomicBool = AtomicBool::new(false);
        if TAKEN.swap(true, Ordering::Relaxed) {
            return None;
        }
        if revision == Revision::Y {
            quiet_axi_sram();
        }
        protect(&mut core.MPU);
        cache(&mut core.SCB, &mut core.CPUID);
        // SAFETY: once, by the flag above; zeros are values of integers and of the descriptors' registers
        // (`PacketQueue::init` does the same).
        unsafe {
            Some(Self {
                cubes: CUBES.zeroed(),
                handover: (*HANDOVER.0.get()).write(Handover::new()),
                packets: PACKETS.zeroed(),
                radar_ring: RADAR_RING.zeroed(),
            })
        }
    }
}

/// On revision Y, reads of AXI SRAM may be corrupted unless only one is issued at a time (ES0392).
fn quiet_axi_sram() {
    /// AXI_TARG7_FN_MOD, bit READ_ISS_OVERRIDE (RM0433, AXI interconnect).
    const TARGET_7_ISSUING: *mut u32 = 0x5100_8108 as *mut u32;
    // SAFETY: a register of the AXI interconnect that nothing else writes.
    unsafe { TARGET_7_ISSUING.write_volatile(1) }
}

/// What a region allows (ARMv7-M, B3.5.9: bits XN, AP, TEX, S, C, B of MPU_RASR).
#[derive(Clone, Copy)]
#[repr(u32)]
enum Access {
    /// Read and write, not executed, normal memory that is not cached.
    Uncached = (1 << 28) | (0b011 << 24) | (0b001 << 19) | (1 << 18),
    /// Read, not executed, in the program's order and never ahead of it.
    Ordered = (1 << 28) | (0b110 << 24) | (1 << 18),
    /// A fault.
    None = 1 << 28,
}

/// Base, size as a power of two, and access of each region; all else keeps the default map.
const REGIONS: [(u32, u32, Access); 5] = [
    (0x3000_0000, 17, Access::Uncached),
    (0x3800_0000, 16, Access::Uncached),
    (0x081C_0000, 18, Access::Uncached),
    (0x1FF0_0000, 19, Access::Ordered),
    (0x1FF8_0000, 19, Access::None),
];

fn protect(mpu: &mut MPU) {
    const DEFAULT_MAP: u32 = 1 << 2;
    const ENABLE: u32 = 1;
    cortex_m::asm::dmb();
    // SAFETY: caches are off and no DMA runs yet, so that no line or buffer is left behind by new attributes; the regions
    // lie where this program has no code, stack or cached data.
    unsafe {
        mpu.ctrl.write(0);
        for (number, (base, power, access)) in (0..).zip(REGIONS) {
            mpu.rnr.write(number);
            mpu.rbar.write(base);
            mpu.rasr.write(access as u32 | ((power - 1) << 1) | ENABLE);
        }
        mpu.ctrl.write(DEFAULT_MAP | ENABLE);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

fn cache(scb: &mut SCB, cpuid: &mut CPUID) {
    scb.enable_icache();
    scb.enable_dcache(cpuid);
}
