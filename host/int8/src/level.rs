//! Which vector instructions the kernels use.

use std::fmt;
use std::str::FromStr;

use crate::isa::Processor;

/// A set of vector instructions, least first. Results do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// None that the target does not always have.
    Plain,
    /// AVX2: sums of two int8 products where weights are [narrow](crate::NARROW), else products of 16-bit numbers, 256 bits wide.
    Avx2,
    /// AVX-VNNI: sums of four int8 products, 256 bits wide.
    AvxVnni,
    /// AVX-512 VNNI: the same, 512 bits wide.
    Avx512Vnni,
    /// AMX: products of whole tiles, for matrix products of some rows; AVX-512 VNNI for all else.
    Amx,
}

impl Level {
    /// All of them, least first.
    pub const ALL: [Self; 5] = [Self::Plain, Self::Avx2, Self::AvxVnni, Self::Avx512Vnni, Self::Amx];

    /// The best that this processor has.
    pub fn detect() -> Self {
        Processor::best().level()
    }

    /// Whether this processor has it.
    pub fn is_available(self) -> bool {
        Processor::detect(self).is_some()
    }

    /// Its name, as [`FromStr`] takes it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Avx2 => "avx2",
            Self::AvxVnni => "avx-vnni",
            Self::Avx512Vnni => "avx512-vnni",
            Self::Amx => "amx",
        }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that is no [`Level`]'s.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownLevel(String);

impl fmt::Display for UnknownLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no level of int8 kernels is called `{}`; there are", self.0)?;
        Level::ALL.iter().try_for_each(|level| write!(f, " {level}"))
    }
}

impl std::error::Error for UnknownLevel {}

impl FromStr for Level {
    type Err = UnknownLevel;

    fn from_str(name: &str) -> Result<Self, UnknownLevel> {
        Self::ALL.into_iter().find(|level| level.name() == name).ok_or_else(|| UnknownLevel(name.to_owned()))
    }
}
