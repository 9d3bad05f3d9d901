//! AVX2, with AVX-VNNI's `vpdpbusd` or without it.
//!
//! AVX2's own product of u8 and s8 (`vpmaddubsw`) adds two products in 16 bits and saturates. Weights of up to
//! [`NARROW`](crate::NARROW) keep it from that, and with inputs of up to [`SMALL`](crate::SMALL) two such sums can be added
//! before they are widened; with other weights each lane's four numbers are widened to 16 bits, even and odd ones apart: their
//! products then add up in the lane's 32 bits, in place.

use std::arch::x86_64::*;
use std::mem::transmute;

use super::{Isa, LANES, QUAD, Quads, Work};

/// How the products of a lane are made: of any numbers without AVX-VNNI, of narrow weights, of small inputs too, with AVX-VNNI.
pub(super) const WIDENED: u8 = 0;
const PAIRED: u8 = 1;
const FOURFOLD: u8 = 2;
pub(super) const VNNI: u8 = 3;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx2<const DOT: u8>(());

impl<const DOT: u8> Avx2<DOT> {
    pub(super) fn detect() -> Option<Self> {
        let has = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && (DOT != VNNI || is_x86_feature_detected!("avxvnni"));
        has.then_some(Self(()))
    }
}

impl Avx2<WIDENED> {
    /// For [`Factors::Narrow`](super::Factors::Narrow).
    pub(super) fn narrow(self) -> Avx2<PAIRED> {
        Avx2(())
    }

    /// For [`Factors::Small`](super::Factors::Small).
    pub(super) fn small(self) -> Avx2<FOURFOLD> {
        Avx2(())
    }
}

#[target_feature(enable = "avx2,fma")]
fn run<const DOT: u8, W: Work>(isa: Avx2<DOT>, work: W) {
    work.run(isa);
}

#[target_feature(enable = "avx2,fma,avxvnni")]
fn run_vnni<W: Work>(isa: Avx2<VNNI>, work: W) {
    work.run(isa);
}

/// The sum and four products in each lane, of which pairs fit 16 bits.
///
/// # Safety
/// The processor must have AVX2.
#[inline(always)]
unsafe fn dot_paired(sum: __m256i, unsigned: __m256i, signed: __m256i) -> __m256i {
    // SAFETY: the caller's.
    unsafe {
        let pairs = _mm256_maddubs_epi16(unsigned, signed);
        _mm256_add_epi32(sum, _mm256_madd_epi16(pairs, _mm256_set1_epi16(1)))
    }
}

/// The sum and eight products in each lane, of which four fit 16 bits.
///
/// # Safety
/// The processor must have AVX2.
#[inline(always)]
unsafe fn dot_fourfold(sum: __m256i, unsigned: [__m256i; 2], signed: [__m256i; 2]) -> __m256i {
    // SAFETY: the caller's.
    unsafe {
        let first = _mm256_maddubs_epi16(unsigned[0], signed[0]);
        let fours = _mm256_add_epi16(first, _mm256_maddubs_epi16(unsigned[1], signed[1]));
        _mm256_add_epi32(sum, _mm256_madd_epi16(fours, _mm256_set1_epi16(1)))
    }
}

/// The sum and four products in each lane, of 16 bits.
///
/// # Safety
/// The processor must have AVX2.
#[inline(always)]
unsafe fn dot_wide(sum: __m256i, unsigned: __m256i, signed: __m256i) -> __m256i {
    // SAFETY: the caller's.
    unsafe {
        let u_even = _mm256_and_si256(unsigned, _mm256_set1_epi16(0xff));
        let u_odd = _mm256_srli_epi16::<8>(unsigned);
        let s_even = _mm256_srai_epi16::<8>(_mm256_slli_epi16::<8>(signed));
        let s_odd = _mm256_srai_epi16::<8>(signed);
        let products = _mm256_add_epi32(_mm256_madd_epi16(u_even, s_even), _mm256_madd_epi16(u_odd, s_odd));
        _mm256_add_epi32(sum, products)
    }
}

/// The sum of eight lanes, halves by halves.
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
pub(super) unsafe fn sum(a: __m256) -> f32 {
    // SAFETY: the caller's.
    unsafe {
        let a = _mm_add_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps::<1>(a));
        let a = _mm_add_ps(a, _mm_movehl_ps(a, a));
        _mm_cvtss_f32(_mm_add_ss(a, _mm_shuffle_ps::<1>(a, a)))
    }
}

/// The greatest of eight lanes, halves by halves.
///
/// # Safety
/// The processor must have AVX.
#[inline(always)]
pub(super) unsafe fn greatest(a: __m256) -> f32 {
    // SAFETY: the caller's.
    unsafe {
        let a = _mm_max_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps::<1>(a));
        let a = _mm_max_ps(a, _mm_movehl_ps(a, a));
        _mm_cvtss_f32(_mm_max_ss(a, _mm_shuffle_ps::<1>(a, a)))
    }
}

/// Sixteen lanes are two registers.
type Ints = [__m256i; 2];
type Floats = [__m256; 2];

/// Functions of one instruction, or some, for both registers.
macro_rules! operations {
    ($($name:ident($($argument:ident: $kind:ty),*) -> $result:ty = $body:expr;)*) => {$(
        #[inline(always)]
        fn $name(self, $($argument: $kind),*) -> $result {
            // SAFETY: `self` exists only where the processor has these instructions. What is loaded and transmuted is as
            // long as two registers, may be unaligned, and is valid whatever its bits are.
            unsafe { $body }
        }
    )*};
}

impl<const DOT: u8> Isa for Avx2<DOT> {
    type Bytes = Ints;
    type Ints = Ints;
    type Floats = Floats;
    // Two sums a row, and beside them what the products take: sixteen registers hold all.
    const ROWS: usize = match DOT {
        WIDENED => 4,
        PAIRED => 5,
        FOURFOLD => 4,
        _ => 6,
    };
    const PAIRS: bool = DOT == FOURFOLD;
    const PANELS: usize = 1;
    const EIGHT_SUMS: bool = false;

    operations! {
        bytes(quads: &Quads) -> Ints = transmute(*quads);
        splat_bytes(quad: [u8; QUAD]) -> Ints = [_mm256_set1_epi32(i32::from_le_bytes(quad)); 2];
        dot(sum: Ints, unsigned: Ints, signed: Ints) -> Ints = match DOT {
            VNNI => [
                _mm256_dpbusd_avx_epi32(sum[0], unsigned[0], signed[0]),
                _mm256_dpbusd_avx_epi32(sum[1], unsigned[1], signed[1]),
            ],
            PAIRED | FOURFOLD =>
                [dot_paired(sum[0], unsigned[0], signed[0]), dot_paired(sum[1], unsigned[1], signed[1])],
            _ => [dot_wide(sum[0], unsigned[0], signed[0]), dot_wide(sum[1], unsigned[1], signed[1])],
        };

        ints(from: &[i32; LANES]) -> Ints = transmute(*from);
        splat_ints(value: i32) -> Ints = [_mm256_set1_epi32(value); 2];
        add_ints(a: Ints, b: Ints) -> Ints = [_mm256_add_epi32(a[0], b[0]), _mm256_add_epi32(a[1], b[1])];
        or(a: Ints, b: Ints) -> Ints = [_mm256_or_si256(a[0], b[0]), _mm256_or_si256(a[1], b[1])];
        shift_left(a: Ints, bits: u32) -> Ints = {
            let bits = _mm_cvtsi32_si128(bits.cast_signed());
            [_mm256_sll_epi32(a[0], bits), _mm256_sll_epi32(a[1], bits)]
        };
        to_floats(a: Ints) -> Floats = [_mm256_cvtepi32_ps(a[0]), _mm256_cvtepi32_ps(a[1])];
        of_bits(a: Ints) -> Floats = transmute(a);
        store_ints(a: Ints) -> [i32; LANES] = transmute(a);
        store_codes(a: Ints, zero: u8) -> [u8; LANES] = {
            // Packing works within halves of registers: afterwards quarters lie in the order 0, 2, 1, 3.
            let pairs = _mm256_permute4x64_epi64::<0b11_01_10_00>(_mm256_packs_epi32(a[0], a[1]));
            let codes = _mm256_adds_epi16(pairs, _mm256_set1_epi16(zero.into()));
            transmute(_mm_packus_epi16(_mm256_castsi256_si128(codes), _mm256_extracti128_si256::<1>(codes)))
        };

        floats(from: &[f32; LANES]) -> Floats = transmute(*from);
        splat(value: f32) -> Floats = [_mm256_set1_ps(value); 2];
        add(a: Floats, b: Floats) -> Floats = [_mm256_add_ps(a[0], b[0]), _mm256_add_ps(a[1], b[1])];
        subtract(a: Floats, b: Floats) -> Floats = [_mm256_sub_ps(a[0], b[0]), _mm256_sub_ps(a[1], b[1])];
        multiply(a: Floats, b: Floats) -> Floats = [_mm256_mul_ps(a[0], b[0]), _mm256_mul_ps(a[1], b[1])];
        max(a: Floats, b: Floats) -> Floats = [_mm256_max_ps(a[0], b[0]), _mm256_max_ps(a[1], b[1])];
        min(a: Floats, b: Floats) -> Floats = [_mm256_min_ps(a[0], b[0]), _mm256_min_ps(a[1], b[1])];
        less(a: Floats, b: Floats, yes: Floats, no: Floats) -> Floats = [
            _mm256_blendv_ps(no[0], yes[0], _mm256_cmp_ps::<_CMP_LT_OQ>(a[0], b[0])),
            _mm256_blendv_ps(no[1], yes[1], _mm256_cmp_ps::<_CMP_LT_OQ>(a[1], b[1])),
        ];
        to_bits(a: Floats) -> Ints = transmute(a);
        round(a: Floats) -> Ints = [_mm256_cvtps_epi32(a[0]), _mm256_cvtps_epi32(a[1])];
        store(a: Floats) -> [f32; LANES] = transmute(a);
        fused(a: Floats, b: Floats, c: Floats) -> Floats =
            [_mm256_fmadd_ps(a[0], b[0], c[0]), _mm256_fmadd_ps(a[1], b[1], c[1])];
        sum(a: Floats) -> f32 = sum(_mm256_add_ps(a[0], a[1]));
        greatest(a: Floats) -> f32 = greatest(_mm256_max_ps(a[0], a[1]));
    }

    #[inline(always)]
    fn dot_two(self, sum: Ints, unsigned: [Ints; 2], signed: [Ints; 2]) -> Ints {
        if DOT != FOURFOLD {
            return self.dot(self.dot(sum, unsigned[0], signed[0]), unsigned[1], signed[1]);
        }
        let ([u, next_u], [s, next_s]) = (unsigned, signed);
        // SAFETY: `self` exists only where the processor has AVX2.
        unsafe {
            [
                dot_fourfold(sum[0], [u[0], next_u[0]], [s[0], next_s[0]]),
                dot_fourfold(sum[1], [u[1], next_u[1]], [s[1], next_s[1]]),
            ]
        }
    }

    #[inline(always)]
    fn prefetch<T>(self, at: *const T) {
        // SAFETY: x86-64 has it, and it reads nothing: any address will do.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(at.cast()) }
    }

    #[inline(always)]
    fn run<W: Work>(self, work: W) {
        // SAFETY: `self` exists only where the processor has these features.
        unsafe { if DOT == VNNI { run_vnni(Avx2(()), work) } else { run(self, work) } }
    }
}
