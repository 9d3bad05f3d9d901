//! AMX: products of u8 and s8 tiles, 16 rows by 64 of k by 16 outputs in one instruction.
//!
//! Its registers are beyond what the compiler knows, so a whole block of products is one piece of assembly. A panel of
//! [`Packed`](crate::Packed) is laid out as its tiles want it: sixteen lines are one.

use std::arch::asm;
use std::arch::x86_64::{__cpuid, __cpuid_count};
use std::marker::PhantomData;
use std::sync::LazyLock;

use super::LANES;
use crate::pack::Line;

/// Of k that a tile covers, and bytes of a tile's row.
pub(crate) const DEPTH: usize = 64;

/// Rows of a tile at most.
pub(crate) const HEIGHT: usize = 16;

/// Sums of a tile of rows by a panel.
pub(crate) type Block = [[i32; LANES]; HEIGHT];

/// Whether the processor has it, and the system lets this process use it.
pub(super) fn is_available() -> bool {
    static AVAILABLE: LazyLock<bool> = LazyLock::new(|| has_instructions() && permitted());
    *AVAILABLE
}

/// Instructions by CPUID, state that the system saves by XCR0: Intel's Software Developer's Manual, volume 1, on AMX.
fn has_instructions() -> bool {
    const OSXSAVE: u32 = 1 << 27;
    const TILE_AND_INT8: u32 = 0b11 << 24;
    const TILE_STATE: u32 = 0b11 << 17;
    if __cpuid(0).eax < 7 || __cpuid(1).ecx & OSXSAVE == 0 {
        return false;
    }
    let enabled: u32;
    // SAFETY: `xgetbv` is there if the system saves extended state, which was just asked; it only reads XCR0.
    unsafe {
        asm!("xgetbv", in("ecx") 0, out("eax") enabled, out("edx") _, options(nomem, nostack, preserves_flags))
    };
    __cpuid_count(7, 0).edx & TILE_AND_INT8 == TILE_AND_INT8 && enabled & TILE_STATE == TILE_STATE
}

/// Linux gives a process the tiles' state when it asks for it: `arch_prctl(ARCH_REQ_XCOMP_PERM, XFEATURE_XTILEDATA)`.
#[cfg(target_os = "linux")]
fn permitted() -> bool {
    const ARCH_PRCTL: i64 = 158;
    const ARCH_REQ_XCOMP_PERM: u64 = 0x1023;
    const XFEATURE_XTILEDATA: u64 = 18;
    let result: i64;
    // SAFETY: a system call that takes no pointer; it clobbers rcx, r11 and the flags, and nothing else.
    unsafe {
        asm!("syscall", inlateout("rax") ARCH_PRCTL => result, in("rdi") ARCH_REQ_XCOMP_PERM,
            in("rsi") XFEATURE_XTILEDATA, lateout("rcx") _, lateout("r11") _, options(nostack));
    }
    result == 0
}

#[cfg(not(target_os = "linux"))]
fn permitted() -> bool {
    false
}

/// The tile registers of this thread: sums of two tiles of rows by two panels in 0 to 3, rows in 4 and 5, panels in 6 and 7.
#[derive(Debug)]
pub(crate) struct Tiles {
    /// Rows of the two tiles, once they are known.
    heights: [usize; 2],
    /// They stay on it.
    thread: PhantomData<*const ()>,
}

/// What `ldtilecfg` takes.
#[repr(C, align(64))]
struct Configuration {
    palette: u8,
    start_row: u8,
    reserved: [u8; 14],
    row_bytes: [u16; 16],
    rows: [u8; 16],
}

impl Tiles {
    /// # Safety
    /// They must be [available](is_available), and the only ones of this thread as long as they live.
    pub(super) unsafe fn new() -> Self {
        Self { heights: [0; 2], thread: PhantomData }
    }

    fn configure(&mut self, heights: [usize; 2]) {
        if self.heights == heights {
            return;
        }
        self.heights = heights;
        let [upper, lower] = heights.map(|height| height as u8);
        let panel = HEIGHT as u8;
        let mut configuration =
            Configuration { palette: 1, start_row: 0, reserved: [0; 14], row_bytes: [0; 16], rows: [0; 16] };
        configuration.rows[..8].copy_from_slice(&[upper, upper, lower, lower, upper, lower, panel, panel]);
        configuration.row_bytes[..8].fill(DEPTH as u16);
        // SAFETY: the processor has AMX; this is a valid configuration of palette 1, heights being from 1 to 16.
        unsafe { asm!("ldtilecfg [{}]", in(reg) &raw const configuration, options(nostack, readonly)) };
    }

    /// Sums of rows, of which there are 2 to 32, by two panels: upper half of the rows by each panel, then the lower half.
    /// `input` is `[rows][k]`; gives the rows of each half.
    ///
    /// # Panics
    /// If there are other numbers of rows, k is no multiple of [`DEPTH`], or the panels do not have k.
    #[inline(always)]
    pub(crate) fn product(
        &mut self,
        input: &[u8],
        k: usize,
        panels: [&[Line]; 2],
        sums: &mut [[Block; 2]; 2],
    ) -> [usize; 2] {
        assert!(
            k > 0 && k.is_multiple_of(DEPTH) && panels.iter().all(|panel| panel.len() * 4 == k),
            "tiles of {k}"
        );
        let rows = input.len() / k;
        assert!((2..=2 * HEIGHT).contains(&rows), "tiles of {rows} rows");
        let heights = [rows.div_ceil(2), rows / 2];
        self.configure(heights);
        // SAFETY: the processor has AMX, and the registers are set to these heights. Rows of `input` are k bytes apart; all
        // steps together read k bytes of each, and all lines of the panels; each block has sixteen rows of 64 bytes. No
        // other code of this thread uses tiles.
        unsafe {
            asm!(
                "tilezero tmm0",
                "tilezero tmm1",
                "tilezero tmm2",
                "tilezero tmm3",
                "2:",
                "tileloadd tmm6, [{first} + {line}]",
                "tileloadd tmm4, [{upper} + {k}]",
                "tileloadd tmm7, [{second} + {line}]",
                "tileloadd tmm5, [{lower} + {k}]",
                "tdpbusd tmm0, tmm4, tmm6",
                "tdpbusd tmm1, tmm4, tmm7",
                "tdpbusd tmm2, tmm5, tmm6",
                "tdpbusd tmm3, tmm5, tmm7",
                "add {upper}, 64",
                "add {lower}, 64",
                "add {first}, 1024",
                "add {second}, 1024",
                "dec {steps}",
                "jnz 2b",
                "tilestored [{sums} + {line}], tmm0",
                "tilestored [{sums} + {line} + 1024], tmm1",
                "tilestored [{sums} + {line} + 2048], tmm2",
                "tilestored [{sums} + {line} + 3072], tmm3",
                upper = inout(reg) input.as_ptr() => _,
                lower = inout(reg) input.as_ptr().add(heights[0] * k) => _,
                first = inout(reg) panels[0].as_ptr() => _,
                second = inout(reg) panels[1].as_ptr() => _,
                steps = inout(reg) k / DEPTH => _,
                sums = in(reg) sums.as_mut_ptr(),
                k = in(reg) k,
                line = in(reg) DEPTH,
                out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
                out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
                options(nostack),
            );
        }
        heights
    }
}

impl Drop for Tiles {
    /// Lets the system keep no tiles of this thread.
    fn drop(&mut self) {
        // SAFETY: the processor has AMX.
        unsafe { asm!("tilerelease", options(nomem, nostack, preserves_flags)) };
    }
}
