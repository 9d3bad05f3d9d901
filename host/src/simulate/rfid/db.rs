//! Decibels.

/// Ratio of powers.
pub(super) fn power(db: f64) -> f64 {
    libm::exp10(db / 10.0)
}

/// Ratio of amplitudes.
pub(super) fn amplitude(db: f64) -> f64 {
    libm::exp10(db / 20.0)
}

/// Decibels of a ratio of powers.
pub(super) fn of_power(ratio: f64) -> f64 {
    10.0 * libm::log10(ratio)
}
