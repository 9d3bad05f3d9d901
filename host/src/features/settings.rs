//! What features are made of.

use std::fmt;

use rfhoi_shared::config::RadarConfig;
use rfhoi_shared::fnv;
use serde::{Deserialize, Serialize};

use super::{FrameFeatures, VERSION};
use crate::align::{self, Angles};
use crate::aoa::{self, Method, SettingsError};

/// How the angle map is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AngleMap {
    /// Not at all: it is zero and said to be invalid.
    None,
    /// Power of a steered beam.
    Bartlett,
    /// Capon's spectrum.
    Capon,
    /// MUSIC's spectrum.
    Music,
}

impl AngleMap {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::None, Self::Bartlett, Self::Capon, Self::Music];

    fn method(self) -> Option<Method> {
        match self {
            Self::None => None,
            Self::Bartlett => Some(Method::Bartlett),
            Self::Capon => Some(Method::Capon),
            Self::Music => Some(Method::Music),
        }
    }
}

impl fmt::Display for AngleMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "none",
            Self::Bartlett => "bartlett",
            Self::Capon => "capon",
            Self::Music => "music",
        })
    }
}

/// What features are made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Settings {
    /// Points of a map each way, 16 to 256.
    pub points: usize,
    /// How the angle map is made.
    pub angles: AngleMap,
    /// Reader antennas: the first ones.
    pub antennas: usize,
    /// Whether the spatial covariance goes along.
    pub covariance: bool,
}

impl Settings {
    /// A stream that gives frames of this kind, of a bridge whose radar is configured for `radar`.
    ///
    /// # Errors
    /// If the profile's array has no angles to be mapped.
    pub fn stream(&self, radar: &RadarConfig) -> Result<align::Settings, SettingsError> {
        let angles = match self.angles.method() {
            Some(method) => Angles::Of(aoa::Settings { method, ..aoa::Settings::of(&radar.profile)? }),
            None => Angles::LeftOut,
        };
        Ok(align::Settings { points: self.points, angles, ..align::Settings::new(radar.clone()) })
    }

    /// What makes features of that stream's frames.
    pub fn frame_features(&self, radar: &RadarConfig) -> FrameFeatures {
        let virtual_antennas = self.covariance.then(|| radar.profile.virtual_count());
        FrameFeatures::new(self.antennas, virtual_antennas)
    }

    /// Of these settings and of what their features mean.
    pub fn fingerprint(&self) -> u32 {
        fnv::more(fnv::EMPTY, format!("{VERSION} {self}").as_bytes())
    }
}

/// As in names of files: `32-bartlett-4`, with `-covariance` where it goes along.
impl fmt::Display for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { points, angles, antennas, covariance } = self;
        write!(f, "{points}-{angles}-{antennas}{}", if *covariance { "-covariance" } else { "" })
    }
}
