//! What a scene asks of the radar and the reader, so that no more is measured than it needs.

use serde::{Deserialize, Serialize};

use crate::radar::{RadarProfile, RangeGate};
use crate::units::{Kilohertz, Metres, MetresPerSecond, Seconds};

/// Lowest carrier of the FCC's UHF RFID band, and so the longest wavelength: the phase of a tag turns slowest there.
const UHF_LOWEST: Kilohertz = Kilohertz(902_750);

/// The scene in numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Scene {
    /// From the radar to the farthest point of interest.
    pub depth: Metres,
    /// Fastest radial speed of a hand or body.
    pub fastest_hand: MetresPerSecond,
    /// Fastest radial speed of a tag that rides on a handled thing.
    pub fastest_tag: MetresPerSecond,
    /// Tags in the scene.
    pub tags: u8,
    /// Antennas of the reader.
    pub reader_antennas: u8,
}

impl Default for Scene {
    /// The paper's setting (section 4): 1 to 3 m, six candidate tags, four antennas.
    fn default() -> Self {
        Self {
            depth: Metres(3.05),
            fastest_hand: MetresPerSecond(4.0),
            fastest_tag: MetresPerSecond(1.5),
            tags: 6,
            reader_antennas: 4,
        }
    }
}

/// Which need of a scene a profile does not meet.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Unmet {
    /// The scene is deeper than the profile's range span.
    Depth {
        /// Depth of the scene.
        needed: Metres,
        /// Range span of the profile.
        span: Metres,
    },
    /// The scene's fastest hand is past the profile's unambiguous speed.
    Speed {
        /// Fastest hand of the scene.
        needed: MetresPerSecond,
        /// Unambiguous speed of the profile.
        span: MetresPerSecond,
    },
}

impl core::fmt::Display for Unmet {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Depth { needed, span } => {
                write!(f, "the scene is {:.2} m deep, the profile sees {:.2} m", needed.0, span.0)
            }
            Self::Speed { needed, span } => write!(
                f,
                "hands move at up to {:.2} m/s, the profile is unambiguous to {:.2} m/s",
                needed.0, span.0
            ),
        }
    }
}

impl core::error::Error for Unmet {}

impl Scene {
    /// Whether `profile` sees all of this scene, and the range gate that holds it.
    ///
    /// # Errors
    /// The first need that is not met.
    pub fn gate(&self, profile: &RadarProfile) -> Result<RangeGate, Unmet> {
        let span = profile.range_span();
        if self.depth > span {
            return Err(Unmet::Depth { needed: self.depth, span });
        }
        let span = profile.velocity_span();
        if self.fastest_hand > span {
            return Err(Unmet::Speed { needed: self.fastest_hand, span });
        }
        Ok(profile.gate_to(self.depth))
    }

    /// Longest time between two reads of a tag by one antenna whose phase difference has one meaning: the path
    /// there and back may change by less than half a wavelength, so t = lambda / (4 v).
    pub fn longest_read_interval(&self, channel: Option<Kilohertz>) -> Seconds {
        let wavelength = channel.unwrap_or(UHF_LOWEST).wavelength();
        Seconds(wavelength.0 / (4.0 * self.fastest_tag.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_scene_fits_the_default_profile_with_the_72_bins_of_its_gate() {
        assert_eq!(Scene::default().gate(&RadarProfile::bridge()), Ok(RangeGate { first: 0, bins: 72 }));
    }

    #[test]
    fn a_hall_does_not_fit_the_default_profile_but_fits_the_papers() {
        let hall = Scene { depth: Metres(9.0), ..Scene::default() };
        assert!(matches!(hall.gate(&RadarProfile::bridge()), Err(Unmet::Depth { .. })));
        assert!(hall.gate(&RadarProfile::paper()).is_ok());
        let fast = Scene { fastest_hand: MetresPerSecond(6.0), ..Scene::default() };
        assert!(matches!(fast.gate(&RadarProfile::paper()), Err(Unmet::Speed { .. })));
    }

    #[test]
    fn read_interval_shrinks_with_speed() {
        let scene = Scene::default();
        let slow = Scene { fastest_tag: MetresPerSecond(0.75), ..scene };
        let (fast, slow) = (scene.longest_read_interval(None).0, slow.longest_read_interval(None).0);
        assert!((fast - 0.05535).abs() < 1e-4, "{fast}");
        assert!((slow / fast - 2.0).abs() < 1e-5);
    }
}
