//! AVX2 without VNNI.
//!
//! Its own product of u8 and s8 (`vpmaddubsw`) adds two products in 16 bits and saturates, so each lane's four numbers
//! are widened to 16 bits, even and odd ones apart: their products then add up in the lane's 32 bits, in place.

use std::arch::x86_64::{
    __m256i, _mm256_add_epi32, _mm256_and_si256, _mm256_loadu_si256, _mm256_madd_epi16, _mm256_set1_epi16,
    _mm256_set1_epi32, _mm256_setzero_si256, _mm256_slli_epi16, _mm256_srai_epi16, _mm256_srli_epi16,
};

use super::{Isa, LANES, QUAD, Quads, Work};

#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx2(());

impl Avx2 {
    pub(super) fn detect() -> Option<Self> {
        is_x86_feature_detected!("avx2").then_some(Self(()))
    }
}

#[target_feature(enable = "avx2")]
fn run<W: Work>(isa: Avx2, work: W) {
    work.run(isa);
}

impl Isa for Avx2 {
    type Bytes = [__m256i; 2];
    type Sums = [__m256i; 2];
    const ROWS: usize = 4;
    const PANELS: usize = 1;
    const CHANNELS: usize = 1;

    #[inline(always)]
    fn run<W: Work>(self, work: W) {
        // SAFETY: `self` exists only where the processor has AVX2.
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
    fn dot(self, mut sums: [__m256i; 2], unsigned: [__m256i; 2], signed: [__m256i; 2]) -> [__m256i; 2] {
        for ((sum, u), s) in sums.iter_mut().zip(unsigned).zip(signed) {
            // SAFETY: the processor has AVX2.
            unsafe {
                let low = _mm256_set1_epi16(0xff);
                let (u_even, u_odd) = (_mm256_and_si256(u, low), _mm256_srli_epi16::<8>(u));
                let s_even = _mm256_srai_epi16::<8>(_mm256_slli_epi16::<8>(s));
                let s_odd = _mm256_srai_epi16::<8>(s);
                *sum = _mm256_add_epi32(*sum, _mm256_madd_epi16(u_even, s_even));
                *sum = _mm256_add_epi32(*sum, _mm256_madd_epi16(u_odd, s_odd));
            }
        }
        sums
    }

    #[inline(always)]
    fn lanes(self, sums: [__m256i; 2]) -> [i32; LANES] {
        // SAFETY: both are 64 bytes of which every pattern is valid.
        unsafe { std::mem::transmute(sums) }
    }
}
