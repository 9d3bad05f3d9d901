//! What is found in a covariance.

use super::doubt::Doubt;
use super::settings::{MAX_PEAKS, Method};

/// A direction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Direction {
    /// Degrees to the right.
    pub azimuth_deg: f32,
    /// Degrees upwards; 0 where the array has no elevation.
    pub elevation_deg: f32,
    /// Height of the map's peak.
    pub level_db: f32,
    /// Least standard deviation of the direction for what was found, degrees; infinite where that cannot be told.
    pub deviation_deg: f32,
}

impl Direction {
    pub(super) fn new(u: f64, w: f64, level_db: f32, deviation_deg: f64) -> Self {
        let elevation = w.clamp(-1.0, 1.0).asin();
        let azimuth = (u / elevation.cos().max(1e-9)).clamp(-1.0, 1.0).asin();
        Self {
            azimuth_deg: azimuth.to_degrees() as f32,
            elevation_deg: elevation.to_degrees() as f32,
            level_db,
            deviation_deg: deviation_deg as f32,
        }
    }
}

/// Directions of one covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The method whose spectrum the map is.
    pub method: Method,
    /// Number of sources that was assumed.
    pub order: u8,
    /// Gap between the eigenvalues of signal and noise, dB.
    pub gap_db: f32,
    /// Share of the signal's power that the directions do not explain, 0 to 1.
    pub mismatch: f32,
    /// Why not to trust it, if so.
    pub doubt: Option<Doubt>,
    pub(super) peaks: [Direction; MAX_PEAKS],
    pub(super) found: u8,
}

impl Estimate {
    pub(super) fn nothing(method: Method, doubt: Doubt) -> Self {
        Self {
            method,
            order: 0,
            gap_db: 0.0,
            mismatch: 0.0,
            doubt: Some(doubt),
            peaks: [Direction::default(); MAX_PEAKS],
            found: 0,
        }
    }

    /// Directions found, the highest peak first, at most [`order`](Self::order).
    pub fn peaks(&self) -> &[Direction] {
        &self.peaks[..self.found.into()]
    }
}
