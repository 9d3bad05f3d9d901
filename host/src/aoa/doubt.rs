//! Why an answer is not to be trusted.

use std::fmt;

/// What is wrong with an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Doubt {
    /// The covariance is zero.
    NothingMoves,
    /// The covariance has an element that is no finite number.
    NotANumber,
    /// The covariance is no covariance: it has negative powers.
    NotPositive,
    /// The covariance is of another number of antennas.
    OtherArray,
    /// Nothing was averaged.
    TooFewSnapshots,
    /// The eigenvalues do not say how many sources there are.
    NoGap,
    /// There are fewer peaks than sources: two that are too close, or one out of view.
    FewerPeaks,
    /// A peak that does not count is about as high as one that does.
    Ambiguous,
    /// A peak at the edge of the field of view: the source may be beyond.
    AtEdge,
    /// The directions do not explain the signal: antennas out of calibration, coherent sources, or a wrong order.
    Mismatch,
    /// Too little signal over noise, too few snapshots, or sources too close to say where they are.
    Imprecise,
}

impl Doubt {
    /// The same as an identifier.
    pub fn reason(self) -> &'static str {
        match self {
            Self::NothingMoves => "nothing_moves",
            Self::NotANumber => "not_a_number",
            Self::NotPositive => "not_positive",
            Self::OtherArray => "other_array",
            Self::TooFewSnapshots => "too_few_snapshots",
            Self::NoGap => "no_gap",
            Self::FewerPeaks => "fewer_peaks",
            Self::Ambiguous => "ambiguous",
            Self::AtEdge => "at_edge",
            Self::Mismatch => "mismatch",
            Self::Imprecise => "imprecise",
        }
    }

    /// Whether there is no spectrum at all.
    pub fn is_empty(self) -> bool {
        matches!(self, Self::NothingMoves | Self::NotANumber | Self::NotPositive | Self::OtherArray)
    }
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NothingMoves => "nothing moves",
            Self::NotANumber => "the covariance has an element that is no number",
            Self::NotPositive => "the covariance has negative powers",
            Self::OtherArray => "the covariance is of another array",
            Self::TooFewSnapshots => "no snapshots",
            Self::NoGap => "signal and noise do not stand apart",
            Self::FewerPeaks => "fewer directions than sources",
            Self::Ambiguous => "another direction is about as likely",
            Self::AtEdge => "at the edge of the field of view",
            Self::Mismatch => "the directions found do not explain the signal",
            Self::Imprecise => "too weak to say where",
        })
    }
}
