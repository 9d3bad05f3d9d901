//! Radar profiles from what a user has: a name, a CLI profile, mmWave Studio's log, or single numbers.

use std::path::{Path, PathBuf};

use rfhoi_firmware::mmwave::TextError;
use rfhoi_firmware::mmwave::cfg::{self, Board, CliProfile, DemoOptions, LvdsStream};
use rfhoi_firmware::mmwave::studio::StudioProfile;
use rfhoi_shared::array::{AntennaArray, Mounting};
use rfhoi_shared::radar::{IqOrder, MAX_TX_SLOTS, ProfileError, RadarProfile, SampleFormat};
use serde::{Deserialize, Serialize};

/// Names that [`RadarProfile::named`] knows.
pub const NAMES: [&str; 3] = ["paper", "fine", "bridge"];

/// Boards as users name them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "documented at AntennaArray")]
pub enum BoardName {
    Awr1843aop,
    Xwr1843boost,
    Xwr1642boost,
    Iwr6843aop,
}

impl From<BoardName> for AntennaArray {
    fn from(name: BoardName) -> Self {
        match name {
            BoardName::Awr1843aop => Self::Awr1843Aop,
            BoardName::Xwr1843boost => Self::Xwr1843Boost,
            BoardName::Xwr1642boost => Self::Xwr1642Boost,
            BoardName::Iwr6843aop => Self::Iwr6843Aop,
        }
    }
}

impl From<AntennaArray> for BoardName {
    fn from(array: AntennaArray) -> Self {
        match array {
            AntennaArray::Awr1843Aop => Self::Awr1843aop,
            AntennaArray::Xwr1843Boost => Self::Xwr1843boost,
            AntennaArray::Xwr1642Boost => Self::Xwr1642boost,
            AntennaArray::Iwr6843Aop => Self::Iwr6843aop,
        }
    }
}

/// Mountings by their quarter turns, clockwise as seen from behind the board.
pub const MOUNTINGS: [Mounting; 4] =
    [Mounting::Upright, Mounting::Quarter, Mounting::Half, Mounting::ThreeQuarters];

/// Why there is no profile.
#[derive(Debug, thiserror::Error)]
pub enum ProfileFileError {
    /// The file cannot be read.
    #[error(
        "cannot read the radar profile {path}: {source}; give a .cfg file, a mmWave Studio log, or one of the names paper, fine, bridge"
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file does not parse.
    #[error("{path}: {error}")]
    Text {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        error: TextError,
    },
    /// The options do not make a valid profile.
    #[error(
        "the radar profile does not hold together: {0}; correct the profile or the options that change it"
    )]
    Options(#[from] ProfileError),
    /// More transmitters than a loop has slots.
    #[error("{0} transmitters: a loop has 1 to {MAX_TX_SLOTS} chirps")]
    Transmitters(u8),
    /// More receivers than a radar has.
    #[error("{0} receivers: a radar has 1 to 4")]
    Receivers(u8),
}

/// Numbers that replace those of a profile.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Changes {
    /// Samples of a chirp.
    pub samples: Option<u16>,
    /// Loops of a frame.
    pub loops: Option<u16>,
    /// Receivers, the first ones of the board.
    pub receivers: Option<u8>,
    /// Transmitters in TDM, the first ones of the board.
    pub transmitters: Option<u8>,
    /// Sample rate, ksps.
    pub sample_rate_ksps: Option<u32>,
    /// Slope, MHz/us.
    pub slope_mhz_us: Option<f64>,
    /// Frame period, ms.
    pub frame_ms: Option<f64>,
    /// Order of the words of complex samples.
    pub iq: Option<IqOrder>,
    /// Real samples.
    pub real: bool,
}

/// The profile that `source` names: `paper`, `fine` or `bridge`, or else the path of a CLI profile or of mmWave
/// Studio's log.
///
/// # Errors
/// If the file cannot be read or does not parse.
pub fn load(source: &str, board: Board) -> Result<RadarProfile, ProfileFileError> {
    if let Some(profile) = RadarProfile::named(source) {
        return Ok(RadarProfile { array: board.array, mounting: board.mounting, ..profile });
    }
    let path = Path::new(source);
    let text = std::fs::read_to_string(path)
        .map_err(|source| ProfileFileError::Read { path: path.to_path_buf(), source })?;
    let parsed = if text.contains("API:ProfileConfig") {
        StudioProfile::parse(&text, board).map(|p| p.radar)
    } else {
        CliProfile::parse(&text, board).map(|p| p.radar)
    };
    parsed.map_err(|error| ProfileFileError::Text { path: path.to_path_buf(), error })
}

/// `profile` as a CLI profile of the stock demo with raw samples on LVDS, which [`load`] reads; `None` where it cannot be said so.
pub fn text(profile: &RadarProfile) -> Option<String> {
    let demo = DemoOptions { lvds: LvdsStream::RAW, ..DemoOptions::default() };
    let mut text = String::new();
    cfg::write(profile, &demo, &mut text).ok().map(|_| text)
}

impl Changes {
    /// `profile` with these numbers. Where the chirps no longer fit, the ramp is lengthened for the samples and the
    /// frame period for the chirps: both are known from the recording itself.
    ///
    /// # Errors
    /// If the result is not valid.
    pub fn apply(&self, mut profile: RadarProfile) -> Result<RadarProfile, ProfileFileError> {
        if let Some(samples) = self.samples {
            profile.samples = samples;
        }
        if let Some(loops) = self.loops {
            profile.loops = loops;
        }
        if let Some(n) = self.receivers {
            profile.rx_mask =
                1u8.checked_shl(n.into()).filter(|_| n <= 4).ok_or(ProfileFileError::Receivers(n))? - 1;
        }
        if let Some(n) = self.transmitters {
            if usize::from(n) > MAX_TX_SLOTS {
                return Err(ProfileFileError::Transmitters(n));
            }
            profile.tx_order = (0..n).map(|i| 1 << i).collect();
        }
        if let Some(rate) = self.sample_rate_ksps {
            profile.sample_rate_ksps = rate;
        }
        if let Some(slope) = self.slope_mhz_us {
            profile.slope_khz_per_us = (slope * 1e3).round() as u32;
        }
        if self.real {
            profile.format = SampleFormat::Real;
        }
        if let Some(iq) = self.iq {
            profile.format = SampleFormat::Complex(iq);
        }
        if self.samples.is_some() || self.sample_rate_ksps.is_some() {
            let sampling_ns =
                u64::from(profile.samples) * 1_000_000 / u64::from(profile.sample_rate_ksps.max(1));
            let end_ns = u32::try_from(sampling_ns + u64::from(profile.adc_start_ns)).unwrap_or(u32::MAX);
            profile.ramp_end_ns = profile.ramp_end_ns.max(end_ns);
        }
        if let Some(ms) = self.frame_ms {
            profile.frame_period_us = (ms * 1e3).round() as u32;
        } else if self.loops.is_some() || self.transmitters.is_some() {
            let active_us = profile.chirp_period_ns() * u64::from(profile.chirps_per_frame()) / 1_000;
            let needed_us = u32::try_from(active_us * 100 / 99 + 1).unwrap_or(u32::MAX);
            profile.frame_period_us = profile.frame_period_us.max(needed_us);
        }
        profile.validate()?;
        Ok(profile)
    }
}

/// `profile` with `loops` frames of one loop taken as the slow time of one frame: for recordings with one chirp a
/// frame, whose motion is seen from frame to frame.
pub fn regroup(profile: &RadarProfile, loops: u16) -> Result<RadarProfile, ProfileFileError> {
    let chirp_period_ns =
        u64::from(profile.frame_period_us) * 1_000 / u64::from(profile.chirps_per_frame().max(1));
    let idle_ns = chirp_period_ns.saturating_sub(u64::from(profile.ramp_end_ns));
    let frames = u32::from(loops) / u32::from(profile.loops.max(1));
    let grouped = RadarProfile {
        loops,
        idle_ns: u32::try_from(idle_ns).unwrap_or(u32::MAX),
        // The frames follow each other without a pause, of which a valid profile keeps a hundredth.
        frame_period_us: profile.frame_period_us.saturating_mul(frames).saturating_mul(100) / 98,
        ..profile.clone()
    };
    grouped.validate()?;
    Ok(grouped)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_names_are_known_and_boards_named_both_ways() {
        assert!(NAMES.into_iter().all(|name| RadarProfile::named(name).is_some()));
        for name in <BoardName as clap::ValueEnum>::value_variants() {
            assert_eq!(BoardName::from(AntennaArray::from(*name)), *name);
        }
    }

    #[test]
    fn names_and_changes() {
        let profile = load("bridge", Board::default()).unwrap();
        assert_eq!(profile, RadarProfile::bridge());
        let changes =
            Changes { samples: Some(256), receivers: Some(2), transmitters: Some(1), ..Changes::default() };
        let changed = changes.apply(profile.clone()).unwrap();
        assert_eq!((changed.samples, changed.rx_count(), changed.tx_slots()), (256, 2, 1));
        assert!(changed.ramp_end_ns > profile.ramp_end_ns, "the ramp grew with the samples");
        let wrong = Changes { samples: Some(100), ..Changes::default() };
        assert!(matches!(
            wrong.apply(profile.clone()),
            Err(ProfileFileError::Options(ProfileError::Samples(100)))
        ));
        let wrong = Changes { receivers: Some(9), ..Changes::default() };
        assert!(matches!(wrong.apply(profile), Err(ProfileFileError::Receivers(9))));
    }

    #[test]
    fn files_that_are_not_there_name_the_choices() {
        let error = load("nowhere.cfg", Board::default()).unwrap_err().to_string();
        assert!(error.contains("nowhere.cfg") && error.contains("paper, fine, bridge"), "{error}");
    }

    #[test]
    fn regrouping_keeps_the_time_between_chirps() {
        let one = RadarProfile {
            loops: 1,
            tx_order: [1].into_iter().collect(),
            frame_period_us: 1_000,
            ..RadarProfile::bridge()
        };
        let grouped = regroup(&one, 64).unwrap();
        assert_eq!((grouped.loops, grouped.chirp_period_ns()), (64, 1_000_000));
    }
}
