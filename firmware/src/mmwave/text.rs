//! What the text formats share: arguments of a command, and errors that name line, command and fault.

use core::fmt;

use rfhoi_shared::radar::{MAX_TX_SLOTS, ProfileError};

use super::decimal;

/// Why a profile's text cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TextError {
    /// Line at fault, counted from 1; for what is missing, the last line of the text.
    pub line: u32,
    /// Command at fault, as it is spelt in the text.
    pub command: &'static str,
    /// What is wrong with it.
    pub problem: Problem,
}

/// What is wrong with a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Problem {
    /// The text has no such command.
    Missing,
    /// It has only this many arguments.
    TooFewArguments(u8),
    /// This argument, counted from 1, is no number or out of its range.
    Number(u8),
    /// The bridge does not take it.
    Unsupported(Unsupported),
    /// The frame's last chirp is before its first.
    ChirpOrder,
    /// The frame has this many chirps in a loop, more than [`MAX_TX_SLOTS`].
    TooManySlots(u16),
    /// The frame uses a chirp of this index, which nothing defines.
    ChirpUndefined(u16),
    /// The frame's chirps use a profile of this number, which nothing defines.
    ProfileUndefined(u8),
    /// A chirp uses transmitters that are not enabled; the mask of those.
    TxNotEnabled(u8),
    /// ADC and ADC buffer disagree on real or complex samples.
    FormatMismatch,
    /// Everything is read, and the radar profile breaks a rule.
    Profile(ProfileError),
}

/// What a radar can do and the bridge does not take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Unsupported {
    /// Advanced (several subframes) or continuous chirping.
    FrameMode,
    /// Chirps that vary frequency, slope, idle or ADC start time from their profile.
    ChirpVariation,
    /// Chirps of one frame from several profiles.
    SeveralProfiles,
    /// Several transmitters at once with binary phase modulation.
    BinaryPhase,
    /// ADC words of other than 16 bits.
    AdcBits,
    /// Complex 2x samples, which keep the image band.
    Complex2x,
    /// Samples of the receivers interleaved.
    Interleaved,
    /// Raw data by another way than LVDS, or with other packets than ADC samples alone.
    DataPath,
}

impl fmt::Display for TextError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, {}: {}", self.line, self.command, self.problem)
    }
}

impl core::error::Error for TextError {}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => write!(f, "is missing"),
            Self::TooFewArguments(found) => write!(f, "too few arguments, only {found}"),
            Self::Number(argument) => write!(f, "argument {argument} is no number or out of range"),
            Self::Unsupported(what) => write!(f, "{what}: not supported"),
            Self::ChirpOrder => write!(f, "the last chirp is before the first"),
            Self::TooManySlots(n) => write!(f, "{n} chirps in a loop, at most {MAX_TX_SLOTS}"),
            Self::ChirpUndefined(chirp) => write!(f, "chirp {chirp} of the frame is not defined"),
            Self::ProfileUndefined(profile) => write!(f, "profile {profile} of the frame is not defined"),
            Self::TxNotEnabled(mask) => write!(f, "transmitters of mask {mask} are used and not enabled"),
            Self::FormatMismatch => write!(f, "ADC and ADC buffer disagree on real or complex samples"),
            Self::Profile(e) => write!(f, "{e}"),
        }
    }
}

impl fmt::Display for Unsupported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::FrameMode => "advanced frames or continuous chirping",
            Self::ChirpVariation => "a chirp that varies from its profile",
            Self::SeveralProfiles => "chirps of several profiles in one frame",
            Self::BinaryPhase => "binary phase modulation",
            Self::AdcBits => "ADC words of other than 16 bits",
            Self::Complex2x => "complex 2x samples",
            Self::Interleaved => "interleaved receivers",
            Self::DataPath => "raw data other than ADC samples over LVDS",
        })
    }
}

/// A command's place in the text.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) line: u32,
    pub(super) command: &'static str,
}

impl Place {
    pub(super) fn error(self, problem: Problem) -> TextError {
        TextError { line: self.line, command: self.command, problem }
    }

    pub(super) fn unsupported(self, what: Unsupported) -> TextError {
        self.error(Problem::Unsupported(what))
    }
}

/// A command's arguments, taken one after the other.
pub(super) struct Args<I> {
    pub(super) place: Place,
    tokens: I,
    taken: u8,
}

impl<'a, I: Iterator<Item = &'a str>> Args<I> {
    pub(super) fn new(place: Place, tokens: I) -> Self {
        Self { place, tokens, taken: 0 }
    }

    /// The next argument as it is.
    pub(super) fn token(&mut self) -> Result<&'a str, TextError> {
        let token = self.tokens.next().ok_or(self.place.error(Problem::TooFewArguments(self.taken)))?;
        self.taken = self.taken.saturating_add(1);
        Ok(token)
    }

    fn bad_number(&self) -> TextError {
        self.place.error(Problem::Number(self.taken))
    }

    /// Passes over `count` arguments, which must be there.
    pub(super) fn skip(&mut self, count: usize) -> Result<(), TextError> {
        (0..count).try_for_each(|_| self.token().map(drop))
    }

    /// The next argument times 10^`decimals`.
    pub(super) fn scaled(&mut self, decimals: usize) -> Result<u32, TextError> {
        let value = decimal::parse(self.token()?, decimals);
        value.and_then(|v| u32::try_from(v).ok()).ok_or(self.bad_number())
    }

    /// The next argument as an integer.
    pub(super) fn integer<T: TryFrom<u32>>(&mut self) -> Result<T, TextError> {
        let value = self.token()?.parse::<u32>().ok();
        value.and_then(|v| T::try_from(v).ok()).ok_or(self.bad_number())
    }

    /// The next argument as a switch, 0 or not.
    pub(super) fn switch(&mut self) -> Result<bool, TextError> {
        self.integer::<u32>().map(|v| v != 0)
    }

    /// Whether the next `count` arguments are numbers, all zero.
    pub(super) fn zeros(&mut self, count: usize) -> Result<bool, TextError> {
        // Finer than any resolution of these fields; a value that still rounds to zero has no effect.
        const DECIMALS: usize = 9;
        let mut all = true;
        for _ in 0..count {
            all &= decimal::parse(self.token()?, DECIMALS).ok_or(self.bad_number())? == 0;
        }
        Ok(all)
    }
}
