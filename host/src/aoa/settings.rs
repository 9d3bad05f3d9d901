//! What an estimator is asked to do.

use std::fmt;

use rfhoi_shared::radar::RadarProfile;

use super::geometry::Geometry;

/// Directions of one estimate, at most.
pub const MAX_PEAKS: usize = 5;

/// How a spectrum over directions is made of a covariance R, with steering vectors a of N antennas.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// Power of a beam steered there: `a^H R a / N^2`.
    Bartlett,
    /// Least power that lets the direction through unchanged: `1 / (a^H R^-1 a)` (Capon 1969).
    Capon,
    /// Distance from the noise subspace: `N / (a^H (I - Us Us^H) a)` (Schmidt 1986). No power: 0 dB is the least.
    Music,
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bartlett => "Bartlett",
            Self::Capon => "Capon",
            Self::Music => "MUSIC",
        })
    }
}

/// How many sources there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// So many, whatever the eigenvalues say.
    Fixed(usize),
    /// Minimum description length (Wax and Kailath 1985).
    Mdl,
    /// Akaike's criterion (Wax and Kailath 1985): finds weaker sources, and some that are none.
    Aic,
}

/// A rectangle of antennas, half a wavelength apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Subarray {
    /// Antennas to the right.
    pub columns: u8,
    /// Antennas upwards.
    pub rows: u8,
}

/// From where on an answer is not to be trusted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guards {
    /// Independent snapshots for each antenna that a subspace needs, twice as many with forward-backward averaging; with fewer
    /// the answer is Bartlett's.
    pub snapshots_per_antenna: f64,
    /// Least gap between the eigenvalues of signal and noise, dB; below, the answer is Bartlett's and doubted.
    pub gap_db: f64,
    /// Largest standard deviation of a direction, degrees, by the stochastic Cramer-Rao bound of what was found.
    pub deviation_deg: f64,
    /// Largest distance of a direction from where the likelihood is largest, degrees: Bartlett's and Capon's peaks are drawn to
    /// other sources.
    pub drift_deg: f64,
    /// Least height of a peak of MUSIC, dB: a tenth of a steering vector may be out of the signal subspace.
    pub peak_db: f32,
    /// Largest share of the signal's power that the directions found do not explain, beyond what noise does. Phase errors of
    /// the antennas of e radians leave about e^2.
    pub mismatch: f64,
    /// Eigenvalues so far below the largest are no sources, dB: antennas with phase errors of e radians make such of one
    /// source, about e^2 / 2 of it.
    pub dynamic_range_db: f64,
    /// The last peak that counts must be so much higher than the first that does not, dB.
    pub margin_db: f32,
}

impl Default for Guards {
    fn default() -> Self {
        Self {
            snapshots_per_antenna: 1.5,
            gap_db: 3.0,
            deviation_deg: 1.5,
            drift_deg: 2.0,
            peak_db: 10.0,
            mismatch: 0.02,
            dynamic_range_db: 20.0,
            margin_db: 3.0,
        }
    }
}

/// What an [`Estimator`](super::Estimator) does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The spectrum.
    pub method: Method,
    /// Points of the grid each way, 16 to 256.
    pub points: usize,
    /// The grid is from minus to plus this, degrees, 1 to 85.
    pub half_span_deg: f32,
    /// Averages forward and backward: of one snapshot two, and of two coherent sources often two. For centro-symmetric
    /// arrays only. Changes nothing in Bartlett's spectrum.
    pub forward_backward: bool,
    /// Averages over all places of a rectangle in the array: coherent sources come apart, for less aperture.
    pub smoothing: Option<Subarray>,
    /// Added to every eigenvalue, relative to their mean. Capon cannot do without where snapshots are few.
    pub loading: f64,
    /// How many sources there are.
    pub order: Order,
    /// Sources at most, 1 to [`MAX_PEAKS`], and less than the antennas of the array or subarray.
    pub largest_order: usize,
    /// Independent snapshots for each cell of the covariance. Two Hann windows have 1.5 bins of noise bandwidth each, so that
    /// neighbouring range-Doppler cells share noise: 1 / 1.5^2.
    pub snapshots_per_cell: f64,
    /// When to doubt; `None` gives every answer as it comes.
    pub guards: Option<Guards>,
}

impl Default for Settings {
    /// For the AWR1843AOP's full rectangle; [`Settings::of`] knows other arrays.
    fn default() -> Self {
        Self {
            method: Method::Music,
            points: 64,
            half_span_deg: 60.0,
            forward_backward: true,
            smoothing: None,
            loading: 1e-3,
            order: Order::Mdl,
            largest_order: 3,
            snapshots_per_cell: 1.0 / 2.25,
            guards: Some(Guards::default()),
        }
    }
}

impl Settings {
    /// Bartlett's spectrum as it comes, with `points` each way.
    pub fn bartlett(points: usize) -> Self {
        let method = Method::Bartlett;
        Self { method, points, forward_backward: false, guards: None, ..Self::default() }
    }

    /// The default for the array of `profile`: with forward-backward averaging where it is centro-symmetric.
    ///
    /// # Errors
    /// If the array has no geometry, or no azimuth.
    pub fn of(profile: &RadarProfile) -> Result<Self, SettingsError> {
        let symmetric = Geometry::of(profile)?.opposite.is_some();
        Ok(Self { forward_backward: symmetric, ..Self::default() })
    }

    pub(super) fn validate(&self, antennas: usize) -> Result<(), SettingsError> {
        let ranges = [
            ("points", self.points as f64, 16.0, 256.0),
            ("half span", self.half_span_deg.into(), 1.0, 85.0),
            ("loading", self.loading, 0.0, 1.0),
            ("snapshots per cell", self.snapshots_per_cell, 0.01, 1.0),
            ("largest order", self.largest_order as f64, 1.0, MAX_PEAKS.min(antennas - 1) as f64),
        ];
        for (name, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                return Err(SettingsError::Range { name, value, least, most });
            }
        }
        Ok(())
    }
}

/// Why there is no estimator.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// The profile's transmitters.
    #[error(
        "the geometry is not defined: a slot with several transmitters, or one that the board does not have"
    )]
    NoGeometry,
    /// All antennas above each other.
    #[error(
        "the antennas are on a vertical line, or in one place: no azimuth; turn the board or use more of them"
    )]
    NoAzimuth,
    /// Forward-backward averaging needs symmetry.
    #[error("forward-backward averaging needs an array that is symmetric about its centre; this one is not")]
    NotSymmetric,
    /// The array does not fill the subarray.
    #[error("no place in the array fills a subarray of {0} x {1} antennas, two or more of them to the right")]
    NoSubarray(u8, u8),
    /// A number is out of range.
    #[error("{name} is {value}, must be from {least} to {most}")]
    Range {
        /// Which.
        name: &'static str,
        /// What it is.
        value: f64,
        /// Lower limit.
        least: f64,
        /// Upper limit.
        most: f64,
    },
}
