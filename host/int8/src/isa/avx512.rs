//! AVX-512 VNNI: `vpdpbusd` in registers of 512 bits.

use std::arch::x86_64::{
    __m512i, _mm512_dpbusd_epi32, _mm512_loadu_si512, _mm512_set1_epi32, _mm512_setzero_si512,
};

use super::{Isa, LANES, QUAD, Quads, Work};

#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx512Vnni(());

impl Avx512Vnni {
    pub(super) fn detect() -> Option<Self> {
        let has = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512vnni");
        has.then_some(Self(()))
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vnni")]
fn run<W: Work>(isa: Avx512Vnni, work: W) {
    work.run(isa);
}

impl Isa for Avx512Vnni {
    type Bytes = __m512i;
    type Sums = __m512i;
    const ROWS: usize = 6;
    const PANELS: usize = 4;
    const CHANNELS: usize = 4;

    #[inline(always)]
    fn run<W: Work>(self, work: W) {
        // SAFETY: `self` exists only where the processor has these features.
        unsafe { run(self, work) }
    }

    #[inline(always)]
    fn load(self, quads: &Quads) -> __m512i {
        // SAFETY: the processor has AVX-512; `quads` is as long as a register, and the load may be unaligned.
        unsafe { _mm512_loadu_si512(quads.as_ptr().cast()) }
    }

    #[inline(always)]
    fn splat(self, quad: [u8; QUAD]) -> __m512i {
        // SAFETY: the processor has AVX-512.
        unsafe { _mm512_set1_epi32(i32::from_le_bytes(quad)) }
    }

    #[inline(always)]
    fn zero(self) -> __m512i {
        // SAFETY: the processor has AVX-512.
        unsafe { _mm512_setzero_si512() }
    }

    #[inline(always)]
    fn dot(self, sums: __m512i, unsigned: __m512i, signed: __m512i) -> __m512i {
        // SAFETY: the processor has AVX-512 VNNI.
        unsafe { _mm512_dpbusd_epi32(sums, unsigned, signed) }
    }

    #[inline(always)]
    fn lanes(self, sums: __m512i) -> [i32; LANES] {
        // SAFETY: both are 64 bytes of which every pattern is valid.
        unsafe { std::mem::transmute(sums) }
    }
}
