//! What a kernel needs of the processor: sums of int8 products, floats sixteen abreast, and a way to have its code compiled
//! for the instructions.
//!
//! None rounds otherwise at another level: there are no estimates, products are fused with sums where that is said, and sums
//! across lanes are one fixed tree.

#[cfg(target_arch = "x86_64")]
pub(crate) mod amx;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod plain;

#[cfg(test)]
pub(crate) use plain::Plain;

use crate::level::Level;

/// Numbers abreast in all kernels, whatever the registers' width: so sums have the same order at every level.
pub(crate) const LANES: usize = 16;

/// int8 numbers of a lane, which one instruction multiplies and adds.
pub(crate) const QUAD: usize = 4;

/// Four int8 numbers in each lane.
pub(crate) type Quads = [[u8; QUAD]; LANES];

/// A level's instructions. A value of such a type is the proof that this processor has them: only `detect` makes one.
pub(crate) trait Isa: Copy + Send + Sync {
    /// [`Quads`].
    type Bytes: Copy;
    /// An i32 in each lane.
    type Ints: Copy;
    /// An f32 in each lane.
    type Floats: Copy;
    /// Rows of inputs that a product takes at once, so that all sums stay in registers: 1 to 6.
    const ROWS: usize;
    /// Panels of 16 outputs that it takes at once: 1, 2 or 4.
    const PANELS: usize;
    /// Whether [`dot_two`](Self::dot_two) is more than two `dot`.
    const PAIRS: bool = false;
    /// Whether eight sums of floats and what they are made of stay in registers.
    const EIGHT_SUMS: bool;

    /// Runs `work`, compiled for these instructions.
    fn run<W: Work>(self, work: W);

    /// Instructions on whole matrices, where the level has them.
    ///
    /// # Safety
    /// This thread must have no others as long as these are in use.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    unsafe fn tiles(self) -> Option<amx::Tiles> {
        None
    }

    /// Brings what is there, if anything, into the second cache.
    fn prefetch<T>(self, at: *const T);
    fn bytes(self, quads: &Quads) -> Self::Bytes;
    /// The same four in each lane.
    fn splat_bytes(self, quad: [u8; QUAD]) -> Self::Bytes;
    /// The sum and four products of u8 and s8, exact as far as [`Work::factors`] has told the truth.
    fn dot(self, sum: Self::Ints, unsigned: Self::Bytes, signed: Self::Bytes) -> Self::Ints;
    /// The sum and eight of them.
    #[inline(always)]
    fn dot_two(self, sum: Self::Ints, unsigned: [Self::Bytes; 2], signed: [Self::Bytes; 2]) -> Self::Ints {
        self.dot(self.dot(sum, unsigned[0], signed[0]), unsigned[1], signed[1])
    }

    fn ints(self, from: &[i32; LANES]) -> Self::Ints;
    fn splat_ints(self, value: i32) -> Self::Ints;
    /// Wraps around.
    fn add_ints(self, a: Self::Ints, b: Self::Ints) -> Self::Ints;
    fn or(self, a: Self::Ints, b: Self::Ints) -> Self::Ints;
    fn shift_left(self, a: Self::Ints, bits: u32) -> Self::Ints;
    fn to_floats(self, a: Self::Ints) -> Self::Floats;
    fn of_bits(self, a: Self::Ints) -> Self::Floats;
    fn store_ints(self, a: Self::Ints) -> [i32; LANES];
    /// The sums of each and `zero`, those below 0 as 0; none may be above 255.
    fn store_codes(self, a: Self::Ints, zero: u8) -> [u8; LANES];

    fn floats(self, from: &[f32; LANES]) -> Self::Floats;
    fn splat(self, value: f32) -> Self::Floats;
    fn add(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn subtract(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn multiply(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// `a * b + c`, rounded once.
    fn fused(self, a: Self::Floats, b: Self::Floats, c: Self::Floats) -> Self::Floats;
    /// `if a > b { a } else { b }`, so `b` if one is NaN.
    fn max(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// `if a < b { a } else { b }`, so `b` if one is NaN.
    fn min(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// `if a < b { yes } else { no }`, so `no` if one is NaN.
    fn less(self, a: Self::Floats, b: Self::Floats, yes: Self::Floats, no: Self::Floats) -> Self::Floats;
    fn to_bits(self, a: Self::Floats) -> Self::Ints;
    /// The nearest integers, of two the even one, for numbers below 2^31; `i32::MIN` for those below -2^31 and NaN.
    fn round(self, a: Self::Floats) -> Self::Ints;
    fn store(self, a: Self::Floats) -> [f32; LANES];
    /// The sum of all lanes: the upper half is added to the lower one until one lane is left.
    fn sum(self, a: Self::Floats) -> f32;
    /// The greatest lane, which NaN is not sure to be; halves by halves, too, as [`max`](Self::max) has it.
    fn greatest(self, a: Self::Floats) -> f32;
}

/// What is compiled once for each level.
///
/// All that it calls has to be `#[inline(always)]`, and closures are to be kept from it: what is not inlined into the level's
/// own function does without the level's instructions.
pub(crate) trait Work {
    /// Whether it takes [`Isa::tiles`].
    const TILES: bool = false;

    /// What is known of the numbers that it multiplies.
    fn factors(&self) -> Factors {
        Factors::Any
    }

    fn run<I: Isa>(self, isa: I);
}

/// What is known of u8 and s8 numbers that are multiplied.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Factors {
    Any,
    /// The s8 ones are [`NARROW`](crate::NARROW): two products fit 16 bits.
    Narrow,
    /// The u8 ones are besides not above [`SMALL`](crate::SMALL): four products do.
    Small,
}

/// The instructions of a level, of which this processor is known to have them.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Processor {
    Plain(plain::Plain),
    #[cfg(target_arch = "x86_64")]
    Avx2(avx2::Avx2<{ avx2::WIDENED }>),
    #[cfg(target_arch = "x86_64")]
    AvxVnni(avx2::Avx2<{ avx2::VNNI }>),
    #[cfg(target_arch = "x86_64")]
    Avx512Vnni(avx512::Avx512<false>),
    #[cfg(target_arch = "x86_64")]
    Amx(avx512::Avx512<true>),
}

impl Processor {
    pub(crate) fn detect(level: Level) -> Option<Self> {
        match level {
            Level::Plain => Some(Self::Plain(plain::Plain)),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => avx2::Avx2::detect().map(Self::Avx2),
            #[cfg(target_arch = "x86_64")]
            Level::AvxVnni => avx2::Avx2::detect().map(Self::AvxVnni),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512Vnni => avx512::Avx512::detect().map(Self::Avx512Vnni),
            #[cfg(target_arch = "x86_64")]
            Level::Amx => avx512::Avx512::detect().map(Self::Amx),
            #[cfg(not(target_arch = "x86_64"))]
            _ => None,
        }
    }

    pub(crate) fn best() -> Self {
        let plain = Self::Plain(plain::Plain);
        Level::ALL.into_iter().rev().find_map(Self::detect).unwrap_or(plain)
    }

    pub(crate) fn level(self) -> Level {
        match self {
            Self::Plain(_) => Level::Plain,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => Level::Avx2,
            #[cfg(target_arch = "x86_64")]
            Self::AvxVnni(_) => Level::AvxVnni,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512Vnni(_) => Level::Avx512Vnni,
            #[cfg(target_arch = "x86_64")]
            Self::Amx(_) => Level::Amx,
        }
    }

    pub(crate) fn run<W: Work>(self, work: W) {
        match self {
            Self::Plain(isa) => isa.run(work),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(isa) => match work.factors() {
                Factors::Any => isa.run(work),
                Factors::Narrow => isa.narrow().run(work),
                Factors::Small => isa.small().run(work),
            },
            #[cfg(target_arch = "x86_64")]
            Self::AvxVnni(isa) => isa.run(work),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512Vnni(isa) => isa.run(work),
            #[cfg(target_arch = "x86_64")]
            Self::Amx(isa) if W::TILES => isa.run(work),
            #[cfg(target_arch = "x86_64")]
            Self::Amx(isa) => isa.without_tiles().run(work),
        }
    }
}
