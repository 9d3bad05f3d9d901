//! What a kernel needs of the processor: sums of int8 products, and a way to have its code compiled for the instructions.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "x86_64")]
mod avxvnni;
mod plain;

use crate::level::Level;

/// Numbers abreast in all kernels, whatever the registers' width: so sums have the same order at every level.
pub(crate) const LANES: usize = 16;

/// int8 numbers of a lane, which one instruction multiplies and adds.
pub(crate) const QUAD: usize = 4;

/// Four int8 numbers in each lane.
pub(crate) type Quads = [[u8; QUAD]; LANES];

/// A level's instructions. A value of such a type is the proof that this processor has them: only `detect` makes one.
pub(crate) trait Isa: Copy + Send + Sync {
    /// Registers of [`Quads`].
    type Bytes: Copy;
    /// Registers of an i32 in each lane.
    type Sums: Copy;
    /// Rows of inputs that a product takes at once, so that all sums stay in registers: 1 to 6.
    const ROWS: usize;
    /// Panels of 16 outputs that it takes at once: 1, 2 or 4.
    const PANELS: usize;
    /// Output channels that a convolution takes at once, for the same reason: 1 to 4.
    const CHANNELS: usize;

    /// Runs `work`, compiled for these instructions.
    fn run<W: Work>(self, work: W);

    fn load(self, quads: &Quads) -> Self::Bytes;

    /// The same four in each lane.
    fn splat(self, quad: [u8; QUAD]) -> Self::Bytes;

    fn zero(self) -> Self::Sums;

    /// In each lane the sum, and four products of u8 and s8.
    fn dot(self, sums: Self::Sums, unsigned: Self::Bytes, signed: Self::Bytes) -> Self::Sums;

    fn lanes(self, sums: Self::Sums) -> [i32; LANES];
}

/// What is compiled once for each level.
///
/// All that it calls has to be `#[inline(always)]`: what is not inlined into the level's own function does without the
/// level's instructions.
pub(crate) trait Work {
    fn run<I: Isa>(self, isa: I);
}

/// The instructions of a level, of which this processor is known to have them.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Processor {
    Plain(plain::Plain),
    #[cfg(target_arch = "x86_64")]
    Avx2(avx2::Avx2),
    #[cfg(target_arch = "x86_64")]
    AvxVnni(avxvnni::AvxVnni),
    #[cfg(target_arch = "x86_64")]
    Avx512Vnni(avx512::Avx512Vnni),
}

impl Processor {
    pub(crate) fn detect(level: Level) -> Option<Self> {
        match level {
            Level::Plain => Some(Self::Plain(plain::Plain)),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => avx2::Avx2::detect().map(Self::Avx2),
            #[cfg(target_arch = "x86_64")]
            Level::AvxVnni => avxvnni::AvxVnni::detect().map(Self::AvxVnni),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512Vnni => avx512::Avx512Vnni::detect().map(Self::Avx512Vnni),
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
        }
    }

    pub(crate) fn run<W: Work>(self, work: W) {
        match self {
            Self::Plain(isa) => isa.run(work),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(isa) => isa.run(work),
            #[cfg(target_arch = "x86_64")]
            Self::AvxVnni(isa) => isa.run(work),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512Vnni(isa) => isa.run(work),
        }
    }
}
