//! A frame of both radios.

use rfhoi_shared::units::BridgeTime;
use rfhoi_shared::wire::Covariance;

use crate::aoa::{Doubt, Estimate};
use crate::maps::Flaw;
use crate::phase::{Invalid, PhaseFrame, Sighting};

/// Maps of a frame.
pub const MAPS: usize = 3;

/// Which map of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MapName {
    /// Row: range, near to far. Column: time within the frame, oldest first.
    RangeTime,
    /// Row: range, near to far. Column: velocity, approaching to receding.
    RangeDoppler,
    /// Row: elevation, rising. Column: azimuth, left to right.
    Angle,
}

impl MapName {
    /// All maps, in the order in which a frame holds them.
    pub const ALL: [Self; MAPS] = [Self::RangeTime, Self::RangeDoppler, Self::Angle];
}

/// What is wrong with a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MapInvalid {
    /// The map itself.
    Flaw(Flaw),
    /// Directions in it are not to be trusted.
    Doubt(Doubt),
    /// The strongest echo is faster than the profile can tell: its velocity is folded, and directions are wrong.
    Folded,
    /// The bridge runs another profile.
    OtherProfile,
    /// Nobody asked for it.
    LeftOut,
}

impl MapInvalid {
    /// The reason as one word in snake case.
    pub fn reason(self) -> &'static str {
        match self {
            Self::Flaw(flaw) => flaw.reason(),
            Self::Doubt(doubt) => doubt.reason(),
            Self::Folded => "velocity_aliased",
            Self::OtherProfile => "other_profile",
            Self::LeftOut => "left_out",
        }
    }
}

/// A frame of both radios: what the network takes.
#[derive(Debug, Clone, PartialEq)]
pub struct AlignedFrame {
    /// The radar's number of the frame, or what it would have been.
    pub number: u32,
    /// When it begins.
    pub begin: BridgeTime,
    /// When it ends, and the next begins.
    pub end: BridgeTime,
    /// Points of a map each way.
    pub points: usize,
    /// Whether the radar sent anything of it.
    pub sent: bool,
    /// Range-Doppler cells that moved, where the bridge's account of the frame came.
    pub moving_cells: Option<u32>,
    /// Strongest cell of the range-Doppler map over its floor, dB, where there is a map.
    pub peak_db: Option<f32>,
    /// Spatial covariance of what moves, where it came.
    pub covariance: Option<Covariance>,
    /// Directions of what moves, where the covariance came and angles are not left out.
    pub estimate: Option<Estimate>,
    pub(super) maps: [Vec<f32>; MAPS],
    pub(super) invalid: [Option<MapInvalid>; MAPS],
    pub(super) phases: PhaseFrame,
}

impl AlignedFrame {
    pub(super) fn empty(points: usize, phases: PhaseFrame) -> Self {
        let begin = BridgeTime::default();
        Self {
            number: 0,
            begin,
            end: begin,
            points,
            sent: false,
            moving_cells: None,
            peak_db: None,
            covariance: None,
            estimate: None,
            maps: std::array::from_fn(|_| vec![0.0; points * points]),
            invalid: [None; MAPS],
            phases,
        }
    }

    /// A map: `points x points` values from 0 to 1, row by row; zeros where there is none. Whether to trust it tells
    /// [`Self::invalid`].
    pub fn map(&self, name: MapName) -> &[f32] {
        &self.maps[name as usize]
    }

    /// What is wrong with a map, if anything.
    pub fn invalid(&self, name: MapName) -> Option<MapInvalid> {
        self.invalid[name as usize]
    }

    /// Phase differences of tags over the frame, by tag and antenna, or why there are none.
    pub fn phases(&self) -> &PhaseFrame {
        &self.phases
    }

    /// Phase difference of one tag at one antenna (from 0), radians, positive where the path grew.
    ///
    /// # Errors
    /// Why it is not known.
    pub fn phase(&self, tag: usize, antenna: usize) -> Result<f32, Invalid> {
        self.phases.tag(tag).get(antenna).copied().unwrap_or(Err(Invalid::NeverSeen))
    }

    /// What the reads of one tag by one antenna (from 0) tell as they are.
    pub fn sighting(&self, tag: usize, antenna: usize) -> Sighting {
        let sightings = self.phases.sightings().chunks_exact(self.phases.antennas()).nth(tag);
        sightings.and_then(|of_tag| of_tag.get(antenna)).copied().unwrap_or_default()
    }
}
