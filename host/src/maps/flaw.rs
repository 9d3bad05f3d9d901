//! What may be wrong with a map.

use std::fmt;

/// Why a map is not to be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Flaw {
    /// It did not arrive.
    Missing,
    /// It is not of the size that was agreed on, as when the bridge has another configuration.
    Shape,
    /// Neighbouring rows are missing, too many to be filled from those around them.
    RowsMissing,
    /// The end of the frame did not arrive, so nothing is known of its losses and of clipping.
    Unaccounted,
    /// Samples were at the ADC's limits, or cells at the end of their scale.
    Clipped,
    /// Chirps were lost.
    ChirpsLost,
    /// Nothing rises over the noise.
    Empty,
}

impl Flaw {
    /// A word for tables.
    pub const fn reason(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Shape => "shape",
            Self::RowsMissing => "rows_missing",
            Self::Unaccounted => "unaccounted",
            Self::Clipped => "clipped",
            Self::ChirpsLost => "chirps_lost",
            Self::Empty => "empty",
        }
    }

    /// Whether the map is all zeros; otherwise it is there, for what it is worth.
    pub const fn is_blank(self) -> bool {
        matches!(self, Self::Missing | Self::Shape | Self::RowsMissing | Self::Empty)
    }
}

impl fmt::Display for Flaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing => "the map did not arrive",
            Self::Shape => "the map is of another size than agreed",
            Self::RowsMissing => "too many neighbouring rows did not arrive",
            Self::Unaccounted => "the end of the frame did not arrive",
            Self::Clipped => "the signal was at the limits of its scale",
            Self::ChirpsLost => "too many chirps were lost",
            Self::Empty => "nothing rises over the noise",
        })
    }
}

/// What is known of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapState {
    /// What is wrong with it.
    pub flaw: Option<Flaw>,
    /// Rows that were filled from those around them.
    pub rows_filled: usize,
    /// Level of the noise, dB relative to a full-scale tone; NaN where there is no map.
    pub floor_db: f32,
    /// Level of the strongest cell, dB relative to a full-scale tone; NaN where there is no map.
    pub peak_db: f32,
}

impl MapState {
    /// Of a map that is not there.
    pub(super) const fn none(flaw: Flaw) -> Self {
        Self { flaw: Some(flaw), rows_filled: 0, floor_db: f32::NAN, peak_db: f32::NAN }
    }
}
