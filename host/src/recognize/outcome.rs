//! What is told of a time in which something moved.

use std::fmt;

use rfhoi_shared::tag::Epc;
use serde::{Serialize, Serializer};

/// What happened between two times.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recognition {
    /// When it began, s since the first packet.
    pub begin_s: f64,
    /// When it ended, s.
    pub end_s: f64,
    /// What it was.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// What happened, as far as it can be told.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum Outcome {
    /// This was done to that thing.
    Tuple(Guess),
    /// None of the actions.
    Nothing {
        /// Probability of that.
        p: f32,
    },
    /// It cannot be told.
    CannotTell {
        /// Why.
        #[serde(flatten)]
        why: Why,
        /// What it would have been, where the network was asked.
        #[serde(skip_serializing_if = "Option::is_none")]
        guess: Option<Guess>,
    },
}

/// An action on a thing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Guess {
    /// What was done.
    pub action: String,
    /// The tag.
    #[serde(serialize_with = "hex")]
    pub epc: Epc,
    /// What the tag is on, where somebody has said so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
    /// Probability of the action.
    pub p_action: f32,
    /// Probability of the tag, given that it is an action.
    pub p_target: f32,
    /// Of both.
    pub p: f32,
}

/// Why it cannot be told.
#[derive(Debug, Clone, PartialEq)]
pub enum Why {
    /// No tag has been read.
    NoTags,
    /// Tags were read before, but hardly any meanwhile.
    ReaderSilent {
        /// Share of the frames without a read.
        share: f32,
    },
    /// The radar sent too few of the frames.
    RadarMissing {
        /// Share of the frames that it did not send.
        share: f32,
    },
    /// Too many maps cannot be trusted.
    MapsInvalid {
        /// What is wrong with most of them, as a frame of both radios has it.
        reason: &'static str,
        /// Share of the frames whose range-Doppler map cannot be trusted.
        share: f32,
    },
    /// The tag that it would be was not read meanwhile.
    TargetUnread,
    /// Nothing is probable enough.
    LowProbability {
        /// Probability of the best guess.
        p: f32,
        /// Probability that is asked for.
        least: f32,
    },
    /// The frames began or ended within it.
    TooShort {
        /// How long something moved, s.
        moved_s: f32,
    },
}

impl Why {
    /// The reason as one word in snake case.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::NoTags => "no_tags",
            Self::ReaderSilent { .. } => "reader_silent",
            Self::RadarMissing { .. } => "radar_missing",
            Self::MapsInvalid { .. } => "maps_invalid",
            Self::TargetUnread => "target_unread",
            Self::LowProbability { .. } => "low_probability",
            Self::TooShort { .. } => "too_short",
        }
    }
}

/// Percent.
fn percent(share: f32) -> f32 {
    (100.0 * share).round()
}

impl fmt::Display for Why {
    /// A sentence that says what to do.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoTags => f.write_str(
                "no tag has been read: check that the reader runs, that things bear tags, and that --tags lists them",
            ),
            Self::ReaderSilent { share } => write!(
                f,
                "no tag was read in {} % of the frames: check the reader, its antennas and what stands before them",
                percent(*share)
            ),
            Self::RadarMissing { share } => write!(
                f,
                "the radar did not send {} % of the frames: check its cable, and with `rfhoi inspect` what was lost",
                percent(*share)
            ),
            Self::MapsInvalid { reason, share } => write!(
                f,
                "{} % of the frames have maps that cannot be trusted ({reason}): {}",
                percent(*share),
                advice(reason)
            ),
            Self::TargetUnread => {
                f.write_str("the tag that it would be was not read meanwhile: bring an antenna closer to it")
            }
            Self::LowProbability { p, least } => {
                write!(f, "nothing is probable enough ({p:.2}, {least:.2} is asked for): repeat it, or ask for less with --least")
            }
            Self::TooShort { moved_s } => {
                write!(f, "only {moved_s:.1} s of it are there: record longer before and after")
            }
        }
    }
}

/// What to do where most maps are wrong for `reason`.
fn advice(reason: &str) -> &'static str {
    match reason {
        "rows_missing" | "missing" | "unaccounted" => {
            "packets are lost between bridge and host; use a cable or a free channel"
        }
        "chirps_lost" => "datagrams are lost between recorder and bridge; check that cable",
        "clipped" => "the signal is too strong; move the radar away from what is near, or lower its gain",
        "velocity_aliased" => "it is too fast for the radar's profile",
        "shape" | "other_profile" => {
            "the bridge is configured for something else; configure it for the model's profile"
        }
        _ => "nothing rises over the noise; point the radar at the people",
    }
}

impl Serialize for Why {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Said {
            reason: &'static str,
            why: String,
            #[serde(skip_serializing_if = "Option::is_none")]
            share: Option<f32>,
        }
        let share = match self {
            Self::ReaderSilent { share } | Self::RadarMissing { share } | Self::MapsInvalid { share, .. } => {
                Some(*share)
            }
            _ => None,
        };
        Said { reason: self.reason(), why: self.to_string(), share }.serialize(serializer)
    }
}

fn hex<S: Serializer>(epc: &Epc, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(epc)
}

impl fmt::Display for Guess {
    /// As `<pick up, book>`; a tag without a name by its EPC.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.object {
            Some(object) => write!(f, "<{}, {object}>", self.action),
            None => write!(f, "<{}, {}>", self.action, self.epc),
        }
    }
}
