//! AVX-512 VNNI: `vpdpbusd` in registers of 512 bits, with AMX's tiles beside them or without.

use std::arch::x86_64::*;
use std::mem::transmute;

use super::amx::{self, Tiles};
use super::avx2::{greatest, sum};
use super::{Isa, LANES, QUAD, Quads, Work};

#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx512<const AMX: bool>(());

impl<const AMX: bool> Avx512<AMX> {
    pub(super) fn detect() -> Option<Self> {
        let has = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512vnni")
            && (!AMX || amx::is_available());
        has.then_some(Self(()))
    }

    pub(super) fn without_tiles(self) -> Avx512<false> {
        Avx512(())
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512vnni")]
fn run<const AMX: bool, W: Work>(isa: Avx512<AMX>, work: W) {
    work.run(isa);
}

/// Functions of one instruction, or two.
macro_rules! operations {
    ($($name:ident($($argument:ident: $kind:ty),*) -> $result:ty = $body:expr;)*) => {$(
        #[inline(always)]
        fn $name(self, $($argument: $kind),*) -> $result {
            // SAFETY: `self` exists only where the processor has these instructions. What is loaded and transmuted is as
            // long as a register, may be unaligned, and is valid whatever its bits are.
            unsafe { $body }
        }
    )*};
}

impl<const AMX: bool> Isa for Avx512<AMX> {
    type Bytes = __m512i;
    type Ints = __m512i;
    type Floats = __m512;
    const ROWS: usize = 6;
    const PANELS: usize = 4;
    const EIGHT_SUMS: bool = true;

    operations! {
        bytes(quads: &Quads) -> __m512i = _mm512_loadu_si512(quads.as_ptr().cast());
        splat_bytes(quad: [u8; QUAD]) -> __m512i = _mm512_set1_epi32(i32::from_le_bytes(quad));
        dot(sum: __m512i, unsigned: __m512i, signed: __m512i) -> __m512i = _mm512_dpbusd_epi32(sum, unsigned, signed);

        ints(from: &[i32; LANES]) -> __m512i = _mm512_loadu_epi32(from.as_ptr());
        splat_ints(value: i32) -> __m512i = _mm512_set1_epi32(value);
        add_ints(a: __m512i, b: __m512i) -> __m512i = _mm512_add_epi32(a, b);
        or(a: __m512i, b: __m512i) -> __m512i = _mm512_or_si512(a, b);
        shift_left(a: __m512i, bits: u32) -> __m512i = _mm512_sll_epi32(a, _mm_cvtsi32_si128(bits.cast_signed()));
        to_floats(a: __m512i) -> __m512 = _mm512_cvtepi32_ps(a);
        of_bits(a: __m512i) -> __m512 = _mm512_castsi512_ps(a);
        store_ints(a: __m512i) -> [i32; LANES] = transmute(a);
        store_codes(a: __m512i, zero: u8) -> [u8; LANES] = {
            let codes = _mm512_add_epi32(a, _mm512_set1_epi32(zero.into()));
            transmute(_mm512_cvtepi32_epi8(_mm512_max_epi32(codes, _mm512_setzero_si512())))
        };

        floats(from: &[f32; LANES]) -> __m512 = _mm512_loadu_ps(from.as_ptr());
        splat(value: f32) -> __m512 = _mm512_set1_ps(value);
        add(a: __m512, b: __m512) -> __m512 = _mm512_add_ps(a, b);
        subtract(a: __m512, b: __m512) -> __m512 = _mm512_sub_ps(a, b);
        multiply(a: __m512, b: __m512) -> __m512 = _mm512_mul_ps(a, b);
        max(a: __m512, b: __m512) -> __m512 = _mm512_max_ps(a, b);
        min(a: __m512, b: __m512) -> __m512 = _mm512_min_ps(a, b);
        less(a: __m512, b: __m512, yes: __m512, no: __m512) -> __m512 =
            _mm512_mask_mov_ps(no, _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b), yes);
        to_bits(a: __m512) -> __m512i = _mm512_castps_si512(a);
        round(a: __m512) -> __m512i = _mm512_cvtps_epi32(a);
        store(a: __m512) -> [f32; LANES] = transmute(a);
        fused(a: __m512, b: __m512, c: __m512) -> __m512 = _mm512_fmadd_ps(a, b, c);
        sum(a: __m512) -> f32 = sum(_mm256_add_ps(_mm512_castps512_ps256(a), _mm512_extractf32x8_ps::<1>(a)));
        greatest(a: __m512) -> f32 =
            greatest(_mm256_max_ps(_mm512_castps512_ps256(a), _mm512_extractf32x8_ps::<1>(a)));
    }

    #[inline(always)]
    unsafe fn tiles(self) -> Option<Tiles> {
        // SAFETY: with AMX `self` exists only where the processor has it; the rest is the caller's.
        AMX.then(|| unsafe { Tiles::new() })
    }

    #[inline(always)]
    fn prefetch<T>(self, at: *const T) {
        // SAFETY: x86-64 has it, and it reads nothing: any address will do.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(at.cast()) }
    }

    #[inline(always)]
    fn run<W: Work>(self, work: W) {
        // SAFETY: `self` exists only where the processor has these features.
        unsafe { run(self, work) }
    }
}
