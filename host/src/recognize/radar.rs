//! What a model needs the radar to be configured for, and whether it is.

use std::fmt;

use rfhoi_network::model::Description;
use rfhoi_shared::config::{Processing, RadarConfig, RadarInput};
use rfhoi_shared::radar::{RadarProfile, RangeGate};
use serde::Deserialize;

use super::RecognizeError;
use crate::profile::NAMES;
use crate::receive::{HeatMap, RadarFrame};

/// Relative difference of lengths and speeds that is none.
const TOLERANCE: f64 = 1e-3;

/// The radar's maps that a model was trained on, as a data set's manifest describes them.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Maps {
    profile_fingerprint: u32,
    frame_period_us: u32,
    first_range_bin: u16,
    range_bins: u16,
    range_bin_m: f64,
    doppler_bins: u16,
    velocity_bin_m_s: f64,
    range_time_columns: u16,
    virtual_antennas: usize,
}

/// What the radar sends is not what the model was trained on.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct Mismatch {
    /// What differs: trained with, and here.
    differences: Vec<String>,
    /// Name of the profile that the model was trained with, where it has one.
    profile: Option<&'static str>,
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the model was trained for another radar profile: {}; ", self.differences.join(", "))?;
        match self.profile {
            Some(name) => write!(
                f,
                "record with the profile `{name}` (`rfhoi bridge config` writes it), or give a model that was trained for this one \
                 with --model"
            ),
            None => f.write_str(
                "record with the profile of its training data, or give another model with --model",
            ),
        }
    }
}

impl Maps {
    /// Those of a model.
    ///
    /// # Errors
    /// If it does not say.
    pub fn of(description: &Description) -> Result<Self, RecognizeError> {
        Self::deserialize(&description.maps)
            .map_err(|error| RecognizeError::Description(format!("maps are not described ({error})")))
    }

    /// What the radar's virtual antennas are.
    pub fn virtual_antennas(&self) -> usize {
        self.virtual_antennas
    }

    /// The configuration that sends such maps, with `profile` or else with one that has a name.
    ///
    /// # Errors
    /// If `profile` is another one, or none is given and it has no name.
    pub fn config(&self, profile: Option<&RadarProfile>) -> Result<RadarConfig, RecognizeError> {
        let profile = match profile {
            Some(profile) if profile.fingerprint() == self.profile_fingerprint => profile.clone(),
            Some(profile) => return Err(self.mismatch(self.differences(profile)).into()),
            None => self.named().and_then(RadarProfile::named).ok_or_else(|| {
                RecognizeError::Description("profile has no name here: give it with --profile".to_owned())
            })?,
        };
        let processing = Processing {
            range_time_columns: self.range_time_columns,
            ..Processing::with_gate(&profile, self.gate())
        };
        Ok(RadarConfig { profile, input: RadarInput::Uart, processing })
    }

    /// Checks what a bridge sent.
    ///
    /// # Errors
    /// If its radar is configured for something else.
    pub fn check(&self, frame: &RadarFrame) -> Result<(), Mismatch> {
        let mut differences = Vec::new();
        if let Some(there) =
            frame.info.map(|info| info.profile).filter(|&there| there != self.profile_fingerprint)
        {
            let known = NAMES.into_iter().find_map(|name| {
                RadarProfile::named(name)
                    .filter(|profile| profile.fingerprint() == there)
                    .map(|profile| (name, profile))
            });
            match known {
                Some((name, profile)) => {
                    differences.push(format!("the bridge runs `{name}`"));
                    differences.extend(self.differences(&profile));
                }
                None => differences.push(format!(
                    "the bridge runs a profile with fingerprint {there:08x}, the model's is {:08x}",
                    self.profile_fingerprint
                )),
            }
        }
        let mut map = |map: &Option<HeatMap>, name: &str, columns: u16| {
            let Some(map) = map else { return };
            if map.gate != self.gate() {
                differences.push(format!("{} instead of {}", bins(map.gate), bins(self.gate())));
            } else if map.columns != usize::from(columns) {
                differences.push(format!("{} columns of the {name} map instead of {columns}", map.columns));
            }
        };
        map(&frame.range_doppler, "range-Doppler", self.doppler_bins);
        map(&frame.range_time, "range-time", self.range_time_columns);
        differences.dedup();
        if differences.is_empty() { Ok(()) } else { Err(self.mismatch(differences)) }
    }

    fn gate(&self) -> RangeGate {
        RangeGate { first: self.first_range_bin, bins: self.range_bins }
    }

    fn named(&self) -> Option<&'static str> {
        let is_it = |name: &&str| {
            RadarProfile::named(name).is_some_and(|profile| profile.fingerprint() == self.profile_fingerprint)
        };
        NAMES.into_iter().find(is_it)
    }

    fn mismatch(&self, differences: Vec<String>) -> Mismatch {
        Mismatch { differences, profile: self.named() }
    }

    /// What is different in `profile`.
    fn differences(&self, profile: &RadarProfile) -> Vec<String> {
        let mut all = Vec::new();
        let mut near = |what: &str, unit: &str, here: f64, trained: f64| {
            if (here - trained).abs() > TOLERANCE * trained.abs() {
                all.push(format!("{what} {here:.3} {unit} instead of {trained:.3} {unit}"));
            }
        };
        near("a range bin is", "m", profile.range_bin().0.into(), self.range_bin_m);
        near("a velocity bin is", "m/s", profile.velocity_bin().0.into(), self.velocity_bin_m_s);
        near(
            "the frame period is",
            "ms",
            f64::from(profile.frame_period_us) / 1e3,
            f64::from(self.frame_period_us) / 1e3,
        );
        let mut same = |what: &str, here: usize, trained: usize| {
            if here != trained {
                all.push(format!("{here} {what} instead of {trained}"));
            }
        };
        same("Doppler bins", profile.loops.into(), self.doppler_bins.into());
        same("virtual antennas", profile.virtual_count(), self.virtual_antennas);
        if profile.range_bins() < self.first_range_bin + self.range_bins {
            all.push(format!(
                "{} range bins, of which {} are needed",
                profile.range_bins(),
                self.first_range_bin + self.range_bins
            ));
        }
        if all.is_empty() {
            all.push("its antennas, its mounting or the timing of its chirps".to_owned());
        }
        all
    }
}

fn bins(gate: RangeGate) -> String {
    format!("range bins {} to {}", gate.first, (gate.first + gate.bins).saturating_sub(1))
}
