//! AVX-VNNI: `vpdpbusd` in registers of 256 bits.

use std::arch::x86_64::{
    __m256i, _mm256_dpbusd_avx_epi32, _mm256_loadu_si256, _mm256_set1_epi32, _mm256_setzero_si256,
};

use super::{Isa, LANES, QUAD, Quads, Work};

#[derive(Debug, Clone, Copy)]
pub(crate) struct AvxVnni(());

impl AvxVnni {
    pub(super) fn detect() -> Option<Self> {
        (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("avxvnni")).then_some(Self(()))
    }
}

#[target_feature(enable = "avx2,avxvnni")]
fn run<W: Work>(isa: AvxVnni, work: W) {
    work.run(isa);
}

impl Isa for AvxVnni {
    type Bytes = [__m256i; 2];
    type Sums = [__m256i; 2];
    const ROWS: usize = 6;
    const PANELS: usize = 1;
    const CHANNELS: usize = 1;

    #[inline(always)]
    fn run<W: Work>(self, work: W) {
        // SAFETY: `self` exists only where the processor has AVX2 and AVX-VNNI.
        unsafe { run(self, work) }
    }

    #[inline(always)]
    fn load(self, quads: &Quads) -> [__m256i; 2] {
        let halves = quads.as_ptr().cast::<__m256i>();
        // SAFETY: the processor has AVX2; `quads` is as long as two registers, and the loads may be unaligned.
        unsafe { [_mm256_loadu_si256(halves), _mm256_loadu_si256(halves.add(1))] }
    }

    #[inline(always)]
    fn splat(self, quad: [u8; QUAD]) -> [__m256i; 2] {
        // SAFETY: the processor has AVX2.
        unsafe { [_mm256_set1_epi32(i32::from_le_bytes(quad)); 2] }
    }

    #[inline(always)]
    fn zero(self) -> [__m256i; 2] {
        // SAFETY: the processor has AVX2.
        unsafe { [_mm256_setzero_si256(); 2] }
    }

    #[inline(always)]
    fn dot(self, sums: [__m256i; 2], unsigned: [__m256i; 2], signed: [__m256i; 2]) -> [__m256i; 2] {
        // SAFETY: the processor has AVX-VNNI.
        unsafe {
            [
                _mm256_dpbusd_avx_epi32(sums[0], unsigned[0], signed[0]),
                _mm256_dpbusd_avx_epi32(sums[1], unsigned[1], signed[1]),
            ]
        }
    }

    #[inline(always)]
    fn lanes(self, sums: [__m256i; 2]) -> [i32; LANES] {
        // SAFETY: both are 64 bytes of which every pattern is valid.
        unsafe { std::mem::transmute(sums) }
    }
}
